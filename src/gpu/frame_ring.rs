//! The frames in flight: for each a command buffer and an arena for the data that the CPU writes once per frame.

use std::sync::Arc;

use super::binding_type::BindingType;
use super::buffer::{Buffer, BufferKind};
use super::command_buffer::{CommandBuffer, PassTimes};
use super::commands::Commands;
use super::descriptor::{Binding, DescriptorSet, DescriptorSetLayout};
use super::device::Gpu;
use super::submit::Acquired;
use crate::{Error, Result};

/// Frames that the CPU may be ahead of the GPU.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Bytes that a shader can see of an arena through its uniform binding: the least that every GPU allows.
pub const UNIFORM_RANGE: u64 = 16 << 10;

/// Slots that frames use in turn. A frame that is begun waits until the GPU has finished the last frame of its slot.
pub struct FrameRing {
    slots: [Slot; FRAMES_IN_FLIGHT],
    next: usize,
    layout: DescriptorSetLayout,
}

struct Slot {
    buffer: CommandBuffer,
    /// Pass times of the slot's last frame, once it has finished.
    times: PassTimes,
    arena: Arena,
    set: DescriptorSet,
}

/// Memory allocated from start to end, and reset when the slot's next frame begins.
struct Arena {
    buffer: Arc<Buffer>,
    capacity: u64,
    used: u64,
    alignment: u64,
}

/// A frame that is being recorded. Dropped without `submit`, it is discarded, and the next frame takes its slot.
pub struct FrameContext<'a> {
    /// 0 to [`FRAMES_IN_FLIGHT`] − 1.
    pub slot: usize,
    /// Pass times of the slot's last frame; empty if there was none.
    pub finished: PassTimes,
    pub commands: Commands<'a>,
    /// The slot's arena, of the layout [`FrameRing::arena_layout`]. Bound with the offsets that `push` returned: one for
    /// the uniform and one for the storage binding, 0 for one that is not used.
    pub set: &'a DescriptorSet,
    arena: &'a mut Arena,
    next: &'a mut usize,
}

impl FrameRing {
    /// Creates a ring with `capacity` bytes of per-frame data per slot.
    pub fn new(gpu: &Arc<Gpu>, capacity: u64) -> Result<Self> {
        let layout = Self::arena_layout(gpu)?;
        let slot = || {
            let arena = Arena::new(gpu, capacity)?;
            let bindings = [
                Binding::UniformDynamic(&arena.buffer, UNIFORM_RANGE),
                Binding::StorageDynamic(&arena.buffer, arena.capacity),
            ];
            let set = DescriptorSet::new(gpu, "frame data", &layout, &bindings)?;
            Ok::<_, Error>(Slot { buffer: CommandBuffer::new(gpu)?, times: PassTimes::default(), arena, set })
        };
        Ok(Self { slots: [slot()?, slot()?], next: 0, layout })
    }

    /// The layout of every ring's sets: binding 0 is the arena as dynamic uniform buffer of [`UNIFORM_RANGE`] bytes,
    /// binding 1 as dynamic storage buffer. Pipelines created with one such layout are compatible with the sets of any ring.
    pub fn arena_layout(gpu: &Arc<Gpu>) -> Result<DescriptorSetLayout> {
        DescriptorSetLayout::new(gpu, "frame data", &[BindingType::UniformDynamic, BindingType::StorageDynamic])
    }

    /// This ring's own [`FrameRing::arena_layout`].
    pub fn layout(&self) -> &DescriptorSetLayout {
        &self.layout
    }

    /// One slot's arena, for descriptor sets that bind it beside other resources. Offsets are those of
    /// [`FrameContext::push_bytes`]; a storage range may be up to the ring's capacity, a uniform range [`UNIFORM_RANGE`].
    pub fn arena(&self, slot: usize) -> &Arc<Buffer> {
        &self.slots[slot].arena.buffer
    }

    /// The slot of the frame that `begin` will start.
    pub fn next_slot(&self) -> usize {
        self.next
    }

