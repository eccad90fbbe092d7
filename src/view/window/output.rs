//! The window as an output: swapchain, camera control, text, and drawing its frames.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use winit::dpi::PhysicalPosition;
use winit::event_loop::ControlFlow;
use winit::keyboard::ModifiersState;
use winit::window::Window;

use super::hud::{Hud, Status, title};
use super::keys::PressedKeys;
use super::mirror::{crop, parts};
use super::presenter::WindowPresenter;
use crate::gpu::Gpu;
use crate::render::Overlay;
use crate::view::Mirror;
use crate::view::app::{App, ShownScene, Update};
use crate::view::control::{Control, Mode};
use crate::view::frame_clock::FrameClock;
use crate::view::headset::Session;
use crate::view::loader::Target;
use crate::view::screenshot;
use crate::{Error, Result, say};

/// How often a minimised window is polled.
const POLL: Duration = Duration::from_millis(100);
/// Pixels per pixel of the font, at scale 1.
const TEXT_SCALE: f64 = 2.0;
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
    pub overlay: Overlay,
    pub hud: Hud,
    pub clock: FrameClock,
    /// `None` before the first scene.
    pub control: Option<Control>,
    pub keys: PressedKeys,
    pub modifiers: ModifiersState,
    pub drag: Option<Drag>,
    pub pointer: Option<PhysicalPosition<f64>>,
    /// The window's, pixels.
    pub size: [u32; 2],
    pub occluded: bool,
    pub focused: bool,
    /// Whether the next frame is written to a file.
    pub screenshot: bool,
    titled: Option<Instant>,
    pub window: Window,
}

impl WindowOutput {
    /// Draws into a window.
    ///
    /// # Errors
    /// Whatever stops making the swapchain or the text's pipeline.
    ///
    /// # Safety
    /// The window's event loop must outlive the output.
    pub unsafe fn new(gpu: &Arc<Gpu>, window: Window) -> Result<Self> {
        Ok(Self {
            // SAFETY: the window becomes a field that is dropped after the presenter; the caller keeps the event loop.
            presenter: unsafe { WindowPresenter::new(gpu, &window) }?,
            overlay: Overlay::new(gpu, 1)?,
            hud: Hud::default(),
            clock: FrameClock::default(),
            control: None,
            keys: PressedKeys::default(),
            modifiers: ModifiersState::empty(),
            drag: None,
            pointer: None,
            size: window.inner_size().into(),
            occluded: false,
            focused: false,
            screenshot: false,
            titled: None,
            window,
        })
    }

    /// The target of scenes that only this window shows.
    pub fn target(&self) -> Target {
        Target { size: self.size.map(|s| s.max(1)), eyes: 1, hidden: Default::default() }
    }

    /// When the next frame of the window's own is due: at once (`Poll`), later, or after some event.
    pub fn pace(&mut self) -> ControlFlow {
        let now = Instant::now();
        let pace = if self.control.is_none() || self.occluded || self.size.contains(&0) {
            ControlFlow::Wait
        } else if !self.focused && self.window.is_minimized() == Some(true) {
            // X11 sends no event when a minimised window comes back.
            ControlFlow::WaitUntil(now + POLL)
        } else {
            self.presenter.retry_at().filter(|at| *at > now).map_or(ControlFlow::Poll, ControlFlow::WaitUntil)
        };
        if pace != ControlFlow::Poll {
            self.clock.pause();
        }
        pace
    }

    /// Draws and shows one frame; returns whether there were a scene and an image to draw to.
    pub fn draw(&mut self, app: &mut App) -> Result<bool> {
        let (wanted, Some(scene), Some(control)) = (self.size, app.scene.as_mut(), self.control.as_mut()) else {
            return Ok(false);
        };
        if wanted.contains(&0) {
            return Ok(false);
        }
        let (acquired, times) = self.presenter.begin(wanted)?;
        self.clock.add_gpu(&times, times.total_ms());
        let Some(acquired) = acquired else { return Ok(false) };
        let now = Instant::now();
        let seconds = self.clock.tick(now);
        control.step(self.keys.movement(), self.keys.fast(), seconds);
        let size = self.presenter.size();
        scene.loaded.renderer.resize(size)?;
        let eyes = [control.eye(size[0] as f32 / size[1] as f32)];
        let inputs = scene.inputs(&eyes, 0.0, None);
        let largest = (TEXT_SCALE * self.window.scale_factor()).round().max(1.0) as u32;
        let mut settings = settings(scene, control.mode(), self.presenter.mode().name()).to_vec();
        settings.extend(scene.loaded.light_progress().map(|part| format!("light {:.0} %", 100.0 * part)));
        let renderer = &mut scene.loaded.renderer;
        settings.extend(renderer.standard_error(self.presenter.slot()).map(|error| error.to_string()));
        let status = Status { rate: self.clock.rate(), settings: &settings, loading: &app.loading };
        let (lines, scale) = self.hud.fit(now, &status, largest, |scale| Overlay::grid(size, scale));
        self.overlay.set_text(&lines, size, scale);
        // Screenshots are of the scene alone.
        let overlay = (!self.screenshot).then_some(&self.overlay);
        let recording = self.presenter.show(acquired, renderer, &inputs, overlay, &self.window)?;
        self.clock.add_recording(recording);
        if std::mem::take(&mut self.screenshot) {
            let pixels = self.presenter.read(renderer)?;
            app.write_screenshot(pixels, size);
        }
        self.write_title(app, now);
        Ok(true)
    }

