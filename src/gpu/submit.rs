//! Submission: a recording's way to the queue, with a window image where there is one.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;

use super::command_buffer::{CommandBuffer, PassTime, PassTimes};
use super::commands::Commands;
use super::device::Gpu;
use crate::{Error, Result};

/// An image of a swapchain that may be drawn to.
pub struct Acquired {
    pub(super) index: u32,
    /// Signalled when the window system has finished reading; `None` if it had before the image was returned.
    pub(super) ready: Option<vk::Semaphore>,
    /// To be signalled when drawing has finished.
    pub(super) done: vk::Semaphore,
    /// The first stage that touches the image: submissions wait for its acquisition there, so that what is drawn before
    /// need not.
    pub(super) first_touch: vk::PipelineStageFlags2,
}

impl Acquired {
    /// An image that is first touched by a copy; drawing changes that.
    pub(super) fn new(index: u32, ready: Option<vk::Semaphore>, done: vk::Semaphore) -> Self {
        Self { index, ready, done, first_touch: vk::PipelineStageFlags2::ALL_TRANSFER }
    }
}

#[cfg(test)]
thread_local! {
    /// This thread's submissions with a pass of this name fail as on a device that is lost.
    pub(crate) static LOSE_IN: std::cell::Cell<Option<&'static str>> = const { std::cell::Cell::new(None) };
}

impl CommandBuffer {
    /// Waits for the last submission and starts recording; also returns that submission's pass times. A recording that
    /// was begun before and not submitted is discarded.
    pub fn begin(&mut self) -> Result<(Commands<'_>, PassTimes)> {
        let times = self.start()?;
        Ok((Commands { buffer: self }, times))
    }
}

impl Commands<'_> {
    /// Ends recording and submits it; with an acquired window image, waits for that and signals when it is drawn.
    pub fn submit(self, window: Option<&Acquired>) -> Result<()> {
        let buffer = self.buffer;
        #[cfg(test)]
        if LOSE_IN.get().is_some_and(|pass| buffer.has_pass(pass)) {
            return Err(Error::vulkan("submitting work")(vk::Result::ERROR_DEVICE_LOST));
        }
        let gpu = &buffer.gpu;
        // SAFETY: the command buffer is being recorded, outside of rendering.
        unsafe { gpu.device.end_command_buffer(buffer.raw) }.map_err(Error::vulkan("ending a recording"))?;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(buffer.raw)];
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let semaphore = |raw| vk::SemaphoreSubmitInfo::default().semaphore(raw).stage_mask(all);
        let waits = window.and_then(|w| Some(semaphore(w.ready?).stage_mask(w.first_touch)));
        let queue = gpu.queue();
        let submission = gpu.submitted.load(Ordering::Acquire) + 1;
        let finished = semaphore(gpu.device.timeline).value(submission);
        let signals = [finished, window.map_or(finished, |w| semaphore(w.done))];
        let submit = vk::SubmitInfo2::default()
            .command_buffer_infos(&commands)
            .wait_semaphore_infos(waits.as_slice())
            .signal_semaphore_infos(&signals[..1 + usize::from(window.is_some())]);
        // SAFETY: the queue is locked; all handles are alive and stay so until the timeline says it is finished.
        unsafe { gpu.device.queue_submit2(*queue, &[submit], vk::Fence::null()) }
            .map_err(Error::vulkan("submitting work"))?;
        gpu.submitted.store(submission, Ordering::Release);
        drop(queue);
        buffer.submitted(submission);
        Ok(())
    }
}

/// Records, submits and waits: for uploads, precomputation and single pictures. Returns the pass times.
pub fn submit_and_wait(gpu: &Arc<Gpu>, record: impl FnOnce(&mut Commands<'_>) -> Result<()>) -> Result<Vec<PassTime>> {
    let mut buffer = CommandBuffer::new(gpu)?;
    let (mut commands, _) = buffer.begin()?;
    record(&mut commands)?;
    commands.submit(None)?;
    Ok(buffer.finish()?.to_vec())
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::GpuOptions;

    #[test]
    fn a_recording_that_is_not_submitted_leaves_no_timers_behind() {
        let gpu = Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap();
        let mut buffer = CommandBuffer::new(&gpu).unwrap();
        let (commands, _) = buffer.begin().unwrap();
        commands.submit(None).unwrap();
        let (mut commands, _) = buffer.begin().unwrap();
        commands.pass("discarded", |_| ());
        // Without the timers' reset, each of these waits for ever for queries that nothing writes.
        assert_eq!(buffer.finish().unwrap().len(), 0);
        let (mut commands, times) = buffer.begin().unwrap();
        assert_eq!(times.len(), 0);
        commands.pass("submitted", |_| ());
        commands.submit(None).unwrap();
        let times = buffer.finish().unwrap();
        assert_eq!(times.iter().map(|time| time.name).collect::<Vec<_>>(), ["submitted"]);
        drop(buffer);
        gpu.messages().check().unwrap();
    }
}
