//! The panel in the headset, on the runtime's dashboard and at the left hand: one layout and one picture for both, made while
//! one of them is seen.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{PointerButton, Pos2, RawInput, Rect, Vec2, pos2};
use openvr_sys::{VR_IVROverlay_FnTable as Table, VROverlayHandle_t};

use super::hands::PanelInput;
use super::held::{HandPlaces, Held};
use super::overlay::{Overlay, Pointer, TextureCall};
use super::painter::{Gate, Painter};
use super::runtime::Runtime;
use crate::Result;
use crate::gpu::Gpu;
use crate::view::action::Action;
use crate::view::panel::{Panel, PanelInputs};

/// Pixels, and pixels of a point: letters that can be read at arm's length through a headset's lenses.
const SIZE: [u32; 2] = [960, 1200];
const PIXELS_PER_POINT: f32 = 2.5;
/// The shortest time between two pictures: a panel needs no 90 a second.
const PERIOD: Duration = Duration::from_millis(50);
/// The least time between two pictures in times of what the last one may have cost a frame of the eyes, up to the longest
/// with which one can still drag a slider.
const REST: u32 = 10;
const LONGEST_REST: Duration = Duration::from_millis(250);
/// Points of a step of the wheel.
const POINTS_PER_STEP: f32 = 40.0;

/// The panel with its overlays.
pub struct HeadsetPanel {
    /// `None` where the runtime refuses it.
    dashboard: Option<Overlay>,
    /// The same.
    held: Option<Held>,
    /// Those that were seen last.
    seen: Vec<VROverlayHandle_t>,
    panel: Panel,
    painter: Painter,
    events: Vec<egui::Event>,
    pointer: Pos2,
    is_pressed: bool,
    /// When the next picture may be begun; `None` before the first.
    rests_until: Option<Instant>,
}

impl HeadsetPanel {
    /// Makes the overlays; what the runtime refuses costs a line, and everything else works without. `None` if it refuses
    /// both.
    ///
    /// # Errors
    /// No memory.
    ///
    /// # Safety
    /// It must be dropped before the runtime is disconnected.
    pub unsafe fn new(gpu: &Arc<Gpu>, runtime: &Runtime) -> Result<Option<Self>> {
        let refused = |why: &str| crate::complain!("pbr-vr: headset: no panel {why}");
        let nowhere = |why: &str| refused(&format!("on the dashboard or at the left hand: {why}"));
        let Some(table) = runtime.overlay() else {
            nowhere("the runtime has no overlays");
            return Ok(None);
        };
        // SAFETY: the painter, which has it, ends with this panel; see above.
        let call = match unsafe { TextureCall::new(table) } {
            Ok(call) => call,
            Err(why) => {
                nowhere(&why);
                return Ok(None);
            }
        };
        let (dashboard, held) = match (Overlay::on_dashboard(table, SIZE), Held::new(table, SIZE)) {
            (Err(why), Err(other)) => {
                nowhere(&if why == other { why } else { format!("{why}; {other}") });
                return Ok(None);
            }
            (dashboard, held) => (
                dashboard.map_err(|why| refused(&format!("on the dashboard: {why}"))).ok(),
                held.map_err(|why| refused(&format!("at the left hand: {why}"))).ok(),
            ),
        };
        Ok(Some(Self {
            dashboard,
            held,
            seen: Vec::new(),
            panel: Panel::new(|| ()),
            painter: Painter::new(gpu, call, SIZE)?,
            events: Vec::new(),
            pointer: Pos2::ZERO,
            is_pressed: false,
            rests_until: None,
        }))
    }

    /// When the thread that paints it may use the queue.
    pub fn gate(&self) -> &Gate {
        &self.painter.gate
    }

    /// Whether the laser is on the panel at the hand: its buttons are the panel's.
    pub fn has_laser(&self) -> bool {
        self.held.as_ref().is_some_and(Held::has_laser)
    }

