//! Triangles as model files give them: unindexed corners, before vertices are shared and tangents computed.

use glam::{DVec3, Vec2, Vec3, Vec4};

/// Of positions: beyond this, or below its inverse, products of lengths leave the range of f32.
pub const MAX_COORDINATE: f32 = 1e9;

/// The largest coordinate over the model's extent from which f32 leaves fewer than 13 bits of it.
const FAR: f64 = 2048.0;

/// The middle of a box around all positions, if it is so far from the origin for its size that f32 would distort the model.
pub fn far_centre(low: DVec3, high: DVec3) -> Option<DVec3> {
    let extent = (high - low).max_element();
    let reach = low.abs().max(high.abs()).max_element();
    (extent > 0.0 && reach > FAR * extent).then(|| (0.5 * (low + high)).round())
}

/// Triangles of one object with one material.
#[derive(Clone, Debug)]
pub struct Submesh {
    pub name: String,
    /// Index into the model's materials; `None` is a default material.
    pub material: Option<usize>,
    pub has_uvs: bool,
    /// Three per triangle, counter-clockwise seen from outside.
    pub corners: Vec<Corner>,
    /// The smoothing group of each triangle, 0 for none; empty if all belong to one.
    pub smoothing: Vec<u32>,
    /// What some files say beyond that of each corner; empty if this one does not.
    pub extras: Vec<CornerExtra>,
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    pub position: Vec3,
    /// Unit length.
    pub normal: Vec3,
    /// v upwards, as OBJ has it.
    pub uv: Vec2,
}

/// More of a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerExtra {
    /// Second texture coordinates, v upwards.
    pub uv1: Vec2,
    /// Multiplies base color, linear, and alpha; 0 to 1.
    pub colour: Vec4,
    /// Towards +u, with the sign of the bitangent (towards the picture's top): `scene::mesh::Vertex`. Zero: not given.
    pub tangent: Vec4,
}

impl Default for CornerExtra {
    fn default() -> Self {
        Self { uv1: Vec2::ZERO, colour: Vec4::ONE, tangent: Vec4::ZERO }
    }
}
