//! The report of a run (`--report`): frame times and events.

use std::collections::{BTreeMap, VecDeque};

use serde::Serialize;

use super::frame_statistics::FrameStatistics;
use super::hidden_area::HiddenAreaV;
use crate::view::frame_clock::Rate;

/// The display's rate where the runtime does not report it.
pub const USUAL_HERTZ: f32 = 90.0;
/// Frames whose times are kept: the last ones.
const KEPT: usize = 20_000;

/// One frame, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameTime {
    /// In WaitGetPoses.
    pub wait_ms: f32,
    /// The program's own work: events, waiting for the frame before the last, recording.
    pub cpu_ms: f32,
    /// In Submit and PostPresentHandoff.
    pub submit_ms: f32,
    /// In the mirror window.
    pub mirror_ms: f32,
    /// On the GPU; 0 for the last frames, whose times have not arrived.
    pub gpu_ms: f32,
    /// Part of the picture's pixels that were drawn.
    pub area: f32,
}

/// Facts of one run, as `--report` writes them.
#[derive(Debug, Default, Serialize)]
pub struct RunReport {
    /// `headset`, `window` or, where there is neither, `picture`.
    pub on: &'static str,
    pub gpu: String,
    pub driver: String,
    pub frames: u64,
    /// The last numbers over the window's picture, also where that is a headset's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Rate>,
    /// The window's present mode at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub present_mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub headset: Option<HeadsetReport>,
}

/// The headset's part of the report.
#[derive(Clone, Debug, Default, Serialize)]
pub struct HeadsetReport {
    pub name: String,
    pub hertz: Option<f32>,
    /// Pixels per eye.
    pub size: [u32; 2],
    pub frames: u64,
    /// Why it ended; empty if the user or `--frames` ended it.
    pub ended: String,
    pub quit_acknowledged: bool,
    pub explicit_timing: bool,
    /// Left, right, down, up of each eye at the end.
    pub tangents: [[f32; 4]; 2],
    pub hidden_area_v: HiddenAreaV,
    /// Part of each eye's pixels that is not shaded.
    pub hidden_area_share: [f64; 2],
    /// Frames for which the runtime had no pose.
    pub lost_poses: u64,
    /// Calls of WaitGetPoses and Submit while another program was shown.
    pub calls_without_focus: u64,
    /// Errors of the runtime's calls that cost a frame, by call and code.
    pub failed_calls: BTreeMap<String, u64>,
    pub optics_changes: u64,
    /// Messages of the validation layer that the runtime's own calls caused.
    pub runtime_messages: u64,
    pub compositor: CompositorReport,
    /// Mirror frames shown, and left out because the window was not ready.
    pub mirror: [u64; 2],
    pub mean: FrameTime,
    /// Oldest first; the last 20,000.
    pub timeline: VecDeque<FrameTime>,
}

/// The compositor's statistics of the frames.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct CompositorReport {
    pub frames: u64,
    pub presents: u64,
    pub dropped: u64,
    pub reprojected: u64,
    pub late_cpu: u64,
    pub late_gpu: u64,
    pub throttled: u64,
}

impl From<&FrameStatistics> for CompositorReport {
    fn from(s: &FrameStatistics) -> Self {
        let FrameStatistics { frames, presents, dropped, reprojected, late_cpu, late_gpu, throttled, .. } = *s;
        Self { frames, presents, dropped, reprojected, late_cpu, late_gpu, throttled }
    }
}

/// What a session notes as it goes; the watchdog shares it, to report a session whose runtime never comes back.
#[derive(Default)]
pub struct Record {
    /// All but what the others hold.
    pub facts: HeadsetReport,
    pub statistics: FrameStatistics,
    pub timeline: Timeline,
}

impl Record {
    /// Facts and times so far.
    pub fn report(&self) -> HeadsetReport {
        HeadsetReport {
            compositor: (&self.statistics).into(),
            mean: self.timeline.mean(),
            timeline: self.timeline.frames().clone(),
            ..self.facts.clone()
        }
    }

