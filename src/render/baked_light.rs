//! Light that surfaces give back: a scene's lightmap and probes, computed a piece with each frame and kept on disk.

use std::sync::Arc;
use std::thread::JoinHandle;

use glam::Mat4;

use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::light_bake::{BakeSource, LightBake};
use super::light_detail::LightDetail;
use super::light_plan::{DARK_SCENE, LightPlan};
use super::lighting::Lighting;
use super::lightmap::{self, dark_lightmap};
use super::probe_maps::ProbeMaps;
use super::probes;
use super::ray_scene::LazyRayScene;
use super::rest::Rest;
use super::settings::RenderSettings;
use super::shared::ray_feature;
use crate::asset::Report;
use crate::context::Context;
use crate::gpu::{Buffer, Commands, DescriptorSet, Image, PassTime};
use crate::precompute::{CONVOLUTION_SHADERS, CacheKind, keep_cached, load_cached};
use crate::scene::lightmap_texels::LightmapTexels;
use crate::scene::{GeometryView, Probe, Scene};
use crate::{Error, Result};

/// In the cache: raise the version when samples, seeds, or the list of texels change.
const CACHE_KIND: CacheKind = CacheKind {
    copying: "baked light from the cache",
    version: 6,
    shaders: &[&lightmap::SHADERS, &[probes::SHADER], &CONVOLUTION_SHADERS],
};

/// Frames in which nothing moves before light is computed again.
const REST: u32 = 10;

/// What light on a scene changes with while it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Digest of the panorama.
    pub panorama: blake3::Hash,
    /// Of the panorama about +Y, radians.
    pub rotation: f32,
    pub world_from_models: Mat4,
    /// A hash of the scene's changes, where there are any.
    pub edits: Option<blake3::Hash>,
}

/// What light is computed from.
#[derive(Clone, Copy)]
pub struct LightSource<'a> {
    pub scene: &'a Scene,
    /// The scene's, with lightmap coordinates.
    pub geometry: GeometryView<'a>,
    pub ray_scene: &'a Arc<LazyRayScene>,
    /// Of the panorama: [`Lighting::importance`].
    pub importance: Option<&'a Arc<Buffer>>,
}

/// A scene's lightmap and probes.
pub struct BakedLight {
    source: BakeSource,
    bake: Bake,
    /// The lightmap's texels, until a bake takes them.
    listed: Option<LightmapTexels>,
    /// Whether the probes' maps hold any light.
    probes_hold_light: bool,
    /// A hash of what else it depends on but for the panorama: geometry, materials with their textures, lamps, the BRDF that
    /// light is given back by, sizes and samples.
    made_by: blake3::Hash,
    /// What it is computed for; `None` before the first frame.
    computed_for: Option<LightState>,
    is_done: bool,
    /// Whether the last frame had another state, for which light is computed once that rests.
    is_behind: bool,
    /// Whether the images hold light that came from the cache.
    has_light: bool,
    /// Whether the cache has it.
    kept: bool,
    rest: Rest<LightState>,
}

/// What computes light.
enum Bake {
    /// Nothing has been computed: light came from the cache.
    Idle,
    /// It is prepared on a thread of its own, while frames go on with the light that is there.
    Coming(JoinHandle<Result<LightBake>>),
    There(Box<LightBake>),
    /// It cannot be prepared: light stays as it is.
    Failed,
}

