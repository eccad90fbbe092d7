//! Maps in memory, and what the program's own stage makes of a panorama.

use std::sync::Arc;

use half::f16;

use super::texels::Texel;
use crate::Result;
use crate::gpu::{Gpu, Image, PassTime, Subresource, read_image};
use crate::precompute::LightMaps;
use crate::precompute::alternatives::{Quantity, Target};
use crate::reference::levels::{LEVELS, alpha_from_level};

/// One map: its lobe, its size and, face by face and row by row, its texels.
pub struct Map {
    pub quantity: Quantity,
    pub level: u32,
    pub target: Target,
    pub texels: Vec<[f32; 3]>,
}

impl Map {
    pub fn at(&self, [x, y, face]: Texel) -> [f32; 3] {
        let size = self.target.size;
        self.texels[((face * size + y) * size + x) as usize]
    }
}

/// Reads one mip of a cube map in half floats that holds radiance / `scale`.
pub fn read_cube(gpu: &Arc<Gpu>, image: &Image, mip: u32, scale: f32) -> Result<Vec<[f32; 3]>> {
    let mut texels = Vec::new();
    for layer in 0..6 {
        let bytes = read_image(gpu, image, Subresource { mip, layer }, 8)?;
        let value = |b: &[u8]| f16::from_le_bytes([b[0], b[1]]).to_f32() * scale;
        texels.extend(bytes.chunks_exact(8).map(|t| [value(&t[..2]), value(&t[2..4]), value(&t[4..6])]));
    }
    Ok(texels)
}

/// The specular maps that the program's own stage makes, scaled to cubes of `size`; the mirror level is left out.
pub fn specular_targets(size: u32) -> Vec<(u32, Target)> {
    (1..LEVELS)
        .map(|level| {
            let target = Target { alpha: alpha_from_level(level), size: (size >> (level / 2)).max(1) };
            (level as u32, target)
        })
        .collect()
}

/// The irradiance map that the program's own stage makes.
pub const IRRADIANCE: Target = Target { alpha: 1.0, size: 32 };

/// Everything that the program's own stage makes, but for the mirror level.
pub fn own_maps(gpu: &Arc<Gpu>, light: &LightMaps) -> Result<Vec<Map>> {
    let mut maps = Vec::new();
    for (level, target) in specular_targets(light.specular[0].desc().size[0]) {
        let texels = read_cube(gpu, &light.specular[level as usize % 2], level / 2, light.scale)?;
        maps.push(Map { quantity: Quantity::Specular, level, target, texels });
    }
    let texels = read_cube(gpu, &light.irradiance_over_pi, 0, light.scale)?;
    maps.push(Map { quantity: Quantity::Irradiance, level: 0, target: IRRADIANCE, texels });
    Ok(maps)
}

/// GPU time of the program's own stage for one quantity: all passes but the other quantity's own.
pub fn own_ms(times: &[PassTime], quantity: Quantity) -> f64 {
    let other = match quantity {
        Quantity::Specular => "irradiance",
        Quantity::Irradiance => "specular levels",
    };
    times.iter().filter(|pass| pass.name != other).map(|pass| pass.ms).sum()
}
