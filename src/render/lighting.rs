//! Precomputed lighting of a panorama: light maps and the BRDF table.

use super::settings::RenderSettings;
use crate::Result;
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::PassTime;
use crate::precompute::{BrdfTable, LightMaps};

/// Light maps and the BRDF table.
pub struct Lighting {
    pub maps: LightMaps,
    pub table: BrdfTable,
}

impl Lighting {
    /// Precomputes a panorama's light, or takes it from the cache.
    ///
    /// # Errors
    /// Those of [`LightMaps::new`] and [`BrdfTable::new`].
    pub fn new(context: &Context, panorama: &Panorama, settings: &RenderSettings) -> Result<Self> {
        context.report.time("precompute", || {
            Ok(Self {
                maps: LightMaps::new(context, panorama, settings.precompute())?,
                table: BrdfTable::new(context, settings.geometry, settings.split_sum)?,
            })
        })
    }

    /// GPU time of precomputation, pass by pass.
    pub fn times(&self) -> impl Iterator<Item = &PassTime> {
        self.maps.times.iter().chain(&self.table.times)
    }
}
