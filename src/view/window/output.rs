//! The window as an output: swapchain, camera control, the panel, and drawing its frames when something has changed.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Mat4;
use winit::dpi::PhysicalPosition;
use winit::event_loop::ControlFlow;
use winit::keyboard::ModifiersState;
use winit::window::Window;

use super::keys::PressedKeys;
use super::mirror::crop;
use super::presenter::{Content, WindowPresenter};
use crate::gpu::Gpu;
use crate::render::{MirrorPart, SceneEdits};
use crate::view::action::Action;
use crate::view::app::App;
use crate::view::control::{Control, Mode};
use crate::view::frame_clock::{FrameClock, Rate};
use crate::view::headset::Session;
use crate::view::loader::Target;
use crate::view::panel::{Panel, PanelInputs};
use crate::view::screenshot;
use crate::view::shown_scene::ShownScene;
use crate::view::update::{Arrival, Update};
use crate::{Error, Result, say};

/// How often a minimised window is polled.
const POLL: Duration = Duration::from_millis(100);
/// How long the view must rest until a draft is followed by a whole picture.
const REST: Duration = Duration::from_millis(200);
/// How often the title bar is updated.
const TITLE_PERIOD: Duration = Duration::from_millis(500);

/// The effect of a drag with the mouse.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Drag {
    Turn,
    Pan,
}

/// One window. Drop order: the swapchain before the window it presents to.
pub struct WindowOutput {
    pub presenter: WindowPresenter,
    pub panel: Panel,
    pub ui_input: egui_winit::State,
    /// Commands of the panel that are to be performed.
    pub actions: Vec<Action>,
    pub clock: FrameClock,
    /// `None` before the first scene.
    pub control: Option<Control>,
    pub keys: PressedKeys,
    pub modifiers: ModifiersState,
    pub drag: Option<Drag>,
    /// Where the left button was pressed, while it is and the pointer has not left that place.
    pub pressed: Option<PhysicalPosition<f64>>,
    pub pointer: Option<PhysicalPosition<f64>>,
    /// The window's, pixels.
    pub size: [u32; 2],
    pub occluded: bool,
    pub focused: bool,
    /// Whether the next frame is written to a file.
    pub screenshot: bool,
    /// Whether frames are drawn all the time, or only when something changes.
    pub continuous: bool,
    /// Whether pictures are coarse while something moves: software renderers are too slow for whole ones.
    drafts: bool,
    /// What the last picture shows; `None` where a new one is needed anyway.
    drawn: Option<PictureState>,
    /// When the last picture was found to differ from the one before.
    moved: Option<Instant>,
    titled: Option<Instant>,
    pub window: Window,
}

/// What a picture depends on.
#[derive(Clone, Debug, PartialEq)]
struct PictureState {
    /// See [`App::revision`].
    revision: u64,
    size: [u32; 2],
    world_from_view: Mat4,
    world_from_models: Mat4,
    exposure_ev: f32,
    environment_rotation: f32,
    edits: SceneEdits,
}

impl PictureState {
    fn of(revision: u64, scene: &ShownScene, control: &Control, size: [u32; 2]) -> Self {
        Self {
            revision,
            size,
            world_from_view: control.eye(1.0).world_from_view,
            world_from_models: scene.world_from_models,
            exposure_ev: scene.exposure_ev,
            environment_rotation: scene.environment_rotation,
            edits: scene.loaded.renderer.edits().clone(),
        }
    }

    /// Whether `next` follows by a movement, of the camera or a slider, rather than by something new to draw.
    fn moved_to(&self, next: &Self) -> bool {
        *self != Self { revision: self.revision, ..next.clone() }
    }
}

