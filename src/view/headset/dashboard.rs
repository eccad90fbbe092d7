//! The panel on the runtime's dashboard: laid out and drawn while it is seen, between frames of the scene.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{PointerButton, Pos2, RawInput, Rect, Vec2, pos2};

use super::overlay::{Overlay, Pointer};
use super::runtime::{EyePicture, Runtime};
use crate::Result;
use crate::gpu::{ColourAttachment, FrameRing, Gpu, Image, ImageAccess, ImageDesc, ImageUsageFlags};
use crate::render::{Output, UI_BYTES, UiRenderer, UiTarget};
use crate::view::action::Action;
use crate::view::panel::{Panel, PanelInputs};

/// Pixels, and pixels of a point: letters that can be read at arm's length through a headset's lenses.
const SIZE: [u32; 2] = [960, 1200];
const PIXELS_PER_POINT: f32 = 2.5;
/// The shortest time between two pictures: a panel needs no 90 a second.
const PERIOD: Duration = Duration::from_millis(50);
/// Points of a step of the wheel.
const POINTS_PER_STEP: f32 = 40.0;

/// The panel as an overlay.
pub struct Dashboard {
    overlay: Overlay,
    panel: Panel,
    ui: UiRenderer,
    /// Taken in turn: the runtime may still read the last one.
    images: [Arc<Image>; 2],
    ring: FrameRing,
    gpu: Arc<Gpu>,
    events: Vec<egui::Event>,
    pointer: Pos2,
    /// When the last picture was drawn.
    drawn: Option<Instant>,
    /// Pictures drawn so far.
    pictures: u64,
}

impl Dashboard {
    /// Puts the panel on the dashboard; `Err` says in words why there is none, and everything else works without.
    ///
    /// # Errors
    /// No memory.
    pub fn new(gpu: &Arc<Gpu>, runtime: &Runtime) -> Result<std::result::Result<Self, String>> {
        let Some(table) = runtime.overlay() else { return Ok(Err("the runtime has no overlays".into())) };
        let overlay = match Overlay::new(table, SIZE) {
            Ok(overlay) => overlay,
            Err(why) => return Ok(Err(why)),
        };
        let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::SAMPLED;
        let image = || Image::new(gpu, "dashboard", ImageDesc::flat(Output::Display.format(), SIZE, usage));
        Ok(Ok(Self {
            overlay,
            panel: Panel::new(|| ()),
            ui: UiRenderer::new(gpu)?,
            images: [image()?, image()?],
            ring: FrameRing::new(gpu, UI_BYTES)?,
            gpu: Arc::clone(gpu),
            events: Vec::new(),
            pointer: Pos2::ZERO,
            drawn: None,
            pictures: 0,
        }))
    }

    /// Follows the laser mouse; whether the panel is to be shown again: it is seen, and has changed.
    pub fn is_due(&mut self, runtime: &Runtime) -> bool {
        let Some(table) = runtime.overlay() else { return false };
        while let Some(event) = self.overlay.next_event(table) {
            self.take(event);
        }
        let now = Instant::now();
        let rests = self.drawn.is_some_and(|at| now < at + PERIOD);
        let changes = !self.events.is_empty() || self.panel.due().is_some_and(|due| due <= now);
        !rests && changes && self.overlay.is_visible(table)
    }

    /// Lays the panel out, draws and shows it; returns what was chosen. Waits for nothing but its own picture before the last.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn show(&mut self, runtime: &Runtime, inputs: &PanelInputs<'_>) -> Result<Vec<Action>> {
        let size = Vec2::new(SIZE[0] as f32, SIZE[1] as f32) / PIXELS_PER_POINT;
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size)),
            events: std::mem::take(&mut self.events),
            focused: true,
            ..RawInput::default()
        };
        if let Some(viewport) = input.viewports.get_mut(&egui::ViewportId::ROOT) {
            viewport.native_pixels_per_point = Some(PIXELS_PER_POINT);
        }
        let actions = self.panel.run(input, inputs).actions;
        let picture = self.draw()?;
        let shown = runtime.overlay().map(|table| self.gpu.with_queue_locked(|| self.overlay.show(table, &picture)));
        if let Some(Err(why)) = shown {
            tracing::debug!("headset: dashboard: {why}");
        }
        self.drawn = Some(Instant::now());
        self.pictures += 1;
        // What was chosen is seen with the next picture; numbers change by themselves.
        if actions.is_empty() {
            self.panel.refresh_later(true)
        } else {
            self.panel.refresh()
        }
        Ok(actions)
    }

    /// Shows an error on the panel.
    pub fn error(&mut self, text: String) {
        self.panel.error(text);
    }

    fn take(&mut self, event: Pointer) {
        let point = |at: [f32; 2]| pos2(at[0], at[1]) / PIXELS_PER_POINT;
        match event {
            Pointer::Move(at) => {
                self.pointer = point(at);
                self.events.push(egui::Event::PointerMoved(self.pointer));
            }
            Pointer::Button { at, pressed } => {
                self.pointer = point(at);
                let (pos, button) = (self.pointer, PointerButton::Primary);
                let modifiers = egui::Modifiers::default();
                self.events.push(egui::Event::PointerMoved(pos));
                self.events.push(egui::Event::PointerButton { pos, button, pressed, modifiers });
            }
            Pointer::Scroll([x, y]) => self.events.push(egui::Event::MouseWheel {
                unit: egui::MouseWheelUnit::Point,
                delta: Vec2::new(x, y) * POINTS_PER_STEP,
                modifiers: egui::Modifiers::default(),
            }),
            Pointer::Gone => self.events.push(egui::Event::PointerGone),
        }
    }

    fn draw(&mut self) -> Result<EyePicture> {
        let image = &self.images[(self.pictures % 2) as usize];
        let mut frame = self.ring.begin()?;
        frame.commands.prepare_fresh(image, ImageAccess::Colour);
        let colour = ColourAttachment::cleared(image.attachment(), [0.0, 0.0, 0.0, 1.0]);
        let target = UiTarget { colour, format: image.desc().format, size: SIZE };
        if let Some(ui) = self.panel.frame() {
            self.ui.record(&mut frame, target, ui)?;
        }
        frame.commands.prepare(image, ImageAccess::CopyFrom);
        frame.submit(None)?;
        self.panel.recorded();
        Ok(EyePicture {
            handles: self.gpu.handles(),
            image: image.handle(),
            size: SIZE,
            // Vulkan's formats are small positive numbers.
            format: image.desc().format.as_raw() as u32,
        })
    }
}
