//! A window's surface and swapchain: acquiring, presenting, and making it anew when the window changes.

use std::sync::Arc;

use ash::{khr, vk};
use raw_window_handle::{RawDisplayHandle, RawWindowHandle};

use super::commands::{Commands, Rect, Subresource, transition};
use super::device::Gpu;
use super::image::{Image, ImageAccess};
use super::submit::{Acquired, FIRST_TOUCH};
use crate::{Error, Result};

/// How long the window system may keep all images: a hidden window's may never come back, and events wait meanwhile.
const ACQUIRE_NS: u64 = 1_000_000_000;

/// When pictures are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PresentMode {
    /// With the display's refresh; no tearing.
    Vsync,
    /// The newest picture at each refresh; no tearing, no waiting.
    Mailbox,
    /// At once; may tear.
    Immediate,
}

impl PresentMode {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vsync => "vsync",
            Self::Mailbox => "mailbox",
            Self::Immediate => "immediate",
        }
    }

    fn raw(self) -> vk::PresentModeKHR {
        match self {
            Self::Vsync => vk::PresentModeKHR::FIFO,
            Self::Mailbox => vk::PresentModeKHR::MAILBOX,
            Self::Immediate => vk::PresentModeKHR::IMMEDIATE,
        }
    }
}

/// What asking for an image without waiting gives.
pub enum Polled {
    Ready(Acquired),
    /// The window system has all images: ask again later.
    Busy,
    /// The swapchain does not fit the window: `resize` it.
    Stale,
}

/// What showing a picture gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presented {
    Good,
    /// It is shown, but another swapchain might suit the surface better.
    Suboptimal,
    /// It is not: the swapchain does not fit the window any more.
    Stale,
}

/// The window's side of presenting.
pub struct Swapchain {
    gpu: Arc<Gpu>,
    surface_api: khr::surface::Instance,
    api: khr::swapchain::Device,
    surface: vk::SurfaceKHR,
    raw: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    size: [u32; 2],
    mode: PresentMode,
    /// One more than images, taken in turn: an acquisition's semaphore has been waited for before it comes round again.
    ready: Vec<vk::Semaphore>,
    /// One per image: presenting an image again proves its last wait is over.
    done: Vec<vk::Semaphore>,
    turn: usize,
    /// Signalled when the image that `poll` has asked for is free, and that image.
    polled: (vk::Fence, Option<u32>),
}

impl Swapchain {
    /// Makes a surface for a window; images come with `resize`.
    ///
    /// # Safety
    /// Both handles must stay valid until the swapchain is dropped.
    pub unsafe fn new(gpu: &Arc<Gpu>, display: RawDisplayHandle, window: RawWindowHandle) -> Result<Self> {
        // SAFETY: the caller keeps the handles valid; the instance was made for this display.
        let surface =
            unsafe { ash_window::create_surface(&gpu.instance.entry, &gpu.instance.raw, display, window, None) }
                .map_err(Error::vulkan("making a window surface"))?;
        let surface_api = khr::surface::Instance::new(&gpu.instance.entry, &gpu.instance.raw);
        let swapchain = Self {
            gpu: Arc::clone(gpu),
            surface_api,
            api: khr::swapchain::Device::new(&gpu.instance.raw, &gpu.device),
            surface,
            raw: vk::SwapchainKHR::null(),
            images: Vec::new(),
            size: [0, 0],
            mode: PresentMode::Vsync,
            ready: Vec::new(),
            done: Vec::new(),
            turn: 0,
            polled: (vk::Fence::null(), None),
        };
        // SAFETY: family, surface and physical device belong together.
        let presents =
            unsafe { swapchain.surface_api.get_physical_device_surface_support(gpu.physical, gpu.family, surface) };
        if presents.map_err(Error::vulkan("asking about presenting"))? {
            Ok(swapchain)
        } else {
            Err(Error::Window {
                problem: format!("{} cannot present to it; choose another with --gpu", gpu.info().name),
            })
        }
    }

