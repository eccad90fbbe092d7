//! The app with a window as its output and, while one is connected, a headset that the window mirrors.

use std::path::Path;
use std::time::{Duration, Instant};

use winit::event_loop::{ControlFlow, EventLoopProxy};
use winit::window::Window;

#[cfg(feature = "hot-reload")]
use super::hot_reload::ShaderWatch;
use super::mirror::MirrorView;
use super::output::{WindowOutput, title};
use crate::context::Context;
use crate::scene::staging::Staging;
use crate::view::ViewRequest;
use crate::view::app::App;
use crate::view::control::Control;
use crate::view::frame_clock::ms_since;
use crate::view::headset::{End, FrameResult, HeadsetReport, RunReport, Session};
use crate::view::kept::Kept;
use crate::view::loader::file_name;
use crate::view::update::{Arrival, Update};
use crate::{Error, Result, say};

/// How often the headset runtime's events are polled while there is nothing to draw.
const POLL: Duration = Duration::from_millis(20);

/// Drop order: the headset's runtime before the GPU's objects, the window last.
pub struct Viewer {
    pub session: Option<Session>,
    /// Of a session that has ended.
    session_report: Option<HeadsetReport>,
    mirror: MirrorView,
    /// Mirroring has failed and is not tried again.
    mirror_broken: bool,
    #[cfg(feature = "hot-reload")]
    shader_watch: ShaderWatch,
    pub app: App,
    pub output: WindowOutput,
    frames: u64,
}

/// What outlasts a viewer whose GPU was lost.
pub struct KeptViewer {
    pub window: Window,
    pub view: KeptView,
}

/// What the window shows.
pub struct KeptView {
    app: Kept,
    control: Option<Control>,
    frames: u64,
}

impl Viewer {
    /// Opens the outputs, without a scene.
    ///
    /// # Errors
    /// Whatever stops making the swapchain or starting the loader.
    ///
    /// # Safety
    /// The window's event loop must outlive the viewer.
    pub unsafe fn new(
        context: Context,
        window: Window,
        request: &ViewRequest,
        wake: EventLoopProxy<()>,
        session: Option<Session>,
    ) -> Result<Self> {
        // Without an event loop there is nothing to wake.
        let wake = move || {
            let _ = wake.send_event(());
        };
        // SAFETY: guaranteed by the caller.
        let mut output = unsafe { WindowOutput::new(&context.gpu, window, wake.clone()) }?;
        // Whoever counts frames wants to see them all drawn.
        output.continuous = request.frames.is_some();
        if let Some(session) = &session {
            output.presenter.choose_free_mode();
            session.when_hopeless(request.last_report(&context.gpu));
        }
        let target = session.as_ref().map_or_else(|| output.target(), Session::target);
        Ok(Self {
            app: App::new(context, request.settings.clone(), target, wake, request.measurements)?,
            session,
            session_report: None,
            mirror: MirrorView::new(request.mirror),
            mirror_broken: false,
            #[cfg(feature = "hot-reload")]
            shader_watch: ShaderWatch::new(&crate::gpu::shader_folder())?,
            output,
            frames: 0,
        })
    }

    /// Ends on this GPU; returns what goes on with another.
    pub fn keep(self) -> KeptViewer {
        let Self { session, app, output, frames, .. } = self;
        // The runtime is shut down before anything else, as always.
        drop(session);
        let app = app.keep();
        let (window, control) = output.keep();
        KeptViewer { window, view: KeptView { app, control, frames } }
    }

    /// Goes on with what a viewer before this one has shown.
    pub fn restore(&mut self, view: KeptView) {
        let KeptView { app, control, frames } = view;
        (self.output.control, self.frames) = (control, frames);
        self.app.restore(app);
    }

    /// Frames shown so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Whether frames go to a headset.
    pub fn is_in_headset(&self) -> bool {
        self.session.is_some()
    }

    /// Times and facts so far.
    pub fn report(&self) -> RunReport {
        let headset = self.session.as_ref().map(|session| session.report()).or_else(|| self.session_report.clone());
        RunReport {
            on: if headset.is_some() { "headset" } else { "window" },
            gpu: self.app.context.gpu.info().name.clone(),
            driver: self.app.context.gpu.info().driver.clone(),
            frames: self.frames,
            rate: self.output.clock.rate().cloned(),
            present_mode: Some(self.output.presenter.mode().name()),
            headset,
        }
    }

    /// When the next frame is due: at once (`Poll`), later, or after some event.
    pub fn pace(&mut self) -> ControlFlow {
        #[cfg(feature = "hot-reload")]
        let look_at = self.shader_watch.look_at(Instant::now());
        let pace = match (self.session.is_some(), self.app.scene.is_some()) {
            (false, _) => self.output.pace(&self.app),
            // The headset's runtime waits until a frame is due.
            (true, true) => ControlFlow::Poll,
            (true, false) => ControlFlow::WaitUntil(Instant::now() + POLL),
        };
        // A window at rest looks after changed shaders, too.
        #[cfg(feature = "hot-reload")]
        let pace = match pace {
            _ if look_at <= Instant::now() => ControlFlow::Poll,
            ControlFlow::Wait => ControlFlow::WaitUntil(look_at),
            ControlFlow::WaitUntil(at) => ControlFlow::WaitUntil(at.min(look_at)),
            ControlFlow::Poll => ControlFlow::Poll,
        };
        pace
    }

