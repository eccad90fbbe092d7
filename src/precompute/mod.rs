//! Precomputes light maps (specular levels, irradiance) and the BRDF table on the GPU, and caches them on disk. Methods
//! and derivations: src/precompute/README.md.

pub mod alternatives;
mod brdf_table;
mod cache;
mod cube_texels;
mod hierarchical_convolution;
mod light_maps;
mod interaction_lists;
mod table_texels;
mod texture;

pub use crate::asset::cache::Cache;
pub use brdf_table::BrdfTable;
pub use cache::{CacheKind, keep_cached, load_cached};
pub use cube_texels::CubeTexels;
pub use hierarchical_convolution::{Alpha, HierarchicalConvolution, SHADERS as CONVOLUTION_SHADERS};
pub use light_maps::{LightMaps, check_face_size, check_irradiance_size};
pub use table_texels::{TableAt, TableTexels};
pub use texture::read_texture;

#[cfg(test)]
mod brdf_gpu_tests;
#[cfg(test)]
mod disc_gpu_tests;
#[cfg(test)]
mod fresnel_gpu_tests;
#[cfg(test)]
mod energy_gpu_tests;
#[cfg(test)]
mod glsl_gpu_tests;
#[cfg(test)]
pub(crate) mod harness_tests;
#[cfg(test)]
mod refraction_gpu_tests;

/// How maps are precomputed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Texels along a face of specular levels 0 and 1: a power of two from 16 to 1024.
    pub face_size: u32,
    /// Texels along a face of the irradiance map: a power of two from 4 to 128.
    pub irradiance_size: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { face_size: 256, irradiance_size: 32 }
    }
}
