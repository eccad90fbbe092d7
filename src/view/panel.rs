//! The panel: choices and numbers beside the picture, laid out by egui. It shows what the app has and returns commands; it
//! changes nothing itself. Windows and headsets draw it.

mod clicks;
mod graph;
mod library;
mod messages;
mod parts;
mod place;
pub(crate) mod saved;
mod sections;
mod settings;
mod style;

use std::time::{Duration, Instant};

use egui::{
    Align2, Area, CentralPanel, Context, FontId, Frame, FullOutput, Id, Order, Pos2, RawInput, Rect, RichText,
    SidePanel, TexturesDelta,
};

use super::action::Action;
use super::app::App;
use super::control::Control;
use super::frame_clock::FrameClock;
use crate::asset::Stage;
use crate::render::{MAX_TEXTURE_SIDE, UiFrame};
use library::Library;
use messages::Messages;
use saved::Saved;

/// The title of the section for materials.
const MATERIAL: &str = "Material";
/// Points.
const WIDTH: f32 = 310.0;
const MARGIN: f32 = 10.0;
/// How often numbers are updated while the picture changes.
const REFRESH: Duration = Duration::from_millis(250);
/// How often progress is updated.
const PROGRESS: Duration = Duration::from_millis(100);

/// What the panel shows.
pub struct PanelInputs<'a> {
    pub app: &'a App,
    pub clock: &'a FrameClock,
    /// The camera that a person at the window moves.
    pub control: Option<&'a Control>,
    pub present_mode: &'static str,
    /// Of the frame ring, where the reference's error is read.
    pub slot: usize,
    /// The headset's state, where there is one.
    pub headset: Option<String>,
    /// Whether frames are drawn all the time.
    pub continuous: bool,
    /// Whether the panel is all that is drawn, always shown, rather than beside a picture.
    pub alone: bool,
}

/// The result of a layout.
pub struct PanelOutput {
    pub actions: Vec<Action>,
    /// What the window system is to do: the pointer's shape, text for the clipboard.
    pub platform: egui::PlatformOutput,
}

/// The panel's state. Layouts are kept until the next one.
pub struct Panel {
    pub context: Context,
    frame: UiFrame,
    /// What the panel left of the window, as it was laid out last.
    left: Rect,
    /// When the next layout is due without any event.
    due: Option<Instant>,
    saved: Saved,
    messages: Messages,
    thumbnails: Library,
    camera_name: String,
    /// A section that is to be open from the next layout on, by its title.
    opened: Option<&'static str>,
}

impl Panel {
    /// With the state of the last start; `wake` is called from other threads when there is something new to lay out.
    pub fn new(wake: impl Fn() + Clone + Send + Sync + 'static) -> Self {
        let context = Context::default();
        style::apply(&context);
        Self {
            thumbnails: Library::new(wake),
            context,
            frame: UiFrame::default(),
            left: Rect::EVERYTHING,
            due: Some(Instant::now()),
            saved: Saved::load(),
            messages: Messages::default(),
            camera_name: String::new(),
            opened: None,
        }
    }

    /// The last layout; `None` where it shows nothing. Its changes of textures are for one recording, after which
    /// [`Panel::recorded`] is called.
    pub fn frame(&self) -> Option<&UiFrame> {
        let shows = !self.frame.primitives.is_empty() || !self.frame.textures.is_empty();
        shows.then_some(&self.frame)
    }

    /// The last layout, to be recorded elsewhere; there is none then until the next.
    pub fn take_frame(&mut self) -> UiFrame {
        std::mem::take(&mut self.frame)
    }

    /// Notes that the last layout's changes of textures have been recorded.
    pub fn recorded(&mut self) {
        self.frame.textures = TexturesDelta::default();
    }

    /// Shows or hides the panel.
    pub fn toggle(&mut self) {
        self.saved.shown = !self.saved.shown;
        self.saved.store();
        self.refresh();
    }

    /// Whether the panel is shown.
    pub fn is_shown(&self) -> bool {
        self.saved.shown
    }

    /// Whether a point of the window is the panel's or its lists', as they were laid out last. egui's own functions tell that of
    /// where the pointer was then: a hand that moves and presses between two frames would press on the wrong one.
    pub fn is_at(&self, point: Pos2) -> bool {
        let floats = self.context.layer_id_at(point).is_some_and(|layer| layer.order != Order::Background);
        floats || (self.is_shown() && !self.left.contains(point))
    }

    /// Shows a message for a while.
    pub fn note(&mut self, text: impl Into<String>) {
        self.messages.note(Instant::now(), text);
        self.refresh();
    }