    /// Mirrors a headset's picture if an image is available now; returns whether it was.
    pub fn mirror(&mut self, app: &mut App, session: &Session, mirror: Mirror, now: Instant) -> Result<bool> {
        let (Some(scene), Some(control)) = (app.scene.as_mut(), self.control.as_ref()) else { return Ok(false) };
        let picture = session.area();
        if std::mem::take(&mut self.screenshot) {
            let renderer = &scene.loaded.renderer;
            let pixels = self.presenter.read(renderer)?;
            let pixels = crop(&pixels, renderer.picture().desc().size[0], picture);
            app.write_screenshot(pixels, picture);
        }
        let Some(acquired) = self.presenter.poll(self.size, now)? else { return Ok(false) };
        let Some(scene) = app.scene.as_mut() else { return Ok(false) };
        let parts = parts(mirror, picture, self.presenter.size());
        // As large in the window as text is without a headset.
        let shrinks = parts.first().map_or(1.0, |(_, [from, onto])| f64::from(from.size[0]) / f64::from(onto.size[0]));
        let largest = (TEXT_SCALE * self.window.scale_factor() * shrinks).floor().max(1.0) as u32;
        let mut settings = settings(scene, control.mode(), self.presenter.mode().name()).to_vec();
        settings.push(session.line());
        settings.extend(scene.loaded.light_progress().map(|part| format!("light {:.0} %", 100.0 * part)));
        let status = Status { rate: self.clock.rate(), settings: &settings, loading: &app.loading };
        let (lines, scale) = self.hud.fit(now, &status, largest, |scale| Overlay::grid(picture, scale));
        self.overlay.set_text(&lines, picture, scale);
        // The text is drawn over the left eye's picture.
        let overlay = (mirror != Mirror::Right).then_some(&self.overlay);
        self.presenter.show_parts(acquired, &scene.loaded.renderer, overlay, &parts, &self.window)?;
        self.write_title(app, now);
        Ok(true)
    }

    /// Reacts to a result of the loader: sets the camera of a new scene, shows a message.
    pub fn update(&mut self, app: &App, update: Update) {
        match update {
            Update::Scene { replaced } => {
                let Some(scene) = &app.scene else { return };
                let mut control = Control::new(&scene.loaded.cameras[0], scene.loaded.bounds);
                if self.control.as_ref().is_some_and(|old| old.mode() == Mode::Fly) {
                    control.switch_mode();
                }
                (self.control, self.titled) = (Some(control), None);
                if replaced {
                    self.announce(format!("showing {}", scene.loaded.name));
                }
            }
            Update::Light(name) => self.announce(format!("lit by {name}")),
            Update::Settings => {}
            Update::Screenshot(written) => self.report_screenshot(&written),
            Update::Failed(error) => self.complain(&error),
        }
    }

    /// Shows a message for a while.
    pub fn note(&mut self, text: impl Into<String>) {
        self.hud.note(Instant::now(), text);
    }

    /// Shows a message and prints it.
    pub fn announce(&mut self, text: String) {
        say!("pbr-vr: {text}");
        self.note(text);
    }

    /// Shows and prints an error that changed nothing.
    pub fn complain(&mut self, error: &Error) {
        crate::complain!("pbr-vr: {error}");
        self.hud.error(Instant::now(), error.to_string());
    }

    fn report_screenshot(&mut self, written: &Result<PathBuf>) {
        screenshot::report(written);
        match written {
            Ok(path) => self.note(format!("wrote {}", path.display())),
            Err(error) => self.hud.error(Instant::now(), error.to_string()),
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

/// The settings as text.
fn settings(scene: &ShownScene, mode: Mode, present_mode: &str) -> [String; 6] {
    let shading = scene.loaded.renderer.settings().shading.to_possible_value();
    let mode = match mode {
        Mode::Orbit => "orbit",
        Mode::Fly => "fly",
    };
    [
        shading.map_or_else(String::new, |value| value.get_name().to_owned()),
        format!("{:+.1} EV", scene.exposure_ev),
        format!("panorama {:.0} deg", scene.environment_rotation.to_degrees()),
        format!("camera {}", scene.loaded.cameras[scene.camera].name),
        mode.to_owned(),
        present_mode.to_owned(),
    ]
}
