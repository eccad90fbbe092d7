//! What an atlas is, and why there is none.

use std::fmt;

use crate::scene::GeometryView;

/// Steps of lightmap coordinates from 0 to 1, which `lightmap_uv` of vertices counts in 16 bits. All sides of atlases divide half of
/// it, so that texels' borders and centres are among them.
pub const STEPS: u32 = 3 << 14;
/// Scenes of more triangles, those of a mesh counted for each instance, get no atlas.
pub const MOST_TRIANGLES: usize = 4_000_000;

/// A scene's triangles, those of a mesh counted for each instance.
pub fn triangle_count(GeometryView { meshes, instances }: GeometryView<'_>) -> usize {
    instances.iter().map(|i| meshes[i.mesh].indices.len() / 3).fold(0, usize::saturating_add)
}

/// What an atlas is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atlas {
    /// Width and height, texels; equal.
    pub size: [u32; 2],
    /// Along both axes, in world space; single charts are stretched by up to a factor of two.
    pub texels_per_metre: f32,
    pub charts: usize,
    /// Share of the picture that is surface rather than margin or gap.
    pub used: f32,
}

/// Why there is no atlas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoAtlas {
    Stopped,
    NoArea,
    TooManyTriangles(usize),
    /// Most triangles have no neighbour at a smooth angle.
    TooFragmented,
    Defect(String),
}

impl fmt::Display for NoAtlas {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped => write!(f, "stopped"),
            Self::NoArea => write!(f, "nothing in the scene has an area"),
            Self::TooManyTriangles(count) => write!(f, "{count} triangles; at most {MOST_TRIANGLES} get a lightmap"),
            Self::TooFragmented => write!(f, "its surfaces fall into too many pieces for a lightmap"),
            Self::Defect(problem) => write!(f, "{problem}; this is a defect, please report it"),
        }
    }
}

/// An atlas as it is kept: new vertices by the old ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub atlas: Atlas,
    /// Triangles without a place.
    pub unplaced: usize,
    /// One for each instance.
    pub parts: Vec<Part>,
}

/// New vertices and triangles of one instance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// The mesh's vertex that each new one is a copy of.
    pub sources: Vec<u32>,
    /// Lightmap coordinates of each new vertex, in [`STEPS`].
    pub coordinates: Vec<[u16; 2]>,
    /// The mesh's triangles, by new vertices.
    pub indices: Vec<u32>,
}
