//! A scene with lightmap coordinates, and the light on it: prepared on any thread while the scene is drawn without.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::Mat4;

use super::baked_light::{BakedLight, LightSource, LightState};
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::scene_resources::{SceneResources, SceneTextures};
use super::settings::{LightModel, RenderSettings};
use crate::Result;
use crate::context::Context;
use crate::gpu::Buffer;
use crate::scene::atlas::{Flattened, NoAtlas, Work, flatten};
use crate::scene::needs::lightmap::{LightmapNeed, lightmap_need};
use crate::scene::{GeometryView, Scene};

/// What is drawn in place of the resources of a scene without a lightmap.
pub struct Lightmapped {
    pub(super) resources: SceneResources,
    pub(super) baked: BakedLight,
}

/// What a lightmap is prepared from in addition to the scene: what is shared with a renderer that draws the scene without.
#[derive(Clone)]
pub struct LightmapRequest {
    layouts: Arc<Layouts>,
    textures: SceneTextures,
    settings: RenderSettings,
    /// Digest of the panorama, the scale of its maps, and what samples are drawn from.
    panorama: blake3::Hash,
    scale: f32,
    importance: Option<Arc<Buffer>>,
}

/// Whether the scene has a lightmap with these settings, where an atlas can be made.
pub fn is_lightmapped(scene: &Scene, settings: &RenderSettings) -> bool {
    side(scene, settings).is_some()
}

/// Texels along a side of the lightmap.
fn side(scene: &Scene, settings: &RenderSettings) -> Option<u32> {
    match lightmap_need(scene, settings.model) {
        LightmapNeed::Side(side) if settings.light == LightModel::Baked => {
            Some(settings.light_detail.lightmap_size.unwrap_or(side))
        }
        _ => None,
    }
}

impl LightmapRequest {
    pub(super) fn new(
        layouts: &Arc<Layouts>,
        textures: &SceneTextures,
        lighting: &Lighting,
        settings: &RenderSettings,
    ) -> Self {
        let (layouts, textures, settings) = (Arc::clone(layouts), textures.clone(), settings.clone());
        let Lighting { digest, importance, maps, .. } = lighting;
        Self { layouts, textures, settings, panorama: *digest, scale: maps.scale, importance: importance.clone() }
    }

    /// Makes the atlas and whatever light is computed with; takes light from the cache if it is there for the scene as its file
    /// has it. `None` if the scene needs no lightmap, if no atlas can be made, or once `stop` is set.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn prepare(&self, context: &Context, scene: &Scene, stop: &AtomicBool) -> Result<Option<Lightmapped>> {
        let Some(flattened) = self.flattened(context, scene, stop) else { return Ok(None) };
        let geometry = GeometryView { meshes: &flattened.meshes, instances: &flattened.instances };
        let resources = SceneResources::new(context, self.textures.clone(), scene, geometry, &self.settings)?;
        let (ray_scene, importance) = (&*resources.ray_scene, self.importance.as_ref());
        let source = LightSource { scene, geometry, ray_scene, importance };
        let mut baked = BakedLight::new(context, &self.layouts, source, flattened.atlas.size[0], &self.settings)?;
        let rotation = scene.environment.rotation_degrees.to_radians();
        let state = LightState { panorama: self.panorama, rotation, world_from_models: Mat4::IDENTITY };
        baked.load(context, state, self.scale)?;
        Ok(Some(Lightmapped { resources, baked }))
    }

    fn flattened(&self, context: &Context, scene: &Scene, stop: &AtomicBool) -> Option<Flattened> {
        let side = side(scene, &self.settings)?;
        let Context { cache, report, .. } = context;
        let work = Work { cache: cache.as_ref(), report, stop };
        match report.time("atlas", || flatten(&scene.meshes, &scene.instances, side, work)) {
            Ok(flattened) => Some(flattened),
            Err(NoAtlas::Stopped) => None,
            Err(why) => {
                report.warn(format!("no lightmap: {why}"));
                None
            }
        }
    }
}
