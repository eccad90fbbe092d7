//! The desktop window: event loop, and when the window, the GPU and what is drawn come and go.

mod canvas;
#[cfg(feature = "hot-reload")]
mod hot_reload;
mod hud;
mod keys;
mod viewer;
mod worker;

use std::sync::Arc;

use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::raw_window_handle::HasDisplayHandle;
use winit::window::{Window, WindowId};

use super::ViewRequest;
use crate::asset::Report;
use crate::gpu::{Gpu, GpuOptions, Messages};
use crate::precompute::Options;
use crate::render::Settings;
use crate::{Error, Result};
use viewer::Viewer;

/// Logical pixels.
const SIZE: LogicalSize<u32> = LogicalSize::new(1280, 720);

/// Shows a scene in a window until that is closed, or for as many frames as asked for.
///
/// # Errors
/// [`Error::Window`] where none can be opened; whatever stops loading or drawing; validation messages where asked for.
pub fn run(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    let event_loop = EventLoop::with_user_event().build().map_err(window_error)?;
    let proxy = event_loop.create_proxy();
    let mut app = App { request, options: gpu, proxy, viewer: None, messages: None, failure: None };
    // `exiting` drops the viewer before the event loop goes.
    let ended = event_loop.run_app(&mut app);
    if let Some(error) = app.failure {
        return Err(error);
    }
    ended.map_err(window_error)?;
    app.messages.map_or(Ok(()), |messages| messages.check())
}

fn window_error(error: impl std::fmt::Display) -> Error {
    let text = error.to_string();
    // Winit begins with the line of its source, which tells its users nothing.
    let what = text.strip_prefix("os error at ").and_then(|rest| rest.split_once(": "));
    Error::Window { problem: what.map_or(text.as_str(), |(_, what)| what).to_owned() }
}

struct App<'a> {
    request: &'a ViewRequest<'a>,
    options: GpuOptions<'a>,
    proxy: EventLoopProxy<()>,
    viewer: Option<Viewer>,
    messages: Option<Arc<Messages>>,
    /// What ended the program early.
    failure: Option<Error>,
}

impl App<'_> {
    fn start(&mut self, event_loop: &ActiveEventLoop) -> Result<Viewer> {
        let scene = self.request.scene()?;
        let attributes = Window::default_attributes().with_title("pbr-vr").with_inner_size(SIZE);
        let window = event_loop.create_window(attributes).map_err(window_error)?;
        let display = event_loop.display_handle().map_err(window_error)?.as_raw();
        let gpu = Gpu::open(GpuOptions { display: Some(display), ..self.options })?;
        self.messages = Some(gpu.messages());
        let (geometry, split_sum) = (self.request.geometry, self.request.split_sum);
        let precompute = Options { cache: self.request.cache.cloned(), ..Options::default() };
        let textures = self.request.textures.options(&gpu, self.request.cache, &Report::to_terminal());
        let model = self.request.model;
        let settings = Settings { geometry, split_sum, model, precompute, textures, ..Settings::default() };
        // SAFETY: `exiting` drops the viewer while the event loop still runs.
        let mut viewer = unsafe { Viewer::new(gpu, window, settings, self.request.shading, self.proxy.clone()) }?;
        viewer.open_first(scene);
        Ok(viewer)
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
            return self.draw(event_loop);
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
        if pace == ControlFlow::Poll {
            // The request itself wakes the loop, so that it can wait for it.
            viewer.window().request_redraw();
            event_loop.set_control_flow(ControlFlow::Wait);
        } else {
            event_loop.set_control_flow(pace);
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        self.viewer = None;
    }
}
