//! Constructors that fail at a later step: what they have created by then is destroyed, or the validation layer tells when
//! the device goes.

use std::cell::Cell;
use std::sync::Arc;

use ash::{DeviceFnV1_0, vk};

use super::*;
use crate::{Error, Result};

const FAILURE: vk::Result = vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;

/// What `attempt` returns on a GPU with some of Vulkan's functions replaced; nothing is left behind.
fn attempt<T>(replace: impl FnOnce(&mut DeviceFnV1_0), attempt: impl FnOnce(&Arc<Gpu>) -> Result<T>) -> Result<()> {
    let mut gpu = Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap();
    Arc::get_mut(&mut gpu).unwrap().device.replace(replace);
    let messages = gpu.messages();
    let result = attempt(&gpu).map(drop);
    assert!(Arc::into_inner(gpu).is_some(), "something keeps the GPU open");
    messages.check().unwrap();
    result
}

fn assert_fails<T>(replace: impl FnOnce(&mut DeviceFnV1_0), make: impl FnOnce(&Arc<Gpu>) -> Result<T>) {
    assert!(matches!(attempt(replace, make), Err(Error::Vulkan { result: FAILURE, .. })));
}

unsafe extern "system" fn bind_buffer(
    _: vk::Device,
    _: vk::Buffer,
    _: vk::DeviceMemory,
    _: vk::DeviceSize,
) -> vk::Result {
    FAILURE
}

unsafe extern "system" fn command_buffers(
    _: vk::Device,
    _: *const vk::CommandBufferAllocateInfo<'_>,
    _: *mut vk::CommandBuffer,
) -> vk::Result {
    FAILURE
}

unsafe extern "system" fn query_pool(
    _: vk::Device,
    _: *const vk::QueryPoolCreateInfo<'_>,
    _: *const vk::AllocationCallbacks<'_>,
    _: *mut vk::QueryPool,
) -> vk::Result {
    FAILURE
}

unsafe extern "system" fn descriptor_sets(
    _: vk::Device,
    _: *const vk::DescriptorSetAllocateInfo<'_>,
    _: *mut vk::DescriptorSet,
) -> vk::Result {
    FAILURE
}

unsafe extern "system" fn compute_pipelines(
    _: vk::Device,
    _: vk::PipelineCache,
    _: u32,
    _: *const vk::ComputePipelineCreateInfo<'_>,
    _: *const vk::AllocationCallbacks<'_>,
    _: *mut vk::Pipeline,
) -> vk::Result {
    FAILURE
}

unsafe extern "system" fn shader_module(
    _: vk::Device,
    _: *const vk::ShaderModuleCreateInfo<'_>,
    _: *const vk::AllocationCallbacks<'_>,
    _: *mut vk::ShaderModule,
) -> vk::Result {
    FAILURE
}

thread_local! {
    /// The device's own function.
    static CREATE_VIEW: Cell<Option<vk::PFN_vkCreateImageView>> = const { Cell::new(None) };
    /// Views that are still created before one fails.
    static VIEWS: Cell<u32> = const { Cell::new(0) };
}

unsafe extern "system" fn image_view(
    device: vk::Device,
    info: *const vk::ImageViewCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    view: *mut vk::ImageView,
) -> vk::Result {
    let left = VIEWS.get();
    VIEWS.set(left.saturating_sub(1));
    match CREATE_VIEW.get() {
        // SAFETY: the driver's own function with the caller's arguments.
        Some(create) if left > 0 => unsafe { create(device, info, callbacks, view) },
        _ => FAILURE,
    }
}

#[test]
fn buffers_and_images_without_memory_are_destroyed() {
    let desc = ImageDesc::flat(Format::R8G8B8A8_UNORM, [4, 4], ImageUsageFlags::SAMPLED);
    assert_fails(|device| device.bind_buffer_memory = bind_buffer, |gpu| Buffer::new(gpu, "b", BufferKind::Upload, 4));
    with_gpu_of_little_memory(|gpu| {
        NO_IMAGES.set(true);
        let made = Image::new(gpu, "i", desc);
        NO_IMAGES.set(false);
        assert!(matches!(made, Err(Error::Vulkan { result: FAILURE, .. })));
    });
}

#[test]
fn images_that_lack_any_of_their_views_are_destroyed() {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::COLOR_ATTACHMENT;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [4, 4], usage);
    let desc = ImageDesc { shape: Shape::Layers(2), mips: 2, ..flat };
    let replace = |device: &mut DeviceFnV1_0| {
        CREATE_VIEW.set(Some(device.create_image_view));
        device.create_image_view = image_view;
    };
    // All, one for each mip to store into, all layers and each layer of each mip to draw into.
    let views = 1 + 2 + 1 + 4;
    for there in 0..=views {
        VIEWS.set(there);
        let made = attempt(replace, |gpu| Image::new(gpu, "image", desc));
        assert_eq!(made.is_ok(), there == views, "{there} views");
    }
}

#[test]
fn command_buffers_without_timers_and_sets_without_a_place_are_destroyed() {
    assert_fails(|device| device.allocate_command_buffers = command_buffers, CommandBuffer::new);
    assert_fails(|device| device.create_query_pool = query_pool, CommandBuffer::new);
    assert_fails(
        |device| device.allocate_descriptor_sets = descriptor_sets,
        |gpu| {
            let buffer = Buffer::new(gpu, "bound", BufferKind::Storage, 4)?;
            let layout = DescriptorSetLayout::new(gpu, "layout", &[BindingType::Storage])?;
            DescriptorSet::new(gpu, "set", &layout, &[Binding::Storage(&buffer)])
        },
    );
}

#[test]
fn pipelines_that_do_not_compile_leave_neither_layout_nor_shader() {
    let make = |gpu: &Arc<Gpu>| Pipeline::compute(gpu, "brdf_table.comp", &[], &[], 4);
    assert_fails(|device| device.create_shader_module = shader_module, make);
    assert_fails(|device| device.create_compute_pipelines = compute_pipelines, make);
}
