//! Frame times: the time step of the running frame, and averages for the display.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::gpu::PassTime;

/// The averaging period.
const PERIOD: Duration = Duration::from_millis(500);
/// The longest time step; after a stall, movement continues from where it was.
const LONGEST_STEP: Duration = Duration::from_millis(100);

/// Frames whose own times are kept.
pub const RECENT: usize = 120;

/// Milliseconds since a moment.
pub fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Averages over the last period.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    pub frames_per_second: f64,
    /// Wall time from frame to frame.
    pub frame_ms: f64,
    /// Processor time of recording and submitting.
    pub record_ms: f64,
    /// GPU time from the first pass's start to the last one's end; `None` until the first has come back.
    pub gpu_ms: Option<f64>,
    /// GPU time of each pass.
    pub passes: Vec<PassTime>,
}

/// Measures frame times; called once per frame.
#[derive(Default)]
pub struct FrameClock {
    last: Option<Instant>,
    frames: u32,
    time: Duration,
    recording: Duration,
    recorded: u32,
    /// Sums and the number of frames.
    passes: Vec<(PassTime, u32)>,
    gpu: (f64, u32),
    rate: Option<Rate>,
    recent: VecDeque<f32>,
}

impl FrameClock {
    /// A frame begins; returns seconds since the one before, 0 for the first after a pause.
    pub fn tick(&mut self, now: Instant) -> f32 {
        let Some(last) = self.last.replace(now) else { return 0.0 };
        let step = now.saturating_duration_since(last);
        self.frames += 1;
        self.time += step;
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(1e3 * step.as_secs_f32());
        if self.time >= PERIOD {
            self.finish_period();
        }
        step.min(LONGEST_STEP).as_secs_f32()
    }

    /// Pauses: time until the next frame does not count.
    pub fn pause(&mut self) {
        self.last = None;
    }

    /// Notes the GPU times of one finished frame: of each pass, and of the whole.
    pub fn add_gpu(&mut self, times: &[PassTime], total_ms: f64) {
        if !times.is_empty() {
            self.gpu = (self.gpu.0 + total_ms, self.gpu.1 + 1);
        }
        for time in times {
            match self.passes.iter_mut().find(|(sum, _)| sum.name == time.name) {
                Some((sum, count)) => (sum.ms, *count) = (sum.ms + time.ms, *count + 1),
                None => self.passes.push((*time, 1)),
            }
        }
    }

    /// Notes the processor time that recording and submitting one frame took.
    pub fn add_recording(&mut self, time: Duration) {
        self.recording += time;
        self.recorded += 1;
    }

    /// The last [`RECENT`] frames' times, milliseconds, newest first.
    pub fn recent(&self) -> impl ExactSizeIterator<Item = f32> {
        self.recent.iter().copied()
    }

    /// The last full period's averages.
    pub fn rate(&self) -> Option<&Rate> {
        self.rate.as_ref()
    }

    fn finish_period(&mut self) {
        let seconds = self.time.as_secs_f64();
        let frames = f64::from(self.frames);
        let mean = |(sum, count): (PassTime, u32)| PassTime { ms: sum.ms / f64::from(count), ..sum };
        let (gpu_ms, gpu_frames) = std::mem::take(&mut self.gpu);
        self.rate = Some(Rate {
            frames_per_second: frames / seconds,
            frame_ms: 1e3 * seconds / frames,
            record_ms: 1e3 * self.recording.as_secs_f64() / f64::from(self.recorded.max(1)),
            gpu_ms: (gpu_frames > 0).then(|| gpu_ms / f64::from(gpu_frames)),
            passes: self.passes.drain(..).map(mean).collect(),
        });
        (self.frames, self.time) = (0, Duration::ZERO);
        (self.recorded, self.recording) = (0, Duration::ZERO);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(name: &'static str, ms: f64) -> PassTime {
        PassTime { name, ms }
    }

    #[test]
    fn a_steady_rate_is_reported_with_its_gpu_times() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        for frame in 0..=50 {
            let step = clock.tick(start + Duration::from_millis(20 * frame));
            assert!((step - if frame == 0 { 0.0 } else { 0.02 }).abs() < 1e-6);
            clock.add_recording(Duration::from_micros(400 + frame % 2 * 200));
            // Half a millisecond lies between the passes.
            let scene = if frame % 2 == 0 { 2.0 } else { 4.0 };
            clock.add_gpu(&[pass("scene", scene), pass("text", 0.5)], scene + 1.0);
            clock.add_gpu(&[], 0.0);
        }
        assert_eq!(clock.recent().len(), 50);
        let rate = clock.rate().expect("a second has passed");
        assert!((rate.frames_per_second - 50.0).abs() < 1e-9 && (rate.frame_ms - 20.0).abs() < 1e-9);
        assert!((rate.record_ms - 0.5).abs() < 0.01, "{rate:?}");
        assert!((rate.gpu_ms.expect("passes") - 4.0).abs() < 0.2, "{rate:?}");
        assert_eq!(rate.passes.iter().map(|p| p.name).collect::<Vec<_>>(), ["scene", "text"]);
    }

    #[test]
    fn stalls_do_not_fling_and_pauses_do_not_count() {
        let (mut clock, start) = (FrameClock::default(), Instant::now());
        clock.tick(start);
        assert_eq!(clock.tick(start + Duration::from_secs(3)), 0.1);
        assert!((clock.rate().expect("three seconds").frames_per_second - 1.0 / 3.0).abs() < 1e-9);
        clock.pause();
        assert!(clock.recent().eq([3000.0]), "the stall itself is shown");
        assert_eq!(clock.tick(start + Duration::from_secs(60)), 0.0);
        assert_eq!(clock.recent().len(), 1);
        assert!((clock.rate().expect("as before").frames_per_second - 1.0 / 3.0).abs() < 1e-9);
    }
}
