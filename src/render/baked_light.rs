//! Light that surfaces give back: a scene's lightmap and probes, computed a piece with each frame and kept on disk.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{Mat4, Vec3};

use super::bake_sets::BakeSets;
use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::light_detail::LightDetail;
use super::lightmap::{self, LightmapBake};
use super::probes::{self, LocalProbes};
use super::ray_scene::{LazyRayScene, RaySet};
use super::settings::{LightModel, RenderSettings};
use crate::Result;
use crate::context::Context;
use crate::gpu::{Commands, DescriptorSet, Image, PassTime};
use crate::precompute::{CONVOLUTION_SHADERS, CacheKind, keep_cached, load_cached};
use crate::scene::Scene;
use crate::scene::atlas::{Flattened, Work, flatten};
use crate::scene::needs::lightmap::{LightmapNeed, lightmap_need};

/// In the cache: raise the version when samples, seeds, or the list of texels change.
const CACHE_KIND: CacheKind = CacheKind {
    copying: "baked light from the cache",
    version: 1,
    shaders: &[&lightmap::SHADERS, &[probes::SHADER], &CONVOLUTION_SHADERS],
};

/// Frames in which nothing moves before light is computed again.
const REST: u32 = 10;

/// What light on a scene changes with while it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Of the panorama about +Y, radians.
    pub rotation: f32,
    pub world_from_models: Mat4,
}

/// A scene's lightmap and probes.
pub struct BakedLight {
    pub lightmap: LightmapBake,
    /// What smooth surfaces mirror of the rooms around them, where there are any.
    pub probes: Option<LocalProbes>,
    rays: RaySet,
    /// What else it depends on: the BRDF that light is given back by, sizes and samples.
    made_by: String,
    /// What it is computed for; `None` before the first frame.
    computed_for: Option<LightState>,
    /// The last frame's state, and for how many frames it has been the same.
    last: Option<LightState>,
    still: u32,
}

/// The scene's geometry with lightmap coordinates, where its soft light is modelled and an atlas can be made.
pub fn flattened(context: &Context, scene: &Scene, settings: &RenderSettings) -> Option<Flattened> {
    if settings.light != LightModel::Baked {
        return None;
    }
    let LightmapNeed::Side(side) = lightmap_need(scene, settings.model) else { return None };
    let side = settings.light_detail.lightmap_size.unwrap_or(side);
    let Context { cache, report, .. } = context;
    let work = Work { cache: cache.as_ref(), report, stop: &AtomicBool::new(false) };
    let made = report.time("atlas", || flatten(&scene.meshes, &scene.instances, side, work));
    made.inspect_err(|why| report.warn(format!("no lightmap: {why}"))).ok()
}

impl BakedLight {
    /// Prepares a lightmap of `side` × `side` texels and the probes that the scene needs.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        context: &Context,
        layouts: &Layouts,
        (scene, ray_scene): (&Scene, &LazyRayScene),
        side: u32,
        settings: &RenderSettings,
    ) -> Result<Self> {
        let gpu = &context.gpu;
        let lamps: Vec<Vec3> = scene.lights.iter().map(|light| light.position).collect();
        let brdf = settings.brdf_constants();
        let LightDetail { lightmap_samples, probe_size, .. } = settings.light_detail;
        let lightmap = LightmapBake::new(gpu, layouts, (ray_scene, &lamps), side, &brdf)?;
        let lightmap = lightmap.with_samples(lightmap_samples);
        let bvh = &ray_scene.get(gpu, layouts)?.bvh;
        let probes = LocalProbes::planned(context, layouts, (scene, bvh), lightmap.given_back(), settings)?;
        Ok(Self {
            lightmap,
            probes,
            rays: RaySet::new(gpu, layouts, Some(ray_scene), None)?,
            made_by: format!("{brdf:?} {side} {lightmap_samples} {probe_size}"),
            computed_for: None,
            last: None,
            still: 0,
        })
    }

    /// Whether all is computed.
    pub fn is_done(&self) -> bool {
        self.lightmap.is_done() && self.probes.as_ref().is_none_or(LocalProbes::is_done)
    }

    /// Computes it again, for other light: until it is better, the old lightmap stays, and so do the old probes if maps keep
    /// their scale.
    pub fn restart(&mut self, scale: f32) {
        self.lightmap.restart();
        self.probes.iter_mut().for_each(|probes| probes.restart(scale));
    }

    /// Follows a frame's state: once that has rested, light is computed again for it. Returns whether there is a piece to
    /// record.
    pub fn follow(&mut self, now: LightState, scale: f32) -> bool {
        self.still = if self.last == Some(now) { self.still + 1 } else { 0 };
        self.last = Some(now);
        if *self.computed_for.get_or_insert(now) != now && self.still >= REST {
            self.computed_for = Some(now);
            self.restart(scale);
        }
        self.computed_for == Some(now) && !self.is_done()
    }

    /// Makes the next pieces take about `target_ms`, from the times of a frame that one was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        self.lightmap.pace(times, target_ms);
        self.probes.iter_mut().for_each(|probes| probes.pace(times, target_ms));
    }

    /// Records the next piece of work: probes once the lightmap has all light that surfaces give back. Probes' maps hold
    /// radiance / `scale`.
    pub fn record(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet, scale: f32) {
        let sets = BakeSets { frame, scene, rays: &self.rays.set };
        if !self.lightmap.is_done() {
            self.lightmap.record(commands, &sets);
        } else if let Some(probes) = &mut self.probes {
            probes.record(commands, &sets, scale);
        }
    }

    /// Takes it from the cache, where it was computed for the same `source`: everything that light depends on, but for what
    /// this holds itself.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn load(&mut self, context: &Context, source: &[&[u8]], scale: f32) -> Result<()> {
        if load_cached(context, &CACHE_KIND, &self.source(source), &self.images())?.is_some() {
            self.lightmap.finish();
            self.probes.iter_mut().for_each(|probes| probes.finish(scale));
        }
        Ok(())
    }

    /// Stores it in the cache.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep(&self, context: &Context, source: &[&[u8]]) -> Result<()> {
        keep_cached(context, &CACHE_KIND, &self.source(source), &self.images())
    }

    fn source<'a>(&'a self, source: &[&'a [u8]]) -> Vec<&'a [u8]> {
        let placed = self.probes.as_ref().map_or(&[][..], LocalProbes::placed);
        source.iter().copied().chain([self.made_by.as_bytes(), placed]).collect()
    }

    /// What the cache holds, by name.
    fn images(&self) -> Vec<(&'static str, &Image)> {
        let image: &Arc<Image> = self.lightmap.image();
        let maps = self.probes.iter().flat_map(LocalProbes::named_maps);
        [("lightmap", &**image)].into_iter().chain(maps).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::compute_shaders;

    #[test]
    fn the_shaders_that_light_is_kept_by_exist() {
        let all = compute_shaders().unwrap();
        for name in CACHE_KIND.shaders.concat() {
            assert!(all.iter().any(|(known, _)| *known == name), "{name}");
        }
    }
}
