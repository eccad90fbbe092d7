//! The desktop window: event loop, and lifetime of the window and the GPU.

pub mod console;
mod desktop_failure;
mod fit;
#[cfg(feature = "hot-reload")]
mod hot_reload;
mod input;
mod keys;
mod mirror;
mod output;
mod presenter;
mod quit;
mod viewer;

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::{Window, WindowId};

use super::headset::{self, Session};
use super::interrupt;
use super::kept::{Losses, opened_again};
use super::request::{ViewRequest, Wanted};
use crate::context::Setup;
use crate::gpu::{Gpu, GpuOptions, Messages};
use crate::{Error, Result, complain, say};
use quit::QuitTimer;
use viewer::{KeptViewer, Viewer};

/// While a window is dragged or its menu is open, Windows runs a modal loop, in which winit emits redraws but never
/// `about_to_wait`. Elsewhere `about_to_wait` follows every redraw.
const HAS_MODAL_LOOPS: bool = cfg!(windows);
/// How long the end may wait for the loader.
const QUIT_LIMIT: Duration = Duration::from_millis(300);
/// Logical pixels.
const SIZE: LogicalSize<u32> = LogicalSize::new(1280, 720);

/// Shows a scene in a window until it is closed or the requested number of frames is reached; if requested, also in a
/// headset, with the window as its mirror. `no_headset` is the known reason why there is no headset; it is printed. Returns
/// the reason if no window could be opened; then nothing has been shown.
///
/// # Errors
/// Whatever stops loading or drawing; a required headset that is not available; validation messages where
/// validation was asked for.
pub fn run(
    request: &ViewRequest,
    setup: &Setup<'_>,
    wanted: Wanted,
    no_headset: Option<&str>,
) -> Result<Option<String>> {
    desktop_failure::install_hook();
    let event_loop = match EventLoop::with_user_event().build() {
        Ok(event_loop) => event_loop,
        Err(error) => return Ok(Some(problem_of(&error))),
    };
    let proxy = event_loop.create_proxy();
    let wake = event_loop.create_proxy();
    interrupt::listen(move || {
        // Without an event loop there is nothing to wake.
        let _ = wake.send_event(());
    });
    let mut handler = EventHandler {
        request,
        setup,
        wanted,
        no_headset,
        proxy,
        viewer: None,
        opened: false,
        messages: Vec::new(),
        losses: Losses::default(),
        failure: None,
        reported: Ok(()),
        waited: false,
    };
    // `exiting` drops the viewer before the event loop goes.
    let ended = event_loop.run_app(&mut handler);
    match handler.failure {
        Some(Error::Window { problem }) if !handler.opened => return Ok(Some(problem)),
        Some(error) => return Err(error),
        None => {}
    }
    ended.map_err(window_error)?;
    handler.reported?;
    handler.messages.iter().try_for_each(|messages| messages.check())?;
    Ok(None)
}

fn window_error(error: impl std::fmt::Display) -> Error {
    Error::Window { problem: problem_of(&error) }
}

fn problem_of(error: &impl std::fmt::Display) -> String {
    let text = error.to_string();
    // Winit's messages begin with a source location, which means nothing to users.
    let what = text.strip_prefix("os error at ").and_then(|rest| rest.split_once(": "));
    what.map_or(text.as_str(), |(_, what)| what).to_owned()
}

struct EventHandler<'a> {
    request: &'a ViewRequest,
    setup: &'a Setup<'a>,
    wanted: Wanted,
    no_headset: Option<&'a str>,
    proxy: EventLoopProxy<()>,
    viewer: Option<Viewer>,
    /// Whether a viewer has ever been created.
    opened: bool,
    /// Of each GPU that was opened.
    messages: Vec<Arc<Messages>>,
    losses: Losses,
    /// The error that ended the program early.
    failure: Option<Error>,
    /// The result of writing the report.
    reported: Result<()>,
    /// Whether `about_to_wait` has drawn for the headset since the last redraw.
    waited: bool,
}

