//! Files to checked CPU data (models, materials, textures with mips, panoramas, pictures, KTX2), writing results, the
//! cache.

pub mod basis;
pub mod cache;
pub mod comparison;
mod compress;
pub mod contained;
pub mod file;
pub mod folders;
pub mod gltf;
pub mod image_source;
mod jpeg;
pub mod ktx2;
pub mod material;
pub mod mesh;
pub mod mip_chain;
pub mod mips;
pub mod model;
pub mod mtl;
pub mod mtl_material;
pub mod normals;
pub mod obj;
mod obj_text;
mod openexr;
pub mod output;
pub mod panorama;
pub mod picture;
mod polygon;
mod radiance;
mod radiance_image;
pub mod report;
pub mod shipped;
mod synthetic;
pub mod temporary;
pub mod texture;

pub use cache::Cache;
pub use mip_chain::{MipChain, Storage, TextureOptions};
pub use output::Outputs;
pub use panorama::Panorama;
pub use report::{Report, Stage};
pub use synthetic::synthetic_panorama;
pub use texture::Texture;
