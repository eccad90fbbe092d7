//! GPU images: shape, views, and the access that each mip of each layer was last recorded for.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use ash::vk;
use ash::vk::Handle as _;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::deferred::Deferred;
use super::device::Gpu;
use crate::{Error, Result};

/// The format of every depth image.
pub const DEPTH_FORMAT: vk::Format = vk::Format::D32_SFLOAT;

/// The layers of an image, as shaders see them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One layer, `sampler2D`.
    Flat,
    /// N layers, `sampler2DArray`: the eyes.
    Layers(u32),
    /// Six layers, `samplerCube`, faces in Vulkan's order +X −X +Y −Y +Z −Z.
    Cube,
    /// N times six layers, `samplerCubeArray`; not on every GPU, see [`Gpu::has_cube_arrays`].
    CubeArray(u32),
}

impl Shape {
    /// Number of array layers.
    pub fn layers(self) -> u32 {
        match self {
            Self::Flat => 1,
            Self::Layers(n) => n,
            Self::Cube => 6,
            Self::CubeArray(n) => 6 * n,
        }
    }

    fn view(self) -> vk::ImageViewType {
        match self {
            Self::Flat => vk::ImageViewType::TYPE_2D,
            Self::Layers(_) => vk::ImageViewType::TYPE_2D_ARRAY,
            Self::Cube => vk::ImageViewType::CUBE,
            Self::CubeArray(_) => vk::ImageViewType::CUBE_ARRAY,
        }
    }

    fn is_cube(self) -> bool {
        matches!(self, Self::Cube | Self::CubeArray(_))
    }
}

/// Format, size and use of an image.
#[derive(Clone, Copy, Debug)]
pub struct ImageDesc {
    pub format: vk::Format,
    /// Width and height in texels.
    pub size: [u32; 2],
    pub shape: Shape,
    pub mips: u32,
    /// 1 or 4.
    pub samples: u32,
    pub usage: vk::ImageUsageFlags,
}

impl ImageDesc {
    /// One layer, one mip, one sample.
    pub fn flat(format: vk::Format, size: [u32; 2], usage: vk::ImageUsageFlags) -> Self {
        Self { format, size, shape: Shape::Flat, mips: 1, samples: 1, usage }
    }

    /// Mips down to 1×1.
    pub fn full_mips(size: [u32; 2]) -> u32 {
        32 - size[0].max(size[1]).max(1).leading_zeros()
    }
}

/// How the GPU accesses an image at one moment: decides layout, stage and access of barriers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ImageAccess {
    /// Not used yet; the content is undefined.
    Fresh,
    /// Colour or resolve attachment.
    Colour,
    /// Depth attachment.
    Depth,
    /// A depth image sampled by any shader.
    DepthSampled,
    /// A colour image sampled by any shader.
    Sampled,
    /// Read and written by compute shaders, as a storage image.
    Storage,
    CopyFrom,
    CopyTo,
    /// Presented to a window.
    Present,
}

impl ImageAccess {
    /// All of them, each at the index of its own value.
    const ALL: [Self; 9] = [
        Self::Fresh,
        Self::Colour,
        Self::Depth,
        Self::DepthSampled,
        Self::Sampled,
        Self::Storage,
        Self::CopyFrom,
        Self::CopyTo,
        Self::Present,
    ];

    /// Whether it only reads: two such accesses in a row in the same layout need no barrier.
    pub(super) fn only_reads(self) -> bool {
        matches!(self, Self::Sampled | Self::DepthSampled | Self::CopyFrom)
    }

    pub(super) fn parts(self) -> (vk::ImageLayout, vk::PipelineStageFlags2, vk::AccessFlags2) {
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        match self {
            Self::Fresh => (L::UNDEFINED, S::NONE, A::NONE),
            Self::Colour => (
                L::COLOR_ATTACHMENT_OPTIMAL,
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
            ),
            Self::Depth => (
                L::DEPTH_ATTACHMENT_OPTIMAL,
                S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS,
                A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
            ),
            Self::DepthSampled => (
                L::DEPTH_READ_ONLY_OPTIMAL,
                S::VERTEX_SHADER | S::FRAGMENT_SHADER | S::COMPUTE_SHADER,
                A::SHADER_SAMPLED_READ,
            ),
            Self::Sampled => (
                L::SHADER_READ_ONLY_OPTIMAL,
                S::VERTEX_SHADER | S::FRAGMENT_SHADER | S::COMPUTE_SHADER,
                A::SHADER_SAMPLED_READ,
            ),
            Self::Storage => (L::GENERAL, S::COMPUTE_SHADER, A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE),
            Self::CopyFrom => (L::TRANSFER_SRC_OPTIMAL, S::ALL_TRANSFER, A::TRANSFER_READ),
            Self::CopyTo => (L::TRANSFER_DST_OPTIMAL, S::ALL_TRANSFER, A::TRANSFER_WRITE),
            Self::Present => (L::PRESENT_SRC_KHR, S::NONE, A::NONE),
        }
    }
}

