//! The scene that is shown, with the user's changes.

use std::path::PathBuf;

use glam::Mat4;

use super::loader::LoadedScene;
use crate::render::{ControllerGizmos, CullOptions, Eye, FrameInputs};

/// The current scene with the user's changes.
pub struct ShownScene {
    pub loaded: Box<LoadedScene>,
    /// The index of the last chosen camera.
    pub camera: usize,
    /// Stops.
    pub exposure_ev: f32,
    /// Of the panorama about +Y, radians.
    pub environment_rotation: f32,
    /// Rigid; moves all models together.
    pub world_from_models: Mat4,
    /// The file of the panorama that lights it; `None` for uniform light.
    pub panorama: Option<PathBuf>,
    /// The panorama asked for last: that one, or one that is still loading.
    pub last_panorama: Option<PathBuf>,
    /// The rotation after [`ShownScene::reset`]: 0 for a panorama other than the scene's own.
    pub first_rotation: f32,
}

impl ShownScene {
    /// A scene as it was loaded.
    pub fn new(loaded: Box<LoadedScene>) -> Self {
        let (exposure_ev, rotation) = (loaded.exposure_ev, loaded.environment_rotation);
        Self {
            camera: 0,
            exposure_ev,
            environment_rotation: rotation,
            world_from_models: Mat4::IDENTITY,
            panorama: loaded.panorama.clone(),
            last_panorama: loaded.panorama.clone(),
            first_rotation: rotation,
            loaded,
        }
    }

    /// Restores the initial exposure, panorama rotation and models.
    pub fn reset(&mut self) {
        self.exposure_ev = self.loaded.exposure_ev;
        self.environment_rotation = self.first_rotation;
        self.world_from_models = Mat4::IDENTITY;
    }

    /// The inputs of a frame of the scene; `fade` darkens it, 0 to 1.
    pub fn inputs<'a>(&self, eyes: &'a [Eye], fade: f32, gizmos: Option<&'a ControllerGizmos>) -> FrameInputs<'a> {
        FrameInputs {
            eyes,
            exposure_ev: self.exposure_ev,
            environment_rotation: self.environment_rotation,
            fade,
            world_from_models: self.world_from_models,
            culling: CullOptions::default(),
            gizmos,
        }
    }
}
