//! Bytes to checked CPU data: models, materials, textures, panoramas, pictures; limits and warnings.

pub mod panorama;
pub mod picture;
pub mod report;
pub mod texture;

pub use panorama::Panorama;
pub use picture::Picture;
pub use report::Report;
pub use texture::Texture;
