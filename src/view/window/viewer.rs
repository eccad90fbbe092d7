//! What stands behind one window: scene, camera and text, and how a frame is made of them; files that are opened.

mod input;
mod mirrored;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use winit::dpi::PhysicalPosition;
use winit::event_loop::{ControlFlow, EventLoopProxy};
use winit::keyboard::ModifiersState;
use winit::window::Window;

use super::super::control::{Control, Mode};
use super::super::frame_clock::FrameClock;
use super::super::headset::playlist::Playlist;
use super::super::headset::{HeadsetReport, Session};
use super::super::{Mirror, ViewRequest};
#[cfg(feature = "hot-reload")]
use super::hot_reload::ShaderWatch;
use super::hud::{Hud, Status, title};
use super::keys::Held;
use super::loader::{LoadRequest, LoadResult, LoadedScene, Loader, file_name, report_screenshot};
use super::presenter::WindowPresenter;
use crate::gpu::Gpu;
use crate::precompute::LightMaps;
use crate::render::{Overlay, Shading};
use crate::{Error, Result, say};

/// A minimised window is looked at this often.
const DOZE: Duration = Duration::from_millis(100);
/// Pixels per pixel of the font, at scale 1.
const TEXT_SCALE: f64 = 2.0;

/// What a press of a mouse button has begun.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Drag {
    Turn,
    Pan,
}

/// A window with all that it shows. The order of its fields is the order in which they go: the window last, after
/// the swapchain that presents to it, and everything on the GPU before the device.
pub struct Viewer {
    /// First of all: the runtime leaves before the GPU's objects go.
    session: Option<Session>,
    /// Of a session that is over.
    session_report: Option<HeadsetReport>,
    mirror: Mirror,
    /// It failed once, and is left alone.
    mirror_broken: bool,
    playlist: Playlist,
    loader: Loader,
    #[cfg(feature = "hot-reload")]
    shader_watch: ShaderWatch,
    canvas: WindowPresenter,
    overlay: Overlay,
    /// Nothing before the first scene is loaded.
    stage: Option<(Box<LoadedScene>, Control)>,
    /// Index of the last chosen camera.
    camera: usize,
    shading: Shading,
    clock: FrameClock,
    titled: Option<Instant>,
    hud: Hud,
    /// Files with the loader, in order.
    loading: VecDeque<String>,
    held: Held,
    modifiers: ModifiersState,
    drag: Option<Drag>,
    pointer: Option<PhysicalPosition<f64>>,
    /// The window's, pixels.
    size: [u32; 2],
    occluded: bool,
    focused: bool,
    screenshot: bool,
    frames: u64,
    gpu: Arc<Gpu>,
    window: Window,
}

impl Viewer {
    /// Takes a window, makes what is needed to draw into it, and starts loading.
    ///
    /// # Safety
    /// The window's event loop must outlive the viewer.
    pub unsafe fn new(
        gpu: Arc<Gpu>,
        window: Window,
        request: &ViewRequest<'_>,
        wake: EventLoopProxy<()>,
        session: Option<Session>,
    ) -> Result<Self> {
        // Without an event loop it needs no waking.
        let wake = move || {
            let _ = wake.send_event(());
        };
        // SAFETY: the window becomes a field that is dropped after the canvas; the caller keeps the event loop.
        let mut canvas = unsafe { WindowPresenter::new(&gpu, &window) }?;
        if session.is_some() {
            canvas.choose_free_mode();
        }
        Ok(Self {
            session,
            session_report: None,
            mirror: request.mirror,
            mirror_broken: false,
            playlist: Playlist::default(),
            loader: Loader::new(&gpu, request.settings(&gpu), wake)?,
            #[cfg(feature = "hot-reload")]
            shader_watch: ShaderWatch::new(&crate::gpu::shader_folder())?,
            canvas,
            overlay: Overlay::new(&gpu, 1)?,
            stage: None,
            camera: 0,
            shading: request.look.shading,
            clock: FrameClock::default(),
            titled: None,
            hud: Hud::default(),
            loading: VecDeque::new(),
            held: Held::default(),
            modifiers: ModifiersState::empty(),
            drag: None,
            pointer: None,
            size: window.inner_size().into(),
            occluded: false,
            focused: false,
            screenshot: false,
            frames: 0,
            gpu,
            window,
        })
    }