    /// Follows hands and lasers; to be called when a frame was handed over. Returns whether the panel is to be laid out:
    /// it is seen, has changed, and its last picture is done. The first layout and picture, for which fonts and pipelines
    /// are made, are due before it is seen.
    ///
    /// # Errors
    /// A failed Vulkan call in the last picture.
    pub fn follow(&mut self, runtime: &Runtime, input: PanelInput, places: &HandPlaces) -> Result<bool> {
        let Some(table) = runtime.overlay() else { return Ok(false) };
        self.follow_hands(table, input, places);
        while let Some(event) = self.next_event(table) {
            self.take(event);
        }
        let seen = self.visible(table);
        if seen.iter().any(|overlay| !self.seen.contains(overlay)) {
            // Its picture is old, or there is none.
            self.panel.refresh();
        }
        self.seen = seen;
        let now = Instant::now();
        if let Some(longest) = self.painter.take_done()? {
            tracing::debug!("headset: panel: given to the runtime in {:.2} ms", longest.as_secs_f64() * 1e3);
            self.rest(now, longest);
        }
        self.gate().open();
        let rests = self.painter.is_busy() || self.rests_until.is_some_and(|until| now < until);
        let changes = !self.events.is_empty() || self.panel.due().is_some_and(|due| due <= now);
        let is_first = self.rests_until.is_none();
        Ok(is_first || !rests && changes && !self.seen.is_empty())
    }

    /// Lays the panel out and has it painted; returns what was chosen.
    pub fn lay_out(&mut self, inputs: &PanelInputs<'_>) -> Vec<Action> {
        let started = Instant::now();
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
        self.painter.paint(self.panel.take_frame(), self.seen.clone());
        let now = Instant::now();
        tracing::debug!("headset: panel: laid out in {:.2} ms", (now - started).as_secs_f64() * 1e3);
        self.rests_until = Some(started + PERIOD);
        self.rest(now, now - started);
        // What was chosen is seen with the next picture; numbers change by themselves.
        if actions.is_empty() {
            self.panel.refresh_later(true)
        } else {
            self.panel.refresh()
        }
        actions
    }

    /// Shows an error on the panel.
    pub fn error(&mut self, text: String) {
        self.panel.error(text);
    }

    /// After something that may have cost a frame so much.
    fn rest(&mut self, now: Instant, cost: Duration) {
        self.rests_until = self.rests_until.max(Some(now + (REST * cost).min(LONGEST_REST)));
    }

    fn follow_hands(&mut self, table: &Table, input: PanelInput, places: &HandPlaces) {
        let Some(held) = &mut self.held else { return };
        match held.follow(table, input, places) {
            Ok(true) => self.take(Pointer::Gone),
            Ok(false) => {}
            Err(why) => {
                crate::complain!("pbr-vr: headset: no panel at the left hand any more: {why}");
                self.held.take().into_iter().for_each(|held| held.destroy(table));
                self.take(Pointer::Gone);
            }
        }
    }

    fn next_event(&mut self, table: &Table) -> Option<Pointer> {
        let on_dashboard = self.dashboard.as_ref().and_then(|overlay| overlay.next_event(table));
        on_dashboard.or_else(|| self.held.as_mut()?.next_event(table))
    }

    fn visible(&self, table: &Table) -> Vec<VROverlayHandle_t> {
        let overlays = self.dashboard.iter().chain(self.held.as_ref().map(Held::overlay));
        overlays.filter(|overlay| overlay.is_visible(table)).map(Overlay::handle).collect()
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
                self.events.push(egui::Event::PointerMoved(self.pointer));
                self.press(pressed);
            }
            Pointer::Scroll([x, y]) => self.events.push(egui::Event::MouseWheel {
                unit: egui::MouseWheelUnit::Point,
                delta: Vec2::new(x, y) * POINTS_PER_STEP,
                modifiers: egui::Modifiers::default(),
            }),
            Pointer::Gone => {
                // Whatever was dragged is let go: nobody may tell later.
                if self.is_pressed {
                    self.press(false);
                }
                self.events.push(egui::Event::PointerGone);
            }
        }
    }

    fn press(&mut self, pressed: bool) {
        self.is_pressed = pressed;
        let (pos, button, modifiers) = (self.pointer, PointerButton::Primary, egui::Modifiers::default());
        self.events.push(egui::Event::PointerButton { pos, button, pressed, modifiers });
    }
}
