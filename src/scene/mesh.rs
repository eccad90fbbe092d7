//! Indexed triangles as the GPU reads them.

use glam::Vec3;

/// One vertex: 48 bytes, read by `glsl/forward.vert`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Metres, local space.
    pub position: [f32; 3],
    /// Unit length.
    pub normal: [f32; 3],
    /// Texture space, v downwards from the picture's top.
    pub uv: [f32; 2],
    /// MikkTSpace tangent (towards +u) and the sign of the bitangent (towards the picture's top, OpenGL +Y):
    /// bitangent = w · cross(normal, tangent).
    pub tangent: [f32; 4],
}

/// Triangles that share one material, counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub struct Mesh {
    pub name: String,
    pub vertices: Vec<Vertex>,
    /// Three per triangle, each below `vertices.len()`.
    pub indices: Vec<u32>,
    /// Index into the scene's materials.
    pub material: usize,
    pub bounds: Bounds,
}

/// An axis-aligned box; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: Vec3,
    pub max: Vec3,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// Its middle.
    pub fn centre(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Half its diagonal; 0 when empty.
    pub fn radius(self) -> f32 {
        ((self.max - self.min).length() * 0.5).max(0.0) * f32::from(u8::from(self.min.cmple(self.max).all()))
    }
}
