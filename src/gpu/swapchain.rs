//! A window's surface and swapchain: acquiring, presenting, and creating it again when the window changes.

use std::marker::PhantomData;
use std::sync::Arc;

use ash::{khr, vk};
use raw_window_handle::{RawDisplayHandle, RawWindowHandle};

use super::commands::{Commands, transition};
use super::copies::Rect;
use super::device::Gpu;
use super::image::{AttachmentView, Image, ImageAccess};
use super::submit::Acquired;
use super::window_images::{ACQUIRE_NS, RANGE, WindowImages};
use crate::{Error, Result};

/// When presented pictures are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PresentMode {
    /// With the display's refresh; no tearing.
    Vsync,
    /// The newest picture at each refresh; no tearing, no waiting.
    Mailbox,
    /// Immediately; may tear.
    Immediate,
}

impl PresentMode {
    /// Its name in messages and reports.
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

/// The result of [`Swapchain::poll`].
pub enum Polled {
    Ready(Acquired),
    /// The window system holds all images: poll again later.
    Busy,
    /// The swapchain does not fit the window: `resize` it.
    Stale,
}

/// The result of [`Swapchain::present`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presented {
    Good,
    /// Shown, but a new swapchain might suit the surface better.
    Suboptimal,
    /// Not shown: the swapchain does not fit the window any more.
    Stale,
}

/// The window's side of presenting.
pub struct Swapchain {
    gpu: Arc<Gpu>,
    surface_api: khr::surface::Instance,
    api: khr::swapchain::Device,
    surface: vk::SurfaceKHR,
    /// `None` while there is nothing to draw to: a minimised window, or a failed `resize`.
    current: Option<WindowImages>,
    /// Counts acquisitions.
    turn: usize,
}

impl Swapchain {
    /// Creates a surface for a window; images come with `resize`.
    ///
    /// # Safety
    /// Both handles must stay valid until the swapchain is dropped.
    pub unsafe fn new(gpu: &Arc<Gpu>, display: RawDisplayHandle, window: RawWindowHandle) -> Result<Self> {
        // SAFETY: the caller keeps the handles valid; the instance was created for this display.
        let surface =
            unsafe { ash_window::create_surface(&gpu.instance.entry, &gpu.instance.raw, display, window, None) }
                .map_err(Error::vulkan("creating a window surface"))?;
        Self::of_surface(gpu, surface)
    }

    /// Takes over a surface of the GPU's instance.
    fn of_surface(gpu: &Arc<Gpu>, surface: vk::SurfaceKHR) -> Result<Self> {
        let surface_api = khr::surface::Instance::new(&gpu.instance.entry, &gpu.instance.raw);
        let swapchain = Self {
            gpu: Arc::clone(gpu),
            surface_api,
            api: khr::swapchain::Device::new(&gpu.instance.raw, &gpu.device),
            surface,
            current: None,
            turn: 0,
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
        self.current.as_ref().map_or([0, 0], |images| images.size)
    }

    /// The format of its images, for pipelines that draw into them; `None` while there are none. Always sRGB.
    pub fn format(&self) -> Option<vk::Format> {
        self.current.as_ref().map(|images| images.format)
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

    /// Creates images of about `wanted` size; the surface decides. Waits for the GPU first.
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
            self.current = None;
            return Ok(());
        }
        let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::COLOR_ATTACHMENT;
        if !caps.supported_usage_flags.contains(usage) {
            return Err(Error::Window { problem: "its images can be neither copied to nor drawn into".into() });
        }
        let format = pick_format(&formats)?;
        let most = if caps.max_image_count == 0 { u32::MAX } else { caps.max_image_count };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count((caps.min_image_count + 1).max(3).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(vk::Extent2D { width: size[0], height: size[1] })
            .image_array_layers(1)
            .image_usage(usage)
            .pre_transform(pick_transform(&caps))
            .composite_alpha(pick_alpha(caps.supported_composite_alpha))
            .present_mode(mode.raw())
            .clipped(true)
            .old_swapchain(self.current.as_ref().map_or(vk::SwapchainKHR::null(), |old| old.raw));
        // SAFETY: the surface is alive, the old swapchain is ours and idle.
        let created = unsafe { self.api.create_swapchain(&info, None) };
        // Even if creation failed, the old swapchain cannot be used any more.
        self.current = None;
        self.current = match created {
            Ok(raw) => Some(WindowImages::new(&self.gpu, &self.api, raw, format.format, size)?),
            // The window shrank to nothing, or is being replaced, between the question and the call.
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR | vk::Result::ERROR_INITIALIZATION_FAILED) => None,
            Err(result) => return Err(Error::Vulkan { doing: "creating a swapchain", result }),
        };
        Ok(())
    }

