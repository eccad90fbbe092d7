//! Panorama to cube pyramid, irradiance, specular levels; BRDF table. All on the GPU; results are kept on disk.

mod brdf_table;
mod cache;
mod light_maps;
mod texture;

pub use brdf_table::BrdfTable;
pub use cache::Cache;
pub use light_maps::{LightMaps, check_face_size};
pub use texture::read_texture;

/// How maps are precomputed.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Texels along a face of the largest specular level: a power of two from 16 to 1024.
    pub face_size: u32,
    /// `None` computes always, and keeps nothing.
    pub cache: Option<Cache>,
}

impl Default for Options {
    fn default() -> Self {
        Self { face_size: 256, cache: None }
    }
}
