//! The headset without a window: loading, frames, and the end.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::hands::Requests;
use super::playlist::Playlist;
use super::session::{End, Frame, Session};
use super::{Connected, RunReport};
use crate::gpu::Gpu;
use crate::render::Shading;
use crate::view::ViewRequest;
use crate::view::look::next_shading;
use crate::view::window::loader::{LoadRequest, LoadResult, LoadedScene, Loader};
use crate::{Error, Result, say};

/// How often the runtime's events are looked at while the first scene is loading.
const DOZE: Duration = Duration::from_millis(10);

/// Shows a scene in a connected headset until the runtime or the number of frames ends it.
///
/// # Errors
/// [`Error::Headset`] where it is lost on the way; whatever stops loading or drawing; validation
/// messages where asked for.
pub fn run(request: &ViewRequest<'_>, connected: Connected) -> Result<()> {
    let scene = request.scene()?;
    let gpu = Arc::clone(&connected.gpu);
    let messages = gpu.messages();
    let settings = request.settings(&gpu);
    let session = connected.begin(request.hidden_area)?;
    let mut alone = HeadsetApp {
        playlist: Playlist::new(&scene),
        loader: Loader::new(&gpu, settings, || {})?,
        session,
        stage: None,
        shading: request.look.shading,
        gpu,
    };
    let end = alone.play(&scene, request.frames);
    let reported = request.write_report(|| alone.report());
    // The device says its last words, leaks for one, while it is destroyed.
    drop(alone);
    match end? {
        Some(End::Lost(problem)) => return Err(Error::Headset { problem }),
        Some(End::Quit) => say!("pbr-vr: ends, because the headset's runtime does"),
        None => {}
    }
    reported?;
    messages.check()
}

/// What is shown. The session goes first, and with it the runtime.
struct HeadsetApp {
    session: Session,
    loader: Loader,
    stage: Option<Box<LoadedScene>>,
    shading: Shading,
    playlist: Playlist,
    gpu: Arc<Gpu>,
}

impl HeadsetApp {
    fn play(&mut self, scene: &Path, frames: Option<u64>) -> Result<Option<End>> {
        self.load(scene.to_owned());
        loop {
            self.collect()?;
            let Some(stage) = &mut self.stage else {
                if let Some(end) = self.session.follow_events()? {
                    return Ok(Some(end));
                }
                std::thread::sleep(DOZE);
                continue;
            };
            match self.session.frame(stage)? {
                Frame::Over(end) => return Ok(Some(end)),
                Frame::Shown(requests) => self.obey(requests)?,
            }
            if self.session.frames() == 1 {
                let [width, height] = self.session.size();
                say!(
                    "pbr-vr: in the headset {}, {width}x{height} per eye on {}",
                    self.session.name(),
                    self.gpu.info().name
                );
            }
            if frames.is_some_and(|frames| self.session.frames() >= frames) {
                return Ok(None);
            }
        }
    }

    fn load(&self, path: PathBuf) {
        let hidden = self.session.hidden_area();
        self.loader.start(LoadRequest::Scene {
            path,
            shading: self.shading,
            size: self.session.size(),
            eyes: 2,
            hidden,
        });
    }

    fn collect(&mut self) -> Result<()> {
        while let Some(done) = self.loader.take()? {
            match done {
                LoadResult::Scene(Ok(mut stage)) => {
                    // It may have been changed while the scene was loading.
                    if stage.renderer.shading() != self.shading {
                        stage.renderer.set_shading(self.shading)?;
                    }
                    self.session.go_to(0);
                    self.stage = Some(stage);
                }
                LoadResult::Scene(Err(error)) if self.stage.is_none() => return Err(error),
                LoadResult::Scene(Err(error)) => crate::complain!("pbr-vr: {error}"),
                LoadResult::Panorama { light, .. } => match (light, &mut self.stage) {
                    (Ok(light), Some(stage)) => stage.renderer.set_light(*light)?,
                    (Ok(_), None) => {}
                    (Err(error), _) => crate::complain!("pbr-vr: {error}"),
                },
                // Nobody asks for one here.
                LoadResult::Screenshot(_) => {}
            }
        }
        Ok(())
    }

    fn obey(&mut self, requests: Requests) -> Result<()> {
        if let Some(path) = requests.next_scene.then(|| self.playlist.next_scene()).flatten() {
            self.load(path);
        }
        if let Some(path) = requests.next_panorama.then(|| self.playlist.next_panorama()).flatten() {
            self.loader.start(LoadRequest::Panorama { path });
        }
        if let Some(stage) = self.stage.as_mut().filter(|_| requests.next_shading) {
            self.shading = next_shading(self.shading, 1, false);
            stage.renderer.set_shading(self.shading)?;
        }
        Ok(())
    }

    fn report(&self) -> RunReport {
        RunReport {
            on: "headset",
            gpu: self.gpu.info().name.clone(),
            driver: self.gpu.info().driver.clone(),
            frames: self.session.frames(),
            present_mode: None,
            headset: Some(self.session.report()),
        }
    }
}
