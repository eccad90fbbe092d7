//! Everything that pipelines depend on, as plain data: any thread can build pipelines from it while frames go on.

use std::sync::Arc;

use super::layouts::Layouts;
use super::ray_scene::LazyRayScene;
use super::settings::RenderSettings;
use crate::gpu::{Gpu, Image};
use crate::scene::MaterialFeatures;

/// A scene's features, the settings, and the number of eyes.
#[derive(Clone)]
pub struct PipelineRequest {
    pub(super) gpu: Arc<Gpu>,
    pub(super) layouts: Arc<Layouts>,
    pub(super) variants: Vec<MaterialFeatures>,
    /// The number of point lights; `None` for any.
    pub(super) constant_lights: Option<u32>,
    /// Of the scene's lightmap; 0 without one.
    pub(super) lightmap_layers: u32,
    /// What the reference's rays meet.
    pub(super) ray_scene: Arc<LazyRayScene>,
    /// The panorama that the reference samples.
    pub(super) panorama: Arc<Image>,
    pub settings: RenderSettings,
    pub eyes: u32,
}
