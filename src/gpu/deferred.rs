//! Deferred destruction: Vulkan objects whose owners are gone wait here until the GPU has finished with them.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::vulkan::Allocation;

use super::pipeline_store::RawPipeline;

/// Objects taken out under one lock.
pub(super) const BATCH: usize = 8;

/// A Vulkan object whose owner is gone but that the GPU may still use.
pub(super) enum Deferred {
    Buffer(vk::Buffer, Allocation),
    Image(vk::Image, Vec<vk::ImageView>, Allocation),
    Sampler(vk::Sampler),
    DescriptorSetLayout(vk::DescriptorSetLayout),
    DescriptorPool(vk::DescriptorPool),
    Pipeline(RawPipeline),
    CommandPool(vk::CommandPool, vk::QueryPool),
}

impl Deferred {
    /// Destroys the object and returns its memory, to be freed.
    ///
    /// # Safety
    /// The object is the device's, and every submission that could use it has finished.
    pub(super) unsafe fn destroy(self, device: &ash::Device) -> Option<Allocation> {
        // SAFETY: by this function's own contract; null handles are ignored.
        unsafe {
            match self {
                Self::Buffer(buffer, allocation) => {
                    device.destroy_buffer(buffer, None);
                    return Some(allocation);
                }
                Self::Image(image, views, allocation) => {
                    views.into_iter().for_each(|view| device.destroy_image_view(view, None));
                    device.destroy_image(image, None);
                    return Some(allocation);
                }
                Self::Sampler(sampler) => device.destroy_sampler(sampler, None),
                Self::DescriptorSetLayout(layout) => device.destroy_descriptor_set_layout(layout, None),
                Self::DescriptorPool(pool) => device.destroy_descriptor_pool(pool, None),
                Self::Pipeline(RawPipeline { pipeline, layout }) => {
                    device.destroy_pipeline(pipeline, None);
                    device.destroy_pipeline_layout(layout, None);
                }
                Self::CommandPool(pool, queries) => {
                    device.destroy_command_pool(pool, None);
                    device.destroy_query_pool(queries, None);
                }
            }
        }
        None
    }
}

/// The waiting objects, each with the submission that must have finished first.
#[derive(Default)]
pub(super) struct DeferredQueue(Mutex<VecDeque<(u64, Deferred)>>);

impl DeferredQueue {
    /// Adds an object that is destroyed after submission `after`.
    pub(super) fn push(&self, after: u64, object: Deferred) {
        self.lock().push_back((after, object));
    }

    /// Removes up to [`BATCH`] objects whose submission is `finished` or earlier; all `None` where there are no more.
    pub(super) fn take(&self, finished: u64) -> [Option<Deferred>; BATCH] {
        let mut queue = self.lock();
        std::array::from_fn(|_| {
            let due = queue.front().is_some_and(|(after, _)| *after <= finished);
            due.then(|| queue.pop_front()).flatten().map(|(_, object)| object)
        })
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.lock().len()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<(u64, Deferred)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod gpu_tests {
    use crate::gpu::{Buffer, BufferKind, submit_and_wait, with_gpu};

    #[test]
    fn objects_go_while_another_thread_holds_the_queue() {
        with_gpu(|gpu| {
            let buffer = Buffer::new(gpu, "dropped", BufferKind::Storage, 64).unwrap();
            // A lock of the queue for each object would wait here for ever.
            gpu.with_queue_locked(|| drop(buffer));
        });
    }

    #[test]
    fn a_wait_destroys_some_and_an_idle_gpu_all() {
        with_gpu(|gpu| {
            gpu.wait_idle().unwrap();
            let before = gpu.taken_memory();
            let buffers: Vec<_> =
                (0..2000).map(|_| Buffer::new(gpu, "dropped", BufferKind::Storage, 1 << 10).unwrap()).collect();
            let filled = gpu.taken_memory();
            assert!(filled >= before + 2000 * (1 << 10));
            drop(buffers);
            assert_eq!((gpu.deferred_objects(), gpu.taken_memory()), (2000, filled));
            submit_and_wait(gpu, |_| Ok(())).unwrap();
            let left = gpu.deferred_objects();
            assert!((2..2000).contains(&left), "{left} of 2000 are left: a wait destroys none or has no limit");
            gpu.wait_idle().unwrap();
            // All but the submission's own command buffer, which has been dropped since.
            assert!(gpu.deferred_objects() <= 1);
            assert_eq!(gpu.taken_memory(), before);
        });
    }
}