    /// The window.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// Frames shown so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// When the next frame is due: at once (`Poll`), later, or after some event.
    pub fn pace(&mut self) -> ControlFlow {
        let now = Instant::now();
        let pace = if self.session.is_some() {
            return self.headset_pace(now);
        } else if self.stage.is_none() || self.occluded || self.size.contains(&0) {
            ControlFlow::Wait
        } else if !self.focused && self.window.is_minimized() == Some(true) {
            // X11 tells of minimising only who asks.
            ControlFlow::WaitUntil(now + DOZE)
        } else {
            self.canvas.retry_at().filter(|at| *at > now).map_or(ControlFlow::Poll, ControlFlow::WaitUntil)
        };
        if pace != ControlFlow::Poll {
            self.clock.pause();
        }
        pace
    }

    /// Draws and shows one frame, if there is anything to draw and a place to draw it.
    pub fn draw(&mut self) -> Result<()> {
        #[cfg(feature = "hot-reload")]
        self.reload_changed_shaders()?;
        if self.session.is_some() {
            return self.draw_headset();
        }
        let wanted = self.size;
        let Some((stage, control)) = self.stage.as_mut().filter(|_| !wanted.contains(&0)) else { return Ok(()) };
        let (acquired, times) = self.canvas.begin(wanted)?;
        self.clock.add_gpu(&times, times.total_ms());
        let Some(acquired) = acquired else { return Ok(()) };
        let now = Instant::now();
        let seconds = self.clock.tick(now);
        control.step(self.held.movement(), self.held.fast(), seconds);
        let size = self.canvas.size();
        stage.renderer.resize(size)?;
        let eye = control.eye(size[0] as f32 / size[1] as f32);
        let largest = (TEXT_SCALE * self.window.scale_factor()).round().max(1.0) as u32;
        let mut settings = settings(stage, control, self.camera, self.canvas.mode().name()).to_vec();
        settings.extend(stage.renderer.standard_error(self.canvas.slot()).map(|error| error.to_string()));
        let status = Status { rate: self.clock.rate(), settings: &settings, loading: &self.loading };
        let (lines, scale) = self.hud.fit(now, &status, largest, |scale| Overlay::grid(size, scale));
        self.overlay.set_text(self.canvas.slot(), &lines, size, scale);
        // Screenshots are of the scene alone.
        let overlay = (!self.screenshot).then_some(&self.overlay);
        let recording = self.canvas.show(acquired, &mut stage.renderer, eye, overlay, &self.window)?;
        self.clock.add_recording(recording);
        if std::mem::take(&mut self.screenshot) {
            self.loader.start(LoadRequest::Screenshot { pixels: self.canvas.read(&stage.renderer)?, size });
        }
        self.frames += 1;
        if self.frames == 1 {
            say!("pbr-vr: window {}x{} on {}", size[0], size[1], self.gpu.info().name);
        }
        self.write_title(now);
        Ok(())
    }

    /// Starts loading a file that was named or dropped.
    pub fn open(&mut self, path: &Path) {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let path: PathBuf = path.into();
        let name = file_name(&path);
        let job = match extension.as_str() {
            "hdr" | "exr" => LoadRequest::Panorama { path },
            "toml" | "obj" => self.scene_job(path),
            _ => {
                let remedy = "drop a scene (.toml, .obj) or a panorama (.hdr, .exr)";
                return self.complain(&Error::Usage(format!("{name} cannot be shown; {remedy}")));
            }
        };
        self.start(name, job);
    }

    /// Starts loading the scene that the window was opened for, whatever its name; failing is final.
    pub fn open_first(&mut self, path: PathBuf) {
        let name = file_name(&path);
        self.playlist = Playlist::new(&path);
        self.window.set_title(&title(&name, None));
        let job = self.scene_job(path);
        self.start(name, job);
    }

    /// Takes what the loader has finished.
    pub fn collect(&mut self) -> Result<()> {
        while let Some(done) = self.loader.take()? {
            match done {
                LoadResult::Scene(stage) => {
                    self.loading.pop_front();
                    match stage {
                        Ok(stage) => self.enter(stage)?,
                        Err(error) if self.stage.is_none() => return Err(error),
                        Err(error) => self.complain(&error),
                    }
                }
                LoadResult::Panorama { name, light } => {
                    self.loading.pop_front();
                    match light {
                        Ok(light) => self.light_with(&name, *light)?,
                        Err(error) => self.complain(&error),
                    }
                }
                LoadResult::Screenshot(written) => {
                    report_screenshot(&written);
                    match written {
                        Ok(path) => self.note(format!("wrote {}", path.display())),
                        Err(error) => self.hud.error(Instant::now(), error.to_string()),
                    }
                }
            }
        }
        Ok(())
    }

