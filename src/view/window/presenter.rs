//! The window's swapchain and frames in flight; the swapchain is recreated whenever the window changes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::Window;

use super::fit::Fit;
use crate::gpu::{
    Acquired, ColourAttachment, FrameRing, Gpu, Image, ImageAccess, PassTimes, Polled, PresentMode, Subresource,
    Swapchain, read_image,
};
use crate::render::{
    FRAME_BYTES, FrameInputs, MirrorPart, MirrorPicture, Renderer, UI_BYTES, UiFrame, UiRenderer, UiTarget,
};
use crate::{Error, Result};

/// The pause after a failed acquisition.
const RETRY: Duration = Duration::from_millis(20);
/// The pause for mirrors that cannot be shown or whose windows change all the time: making a swapchain costs the headset
/// frames.
const MIRROR_RETRY: Duration = Duration::from_millis(250);

/// The colour of a window without a picture, linear.
const GROUND: [f32; 4] = [0.01, 0.01, 0.01, 1.0];

/// What a frame of the window shows behind the interface.
pub enum Content<'a> {
    /// There is no scene yet.
    Nothing,
    /// The picture of a scene that has been drawn.
    Picture(&'a Renderer),
    /// Parts of the eyes' picture that has been drawn for a headset.
    Mirror(&'a Arc<Image>, &'a [MirrorPart]),
    /// A new picture of a scene.
    Scene(&'a mut Renderer, &'a FrameInputs<'a>),
}

/// Presents frames in one window.
pub struct WindowPresenter {
    gpu: Arc<Gpu>,
    swapchain: Swapchain,
    ring: FrameRing,
    ui: UiRenderer,
    mode: PresentMode,
    fit: Fit,
    /// Made with the first frame of a headset.
    mirror: Option<MirrorPicture>,
    retry_at: Option<Instant>,
}

impl WindowPresenter {
    /// For a window on the display that the GPU was opened for.
    ///
    /// # Safety
    /// The window and its event loop must outlive the presenter.
    pub unsafe fn new(gpu: &Arc<Gpu>, window: &Window) -> Result<Self> {
        let no_handle = |e| Error::Window { problem: format!("it has no handle ({e})") };
        let display = window.display_handle().map_err(no_handle)?.as_raw();
        let handle = window.window_handle().map_err(no_handle)?.as_raw();
        // SAFETY: the caller keeps the window and the event loop alive for as long.
        let swapchain = unsafe { Swapchain::new(gpu, display, handle) }?;
        let ring = FrameRing::new(gpu, FRAME_BYTES + UI_BYTES)?;
        let ui = UiRenderer::new(gpu)?;
        let gpu = Arc::clone(gpu);
        Ok(Self { gpu, swapchain, ring, ui, mode: PresentMode::Vsync, fit: Fit::none(), mirror: None, retry_at: None })
    }

    /// Notes that the window's size has changed.
    pub fn window_changed(&mut self) {
        self.fit.changed();
    }

    /// Changes to the surface's next present mode.
    pub fn next_mode(&mut self) -> PresentMode {
        let modes = self.swapchain.modes();
        let at = modes.iter().position(|mode| *mode == self.mode).unwrap_or(0);
        self.mode = modes.get((at + 1) % modes.len().max(1)).copied().unwrap_or(PresentMode::Vsync);
        self.fit.changed();
        self.mode
    }

    /// The present mode.
    pub fn mode(&self) -> PresentMode {
        self.mode
    }

    /// The slot of the frame that `show` draws next.
    pub fn slot(&self) -> usize {
        self.ring.next_slot()
    }

    /// The size of its images, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.swapchain.size()
    }

    /// When to try again, if the last try to get an image failed.
    pub fn retry_at(&self) -> Option<Instant> {
        self.retry_at
    }

    /// Waits for the slot's previous frame and for an image; `wanted` is the window's size. `None` if no image is available.
    /// Returns the previous frame's times.
    pub fn begin(&mut self, wanted: [u32; 2]) -> Result<(Option<Acquired>, PassTimes)> {
        let times = self.ring.finish_slot()?;
        if self.fit.is_stale() {
            self.make_swapchain(wanted, Instant::now())?;
        }
        let acquired = self.swapchain.acquire()?;
        self.retry_at = acquired.is_none().then(|| Instant::now() + RETRY);
        if acquired.is_none() {
            self.fit.changed();
        }
        Ok((acquired, times))
    }

    fn make_swapchain(&mut self, wanted: [u32; 2], now: Instant) -> Result<()> {
        self.swapchain.resize(wanted, self.mode)?;
        self.fit.made(now);
        Ok(())
    }

    /// Stops waiting for the display's refresh, if the surface supports that.
    pub fn choose_free_mode(&mut self) {
        let modes = self.swapchain.modes();
        let free = [PresentMode::Mailbox, PresentMode::Immediate].into_iter().find(|mode| modes.contains(mode));
        self.mode = free.unwrap_or(self.mode);
        self.fit.changed();
    }

    /// Waits for the display's refresh again, which then paces the frames.
    pub fn choose_vsync(&mut self) {
        self.mode = PresentMode::Vsync;
        self.fit.changed();
    }

    /// Like `begin`, without waiting for an image.
    pub fn poll(&mut self, wanted: [u32; 2], now: Instant) -> Result<Option<Acquired>> {
        if wanted.contains(&0) || self.retry_at.is_some_and(|at| now < at) {
            return Ok(None);
        }
        if self.fit.is_stale() {
            let due = self.fit.due_at(now, MIRROR_RETRY);
            if now < due {
                self.retry_at = Some(due);
                return Ok(None);
            }
            self.make_swapchain(wanted, now)?;
        }
        self.retry_at = None;
        match self.swapchain.poll()? {
            Polled::Ready(acquired) => {
                self.ring.finish_slot()?;
                Ok(Some(acquired))
            }
            Polled::Busy => Ok(None),
            Polled::Stale => {
                self.fit.changed();
                self.retry_at = Some(now + MIRROR_RETRY);
                Ok(None)
            }
        }
    }

    /// Draws what is to be seen and shows it; returns the processor time of recording and submitting.
    pub fn show(
        &mut self,
        mut acquired: Acquired,
        content: Content<'_>,
        ui: Option<&UiFrame>,
        window: &Window,
    ) -> Result<Duration> {
        let started = ThreadTime::now();
        let mut frame = self.ring.begin()?;
        let picture = match content {
            Content::Nothing => None,
            Content::Picture(renderer) => Some(Arc::clone(renderer.picture())),
            Content::Mirror(eyes, parts) => {
                let mirror = match &mut self.mirror {
                    Some(mirror) => mirror,
                    none => none.insert(MirrorPicture::new(&self.gpu)?),
                };
                Some(mirror.record(&mut frame, eyes, parts, self.swapchain.size())?)
            }
            Content::Scene(renderer, inputs) => {
                renderer.record(&mut frame, inputs)?;
                Some(Arc::clone(renderer.picture()))
            }
        };
        if let Some(picture) = &picture {
            frame.commands.prepare(picture, ImageAccess::CopyFrom);
            self.swapchain.copy(&mut frame.commands, picture, &acquired);
        }
        match (picture, ui, self.swapchain.format()) {
            (Some(_), None, _) | (_, _, None) => self.swapchain.end_copy(&mut frame.commands, &acquired),
            (picture, ui, Some(format)) => {
                let colour = match picture {
                    Some(_) => {
                        ColourAttachment::loaded(self.swapchain.begin_drawing_over(&mut frame.commands, &acquired)?)
                    }
                    None => ColourAttachment::cleared(
                        self.swapchain.begin_drawing(&mut frame.commands, &mut acquired)?,
                        GROUND,
                    ),
                };
                let target = UiTarget { colour, format, size: self.swapchain.size() };
                self.ui.record(&mut frame, target, ui.unwrap_or(&UiFrame::default()))?;
                self.swapchain.end_drawing(&mut frame.commands, &acquired);
            }
        }
        frame.submit(Some(&acquired))?;
        let recording = started.elapsed();
        self.present(acquired, window)?;
        Ok(recording)
    }

    fn present(&mut self, acquired: Acquired, window: &Window) -> Result<()> {
        window.pre_present_notify();
        let size = self.swapchain.size();
        self.fit.judge(self.swapchain.present(acquired)?, size);
        Ok(())
    }

    /// The picture last shown: RGBA, 8 bits a channel, rows from the top.
    pub fn read(&self, renderer: &Renderer) -> Result<Vec<u8>> {
        read_image(&self.gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, 4)
    }
}
