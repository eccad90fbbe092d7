//! Bytes to checked CPU data: models, materials, textures, panoramas, pictures; limits and warnings.

pub mod file;
pub mod mtl;
pub mod normals;
pub mod obj;
mod openexr;
pub mod panorama;
mod radiance;
pub mod report;
pub mod texture;

pub use panorama::Panorama;
pub use report::Report;
pub use texture::Texture;
