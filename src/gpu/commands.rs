//! Recording: passes, barriers, binding, draws and dispatches. Attachments: `rendering`; copies: `copies`.

use std::ops::Range;

use ash::vk;

use super::buffer::Buffer;
use super::command_buffer::CommandBuffer;
use super::descriptor::DescriptorSet;
use super::image::{Image, ImageAccess};
use super::pipeline::Pipeline;

/// Triangles that are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cull {
    #[default]
    Nothing,
    /// Those whose back is seen.
    Back,
    Front,
}

/// A command buffer that is being recorded.
pub struct Commands<'a> {
    pub(super) buffer: &'a mut CommandBuffer,
}

impl Commands<'_> {
    /// Labels and times the commands that `record` records; `name` is the key of its time.
    pub fn pass<R>(&mut self, name: &'static str, record: impl FnOnce(&mut Self) -> R) -> R {
        let raw = self.buffer.raw;
        self.buffer.gpu.begin_label(raw, name);
        let first = self.buffer.start_timer(name);
        let result = record(self);
        self.buffer.stop_timer(first);
        self.buffer.gpu.end_label(raw);
        result
    }

    /// Transitions all of an image for an access that comes after all accesses recorded so far.
    pub fn prepare(&mut self, image: &Image, next: ImageAccess) {
        let desc = image.desc();
        self.transition(image, [0..desc.mips, 0..desc.shape.layers()], next, Content::Kept);
    }

    /// Like `prepare`, but discards the image's content.
    pub fn prepare_fresh(&mut self, image: &Image, next: ImageAccess) {
        let desc = image.desc();
        self.transition(image, [0..desc.mips, 0..desc.shape.layers()], next, Content::Discarded);
    }

    /// Like `prepare`, for some mips of some layers only.
    pub fn prepare_subresources(&mut self, image: &Image, mips: Range<u32>, layers: Range<u32>, next: ImageAccess) {
        self.transition(image, [mips, layers], next, Content::Kept);
    }

    /// Makes writes to buffers by shaders and copies visible to all commands that follow.
    pub fn buffers_written(&mut self) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded.
        unsafe { self.device().cmd_pipeline_barrier2(self.buffer.raw, &info) };
    }

    /// Binds a pipeline and, from index 0 on, descriptor sets without dynamic bindings.
    pub fn bind(&mut self, pipeline: &Pipeline, sets: &[&DescriptorSet]) {
        self.bind_pipeline(pipeline);
        for (i, set) in (0u32..).zip(sets) {
            self.bind_set(pipeline, i, set, &[]);
        }
    }

    /// Binds a pipeline alone; sets bound with a compatible layout stay.
    pub fn bind_pipeline(&mut self, pipeline: &Pipeline) {
        // SAFETY: the command buffer is being recorded; the pipeline is alive.
        unsafe { self.device().cmd_bind_pipeline(self.buffer.raw, pipeline.point, pipeline.raw.pipeline) };
    }

    /// Binds one descriptor set, with the offset of each of its dynamic bindings in bytes, in the order of the bindings.
    ///
    /// # Panics
    /// If there is not one offset for each, or one of them is too large for its buffer: a defect of the caller.
    pub fn bind_set(&mut self, pipeline: &Pipeline, index: u32, set: &DescriptorSet, dynamic_offsets: &[u32]) {
        set.check_offsets(dynamic_offsets);
        let (point, sets) = (pipeline.point, [set.raw]);
        // SAFETY: the command buffer is being recorded; pipeline and set are alive, the offsets fit.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_bind_descriptor_sets(self.buffer.raw, point, pipeline.raw.layout, index, &sets, dynamic_offsets);
        }
    }

    /// Sets the pipeline's push constants.
    pub fn push(&mut self, pipeline: &Pipeline, bytes: &[u8]) {
        // SAFETY: the command buffer is being recorded; the layout has one range for all stages.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_push_constants(self.buffer.raw, pipeline.raw.layout, vk::ShaderStageFlags::ALL, 0, bytes);
        }
    }

    /// Draws without vertex buffers: the shader computes its vertices from their index.
    pub fn draw(&mut self, vertices: u32, instances: u32) {
        // SAFETY: called inside `render` with a pipeline bound.
        unsafe { self.device().cmd_draw(self.buffer.raw, vertices, instances, 0, 0) };
    }

    /// Leaves out triangles that face away or that face the eye, or none.
    pub fn cull(&mut self, cull: Cull) {
        let mode = match cull {
            Cull::Nothing => vk::CullModeFlags::NONE,
            Cull::Back => vk::CullModeFlags::BACK,
            Cull::Front => vk::CullModeFlags::FRONT,
        };
        // SAFETY: the command buffer is being recorded; every graphics pipeline has this state dynamic.
        unsafe { self.device().cmd_set_cull_mode(self.buffer.raw, mode) };
    }

    /// Binds a vertex buffer and a buffer of 32-bit indices.
    pub fn bind_mesh(&mut self, vertices: &Buffer, indices: &Buffer) {
        // SAFETY: the command buffer is being recorded; both buffers are alive and of the right kind.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_bind_vertex_buffers(self.buffer.raw, 0, &[vertices.raw], &[0]);
            device.cmd_bind_index_buffer(self.buffer.raw, indices.raw, 0, vk::IndexType::UINT32);
        }
    }

    /// Draws a range of the bound indices.
    pub fn draw_indexed(&mut self, indices: Range<u32>, instances: u32) {
        let count = indices.end - indices.start;
        // SAFETY: called inside `render` with a pipeline and a mesh bound.
        unsafe {
            self.device().cmd_draw_indexed(self.buffer.raw, count, instances, indices.start, 0, 0);
        }
    }

    /// Runs the bound compute pipeline.
    pub fn dispatch(&mut self, groups: [u32; 3]) {
        // SAFETY: the command buffer is being recorded with a compute pipeline bound.
        unsafe { self.device().cmd_dispatch(self.buffer.raw, groups[0], groups[1], groups[2]) };
    }

    /// One barrier if all these subresources have the same access, else one for each run of layers that have.
    fn transition(&mut self, image: &Image, [mips, layers]: [Range<u32>; 2], next: ImageAccess, content: Content) {
        let first = image.access(mips.start, layers.start);
        let same = |mip| layers.clone().all(|layer| image.access(mip, layer) == first);
        if mips.clone().all(same) {
            return self.transition_alike(image, [mips, layers], next, content);
        }
        for mip in mips {
            let mut start = layers.start;
            while start < layers.end {
                let access = image.access(mip, start);
                let end = (start..layers.end).find(|layer| image.access(mip, *layer) != access).unwrap_or(layers.end);
                self.transition_alike(image, [mip..mip + 1, start..end], next, content);
                start = end;
            }
        }
    }

    /// The same for subresources that all have the access of the first.
    fn transition_alike(
        &mut self,
        image: &Image,
        [mips, layers]: [Range<u32>; 2],
        next: ImageAccess,
        content: Content,
    ) {
        let from = image.access(mips.start, layers.start);
        if from == next && next.only_reads() && content == Content::Kept {
            return;
        }
        let mut barrier = transition(from, next);
        if content == Content::Discarded {
            barrier = barrier.old_layout(vk::ImageLayout::UNDEFINED);
        }
        let range = vk::ImageSubresourceRange {
            aspect_mask: image.aspect(),
            base_mip_level: mips.start,
            level_count: mips.end - mips.start,
            base_array_layer: layers.start,
            layer_count: layers.end - layers.start,
        };
        self.raw_image_barrier(barrier.image(image.raw).subresource_range(range));
        for mip in mips {
            layers.clone().for_each(|layer| image.set_access(mip, layer, next));
        }
    }

    pub(super) fn raw_image_barrier(&mut self, barrier: vk::ImageMemoryBarrier2<'_>) {
        let barriers =
            [barrier.src_queue_family_index(vk::QUEUE_FAMILY_IGNORED).dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is being recorded; the image is alive.
        unsafe { self.device().cmd_pipeline_barrier2(self.buffer.raw, &info) };
    }

    pub(super) fn device(&self) -> &ash::Device {
        &self.buffer.gpu.device
    }
}

/// Whether a transition keeps the texels.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    Kept,
    Discarded,
}

/// The barrier from one access to the next.
pub(super) fn transition(from: ImageAccess, to: ImageAccess) -> vk::ImageMemoryBarrier2<'static> {
    let (old, stage, access) = from.parts();
    let (new, next_stage, next_access) = to.parts();
    vk::ImageMemoryBarrier2::default()
        .old_layout(old)
        .src_stage_mask(stage)
        .src_access_mask(access)
        .new_layout(new)
        .dst_stage_mask(next_stage)
        .dst_access_mask(next_access)
}
