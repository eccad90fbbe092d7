//! A KTX2 file that `bake` wrote, and what is said of it.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::asset::ktx2::Ktx2;
use crate::{Error, Result};

/// One file that was written.
#[derive(Serialize)]
pub struct BakedFile {
    pub path: PathBuf,
    pub bytes: u64,
    /// Vulkan's name.
    pub format: &'static str,
    /// Texels of level 0.
    pub size: [u32; 2],
    /// Layers; 0 for a texture that is not an array.
    pub layers: u32,
    pub faces: u32,
    pub levels: usize,
}

impl fmt::Display for BakedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        let shape = if self.faces == 6 { "cube" } else { "texture" };
        let path = self.path.display();
        write!(f, "{path}: {shape} {width}x{height}, {} level(s), {}", self.levels, self.format)?;
        if self.layers > 0 { write!(f, ", {} layers", self.layers) } else { Ok(()) }
    }
}

/// Writes a texture.
///
/// # Errors
/// The file cannot be written.
pub fn write_file(path: PathBuf, texture: &Ktx2) -> Result<BakedFile> {
    texture.write(&path)?;
    let bytes = std::fs::metadata(&path).map_err(Error::read(&path))?.len();
    let Ktx2 { format, size, layers, faces, .. } = *texture;
    Ok(BakedFile { path, bytes, format: format.name(), size, layers, faces, levels: texture.levels.len() })
}