    /// Other windows cover it wholly, or no longer.
    pub fn occlude(&mut self, occluded: bool) {
        self.occluded = occluded;
    }

    /// The window has another size, pixels; 0 while it is minimised, on some systems.
    pub fn resized(&mut self, size: [u32; 2]) {
        self.size = size;
        self.canvas.window_changed();
    }

    fn scene_job(&self, path: PathBuf) -> LoadRequest {
        let in_headset = |session: &Session| (session.size(), 2, session.hidden_area());
        let (size, eyes, hidden) = self.session.as_ref().map_or((self.size, 1, Default::default()), in_headset);
        LoadRequest::Scene { path, shading: self.shading, size: size.map(|s| s.max(1)), eyes, hidden }
    }

    fn start(&mut self, name: String, job: LoadRequest) {
        self.loading.push_back(name);
        self.loader.start(job);
    }

    fn enter(&mut self, mut stage: Box<LoadedScene>) -> Result<()> {
        // These may have been changed while the scene was loading.
        match &mut self.session {
            Some(session) => session.go_to(0),
            None => stage.renderer.set_eyes(1)?,
        }
        if stage.renderer.shading() != self.shading {
            stage.renderer.set_shading(self.shading)?;
        }
        if self.stage.is_some() {
            self.tell(format!("showing {}", stage.name));
        }
        let mut control = Control::new(&stage.cameras[0], stage.bounds);
        if self.stage.as_ref().is_some_and(|(_, old)| old.mode() == Mode::Fly) {
            control.switch_mode();
        }
        (self.camera, self.titled) = (0, None);
        self.stage = Some((stage, control));
        Ok(())
    }

    fn light_with(&mut self, name: &str, light: LightMaps) -> Result<()> {
        if let Some((stage, _)) = &mut self.stage {
            stage.renderer.set_light(light)?;
            stage.rotation_degrees = 0.0;
            self.tell(format!("lit by {name}"));
        }
        Ok(())
    }

    #[cfg(feature = "hot-reload")]
    fn reload_changed_shaders(&mut self) -> Result<()> {
        let now = Instant::now();
        let Some((stage, _)) = self.stage.as_mut().filter(|_| self.shader_watch.is_due(now)) else { return Ok(()) };
        let overlay = Overlay::new(&self.gpu, 1);
        match stage.renderer.reload_shaders().and(overlay) {
            Ok(overlay) => {
                self.overlay = overlay;
                self.hud.forget();
                self.tell("shaders reloaded; light maps are made anew with the next panorama or scene".into());
                Ok(())
            }
            Err(error @ Error::Broken { .. }) => {
                self.complain(&error);
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    fn write_title(&mut self, now: Instant) {
        let Some((stage, _)) = &self.stage else { return };
        let fresh = self.titled.is_some_and(|at| now < at + Duration::from_millis(500));
        if !fresh {
            self.window.set_title(&title(&stage.name, self.clock.rate()));
            self.titled = Some(now);
        }
    }

    fn note(&mut self, text: impl Into<String>) {
        self.hud.note(Instant::now(), text);
    }

    /// A note that stays on the terminal.
    fn tell(&mut self, text: String) {
        say!("pbr-vr: {text}");
        self.note(text);
    }

    /// Tells of something that went wrong and changed nothing.
    fn complain(&mut self, error: &Error) {
        crate::complain!("pbr-vr: {error}");
        self.hud.error(Instant::now(), error.to_string());
    }
}

/// The settings in words.
fn settings(stage: &mut LoadedScene, control: &Control, camera: usize, present_mode: &str) -> [String; 6] {
    let shading = stage.renderer.shading().to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    let mode = match control.mode() {
        Mode::Orbit => "orbit",
        Mode::Fly => "fly",
    };
    [
        shading,
        format!("{:+.1} EV", *stage.renderer.exposure_ev()),
        format!("panorama {:.0} deg", stage.renderer.environment_rotation().to_degrees()),
        format!("camera {}", stage.cameras[camera].name),
        mode.to_owned(),
        present_mode.to_owned(),
    ]
}
