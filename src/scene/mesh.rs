//! Indexed triangles, and axis-aligned bounds.

use std::f32::consts::{PI, TAU};

use glam::{BVec3, Mat4, Vec3};

/// One vertex: 72 bytes. `render` packs it for the GPU.
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
    /// Place in the lightmap, 0 to 1, a multiple of 1 / 65536, v downwards; 0 without one: `scene::atlas`.
    pub lightmap_uv: [f32; 2],
    /// Second texture coordinates, v downwards; 0 where none are needed.
    pub uv1: [f32; 2],
    /// Multiplies base color, linear, and alpha, in 65535ths.
    pub colour: [u16; 4],
}

/// The colour of vertices without one.
pub const WHITE: [u16; 4] = [u16::MAX; 4];

impl Default for Vertex {
    /// White, and 0 in everything else.
    fn default() -> Self {
        Self { colour: WHITE, ..bytemuck::Zeroable::zeroed() }
    }
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

impl Mesh {
    /// Whether some vertex has another colour than white.
    pub fn has_colours(&self) -> bool {
        self.vertices.iter().any(|vertex| vertex.colour != WHITE)
    }

    /// Whether some vertex has an alpha below 1.
    pub fn has_alpha(&self) -> bool {
        self.vertices.iter().any(|vertex| vertex.colour[3] != WHITE[3])
    }

    /// A ball of `rows` by `2 rows` quadrilaterals about the origin; rounding separates the two sides of its seam.
    pub fn ball(rows: u32, radius: f32) -> Self {
        let columns = 2 * rows;
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for row in 0..=rows {
            for column in 0..=columns {
                let (v, u) = (row as f32 / rows as f32, column as f32 / columns as f32);
                let ((across, y), (sin, cos)) = ((v * PI).sin_cos(), (u * TAU).sin_cos());
                let n = Vec3::new(across * cos, y, -across * sin);
                let tangent = [-sin, 0.0, -cos, 1.0];
                let (position, normal) = ((radius * n).into(), n.into());
                vertices.push(Vertex { position, normal, uv: [u, v], tangent, ..Vertex::default() });
                if row < rows && column < columns {
                    let a = row * (columns + 1) + column;
                    let (b, c, d) = (a + columns + 1, a + columns + 2, a + 1);
                    indices.extend([a, b, c, a, c, d]);
                }
            }
        }
        let bounds = Bounds { min: Vec3::splat(-radius), max: Vec3::splat(radius) };
        Self { name: "ball".into(), vertices, indices, material: 0, bounds }
    }
}

/// An axis-aligned box; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: Vec3,
    pub max: Vec3,
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// The bounds of this box after a transform; empty stays empty.
    pub fn placed(self, transform: Mat4) -> Self {
        if !self.min.cmple(self.max).all() {
            return Self::EMPTY;
        }
        let corner = |i: u32| Vec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), self.max, self.min);
        Self::of((0..8).map(|i| transform.transform_point3(corner(i))))
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both have in common; the wrong way round where that is nothing.
    pub fn common(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether all of another box is in this one.
    pub fn contains(self, other: Self) -> bool {
        other.min.cmpge(self.min).all() && other.max.cmple(self.max).all()
    }

    /// In m³, in f64 as sides may be very long; 0 when empty.
    pub fn volume(self) -> f64 {
        (self.max - self.min).max(Vec3::ZERO).as_dvec3().element_product()
    }

    /// The box with its sides moved outwards.
    pub fn grown(self, by: f32) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    /// Its centre.
    pub fn centre(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Half its diagonal; 0 when empty.
    pub fn radius(self) -> f32 {
        ((self.max - self.min).length() * 0.5).max(0.0) * f32::from(u8::from(self.min.cmple(self.max).all()))
    }
}
