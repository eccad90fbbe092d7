//! A command buffer and its timers: reset, begun, waited for. Submission: `submit`.

use std::ops::Deref;
use std::sync::Arc;

use ash::vk;

use super::deferred::Deferred;
use super::device::Gpu;
use crate::{Error, Result};

/// Passes that one recording can time; later ones are not timed.
const MAX_TIMERS: usize = 32;
const MAX_QUERIES: u32 = 2 * MAX_TIMERS as u32;

/// GPU time of one pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PassTime {
    pub name: &'static str,
    pub ms: f64,
}

/// The times of one recording's passes, in order: a slice that needs no allocation.
#[derive(Clone, Copy, Debug, Default)]
pub struct PassTimes {
    times: [PassTime; MAX_TIMERS],
    count: usize,
    total_ms: f64,
}

impl PassTimes {
    /// GPU time from the first pass's start to the last one's end, gaps included, in milliseconds. 0 without passes.
    pub fn total_ms(&self) -> f64 {
        self.total_ms
    }
}

impl Deref for PassTimes {
    type Target = [PassTime];

    fn deref(&self) -> &[PassTime] {
        &self.times[..self.count]
    }
}

/// A command buffer with its timers.
pub struct CommandBuffer {
    pub(super) gpu: Arc<Gpu>,
    pub(super) raw: vk::CommandBuffer,
    pool: vk::CommandPool,
    queries: vk::QueryPool,
    /// Names of the timed passes, the first `timers` of them valid.
    names: [&'static str; MAX_TIMERS],
    timers: usize,
    /// The number of the submission whose times have not been read yet.
    pending: Option<u64>,
}

impl CommandBuffer {
    /// Creates a command buffer with a pool of its own.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(gpu.family);
        // SAFETY: the device is alive, the family is its own.
        let pool =
            unsafe { gpu.device.create_command_pool(&info, None) }.map_err(Error::vulkan("creating a command pool"))?;
        let mut buffer = Self {
            gpu: Arc::clone(gpu),
            raw: vk::CommandBuffer::null(),
            pool,
            queries: vk::QueryPool::null(),
            names: [""; MAX_TIMERS],
            timers: 0,
            pending: None,
        };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just created.
        let buffers = unsafe { gpu.device.allocate_command_buffers(&info) }
            .map_err(Error::vulkan("allocating a command buffer"))?;
        buffer.raw = buffers.first().copied().unwrap_or_default();
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(MAX_QUERIES);
        // SAFETY: the device is alive; the queue family has timestamps (see `choice`).
        buffer.queries =
            unsafe { gpu.device.create_query_pool(&info, None) }.map_err(Error::vulkan("creating timers"))?;
        Ok(buffer)
    }

    /// Waits for the last submission and starts recording; returns that submission's pass times.
    pub(super) fn start(&mut self) -> Result<PassTimes> {
        let times = self.finish()?;
        // A recording that was never submitted has set timers, too, but nothing writes their queries.
        self.timers = 0;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission has finished, so pool, queries and buffer are free to be reused.
        unsafe {
            let device = &self.gpu.device;
            device
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .map_err(Error::vulkan("resetting a command pool"))?;
            device.reset_query_pool(self.queries, 0, MAX_QUERIES);
            device.begin_command_buffer(self.raw, &info).map_err(Error::vulkan("starting to record"))?;
        }
        Ok(times)
    }

    /// Notes the number under which the recording was submitted.
    pub(super) fn submitted(&mut self, submission: u64) {
        self.pending = Some(submission);
    }

    /// Whether a pass of this name is recorded.
    #[cfg(test)]
    pub(super) fn has_pass(&self, name: &str) -> bool {
        self.names[..self.timers].contains(&name)
    }

    /// Waits for the last submission and returns its pass times; none if they have been returned before.
    pub fn finish(&mut self) -> Result<PassTimes> {
        let mut finished = PassTimes::default();
        let Some(submission) = self.pending else { return Ok(finished) };
        self.gpu.wait_for(submission)?;
        self.pending = None;
        finished.count = std::mem::take(&mut self.timers);
        let mut ticks = [[0u64; 2]; MAX_TIMERS];
        let ticks = &mut ticks[..finished.count];
        if !ticks.is_empty() {
            // SAFETY: the submission that wrote these queries has finished.
            unsafe {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                self.gpu.device.get_query_pool_results(self.queries, 0, ticks.as_flattened_mut(), flags)
            }
            .map_err(Error::vulkan("reading timers"))?;
        }
        let ms_per_tick = f64::from(self.gpu.limits.vulkan.timestamp_period) * 1e-6;
        for ((time, name), [start, end]) in finished.times.iter_mut().zip(self.names).zip(&*ticks) {
            *time = PassTime { name, ms: end.saturating_sub(*start) as f64 * ms_per_tick };
        }
        finished.total_ms = whole(ticks) as f64 * ms_per_tick;
        Ok(finished)
    }

    pub(super) fn start_timer(&mut self, name: &'static str) -> Option<u32> {
        *self.names.get_mut(self.timers)? = name;
        // Below `MAX_QUERIES`: the line above returns where there is no room.
        let first = 2 * self.timers as u32;
        self.timers += 1;
        self.stamp(first);
        Some(first)
    }

    pub(super) fn stop_timer(&mut self, first: Option<u32>) {
        if let Some(first) = first {
            self.stamp(first + 1);
        }
    }

    /// Writes the time at which all work before has ended. An earlier stage would let passes overlap and count the same
    /// time twice.
    fn stamp(&self, query: u32) {
        let stage = vk::PipelineStageFlags2::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded and the query was reset in `begin`.
        unsafe { self.gpu.device.cmd_write_timestamp2(self.raw, stage, self.queries, query) };
    }
}

/// Ticks from the first start to the last end.
fn whole(ticks: &[[u64; 2]]) -> u64 {
    let first = ticks.iter().map(|[start, _]| *start).min().unwrap_or(0);
    let last = ticks.iter().map(|[_, end]| *end).max().unwrap_or(0);
    last.saturating_sub(first)
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::CommandPool(self.pool, self.queries));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_that_overlap_or_lie_apart_count_once_and_with_their_gaps() {
        assert_eq!(whole(&[]), 0);
        assert_eq!(whole(&[[100, 130]]), 30);
        assert_eq!(whole(&[[100, 130], [110, 150]]), 50);
        assert_eq!(whole(&[[100, 130], [140, 150]]), 50);
        assert_eq!(whole(&[[100, 190], [110, 150]]), 90);
        // A counter that wraps gives 0 rather than an absurd time.
        assert_eq!(whole(&[[u64::MAX, 3]]), 0);
    }
}
