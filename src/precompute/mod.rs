//! Panorama to cube pyramid, irradiance, specular levels; BRDF table. All on the GPU.

mod brdf_table;
mod light_maps;
mod lobe;

pub use brdf_table::BrdfTable;
pub use light_maps::LightMaps;

#[cfg(test)]
mod brdf_glsl_tests;
#[cfg(test)]
mod glsl_tests;
#[cfg(test)]
pub(crate) mod harness_tests;
