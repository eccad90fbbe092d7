//! The compositor's statistics of the submitted frames: presented, dropped, reprojected, throttled. A frame rate that the
//! runtime itself has halved is thereby not mistaken for slow rendering.

use openvr_sys::Compositor_FrameTiming;

/// Size that the runtime expects in `Compositor_FrameTiming::m_nSize`: its header packs to 4 bytes except on Windows, the
/// binding does not; the members' offsets are the same.
pub const FRAME_TIMING_BYTES: u32 = if cfg!(windows) { 192 } else { 188 };

// `m_nReprojectionFlags`, openvr.h.
const REASON_CPU: u32 = 0x01;
const REASON_GPU: u32 = 0x02;
const MOTION: u32 = 0x08;
const THROTTLE_SHIFT: u32 = 8;
const THROTTLE_MASK: u32 = 0xf;

/// One frame's numbers from `GetFrameTiming`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameTiming {
    /// `m_nFrameIndex`.
    pub index: u32,
    /// `m_nNumFramePresents`: times this frame was shown.
    pub presents: u32,
    /// `m_nNumMisPresented`: of these, at another refresh than planned.
    pub mispresented: u32,
    /// `m_nNumDroppedFrames`: times the frame before was scanned out once more.
    pub dropped: u32,
    /// `m_nReprojectionFlags`.
    pub flags: u32,
}

impl From<&Compositor_FrameTiming> for FrameTiming {
    fn from(timing: &Compositor_FrameTiming) -> Self {
        Self {
            index: timing.m_nFrameIndex,
            presents: timing.m_nNumFramePresents,
            mispresented: timing.m_nNumMisPresented,
            dropped: timing.m_nNumDroppedFrames,
            flags: timing.m_nReprojectionFlags,
        }
    }
}

impl FrameTiming {
    /// Whether the compositor had to reuse a picture because the GPU was late.
    pub fn is_reprojected_for_gpu(self) -> bool {
        self.flags & REASON_GPU != 0
    }

    /// Refreshes that the runtime makes the program skip after each frame: 1 is half the display's rate.
    pub fn throttled(self) -> u32 {
        self.flags >> THROTTLE_SHIFT & THROTTLE_MASK
    }
}

/// Sums since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameStatistics {
    /// The program's frames that the compositor received.
    pub frames: u64,
    /// How often they were shown, in total.
    pub presents: u64,
    pub mispresented: u64,
    pub dropped: u64,
    /// Frames that were shown again because there was no newer one, whether or not the runtime chose so.
    pub reprojected: u64,
    /// Frames reused because the program's CPU work, or its GPU work, was late, according to the compositor.
    pub late_cpu: u64,
    pub late_gpu: u64,
    /// Frames with motion smoothing.
    pub smoothed: u64,
    /// Frames at a part of the display's rate because the runtime throttled the program.
    pub throttled: u64,
    last: Option<FrameTiming>,
}

impl FrameStatistics {
    /// Counts a frame, once: the compositor reports the same one until the next has ended.
    pub fn add(&mut self, timing: FrameTiming) {
        if self.last.is_some_and(|last| last.index == timing.index) {
            return;
        }
        self.last = Some(timing);
        let count = |happened: bool| u64::from(happened);
        let reasons = timing.flags & (REASON_CPU | REASON_GPU) != 0;
        self.frames += 1;
        self.presents += u64::from(timing.presents);
        self.mispresented += u64::from(timing.mispresented);
        self.dropped += u64::from(timing.dropped);
        self.reprojected += count(reasons || timing.presents > 1);
        self.late_cpu += count(timing.flags & REASON_CPU != 0);
        self.late_gpu += count(timing.is_reprojected_for_gpu());
        self.smoothed += count(timing.flags & MOTION != 0);
        self.throttled += count(timing.throttled() > 0);
    }

    /// The frame counted last.
    pub fn last(&self) -> Option<FrameTiming> {
        self.last
    }

    /// Frames per second that the runtime currently asks for, on a display of `refresh_hz`.
    pub fn rate_hz(&self, refresh_hz: f32) -> f32 {
        refresh_hz / (1 + self.last.map_or(0, FrameTiming::throttled)) as f32
    }

