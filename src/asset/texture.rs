//! Decoded material textures.

/// How a texture's eight-bit values are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// RGB is sRGB-encoded colour; alpha is linear coverage.
    Srgb,
    /// Plain numbers: occlusion in red, roughness in green, metallic in blue.
    Linear,
    /// A tangent-space unit vector, n = 2·rgb − 1, +Y up (OpenGL).
    Normal,
}

/// A picture in memory: RGBA, 8 bits a channel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// For messages and GPU debug names.
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub encoding: Encoding,
    /// `width * height * 4` bytes.
    pub pixels: Vec<u8>,
}
