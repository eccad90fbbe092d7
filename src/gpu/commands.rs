//! Recording: barriers, rendering, dispatches, copies, pass labels.

use std::ops::Range;

use ash::vk;

use super::buffer::Buffer;
use super::command_buffer::CommandBuffer;
use super::descriptor::DescriptorSet;
use super::image::{Image, ImageAccess};
use super::pipeline::Pipeline;

/// The images one rendering draws into; all have the same size and layers.
pub struct Attachments<'a> {
    pub colour: &'a Image,
    /// Where a multisampled `colour` is averaged to.
    pub resolve: Option<&'a Image>,
    pub depth: Option<&'a Image>,
    /// `None` keeps what is there.
    pub clear: Option<[f32; 4]>,
    /// Only this many pixels from the upper left corner are drawn; the rest is left as it is.
    pub area: [u32; 2],
}

/// A rectangle of pixels, its corner from the upper left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    pub corner: [u32; 2],
    pub size: [u32; 2],
}

impl Rect {
    /// From the upper left corner.
    pub fn of(size: [u32; 2]) -> Self {
        Self { corner: [0, 0], size }
    }

    /// Its two corners, as Vulkan blits want them.
    pub(super) fn offsets(self) -> [vk::Offset3D; 2] {
        // Images have at most 2^15 pixels a side on any GPU.
        let at = |x: u32, y: u32, z| vk::Offset3D { x: x as i32, y: y as i32, z };
        let ([x, y], [width, height]) = (self.corner, self.size);
        [at(x, y, 0), at(x + width, y + height, 1)]
    }
}

/// One layer of one mip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subresource {
    pub mip: u32,
    pub layer: u32,
}

/// A command buffer that is being recorded.
pub struct Commands<'a> {
    pub(super) buffer: &'a mut CommandBuffer,
}

