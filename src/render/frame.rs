//! Inputs of a frame, and the uniform block that shaders read.

use glam::{DVec2, Mat4};

use super::draws::CullOptions;
use super::eye::Eye;
use super::gizmos::{ControllerGizmos, GizmoVertex, MAX_GIZMO_VERTICES};
use super::shared::{EyeBlock, FrameBlock, SphereLightBlock, SunBlock, SunShadowBlock};
use crate::reference::cube::rotate_y;
use crate::reference::sun::Sun;
use crate::scene::Scene;
use crate::scene::sphere_lights::MAX_SPHERE_LIGHTS;

/// Bytes per frame of a `gpu::FrameRing` for rendering: uniform blocks and gizmos, with room for alignment.
pub const FRAME_BYTES: u64 = (MAX_GIZMO_VERTICES * size_of::<GizmoVertex>() + 4096) as u64;

/// Inputs that may change every frame.
#[derive(Clone, Copy)]
pub struct FrameInputs<'a> {
    /// One per eye of the renderer.
    pub eyes: &'a [Eye],
    /// Stops of exposure; the picture's radiance is multiplied by 2^ev.
    pub exposure_ev: f32,
    /// The panorama's rotation about +Y, radians.
    pub environment_rotation: f32,
    /// Darkens scene and sky: 0 not at all, 1 to black.
    pub fade: f32,
    /// Moves all models of the scene together, rigidly.
    pub world_from_models: Mat4,
    /// Optimisations of the frame.
    pub culling: CullOptions,
    /// Shown in the scene; only with more than one eye.
    pub gizmos: Option<&'a ControllerGizmos>,
}

impl<'a> FrameInputs<'a> {
    /// The inputs that the scene's file describes.
    pub fn of(scene: &Scene, eyes: &'a [Eye]) -> Self {
        Self {
            eyes,
            exposure_ev: scene.exposure_ev,
            environment_rotation: scene.environment.rotation_degrees.to_radians(),
            fade: 0.0,
            world_from_models: Mat4::IDENTITY,
            culling: CullOptions::default(),
            gizmos: None,
        }
    }

    /// The uniform block, with the scene's constants added.
    pub(super) fn block(&self, scene: SceneConstants) -> FrameBlock {
        let mut block = FrameBlock {
            environment_rotation: [self.environment_rotation.cos(), self.environment_rotation.sin()],
            exposure: self.exposure_ev.exp2() * (1.0 - self.fade.clamp(0.0, 1.0)),
            environment_scale: scene.environment_scale,
            light_count: scene.light_count,
            world_from_models: self.world_from_models.to_cols_array_2d(),
            sun: scene.sun.map_or_else(SunBlock::default, |sun| sun_block(&sun, self.environment_rotation)),
            sun_shadow: scene.sun_shadow,
            sphere_lights: scene.sphere_lights,
            ..FrameBlock::default()
        };
        for (block, eye) in block.eyes.iter_mut().zip(self.eyes) {
            *block = EyeBlock {
                clip_from_world: eye.clip_from_world().to_cols_array_2d(),
                world_from_view: eye.world_from_view.to_cols_array_2d(),
                tangents: [eye.left, eye.right, eye.down, eye.up],
            };
        }
        block
    }
}

/// The scene's part of a [`FrameBlock`].
#[derive(Clone, Copy, Debug)]
pub struct SceneConstants {
    pub environment_scale: f32,
    pub light_count: u32,
    /// In the panorama's frame.
    pub sun: Option<Sun>,
    /// All 0 without a shadow map of it.
    pub sun_shadow: SunShadowBlock,
    pub sphere_lights: [SphereLightBlock; MAX_SPHERE_LIGHTS],
}

/// A sun in world space, for a panorama turned by so many radians.
pub(super) fn sun_block(sun: &Sun, rotation: f32) -> SunBlock {
    let (sine, cosine) = f64::from(rotation).sin_cos();
    SunBlock {
        towards: rotate_y(sun.direction, DVec2::new(cosine, sine)).as_vec3().to_array(),
        irradiance: sun.irradiance.as_vec3().to_array(),
        sine: sun.angular_radius.sin() as f32,
    }
}