    /// Waits until the GPU has finished the last frame of the next slot, and returns that frame's pass times: the same
    /// that `begin` will return.
    pub fn finish_slot(&mut self) -> Result<PassTimes> {
        self.slots[self.next].finish()
    }

    /// Waits until the GPU has finished all frames; their pass times, the oldest frame first. Those whose times were
    /// returned by `begin`, and slots that had no frame, have none.
    pub fn finish_all(&mut self) -> Result<[PassTimes; FRAMES_IN_FLIGHT]> {
        let mut all = [PassTimes::default(); FRAMES_IN_FLIGHT];
        for (i, times) in all.iter_mut().enumerate() {
            *times = self.slots[(self.next + i) % FRAMES_IN_FLIGHT].finish()?;
        }
        Ok(all)
    }

    /// Waits until the GPU has finished the last frame of the next slot, and starts recording.
    pub fn begin(&mut self) -> Result<FrameContext<'_>> {
        let slot = self.next;
        let Slot { buffer, times, arena, set } = &mut self.slots[slot];
        let (commands, new) = buffer.begin()?;
        let before = std::mem::take(times);
        let finished = if new.is_empty() { before } else { new };
        arena.used = 0;
        Ok(FrameContext { slot, finished, commands, set, arena, next: &mut self.next })
    }
}

impl Slot {
    fn finish(&mut self) -> Result<PassTimes> {
        let times = self.buffer.finish()?;
        if !times.is_empty() {
            self.times = times;
        }
        Ok(self.times)
    }
}

impl FrameContext<'_> {
    /// Copies bytes into the frame's arena and returns their offset there, aligned for uniform and storage buffers.
    ///
    /// # Errors
    /// An arena that has no room left.
    pub fn push_bytes(&mut self, bytes: &[u8]) -> Result<u32> {
        self.arena.push(bytes)
    }

    /// Copies one value into the frame's arena; see [`FrameContext::push_bytes`].
    pub fn push<T: bytemuck::NoUninit>(&mut self, value: &T) -> Result<u32> {
        self.push_bytes(bytemuck::bytes_of(value))
    }

    /// Submits the frame; with an acquired window image, waits for that and signals when it is drawn.
    pub fn submit(self, window: Option<&Acquired>) -> Result<()> {
        self.commands.submit(window)?;
        *self.next = (self.slot + 1) % FRAMES_IN_FLIGHT;
        Ok(())
    }
}

impl Arena {
    fn new(gpu: &Arc<Gpu>, capacity: u64) -> Result<Self> {
        let limits = &gpu.limits.vulkan;
        let alignment = limits.min_uniform_buffer_offset_alignment.max(limits.min_storage_buffer_offset_alignment);
        // Dynamic offsets are 32 bits, and a binding's range must lie in the buffer from any offset on.
        let capacity = capacity.clamp(UNIFORM_RANGE, 1 << 30).next_multiple_of(alignment);
        let buffer = Buffer::new(gpu, "frame data", BufferKind::Arena, 2 * capacity)?;
        Ok(Self { buffer, capacity, used: 0, alignment })
    }

