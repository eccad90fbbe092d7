//! What a scene's baked light consists of, which takes rays to find out: layers of the lightmap, and probes. Kept in the cache,
//! so that a start whose light is there traces none.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::layouts::Layouts;
use super::ray_scene::LazyRayScene;
use super::settings::RenderSettings;
use crate::Result;
use crate::asset::Cache;
use crate::asset::cache::Key;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::gpu::Gpu;
use crate::scene::lightmap_texels::LightmapTexels;
use crate::scene::needs::mirrors::ProbePlan;
use crate::scene::{Bounds, Probe, Scene};

/// Raise it whenever rays find other sides or other places.
const VERSION: u32 = 8;
/// Limit of an entry, in bytes.
const ENTRY_BYTES: u64 = 1 << 20;

/// The images of a scene's baked light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPlan {
    /// Of the lightmap: 1 for fronts, 2 where backs are read, too.
    pub layers: u32,
    pub probes: Vec<Probe>,
    /// Whether almost no light reaches what the cameras see.
    pub dark: bool,
}

/// What [`LightPlan::dark`] is told by.
pub const DARK_SCENE: &str = "less than a sixtieth of the panorama's light comes to most of what is seen: it is nearly closed, and no lamp is in it; \
                        add lamps to the scene file (`[[light]]`), raise `--exposure`, or draw with `--light open`";

/// A probe in the cache.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ProbeWords {
    position: [f32; 3],
    /// Least and largest corner, as of the next.
    bounds: [[f32; 3]; 2],
    /// [`Bounds::EMPTY`] for none.
    thing: [[f32; 3]; 2],
}

impl LightPlan {
    /// Finds out by rays; also returns the texels of the lightmap of this side.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn by_rays(
        (gpu, layouts): (&Arc<Gpu>, &Layouts),
        scene: &Scene,
        ray_scene: &LazyRayScene,
        side: u32,
        settings: &RenderSettings,
    ) -> Result<(Self, LightmapTexels)> {
        let rays = ray_scene.get(gpu, layouts)?;
        let texels = ray_scene.lightmap_texels(&rays, side);
        let probes = if settings.light_detail.probe_size == 0 {
            Vec::new()
        } else {
            let ProbePlan { probes, why } = ProbePlan::new(scene, settings.model, &rays.bvh);
            tracing::debug!("reflection probes: {why}: {probes:?}");
            probes
        };
        let dark = ray_scene.is_dark(&rays);
        Ok((Self { layers: if texels.has_backs() { 2 } else { 1 }, probes, dark }, texels))
    }

    /// The name in the cache of the plan of light that is made by this with these settings.
    pub fn key(made_by: &blake3::Hash, scene: &Scene, settings: &RenderSettings) -> String {
        let mut key = Key::new("plan of light", VERSION);
        key.add(made_by.as_bytes());
        key.add(format!("{:?} {:?}", settings.model, scene.probes).as_bytes());
        key.text()
    }

    /// A plan that was kept.
    pub fn load(cache: &Cache, key: &str) -> Option<Self> {
        let entry = cache.load(key, ENTRY_BYTES, |entry| entry.format == TexelFormat::Rgba8)?;
        // Bytes need not be aligned as words are.
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(entry.levels.first()?);
        let ([layers, dark], probes) = words.split_first_chunk()?;
        if !([1, 2].contains(layers) && [0, 1].contains(dark)) {
            return None;
        }
        let probes: &[ProbeWords] = bytemuck::try_cast_slice(probes).ok()?;
        let probe = |words: &ProbeWords| {
            let corners = |[min, max]: [[f32; 3]; 2]| Bounds { min: min.into(), max: max.into() };
            let [bounds, thing] = [words.bounds, words.thing].map(corners);
            Probe { position: words.position.into(), bounds, thing: (thing != Bounds::EMPTY).then_some(thing) }
        };
        Some(Self { layers: *layers, probes: probes.iter().map(probe).collect(), dark: *dark == 1 })
    }

    /// Keeps it; a failure is logged.
    pub fn keep(&self, cache: &Cache, key: &str) {
        let corners = |bounds: Bounds| [bounds.min.into(), bounds.max.into()];
        let words = |probe: &Probe| ProbeWords {
            position: probe.position.into(),
            bounds: corners(probe.bounds),
            thing: corners(probe.thing.unwrap_or(Bounds::EMPTY)),
        };
        let probes: Vec<ProbeWords> = self.probes.iter().map(words).collect();
        let head = [self.layers, self.dark.into()];
        let level = [bytemuck::bytes_of(&head), bytemuck::cast_slice(&probes)].concat();
        let size = [(level.len() / size_of::<u32>()) as u32, 1];
        let entry =
            Ktx2 { format: TexelFormat::Rgba8, size, layers: 0, faces: 1, levels: vec![level], key_values: [].into() };
        cache.keep(key, entry);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn a_plan_comes_back_from_the_cache_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().into());
        let probe = |x: f32| Probe {
            position: Vec3::new(x, 0.1, -2.0),
            bounds: Bounds { min: Vec3::splat(-1e30), max: Vec3::new(3.0, x, 0.0) },
            thing: (x > 1.0).then_some(Bounds { min: Vec3::ZERO, max: Vec3::splat(x) }),
        };
        for (layers, probes) in [(1, vec![]), (2, vec![probe(0.5)]), (2, (0..8).map(|i| probe(i as f32)).collect())] {
            let plan = LightPlan { layers, probes, dark: layers == 2 };
            plan.keep(&cache, "plan");
            assert_eq!(LightPlan::load(&cache, "plan"), Some(plan));
        }
        let broken = LightPlan { layers: 3, probes: vec![], dark: false };
        broken.keep(&cache, "broken");
        assert_eq!(["broken", "none"].map(|key| LightPlan::load(&cache, key)), [None, None]);
    }
}