    /// The line printed at the end.
    pub fn summary(&self) -> String {
        let saved = 50.0 * self.facts.hidden_area_share.iter().sum::<f64>();
        let FrameTime { wait_ms, cpu_ms, gpu_ms, submit_ms, .. } = self.timeline.mean();
        let statistics = self.statistics_line();
        let mut line = format!(
            "{statistics}; per frame {wait_ms:.1} ms waiting, {cpu_ms:.1} ms CPU, {submit_ms:.1} ms in Submit, {gpu_ms:.1} ms GPU; \
             {saved:.1} % of the pixels hidden by the lenses and not drawn"
        );
        let messages = self.facts.runtime_messages;
        if messages > 0 {
            line += &format!("; {messages} message(s) of the validation layer from the runtime's own calls");
        }
        line
    }

    /// The compositor's statistics as a line.
    pub fn statistics_line(&self) -> String {
        self.statistics.line(self.facts.hertz.unwrap_or(USUAL_HERTZ))
    }
}

/// The times of a run's frames, in memory that is allocated once.
pub struct Timeline {
    frames: VecDeque<FrameTime>,
    sum: [f64; 6],
    count: u64,
    /// GPU times come later than the others, and not for every frame.
    gpu_count: u64,
}

impl Default for Timeline {
    fn default() -> Self {
        Self { frames: VecDeque::with_capacity(KEPT), sum: [0.0; 6], count: 0, gpu_count: 0 }
    }
}

impl Timeline {
    /// Notes a frame's times at its end.
    pub fn push(&mut self, time: FrameTime) {
        if self.frames.len() == KEPT {
            self.frames.pop_front();
        }
        self.frames.push_back(time);
        let FrameTime { wait_ms, cpu_ms, submit_ms, mirror_ms, area, .. } = time;
        for (sum, value) in self.sum.iter_mut().zip([wait_ms, cpu_ms, submit_ms, mirror_ms, 0.0, area]) {
            *sum += f64::from(value);
        }
        self.count += 1;
    }

    /// Notes the GPU time of the frame `ago` frames before the current one.
    pub fn set_gpu(&mut self, ago: usize, gpu_ms: f32) {
        let at = self.frames.len().checked_sub(ago);
        if let Some(frame) = at.and_then(|at| self.frames.get_mut(at)) {
            frame.gpu_ms = gpu_ms;
            self.sum[4] += f64::from(gpu_ms);
            self.gpu_count += 1;
        }
    }

    /// Notes the mirror's time, which comes after the frame's end.
    pub fn set_mirror(&mut self, mirror_ms: f32) {
        if let Some(frame) = self.frames.back_mut() {
            frame.mirror_ms = mirror_ms;
            self.sum[3] += f64::from(mirror_ms);
        }
    }

    /// Averages over all frames.
    pub fn mean(&self) -> FrameTime {
        let mean = |i: usize| (self.sum[i] / self.count.max(1) as f64) as f32;
        let gpu_ms = (self.sum[4] / self.gpu_count.max(1) as f64) as f32;
        let [wait_ms, cpu_ms, submit_ms, mirror_ms, area] = [mean(0), mean(1), mean(2), mean(3), mean(5)];
        FrameTime { wait_ms, cpu_ms, submit_ms, mirror_ms, gpu_ms, area }
    }

    /// The frames that are kept.
    pub fn frames(&self) -> &VecDeque<FrameTime> {
        &self.frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpu_times_find_their_frame_and_averages_count_what_has_arrived() {
        let mut timeline = Timeline::default();
        for i in 0..4u8 {
            // As in the loop: before a frame ends, the time of the one two before it arrives.
            timeline.set_gpu(2, 10.0 + f32::from(i));
            timeline.push(FrameTime { cpu_ms: 1.0, area: 0.5, ..FrameTime::default() });
        }
        let gpu: Vec<f32> = timeline.frames().iter().map(|frame| frame.gpu_ms).collect();
        assert_eq!(gpu, [12.0, 13.0, 0.0, 0.0]);
        let mean = timeline.mean();
        assert_eq!((mean.cpu_ms, mean.gpu_ms, mean.area), (1.0, 12.5, 0.5));
    }

    #[test]
    fn long_runs_take_no_more_room() {
        let mut timeline = Timeline::default();
        let room = timeline.frames.capacity();
        (0..2 * KEPT).for_each(|_| timeline.push(FrameTime { wait_ms: 2.0, ..FrameTime::default() }));
        assert_eq!((timeline.frames.len(), timeline.frames.capacity()), (KEPT, room));
        assert_eq!(timeline.mean().wait_ms, 2.0);
    }
}
