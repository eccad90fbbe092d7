//! The content and format of pictures: display light or radiance.

use crate::gpu::Format;

/// The content and format of pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Output {
    /// What a viewer sees: exposed, tone-mapped, 8-bit sRGB.
    #[default]
    Display,
    /// Scene radiance as it is, 32-bit float.
    Linear,
}

impl Output {
    /// The picture's format: RGBA.
    pub fn format(self) -> Format {
        match self {
            Self::Display => Format::R8G8B8A8_SRGB,
            Self::Linear => Format::R32G32B32A32_SFLOAT,
        }
    }

    /// Bytes per pixel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Display => 4,
            Self::Linear => 16,
        }
    }
}
