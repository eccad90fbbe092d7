//! The VkDevice with its timeline: created with all features that are used, destroyed on drop.

use std::ffi::{CString, c_char};
use std::ops::Deref;

use ash::{ext, khr, vk};

use super::choice::Candidate;
use super::instance::{Instance, drop_repeated};
use crate::{Error, Result};

/// A VkDevice, and the semaphore that is signalled with the number of each finished submission. Its objects and its
/// instance outlive it in `Gpu`.
pub(super) struct LogicalDevice {
    raw: ash::Device,
    pub(super) timeline: vk::Semaphore,
}

impl LogicalDevice {
    /// Creates the device with the extensions in `asked`, which it has, and those that this program uses.
    pub(super) fn new(instance: &Instance, chosen: &Candidate, present: bool, asked: &[CString]) -> Result<Self> {
        let raw = create(instance, chosen, present, asked)?;
        let mut device = Self { raw, timeline: vk::Semaphore::null() };
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive and has the timelineSemaphore feature.
        device.timeline =
            unsafe { device.raw.create_semaphore(&info, None) }.map_err(Error::vulkan("creating a semaphore"))?;
        Ok(device)
    }

    /// Calls other functions than Vulkan's from now on.
    #[cfg(test)]
    pub(super) fn replace(&mut self, change: impl FnOnce(&mut ash::DeviceFnV1_0)) {
        let raw = &self.raw;
        let mut functions = raw.fp_v1_0().clone();
        change(&mut functions);
        let (v11, v12, v13) = (raw.fp_v1_1().clone(), raw.fp_v1_2().clone(), raw.fp_v1_3().clone());
        self.raw = ash::Device::from_parts_1_3(raw.handle(), functions, v11, v12, v13);
    }
}

impl Deref for LogicalDevice {
    type Target = ash::Device;

    fn deref(&self) -> &ash::Device {
        &self.raw
    }
}

impl Drop for LogicalDevice {
    fn drop(&mut self) {
        // SAFETY: the owner has destroyed all other objects, and nothing runs; a null semaphore is ignored.
        unsafe {
            self.raw.destroy_semaphore(self.timeline, None);
            self.raw.destroy_device(None);
        }
    }
}

fn create(instance: &Instance, chosen: &Candidate, present: bool, asked: &[CString]) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(chosen.family).queue_priorities(&priorities)];
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(true)
        .host_query_reset(true)
        .scalar_block_layout(true)
        .shader_output_layer(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
        .maintenance4(true)
        .dynamic_rendering(true)
        .synchronization2(true)
        .shader_demote_to_helper_invocation(true);
    let core = vk::PhysicalDeviceFeatures::default()
        .full_draw_index_uint32(true)
        .sampler_anisotropy(chosen.options.anisotropy)
        .texture_compression_bc(chosen.options.compressed_textures)
        .image_cube_array(chosen.options.cube_arrays)
        .dual_src_blend(chosen.options.two_sources);
    let mut extensions: Vec<*const c_char> = asked.iter().map(|name| name.as_ptr()).collect();
    if chosen.options.memory_budget {
        extensions.push(ext::memory_budget::NAME.as_ptr());
    }
    if chosen.options.late_depth {
        extensions.push(ext::shader_stencil_export::NAME.as_ptr());
    }
    if present {
        extensions.push(khr::swapchain::NAME.as_ptr());
    }
    drop_repeated(&mut extensions);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&core)
        .enabled_extension_names(&extensions)
        .push_next(&mut v12)
        .push_next(&mut v13);
    // SAFETY: all that `info` points to lives until the call returns; features and extensions were found in `choice`.
    unsafe { instance.raw.create_device(chosen.physical, &info, None) }.map_err(Error::vulkan("opening the device"))
}
