//! The KTX2 files that `bake` writes: radiance without a scale, and what is said of a file.

use std::fmt;
use std::path::PathBuf;

use half::f16;
use serde::Serialize;

use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::precompute::LightMaps;
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

/// A texture of radiance from one of radiance / `scale`: half floats, bit for bit, if the scale is 1, else full floats, because
/// halves might overflow.
pub fn radiance(texture: Ktx2, scale: f32) -> Ktx2 {
    if scale > 1.0 && texture.format == TexelFormat::Rgba16Float { widen(texture, scale) } else { texture }
}

/// Roughness of specular levels, from level 0 on.
pub fn roughness_text() -> String {
    LightMaps::specular_roughness().map(|r| format!("{r:.6}")).join(" ")
}

/// Halves to floats with RGB times `scale`; exact, as scale is a power of two.
fn widen(mut texture: Ktx2, scale: f32) -> Ktx2 {
    let number = |(i, bytes): (usize, &[u8])| {
        let half = f32::from(f16::from_le_bytes([bytes[0], bytes[1]]));
        // Rounding to halves may have rounded the largest float up.
        let value = if i % 4 < 3 { (half * scale).min(f32::MAX) } else { half };
        value.to_le_bytes()
    };
    for level in &mut texture.levels {
        *level = level.chunks_exact(2).enumerate().flat_map(number).collect();
    }
    texture.format = TexelFormat::Rgba32Float;
    texture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widening_multiplies_colour_and_keeps_alpha() {
        let halves = [1.5, 65504.0, 0.0, 1.0].map(|v| f16::from_f32(v).to_le_bytes()).concat();
        let format = TexelFormat::Rgba16Float;
        let texture = Ktx2 { format, size: [1, 1], layers: 0, faces: 1, levels: vec![halves], key_values: [].into() };
        let wide = widen(texture.clone(), 4.0);
        assert_eq!(wide.format, TexelFormat::Rgba32Float);
        assert_eq!(wide.levels[0], [6f32, 262_016.0, 0.0, 1.0].map(f32::to_le_bytes).concat());
        let widest = widen(texture, 2f32.powi(113));
        assert_eq!(widest.levels[0][4..8], f32::MAX.to_le_bytes());
    }
}
