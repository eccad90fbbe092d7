//! The app with a headset as its only output: frame loop and shutdown.

use std::time::{Duration, Instant};

use super::session::{End, FrameResult, Session};
use super::{Connected, RunReport};
use crate::context::Setup;
use crate::view::action::Action;
use crate::view::app::App;
use crate::view::frame_clock::FrameClock;
use crate::view::kept::{Kept, Losses, opened_again};
use crate::view::update::{Arrival, Update};
use crate::view::{ViewRequest, interrupt, screenshot};
use crate::{Error, Result, complain, say};

/// How often the runtime's events are polled while the first scene is loading.
const POLL: Duration = Duration::from_millis(10);

/// Shows a scene in a connected headset until the runtime, a signal or the number of frames ends it.
///
/// # Errors
/// [`Error::Headset`] if the headset is lost; whatever stops loading or drawing; validation messages where asked for.
pub fn run(request: &ViewRequest, connected: Connected, setup: &Setup<'_>) -> Result<()> {
    let scene = request.scene()?;
    let mut messages = vec![connected.gpu.messages()];
    let mut headset = HeadsetApp::new(request, connected, setup)?;
    interrupt::listen(|| {});
    headset.app.open_first(&scene, request.staging.clone());
    let (mut end, mut losses) = (headset.play(request.frames), Losses::default());
    while let Err(error) = &end
        && losses.may_go_on_after(error, headset.app.scene.is_some(), Instant::now())
    {
        tracing::debug!("{error}");
        complain!("pbr-vr: {}", opened_again(error));
        let report = headset.report();
        let kept = headset.keep();
        let again = super::connect(setup.gpu).and_then(|connected| {
            messages.push(connected.gpu.messages());
            HeadsetApp::new(request, connected, setup)
        });
        headset = again.or_else(|error| request.write_report(|| report).and(Err(error)))?;
        headset.app.restore(kept);
        end = headset.play(request.frames);
    }
    let reported = request.write_report(|| headset.report());
    // Destroying the device may add validation messages, for example about leaks.
    drop(headset);
    match end? {
        Some(End::Lost(problem)) => return Err(Error::Headset { problem }),
        Some(End::Quit) => say!("pbr-vr: ends, because the headset's runtime does"),
        None => {}
    }
    reported?;
    messages.iter().try_for_each(|messages| messages.check())
}

/// Drop order: the session, and with it the runtime, before anything on the GPU.
struct HeadsetApp {
    session: Session,
    app: App,
    clock: FrameClock,
}

impl HeadsetApp {
    fn new(request: &ViewRequest, connected: Connected, setup: &Setup<'_>) -> Result<Self> {
        let context = setup.with(&connected.gpu);
        let session = connected.begin(request.hidden_area)?;
        let app = App::new(context, request.settings.clone(), session.target(), || {}, request.measurements)?;
        session.when_hopeless(request.last_report(&app.context.gpu));
        Ok(Self { session, app, clock: FrameClock::default() })
    }

    /// Ends on this GPU; returns what goes on with another.
    fn keep(self) -> Kept {
        let Self { session, app, .. } = self;
        drop(session);
        app.keep()
    }

    fn play(&mut self, frames: Option<u64>) -> Result<Option<End>> {
        while !interrupt::is_requested() {
            self.collect()?;
            let Some(scene) = &mut self.app.scene else {
                if let Some(end) = self.session.follow_events()? {
                    return Ok(Some(end));
                }
                std::thread::sleep(POLL);
                continue;
            };
            match self.session.frame(scene)? {
                FrameResult::Over(end) => return Ok(Some(end)),
                FrameResult::Shown(requests) => self.app.obey(requests)?,
            }
            self.session.time_frame(&mut self.clock, Instant::now());
            let actions = self.session.follow_panel(&self.app, &self.clock)?;
            actions.into_iter().try_for_each(|action| self.perform(action))?;
            if self.session.frames() == 1 {
                let [width, height] = self.session.size();
                let (headset, gpu) = (self.session.name(), &self.app.context.gpu.info().name);
                say!("pbr-vr: in the headset {headset}, {width}x{height} per eye on {gpu}");
            }
            if frames.is_some_and(|frames| self.session.frames() >= frames) {
                break;
            }
        }
        Ok(None)
    }

    /// Performs a command of the panel.
    fn perform(&mut self, action: Action) -> Result<()> {
        let Some(action) = self.app.perform(action)? else { return Ok(()) };
        let Some(scene) = &mut self.app.scene else { return Ok(()) };
        match action {
            Action::Camera(index) if index < scene.loaded.cameras.len() => {
                scene.camera = index;
                self.session.go_to(index);
            }
            Action::Reset => {
                self.session.go_to(scene.camera);
                self.app.reset()?;
            }
            Action::Open(path) => {
                if let Err(error) = self.app.open(&path) {
                    self.complain(&error);
                }
            }
            // A panel that is alone has no other controls.
            _ => {}
        }
        Ok(())
    }

    /// Shows and prints an error that changed nothing.
    fn complain(&mut self, error: &Error) {
        crate::complain!("pbr-vr: {error}");
        self.session.show_error(error);
    }

    fn collect(&mut self) -> Result<()> {
        while let Some(update) = self.app.collect()? {
            match update {
                Update::Scene(Arrival::Again) => {}
                Update::Scene(_) => self.session.go_to(0),
                Update::Failed(error) => self.complain(&error),
                Update::Screenshot(written) => screenshot::report(&written),
                Update::Textures(why) => say!("pbr-vr: {why}"),
                Update::Light(_) | Update::Settings => {}
            }
        }
        Ok(())
    }

    fn report(&self) -> RunReport {
        RunReport {
            on: "headset",
            gpu: self.app.context.gpu.info().name.clone(),
            driver: self.app.context.gpu.info().driver.clone(),
            frames: self.session.frames(),
            rate: self.clock.rate().cloned(),
            present_mode: None,
            headset: Some(self.session.report()),
        }
    }
}
