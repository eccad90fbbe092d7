//! State shared by all outputs: the current scene, the requested settings, the loader and the playlist. Outputs (a window, a
//! headset, or both) draw it and pass on the user's requests.

mod light;
mod textures;

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::action::{Action, Requests};
use super::kept::Kept;
use super::loader::{LoadRequest, LoadResult, LoadedScene, Loader, Target, file_name};
use super::loading_files::LoadingFiles;
use super::measured::Measurements;
use super::playlist::Playlist;
use super::shown_scene::{SceneChanges, ShownScene};
use super::stagings::Stagings;
use super::update::{Arrival, Update};
use crate::asset::Report;
use crate::context::Context;
use crate::render::{Change, Lighting, Lightmapped, RenderSettings, Shading};
use crate::scene::is_scene;
use crate::scene::load::scene_in;
use crate::scene::staging::Staging;
use crate::{Error, Result};

/// Light that is shown as soon as its pipelines are there.
struct NewLight {
    path: PathBuf,
    lighting: Lighting,
    /// What it was precomputed with.
    settings: RenderSettings,
}

/// The state that outputs share. Drop order: the loader's thread ends before the scene is freed.
pub struct App {
    loader: Loader,
    playlist: Playlist,
    /// `None` until the first scene is loaded.
    pub scene: Option<ShownScene>,
    /// The requested settings; the shown scene changes to them when the loader has finished.
    settings: RenderSettings,
    /// Those of the start.
    first_settings: RenderSettings,
    target: Target,
    /// The number of the last request for pipelines.
    pipelines: u64,
    /// What the last request for pipelines is for, if not the light that is shown.
    new_light: Option<NewLight>,
    /// Of the shown scene: shown as soon as its pipelines are there, after `new_light`.
    new_lightmap: Option<Lightmapped>,
    /// The number of the last request for a scene.
    scenes: u64,
    /// That number, where the request was for the shown scene with other settings.
    again: Option<u64>,
    /// What was changed of the scene of that request by an app before this one.
    changes: Option<SceneChanges>,
    stagings: Stagings,
    loading: LoadingFiles,
    /// Counts changes of the scene, its light, its settings or its target: what is drawn from then on may look different.
    revision: u64,
    /// Why a setting was not changed; told by the next `collect`.
    refusal: Option<Error>,
    /// Screenshots that are being written.
    screenshots: usize,
    pub context: Context,
}