    fn push(&mut self, bytes: &[u8]) -> Result<u32> {
        let (offset, size) = (self.used, bytes.len() as u64);
        if size > self.capacity - offset {
            let problem = format!("{size} bytes more than the {offset} of {} that are taken", self.capacity);
            return Err(Error::GpuMemory { what: "per-frame data".into(), problem });
        }
        // Both are below 2^31, as the capacity is.
        self.buffer.write(offset as usize, bytes);
        self.used = (offset + size).next_multiple_of(self.alignment).min(self.capacity);
        Ok(offset as u32)
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{Pipeline, read_buffer, with_gpu};

    #[test]
    fn slots_take_turns_and_return_their_times_once() {
        with_gpu(|gpu| {
            let mut ring = FrameRing::new(gpu, 1 << 14).unwrap();
            for frame in 0..5 {
                if frame == 3 {
                    assert_eq!(ring.finish_slot().unwrap().len(), 1);
                }
                let mut context = ring.begin().unwrap();
                assert_eq!((context.slot, context.finished.len()), (frame % 2, usize::from(frame >= 2)));
                context.commands.pass("empty", |_| ());
                context.submit(None).unwrap();
                // A frame that is not submitted costs neither its slot nor the times before it.
                let discarded = ring.begin().unwrap();
                assert_eq!(discarded.slot, (frame + 1) % 2);
                if let Some(times) = (frame > 0).then_some(discarded.finished) {
                    assert_eq!(times.len(), 1);
                    ring.slots[ring.next].times = times;
                }
            }
            assert_eq!(ring.finish_all().unwrap().map(|times| times.len()), [1, 1]);
        });
    }

    #[test]
    fn shaders_read_what_was_pushed_at_its_offset() {
        with_gpu(|gpu| {
            let mut ring = FrameRing::new(gpu, 1 << 14).unwrap();
            let layout = DescriptorSetLayout::new(gpu, "out", &[BindingType::Storage]).unwrap();
            let pipeline = Pipeline::compute(gpu, "test_arena.comp", &[], &[ring.layout(), &layout], 0).unwrap();
            let out = Buffer::new(gpu, "out", BufferKind::Storage, 4).unwrap();
            let set = DescriptorSet::new(gpu, "out", &layout, &[Binding::Storage(&out)]).unwrap();
            for frame in 0..4u32 {
                let mut context = ring.begin().unwrap();
                context.push(&[7u32; 3]).unwrap();
                let uniform = context.push(&[100 * frame, 1, 0, 0]).unwrap();
                let storage = context.push(&[10 * frame, 2]).unwrap();
                let FrameContext { commands, set: frame_set, .. } = &mut context;
                commands.bind_pipeline(&pipeline);
                commands.bind_set(&pipeline, 0, frame_set, &[uniform, storage]);
                commands.bind_set(&pipeline, 1, &set, &[]);
                commands.buffers_written();
                commands.dispatch([1, 1, 1]);
                context.submit(None).unwrap();
                let sum: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &out).unwrap());
                assert_eq!(sum, [110 * frame + 3]);
            }
        });
    }

    #[test]
    fn a_full_arena_is_an_error_until_the_next_frame() {
        with_gpu(|gpu| {
            let mut ring = FrameRing::new(gpu, UNIFORM_RANGE).unwrap();
            {
                let mut context = ring.begin().unwrap();
                let half = vec![1; UNIFORM_RANGE as usize / 2];
                assert_eq!(context.push_bytes(&half).unwrap(), 0);
                assert_eq!(context.push_bytes(&half).unwrap(), UNIFORM_RANGE as u32 / 2);
                let error = context.push_bytes(&[1]).unwrap_err().to_string();
                assert!(error.contains("per-frame data"), "{error}");
            }
            assert_eq!(ring.begin().unwrap().push_bytes(&[1]).unwrap(), 0);
        });
    }

    #[test]
    fn frames_take_no_memory_from_the_heap() {
        let gpu = Gpu::open(crate::gpu::GpuOptions::default()).unwrap();
        let mut ring = FrameRing::new(&gpu, 0).unwrap();
        let mut frame = || {
            let mut context = ring.begin().unwrap();
            context.commands.pass("frame", |_| ());
            context.push(&[1u32; 64]).unwrap();
            context.submit(None).unwrap();
        };
        (0..4).for_each(|_| frame());
        let counts = allocation_counter::measure(|| (0..20).for_each(|_| frame()));
        assert_eq!(counts.count_total, 0);
    }

    #[test]
    #[should_panic(expected = "one dynamic offset for each")]
    fn a_set_of_the_ring_is_not_bound_without_offsets() {
        let gpu = Gpu::open(crate::gpu::GpuOptions::default()).unwrap();
        let mut ring = FrameRing::new(&gpu, 0).unwrap();
        let pipeline = Pipeline::compute(&gpu, "test_arena.comp", &[], &[ring.layout(), ring.layout()], 0).unwrap();
        let mut context = ring.begin().unwrap();
        context.commands.bind(&pipeline, &[context.set]);
    }
}
