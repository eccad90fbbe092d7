//! The only place that calls Vulkan: device, memory, images, buffers, pipelines, barriers, timers, readback.

mod binding_type;
mod buffer;
mod choice;
mod command_buffer;
mod commands;
mod copies;
mod deferred;
mod descriptor;
mod device;
mod frame_ring;
#[cfg(test)]
mod failures_gpu_tests;
#[cfg(test)]
mod harness_tests;
mod image;
mod instance;
mod limits;
mod logical_device;
mod pipeline;
mod pipeline_cache;
mod pipeline_store;
mod rendering;
#[cfg(test)]
mod rendering_gpu_tests;
mod sampler;
mod shader;
#[cfg(feature = "hot-reload")]
mod shader_compiler;
mod staging;
mod submit;
mod swapchain;
mod transfer;
mod window_images;

/// Formats and usage flags; calls stay in this layer.
pub use ash::vk::{Format, ImageUsageFlags};

pub use binding_type::BindingType;
pub use buffer::{Buffer, BufferKind};
pub use choice::{GpuInfo, survey};
pub use command_buffer::{CommandBuffer, PassTime, PassTimes};
pub use commands::{Commands, Cull};
pub use copies::Rect;
pub use descriptor::{Binding, DescriptorSet, DescriptorSetLayout};
pub use device::{Gpu, GpuOptions, Handles, MemoryUse};
pub use frame_ring::{FRAMES_IN_FLIGHT, FrameContext, FrameRing, UNIFORM_RANGE};
#[cfg(test)]
pub use harness_tests::{NO_IMAGES, with_gpu, with_gpu_of_little_memory};
pub use image::{AttachmentView, DEPTH_FORMAT, Image, ImageAccess, ImageDesc, Shape, Subresource};
pub use instance::{Instance, Messages, foreign_call, validation_available};
#[cfg(test)]
pub use limits::{SAMPLED_IN_STAGE, STORAGE_IN_STAGE};
#[cfg(test)]
pub use pipeline::pipelines_of_this_thread;
pub use pipeline::{Blend, Constant, DepthBias, DepthState, GraphicsDesc, Pipeline};
pub use rendering::{Attachments, ColourAttachment, DepthAttachment, LoadOp, StoreOp};
pub use sampler::{AddressMode, Compare, Sampler};
#[cfg(feature = "hot-reload")]
pub use shader::on_disk::folder as shader_folder;
pub use shader::{compute_shaders, core_materials, stage_file};
pub use staging::{Upload, upload_rows};
#[cfg(test)]
pub(crate) use submit::LOSE_IN;
pub use submit::{Acquired, submit_and_wait};
pub use swapchain::{Polled, PresentMode, Presented, Swapchain};
pub use transfer::{read_buffer, read_image, read_mips, write_mips};
