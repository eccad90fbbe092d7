//! The desktop window: event loop, and when the window, the GPU and what is drawn come and go.

mod presenter;
pub mod console;
mod fit;
#[cfg(feature = "hot-reload")]
mod hot_reload;
mod hud;
mod keys;
mod viewer;
pub(super) mod loader;

use std::sync::Arc;

use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::{Window, WindowId};

use super::headset::{self, Session};
use super::{ViewRequest, Wanted};
use crate::gpu::{Gpu, GpuOptions, Messages};
use crate::{Error, Result, say};
use viewer::Viewer;

/// While a window is dragged or its menu is open, Windows runs a loop of its own, which never comes to `about_to_wait`, but
/// paints. Elsewhere winit comes to `about_to_wait` after each painting.
const LOOPS_OF_ITS_OWN: bool = cfg!(windows);
/// Logical pixels.
const SIZE: LogicalSize<u32> = LogicalSize::new(1280, 720);

/// Shows a scene in a window until that is closed, or for as many frames as asked for; and in a headset, if wanted, with the
/// window as its mirror. Returns why no window could be opened, if so; then nothing has been shown.
///
/// # Errors
/// Whatever stops loading or drawing; a headset that is wanted before all else and cannot be had; validation messages where
/// asked for.
pub fn run(request: &ViewRequest<'_>, gpu: GpuOptions<'_>, wanted: Wanted) -> Result<Option<String>> {
    end_in_words_if_the_desktop_dies();
    let event_loop = match EventLoop::with_user_event().build() {
        Ok(event_loop) => event_loop,
        Err(error) => return Ok(Some(problem_of(&error))),
    };
    let proxy = event_loop.create_proxy();
    let mut app = App {
        request,
        options: gpu,
        wanted,
        proxy,
        viewer: None,
        opened: false,
        messages: None,
        failure: None,
        reported: Ok(()),
        waited: false,
    };
    // `exiting` drops the viewer before the event loop goes.
    let ended = event_loop.run_app(&mut app);
    match app.failure {
        Some(Error::Window { problem }) if !app.opened => return Ok(Some(problem)),
        Some(error) => return Err(error),
        None => {}
    }
    ended.map_err(window_error)?;
    app.reported?;
    app.messages.map_or(Ok(()), |messages| messages.check())?;
    Ok(None)
}

/// Winit panics where the connection to the desktop breaks within a call of its own (elsewhere Xlib ends the process): nothing
/// can be drawn from then on, and a backtrace tells the user nothing.
fn end_in_words_if_the_desktop_dies() {
    let otherwise = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| place.file().contains("winit")) {
            return otherwise(panic);
        }
        let why = panic.payload().downcast_ref::<String>().map_or("it does not say why", String::as_str);
        let error = Error::Window { problem: format!("the window system failed: {why}") };
        crate::complain!("pbr-vr: {error}");
        std::process::exit(error.exit_code().into());
    }));
}

fn window_error(error: impl std::fmt::Display) -> Error {
    Error::Window { problem: problem_of(&error) }
}

fn problem_of(error: &impl std::fmt::Display) -> String {
    let text = error.to_string();
    // Winit begins with the line of its source, which tells its users nothing.
    let what = text.strip_prefix("os error at ").and_then(|rest| rest.split_once(": "));
    what.map_or(text.as_str(), |(_, what)| what).to_owned()
}

struct App<'a> {
    request: &'a ViewRequest<'a>,
    options: GpuOptions<'a>,
    wanted: Wanted,
    proxy: EventLoopProxy<()>,
    viewer: Option<Viewer>,
    /// Whether there has been a viewer.
    opened: bool,
    messages: Option<Arc<Messages>>,
    /// What ended the program early.
    failure: Option<Error>,
    /// Whether the report could be written.
    reported: Result<()>,
    /// Whether `about_to_wait` has drawn for the headset since the last painting.
    waited: bool,
}