impl BakedLight {
    /// Prepares a lightmap of `side` × `side` texels and the probes that the scene needs.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        context: &Context,
        layouts: &Arc<Layouts>,
        source: LightSource<'_>,
        side: u32,
        settings: &RenderSettings,
    ) -> Result<Self> {
        let LightSource { scene, geometry, ray_scene, .. } = source;
        let made_by = made_by(scene, geometry, side, settings);
        let (cache, key) = (context.cache.as_ref(), LightPlan::key(&made_by, scene, settings));
        let kept = cache.and_then(|cache| LightPlan::load(cache, &key));
        let (plan, listed) = if let Some(plan) = kept {
            (plan, None)
        } else {
            let (plan, texels) = LightPlan::by_rays((&context.gpu, layouts), scene, ray_scene, side, settings)?;
            cache.iter().for_each(|cache| plan.keep(cache, &key));
            (plan, Some(texels))
        };
        let mut made = Self::planned(context, layouts, source, (side, &plan, made_by), settings)?;
        made.listed = listed;
        Ok(made)
    }

    /// The same by this plan; `made_by`: a hash of what light depends on but for the panorama.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn planned(
        context: &Context,
        layouts: &Arc<Layouts>,
        source: LightSource<'_>,
        (side, plan, made_by): (u32, &LightPlan, blake3::Hash),
        settings: &RenderSettings,
    ) -> Result<Self> {
        let LightSource { ray_scene, importance, .. } = source;
        let (gpu, LightPlan { layers, probes, dark }) = (&context.gpu, plan);
        if *dark {
            context.report.warn(DARK_SCENE);
        }
        let has_probes = !probes.is_empty() && gpu.has_cube_arrays();
        if !probes.is_empty() && !has_probes {
            context.report.warn(format!("{}: no arrays of cubes; rooms mirror the panorama alone", gpu.info().name));
        }
        let face = settings.light_detail.probe_size;
        Ok(Self {
            source: BakeSource {
                gpu: Arc::clone(gpu),
                layouts: Arc::clone(layouts),
                ray_scene: Arc::clone(ray_scene),
                importance: importance.cloned(),
                lightmap: dark_lightmap(gpu, side, *layers)?,
                probes: has_probes.then(|| ProbeMaps::new(gpu, probes, face).map(Arc::new)).transpose()?,
                brdf: settings.brdf_constants(),
                model: settings.model,
                more_features: 0,
                samples: settings.light_detail.lightmap_samples,
            },
            bake: Bake::Idle,
            listed: None,
            probes_hold_light: false,
            made_by,
            computed_for: None,
            is_done: false,
            is_behind: false,
            has_light: false,
            kept: false,
            rest: Rest::default(),
        })
    }

    /// Draws samples from another panorama from now on.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn set_panorama(&mut self, lighting: &Lighting) -> Result<()> {
        self.source.importance = lighting.importance.clone();
        match &mut self.bake {
            Bake::There(bake) => bake.set_panorama(&self.source),
            Bake::Idle | Bake::Coming(_) | Bake::Failed => Ok(()),
        }
    }

    /// The lightmap: first an open sky's light, later that which is computed.
    pub fn lightmap(&self) -> &Arc<Image> {
        &self.source.lightmap
    }

    /// Its layers of light: fronts, and backs where some can be seen.
    pub fn layers(&self) -> u32 {
        lightmap::sides(&self.source.lightmap)
    }

    /// What smooth surfaces mirror of the rooms around them, where there are any.
    pub fn probes(&self) -> Option<&Arc<ProbeMaps>> {
        self.source.probes.as_ref()
    }

    /// Where they stand.
    pub fn placed_probes(&self) -> &[Probe] {
        self.probes().map_or(&[], |probes| probes.placed())
    }

    /// Whether their maps hold any light.
    pub fn probes_hold_light(&self) -> bool {
        self.probes_hold_light
    }

    /// Whether nothing is left to be computed, nor will be while frames stay as the last one.
    pub fn is_done(&self) -> bool {
        self.is_done && !self.is_behind || matches!(self.bake, Bake::Failed)
    }

    /// The part of the lightmap that is computed, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.bake {
            Bake::There(_) if self.is_behind => 0.0,
            Bake::There(bake) => bake.progress(),
            Bake::Idle | Bake::Coming(_) => 0.0,
            Bake::Failed => 1.0,
        }
    }

    /// Computes it again, for other light: until it is better, the old lightmap and the old probes stay.
    fn restart(&mut self) {
        (self.is_done, self.kept) = (false, false);
        if let Bake::There(bake) = &mut self.bake {
            bake.restart();
        }
    }

    /// Computes for this state from now on.
    fn compute_for(&mut self, state: LightState) {
        if self.computed_for.replace(state).is_some_and(|before| before != state) {
            self.restart();
        }
        // Changed factors may make any material smooth metal.
        self.source.more_features |= if state.edits.is_some() { ray_feature::GLOSSY } else { 0 };
    }

    /// Follows a frame's state: once that has rested, light is computed again for it. Returns whether there is a piece to
    /// record. What rays need is prepared beside frames.
    ///
    /// # Errors
    /// A lost GPU.
    pub fn follow(&mut self, now: LightState, report: &Report) -> Result<bool> {
        let rested = self.rest.follow(now) >= REST;
        if self.computed_for.is_none_or(|state| state != now && rested) {
            self.compute_for(now);
        }
        self.is_behind = self.computed_for != Some(now);
        if self.is_behind || self.is_done() {
            return Ok(false);
        }
        match self.advance() {
            Err(error) if !error.is_device_lost() => {
                report.warn(format!("light is not computed again: {error}"));
                self.bake = Bake::Failed;
                Ok(false)
            }
            ready => ready,
        }
    }

    /// Whether a piece can be recorded; what that takes is prepared by a thread, which this starts and looks after.
    fn advance(&mut self) -> Result<bool> {
        match &mut self.bake {
            Bake::There(bake) => bake.keep_up(&self.source)?,
            Bake::Coming(thread) if thread.is_finished() => self.prepare()?,
            Bake::Coming(_) | Bake::Failed => {}
            Bake::Idle => {
                let (source, listed) = (self.source.clone(), self.listed.take());
                let work = move || LightBake::new(&source, listed);
                let thread = std::thread::Builder::new().name("bakes".into()).spawn(work);
                let problem = |e| Error::Light { problem: format!("no thread can be started ({e})") };
                self.bake = Bake::Coming(thread.map_err(problem)?);
            }
        }
        Ok(matches!(self.bake, Bake::There(_)))
    }

    /// Prepares what computes light, unless it is there.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn prepare(&mut self) -> Result<()> {
        let mut bake = match std::mem::replace(&mut self.bake, Bake::Failed) {
            Bake::Idle => LightBake::new(&self.source, self.listed.take())?,
            Bake::Coming(thread) => {
                let mut bake = thread.join().map_err(|_| Error::light_panicked())??;
                // It may be another's by now.
                bake.set_panorama(&self.source)?;
                bake
            }
            Bake::There(mut bake) => {
                bake.keep_up(&self.source)?;
                self.bake = Bake::There(bake);
                return Ok(());
            }
            Bake::Failed => return Ok(()),
        };
        bake.keep_up(&self.source)?;
        if self.has_light {
            bake.restart();
        }
        self.bake = Bake::There(Box::new(bake));
        Ok(())
    }

    /// Takes a frame's state for what light is to be computed for, at once. Returns whether there is anything to compute.
    ///
    /// # Errors
    /// Those of [`BakedLight::prepare`].
    pub fn demand(&mut self, now: LightState) -> Result<bool> {
        self.compute_for(now);
        self.is_behind = false;
        if !self.is_done() {
            self.prepare()?;
        }
        Ok(!self.is_done())
    }

    /// Makes the next pieces take about `target_ms`, from the times of a frame that one was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        if let Bake::There(bake) = &mut self.bake {
            bake.pace(times, target_ms);
        }
    }

    /// Records the next piece of work, if it is prepared.
    pub fn record(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet) {
        let Bake::There(bake) = &mut self.bake else { return };
        bake.record(commands, frame, scene);
        if bake.is_done() {
            (self.is_done, self.probes_hold_light) = (true, true);
        }
    }

    /// Takes it from the cache, if it was computed for this state. Returns whether it was.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn load(&mut self, context: &Context, state: LightState) -> Result<bool> {
        let source = self.source(state);
        let is_there = load_cached(context, &CACHE_KIND, &[source.as_bytes()], &self.images())?.is_some();
        if is_there {
            (self.is_done, self.has_light, self.kept) = (true, true, true);
            (self.computed_for, self.probes_hold_light) = (Some(state), true);
        }
        Ok(is_there)
    }

    /// Stores it in the cache if it is done and not there yet.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep(&mut self, context: &Context) -> Result<()> {
        if let Some(state) = self.computed_for.filter(|_| self.is_done && !self.kept) {
            let source = self.source(state);
            keep_cached(context, &CACHE_KIND, &[source.as_bytes()], &self.images())?;
            self.kept = true;
        }
        Ok(())
    }

    fn source(&self, state: LightState) -> blake3::Hash {
        let LightState { panorama, rotation, world_from_models, edits } = state;
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.made_by.as_bytes()).update(panorama.as_bytes()).update(&rotation.to_le_bytes());
        hasher.update(bytemuck::bytes_of(&world_from_models));
        if let Some(edits) = edits {
            hasher.update(edits.as_bytes());
        }
        hasher.update(format!("{:?}", self.placed_probes()).as_bytes());
        hasher.finalize()
    }

    /// What the cache holds, by name.
    fn images(&self) -> Vec<(&'static str, &Image)> {
        let maps = self.probes().into_iter().flat_map(|probes| probes.named());
        [("lightmap", &**self.lightmap())].into_iter().chain(maps).collect()
    }
}

