//! Panorama to cube pyramid, irradiance, specular levels; BRDF table. All on the GPU.

pub mod alternatives;
mod brdf_table;
mod light_maps;

pub use brdf_table::BrdfTable;
pub use light_maps::LightMaps;
