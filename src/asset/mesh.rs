//! Triangles as model files give them: unindexed corners, before vertices are shared and tangents computed.

use glam::{Vec2, Vec3};

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
