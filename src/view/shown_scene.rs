//! The scene that is shown, with the user's changes.

use std::f32::consts::TAU;
use std::path::PathBuf;

use glam::Mat4;

use super::action::Action;
use super::loader::LoadedScene;
use super::scene_parts::SceneParts;
use crate::Result;
use crate::render::{ControllerGizmos, CullOptions, Eye, FrameInputs, SceneEdits};
use crate::scene::Camera;

/// Radians of one step of the panorama's rotation.
const ROTATION_STEP: f32 = TAU / 72.0;

/// The current scene with the user's changes.
pub struct ShownScene {
    pub loaded: Box<LoadedScene>,
    /// The index of the last chosen camera.
    pub camera: usize,
    /// The index of the last chosen material.
    pub material: Option<usize>,
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
    /// Whether changes of materials take other pipelines than those that were asked for.
    takes_pipelines: bool,
}

/// What a person has changed of a scene; see [`ShownScene`].
#[derive(Clone, Debug)]
pub struct SceneChanges {
    camera: usize,
    material: Option<usize>,
    exposure_ev: f32,
    /// Of the panorama: now, and after a reset.
    rotation: [f32; 2],
    world_from_models: Mat4,
    /// The panorama asked for last.
    pub panorama: Option<PathBuf>,
    edits: SceneEdits,
    /// The scene's, by whose order some of this goes.
    cameras: Vec<Camera>,
    parts: SceneParts,
}

impl ShownScene {
    /// Changes the number of eyes on the calling thread, as no frame can be drawn before.
    ///
    /// # Errors
    /// No memory.
    pub fn draw_for(&mut self, eyes: u32) -> Result<()> {
        let renderer = &mut self.loaded.renderer;
        if renderer.eyes() == eyes { Ok(()) } else { renderer.rebuild(renderer.settings().clone(), eyes) }
    }

    /// A scene as it was loaded.
    pub fn new(loaded: Box<LoadedScene>) -> Self {
        let (exposure_ev, rotation) = (loaded.exposure_ev, loaded.environment_rotation);
        Self {
            camera: 0,
            material: None,
            exposure_ev,
            environment_rotation: rotation,
            world_from_models: Mat4::IDENTITY,
            panorama: loaded.panorama.clone(),
            last_panorama: loaded.panorama.clone(),
            first_rotation: rotation,
            takes_pipelines: false,
            loaded,
        }
    }

    /// What was changed of it.
    pub fn changes(&self) -> SceneChanges {
        SceneChanges {
            camera: self.camera,
            material: self.material,
            exposure_ev: self.exposure_ev,
            rotation: [self.environment_rotation, self.first_rotation],
            world_from_models: self.world_from_models,
            panorama: self.last_panorama.clone(),
            edits: self.loaded.renderer.edits().clone(),
            cameras: self.loaded.cameras.clone(),
            parts: self.loaded.parts.clone(),
        }
    }

    /// Goes on with what was changed of the same scene before it was loaded again.
    pub fn apply(&mut self, changes: &SceneChanges) {
        (self.exposure_ev, self.world_from_models) = (changes.exposure_ev, changes.world_from_models);
        if self.panorama == changes.panorama {
            [self.environment_rotation, self.first_rotation] = changes.rotation;
        }
        // The file may have changed meanwhile.
        if self.loaded.cameras == changes.cameras {
            self.camera = changes.camera;
        }
        if self.loaded.parts == changes.parts {
            self.material = changes.material;
            self.loaded.renderer.set_edits(changes.edits.clone());
        }
    }

    /// Restores the initial exposure, panorama rotation, models, materials and lamps.
    pub fn reset(&mut self) {
        self.loaded.renderer.set_edits(SceneEdits::default());
        self.exposure_ev = self.loaded.exposure_ev;
        self.environment_rotation = self.first_rotation;
        self.world_from_models = Mat4::IDENTITY;
    }

    /// Performs a command that changes how the scene is seen; returns others.
    pub fn perform(&mut self, action: Action) -> Option<Action> {
        match action {
            Action::AddExposure(thirds) => self.exposure_ev += f32::from(thirds) / 3.0,
            Action::Exposure(ev) => self.exposure_ev = ev,
            Action::Material(index) => self.material = Some(index).filter(|i| *i < self.loaded.parts.materials.len()),
            Action::AddRotation(steps) => {
                let rotation = self.environment_rotation + f32::from(steps) * ROTATION_STEP;
                self.environment_rotation = rotation.rem_euclid(TAU);
            }
            Action::Rotation(radians) => self.environment_rotation = radians.rem_euclid(TAU),
            Action::Factors(index, factors) => self.edit(|edits| edits.set_material(index, factors)),
            Action::Lamp(index, factor) => self.edit(|edits| edits.set_lamp(index, factor)),
            action => return Some(action),
        }
        None
    }

    fn edit(&mut self, edit: impl FnOnce(&mut SceneEdits)) {
        let renderer = &mut self.loaded.renderer;
        let mut edits = renderer.edits().clone();
        edit(&mut edits);
        self.takes_pipelines |= renderer.set_edits(edits);
    }

    /// Whether other pipelines have become necessary since the last call.
    pub fn take_change_of_pipelines(&mut self) -> bool {
        std::mem::take(&mut self.takes_pipelines)
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