    /// Draws and shows one frame, if there is anything to draw and a place to draw it.
    pub fn draw(&mut self) -> Result<()> {
        #[cfg(feature = "hot-reload")]
        self.reload_changed_shaders()?;
        if self.session.is_some() {
            self.draw_headset()?;
            return self.perform_waiting();
        }
        if self.output.draw(&mut self.app)? {
            self.frames += u64::from(self.app.scene.is_some());
            if self.frames == 1 {
                let [width, height] = self.output.presenter.size();
                say!("pbr-vr: window {width}x{height} on {}", self.app.context.gpu.info().name);
            }
        }
        self.perform_waiting()
    }

    /// Starts loading a file that was dropped on the window.
    pub fn open(&mut self, path: &Path) {
        if let Err(error) = self.app.open(path) {
            self.output.complain(&error);
        }
    }

    /// Starts loading the scene that the window was opened for; failing is final.
    pub fn open_first(&mut self, path: &Path, staging: Staging) {
        self.output.window.set_title(&title(&file_name(path), None));
        self.app.open_first(path, staging);
    }

    /// Takes what the loader has finished.
    pub fn collect(&mut self) -> Result<()> {
        while let Some(update) = self.app.collect()? {
            if let (Update::Scene(Arrival::First | Arrival::Next), Some(session)) = (&update, &mut self.session) {
                session.go_to(0);
            }
            self.output.update(&self.app, update);
        }
        // Another thread may have something new for the panel.
        self.output.panel.refresh();
        Ok(())
    }

    /// Handles a new size of the window, pixels; 0 while it is minimised, on some systems.
    pub fn resized(&mut self, size: [u32; 2]) -> Result<()> {
        self.output.size = size;
        self.output.presenter.window_changed();
        if self.session.is_none() { self.app.set_target(self.output.target()) } else { Ok(()) }
    }

    /// Draws one frame for the headset, if there is a scene, and mirrors it.
    fn draw_headset(&mut self) -> Result<()> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let shown = match &mut self.app.scene {
            Some(scene) => session.frame(scene),
            None => match session.follow_events() {
                Ok(None) => return Ok(()),
                ended => ended.map(|end| FrameResult::Over(end.unwrap_or(End::Quit))),
            },
        };
        let requests = match shown {
            Ok(FrameResult::Shown(requests)) => requests,
            Ok(FrameResult::Over(end)) => return self.leave_headset(&end),
            Err(Error::Headset { problem }) => return self.leave_headset(&End::Lost(problem)),
            Err(error) => return Err(error),
        };
        self.frames += 1;
        let now = Instant::now();
        session.time_frame(&mut self.output.clock, now);
        let shown = self.mirror_if_it_works(now)?;
        let Some(session) = &mut self.session else { return Ok(()) };
        session.mirrored(shown, ms_since(now));
        if self.frames == 1 {
            let [width, height] = session.size();
            let (headset, gpu) = (session.name(), &self.app.context.gpu.info().name);
            say!("pbr-vr: in the headset {headset}, {width}x{height} per eye on {gpu}, mirrored in a window");
        }
        self.output.actions.extend(session.follow_panel(&self.app, &self.output.clock)?);
        self.app.obey(requests)
    }

    /// Continues in the window alone: scene and light stay; the eyes' pipelines and images are freed.
    fn leave_headset(&mut self, end: &End) -> Result<()> {
        self.session_report = self.session.as_ref().map(|session| session.report());
        // The runtime is shut down here.
        self.session = None;
        self.app.set_target(self.output.target())?;
        // The display paces the window again; a mirror that failed may work with another swapchain.
        self.output.presenter.choose_vsync();
        self.output.clock.pause();
        let why = match end {
            End::Quit => "the headset's runtime ends",
            End::Lost(why) => why,
        };
        self.output.announce(format!("in the window from here on, because {why}"));
        Ok(())
    }

    /// Mirrors the headset; if that fails, the headset continues without a mirror, unless the GPU is lost.
    fn mirror_if_it_works(&mut self, now: Instant) -> Result<bool> {
        let Some(session) = self.session.as_ref().filter(|_| !self.mirror_broken) else { return Ok(false) };
        let parts = self.mirror.follow(session, self.output.presenter.size());
        match self.output.mirror(&mut self.app, session, &parts, now) {
            Err(error) if !error.is_device_lost() => {
                self.mirror_broken = true;
                crate::complain!("pbr-vr: the window no longer shows the headset: {error}");
                Ok(false)
            }
            mirrored => mirrored,
        }
    }

    #[cfg(feature = "hot-reload")]
    fn reload_changed_shaders(&mut self) -> Result<()> {
        let now = Instant::now();
        let due = self.shader_watch.is_due(now);
        let Some(scene) = self.app.scene.as_mut().filter(|_| due) else { return Ok(()) };
        match scene.loaded.reload_shaders() {
            Ok(()) => {
                self.app.redraw();
                self.output.panel.forget();
                self.output.announce(
                    "shaders reloaded; light maps are precomputed again with the next panorama or scene".into(),
                );
                Ok(())
            }
            Err(error @ Error::Broken { .. }) => {
                self.output.complain(&error);
                Ok(())
            }
            Err(error) => Err(error),
        }
    }
}