/// One layer of one mip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subresource {
    pub mip: u32,
    pub layer: u32,
}

/// A view of an image that draws can write to; see [`super::Attachments`].
#[derive(Clone, Copy)]
pub struct AttachmentView<'a> {
    pub(super) raw: vk::ImageView,
    pub(super) layers: u32,
    /// The image stays alive while an attachment is described; its destruction waits for the submission.
    pub(super) of: PhantomData<&'a ()>,
}

/// An image, its memory and its views. For each mip of each layer it knows the access of the last recorded command.
/// Shared by reference count: descriptor sets hold the images they bind.
pub struct Image {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::Image,
    /// All mips and layers.
    pub(super) view: vk::ImageView,
    /// One per mip, all layers as an array; only for storage images.
    pub(super) mip_views: Vec<vk::ImageView>,
    /// All layers of mip 0, then each layer of each mip; only for attachments.
    attachment_views: Vec<vk::ImageView>,
    allocation: Option<Allocation>,
    desc: ImageDesc,
    /// The [`ImageAccess`] of each subresource, the layers of mip 0 first.
    accesses: Box<[AtomicU8]>,
}

impl Image {
    /// Creates an image; its content is undefined.
    ///
    /// # Errors
    /// An array of cubes where the GPU has none; larger than the GPU allows; no memory.
    pub fn new(gpu: &Arc<Gpu>, name: &str, desc: ImageDesc) -> Result<Arc<Self>> {
        if matches!(desc.shape, Shape::CubeArray(_)) && !gpu.has_cube_arrays() {
            let result = vk::Result::ERROR_FEATURE_NOT_PRESENT;
            return Err(Error::Vulkan { doing: "creating an array of cubes", result });
        }
        gpu.limits.check_image(name, desc.size, desc.shape.layers(), desc.shape.is_cube())?;
        let info = vk::ImageCreateInfo::default()
            .flags(if desc.shape.is_cube() { vk::ImageCreateFlags::CUBE_COMPATIBLE } else { Default::default() })
            .image_type(vk::ImageType::TYPE_2D)
            .format(desc.format)
            .extent(vk::Extent3D { width: desc.size[0], height: desc.size[1], depth: 1 })
            .mip_levels(desc.mips)
            .array_layers(desc.shape.layers())
            .samples(vk::SampleCountFlags::from_raw(desc.samples))
            .usage(desc.usage);
        // SAFETY: the device is alive, `info` is complete.
        let raw = unsafe { gpu.device.create_image(&info, None) }.map_err(Error::vulkan("creating an image"))?;
        // SAFETY: `raw` was just created by this device.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(raw) };
        let allocation = gpu.allocate(name, requirements, MemoryLocation::GpuOnly, false).inspect_err(|_| {
            // SAFETY: the GPU has never seen the image.
            unsafe { gpu.device.destroy_image(raw, None) }
        })?;
        // SAFETY: the memory outlives the object bound to it: both are freed together, the memory last.
        let (memory, offset) = (unsafe { allocation.memory() }, allocation.offset());
        // From here on, Drop releases the handles if a later step fails.
        let mut image = Self {
            gpu: Arc::clone(gpu),
            raw,
            view: vk::ImageView::null(),
            mip_views: Vec::new(),
            attachment_views: Vec::new(),
            allocation: Some(allocation),
            desc,
            accesses: (0..desc.mips * desc.shape.layers()).map(|_| AtomicU8::new(ImageAccess::Fresh as u8)).collect(),
        };
        // SAFETY: the memory was allocated for this image's requirements and is not bound elsewhere.
        unsafe { gpu.device.bind_image_memory(raw, memory, offset) }.map_err(Error::vulkan("binding image memory"))?;
        gpu.name(raw, name);
        image.make_views()?;
        Ok(Arc::new(image))
    }

