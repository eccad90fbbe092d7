//! A scene with lightmap coordinates, and the light on it: prepared on any thread while the scene is drawn without.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::Mat4;

use super::baked_light::{BakedLight, LightSource, LightState};
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::scene_resources::{SceneResources, SceneTextures};
use super::settings::{LightModel, RenderSettings};
use crate::asset::Report;
use crate::context::Context;
use crate::gpu::Buffer;
use crate::scene::atlas::{Flattened, NoAtlas, Work, flatten};
use crate::scene::needs::lightmap::{LightmapNeed, needs_no_lightmap};
use crate::scene::{GeometryView, Scene};
use crate::{Error, Result};

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
    /// Digest of the panorama, and what samples are drawn from.
    panorama: blake3::Hash,
    importance: Option<Arc<Buffer>>,
}

/// The least side of a lightmap that memory is tried for.
const LEAST_SIDE: u32 = 64;

/// Whether the scene has a lightmap with these settings, where an atlas can be made.
pub fn is_lightmapped(scene: &Scene, settings: &RenderSettings) -> bool {
    settings.light == LightModel::Baked && needs_no_lightmap(scene, settings.model).is_none()
}

impl LightmapRequest {
    pub(super) fn new(
        layouts: &Arc<Layouts>,
        textures: &SceneTextures,
        lighting: &Lighting,
        settings: &RenderSettings,
    ) -> Self {
        let (layouts, textures, settings) = (Arc::clone(layouts), textures.clone(), settings.clone());
        let Lighting { digest, importance, .. } = lighting;
        Self { layouts, textures, settings, panorama: *digest, importance: importance.clone() }
    }

    /// Makes the atlas, and takes light from the cache if it is there for the scene as its file has it; else prepares whatever
    /// light is computed with. The lightmap is coarser where memory is missing. `None` if the scene needs no lightmap, if there is no memory or
    /// no atlas can be made, or once `stop` is set.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn prepare(&self, context: &Context, scene: &Scene, stop: &AtomicBool) -> Result<Option<Lightmapped>> {
        or_none(self.require(context, scene, stop), &context.report)
    }

    /// The same with missing memory as an error.
    ///
    /// # Errors
    /// Memory that is missing even for the least side; a failed Vulkan call.
    pub fn require(&self, context: &Context, scene: &Scene, stop: &AtomicBool) -> Result<Option<Lightmapped>> {
        if !is_lightmapped(scene, &self.settings) {
            return Ok(None);
        }
        let need = || LightmapNeed::new(scene, self.settings.model, context.cache.as_ref());
        let LightmapNeed { side, hidden } = context.report.time("hidden surfaces", need);
        let side = self.settings.light_detail.lightmap_size.unwrap_or(side);
        as_fine_as_fits(side, &context.report, |side| self.prepare_at(context, scene, (side, &hidden), stop))
    }

    fn prepare_at(
        &self,
        context: &Context,
        scene: &Scene,
        (side, hidden): (u32, &[Vec<bool>]),
        stop: &AtomicBool,
    ) -> Result<Option<Lightmapped>> {
        let Some(flattened) = flattened(context, scene, (side, hidden), stop) else { return Ok(None) };
        let geometry = GeometryView { meshes: &flattened.meshes, instances: &flattened.instances };
        let textures = self.textures.clone();
        let (mut resources, clusters) =
            SceneResources::with_clusters(context, textures, scene, geometry, &self.settings)?;
        let (ray_scene, importance) = (&resources.ray_scene, self.importance.as_ref());
        let source = LightSource { scene, geometry, ray_scene, importance };
        let mut baked = BakedLight::new(context, &self.layouts, source, flattened.atlas.size[0], &self.settings)?;
        let rotation = scene.environment.rotation_degrees.to_radians();
        let world_from_models = Mat4::IDENTITY;
        let state = LightState { panorama: self.panorama, rotation, world_from_models, edits: None };
        if !baked.load(context, state)? {
            baked.prepare()?;
        }
        resources.place_probes(&context.gpu, clusters, baked.placed_probes())?;
        Ok(Some(Lightmapped { resources, baked }))
    }
}

