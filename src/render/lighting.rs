//! Precomputed lighting of a panorama: its sun, the light maps of the rest, and the BRDF table.

use std::sync::Arc;

use super::importance::excess_importance;
use super::settings::{LightModel, RenderSettings};
use crate::Result;
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::{Buffer, PassTime};
use crate::precompute::{BrdfTable, LightMaps};
use crate::reference::sun::{Sun, find_sun};

/// A sun, light maps and the BRDF table.
pub struct Lighting {
    /// In the panorama's frame; `None` if there is none, or if it is left in the panorama.
    pub sun: Option<Sun>,
    /// Of the panorama without that sun.
    pub maps: LightMaps,
    pub table: BrdfTable,
    /// Of the panorama.
    pub digest: blake3::Hash,
    /// What lightmaps draw samples from, where there may be one and it is worth it: see [`excess_importance`].
    pub importance: Option<Arc<Buffer>>,
}

impl Lighting {
    /// Precomputes a panorama's light, or takes it from the cache.
    ///
    /// # Errors
    /// Those of [`LightMaps::new`] and [`BrdfTable::new`].
    pub fn new(context: &Context, panorama: &Panorama, settings: &RenderSettings) -> Result<Self> {
        context.report.time("precompute", || {
            let (sun, remainder) = match settings.light {
                LightModel::Open => (None, None),
                LightModel::Direct | LightModel::Baked => without_sun(panorama).unzip(),
            };
            let maps = LightMaps::new(context, remainder.as_ref().unwrap_or(panorama), settings.precompute())?;
            let is_baked = settings.light == LightModel::Baked;
            let importance = is_baked.then(|| excess_importance(&context.gpu, &maps.panorama)).transpose()?.flatten();
            Ok(Self {
                digest: digest(panorama),
                importance,
                sun,
                maps,
                table: BrdfTable::new(context, settings.geometry, settings.split_sum)?,
            })
        })
    }

    /// GPU time of precomputation, pass by pass.
    pub fn times(&self) -> impl Iterator<Item = &PassTime> {
        self.maps.times.iter().chain(&self.table.times)
    }
}

/// A hash of a panorama's texels.
fn digest(panorama: &Panorama) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&panorama.width.to_le_bytes());
    hasher.update_rayon(bytemuck::cast_slice(&panorama.texels));
    hasher.finalize()
}

/// A panorama's sun, and the panorama without it.
fn without_sun(panorama: &Panorama) -> Option<(Sun, Panorama)> {
    let split = find_sun([panorama.width, panorama.height], &panorama.texels)?;
    let mut remainder = panorama.clone();
    for (index, texel) in split.changed {
        remainder.texels[index] = texel;
    }
    Some((split.sun, remainder))
}