impl App<'_> {
    fn start(&mut self, event_loop: &ActiveEventLoop) -> Result<Viewer> {
        let scene = self.request.scene()?;
        let attributes = Window::default_attributes().with_title("pbr-vr").with_inner_size(SIZE);
        let window = event_loop.create_window(attributes).map_err(window_error)?;
        let display = event_loop.display_handle().map_err(window_error)?;
        let handle = window.window_handle().map_err(window_error)?;
        let options = GpuOptions { display: Some(display), window: Some(handle), ..self.options };
        let (gpu, session) = self.open_gpu(options)?;
        self.messages = Some(gpu.messages());
        // SAFETY: `exiting` drops the viewer while the event loop still runs.
        let mut viewer = unsafe { Viewer::new(gpu, window, self.request, self.proxy.clone(), session) }?;
        self.opened = true;
        self.request.no_headset.iter().for_each(|why| say!("pbr-vr: in a window, because {why}"));
        viewer.open_first(scene);
        Ok(viewer)
    }

    fn open_gpu(&self, options: GpuOptions<'_>) -> Result<(Arc<Gpu>, Option<Session>)> {
        if self.wanted == Wanted::Window {
            return Ok((Gpu::open(options)?, None));
        }
        let connected = headset::connect(options).and_then(|connected| {
            let gpu = Arc::clone(&connected.gpu);
            let session = connected.begin(self.request.hidden_area)?;
            Ok((gpu, Some(session)))
        });
        match connected {
            Err(Error::Headset { problem }) if self.wanted == Wanted::Headset => {
                say!("pbr-vr: in a window, because {problem}");
                Ok((Gpu::open(options)?, None))
            }
            connected => connected,
        }
    }

    /// Does something with the viewer, if there is one; a failure ends the program.
    fn with(&mut self, event_loop: &ActiveEventLoop, act: impl FnOnce(&mut Viewer) -> Result<()>) {
        // After the first failure there are no more attempts: the device may be gone.
        let Some(viewer) = self.viewer.as_mut().filter(|_| self.failure.is_none()) else { return };
        if let Err(error) = act(viewer) {
            self.failure = Some(error);
            event_loop.exit();
        }
    }

    /// Asks for the painting by which a loop that holds up `about_to_wait` shows: two in a row without that in between.
    fn keep_painting(&mut self) {
        let viewer = self.viewer.as_mut().filter(|viewer| LOOPS_OF_ITS_OWN && viewer.is_in_headset());
        if let Some(viewer) = viewer.filter(|_| self.failure.is_none())
            && viewer.pace() == ControlFlow::Poll
        {
            viewer.window().request_redraw();
        }
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let frames = self.request.frames;
        self.with(event_loop, |viewer| {
            viewer.draw()?;
            if frames.is_some_and(|frames| viewer.frames() >= frames) {
                event_loop.exit();
            }
            Ok(())
        });
    }
}

impl ApplicationHandler<()> for App<'_> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.viewer.is_none() && self.failure.is_none() {
            match self.start(event_loop) {
                Ok(viewer) => self.viewer = Some(viewer),
                Err(error) => {
                    self.failure = Some(error);
                    event_loop.exit();
                }
            }
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, (): ()) {
        self.with(event_loop, Viewer::collect);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if let WindowEvent::RedrawRequested = event {
            // The headset sets the pace, whether or not the window is seen.
            let held_up = LOOPS_OF_ITS_OWN && !std::mem::take(&mut self.waited);
            if held_up || !self.viewer.as_ref().is_some_and(Viewer::is_in_headset) {
                self.draw(event_loop);
            }
            self.keep_painting();
            return;
        }
        self.with(event_loop, |viewer| {
            match event {
                WindowEvent::CloseRequested => event_loop.exit(),
                WindowEvent::Destroyed => {
                    return Err(Error::Window { problem: "another program has destroyed it".into() });
                }
                // A change of scale changes the size, too.
                WindowEvent::Resized(size) => viewer.resized(size.into()),
                WindowEvent::Occluded(occluded) => viewer.occlude(occluded),
                WindowEvent::Focused(focused) => viewer.focus(focused),
                WindowEvent::ModifiersChanged(modifiers) => viewer.modifiers(modifiers.state()),
                WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if viewer.key(&event)? => {
                    event_loop.exit();
                }
                WindowEvent::MouseInput { state, button, .. } => viewer.button(state, button),
                WindowEvent::CursorMoved { position, .. } => viewer.pointer(position),
                WindowEvent::MouseWheel { delta, .. } => viewer.wheel(delta),
                WindowEvent::DroppedFile(path) => viewer.open(&path),
                _ => {}
            }
            Ok(())
        });
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(viewer) = self.viewer.as_mut().filter(|_| self.failure.is_none()) else { return };
        let pace = viewer.pace();
        if viewer.is_in_headset() {
            event_loop.set_control_flow(pace);
            self.draw(event_loop);
            self.waited = true;
            self.keep_painting();
        } else if pace == ControlFlow::Poll {
            // The request itself wakes the loop, so that it can wait for it.
            viewer.window().request_redraw();
            event_loop.set_control_flow(ControlFlow::Wait);
        } else {
            event_loop.set_control_flow(pace);
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let Some(viewer) = &self.viewer {
            self.reported = self.request.write_report(|| viewer.report());
        }
        self.viewer = None;
    }
}