    /// The size of its images; 0×0 while there are none.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The modes this surface has; Vsync is always there.
    pub fn modes(&self) -> Vec<PresentMode> {
        // SAFETY: surface and physical device are alive; the call only reads.
        let modes =
            unsafe { self.surface_api.get_physical_device_surface_present_modes(self.gpu.physical, self.surface) }
                .unwrap_or_default();
        let all = [PresentMode::Vsync, PresentMode::Mailbox, PresentMode::Immediate];
        all.into_iter().filter(|m| *m == PresentMode::Vsync || modes.contains(&m.raw())).collect()
    }

    /// Makes images of about `wanted` size (the surface has the last word). Waits for the GPU first.
    /// A surface of size 0×0 (a minimised window) leaves it without images.
    pub fn resize(&mut self, wanted: [u32; 2], mode: PresentMode) -> Result<()> {
        self.gpu.wait_idle()?;
        self.wait_presents()?;
        // SAFETY: surface and physical device are alive; the calls only read.
        let (caps, formats) = unsafe {
            let caps = self.surface_api.get_physical_device_surface_capabilities(self.gpu.physical, self.surface);
            let formats = self.surface_api.get_physical_device_surface_formats(self.gpu.physical, self.surface);
            (
                caps.map_err(Error::vulkan("asking about the window"))?,
                formats.map_err(Error::vulkan("asking about the window"))?,
            )
        };
        let size = extent(&caps, wanted);
        if size.contains(&0) {
            self.destroy_images();
            return Ok(());
        }
        if !caps.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST) {
            return Err(Error::Window { problem: "this display does not take copied pictures".into() });
        }
        let format = pick_format(&formats)?;
        let most = if caps.max_image_count == 0 { u32::MAX } else { caps.max_image_count };
        let old = self.raw;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count((caps.min_image_count + 1).max(3).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(vk::Extent2D { width: size[0], height: size[1] })
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .pre_transform(pick_transform(&caps))
            .composite_alpha(pick_alpha(caps.supported_composite_alpha))
            .present_mode(mode.raw())
            .clipped(true)
            .old_swapchain(old);
        // SAFETY: the surface is alive, the old swapchain is ours and idle.
        let made = unsafe { self.api.create_swapchain(&info, None) };
        // Whether or not a new one was made, the old one is spent.
        self.destroy_images();
        self.raw = match made {
            Ok(raw) => raw,
            // The window shrank to nothing, or is being replaced, between the question and the call.
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR | vk::Result::ERROR_INITIALIZATION_FAILED) => return Ok(()),
            Err(result) => return Err(Error::Vulkan { doing: "making a swapchain", result }),
        };
        self.mode = mode;
        self.size = size;
        // SAFETY: the swapchain was just made.
        self.images =
            unsafe { self.api.get_swapchain_images(self.raw) }.map_err(Error::vulkan("asking for window images"))?;
        self.ready = self.semaphores(self.images.len() + 1)?;
        self.done = self.semaphores(self.images.len())?;
        // SAFETY: the device is alive.
        let fence = unsafe { self.gpu.device.create_fence(&vk::FenceCreateInfo::default(), None) };
        self.polled = (fence.map_err(Error::vulkan("making a fence"))?, None);
        Ok(())
    }

    /// The next image to draw to, or `None` where the swapchain does not fit the window any more, or the window system
    /// has given no image for a second: `resize` it.
    pub fn acquire(&mut self) -> Result<Option<Acquired>> {
        if self.images.is_empty() {
            return Ok(None);
        }
        let ready = self.ready[self.turn % self.ready.len()];
        // SAFETY: the swapchain is alive; the semaphore's last wait was `images + 1` acquisitions ago.
        let acquired = unsafe { self.api.acquire_next_image(self.raw, ACQUIRE_NS, ready, vk::Fence::null()) };
        match acquired {
            Ok((index, _)) => {
                self.turn += 1;
                Ok(Some(Acquired { index, ready: Some(ready), done: self.done[index as usize] }))
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR | vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(None),
            Err(result) => Err(Error::Vulkan { doing: "taking a window image", result }),
        }
    }

    /// Like `acquire`, but waits for nothing: `None` also where no image is free yet. Of a swapchain, one of the two is
    /// used, never both.
    pub fn poll(&mut self) -> Result<Polled> {
        if self.images.is_empty() {
            return Ok(Polled::Stale);
        }
        let (fence, asked) = self.polled;
        let index = match asked {
            Some(index) => index,
            // SAFETY: the swapchain is alive; the fence is not in use.
            None => match unsafe { self.api.acquire_next_image(self.raw, 0, vk::Semaphore::null(), fence) } {
                Ok((index, _)) => index,
                Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(Polled::Busy),
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => return Ok(Polled::Stale),
                Err(result) => return Err(Error::Vulkan { doing: "taking a window image", result }),
            },
        };
        self.polled.1 = Some(index);
        // SAFETY: the fence is this device's and alive.
        if !unsafe { self.gpu.device.get_fence_status(fence) }.map_err(Error::vulkan("asking for a window image"))? {
            return Ok(Polled::Busy);
        }
        // SAFETY: the fence is signalled, nothing uses it.
        unsafe { self.gpu.device.reset_fences(&[fence]) }.map_err(Error::vulkan("asking for a window image"))?;
        self.polled.1 = None;
        Ok(Polled::Ready(Acquired { index, ready: None, done: self.done[index as usize] }))
    }

    /// Scales one layer of a picture over the whole acquired image; `from` must be prepared for `CopyFrom`.
    pub fn copy(&self, commands: &mut Commands<'_>, from: &Image, part: Subresource, to: &Acquired) {
        let whole = [Rect::of(from.mip_size(part.mip)), Rect::of(self.size)];
        self.copy_parts(commands, from, &[(part, whole)], to);
    }

    /// Scales parts of a picture's layers into parts of the acquired image and leaves the rest black; `from` must be
    /// prepared for `CopyFrom`.
    pub fn copy_parts(
        &self,
        commands: &mut Commands<'_>,
        from: &Image,
        parts: &[(Subresource, [Rect; 2])],
        to: &Acquired,
    ) {
        let image = self.images[to.index as usize];
        let range = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            level_count: 1,
            layer_count: 1,
            ..Default::default()
        };
        // The acquisition is waited for at these stages, and this barrier begins at the same ones: so the layout changes
        // after the window system has read the image. Clear and blits, all that writes to it, come after the change.
        let start = transition(ImageAccess::Fresh, ImageAccess::CopyTo).src_stage_mask(FIRST_TOUCH);
        commands.raw_image_barrier(start.image(image).subresource_range(range));
        let layers = |mip, layer| vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: mip,
            base_array_layer: layer,
            layer_count: 1,
        };
        let covered = parts.iter().any(|(_, [_, onto])| *onto == Rect::of(self.size));
        if !covered {
            commands.clear_raw(image, range);
            commands.copied();
        }
        for (part, rects) in parts {
            commands.blit_raw(from.raw, image, *rects, [layers(part.mip, part.layer), layers(0, 0)]);
        }
        commands.raw_image_barrier(
            transition(ImageAccess::CopyTo, ImageAccess::Present).image(image).subresource_range(range),
        );
    }

    /// Shows a drawn image.
    pub fn present(&mut self, acquired: Acquired) -> Result<Presented> {
        let (waits, swapchains, indices) = ([acquired.done], [self.raw], [acquired.index]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&swapchains).image_indices(&indices);
        let queue = self.gpu.queue();
        // SAFETY: the queue is locked; the image was acquired and its drawing submitted.
        match unsafe { self.api.queue_present(queue.raw, &info) } {
            Ok(false) => Ok(Presented::Good),
            Ok(true) => Ok(Presented::Suboptimal),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Presented::Stale),
            Err(result) => Err(Error::Vulkan { doing: "showing a picture", result }),
        }
    }

    fn semaphores(&self, count: usize) -> Result<Vec<vk::Semaphore>> {
        let info = vk::SemaphoreCreateInfo::default();
        // SAFETY: the device is alive.
        let make = |_| unsafe { self.gpu.device.create_semaphore(&info, None) };
        (0..count).map(make).collect::<std::result::Result<_, _>>().map_err(Error::vulkan("making a semaphore"))
    }

    /// The presentation engine may wait on `done` semaphores until the queue is idle.
    fn wait_presents(&self) -> Result<()> {
        let queue = self.gpu.queue();
        // SAFETY: the queue is locked.
        unsafe { self.gpu.device.queue_wait_idle(queue.raw) }.map_err(Error::vulkan("waiting for the window"))
    }

    fn destroy_images(&mut self) {
        self.size = [0, 0];
        self.images.clear();
        let semaphores = self.ready.drain(..).chain(self.done.drain(..));
        let (fence, asked) = std::mem::take(&mut self.polled);
        // SAFETY: the caller has waited for the GPU and the queue, and the fence is waited for where it is in use. A
        // window system that never signals it has died, and uses it no more.
        unsafe {
            if asked.is_some() {
                let _ = self.gpu.device.wait_for_fences(&[fence], true, ACQUIRE_NS);
            }
            self.gpu.device.destroy_fence(fence, None);
            semaphores.for_each(|s| self.gpu.device.destroy_semaphore(s, None));
            self.api.destroy_swapchain(std::mem::take(&mut self.raw), None);
        }
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // A lost device cannot be waited for, and then nothing is running.
        let _ = self.gpu.wait_idle();
        let _ = self.wait_presents();
        self.destroy_images();
        // SAFETY: the swapchain is gone, nothing else uses the surface.
        unsafe { self.surface_api.destroy_surface(self.surface, None) };
    }
}