impl App {
    /// An app without a scene. The loader calls `wake` whenever [`App::collect`] has something to collect, and `measurements`
    /// for each scene.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn new(
        context: Context,
        settings: RenderSettings,
        target: Target,
        wake: impl Fn() + Clone + Send + 'static,
        measurements: Option<Measurements>,
    ) -> Result<Self> {
        Ok(Self {
            loader: Loader::new(&context, measurements, wake)?,
            playlist: Playlist::new(),
            scene: None,
            first_settings: settings.clone(),
            settings,
            target,
            pipelines: 0,
            new_light: None,
            new_lightmap: None,
            scenes: 0,
            again: None,
            changes: None,
            stagings: Stagings::default(),
            loading: LoadingFiles::default(),
            revision: 0,
            refusal: None,
            screenshots: 0,
            context,
        })
    }

    /// The requested settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// Scenes and panoramas to choose from.
    pub fn playlist(&self) -> &Playlist {
        &self.playlist
    }

    /// The files that are being loaded.
    pub fn loading(&self) -> &LoadingFiles {
        &self.loading
    }

    /// Warnings and progress of loading.
    pub fn report(&self) -> &Report {
        self.loader.report()
    }

    /// Whether scenes, panoramas or pipelines are still being loaded, and nothing that a user would miss.
    pub fn is_only_loading(&self) -> bool {
        self.screenshots == 0 && (self.scene.is_none() || !self.loading.is_empty())
    }

    /// Changes whenever the picture may look different although no camera has moved.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Has the picture drawn again: something else has changed how it looks.
    #[cfg(feature = "hot-reload")]
    pub fn redraw(&mut self) {
        self.revision += 1;
    }

    /// Starts loading a scene, whatever its file extension.
    pub fn open_scene(&mut self, path: &Path) {
        let staging = self.stagings.of(path, self.scene.as_ref());
        self.load_scene(path, staging);
    }

    /// Starts loading a scene that goes on as it was shown, under the panorama that was asked for last.
    fn open_again(&mut self, path: &Path, panorama: Option<PathBuf>) {
        let staging = self.stagings.of(path, self.scene.as_ref());
        self.load_scene(path, Staging { panorama: panorama.or(staging.panorama), ..staging });
        self.again = Some(self.scenes);
    }

    fn load_scene(&mut self, path: &Path, staging: Staging) {
        self.playlist.set_scene(path);
        staging.panorama.iter().for_each(|panorama| self.playlist.set_panorama(panorama));
        self.loading.begin_scene(path);
        let (path, target, settings) = (path.to_owned(), self.target.clone(), self.settings.clone());
        self.scenes += 1;
        self.loader.start(LoadRequest::Scene { number: self.scenes, path, staging, settings, target });
    }

    /// Ends, and returns what another app can go on with.
    pub fn keep(mut self) -> Kept {
        let shown = self.scene.as_ref();
        Kept {
            scene: shown.map(|scene| scene.loaded.path.as_path()).or(self.stagings.first()).map(Path::to_owned),
            changes: shown.map(ShownScene::changes).or(self.changes.take()),
            playlist: self.playlist,
            stagings: self.stagings,
            settings: self.settings,
            first_settings: self.first_settings,
        }
    }

    /// Goes on with what an app before this one has shown.
    pub fn restore(&mut self, kept: Kept) {
        let Kept { playlist, stagings, scene, changes, settings, first_settings } = kept;
        (self.playlist, self.stagings) = (playlist, stagings);
        (self.settings, self.first_settings) = (settings, first_settings);
        if let Some(scene) = scene {
            self.open_again(&scene, changes.as_ref().and_then(|changes| changes.panorama.clone()));
        }
        self.changes = changes;
    }

    /// Starts loading the scene of the command line, which keeps its stage whenever it is loaded again.
    pub fn open_first(&mut self, path: &Path, staging: Staging) {
        self.stagings.set_first(path, staging);
        self.open_scene(path);
    }

    /// Starts loading a scene or a panorama, by its extension; of a folder its scene.
    ///
    /// # Errors
    /// [`Error::Usage`] for other files.
    pub fn open(&mut self, path: &Path) -> Result<()> {
        let within = if path.is_dir() { scene_in(path) } else { None };
        let path = within.as_deref().unwrap_or(path);
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "hdr" | "exr" => {
                self.playlist.set_panorama(path);
                self.load_panorama(path);
            }
            _ if is_scene(path) => self.open_scene(path),
            _ => {
                let remedy = "drop a scene (.toml, .gltf, .glb, .obj), its folder or a panorama (.hdr, .exr)";
                return Err(Error::Usage(format!("{} cannot be shown; {remedy}", file_name(path))));
            }
        }
        Ok(())
    }

    fn load_panorama(&mut self, path: &Path) {
        self.scene.iter_mut().for_each(|scene| scene.last_panorama = Some(path.to_owned()));
        self.loading.begin_panorama(path);
        self.loader.start(LoadRequest::Panorama { path: path.to_owned(), settings: self.settings.clone() });
    }

    /// A panorama cannot be shown: the one that is shown is the last again.
    fn forget_panorama(&mut self, path: &Path) {
        if let Some(scene) = self.scene.as_mut().filter(|scene| scene.last_panorama.as_deref() == Some(path)) {
            scene.last_panorama = scene.panorama.clone();
        }
    }

    /// A file cannot be loaded: what waited for it is asked for now, but not the same file once more. A lost GPU is passed on.
    fn go_on_without(&mut self, path: &Path, error: Error) -> Result<Update> {
        self.forget_panorama(path);
        let Some(scene) = self.scene.as_ref().filter(|_| !error.is_device_lost()) else { return Err(error) };
        if scene.loaded.path != path && scene.panorama.as_deref() != Some(path) {
            self.follow_settings()?;
        }
        Ok(Update::Failed(error))
    }

    /// Changes the target of the current scene and of those that are still loading.
    ///
    /// # Errors
    /// Pipelines or images for another number of eyes cannot be made; then nothing has changed.
    pub fn set_target(&mut self, target: Target) -> Result<()> {
        self.revision += 1;
        if let Some(scene) = &mut self.scene {
            scene.draw_for(target.eyes)?;
        }
        self.target = target;
        self.follow_settings()
    }

    /// Whether there is something to collect that the loader knows nothing of.
    pub fn has_refused(&self) -> bool {
        self.refusal.is_some()
    }

    /// Takes results of the loader, oldest first, until one has changed something.
    ///
    /// # Errors
    /// The first scene does not load, a result cannot be put on the GPU, or the GPU was lost meanwhile.
    pub fn collect(&mut self) -> Result<Option<Update>> {
        if let Some(refusal) = self.refusal.take() {
            return Ok(Some(Update::Failed(refusal)));
        }
        while let Some(result) = self.loader.take()? {
            if let Some(update) = self.apply(result)? {
                return Ok(Some(update));
            }
        }
        Ok(None)
    }

    fn apply(&mut self, result: LoadResult) -> Result<Option<Update>> {
        self.revision += 1;
        Ok(match result {
            LoadResult::Scene(scene) => {
                let path = self.loading.end().unwrap_or_default();
                Some(match scene {
                    Ok(scene) => self.show(scene)?,
                    Err(error) => self.go_on_without(&path, error)?,
                })
            }
            LoadResult::Lightmap(number, lightmap) => self.map_light(number, lightmap)?,
            LoadResult::Panorama { path, settings, lighting } => {
                self.loading.end();
                match lighting {
                    Ok(lighting) => self.light(NewLight { path, lighting: *lighting, settings })?,
                    Err(error) => Some(self.go_on_without(&path, error)?),
                }
            }
            // Another request has replaced this one.
            LoadResult::Pipelines(number, _) if number != self.pipelines => None,
            LoadResult::Pipelines(_, pipelines) => match pipelines {
                Ok(pipelines) => self.draw_with(*pipelines)?,
                Err(error) if error.is_device_lost() => return Err(error),
                Err(error) => {
                    let (light, lightmap) = (self.new_light.take(), self.new_lightmap.take());
                    light.iter().for_each(|light| self.forget_panorama(&light.path));
                    let without = self.scene.as_mut().filter(|_| lightmap.is_some());
                    without.into_iter().for_each(|scene| scene.loaded.lightmap_follows = false);
                    Some(Update::Failed(error))
                }
            },
            LoadResult::Memory(advice) => {
                self.follow_memory(advice);
                None
            }
            LoadResult::Textures(advice, textures) => self.texture(advice, textures)?,
            LoadResult::Screenshot(written) => {
                self.screenshots -= 1;
                Some(Update::Screenshot(written))
            }
        })
    }

    /// Requests other settings; until the loader has what they need, the scene is drawn as before.
    ///
    /// # Errors
    /// No memory for targets of another scale.
    pub fn set_settings(&mut self, settings: RenderSettings) -> Result<()> {
        self.revision += 1;
        self.settings = settings;
        self.follow_settings()
    }

    /// Asks the loader for whatever the shown scene needs for the current settings. Other light and another scene wait for
    /// the files that are being loaded: these may be what is shown then.
    fn follow_settings(&mut self) -> Result<()> {
        let Some(scene) = &mut self.scene else { return Ok(()) };
        self.pipelines += 1;
        let renderer = &mut scene.loaded.renderer;
        if let Some(NewLight { lighting, settings, .. }) = &self.new_light {
            let request = renderer.pipeline_request_under(lighting, settings);
            self.loader.start(LoadRequest::Pipelines(self.pipelines, request));
            return Ok(());
        }
        if let Some(lightmap) = &self.new_lightmap {
            let request = renderer.pipeline_request_lightmapped(lightmap);
            self.loader.start(LoadRequest::Pipelines(self.pipelines, request));
            return Ok(());
        }
        let least = if renderer.lacks_pipelines() { Change::Pipelines } else { Change::Nothing };
        let change = renderer.settings().difference(&self.settings).max(least);
        match change {
            Change::Nothing => {}
            Change::Targets => {
                if let Err(error) = renderer.set_scale(self.settings.scale) {
                    self.refuse(error)?;
                }
            }
            Change::Pipelines => {
                let request = renderer.pipeline_request(self.settings.clone(), renderer.eyes());
                self.loader.start(LoadRequest::Pipelines(self.pipelines, request));
            }
            Change::Light | Change::Scene if !self.loading.is_empty() => {}
            Change::Light => match scene.last_panorama.clone() {
                Some(panorama) => self.load_panorama(&panorama),
                None => self.load_again(),
            },
            Change::Scene => self.load_again(),
        }
        Ok(())
    }

    /// Settings cannot be had: the scene is drawn as before. A lost GPU is passed on.
    fn refuse(&mut self, error: Error) -> Result<()> {
        if error.is_device_lost() {
            return Err(error);
        }
        self.settings = self.scene.as_ref().map_or(&self.settings, |scene| scene.loaded.renderer.settings()).clone();
        self.refusal = Some(error);
        Ok(())
    }

    fn load_again(&mut self) {
        let shown = self.scene.as_ref().map(|scene| (scene.loaded.path.clone(), scene.last_panorama.clone()));
        if let Some((path, panorama)) = shown {
            self.open_again(&path, panorama);
        }
    }

    /// Changes the shading by `steps` in the list of all; see `Shading::step`.
    ///
    /// # Errors
    /// Those of [`App::set_settings`].
    pub fn shade(&mut self, steps: usize, holds_still: bool) -> Result<()> {
        let shading = self.settings.shading.step(steps, holds_still);
        self.set_settings(RenderSettings { shading, ..self.settings.clone() })
    }

    /// Handles requests made with a controller's buttons.
    ///
    /// # Errors
    /// Those of [`App::set_settings`].
    pub fn obey(&mut self, requests: Requests) -> Result<()> {
        if requests.next_scene {
            self.perform(Action::NextScene)?;
        }
        if requests.next_panorama {
            self.perform(Action::NextPanorama)?;
        }
        if requests.next_shading { self.shade(1, false) } else { Ok(()) }
    }

    /// Performs a command that every output can give; returns those that are the output's own.
    ///
    /// # Errors
    /// Those of [`App::set_settings`] and [`App::open`].
    pub fn perform(&mut self, action: Action) -> Result<Option<Action>> {
        let playlist = &mut self.playlist;
        let file = match action {
            Action::NextScene => playlist.next_scene(),
            Action::PreviousScene => playlist.previous_scene(),
            Action::NextPanorama => playlist.next_panorama(),
            Action::PreviousPanorama => playlist.previous_panorama(),
            Action::NextShading => return self.shade(1, true).map(|()| None),
            Action::PreviousShading => {
                return self.shade(Shading::value_variants().len() - 1, true).map(|()| None);
            }
            Action::Settings(settings) => return self.set_settings(*settings).map(|()| None),
            action => {
                let Some(scene) = &mut self.scene else { return Ok(Some(action)) };
                let left = scene.perform(action);
                return if scene.take_change_of_pipelines() { self.follow_settings() } else { Ok(()) }.map(|()| left);
            }
        };
        // There may be no other.
        file.map_or(Ok(()), |file| self.open(&file)).map(|()| None)
    }

    /// Restores exposure, the panorama's rotation, models, materials, lamps and the settings of the start.
    ///
    /// # Errors
    /// Those of [`App::set_settings`].
    pub fn reset(&mut self) -> Result<()> {
        self.scene.iter_mut().for_each(ShownScene::reset);
        self.set_settings(self.first_settings.clone())
    }

    /// Starts writing a screenshot: RGBA, 8 bits a channel.
    pub fn write_screenshot(&mut self, pixels: Vec<u8>, size: [u32; 2]) {
        self.screenshots += 1;
        self.loader.start(LoadRequest::Screenshot { pixels, size });
    }

    fn show(&mut self, loaded: Box<LoadedScene>) -> Result<Update> {
        let again = self.again == Some(loaded.number);
        let mut scene = ShownScene::new(loaded);
        let changes = self.scene.as_ref().map(ShownScene::changes).or(self.changes.take());
        changes.iter().filter(|_| again).for_each(|changes| scene.apply(changes));
        // The number of eyes and the settings may have changed while the scene was loading.
        scene.draw_for(self.target.eyes)?;
        if let Some(panorama) = self.loading.last_panorama() {
            scene.last_panorama = Some(panorama.to_owned());
        }
        let old = self.scene.replace(scene);
        (self.new_light, self.new_lightmap) = (None, None);
        self.watch_memory();
        self.follow_settings()?;
        let arrival = match &old {
            _ if again => Arrival::Again,
            Some(_) => Arrival::Next,
            None => Arrival::First,
        };
        old.into_iter().for_each(|old| self.loader.start(LoadRequest::Discard(old.loaded)));
        Ok(Update::Scene(arrival))
    }
}

#[cfg(test)]
#[path = "app_gpu_tests.rs"]
pub(super) mod gpu_tests;