impl Drop for BakedLight {
    fn drop(&mut self) {
        // The GPU is not closed by that thread.
        if let Bake::Coming(thread) = std::mem::replace(&mut self.bake, Bake::Failed) {
            drop(thread.join());
        }
    }
}

/// A hash of everything that light on a scene with this geometry depends on but for its panorama.
fn made_by(scene: &Scene, geometry: GeometryView<'_>, side: u32, settings: &RenderSettings) -> blake3::Hash {
    let LightDetail { lightmap_samples, probe_size, .. } = settings.light_detail;
    let settings = format!("{:?} {side} {lightmap_samples} {probe_size}", settings.brdf_constants());
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update_rayon(bytes);
    };
    for mesh in geometry.meshes {
        add(bytemuck::cast_slice(&mesh.vertices));
        add(bytemuck::cast_slice(&mesh.indices));
        add(&mesh.material.to_le_bytes());
    }
    let cameras: Vec<[f32; 3]> = scene.cameras.iter().map(|camera| camera.position.into()).collect();
    add(bytemuck::cast_slice(&cameras));
    geometry.instances.iter().for_each(|i| add(bytemuck::bytes_of(&i.world_from_local)));
    add(format!("{:?} {:?} {settings}", scene.materials, scene.lights).as_bytes());
    scene.textures.iter().flat_map(|texture| &texture.levels).for_each(|level| add(level));
    hasher.finalize()
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