    /// The next image to draw to, or `None` where the swapchain does not fit the window any more, or the window system
    /// has given no image for a second: `resize` it.
    pub fn acquire(&mut self) -> Result<Option<Acquired>> {
        let Some(images) = &self.current else { return Ok(None) };
        let ready = images.ready[self.turn % images.ready.len()];
        // SAFETY: the swapchain is alive; the semaphore's last wait was `images + 1` acquisitions ago.
        let acquired = unsafe { self.api.acquire_next_image(images.raw, ACQUIRE_NS, ready, vk::Fence::null()) };
        match acquired {
            Ok((index, _)) => {
                self.turn += 1;
                Ok(Some(Acquired::new(index, Some(ready), images.done[index as usize])))
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR | vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(None),
            Err(result) => Err(Error::Vulkan { doing: "acquiring a window image", result }),
        }
    }

    /// Like `acquire`, but waits for nothing: [`Polled::Busy`] where no image is free yet. Of a swapchain, one of the two
    /// is used, never both.
    pub fn poll(&mut self) -> Result<Polled> {
        let Some(images) = &mut self.current else { return Ok(Polled::Stale) };
        let fence = images.fence;
        let index = match images.asked {
            Some(index) => index,
            // SAFETY: the swapchain is alive; the fence is not in use.
            None => match unsafe { self.api.acquire_next_image(images.raw, 0, vk::Semaphore::null(), fence) } {
                Ok((index, _)) => index,
                Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(Polled::Busy),
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => return Ok(Polled::Stale),
                Err(result) => return Err(Error::Vulkan { doing: "acquiring a window image", result }),
            },
        };
        images.asked = Some(index);
        // SAFETY: the fence is this device's and alive.
        if !unsafe { self.gpu.device.get_fence_status(fence) }.map_err(Error::vulkan("asking for a window image"))? {
            return Ok(Polled::Busy);
        }
        // SAFETY: the fence is signalled, nothing uses it.
        unsafe { self.gpu.device.reset_fences(&[fence]) }.map_err(Error::vulkan("asking for a window image"))?;
        images.asked = None;
        Ok(Polled::Ready(Acquired::new(index, None, images.done[index as usize])))
    }

    /// Prepares the acquired image to be drawn into, its content undefined, and returns its view; `end_drawing` comes
    /// after the draws.
    pub fn begin_drawing(&self, commands: &mut Commands<'_>, to: &mut Acquired) -> Result<AttachmentView<'_>> {
        let images = self.current.as_ref().ok_or_else(no_images)?;
        to.first_touch = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT;
        // As in `copy`: the layout changes after the acquisition.
        let start = transition(ImageAccess::Fresh, ImageAccess::Colour).src_stage_mask(to.first_touch);
        let index = to.index as usize;
        commands.raw_image_barrier(start.image(images.images[index]).subresource_range(RANGE));
        Ok(AttachmentView { raw: images.views[index], layers: 1, of: PhantomData })
    }

    /// The same after `copy`, whose content stays.
    pub fn begin_drawing_over(&self, commands: &mut Commands<'_>, to: &Acquired) -> Result<AttachmentView<'_>> {
        let images = self.current.as_ref().ok_or_else(no_images)?;
        let index = to.index as usize;
        let over = transition(ImageAccess::CopyTo, ImageAccess::Colour);
        commands.raw_image_barrier(over.image(images.images[index]).subresource_range(RANGE));
        Ok(AttachmentView { raw: images.views[index], layers: 1, of: PhantomData })
    }

    /// Transitions the drawn image for presenting.
    pub fn end_drawing(&self, commands: &mut Commands<'_>, to: &Acquired) {
        let Some(images) = &self.current else { return };
        let end = transition(ImageAccess::Colour, ImageAccess::Present);
        commands.raw_image_barrier(end.image(images.images[to.index as usize]).subresource_range(RANGE));
    }

    /// Scales a picture, its first layer, over the whole acquired image; `from` must be prepared for `CopyFrom`. `end_copy` or
    /// `begin_drawing_over` comes after it.
    pub fn copy(&self, commands: &mut Commands<'_>, from: &Image, to: &Acquired) {
        let Some(images) = &self.current else { return };
        let image = images.images[to.index as usize];
        // The acquisition is waited for at these stages, and this barrier begins at the same ones: so the layout changes
        // after the window system has read the image. The blit, all that writes to it, comes after the change.
        let start = transition(ImageAccess::Fresh, ImageAccess::CopyTo).src_stage_mask(to.first_touch);
        commands.raw_image_barrier(start.image(image).subresource_range(RANGE));
        let layer = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        };
        commands.blit_raw(from.raw, image, [from.desc().size, self.size()].map(Rect::of), [layer; 2]);
    }

    /// Transitions the image for presenting after `copy`.
    pub fn end_copy(&self, commands: &mut Commands<'_>, to: &Acquired) {
        let Some(images) = &self.current else { return };
        let end = transition(ImageAccess::CopyTo, ImageAccess::Present);
        commands.raw_image_barrier(end.image(images.images[to.index as usize]).subresource_range(RANGE));
    }

    /// Shows a drawn image, whose commands have been submitted.
    pub fn present(&mut self, acquired: Acquired) -> Result<Presented> {
        let Some(images) = &self.current else { return Ok(Presented::Stale) };
        let (waits, swapchains, indices) = ([acquired.done], [images.raw], [acquired.index]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&swapchains).image_indices(&indices);
        let queue = self.gpu.queue();
        // SAFETY: the queue is locked; the image was acquired and its drawing submitted.
        match unsafe { self.api.queue_present(*queue, &info) } {
            Ok(false) => Ok(Presented::Good),
            Ok(true) => Ok(Presented::Suboptimal),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Presented::Stale),
            Err(result) => Err(Error::Vulkan { doing: "showing a picture", result }),
        }
    }

    /// The presentation engine may wait on `done` semaphores until the queue is idle.
    fn wait_presents(&self) -> Result<()> {
        let queue = self.gpu.queue();
        // SAFETY: the queue is locked.
        unsafe { self.gpu.device.queue_wait_idle(*queue) }.map_err(Error::vulkan("waiting for the window"))
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // A lost device cannot be waited for, and then nothing is running.
        let _ = self.gpu.wait_idle();
        let _ = self.wait_presents();
        self.current = None;
        // SAFETY: the swapchain is gone, nothing else uses the surface.
        unsafe { self.surface_api.destroy_surface(self.surface, None) };
    }
}

fn no_images() -> Error {
    Error::Window { problem: "it has no images to draw into".into() }
}

fn extent(caps: &vk::SurfaceCapabilitiesKHR, wanted: [u32; 2]) -> [u32; 2] {
    // The special value means that the swapchain decides the window's size (Wayland).
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

/// Pictures are drawn upright: where the surface can rotate them itself, it does.
fn pick_transform(caps: &vk::SurfaceCapabilitiesKHR) -> vk::SurfaceTransformFlagsKHR {
    let upright = vk::SurfaceTransformFlagsKHR::IDENTITY;
    if caps.supported_transforms.contains(upright) { upright } else { caps.current_transform }
}

fn pick_alpha(there: vk::CompositeAlphaFlagsKHR) -> vk::CompositeAlphaFlagsKHR {
    use vk::CompositeAlphaFlagsKHR as A;
    [A::OPAQUE, A::INHERIT, A::PRE_MULTIPLIED].into_iter().find(|a| there.contains(*a)).unwrap_or(A::POST_MULTIPLIED)
}

#[cfg(test)]
mod gpu_tests {
    use super::super::{Attachments, ColourAttachment, CommandBuffer, GpuOptions, Instance};
    use super::*;

    /// A GPU that presents to surfaces without a display; `None` where the driver has none.
    fn headless() -> Option<(Arc<Gpu>, Swapchain)> {
        let extensions = [khr::surface::NAME, ash::ext::headless_surface::NAME].map(std::ffi::CStr::to_owned);
        let instance = Arc::new(Instance::new(true, None, &extensions).ok()?);
        let asked = |_| Ok(vec![khr::swapchain::NAME.to_owned()]);
        let gpu = Gpu::open_for_headset(GpuOptions::default(), &instance, 0, asked).unwrap();
        let api = ash::ext::headless_surface::Instance::new(&instance.entry, &instance.raw);
        // SAFETY: the instance has the extension; the swapchain takes over the surface.
        let surface = unsafe { api.create_headless_surface(&Default::default(), None) }.unwrap();
        let swapchain = Swapchain::of_surface(&gpu, surface).unwrap();
        Some((gpu, swapchain))
    }

    #[test]
    fn window_images_are_drawn_into_and_presented() {
        let Some((gpu, mut swapchain)) = headless() else {
            println!("skipped: this driver has no headless surfaces");
            return;
        };
        let mut buffer = CommandBuffer::new(&gpu).unwrap();
        assert!(swapchain.acquire().unwrap().is_none(), "an image without a size");
        for size in [[64, 32], [32, 64]] {
            swapchain.resize(size, PresentMode::Vsync).unwrap();
            assert_eq!(swapchain.size(), size);
            assert!(swapchain.format().is_some());
            for _ in 0..6 {
                let mut acquired = swapchain.acquire().unwrap().unwrap();
                let (mut commands, _) = buffer.begin().unwrap();
                let view = swapchain.begin_drawing(&mut commands, &mut acquired).unwrap();
                let colours = &[ColourAttachment::cleared(view, [0.0, 1.0, 0.0, 1.0])];
                commands.render(&Attachments { colours, depth: None, area: size }, |_| ());
                swapchain.end_drawing(&mut commands, &acquired);
                commands.submit(Some(&acquired)).unwrap();
                swapchain.present(acquired).unwrap();
            }
        }
        swapchain.resize([0, 0], PresentMode::Vsync).unwrap();
        drop(swapchain);
        drop(buffer);
        let messages = gpu.messages();
        drop(gpu);
        messages.check().unwrap();
    }

    #[test]
    fn pictures_are_upright_where_the_surface_rotates_them_itself() {
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
