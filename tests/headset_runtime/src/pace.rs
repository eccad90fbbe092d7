//! The pace of frames: when they begin, which were late, and their data for GetFrameTiming.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Frames that GetFrameTiming remembers, as SteamVR does.
const REMEMBERED: usize = 128;

/// One past frame, as GetFrameTiming reports it.
#[derive(Clone, Copy, Default)]
pub struct PastFrame {
    pub frame: u64,
    pub presents: u32,
    pub dropped: u32,
    pub reprojection_flags: u32,
    pub interval_ms: f32,
}

/// When frames begin, and which came too late.
pub struct Pace {
    pub hz: f32,
    period: Option<Duration>,
    started: Instant,
    vsync: Instant,
    past: VecDeque<PastFrame>,
    pub presents: u32,
    pub dropped: u32,
    pub reprojected: u32,
}

impl Pace {
    /// Of a display with a frequency, whose frames may be waited for.
    pub fn new(hz: f32, is_paced: bool) -> Self {
        let period = is_paced.then(|| Duration::from_secs_f32(1.0 / hz));
        let now = Instant::now();
        let past = VecDeque::with_capacity(REMEMBERED);
        Self { hz, period, started: now, vsync: now, past, presents: 0, dropped: 0, reprojected: 0 }
    }

    /// Since the start.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// The frame that many frames ago, or the oldest that is remembered.
    pub fn ago(&self, frames: usize) -> Option<PastFrame> {
        let newest = self.past.len().checked_sub(1)?;
        self.past.get(newest.saturating_sub(frames)).copied()
    }

    pub fn seconds_since_vsync(&self) -> f32 {
        self.vsync.elapsed().as_secs_f32()
    }

    /// The next vsync, and how many have been missed since the last frame began.
    pub fn next_vsync(&self, now: Instant) -> (Instant, u32) {
        let Some(period) = self.period else { return (now, 0) };
        let mut next = self.vsync + period;
        let mut missed = 0;
        while next < now {
            next += period;
            missed += 1;
        }
        (next, missed)
    }

    /// Takes up a frame that begins at `vsync`.
    pub fn begin(&mut self, frame: PastFrame, vsync: Instant) {
        let interval_ms = (vsync - self.vsync).as_secs_f32() * 1e3;
        self.vsync = vsync;
        if self.past.len() == REMEMBERED {
            self.past.pop_front();
        }
        self.presents += frame.presents;
        self.dropped += frame.dropped;
        self.reprojected += u32::from(frame.presents > 1);
        self.past.push_back(PastFrame { interval_ms, ..frame });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vsyncs_keep_their_period_and_late_frames_miss_some() {
        let pace = Pace::new(100.0, true);
        let after = |ms| pace.next_vsync(pace.vsync + Duration::from_millis(ms));
        for (ms, next_ms, missed) in [(3, 10, 0), (12, 20, 1), (35, 40, 3)] {
            let (next, count) = after(ms);
            assert_eq!(((next - pace.vsync).as_secs_f32() * 1e3).round(), next_ms as f32, "after {ms} ms");
            assert_eq!(count, missed, "after {ms} ms");
        }
    }

    #[test]
    fn only_so_many_frames_are_remembered() {
        let mut pace = Pace::new(90.0, false);
        assert!(pace.ago(0).is_none());
        for frame in 1..=200 {
            pace.begin(PastFrame { frame, presents: 1, ..PastFrame::default() }, Instant::now());
        }
        let frame = |ago| pace.ago(ago).expect("a frame").frame;
        assert_eq!([frame(0), frame(1), frame(1000)], [200, 199, 73]);
    }
}
