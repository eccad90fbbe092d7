//! Bytes to checked CPU data: models, materials, textures, panoramas, pictures; limits and warnings.

pub mod file;
pub mod mtl;
pub mod normals;
pub mod obj;
mod openexr;
pub mod panorama;
pub mod picture;
mod radiance;
pub mod report;
pub mod shipped;
pub mod texture;

pub use panorama::Panorama;
pub use report::Report;
pub use texture::Texture;