impl EventHandler<'_> {
    fn start(&mut self, event_loop: &ActiveEventLoop) -> Result<Viewer> {
        let scene = self.request.scene()?;
        let attributes = Window::default_attributes().with_title("pbr-vr").with_inner_size(SIZE);
        let window = event_loop.create_window(attributes).map_err(window_error)?;
        let mut viewer = self.open(event_loop, window)?;
        self.opened = true;
        self.no_headset.iter().for_each(|why| say!("pbr-vr: in a window, because {why}"));
        viewer.open_first(&scene, self.request.staging.clone());
        Ok(viewer)
    }

    fn open(&mut self, event_loop: &ActiveEventLoop, window: Window) -> Result<Viewer> {
        let display = event_loop.display_handle().map_err(window_error)?;
        let handle = window.window_handle().map_err(window_error)?;
        let options = GpuOptions { display: Some(display), window: Some(handle), ..self.setup.gpu };
        let (gpu, session) = self.open_gpu(options)?;
        self.messages.push(gpu.messages());
        // SAFETY: `exiting` and `go_on` drop the viewer while the event loop still runs.
        unsafe { Viewer::new(self.setup.with(&gpu), window, self.request, self.proxy.clone(), session) }
    }

    /// Opens a GPU again after the loss or a failure of one, and shows the same as before.
    fn go_on(&mut self, event_loop: &ActiveEventLoop, failure: &Error) -> Result<()> {
        let Some(viewer) = self.viewer.take() else { return Ok(()) };
        tracing::debug!("{failure}");
        complain!("pbr-vr: {}", opened_again(failure));
        let report = viewer.report();
        let KeptViewer { window, view } = viewer.keep();
        let mut viewer = self.open(event_loop, window).inspect_err(|_| {
            self.reported = self.request.write_report(|| report);
        })?;
        viewer.restore(view);
        self.viewer = Some(viewer);
        Ok(())
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

    /// Calls `act` with the viewer, if there is one; an error ends the program.
    fn with(&mut self, event_loop: &ActiveEventLoop, act: impl FnOnce(&mut Viewer) -> Result<()>) {
        // After the first failure there are no more attempts: the device may be gone.
        let Some(viewer) = self.viewer.as_mut().filter(|_| self.failure.is_none()) else { return };
        let Err(error) = act(viewer) else { return };
        let goes_on = self.losses.may_go_on_after(&error, viewer.app.scene.is_some(), Instant::now());
        if let Err(error) = if goes_on { self.go_on(event_loop, &error) } else { Err(error) } {
            self.failure = Some(error);
            event_loop.exit();
        }
    }

    /// Requests a redraw, so that frames go on in a modal loop, which is detected by two redraws without `about_to_wait`
    /// between them.
    fn keep_painting(&mut self) {
        let viewer = self.viewer.as_mut().filter(|viewer| HAS_MODAL_LOOPS && viewer.is_in_headset());
        if let Some(viewer) = viewer.filter(|_| self.failure.is_none())
            && viewer.pace() == ControlFlow::Poll
        {
            viewer.output.window.request_redraw();
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

impl ApplicationHandler<()> for EventHandler<'_> {
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
        if interrupt::is_requested() {
            return event_loop.exit();
        }
        self.with(event_loop, Viewer::collect);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if let WindowEvent::RedrawRequested = event {
            // The headset sets the pace, whether or not the window is visible.
            let in_modal_loop = HAS_MODAL_LOOPS && !std::mem::take(&mut self.waited);
            if in_modal_loop || !self.viewer.as_ref().is_some_and(Viewer::is_in_headset) {
                self.draw(event_loop);
            }
            self.keep_painting();
            return;
        }
        self.with(event_loop, |viewer| {
            let taken = viewer.output.pass_to_panel(&event);
            match event {
                WindowEvent::CloseRequested => event_loop.exit(),
                WindowEvent::Destroyed => {
                    return Err(Error::Window { problem: "another program has destroyed it".into() });
                }
                // A change of scale changes the size, too.
                WindowEvent::Resized(size) => viewer.resized(size.into())?,
                WindowEvent::Occluded(occluded) => viewer.output.occluded = occluded,
                WindowEvent::Focused(focused) => viewer.output.focus(focused),
                WindowEvent::ModifiersChanged(modifiers) => viewer.output.modifiers = modifiers.state(),
                WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if viewer.key(&event)? => {
                    event_loop.exit();
                }
                // Released, a button is for whoever it was pressed for.
                WindowEvent::MouseInput { state, button, .. } if !taken || !state.is_pressed() => {
                    if let Some(pixel) = viewer.output.button(state, button) {
                        viewer.pick(pixel)?;
                    }
                }
                WindowEvent::CursorMoved { position, .. } => viewer.output.pointer(position),
                WindowEvent::MouseWheel { delta, .. } if !taken => viewer.output.wheel(delta),
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
            viewer.output.window.request_redraw();
            event_loop.set_control_flow(ControlFlow::Wait);
        } else {
            event_loop.set_control_flow(pace);
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        if let Some(viewer) = &mut self.viewer {
            self.reported = self.request.write_report(|| viewer.report());
            // The runtime is shut down before anything else, whatever happens then.
            viewer.session = None;
            viewer.output.window.set_visible(false);
        }
        let only_loads = self.viewer.as_ref().is_some_and(|viewer| viewer.app.is_only_loading());
        // What is still loading takes seconds to stop, and nobody waits for it. Validation wants to see all destroyed.
        let may_quit = only_loads && self.failure.is_none() && self.reported.is_ok() && !self.setup.gpu.validate;
        let _timer = may_quit.then(|| QuitTimer::start(QUIT_LIMIT));
        self.viewer = None;
    }
}