    /// Shows an error message, for longer.
    pub fn error(&mut self, text: impl Into<String>) {
        self.messages.error(Instant::now(), text);
        self.refresh();
    }

    /// Removes all messages: their cause has been fixed.
    #[cfg(feature = "hot-reload")]
    pub fn forget(&mut self) {
        self.messages.clear();
        self.refresh();
    }

    /// Opens the section of the chosen material.
    pub fn open_material(&mut self) {
        self.opened = Some(MATERIAL);
        self.refresh();
    }

    /// Lays out with the next frame.
    pub fn refresh(&mut self) {
        self.due = Some(Instant::now());
    }

    /// When the next layout is due; `None`: after the next event.
    pub fn due(&self) -> Option<Instant> {
        self.due
    }

    /// Lays out a frame.
    pub fn run(&mut self, mut input: RawInput, inputs: &PanelInputs<'_>) -> PanelOutput {
        let now = Instant::now();
        input.max_texture_side = Some(MAX_TEXTURE_SIDE);
        let mut actions = Vec::new();
        let context = self.context.clone();
        let mut output = FullOutput::default();
        for part in clicks::apart(input) {
            output.append(context.run(part, |context| self.lay_out(context, inputs, &mut actions, now)));
        }
        self.frame.pixels_per_point = output.pixels_per_point;
        self.frame.primitives = context.tessellate(output.shapes, output.pixels_per_point);
        self.frame.textures.append(output.textures_delta);
        let wanted = output.viewport_output.values().map(|viewport| viewport.repaint_delay).min();
        self.due =
            [wanted.and_then(|delay| now.checked_add(delay)), self.own_due(inputs, now)].into_iter().flatten().min();
        tracing::debug!("panel: laid out");
        PanelOutput { actions, platform: output.platform_output }
    }

    /// When something that is shown changes by itself.
    fn own_due(&self, inputs: &PanelInputs<'_>, now: Instant) -> Option<Instant> {
        let loads = !inputs.app.loading().is_empty() || inputs.app.scene.is_none();
        let light = inputs.app.scene.as_ref().and_then(|scene| scene.loaded.light_progress()).is_some();
        let progress = (loads || light).then_some(now + PROGRESS);
        progress.into_iter().chain(self.messages.next_end()).min()
    }

    /// The time after a frame at which numbers are shown again, where the panel or, over a headset's mirror, a line has them.
    pub fn refresh_later(&mut self, mirrors: bool) {
        let later = Instant::now() + REFRESH;
        if self.saved.shown || mirrors {
            self.due = Some(self.due.map_or(later, |due| due.min(later)));
        }
    }

    fn lay_out(&mut self, context: &Context, inputs: &PanelInputs<'_>, actions: &mut Vec<Action>, now: Instant) {
        let mut left = context.content_rect();
        let is_beside = self.saved.shown && inputs.app.scene.is_some();
        let mut sections = |ui: &mut egui::Ui| {
            style::scrolled().auto_shrink([false, false]).show(ui, |ui| self.sections(ui, inputs, actions));
        };
        if inputs.alone {
            CentralPanel::default().show(context, |ui| sections(ui));
        } else if is_beside {
            let widest = 0.8 * left.width();
            let panel = SidePanel::right("panel").default_width(WIDTH.min(widest)).max_width(widest);
            left.max.x = panel.show(context, |ui| sections(ui)).response.rect.min.x;
        }
        self.left = left;
        if let Some(line) = inputs.headset.as_ref().filter(|_| !self.saved.shown && !inputs.alone) {
            let text = rate_text(inputs.clock).map_or_else(|| line.clone(), |rate| format!("{rate}  {line}"));
            area("status", Align2::LEFT_TOP, left).show(context, |ui| framed(ui, |ui| ui.label(text)));
        }
        self.progress(context, inputs, left);
        let lines = self.messages.current(now);
        if !lines.is_empty() {
            let width = (left.width() - 4.0 * MARGIN).max(80.0);
            area("messages", Align2::LEFT_BOTTOM, left).show(context, |ui| {
                ui.set_max_width(width.min(640.0));
                for line in lines {
                    framed(ui, |ui| {
                        ui.label(if line.is_error { style::error(&line.text) } else { RichText::new(&line.text) })
                    });
                }
            });
        }
    }

