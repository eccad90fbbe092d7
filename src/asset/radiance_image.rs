//! What decoders of HDR files give, before it is a panorama or a picture.

use std::path::Path;

use crate::Result;

/// Linear RGB radiance: rows from the top, `width * height` texels of any value.
pub struct RadianceImage {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<[f32; 3]>,
}

/// Whether a picture of this width and height is accepted; called before memory is allocated for it.
///
/// # Errors
/// The size is zero or too large; the path names the file in the error.
pub type SizeCheck = fn(&Path, u64, u64) -> Result<()>;