impl WindowOutput {
    /// Draws into a window.
    ///
    /// # Errors
    /// Whatever stops making the swapchain or the text's pipeline.
    ///
    /// # Safety
    /// The window's event loop must outlive the output.
    pub unsafe fn new(gpu: &Arc<Gpu>, window: Window, wake: impl Fn() + Clone + Send + Sync + 'static) -> Result<Self> {
        let panel = Panel::new(wake);
        let scale = window.scale_factor() as f32;
        let root = egui::ViewportId::ROOT;
        Ok(Self {
            ui_input: egui_winit::State::new(panel.context.clone(), root, &window, Some(scale), None, None),
            panel,
            actions: Vec::new(),
            // SAFETY: the window becomes a field that is dropped after the presenter; the caller keeps the event loop.
            presenter: unsafe { WindowPresenter::new(gpu, &window) }?,
            clock: FrameClock::default(),
            control: None,
            keys: PressedKeys::default(),
            modifiers: ModifiersState::empty(),
            drag: None,
            pressed: None,
            pointer: None,
            size: window.inner_size().into(),
            occluded: false,
            focused: false,
            screenshot: false,
            continuous: false,
            drafts: gpu.info().is_software(),
            drawn: None,
            moved: None,
            titled: None,
            window,
        })
    }

    /// Ends on this GPU; returns what goes on with another.
    pub fn keep(self) -> (Window, Option<Control>) {
        let Self { presenter, window, control, .. } = self;
        drop(presenter);
        (window, control)
    }

    /// The target of scenes that only this window shows.
    pub fn target(&self) -> Target {
        Target { size: self.size.map(|s| s.max(1)), eyes: 1, hidden: Default::default() }
    }

    /// When the next frame of the window's own is due: at once (`Poll`), later, or after some event.
    pub fn pace(&mut self, app: &App) -> ControlFlow {
        let now = Instant::now();
        let pace = if self.occluded || self.size.contains(&0) {
            ControlFlow::Wait
        } else if !self.focused && self.window.is_minimized() == Some(true) {
            // X11 sends no event when a minimised window comes back.
            ControlFlow::WaitUntil(now + POLL)
        } else if let Some(at) = self.presenter.retry_at().filter(|at| *at > now) {
            ControlFlow::WaitUntil(at)
        } else {
            match self.due(app, now) {
                Some(at) if at <= now => ControlFlow::Poll,
                Some(at) => ControlFlow::WaitUntil(at),
                None => ControlFlow::Wait,
            }
        };
        if pace != ControlFlow::Poll {
            self.clock.pause();
        }
        pace
    }

    /// When something changes on the screen; `None`: after the next event.
    fn due(&self, app: &App, now: Instant) -> Option<Instant> {
        let scene = app.scene.as_ref().zip(self.control.as_ref()).and_then(|(scene, control)| {
            if self.continuous || self.screenshot || self.is_moving(control) {
                return Some(now);
            }
            self.scene_due(app.revision(), scene, control, now)
        });
        [scene, self.panel.due()].into_iter().flatten().min()
    }

    /// When the scene is to be drawn: at once where it looks different from the last picture, at rest where that is a draft.
    fn scene_due(&self, revision: u64, scene: &ShownScene, control: &Control, now: Instant) -> Option<Instant> {
        let state = PictureState::of(revision, scene, control, self.presenter.size());
        let rests = self.moved.map(|at| at + REST).filter(|at| *at > now);
        match self.drawn.as_ref() {
            Some(drawn) if *drawn == state => {
                let renderer = &scene.loaded.renderer;
                renderer.is_unfinished().then(|| rests.filter(|_| renderer.is_draft()).unwrap_or(now))
            }
            _ => Some(now),
        }
    }

    /// Whether a person is flying, or may be about to with a key that is held.
    fn is_moving(&self, control: &Control) -> bool {
        control.mode() == Mode::Fly && self.keys.movement() != glam::Vec3::ZERO
    }

