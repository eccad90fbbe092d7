//! Bytes to checked CPU data: models, materials, textures, panoramas, pictures, KTX2; limits and warnings.

pub mod file;
pub mod folders;
pub mod ktx2;
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
