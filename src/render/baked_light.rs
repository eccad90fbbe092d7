//! Light that surfaces give back: a scene's lightmap and probes, computed a piece with each frame and kept on disk.

use std::sync::Arc;

use glam::{Mat4, Vec3};

use super::bake_sets::BakeSets;
use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::light_detail::LightDetail;
use super::lighting::Lighting;
use super::lightmap::{self, LightmapBake};
use super::probes::{self, LocalProbes};
use super::ray_scene::{LazyRayScene, RaySet};
use super::rest::Rest;
use super::settings::RenderSettings;
use crate::Result;
use crate::context::Context;
use crate::gpu::{Buffer, Commands, DescriptorSet, Gpu, Image, PassTime};
use crate::precompute::{CONVOLUTION_SHADERS, CacheKind, keep_cached, load_cached};
use crate::scene::{GeometryView, Scene};

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
    /// Digest of the panorama.
    pub panorama: blake3::Hash,
    /// Of the panorama about +Y, radians.
    pub rotation: f32,
    pub world_from_models: Mat4,
}

/// What light is computed from.
pub struct LightSource<'a> {
    pub scene: &'a Scene,
    /// The scene's, with lightmap coordinates.
    pub geometry: GeometryView<'a>,
    pub ray_scene: &'a LazyRayScene,
    /// Of the panorama: [`Lighting::importance`].
    pub importance: Option<&'a Arc<Buffer>>,
}

/// A scene's lightmap and probes.
pub struct BakedLight {
    pub lightmap: LightmapBake,
    /// What smooth surfaces mirror of the rooms around them, where there are any.
    pub probes: Option<LocalProbes>,
    rays: RaySet,
    /// A hash of what else it depends on but for the panorama: geometry, materials with their textures, lamps, the BRDF that
    /// light is given back by, sizes and samples.
    made_by: blake3::Hash,
    /// What it is computed for; `None` before the first frame.
    computed_for: Option<LightState>,
    /// Whether the cache has it.
    kept: bool,
    rest: Rest<LightState>,
}

impl BakedLight {
    /// Prepares a lightmap of `side` × `side` texels and the probes that the scene needs
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        context: &Context,
        layouts: &Layouts,
        source: LightSource<'_>,
        side: u32,
        settings: &RenderSettings,
    ) -> Result<Self> {
        let LightSource { scene, geometry, ray_scene, importance } = source;
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
            rays: RaySet::new(gpu, layouts, Some(ray_scene), importance)?,
            made_by: made_by(scene, geometry, &format!("{brdf:?} {side} {lightmap_samples} {probe_size}")),
            computed_for: None,
            kept: false,
            rest: Rest::default(),
        })
    }

    /// Draws samples from another panorama from now on.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn set_panorama(
        &mut self,
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        source: (&LazyRayScene, &Lighting),
    ) -> Result<()> {
        let (ray_scene, lighting) = source;
        self.rays = RaySet::new(gpu, layouts, Some(ray_scene), lighting.importance.as_ref())?;
        Ok(())
    }

    /// Whether all is computed.
    pub fn is_done(&self) -> bool {
        self.lightmap.is_done() && self.probes.as_ref().is_none_or(LocalProbes::is_done)
    }

    /// Computes it again, for other light: until it is better, the old lightmap stays, and so do the old probes if maps keep
    /// their scale.
    pub fn restart(&mut self, scale: f32) {
        self.kept = false;
        self.lightmap.restart();
        self.probes.iter_mut().for_each(|probes| probes.restart(scale));
    }

    /// Follows a frame's state: once that has rested, light is computed again for it. Returns whether there is a piece to
    /// record.
    pub fn follow(&mut self, now: LightState, scale: f32) -> bool {
        let rested = self.rest.follow(now) >= REST;
        if *self.computed_for.get_or_insert(now) != now && rested {
            self.computed_for = Some(now);
            self.restart(scale);
        }
        self.computed_for == Some(now) && !self.is_done()
    }

    /// Takes a frame's state for what light is to be computed for, at once. Returns whether there is anything to compute.
    pub fn demand(&mut self, now: LightState, scale: f32) -> bool {
        if self.computed_for.replace(now).is_some_and(|before| before != now) {
            self.restart(scale);
        }
        !self.is_done()
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

    /// Takes it from the cache, if it was computed for this state; probes' maps then hold radiance / `scale`.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn load(&mut self, context: &Context, state: LightState, scale: f32) -> Result<()> {
        let source = self.source(state);
        if load_cached(context, &CACHE_KIND, &[source.as_bytes()], &self.images())?.is_some() {
            self.lightmap.finish();
            self.probes.iter_mut().for_each(|probes| probes.finish(scale));
            (self.computed_for, self.kept) = (Some(state), true);
        }
        Ok(())
    }

    /// Stores it in the cache if it is done and not there yet.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep(&mut self, context: &Context) -> Result<()> {
        if let Some(state) = self.computed_for.filter(|_| self.is_done() && !self.kept) {
            let source = self.source(state);
            keep_cached(context, &CACHE_KIND, &[source.as_bytes()], &self.images())?;
            self.kept = true;
        }
        Ok(())
    }

    fn source(&self, state: LightState) -> blake3::Hash {
        let LightState { panorama, rotation, world_from_models } = state;
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.made_by.as_bytes()).update(panorama.as_bytes()).update(&rotation.to_le_bytes());
        hasher.update(bytemuck::bytes_of(&world_from_models));
        hasher.update(self.probes.as_ref().map_or(&[][..], LocalProbes::placed));
        hasher.finalize()
    }

    /// What the cache holds, by name.
    fn images(&self) -> Vec<(&'static str, &Image)> {
        let image: &Arc<Image> = self.lightmap.image();
        let maps = self.probes.iter().flat_map(LocalProbes::named_maps);
        [("lightmap", &**image)].into_iter().chain(maps).collect()
    }
}

/// A hash of everything that light on a scene with this geometry depends on but for its panorama.
fn made_by(scene: &Scene, geometry: GeometryView<'_>, settings: &str) -> blake3::Hash {
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
