//! One VkSwapchainKHR with its images, views, semaphores and fence: created together, destroyed together.

use std::sync::Arc;

use ash::{khr, vk};

use super::device::Gpu;
use crate::{Error, Result};

/// How long the window system may keep all images: a hidden window's may never come back, and events wait meanwhile.
pub(super) const ACQUIRE_NS: u64 = 1_000_000_000;

/// A VkSwapchainKHR and its images. Dropped only after the GPU and the queue have been waited for.
pub(super) struct WindowImages {
    gpu: Arc<Gpu>,
    api: khr::swapchain::Device,
    pub(super) raw: vk::SwapchainKHR,
    pub(super) format: vk::Format,
    /// Width and height in pixels.
    pub(super) size: [u32; 2],
    pub(super) images: Vec<vk::Image>,
    /// One per image, to draw into.
    pub(super) views: Vec<vk::ImageView>,
    /// One more than images, taken in turn: an acquisition's semaphore has been waited for before it comes round again.
    pub(super) ready: Vec<vk::Semaphore>,
    /// One per image: presenting an image again proves its last wait is over.
    pub(super) done: Vec<vk::Semaphore>,
    /// Signalled when the image that was asked for without waiting is free.
    pub(super) fence: vk::Fence,
    /// The image that was asked for without waiting and is not known to be free yet.
    pub(super) asked: Option<u32>,
}

impl WindowImages {
    /// Takes ownership of a new swapchain; if a step fails, it is destroyed with all objects created for it.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        api: &khr::swapchain::Device,
        raw: vk::SwapchainKHR,
        format: vk::Format,
        size: [u32; 2],
    ) -> Result<Self> {
        // From here on, Drop releases the objects created so far.
        let mut new = Self {
            gpu: Arc::clone(gpu),
            api: api.clone(),
            raw,
            format,
            size,
            images: Vec::new(),
            views: Vec::new(),
            ready: Vec::new(),
            done: Vec::new(),
            fence: vk::Fence::null(),
            asked: None,
        };
        // SAFETY: the swapchain was just created.
        new.images = unsafe { api.get_swapchain_images(raw) }.map_err(Error::vulkan("asking for window images"))?;
        // SAFETY: the device is alive.
        new.fence = unsafe { gpu.device.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(Error::vulkan("creating a fence"))?;
        new.ready.push(new.semaphore()?);
        for i in 0..new.images.len() {
            new.ready.push(new.semaphore()?);
            new.done.push(new.semaphore()?);
            new.views.push(new.view(new.images[i])?);
        }
        Ok(new)
    }

    fn semaphore(&self) -> Result<vk::Semaphore> {
        // SAFETY: the device is alive.
        unsafe { self.gpu.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }
            .map_err(Error::vulkan("creating a semaphore"))
    }

    fn view(&self, image: vk::Image) -> Result<vk::ImageView> {
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(self.format)
            .subresource_range(RANGE);
        // SAFETY: the image is the swapchain's and of this format.
        unsafe { self.gpu.device.create_image_view(&info, None) }.map_err(Error::vulkan("creating an image view"))
    }
}

/// All of a window image.
pub(super) const RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

impl Drop for WindowImages {
    fn drop(&mut self) {
        let device = &self.gpu.device;
        // SAFETY: the owner has waited for the GPU and the queue, and the fence is waited for where it is in use. A
        // window system that has not signalled it by then no longer uses it.
        unsafe {
            if self.asked.is_some() {
                let _ = device.wait_for_fences(&[self.fence], true, ACQUIRE_NS);
            }
            device.destroy_fence(self.fence, None);
            self.views.drain(..).for_each(|view| device.destroy_image_view(view, None));
            self.ready.drain(..).chain(self.done.drain(..)).for_each(|s| device.destroy_semaphore(s, None));
            self.api.destroy_swapchain(self.raw, None);
        }
    }
}
