//! Panorama to cube, specular levels and irradiance; BRDF table. On the GPU, but for lists of what to sum.

pub mod alternatives;
mod brdf_table;
mod kernel_sum;
mod light_maps;
mod node_lists;

pub use brdf_table::BrdfTable;
pub use light_maps::LightMaps;

#[cfg(test)]
mod brdf_glsl_tests;
#[cfg(test)]
mod glsl_tests;
#[cfg(test)]
pub(crate) mod harness_tests;
