//! A scene under a light: the resources of both, and the descriptor set that binds them.

use std::sync::Arc;

use super::frame::{FrameInputs, SceneConstants, sun_block};
use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::lightmap::LightmapBake;
use super::pipeline_request::PipelineRequest;
use super::probes::LocalProbes;
use super::scene_resources::SceneResources;
use super::settings::RenderSettings;
use super::shadow_maps::{Placement, ShadowMaps};
use super::shadow_pass::ShadowPass;
use crate::Result;
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, Commands, Compare, DescriptorSet, Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime,
    Sampler, Shape, upload_rows,
};

/// A scene and its light, with a descriptor set that is created again when the light changes.
pub struct BoundScene {
    pub resources: SceneResources,
    pub lighting: Lighting,
    /// Soft light on the scene's surfaces, where it is modelled.
    pub lightmap: Option<LightmapBake>,
    /// What smooth surfaces mirror of the rooms around them, where there are any.
    pub probes: Option<LocalProbes>,
    pub shadows: ShadowMaps,
    /// `bindings::SCENE`.
    pub set: DescriptorSet,
}

impl BoundScene {
    /// Binds a scene and its light.
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        resources: SceneResources,
        lighting: Lighting,
        (lightmap, probes): (Option<LightmapBake>, Option<LocalProbes>),
    ) -> Result<Self> {
        let shadows = ShadowMaps::new(gpu, &resources.shadow_plan, lighting.sun.is_some())?;
        let set = scene_set(gpu, layouts, (&resources, &shadows), &lighting, (lightmap.as_ref(), probes.as_ref()))?;
        Ok(Self { resources, lighting, lightmap, probes, shadows, set })
    }

    /// Puts the scene under another light.
    pub fn set_lighting(&mut self, gpu: &Arc<Gpu>, layouts: &Layouts, lighting: Lighting) -> Result<()> {
        let shadows = ShadowMaps::new(gpu, &self.resources.shadow_plan, lighting.sun.is_some())?;
        self.set = scene_set(
            gpu,
            layouts,
            (&self.resources, &shadows),
            &lighting,
            (self.lightmap.as_ref(), self.probes.as_ref()),
        )?;
        (self.lighting, self.shadows) = (lighting, shadows);
        self.lightmap.iter_mut().for_each(LightmapBake::restart);
        Ok(())
    }

    /// Whether lightmap and probes hold all light.
    pub fn is_baked(&self) -> bool {
        self.lightmap.as_ref().is_none_or(LightmapBake::is_done)
            && self.probes.as_ref().is_none_or(LocalProbes::is_done)
    }

    /// Records a piece of what probes capture, once the lightmap has all light that surfaces give back.
    pub fn update_probes(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, finished: &[PassTime], ms: f64) {
        let Self { lightmap, probes: Some(probes), lighting, set, .. } = self else { return };
        if lightmap.as_ref().is_some_and(LightmapBake::is_done) {
            probes.pace(finished, ms);
            probes.record(commands, frame, set, lighting.maps.scale);
        } else {
            probes.restart(lighting.maps.scale);
        }
    }

    /// Records the drawing of shadow maps that do not show the scene as it is, if a pass draws any.
    pub fn update_shadows(&mut self, commands: &mut Commands<'_>, pass: Option<&ShadowPass>, inputs: &FrameInputs<'_>) {
        let sun = self.lighting.sun.map(|sun| sun_block(&sun, inputs.environment_rotation));
        let place =
            Placement { world_from_models: inputs.world_from_models, towards_sun: sun.map(|sun| sun.towards.into()) };
        self.shadows.update(commands, pass, (&self.resources, &self.set), place);
    }

    /// Takes lightmap and probes from the cache, if both are there for the scene as its file has it.
    pub fn load_light(&mut self, context: &Context, rotation: f32) -> Result<()> {
        let Some(source) = self.light_source(rotation) else { return Ok(()) };
        let Some(lightmap) = &mut self.lightmap else { return Ok(()) };
        lightmap.load(context, source)?;
        if let Some(probes) = self.probes.as_mut().filter(|_| lightmap.is_done())
            && !probes.load(context, source, self.lighting.maps.scale)?
        {
            lightmap.start_over();
        }
        Ok(())
    }

    /// Stores lightmap and probes in the cache.
    pub fn keep_light(&self, context: &Context, rotation: f32) -> Result<()> {
        let Some(source) = self.light_source(rotation) else { return Ok(()) };
        self.lightmap.as_ref().map_or(Ok(()), |lightmap| lightmap.keep(context, source))?;
        self.probes.as_ref().map_or(Ok(()), |probes| probes.keep(context, source))
    }

    /// A hash of everything that soft light depends on, with the panorama turned by `rotation` radians and models where the
    /// scene has them.
    pub fn light_source(&self, rotation: f32) -> Option<blake3::Hash> {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.resources.digest?.as_bytes());
        hasher.update(self.lighting.digest?.as_bytes());
        hasher.update(&rotation.to_le_bytes());
        Some(hasher.finalize())
    }

    /// The scene's part of each [`FrameBlock`](super::shared::FrameBlock).
    pub fn constants(&self) -> SceneConstants {
        let Lighting { maps, sun, .. } = &self.lighting;
        SceneConstants {
            environment_scale: maps.scale,
            light_count: self.resources.light_count,
            sun: *sun,
            sun_shadow: self.shadows.sun_block(sun.as_ref()),
            probe_scale: self.probes.as_ref().map_or(0.0, LocalProbes::scale),
        }
    }

    /// What pipelines for this scene are built from.
    pub fn pipeline_request(
        &self,
        gpu: &Arc<Gpu>,
        layouts: &Arc<Layouts>,
        settings: RenderSettings,
        eyes: u32,
    ) -> PipelineRequest {
        PipelineRequest {
            gpu: Arc::clone(gpu),
            layouts: Arc::clone(layouts),
            variants: self.resources.variants.clone(),
            constant_lights: self.resources.constant_lights,
            lightmap_layers: self.lightmap.as_ref().map_or(0, LightmapBake::layers),
            probes: self.probes.as_ref().map_or(0, LocalProbes::count),
            ray_scene: Arc::clone(&self.resources.ray_scene),
            casts: self.resources.shadow_plan.casts,
            planned_shadows: self.resources.shadow_plan.kind,
            panorama: Arc::clone(&self.lighting.maps.panorama),
            sun: self.lighting.sun,
            settings,
            eyes,
        }
    }
}

