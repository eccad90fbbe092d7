//! Light maps in memory, and those that the renderer uses, read back from the GPU.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Gpu, PassTime};
use crate::precompute::alternatives::{Quantity, Target};
use crate::precompute::{CubeTexels, LightMaps};
use crate::reference::levels::{LEVELS, alpha_from_level};

/// One map: its quantity, lobe and texels.
pub struct Map {
    pub quantity: Quantity,
    pub level: u32,
    pub alpha: f64,
    pub cube: CubeTexels,
}

/// Level, lobe and size of the renderer's own specular maps for cubes of `size`; the mirror level is left out.
pub fn specular_targets(size: u32) -> Vec<(u32, Target)> {
    let target = |level| Target { alpha: alpha_from_level(level), size: (size >> (level / 2)).max(1) };
    (1..LEVELS).map(|level| (level as u32, target(level))).collect()
}

/// The renderer's own irradiance map.
pub const IRRADIANCE: Target = Target { alpha: 1.0, size: 32 };

/// All of the renderer's own maps: the specular levels, the mirror's first, and irradiance / π.
pub fn own_maps(gpu: &Arc<Gpu>, light: &LightMaps) -> Result<(Vec<CubeTexels>, CubeTexels)> {
    let level = |level: usize| CubeTexels::read(gpu, &light.specular[level % 2], (level / 2) as u32, light.scale);
    let irradiance = CubeTexels::read(gpu, &light.irradiance_over_pi, 0, light.scale)?;
    Ok(((0..LEVELS).map(level).collect::<Result<_>>()?, irradiance))
}

/// GPU time for one quantity of the renderer's own maps: all passes but those of the other quantity alone.
pub fn own_ms(times: &[PassTime], quantity: Quantity) -> f64 {
    let other = match quantity {
        Quantity::Specular => "irradiance",
        Quantity::Irradiance => "specular levels",
    };
    times.iter().filter(|pass| pass.name != other).map(|pass| pass.ms).sum()
}
