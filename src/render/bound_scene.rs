//! A scene under a light: the resources of both, and the descriptor set that binds them.

use std::sync::Arc;

use super::frame::SceneConstants;
use super::layouts::Layouts;
use super::lighting::Lighting;
use super::pipeline_request::PipelineRequest;
use super::scene_resources::SceneResources;
use super::settings::RenderSettings;
use crate::Result;
use crate::gpu::{AddressMode, Binding, DescriptorSet, Gpu, Sampler};

/// A scene and its light, with a descriptor set that is created again when the light changes.
pub struct BoundScene {
    pub resources: SceneResources,
    pub lighting: Lighting,
    /// `bindings::SCENE`.
    pub set: DescriptorSet,
}

impl BoundScene {
    /// Binds a scene and its light.
    pub fn new(gpu: &Arc<Gpu>, layouts: &Layouts, resources: SceneResources, lighting: Lighting) -> Result<Self> {
        let set = scene_set(gpu, layouts, &resources, &lighting)?;
        Ok(Self { resources, lighting, set })
    }

    /// Puts the scene under another light.
    pub fn set_lighting(&mut self, gpu: &Arc<Gpu>, layouts: &Layouts, lighting: Lighting) -> Result<()> {
        self.set = scene_set(gpu, layouts, &self.resources, &lighting)?;
        self.lighting = lighting;
        Ok(())
    }

    /// The scene's part of each [`FrameBlock`](super::shared::FrameBlock).
    pub fn constants(&self) -> SceneConstants {
        let Lighting { maps, sun, .. } = &self.lighting;
        SceneConstants { environment_scale: maps.scale, light_count: self.resources.light_count, sun: *sun }
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
            ray_scene: Arc::clone(&self.resources.ray_scene),
            panorama: Arc::clone(&self.lighting.maps.panorama),
            sun: self.lighting.sun,
            settings,
            eyes,
        }
    }
}

fn scene_set(
    gpu: &Arc<Gpu>,
    layouts: &Layouts,
    resources: &SceneResources,
    Lighting { maps, table, .. }: &Lighting,
) -> Result<DescriptorSet> {
    let panorama = Sampler::new(gpu, "panorama", AddressMode::Panorama, 1)?;
    let clamped = Sampler::new(gpu, "clamped", AddressMode::Clamp, 1)?;
    let bindings = [
        Binding::Storage(&resources.instances),
        Binding::Storage(&resources.materials),
        Binding::Storage(&resources.lights),
        Binding::Sampled(&maps.panorama, &panorama),
        Binding::Sampled(&maps.irradiance_over_pi, &clamped),
        Binding::Sampled(&maps.specular[0], &clamped),
        Binding::Sampled(&maps.specular[1], &clamped),
        Binding::Sampled(&table.image, &clamped),
    ];
    DescriptorSet::new(gpu, "scene", &layouts.scene, &bindings)
}
