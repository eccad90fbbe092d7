//! What every output shows: the current scene and its state, the wanted settings, the loader and the playlist. Outputs (a
//! window, a headset, or both) draw it and pass on what the user asks for.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Mat4;

use super::loader::{LoadRequest, LoadResult, LoadedScene, Loader, Target, file_name};
use super::look::next_shading;
use super::playlist::Playlist;
use crate::gpu::Gpu;
use crate::render::{Settings, Shading};
use crate::{Error, Result};

/// The current scene, and what the user has changed of it.
pub struct ShownScene {
    pub loaded: Box<LoadedScene>,
    /// Index of the camera chosen last.
    pub camera: usize,
    /// Stops.
    pub exposure_ev: f32,
    /// Of the panorama about +Y, radians.
    pub environment_rotation: f32,
    /// Rigid; moves all models together.
    pub world_from_models: Mat4,
    /// What [`ShownScene::reset`] turns the panorama to: another panorama than the scene's own starts unturned.
    first_rotation: f32,
}

impl ShownScene {
    fn new(loaded: Box<LoadedScene>) -> Self {
        let (exposure_ev, rotation) = (loaded.exposure_ev, loaded.environment_rotation);
        Self {
            loaded,
            camera: 0,
            exposure_ev,
            environment_rotation: rotation,
            world_from_models: Mat4::IDENTITY,
            first_rotation: rotation,
        }
    }

    /// Exposure, panorama and models as they were at first.
    pub fn reset(&mut self) {
        self.exposure_ev = self.loaded.exposure_ev;
        self.environment_rotation = self.first_rotation;
        self.world_from_models = Mat4::IDENTITY;
    }

    /// Sets the renderer up for the next frame; `fade` darkens it, 0 to 1.
    pub fn prepare(&mut self, fade: f32) {
        let renderer = &mut self.loaded.renderer;
        *renderer.exposure_ev() = self.exposure_ev;
        *renderer.environment_rotation() = self.environment_rotation;
        *renderer.world_from_models() = self.world_from_models;
        renderer.set_fade(fade);
    }
}

/// What the user asks of the app with a controller's buttons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    pub next_scene: bool,
    pub next_panorama: bool,
    pub next_shading: bool,
}

/// Something that the loader has finished.
pub enum Update {
    /// Another scene is shown; whether there was one before.
    Scene { replaced: bool },
    /// The scene is lit by the panorama of this name.
    Light(String),
    /// A screenshot was written.
    Screenshot(Result<PathBuf>),
    /// A file could not be loaded; nothing has changed.
    Failed(Error),
}

/// The state that outputs share. Drop order: the loader's thread ends before the scene is freed.
pub struct App {
    loader: Loader,
    playlist: Playlist,
    /// `None` until the first scene is loaded.
    pub scene: Option<ShownScene>,
    /// What is to be drawn.
    shading: Shading,
    target: Target,
    /// Names of the files being loaded, in order.
    pub loading: VecDeque<String>,
    pub gpu: Arc<Gpu>,
}