    /// Draws and shows one frame; returns whether there was an image to draw to.
    pub fn draw(&mut self, app: &mut App) -> Result<bool> {
        if self.size.contains(&0) {
            return Ok(false);
        }
        let (acquired, times) = self.presenter.begin(self.size)?;
        // Frames that show the last picture again would make the scene look cheap.
        if times.iter().any(|time| time.name != "interface") {
            self.clock.add_gpu(&times, times.total_ms());
        }
        let Some(acquired) = acquired else { return Ok(false) };
        let now = Instant::now();
        let seconds = self.clock.tick(now);
        if let Some(control) = &mut self.control {
            control.step(self.keys.movement(), self.keys.fast(), seconds);
        }
        self.lay_out(app, None, now);
        let (size, revision) = (self.presenter.size(), app.revision());
        let (Some(scene), Some(control)) = (app.scene.as_mut(), self.control.as_ref()) else {
            self.presenter.show(acquired, Content::Nothing, self.panel.frame(), &self.window)?;
            self.panel.recorded();
            return Ok(true);
        };
        let due = self.scene_due(revision, scene, control, now);
        let is_due = self.continuous || self.screenshot || due.is_some_and(|at| at <= now);
        // Screenshots are of the scene alone.
        let ui = self.panel.frame().filter(|_| !self.screenshot);
        if is_due {
            let state = PictureState::of(revision, scene, control, size);
            if self.drawn.as_ref().is_some_and(|drawn| drawn.moved_to(&state)) {
                self.moved = Some(now);
            }
            let moves = self.moved.is_some_and(|at| now < at + REST);
            let eyes = [control.eye(size[0] as f32 / size[1] as f32)];
            let inputs = scene.inputs(&eyes, 0.0, None);
            let renderer = &mut scene.loaded.renderer;
            renderer.resize(size)?;
            renderer.set_draft(self.drafts && moves && !self.screenshot && !self.continuous)?;
            let content = Content::Scene(renderer, &inputs);
            let recording = self.presenter.show(acquired, content, ui, &self.window)?;
            self.clock.add_recording(recording);
            self.panel.refresh_later(false);
            self.drawn = Some(state);
        } else {
            self.clock.pause();
            self.presenter.show(acquired, Content::Picture(&scene.loaded.renderer), ui, &self.window)?;
        }
        if std::mem::take(&mut self.screenshot) {
            let pixels = self.presenter.read(&scene.loaded.renderer)?;
            app.write_screenshot(pixels, size);
            self.panel.refresh();
        } else {
            self.panel.recorded();
        }
        self.write_title(app, now);
        Ok(true)
    }

    /// Mirrors these parts of a headset's picture if an image is available now; returns whether it was.
    pub fn mirror(&mut self, app: &mut App, session: &Session, parts: &[MirrorPart], now: Instant) -> Result<bool> {
        let Some(scene) = app.scene.as_mut() else { return Ok(false) };
        let picture = session.area();
        if std::mem::take(&mut self.screenshot) {
            let renderer = &scene.loaded.renderer;
            let pixels = self.presenter.read(renderer)?;
            let pixels = crop(&pixels, renderer.picture().desc().size[0], picture);
            app.write_screenshot(pixels, picture);
        }
        let Some(acquired) = self.presenter.poll(self.size, now)? else { return Ok(false) };
        self.lay_out(app, Some(session), now);
        let Some(scene) = app.scene.as_mut() else { return Ok(false) };
        let content = Content::Mirror(scene.loaded.renderer.picture(), parts);
        self.presenter.show(acquired, content, self.panel.frame(), &self.window)?;
        self.panel.recorded();
        self.panel.refresh_later(true);
        self.write_title(app, now);
        Ok(true)
    }

    /// Lays the panel out where that is due; its commands wait in `actions`.
    fn lay_out(&mut self, app: &App, session: Option<&Session>, now: Instant) {
        if self.panel.due().is_none_or(|at| at > now) {
            return;
        }
        let inputs = PanelInputs {
            app,
            clock: &self.clock,
            control: self.control.as_ref(),
            present_mode: self.presenter.mode().name(),
            slot: self.presenter.slot(),
            headset: session.map(Session::line),
            continuous: self.continuous,
            alone: false,
        };
        let input = self.ui_input.take_egui_input(&self.window);
        let output = self.panel.run(input, &inputs);
        self.ui_input.handle_platform_output(&self.window, output.platform);
        self.actions.extend(output.actions);
    }

