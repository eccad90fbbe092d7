//! Everything that pipelines depend on, as plain data: any thread can build pipelines from it while frames go on.

use std::sync::Arc;

use super::draws::ProbeUse;
use super::layouts::Layouts;
use super::ray_scene::LazyRayScene;
use super::settings::{LightModel, RenderSettings};
use super::shadow_plan::LampShadows;
use crate::gpu::{Gpu, Image};
use crate::reference::sun::Sun;
use crate::scene::{MaterialFeatures, Model};

/// A scene's features, the settings, and the number of eyes.
#[derive(Clone)]
pub struct PipelineRequest {
    pub(super) gpu: Arc<Gpu>,
    pub(super) layouts: Arc<Layouts>,
    pub(super) variants: Vec<MaterialFeatures>,
    /// The number of point lights; `None` for any.
    pub(super) constant_lights: Option<u32>,
    /// The number of sphere lights.
    pub(super) sphere_lights: u32,
    /// Of the scene's lightmap; 0 without one.
    pub(super) lightmap_layers: u32,
    /// Of each variant, whether something is drawn with it by each kind of [`ProbeUse`].
    pub(super) drawn: Vec<[bool; ProbeUse::KINDS]>,
    /// What the reference's rays meet.
    pub(super) ray_scene: Arc<LazyRayScene>,
    /// Whether anything casts a shadow on anything.
    pub(super) casts: bool,
    /// How lamps' shadows are looked up where shadows are modelled.
    pub(super) planned_shadows: LampShadows,
    /// Whether its paths follow light from the panorama.
    pub(super) sky_relays: bool,
    /// The panorama that the reference samples.
    pub(super) panorama: Arc<Image>,
    /// The sun that is a light of its own, in the panorama's frame.
    pub(super) sun: Option<Sun>,
    pub settings: RenderSettings,
    pub eyes: u32,
}

impl PipelineRequest {
    /// Whether shaders have the sun's code.
    pub(super) fn shades_sun(&self) -> bool {
        let always = self.settings.model == Model::Everything && self.settings.light != LightModel::Open;
        self.sun.is_some() || always
    }

    /// Whether the sun has a shadow map.
    pub(super) fn sun_shadow(&self) -> bool {
        self.sun.is_some() && self.casts
    }

    /// The number of sphere lights that shaders add to mirror images: those of probes leave them out.
    pub(super) fn shown_spheres(&self) -> u32 {
        let by_probes = self.drawn.iter().any(|kinds| kinds[1..].contains(&true));
        if by_probes && self.lightmap_layers > 0 { self.sphere_lights } else { 0 }
    }

    /// Whether any shadow map is read.
    pub(super) fn reads_shadows(&self) -> bool {
        let spheres = self.shown_spheres() > 0 && self.casts;
        self.lamp_shadows() != LampShadows::None || self.sun_shadow() || spheres
    }

    /// How lamps' shadows are looked up under the request's settings.
    pub(super) fn lamp_shadows(&self) -> LampShadows {
        if self.settings.light == LightModel::Open { LampShadows::None } else { self.planned_shadows }
    }
}