/// One black texel, where no lightmap is read.
fn no_lightmap(gpu: &Arc<Gpu>) -> Result<Arc<Image>> {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [1, 1], usage);
    let image = Image::new(gpu, "no lightmap", ImageDesc { shape: Shape::Layers(1), ..flat })?;
    upload_rows(gpu, &image, size_of::<[u16; 4]>() as u64, |_| vec![0; size_of::<[u16; 4]>()])?;
    Ok(image)
}

fn scene_set(
    gpu: &Arc<Gpu>,
    layouts: &Layouts,
    (resources, shadows): (&SceneResources, &ShadowMaps),
    Lighting { maps, table, .. }: &Lighting,
    (lightmap, probes): (Option<&LightmapBake>, Option<&LocalProbes>),
) -> Result<DescriptorSet> {
    let lightmap = lightmap.map_or_else(|| no_lightmap(gpu), |lightmap| Ok(Arc::clone(lightmap.image())))?;
    // Shaders without probes read none of these.
    let blocks = probes.map_or(&resources.lights, |probes| &probes.blocks);
    let [even, odd, irradiance] = probes.map_or([&lightmap; 3], LocalProbes::maps);
    let panorama = Sampler::new(gpu, "panorama", AddressMode::Panorama, 1)?;
    let clamped = Sampler::new(gpu, "clamped", AddressMode::Clamp, 1)?;
    // A receiver passes where nothing nearer to the light, of greater depth, is stored.
    let compared = Sampler::compare(gpu, "shadow", AddressMode::Clamp, Compare::GreaterOrEqual)?;
    let nearest = Sampler::nearest(gpu, "depth", AddressMode::Clamp)?;
    let bindings = [
        Binding::Storage(&resources.instances),
        Binding::Storage(&resources.materials),
        Binding::Storage(&resources.lights),
        Binding::Sampled(&maps.panorama, &panorama),
        Binding::Sampled(&maps.irradiance_over_pi, &clamped),
        Binding::Sampled(&maps.specular[0], &clamped),
        Binding::Sampled(&maps.specular[1], &clamped),
        Binding::Sampled(&table.image, &clamped),
        Binding::Sampled(&lightmap, &clamped),
        Binding::Sampled(&shadows.lamps, &compared),
        Binding::Sampled(&shadows.lamps, &nearest),
        Binding::Sampled(&shadows.sun, &compared),
        Binding::Sampled(&shadows.sun, &nearest),
        Binding::Storage(blocks),
        Binding::Sampled(even, &clamped),
        Binding::Sampled(odd, &clamped),
        Binding::Sampled(irradiance, &clamped),
    ];
    DescriptorSet::new(gpu, "scene", &layouts.scene, &bindings)
}
