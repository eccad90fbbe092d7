//! The driver's pipeline cache: all pipelines are created through it, and its content can be saved as bytes.

use std::sync::{PoisonError, RwLock};

use ash::vk;

use crate::{Error, Result};

/// Bytes of the header that all drivers' caches begin with (VkPipelineCacheHeaderVersionOne).
const HEADER: usize = 32;

/// A `VkPipelineCache`; dropped before its device.
pub(super) struct PipelineCache {
    device: ash::Device,
    /// Creating pipelines may share it, merging may not.
    raw: RwLock<vk::PipelineCache>,
    header: [u8; HEADER],
}

impl PipelineCache {
    /// Creates an empty cache for a device of this GPU.
    pub(super) fn new(device: &ash::Device, gpu: &vk::PhysicalDeviceProperties) -> Result<Self> {
        // SAFETY: the device is alive, the structure is complete.
        let raw = unsafe { device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
            .map_err(Error::vulkan("creating a pipeline cache"))?;
        Ok(Self { device: device.clone(), raw: RwLock::new(raw), header: header(gpu) })
    }

    /// Calls something that creates pipelines.
    pub(super) fn with<R>(&self, create: impl FnOnce(vk::PipelineCache) -> R) -> R {
        create(*self.raw.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// The content; begins with the header.
    pub(super) fn bytes(&self) -> Result<Vec<u8>> {
        // SAFETY: the cache is alive.
        self.with(|raw| unsafe { self.device.get_pipeline_cache_data(raw) })
            .map_err(Error::vulkan("reading the pipeline cache"))
    }

    /// Adds the content of another run's cache. Returns whether it was one of this GPU and driver; others never reach
    /// the driver.
    pub(super) fn merge(&self, bytes: &[u8]) -> bool {
        if bytes.len() < HEADER || bytes[..HEADER] != self.header {
            return false;
        }
        let info = vk::PipelineCacheCreateInfo::default().initial_data(bytes);
        // SAFETY: the device is alive; the data begins with this driver's own header.
        let Ok(added) = (unsafe { self.device.create_pipeline_cache(&info, None) }) else { return false };
        let raw = self.raw.write().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: both caches are alive, and the lock keeps others from using the destination.
        let merged = unsafe { self.device.merge_pipeline_caches(*raw, &[added]) };
        // SAFETY: nothing else refers to it.
        unsafe { self.device.destroy_pipeline_cache(added, None) };
        merged.is_ok()
    }

    /// Vendor and device in hexadecimal: a name for a file, the same for all versions of the driver.
    pub(super) fn name(&self) -> String {
        self.header[8..16].iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

impl Drop for PipelineCache {
    fn drop(&mut self) {
        let raw = *self.raw.get_mut().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: no pipeline is being created any more, and the device is still alive.
        unsafe { self.device.destroy_pipeline_cache(raw, None) };
    }
}

fn header(gpu: &vk::PhysicalDeviceProperties) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    let version = vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32;
    let words = [HEADER as u32, version, gpu.vendor_id, gpu.device_id];
    header.chunks_exact_mut(4).zip(words).for_each(|(to, word)| to.copy_from_slice(&word.to_le_bytes()));
    header[16..].copy_from_slice(&gpu.pipeline_cache_uuid);
    header
}

#[cfg(test)]
mod gpu_tests {
    use super::HEADER;
    use crate::gpu::{BindingType, DescriptorSetLayout, Gpu, Pipeline, with_gpu};

    fn make_pipeline(gpu: &std::sync::Arc<Gpu>) {
        let kinds = [BindingType::UniformDynamic, BindingType::StorageDynamic];
        let layout = DescriptorSetLayout::new(gpu, "arena", &kinds).unwrap();
        let sum = DescriptorSetLayout::new(gpu, "sum", &[BindingType::Storage]).unwrap();
        Pipeline::compute(gpu, "test_arena.comp", &[], &[&layout, &sum], 0).unwrap();
    }

    #[test]
    fn bytes_of_one_run_are_taken_in_the_next() {
        let bytes = with_gpu(|gpu| {
            make_pipeline(gpu);
            gpu.pipeline_cache_bytes().unwrap()
        });
        with_gpu(|gpu| {
            assert!(gpu.merge_pipeline_cache(&bytes));
            make_pipeline(gpu);
            assert!(gpu.pipeline_cache_bytes().unwrap().len() >= bytes.len());
        });
    }

    #[test]
    fn bytes_of_others_and_broken_ones_are_refused() {
        with_gpu(|gpu| {
            make_pipeline(gpu);
            let good = gpu.pipeline_cache_bytes().unwrap();
            assert!(good.len() >= HEADER, "no header");
            for length in [0, 3, HEADER - 1] {
                assert!(!gpu.merge_pipeline_cache(&good[..length]), "{length} bytes");
            }
            // Header size, version, vendor, device, UUID.
            for byte in [0, 4, 8, 12, 16, 31] {
                let mut other = good.clone();
                other[byte] ^= 0x55;
                assert!(!gpu.merge_pipeline_cache(&other), "byte {byte}");
            }
            assert!(gpu.merge_pipeline_cache(&good));
        });
    }
}