    /// One line for the screen.
    pub fn line(&self, refresh_hz: f32) -> String {
        let Self { frames, dropped, reprojected, late_cpu, late_gpu, throttled, smoothed, .. } = self;
        let mut line = format!(
            "{frames} frames, {dropped} dropped, {reprojected} reprojected (CPU late {late_cpu}, GPU late {late_gpu})"
        );
        if *smoothed > 0 {
            line += &format!(", {smoothed} smoothed");
        }
        if *throttled > 0 {
            line += &format!(", {throttled} throttled");
        }
        let rate = self.rate_hz(refresh_hz);
        if rate < refresh_hz {
            line += &format!("; now {rate:.0} of {refresh_hz:.0} Hz by the runtime's choice");
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    fn frame(index: u32, presents: u32, dropped: u32, flags: u32) -> FrameTiming {
        FrameTiming { index, presents, mispresented: 0, dropped, flags }
    }

    fn sum(frames: &[FrameTiming]) -> FrameStatistics {
        let mut sum = FrameStatistics::default();
        frames.iter().for_each(|frame| sum.add(*frame));
        sum
    }

    #[test]
    fn frames_in_time_are_only_presented() {
        let sum = sum(&(0..90).map(|i| frame(i, 1, 0, 0x04)).collect::<Vec<_>>());
        assert_eq!((sum.frames, sum.presents, sum.dropped, sum.reprojected, sum.throttled), (90, 90, 0, 0, 0));
        assert_eq!(sum.line(90.0), "90 frames, 0 dropped, 0 reprojected (CPU late 0, GPU late 0)");
    }

    #[test]
    fn a_frame_reported_twice_counts_once() {
        let sum = sum(&[frame(7, 1, 1, 0), frame(7, 1, 1, 0), frame(8, 1, 0, 0)]);
        assert_eq!((sum.frames, sum.dropped), (2, 1));
    }

    #[test]
    fn reasons_and_second_presents_are_reprojections() {
        let sum = sum(&[frame(1, 1, 0, 0x01), frame(2, 1, 0, 0x02), frame(3, 2, 3, 0), frame(4, 2, 0, 0x03 | 0x08)]);
        let FrameStatistics { reprojected, late_cpu, late_gpu, dropped, smoothed, .. } = sum;
        assert_eq!((reprojected, late_cpu, late_gpu, dropped, smoothed), (4, 2, 2, 3, 1));
    }

    #[test]
    fn half_rate_is_the_runtimes_choice_and_not_slow_rendering() {
        let sum = sum(&(0..45).map(|i| frame(i, 2, 0, 0x100)).collect::<Vec<_>>());
        assert_eq!((sum.throttled, sum.late_gpu, sum.late_cpu), (45, 0, 0));
        assert_eq!(sum.rate_hz(90.0), 45.0);
        assert!(sum.line(90.0).ends_with("; now 45 of 90 Hz by the runtime's choice"), "{}", sum.line(90.0));
        let mut ended = sum;
        ended.add(frame(100, 1, 0, 0xf0));
        assert_eq!(ended.rate_hz(90.0), 90.0, "predicted frames are not throttled ones");
    }

    #[test]
    fn the_bindings_members_lie_where_the_runtime_puts_them() {
        // Packed to 4 bytes: six words, a double, sixteen floats, a pose of 80 bytes, three words.
        assert_eq!(offset_of!(Compositor_FrameTiming, m_nReprojectionFlags), 20);
        assert_eq!(offset_of!(Compositor_FrameTiming, m_flSystemTimeInSeconds), 24);
        assert_eq!(offset_of!(Compositor_FrameTiming, m_HmdPose), 96);
        assert_eq!(offset_of!(Compositor_FrameTiming, m_flTransferLatencyMs) + 4, 188);
        assert!(FRAME_TIMING_BYTES as usize <= size_of::<Compositor_FrameTiming>());
        // SAFETY: plain numbers; all zeros are valid.
        let mut raw: Compositor_FrameTiming = unsafe { std::mem::zeroed() };
        (raw.m_nFrameIndex, raw.m_nNumFramePresents, raw.m_nNumDroppedFrames) = (1, 2, 4);
        (raw.m_nNumMisPresented, raw.m_nReprojectionFlags) = (3, 0x202);
        let timing = FrameTiming::from(&raw);
        assert_eq!(timing, FrameTiming { index: 1, presents: 2, mispresented: 3, dropped: 4, flags: 0x202 });
        assert!(timing.is_reprojected_for_gpu() && timing.throttled() == 2);
    }
}
