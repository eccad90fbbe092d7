//! What a GPU allows: limits that the program needs to be higher than Vulkan requires of every GPU, and checks of what is about
//! to be made against the others.

use ash::vk;

use crate::{Error, Result};

/// Images with samplers that one shader stage sees, in all sets of a pipeline; Vulkan requires 16.
pub const SAMPLED_IN_STAGE: u32 = 24;
/// Storage buffers that one shader stage sees; Vulkan requires 4.
pub const STORAGE_IN_STAGE: u32 = 16;

/// The needed limits that are too low, with what is needed; empty if there are none.
pub(super) fn too_low(limits: &vk::PhysicalDeviceLimits) -> Vec<String> {
    let needed = [
        ("maxPerStageDescriptorSamplers", limits.max_per_stage_descriptor_samplers, SAMPLED_IN_STAGE),
        ("maxPerStageDescriptorSampledImages", limits.max_per_stage_descriptor_sampled_images, SAMPLED_IN_STAGE),
        ("maxPerStageDescriptorStorageBuffers", limits.max_per_stage_descriptor_storage_buffers, STORAGE_IN_STAGE),
    ];
    let low = needed.into_iter().filter(|(_, there, needed)| there < needed);
    low.map(|(name, there, needed)| format!("{name} of {needed} ({there})")).collect()
}

/// The limits of one GPU.
pub(super) struct Limits {
    pub(super) vulkan: vk::PhysicalDeviceLimits,
    pub(super) max_buffer_bytes: u64,
    /// For messages.
    pub(super) gpu: String,
}

impl Limits {
    /// Checks that an image may have this size and so many layers.
    pub(super) fn check_image(&self, name: &str, [width, height]: [u32; 2], layers: u32, is_cube: bool) -> Result<()> {
        let vk::PhysicalDeviceLimits { max_image_dimension2_d, max_image_dimension_cube, .. } = self.vulkan;
        let side = if is_cube { max_image_dimension_cube } else { max_image_dimension2_d };
        if width.max(height) > side {
            return Err(self.refused(name, (format!("{width}x{height} texels"), format!("{side}x{side}"))));
        }
        let most = self.vulkan.max_image_array_layers;
        if layers > most {
            return Err(self.refused(name, (format!("{layers} layers"), most.to_string())));
        }
        Ok(())
    }

    /// Checks that a buffer may have so many bytes.
    pub(super) fn check_buffer(&self, name: &str, bytes: u64) -> Result<()> {
        self.check_bytes(name, bytes, self.max_buffer_bytes)
    }

    /// Checks that shaders may see so many bytes of a storage buffer.
    pub(super) fn check_storage(&self, name: &str, bytes: u64) -> Result<()> {
        self.check_bytes(name, bytes, self.vulkan.max_storage_buffer_range.into())
    }

    fn check_bytes(&self, name: &str, bytes: u64, most: u64) -> Result<()> {
        let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
        if bytes > most { Err(self.refused(name, (mib(bytes), mib(most)))) } else { Ok(()) }
    }

    fn refused(&self, name: &str, (asked, most): (String, String)) -> Error {
        Error::GpuLimit { what: name.into(), asked, most, gpu: self.gpu.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_that_are_too_low_are_named() {
        let enough = vk::PhysicalDeviceLimits {
            max_per_stage_descriptor_samplers: SAMPLED_IN_STAGE,
            max_per_stage_descriptor_sampled_images: SAMPLED_IN_STAGE,
            max_per_stage_descriptor_storage_buffers: STORAGE_IN_STAGE,
            ..Default::default()
        };
        assert_eq!(too_low(&enough), [""; 0]);
        let few = vk::PhysicalDeviceLimits { max_per_stage_descriptor_storage_buffers: 4, ..enough };
        assert_eq!(too_low(&few), ["maxPerStageDescriptorStorageBuffers of 16 (4)"]);
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{
        Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Format, Image, ImageDesc,
        ImageUsageFlags, Shape, with_gpu,
    };

    #[test]
    fn what_exceeds_a_limit_is_refused_before_vulkan_is_asked() {
        with_gpu(|gpu| {
            let is_limit = |error: &Error| matches!(error, Error::GpuLimit { .. }) && !error.is_out_of_memory();
            let flat = |size| ImageDesc::flat(Format::R8G8B8A8_UNORM, size, ImageUsageFlags::TRANSFER_DST);
            let wide = Image::new(gpu, "wide", flat([1, gpu.max_image_size() + 1]));
            assert!(wide.is_err_and(|error| is_limit(&error) && error.to_string().contains("wide")));
            let layers = gpu.limits.vulkan.max_image_array_layers + 1;
            let deep = Image::new(gpu, "deep", ImageDesc { shape: Shape::Layers(layers), ..flat([1, 1]) });
            assert!(deep.is_err_and(|error| is_limit(&error)));
            let large = Buffer::new(gpu, "large", BufferKind::Storage, gpu.limits.max_buffer_bytes + 1);
            assert!(large.is_err_and(|error| is_limit(&error)));
            // lavapipe's is 128 MiB, of which nothing is touched.
            let seen = u64::from(gpu.limits.vulkan.max_storage_buffer_range) + 4;
            if seen <= 1 << 28 {
                let buffer = Buffer::new(gpu, "seen", BufferKind::Storage, seen).unwrap();
                let layout = DescriptorSetLayout::new(gpu, "layout", &[BindingType::Storage]).unwrap();
                let set = DescriptorSet::new(gpu, "set", &layout, &[Binding::Storage(&buffer)]);
                assert!(set.is_err_and(|error| is_limit(&error)));
            }
        });
    }
}