impl Commands<'_> {
    /// Names and times what `record` records.
    pub fn pass<R>(&mut self, name: &'static str, record: impl FnOnce(&mut Self) -> R) -> R {
        let raw = self.buffer.raw;
        self.buffer.gpu.begin_label(raw, name);
        let first = self.buffer.start_timer(name);
        let result = record(self);
        self.buffer.stop_timer(first);
        self.buffer.gpu.end_label(raw);
        result
    }

    /// Makes an image ready for an access, after all accesses before.
    pub fn prepare(&mut self, image: &Image, next: ImageAccess) {
        let desc = image.desc();
        self.transition(image, [0..desc.mips, 0..desc.shape.layers()], next, Content::Kept);
    }

    /// The same, but discards the image's content.
    pub fn prepare_fresh(&mut self, image: &Image, next: ImageAccess) {
        let desc = image.desc();
        self.transition(image, [0..desc.mips, 0..desc.shape.layers()], next, Content::Discarded);
    }

    /// Like `prepare`, for some mips of some layers only.
    pub fn prepare_subresources(&mut self, image: &Image, mips: Range<u32>, layers: Range<u32>, next: ImageAccess) {
        self.transition(image, [mips, layers], next, Content::Kept);
    }

    /// Makes what shaders wrote into buffers visible to all that follows, copies included.
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

    /// Draws into `targets`; they must have been prepared. Sets the viewport to their area, and culls nothing.
    pub fn render(&mut self, targets: &Attachments<'_>, record: impl FnOnce(&mut Self)) {
        let desc = targets.colour.desc();
        let [width, height] = targets.area;
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let load = if targets.clear.is_some() { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD };
        let (colour_layout, ..) = ImageAccess::Colour.parts();
        let mut colour = vk::RenderingAttachmentInfo::default()
            .image_view(targets.colour.view)
            .image_layout(colour_layout)
            .load_op(load)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32: targets.clear.unwrap_or_default() } });
        if let Some(resolve) = targets.resolve {
            colour = colour
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .resolve_mode(vk::ResolveModeFlags::AVERAGE)
                .resolve_image_view(resolve.view)
                .resolve_image_layout(colour_layout);
        }
        let colours = [colour];
        let depth = targets.depth.map(|image| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view)
                .image_layout(ImageAccess::Depth.parts().0)
                .load_op(load)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
        });
        let mut info =
            vk::RenderingInfo::default().render_area(area).layer_count(desc.shape.layers()).color_attachments(&colours);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        let viewport =
            vk::Viewport { width: width as f32, height: height as f32, max_depth: 1.0, ..Default::default() };
        // SAFETY: the command buffer is being recorded; views, layouts and sizes are those of the targets.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_begin_rendering(self.buffer.raw, &info);
            device.cmd_set_viewport(self.buffer.raw, 0, &[viewport]);
            device.cmd_set_scissor(self.buffer.raw, 0, &[area]);
        }
        self.cull_back(false);
        record(self);
        // SAFETY: rendering was begun above.
        unsafe { self.device().cmd_end_rendering(self.buffer.raw) };
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
        unsafe { self.device().cmd_bind_pipeline(self.buffer.raw, pipeline.point, pipeline.raw) };
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
            device.cmd_bind_descriptor_sets(self.buffer.raw, point, pipeline.layout, index, &sets, dynamic_offsets);
        }
    }

    /// Sets the pipeline's push constants.
    pub fn push(&mut self, pipeline: &Pipeline, bytes: &[u8]) {
        // SAFETY: the command buffer is being recorded; the layout has one range for all stages.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_push_constants(self.buffer.raw, pipeline.layout, vk::ShaderStageFlags::ALL, 0, bytes);
        }
    }

    /// Draws `vertices` vertices that the shader makes up itself.
    pub fn draw(&mut self, vertices: u32, instances: u32) {
        // SAFETY: called inside `render` with a pipeline bound.
        unsafe { self.device().cmd_draw(self.buffer.raw, vertices, instances, 0, 0) };
    }

    /// Leaves out triangles that show their backs, or none.
    pub fn cull_back(&mut self, on: bool) {
        let mode = if on { vk::CullModeFlags::BACK } else { vk::CullModeFlags::NONE };
        // SAFETY: the command buffer is being recorded; every graphics pipeline has this state dynamic.
        unsafe { self.device().cmd_set_cull_mode(self.buffer.raw, mode) };
    }

    /// Takes vertices and 16-bit indices.
    pub fn bind_mesh(&mut self, vertices: &Buffer, indices: &Buffer) {
        // SAFETY: the command buffer is being recorded; both buffers are alive and of the right kind.
        unsafe {
            let device = &self.buffer.gpu.device;
            device.cmd_bind_vertex_buffers(self.buffer.raw, 0, &[vertices.raw], &[0]);
            device.cmd_bind_index_buffer(self.buffer.raw, indices.raw, 0, vk::IndexType::UINT16);
        }
    }

    /// Draws a range of the bound indices.
    pub fn draw_indexed(&mut self, indices: Range<u32>, first_vertex: i32, instances: u32) {
        let count = indices.end - indices.start;
        // SAFETY: called inside `render` with a pipeline and a mesh bound.
        unsafe {
            self.device().cmd_draw_indexed(self.buffer.raw, count, instances, indices.start, first_vertex, 0);
        }
    }

    /// Runs the bound compute pipeline.
    pub fn dispatch(&mut self, groups: [u32; 3]) {
        // SAFETY: the command buffer is being recorded with a compute pipeline bound.
        unsafe { self.device().cmd_dispatch(self.buffer.raw, groups[0], groups[1], groups[2]) };
    }

    /// Copies bytes between buffers.
    pub fn copy_buffer(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, size: u64) {
        let region = vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size };
        // SAFETY: the command buffer is being recorded; both buffers are alive.
        unsafe { self.device().cmd_copy_buffer(self.buffer.raw, from.raw, to.raw, &[region]) };
    }

    /// Copies tightly packed texels into one layer of one mip; the image must be prepared for `CopyTo`.
    pub fn copy_to_image(&mut self, from: &Buffer, offset: u64, image: &Image, part: Subresource) {
        let region = self.region(image, part).buffer_offset(offset);
        let (layout, ..) = ImageAccess::CopyTo.parts();
        // SAFETY: the command buffer is being recorded; buffer and image are alive.
        unsafe { self.device().cmd_copy_buffer_to_image(self.buffer.raw, from.raw, image.raw, layout, &[region]) };
    }

    /// Copies tightly packed texels, or blocks, into some rows of one mip of the first layer; the image must be prepared
    /// for `CopyTo`. Rows of blocks begin and end at blocks' borders, or at the image's.
    pub fn copy_rows_to_image(&mut self, from: &Buffer, offset: u64, image: &Image, mip: u32, rows: Range<u32>) {
        let mut region = self.region(image, Subresource { mip, layer: 0 }).buffer_offset(offset);
        // An image has at most 2^15 rows on any GPU.
        region.image_offset.y = rows.start as i32;
        region.image_extent.height = rows.end - rows.start;
        let (layout, ..) = ImageAccess::CopyTo.parts();
        // SAFETY: the command buffer is being recorded; buffer and image are alive.
        unsafe { self.device().cmd_copy_buffer_to_image(self.buffer.raw, from.raw, image.raw, layout, &[region]) };
    }

    /// Copies one layer of one mip into a buffer, tightly packed; the image must be prepared for `CopyFrom`.
    pub fn copy_from_image(&mut self, image: &Image, part: Subresource, to: &Buffer, offset: u64) {
        let region = self.region(image, part).buffer_offset(offset);
        let (layout, ..) = ImageAccess::CopyFrom.parts();
        // SAFETY: the command buffer is being recorded; buffer and image are alive.
        unsafe { self.device().cmd_copy_image_to_buffer(self.buffer.raw, image.raw, layout, to.raw, &[region]) };
    }

    /// Copies the upper left corner of one layer, of `size`, into a flat image of the same format; they must be
    /// prepared for `CopyFrom` and `CopyTo`.
    pub fn copy_layer(&mut self, from: &Image, layer: u32, to: &Image, [width, height]: [u32; 2]) {
        let layers = |image: &Image, layer| vk::ImageSubresourceLayers {
            aspect_mask: image.aspect(),
            mip_level: 0,
            base_array_layer: layer,
            layer_count: 1,
        };
        let region = vk::ImageCopy::default()
            .src_subresource(layers(from, layer))
            .dst_subresource(layers(to, 0))
            .extent(vk::Extent3D { width, height, depth: 1 });
        let (from_layout, to_layout) = (ImageAccess::CopyFrom.parts().0, ImageAccess::CopyTo.parts().0);
        // SAFETY: the command buffer is being recorded; images are alive and in these layouts.
        unsafe {
            self.device().cmd_copy_image(self.buffer.raw, from.raw, from_layout, to.raw, to_layout, &[region]);
        }
    }

    /// Makes host reads of readback buffers see the copies recorded so far.
    pub fn copies_to_host(&mut self) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded.
        unsafe { self.device().cmd_pipeline_barrier2(self.buffer.raw, &info) };
    }

    /// Scales a part of all layers into a part of another image's, filtered bilinearly; they must be prepared for `CopyFrom`
    /// and `CopyTo`.
    pub fn scale(&mut self, from: &Image, to: &Image, parts: [Rect; 2]) {
        self.blit_raw(from.raw, to.raw, parts, [self.layers(from, 0), self.layers(to, 0)]);
    }

    /// Fills mips 1.. of a one-layer or layered image from mip 0 by halving; leaves it `Sampled`.
    pub fn generate_mips(&mut self, image: &Image) {
        let (mips, layers) = (image.desc().mips, image.desc().shape.layers());
        self.prepare(image, ImageAccess::CopyTo);
        for mip in 1..mips {
            self.prepare_subresources(image, mip - 1..mip, 0..layers, ImageAccess::CopyFrom);
            let parts = [Rect::of(image.mip_size(mip - 1)), Rect::of(image.mip_size(mip))];
            self.blit_raw(image.raw, image.raw, parts, [self.layers(image, mip - 1), self.layers(image, mip)]);
        }
        self.prepare(image, ImageAccess::Sampled);
    }

    pub(super) fn blit_raw(
        &mut self,
        from: vk::Image,
        to: vk::Image,
        parts: [Rect; 2],
        layers: [vk::ImageSubresourceLayers; 2],
    ) {
        let regions = [vk::ImageBlit2::default()
            .src_subresource(layers[0])
            .src_offsets(parts[0].offsets())
            .dst_subresource(layers[1])
            .dst_offsets(parts[1].offsets())];
        let info = vk::BlitImageInfo2::default()
            .src_image(from)
            .src_image_layout(ImageAccess::CopyFrom.parts().0)
            .dst_image(to)
            .dst_image_layout(ImageAccess::CopyTo.parts().0)
            .regions(&regions)
            .filter(vk::Filter::LINEAR);
        // SAFETY: the command buffer is being recorded; images are alive and in these layouts.
        unsafe { self.device().cmd_blit_image2(self.buffer.raw, &info) };
    }

    pub(super) fn clear_raw(&mut self, image: vk::Image, range: vk::ImageSubresourceRange) {
        let (layout, black) = (ImageAccess::CopyTo.parts().0, vk::ClearColorValue { float32: [0.0, 0.0, 0.0, 1.0] });
        // SAFETY: the command buffer is being recorded; the image is alive and in this layout.
        unsafe { self.device().cmd_clear_color_image(self.buffer.raw, image, layout, &black, &[range]) };
    }

    /// What was cleared or copied may be copied over.
    pub(super) fn copied(&mut self) {
        let (_, stage, access) = ImageAccess::CopyTo.parts();
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(stage)
            .src_access_mask(access)
            .dst_stage_mask(stage)
            .dst_access_mask(access)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is being recorded.
        unsafe { self.device().cmd_pipeline_barrier2(self.buffer.raw, &info) };
    }

    pub(super) fn layers(&self, image: &Image, mip: u32) -> vk::ImageSubresourceLayers {
        vk::ImageSubresourceLayers {
            aspect_mask: image.aspect(),
            mip_level: mip,
            base_array_layer: 0,
            layer_count: image.desc().shape.layers(),
        }
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

    fn region(&self, image: &Image, part: Subresource) -> vk::BufferImageCopy {
        let [width, height] = image.mip_size(part.mip);
        vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: image.aspect(),
                mip_level: part.mip,
                base_array_layer: part.layer,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D { width, height, depth: 1 })
    }

    fn device(&self) -> &ash::Device {
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
