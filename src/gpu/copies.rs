//! Copies between buffers and images, scaled copies and mips.

use std::ops::Range;

use ash::vk;

use super::buffer::Buffer;
use super::commands::Commands;
use super::image::{Image, ImageAccess, Subresource};

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

    /// Its two corners, as Vulkan blits take them.
    pub(super) fn offsets(self) -> [vk::Offset3D; 2] {
        // Images have at most 2^15 pixels a side on any GPU.
        let at = |x: u32, y: u32, z| vk::Offset3D { x: x as i32, y: y as i32, z };
        let ([x, y], [width, height]) = (self.corner, self.size);
        [at(x, y, 0), at(x + width, y + height, 1)]
    }
}

impl Commands<'_> {
    /// Copies bytes between buffers.
    pub fn copy_buffer(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, size: u64) {
        let region = vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size };
        // SAFETY: the command buffer is being recorded; both buffers are alive.
        unsafe { self.device().cmd_copy_buffer(self.buffer.raw, from.raw, to.raw, &[region]) };
    }

    /// Writes a multiple of four bytes, at most 65536 (the limit of vkCmdUpdateBuffer), after all that was recorded before has
    /// read the buffer and before anything that follows does.
    pub fn update_buffer(&mut self, to: &Buffer, offset: u64, bytes: &[u8]) {
        let read = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)];
        let info = vk::DependencyInfo::default().memory_barriers(&read);
        // SAFETY: the command buffer is being recorded; the buffer is alive.
        unsafe {
            self.device().cmd_pipeline_barrier2(self.buffer.raw, &info);
            self.device().cmd_update_buffer(self.buffer.raw, to.raw, offset, bytes);
        }
        self.buffers_written();
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

    /// Copies areas of one layer into a flat image of the same format: each area is given with the corner it goes to. The
    /// images must be prepared for `CopyFrom` and `CopyTo`.
    pub fn copy_layer(&mut self, from: &Image, layer: u32, to: &Image, areas: &[(Rect, [u32; 2])]) {
        let layers = |image: &Image, layer| vk::ImageSubresourceLayers {
            aspect_mask: image.aspect(),
            mip_level: 0,
            base_array_layer: layer,
            layer_count: 1,
        };
        // Images have at most 2^15 pixels a side on any GPU.
        let offset = |[x, y]: [u32; 2]| vk::Offset3D { x: x as i32, y: y as i32, z: 0 };
        let region = |(area, corner): &(Rect, [u32; 2])| {
            vk::ImageCopy::default()
                .src_subresource(layers(from, layer))
                .src_offset(offset(area.corner))
                .dst_subresource(layers(to, 0))
                .dst_offset(offset(*corner))
                .extent(vk::Extent3D { width: area.size[0], height: area.size[1], depth: 1 })
        };
        let (from_layout, to_layout) = (ImageAccess::CopyFrom.parts().0, ImageAccess::CopyTo.parts().0);
        for region in areas.iter().map(region) {
            // SAFETY: the command buffer is being recorded; images are alive and in these layouts.
            unsafe {
                self.device().cmd_copy_image(self.buffer.raw, from.raw, from_layout, to.raw, to_layout, &[region]);
            }
        }
    }

    /// Makes the copies recorded so far visible to reads on the CPU, once the submission has finished.
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

    /// Makes every number of a colour image 0, alpha too.
    pub fn clear(&mut self, image: &Image) {
        self.prepare_fresh(image, ImageAccess::CopyTo);
        let range = vk::ImageSubresourceRange {
            aspect_mask: image.aspect(),
            base_mip_level: 0,
            level_count: image.desc().mips,
            base_array_layer: 0,
            layer_count: image.desc().shape.layers(),
        };
        let (layout, zero) = (ImageAccess::CopyTo.parts().0, vk::ClearColorValue { float32: [0.0; 4] });
        // SAFETY: the command buffer is being recorded; the image is alive and in this layout.
        unsafe { self.device().cmd_clear_color_image(self.buffer.raw, image.raw, layout, &zero, &[range]) };
    }

    pub(super) fn layers(&self, image: &Image, mip: u32) -> vk::ImageSubresourceLayers {
        vk::ImageSubresourceLayers {
            aspect_mask: image.aspect(),
            mip_level: mip,
            base_array_layer: 0,
            layer_count: image.desc().shape.layers(),
        }
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
}