fn flattened(
    context: &Context,
    scene: &Scene,
    (side, hidden): (u32, &[Vec<bool>]),
    stop: &AtomicBool,
) -> Option<Flattened> {
    let Context { cache, report, .. } = context;
    let work = Work { cache: cache.as_ref(), report, stop };
    match report.time("atlas", || flatten(scene.geometry(), hidden, side, work)) {
        Ok(flattened) => Some(flattened),
        Err(NoAtlas::Stopped) => None,
        Err(why) => {
            report.warn(format!("no lightmap: {why}"));
            None
        }
    }
}

/// What `make` makes of a lightmap of `side` × `side` texels, or of half as many along a side as long as memory is missing.
fn as_fine_as_fits<T>(side: u32, report: &Report, make: impl Fn(u32) -> Result<Option<T>>) -> Result<Option<T>> {
    let mut fits = side;
    loop {
        match make(fits) {
            Err(error) if is_too_large(&error) && fits / 2 >= LEAST_SIDE => fits /= 2,
            made => {
                if fits < side && matches!(made, Ok(Some(_))) {
                    report.warn(format!("GPU memory: a lightmap of {fits}x{fits} texels instead of {side}x{side}"));
                }
                return made;
            }
        }
    }
}

/// None, and a warning, where even the least lightmap does not fit.
fn or_none<T>(made: Result<Option<T>>, report: &Report) -> Result<Option<T>> {
    match made {
        Err(error) if is_too_large(&error) => {
            report.warn(format!("no lightmap: {error}"));
            Ok(None)
        }
        made => made,
    }
}

/// Whether less would fit: memory is missing, or the GPU allows no such size.
fn is_too_large(error: &Error) -> bool {
    error.is_out_of_memory() || matches!(error, Error::GpuLimit { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_memory() -> Error {
        Error::GpuMemory { what: "lightmap".into(), problem: "none left".into() }
    }

    #[test]
    fn a_lightmap_is_coarser_where_memory_is_missing_and_one_line_says_so() {
        let report = Report::silent();
        let fits = |most| move |side| if side > most { Err(no_memory()) } else { Ok(Some(side)) };
        assert_eq!(as_fine_as_fits(512, &report, fits(512)).unwrap(), Some(512));
        assert_eq!(report.warnings(), [""; 0]);
        assert_eq!(as_fine_as_fits(512, &report, fits(200)).unwrap(), Some(128));
        assert_eq!(report.warnings(), ["GPU memory: a lightmap of 128x128 texels instead of 512x512"]);
        let limit = |side: u32| {
            let [asked, most] = [side.to_string(), "300".into()];
            let refused = Error::GpuLimit { what: "lightmap".into(), asked, most, gpu: "a GPU".into() };
            if side > 300 { Err(refused) } else { Ok(Some(side)) }
        };
        assert_eq!(as_fine_as_fits(1024, &report, limit).unwrap(), Some(256));
        assert_eq!(report.warnings()[1..], ["GPU memory: a lightmap of 256x256 texels instead of 1024x1024"]);
        assert_eq!(or_none(as_fine_as_fits(512, &report, fits(10)), &report).unwrap(), None);
        assert!(
            report.warnings()[2].starts_with("no lightmap: GPU: no memory for lightmap"),
            "{:?}",
            report.warnings()
        );
    }

    #[test]
    fn other_errors_and_nothing_at_all_stay_what_they_are() {
        let report = Report::silent();
        let lost = |_| Err::<Option<()>, _>(Error::vulkan("submitting")(ash::vk::Result::ERROR_DEVICE_LOST));
        assert!(as_fine_as_fits(512, &report, lost).is_err_and(|error| error.is_device_lost()));
        assert!(as_fine_as_fits(512, &report, |_| Ok(None::<()>)).unwrap().is_none());
        assert_eq!(report.warnings(), [""; 0]);
    }
}