    fn make_views(&mut self) -> Result<()> {
        let layers = self.desc.shape.layers();
        // An image that is only copied needs no views, and Vulkan allows it none.
        let copies = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        if !copies.contains(self.desc.usage) {
            self.view = self.make_view(self.desc.shape.view(), 0..self.desc.mips, 0..layers)?;
        }
        if self.desc.usage.contains(vk::ImageUsageFlags::STORAGE) {
            for mip in 0..self.desc.mips {
                let view = self.make_view(vk::ImageViewType::TYPE_2D_ARRAY, mip..mip + 1, 0..layers)?;
                self.mip_views.push(view);
            }
        }
        let attachment = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        if self.desc.usage.intersects(attachment) {
            let all = self.make_view(vk::ImageViewType::TYPE_2D_ARRAY, 0..1, 0..layers)?;
            self.attachment_views.push(all);
            for (mip, layer) in (0..self.desc.mips).flat_map(|mip| (0..layers).map(move |layer| (mip, layer))) {
                let view = self.make_view(vk::ImageViewType::TYPE_2D, mip..mip + 1, layer..layer + 1)?;
                self.attachment_views.push(view);
            }
        }
        Ok(())
    }

    /// The access of the last recorded command to one layer of one mip.
    pub(super) fn access(&self, mip: u32, layer: u32) -> ImageAccess {
        let value = self.accesses[self.index(mip, layer)].load(Ordering::Relaxed);
        ImageAccess::ALL[usize::from(value)]
    }

    pub(super) fn set_access(&self, mip: u32, layer: u32, access: ImageAccess) {
        self.accesses[self.index(mip, layer)].store(access as u8, Ordering::Relaxed);
    }

    fn index(&self, mip: u32, layer: u32) -> usize {
        let layers = self.desc.shape.layers();
        debug_assert!(layer < layers, "layer {layer} of {layers}");
        (mip * layers + layer) as usize
    }

    /// Its description at creation.
    pub fn desc(&self) -> &ImageDesc {
        &self.desc
    }

    /// The VkImage, for a headset's runtime.
    pub fn handle(&self) -> u64 {
        self.raw.as_raw()
    }

    /// Width and height of one mip.
    pub fn mip_size(&self, mip: u32) -> [u32; 2] {
        self.desc.size.map(|s| (s >> mip).max(1))
    }

    /// All layers of mip 0, to draw into.
    ///
    /// # Panics
    /// If the image was not created as an attachment: a defect of the caller.
    pub fn attachment(&self) -> AttachmentView<'_> {
        AttachmentView { raw: self.attachment_views[0], layers: self.desc.shape.layers(), of: PhantomData }
    }

    /// One layer of one mip, to draw into.
    ///
    /// # Panics
    /// As for [`Image::attachment`].
    pub fn attachment_of(&self, part: Subresource) -> AttachmentView<'_> {
        let raw = self.attachment_views[1 + self.index(part.mip, part.layer)];
        AttachmentView { raw, layers: 1, of: PhantomData }
    }

    pub(super) fn aspect(&self) -> vk::ImageAspectFlags {
        if self.desc.usage.contains(vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT) {
            vk::ImageAspectFlags::DEPTH
        } else {
            vk::ImageAspectFlags::COLOR
        }
    }

    /// The access under which shaders sample it.
    pub(super) fn sampled_access(&self) -> ImageAccess {
        if self.aspect() == vk::ImageAspectFlags::DEPTH { ImageAccess::DepthSampled } else { ImageAccess::Sampled }
    }

    fn make_view(&self, kind: vk::ImageViewType, mips: Range<u32>, layers: Range<u32>) -> Result<vk::ImageView> {
        let range = vk::ImageSubresourceRange::default()
            .aspect_mask(self.aspect())
            .base_mip_level(mips.start)
            .level_count(mips.end - mips.start)
            .base_array_layer(layers.start)
            .layer_count(layers.end - layers.start);
        let info = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(kind)
            .format(self.desc.format)
            .subresource_range(range);
        // SAFETY: the image is alive and has these mips and layers.
        unsafe { self.gpu.device.create_image_view(&info, None) }.map_err(Error::vulkan("creating an image view"))
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let mut views = std::mem::take(&mut self.mip_views);
        views.append(&mut self.attachment_views);
        views.push(self.view);
        if let Some(allocation) = self.allocation.take() {
            self.gpu.defer_destruction(Deferred::Image(self.raw, views, allocation));
        }
    }
}