    /// Reacts to a result of the loader: sets the camera of a new scene, shows a message.
    pub fn update(&mut self, app: &App, update: Update) {
        self.panel.refresh();
        match update {
            Update::Scene(Arrival::Again) => self.drawn = None,
            Update::Scene(arrival) => {
                let Some(scene) = &app.scene else { return };
                let mut control = Control::new(&scene.loaded.cameras[0], scene.loaded.bounds);
                if self.control.as_ref().is_some_and(|old| old.mode() == Mode::Fly) {
                    control.switch_mode();
                }
                (self.control, self.titled) = (Some(control), None);
                (self.drawn, self.moved) = (None, None);
                if arrival == Arrival::Next {
                    self.announce(format!("showing {}", scene.loaded.name));
                }
            }
            Update::Textures(why) => self.announce(why),
            Update::Light(name) => self.announce(format!("lit by {name}")),
            Update::Settings => tracing::debug!("the settings are in use"),
            Update::Screenshot(written) => self.report_screenshot(&written),
            Update::Failed(error) => self.complain(&error),
        }
    }

    /// Shows a message for a while.
    pub fn note(&mut self, text: impl Into<String>) {
        self.panel.note(text);
    }

    /// Shows a message and prints it.
    pub fn announce(&mut self, text: String) {
        say!("pbr-vr: {text}");
        self.note(text);
    }

    /// Shows and prints an error that changed nothing.
    pub fn complain(&mut self, error: &Error) {
        crate::complain!("pbr-vr: {error}");
        self.panel.error(error.to_string());
    }

    fn report_screenshot(&mut self, written: &Result<PathBuf>) {
        screenshot::report(written);
        match written {
            Ok(path) => self.note(format!("wrote {}", path.display())),
            Err(error) => self.panel.error(error.to_string()),
        }
    }

    fn write_title(&mut self, app: &App, now: Instant) {
        let Some(scene) = &app.scene else { return };
        if self.titled.is_none_or(|at| now >= at + TITLE_PERIOD) {
            self.window.set_title(&title(&scene.loaded.name, self.clock.rate()));
            self.titled = Some(now);
        }
    }
}

/// The title bar's text.
pub fn title(scene: &str, rate: Option<&Rate>) -> String {
    match rate {
        Some(rate) => {
            let gpu = rate.gpu_ms.map_or(String::new(), |ms| format!(", GPU {ms:.2} ms"));
            format!("{scene} - {:.0} fps{gpu} - pbr-vr", rate.frames_per_second)
        }
        None => format!("{scene} - pbr-vr"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_title_names_the_scene_and_its_rate() {
        let rate = Rate { frames_per_second: 59.94, gpu_ms: Some(3.25), ..Rate::default() };
        assert_eq!(title("demo.toml", Some(&rate)), "demo.toml - 60 fps, GPU 3.25 ms - pbr-vr");
        assert_eq!(title("demo.toml", None), "demo.toml - pbr-vr");
    }

    #[test]
    fn movements_are_told_from_new_light() {
        let state = PictureState {
            revision: 1,
            size: [64, 64],
            world_from_view: Mat4::IDENTITY,
            world_from_models: Mat4::IDENTITY,
            exposure_ev: 0.0,
            environment_rotation: 0.0,
            edits: SceneEdits::default(),
        };
        assert!(!state.moved_to(&PictureState { revision: 2, ..state.clone() }));
        assert!(state.moved_to(&PictureState { exposure_ev: 0.1, revision: 2, ..state.clone() }));
        assert!(state.moved_to(&PictureState { world_from_view: Mat4::from_rotation_x(0.1), ..state.clone() }));
    }
}
