//! A scene under a light: the resources of both, and the descriptor set that binds them.

use std::sync::Arc;

use super::baked_light::{BakedLight, LightState};
use super::edits::{EditPlaces, SceneEdits};
use super::frame::{FRAME_BYTES, FrameInputs, SceneConstants, sun_block};
use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::lightmapped::Lightmapped;
use super::pipeline_request::PipelineRequest;
use super::scene_resources::SceneResources;
use super::settings::RenderSettings;
use super::shadow_maps::{Placement, ShadowMaps};
use super::shared::{COUNTED_LIGHTS_BYTES, FrameBlock, PROBES_BYTES};
use super::surface_pass::SurfacePass;
use crate::Result;
use crate::asset::Report;
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, Commands, Compare, DescriptorSet, Format, FrameContext, FrameRing, Gpu, Image, ImageDesc,
    ImageUsageFlags, PassTimes, Sampler, Shape, upload_rows,
};

/// What a piece of a bake may take where no frame waits for it, milliseconds.
pub const BAKE_MS: f64 = 50.0;
/// Steps of a progress bar.
const PROGRESS: u64 = 1000;

/// A scene and its light, with a descriptor set that is created again when the light changes.
pub struct BoundScene {
    pub resources: SceneResources,
    pub lighting: Lighting,
    /// Light that surfaces give back, where it is modelled.
    pub baked: Option<BakedLight>,
    pub shadows: ShadowMaps,
    edits: SceneEdits,
    /// Where the buffers do not have the edits yet.
    unwritten: EditPlaces,
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
        baked: Option<BakedLight>,
    ) -> Result<Self> {
        let shadows = ShadowMaps::new(gpu, &resources, lighting.sun.is_some())?;
        let set = scene_set(gpu, layouts, (&resources, &shadows), &lighting, baked.as_ref())?;
        let (edits, unwritten) = Default::default();
        Ok(Self { resources, lighting, baked, shadows, edits, unwritten, set })
    }

    /// Changes of the scene as its file has it.
    pub fn edits(&self) -> &SceneEdits {
        &self.edits
    }

    /// Shows the scene with these changes from the next frame on; returns whether that takes other pipelines to be right.
    pub fn set_edits(&mut self, edits: SceneEdits) -> bool {
        let before = self.resources.variants_for(&self.edits);
        self.unwritten.extend(self.edits.places(&edits));
        self.edits = edits;
        self.resources.variants_for(&self.edits) != before
    }

    /// Brings the buffers up to date with the edits.
    pub fn write_edits(&mut self, commands: &mut Commands<'_>) {
        self.resources.write(commands, &self.edits, &std::mem::take(&mut self.unwritten));
    }

    /// Puts the scene under another light.
    pub fn set_lighting(&mut self, gpu: &Arc<Gpu>, layouts: &Layouts, lighting: Lighting) -> Result<()> {
        let shadows = ShadowMaps::new(gpu, &self.resources, lighting.sun.is_some())?;
        self.set = scene_set(gpu, layouts, (&self.resources, &shadows), &lighting, self.baked.as_ref())?;
        if let Some(baked) = &mut self.baked {
            baked.set_panorama(&lighting)?;
        }
        (self.lighting, self.shadows) = (lighting, shadows);
        Ok(())
    }

    /// Draws the scene with a lightmap from now on.
    pub fn set_lightmapped(&mut self, gpu: &Arc<Gpu>, layouts: &Layouts, lightmapped: Lightmapped) -> Result<()> {
        let Lightmapped { mut resources, mut baked } = lightmapped;
        // They may have got other levels meanwhile.
        resources.replace_textures(self.resources.textures.clone());
        baked.set_panorama(&self.lighting)?;
        self.set = scene_set(gpu, layouts, (&resources, &self.shadows), &self.lighting, Some(&baked))?;
        (self.resources, self.baked) = (resources, Some(baked));
        // They are as the file has them.
        self.unwritten = self.edits.places(&self.edits);
        Ok(())
    }

    /// What soft light depends on in a frame.
    fn light_state(&self, inputs: &FrameInputs<'_>) -> LightState {
        LightState {
            panorama: self.lighting.digest,
            rotation: inputs.environment_rotation,
            world_from_models: inputs.world_from_models,
            edits: self.edits.digest(),
        }
    }

    /// Follows what light depends on in a frame; returns whether there is a piece of it to compute.
    ///
    /// # Errors
    /// A lost GPU.
    pub fn follow_light(&mut self, inputs: &FrameInputs<'_>, report: &Report) -> Result<bool> {
        let state = self.light_state(inputs);
        self.baked.as_mut().map_or(Ok(false), |baked| baked.follow(state, report))
    }

    /// Records the next piece of light, of about `target_ms`.
    pub fn record_light(&mut self, frame: &mut FrameContext<'_>, block: &FrameBlock, target_ms: f64) -> Result<()> {
        let Some(baked) = &mut self.baked else { return Ok(()) };
        let set = FrameSet { set: frame.set, block: frame.push(block)? };
        baked.pace(&frame.finished, target_ms);
        baked.record(&mut frame.commands, set, &self.set);
        Ok(())
    }

    /// Computes light to its end, and keeps it in the cache; returns the GPU time that it took, milliseconds, 0 where there
    /// is nothing to do.
    pub fn finish_light(&mut self, context: &Context, inputs: &FrameInputs<'_>) -> Result<f64> {
        let state = self.light_state(inputs);
        if !self.baked.as_mut().map_or(Ok(false), |baked| baked.demand(state))? {
            return Ok(0.0);
        }
        let mut gpu_ms = 0.0;
        let mut ring = FrameRing::new(&context.gpu, FRAME_BYTES)?;
        let (block, progress) = (inputs.block(self.constants()), context.report.progress("light", PROGRESS));
        while let Some(part) = self.light_progress() {
            let mut frame = ring.begin()?;
            gpu_ms += frame.finished.total_ms();
            self.write_edits(&mut frame.commands);
            self.record_light(&mut frame, &block, BAKE_MS)?;
            progress.set_position((part * PROGRESS as f32) as u64);
            frame.submit(None)?;
        }
        gpu_ms += ring.finish_all()?.iter().map(PassTimes::total_ms).sum::<f64>();
        progress.finish_and_clear();
        self.keep_light(context)?;
        Ok(gpu_ms)
    }

    /// The part of light that is computed, while it is; 0 to 1.
    pub fn light_progress(&self) -> Option<f32> {
        self.baked.as_ref().filter(|baked| !baked.is_done()).map(BakedLight::progress)
    }

    /// Records the drawing of shadow maps that do not show the scene as it is, if a pass draws any.
    pub fn update_shadows(
        &mut self,
        commands: &mut Commands<'_>,
        pass: Option<&SurfacePass>,
        inputs: &FrameInputs<'_>,
    ) {
        let sun = self.lighting.sun.map(|sun| sun_block(&sun, inputs.environment_rotation));
        let place =
            Placement { world_from_models: inputs.world_from_models, towards_sun: sun.map(|sun| sun.towards.into()) };
        self.shadows.update(commands, pass, (&self.resources, &self.set), place);
    }

    /// Stores lightmap and probes in the cache, if they are done and not there yet.
    pub fn keep_light(&mut self, context: &Context) -> Result<()> {
        self.baked.as_mut().map_or(Ok(()), |baked| baked.keep(context))
    }

    /// The scene's part of each [`FrameBlock`](super::shared::FrameBlock).
    pub fn constants(&self) -> SceneConstants {
        let Lighting { maps, sun, .. } = &self.lighting;
        SceneConstants {
            environment_scale: maps.scale,
            light_count: self.resources.light_count,
            sphere_lights: self.resources.sphere_lights,
            sun: *sun,
            sun_shadow: self.shadows.sun_block(sun.as_ref()),
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
            variants: self.resources.variants_for(&self.edits),
            constant_lights: self.resources.constant_lights,
            sphere_lights: self.resources.sphere_light_count,
            lightmap_layers: self.baked.as_ref().map_or(0, BakedLight::layers),
            drawn: self.resources.drawn_kinds(),
            ray_scene: Arc::clone(&self.resources.ray_scene),
            sky_relays: false,
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
    baked: Option<&BakedLight>,
) -> Result<DescriptorSet> {
    let lightmap = baked.map_or_else(|| no_lightmap(gpu), |baked| Ok(Arc::clone(baked.lightmap())))?;
    let probes = baked.and_then(BakedLight::probes);
    // Shaders without probes read none of these.
    let blocks = probes.map_or(&resources.lights, |probes| &probes.blocks);
    let [even, odd] = probes.map_or([&lightmap; 2], |probes| probes.specular.each_ref());
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
        Binding::Sampled(&shadows.lamps.depth, &compared),
        Binding::Sampled(&shadows.lamps.depth, &nearest),
        Binding::Sampled(&shadows.sun.depth, &compared),
        Binding::Sampled(&shadows.sun.depth, &nearest),
        Binding::Uniform(blocks, PROBES_BYTES),
        Binding::Sampled(even, &clamped),
        Binding::Sampled(odd, &clamped),
        Binding::Storage(&resources.geometry.extras),
        Binding::Uniform(&resources.lights, COUNTED_LIGHTS_BYTES),
        Binding::Sampled(&shadows.lamps.transmission, &clamped),
        Binding::Sampled(&shadows.sun.transmission, &clamped),
    ];
    DescriptorSet::new(gpu, "scene", &layouts.scene, &bindings)
}
