//! The computation of a scene's light: lightmap, then probes. It is prepared only where light is computed, as it takes what only
//! rays need, and on any thread.

use std::sync::Arc;

use super::bake_sets::BakeSets;
use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::lightmap::{Facts, LightmapBake};
use super::probe_maps::ProbeMaps;
use super::probes::ProbeBake;
use super::ray_scene::{LazyRayScene, RaySet};
use super::shared::ray_feature;
use crate::Result;
use crate::gpu::{Buffer, Commands, Constant, DescriptorSet, Gpu, Image, PassTime};
use crate::scene::Model;
use crate::scene::lightmap_texels::LightmapTexels;

/// Part of the scene's radius: light that begins nearer to a surface makes a spot on it that few rays find.
const NEAR_LIGHT: f32 = 0.1;

/// What light is computed from, and the images that it is computed in.
#[derive(Clone)]
pub struct BakeSource {
    pub gpu: Arc<Gpu>,
    pub layouts: Arc<Layouts>,
    pub ray_scene: Arc<LazyRayScene>,
    /// Of the panorama: [`Lighting::importance`](super::lighting::Lighting::importance).
    pub importance: Option<Arc<Buffer>>,
    pub lightmap: Arc<Image>,
    pub probes: Option<Arc<ProbeMaps>>,
    /// Of shaders: the BRDF that light is given back by.
    pub brdf: [Constant; 2],
    pub model: Model,
    /// What rays may meet beside what the scene's file has: smooth metal, or 0.
    pub more_features: u32,
    /// Of a lightmap's texel.
    pub samples: u32,
}

impl BakeSource {
    /// Constants of shaders, for what rays may meet beside.
    fn constants(&self, more_features: u32) -> Vec<Constant> {
        let features = self.ray_scene.features(self.model, self.more_features | more_features);
        self.brdf.into_iter().chain([features, self.ray_scene.lamps()]).collect()
    }
}

/// A scene's light while it is computed, a piece with each frame.
pub struct LightBake {
    lightmap: LightmapBake,
    probes: Option<ProbeBake>,
    rays: RaySet,
    more_features: u32,
}

impl LightBake {
    /// Prepares the computation; the images are not touched. `listed`: the lightmap's texels, if they are known.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(source: &BakeSource, listed: Option<LightmapTexels>) -> Result<Self> {
        let BakeSource { gpu, layouts, ray_scene, lightmap, .. } = source;
        let scene = ray_scene.get(gpu, layouts)?;
        let has_relays = scene.is_light_near(ray_scene, NEAR_LIGHT);
        let constants = source.constants(if has_relays { ray_feature::RELAYS } else { 0 });
        let listed = |side| listed.unwrap_or_else(|| ray_scene.lightmap_texels(&scene, side));
        let facts = Facts { radius: scene.radius(), has_relays };
        let lightmap = LightmapBake::new(gpu, layouts, lightmap, (listed, facts), &constants)?;
        let probe_bake = |probes| ProbeBake::new(gpu, layouts, probes, lightmap.given_back(), &constants);
        let probes = source.probes.as_ref().map(probe_bake).transpose()?;
        let count = source.probes.as_ref().map_or(0, |probes| probes.placed().len());
        let lightmap = lightmap.with_samples(source.samples).with_probes(count as u32);
        Ok(Self { lightmap, probes, rays: rays(source)?, more_features: source.more_features })
    }

    /// Lets rays meet what they may meet by now.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep_up(&mut self, source: &BakeSource) -> Result<()> {
        if self.more_features != source.more_features {
            let constants = source.constants(if self.lightmap.has_relays() { ray_feature::RELAYS } else { 0 });
            self.lightmap.see_smooth_metal(&source.gpu, &source.layouts, &constants)?;
            self.more_features = source.more_features;
        }
        Ok(())
    }

    /// Draws samples from the source's panorama from now on.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn set_panorama(&mut self, source: &BakeSource) -> Result<()> {
        self.rays = rays(source)?;
        Ok(())
    }

    /// Whether all is computed.
    pub fn is_done(&self) -> bool {
        self.lightmap.is_done() && self.probes.as_ref().is_none_or(ProbeBake::is_done)
    }

    /// The part of the lightmap that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.lightmap.progress()
    }

    /// Computes it again, for other light; until it is better, the images keep what they have.
    pub fn restart(&mut self) {
        self.lightmap.restart();
        self.probes.iter_mut().for_each(ProbeBake::restart);
    }

    /// Makes the next pieces take about `target_ms`, from the times of a frame that one was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        self.lightmap.pace(times, target_ms);
        self.probes.iter_mut().for_each(|probes| probes.pace(times, target_ms));
    }

    /// Records the next piece of work: probes once the lightmap has all light that surfaces give back.
    pub fn record(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet) {
        let sets = BakeSets { frame, scene, rays: &self.rays.set };
        if !self.lightmap.is_done() {
            self.lightmap.record(commands, &sets);
        } else if let Some(probes) = &mut self.probes {
            probes.record(commands, &sets);
        }
    }
}

fn rays(source: &BakeSource) -> Result<RaySet> {
    let BakeSource { gpu, layouts, ray_scene, importance, .. } = source;
    RaySet::new(gpu, layouts, Some(ray_scene), importance.as_ref())
}