    /// What is being loaded and computed; in the middle of the picture while there is none.
    fn progress(&self, context: &Context, inputs: &PanelInputs<'_>, left: Rect) {
        let app = inputs.app;
        let Some(scene) = &app.scene else {
            let place = area("loading", Align2::CENTER_CENTER, left);
            place.show(context, |ui| {
                framed(ui, |ui| {
                    ui.set_max_width((left.width() - 4.0 * MARGIN).clamp(80.0, 420.0));
                    ui.label(RichText::new("pbr-vr").font(FontId::proportional(22.0)));
                    let name = app.loading().names().next().unwrap_or_default();
                    ui.label(format!("loading {name} on {}", app.context.gpu.info().name));
                    stage(ui, app.report().stage().as_ref());
                    ui.label(RichText::new("Esc quits").weak());
                })
            });
            return;
        };
        let light = scene.loaded.light_progress();
        if app.loading().is_empty() && light.is_none() {
            return;
        }
        // Below the line of numbers.
        let top = if inputs.headset.is_some() { 40.0 } else { 0.0 };
        area("progress", Align2::LEFT_TOP, left.translate(egui::vec2(0.0, top))).show(context, |ui| {
            framed(ui, |ui| {
                ui.set_max_width((left.width() - 4.0 * MARGIN).clamp(80.0, 320.0));
                for name in app.loading().names() {
                    ui.label(format!("loading {name}"));
                }
                if app.loading().is_empty() {
                    light.iter().for_each(|part| bar(ui, "soft light", *part));
                } else {
                    stage(ui, app.report().stage().as_ref());
                }
            });
        });
    }
}

/// An area of the picture that takes no input.
fn area(name: &'static str, align: Align2, within: Rect) -> Area {
    let within = within.shrink(MARGIN);
    Area::new(Id::new(name)).pivot(align).fixed_pos(align.pos_in_rect(&within)).interactable(false)
}

/// Text on a dark ground, which can be read over any picture.
fn framed<R>(ui: &mut egui::Ui, add: impl FnOnce(&mut egui::Ui) -> R) {
    Frame::NONE.fill(style::GROUND).inner_margin(8.0).corner_radius(4.0).show(ui, |ui| {
        add(ui);
    });
}

fn stage(ui: &mut egui::Ui, stage: Option<&Stage>) {
    match stage {
        Some(Stage { label, steps: Some((done, total)) }) => {
            bar(ui, stage_text(label), *done as f32 / (*total).max(1) as f32)
        }
        Some(Stage { label, steps: None }) => drop(ui.label(stage_text(label))),
        None => drop(ui.label("starting")),
    }
}

/// What a label of the report means to a user.
fn stage_text(label: &str) -> &str {
    match label {
        "parse" | "models" => "reading models",
        "hash" | "decode" | "textures" => "reading textures",
        "mips" => "filtering textures",
        "compress" => "compressing textures",
        "upload" => "copying textures to the GPU",
        "precompute" => "precomputing light",
        "pipelines" => "building pipelines",
        "atlas" => "unwrapping for soft light",
        label => label,
    }
}

fn bar(ui: &mut egui::Ui, label: &str, part: f32) {
    ui.add(
        egui::ProgressBar::new(part)
            .desired_width(280.0)
            .corner_radius(2.0)
            .text(format!("{label} {:.0} %", 100.0 * part)),
    );
}

/// The frame rate and times as one line.
pub fn rate_text(clock: &FrameClock) -> Option<String> {
    let rate = clock.rate()?;
    let gpu = rate.gpu_ms.map_or_else(String::new, |ms| format!("  GPU {ms:.2} ms"));
    Some(format!("{:.1} fps  {:.2} ms  CPU {:.2} ms{gpu}", rate.frames_per_second, rate.frame_ms, rate.record_ms))
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::with_gpu;
    use crate::view::app::gpu_tests::desk::{Desk, settings};

    /// A pointer moves between layouts, too: before the first, after it, and after each that showed or hid the panel.
    #[test]
    fn the_panel_is_where_it_was_laid_out_last() {
        with_gpu(|gpu| {
            let desk = Desk::new(gpu, settings());
            let (picture, side) = (Pos2::new(100.0, 300.0), Pos2::new(780.0, 300.0));
            let mut panel = Panel { saved: Saved::default(), ..Panel::new(|| ()) };
            panel.saved.shown = true;
            assert!(!panel.is_at(picture) && !panel.is_at(side));
            for shown in [true, false, true] {
                panel.saved.shown = shown;
                lay_out(&mut panel, &desk.app);
                assert!(!panel.is_at(picture));
                assert_eq!(panel.is_at(side), shown);
            }
        });
    }

    fn lay_out(panel: &mut Panel, app: &App) {
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, egui::vec2(800.0, 600.0))),
            ..RawInput::default()
        };
        let clock = FrameClock::default();
        let inputs = PanelInputs {
            app,
            clock: &clock,
            control: None,
            present_mode: "",
            slot: 0,
            headset: None,
            continuous: false,
            alone: false,
        };
        panel.run(input, &inputs);
    }
}