fn extent(caps: &vk::SurfaceCapabilitiesKHR, wanted: [u32; 2]) -> [u32; 2] {
    // The special value says that the swapchain decides the window's size (Wayland).
    if caps.current_extent.width != u32::MAX {
        return [caps.current_extent.width, caps.current_extent.height];
    }
    let (min, max) = (caps.min_image_extent, caps.max_image_extent);
    [wanted[0].clamp(min.width, max.width), wanted[1].clamp(min.height, max.height)]
}

fn pick_format(formats: &[vk::SurfaceFormatKHR]) -> Result<vk::SurfaceFormatKHR> {
    let srgb = [vk::Format::B8G8R8A8_SRGB, vk::Format::R8G8B8A8_SRGB];
    let found = formats.iter().find(|f| srgb.contains(&f.format) && f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR);
    found.copied().ok_or_else(|| Error::Window { problem: "this display has no sRGB format".into() })
}

/// Ours are upright pictures: where the surface can, it turns them itself.
fn pick_transform(caps: &vk::SurfaceCapabilitiesKHR) -> vk::SurfaceTransformFlagsKHR {
    let upright = vk::SurfaceTransformFlagsKHR::IDENTITY;
    if caps.supported_transforms.contains(upright) { upright } else { caps.current_transform }
}

fn pick_alpha(there: vk::CompositeAlphaFlagsKHR) -> vk::CompositeAlphaFlagsKHR {
    use vk::CompositeAlphaFlagsKHR as A;
    [A::OPAQUE, A::INHERIT, A::PRE_MULTIPLIED].into_iter().find(|a| there.contains(*a)).unwrap_or(A::POST_MULTIPLIED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_upright_where_the_surface_turns_them_itself() {
        use vk::SurfaceTransformFlagsKHR as T;
        let caps = |supported, current| vk::SurfaceCapabilitiesKHR {
            supported_transforms: supported,
            current_transform: current,
            ..Default::default()
        };
        assert_eq!(pick_transform(&caps(T::IDENTITY, T::IDENTITY)), T::IDENTITY);
        assert_eq!(pick_transform(&caps(T::IDENTITY | T::ROTATE_90, T::ROTATE_90)), T::IDENTITY);
        assert_eq!(pick_transform(&caps(T::ROTATE_90, T::ROTATE_90)), T::ROTATE_90);
    }
}
