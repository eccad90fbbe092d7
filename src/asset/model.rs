//! What a model file gives: meshes and where they stand, materials, cameras and lights.

use glam::{Mat4, Vec3};

use super::material::MaterialDesc;
use super::mesh::Submesh;

/// A model. Its space is right-handed, +Y up.
#[derive(Clone, Debug, Default)]
pub struct Model {
    pub submeshes: Vec<Submesh>,
    pub placements: Vec<Placement>,
    /// Only those that submeshes use.
    pub materials: Vec<MaterialDesc>,
    pub cameras: Vec<ModelCamera>,
    pub lights: Vec<ModelLight>,
}

/// A submesh with its transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Model::submeshes`].
    pub submesh: usize,
    /// Rotation, uniform scale above 0, translation.
    pub model_from_local: Mat4,
}

/// A perspective camera, which looks along its −Z, +Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelCamera {
    pub name: String,
    /// Rotation and translation.
    pub model_from_camera: Mat4,
    pub vertical_fov_degrees: f32,
}

/// A light of no size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModelLight {
    Point {
        position: Vec3,
        /// Radiant intensity per channel, W/sr.
        intensity: Vec3,
        /// Not for one that shines to all sides.
        cone: Option<Cone>,
    },
    /// So far away that it comes from one direction.
    Directional {
        /// Unit vector to it.
        towards: Vec3,
        /// Of a surface that faces it, W/m² per channel.
        irradiance: Vec3,
    },
}

/// Where a spot light shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector.
    pub along: Vec3,
    /// Radians from `along` to where light begins to fall off, and to where it ends: 0 ≤ inner < outer ≤ π / 2.
    pub inner: f32,
    pub outer: f32,
}

impl ModelLight {
    /// The light after a rotation, a uniform scale, which leaves its intensity, and a translation.
    pub fn placed(&self, transform: Mat4) -> Self {
        let turned = |v: Vec3| transform.transform_vector3(v).normalize_or(v);
        match *self {
            Self::Point { position, intensity, cone } => Self::Point {
                position: transform.transform_point3(position),
                intensity,
                cone: cone.map(|cone| Cone { along: turned(cone.along), ..cone }),
            },
            Self::Directional { towards, irradiance } => Self::Directional { towards: turned(towards), irradiance },
        }
    }
}

impl Model {
    /// Submeshes that stand where they are.
    pub fn in_place(submeshes: Vec<Submesh>, materials: Vec<MaterialDesc>) -> Self {
        let place = |submesh| Placement { submesh, model_from_local: Mat4::IDENTITY };
        let placements = (0..submeshes.len()).map(place).collect();
        Self { submeshes, placements, materials, ..Self::default() }
    }
}