impl App {
    /// An app without a scene. The loader calls `wake` whenever [`App::collect`] has something to collect.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn new(
        gpu: &Arc<Gpu>,
        settings: Settings,
        shading: Shading,
        target: Target,
        wake: impl Fn() + Clone + Send + 'static,
    ) -> Result<Self> {
        Ok(Self {
            loader: Loader::new(gpu, settings, wake)?,
            playlist: Playlist::new(),
            scene: None,
            shading,
            target,
            loading: VecDeque::new(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Starts loading a scene, whatever its name.
    pub fn open_scene(&mut self, path: &Path) {
        self.playlist.set_scene(path);
        self.loading.push_back(file_name(path));
        let (path, target) = (path.to_owned(), self.target.clone());
        self.loader.start(LoadRequest::Scene { path, shading: self.shading, target });
    }

    /// Starts loading a scene or a panorama, by its extension.
    ///
    /// # Errors
    /// [`Error::Usage`] for other files.
    pub fn open(&mut self, path: &Path) -> Result<()> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "hdr" | "exr" => {
                self.playlist.set_panorama(path);
                self.loading.push_back(file_name(path));
                self.loader.start(LoadRequest::Panorama { path: path.to_owned() });
            }
            "toml" | "obj" => self.open_scene(path),
            _ => {
                let remedy = "drop a scene (.toml, .obj) or a panorama (.hdr, .exr)";
                return Err(Error::Usage(format!("{} cannot be shown; {remedy}", file_name(path))));
            }
        }
        Ok(())
    }

    /// Draws for another target from now on: the current scene and those that are still loading.
    ///
    /// # Errors
    /// Whatever stops making pipelines and images for another number of eyes; then nothing has changed.
    pub fn set_target(&mut self, target: Target) -> Result<()> {
        if let Some(scene) = &mut self.scene {
            scene.loaded.renderer.set_eyes(target.eyes)?;
        }
        self.target = target;
        Ok(())
    }

    /// Takes the oldest result of the loader, if there is one.
    ///
    /// # Errors
    /// The first scene does not load; whatever stops putting a result on the GPU.
    pub fn collect(&mut self) -> Result<Option<Update>> {
        let Some(result) = self.loader.take()? else { return Ok(None) };
        Ok(Some(match result {
            LoadResult::Scene(scene) => {
                self.loading.pop_front();
                match scene {
                    Ok(scene) => self.show(scene)?,
                    Err(error) if self.scene.is_none() => return Err(error),
                    Err(error) => Update::Failed(error),
                }
            }
            LoadResult::Panorama { path, light } => {
                self.loading.pop_front();
                match (light, &mut self.scene) {
                    (Ok(light), Some(scene)) => {
                        scene.loaded.renderer.set_light(*light)?;
                        (scene.environment_rotation, scene.first_rotation) = (0.0, 0.0);
                        Update::Light(file_name(&path))
                    }
                    (Ok(_), None) => Update::Light(file_name(&path)),
                    (Err(error), _) => Update::Failed(error),
                }
            }
            LoadResult::Screenshot(written) => Update::Screenshot(written),
        }))
    }

    /// Changes the shading by `steps` in the list of all; see [`next_shading`].
    ///
    /// # Errors
    /// Whatever stops making pipelines.
    pub fn shade(&mut self, steps: usize, holds_still: bool) -> Result<()> {
        self.shading = next_shading(self.shading, steps, holds_still);
        match &mut self.scene {
            Some(scene) => scene.loaded.renderer.set_shading(self.shading),
            None => Ok(()),
        }
    }

    /// Does what a controller's buttons ask for.
    ///
    /// # Errors
    /// Those of [`App::shade`].
    pub fn obey(&mut self, requests: Requests) -> Result<()> {
        let scene = requests.next_scene.then(|| self.playlist.next_scene()).flatten();
        let panorama = requests.next_panorama.then(|| self.playlist.next_panorama()).flatten();
        // Both are of known kinds.
        scene.into_iter().chain(panorama).try_for_each(|path| self.open(&path))?;
        if requests.next_shading { self.shade(1, false) } else { Ok(()) }
    }

    /// Starts writing a screenshot: RGBA, 8 bits a channel.
    pub fn write_screenshot(&self, pixels: Vec<u8>, size: [u32; 2]) {
        self.loader.start(LoadRequest::Screenshot { pixels, size });
    }

    fn show(&mut self, mut loaded: Box<LoadedScene>) -> Result<Update> {
        // Both may have changed while the scene was loading.
        loaded.renderer.set_eyes(self.target.eyes)?;
        if loaded.renderer.shading() != self.shading {
            loaded.renderer.set_shading(self.shading)?;
        }
        let old = self.scene.replace(ShownScene::new(loaded));
        let replaced = old.is_some();
        if let Some(old) = old {
            self.loader.start(LoadRequest::Discard(old.loaded));
        }
        Ok(Update::Scene { replaced })
    }
}
