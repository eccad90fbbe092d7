//! One scene ready to be drawn with any settings, timed interleaved with the default ones, and judged.

use std::path::Path;

use super::super::bench::{Bench, Budget, Cost, first_eye, interleaved, ratio};
use super::super::request::MeasureRequest;
use super::bakes::Bakes;
use super::config::Config;
use super::reference::{Pixels, Reference, Shot, textures};
use super::settings;
use crate::Result;
use crate::asset::{Report, Storage};
use crate::context::Context;
use crate::render::{Output, RenderSettings};
use crate::scene::Scene;
use crate::scene::needs::lightmap::LightmapNeed;
use crate::scene::needs::resolution::Viewpoint;
use crate::scene::staging::Staging;
use crate::view::load_staged;

/// A scene, its default configuration, and its reference picture.
pub struct SettingsBench<'a> {
    context: &'a Context,
    path: &'a Path,
    pub shot: Shot,
    budget: Budget,
    staging: Staging,
    /// By how their textures are stored.
    scenes: Vec<(Storage, Scene)>,
    default: Bench,
    /// What has been measured.
    known: Vec<RenderSettings>,
    bakes: Bakes,
    pub reference: Reference,
}

impl<'a> SettingsBench<'a> {
    /// Loads a scene, draws its reference picture, and prepares the default, as its first camera sees it.
    pub fn new(context: &'a Context, path: &'a Path, request: &MeasureRequest) -> Result<Self> {
        let (size, half, seconds) = if request.full { ([1280, 720], 64, 10) } else { ([384, 216], 16, 2) };
        let size = request.picture.unwrap_or(size);
        let staging = request.staging();
        let options = textures().options(context);
        let raw = load_staged(path, staging.clone(), &options, &context.report)?;
        let (eye, exposure_ev) = (first_eye(&raw, size), raw.exposure_ev);
        let shot = Shot { eye, size, exposure_ev, pixels_per_degree: request.pixels_per_degree };
        let settings = settings_of(context, shot, RenderSettings::default());
        let reference = Reference::new(context, shot, &raw, &settings, half)?;
        let mut scenes = vec![(Storage::Raw, raw)];
        let scene = stored(context, &mut scenes, (path, &staging), &settings)?;
        let mut bakes = Bakes::new(path);
        let (default, _) = bakes.bench(context, scene, settings.clone(), shot)?;
        let budget = Budget { least: 5, seconds };
        let known = Vec::new();
        Ok(Self { context, path, staging, shot, budget, scenes, default, known, bakes, reference })
    }

    /// Draws with these flags, interleaved with the default, and judges the picture; `None` for flags that mean the same
    /// here as some that have been measured.
    pub fn measure(&mut self, dimension: &str, flags: &str) -> Result<Option<Config>> {
        let shot = self.shot;
        let settings = settings_of(self.context, shot, settings::options(flags)?);
        let scene = stored(self.context, &mut self.scenes, (self.path, &self.staging), &settings)?;
        let settings = without_what_is_chosen_anyway(self.context, scene, settings);
        if self.known.contains(&settings) {
            return Ok(None);
        }
        self.known.push(settings.clone());
        let mut bench = |settings| self.bakes.bench(self.context, scene, settings, shot);
        let (mut timed, bake) = bench(settings.clone())?;
        let times = interleaved(&mut [&mut self.default, &mut timed], self.budget)?;
        let costs = Cost::of(&times[0]).zip(Cost::of(&times[1])).zip(ratio(&self.context.gpu, &times[0], &times[1]));
        let Some(((default, cost), ratio)) = costs else { return Ok(None) };
        let display = timed.display()?;
        drop(timed);
        let (mut linear, _) = bench(RenderSettings { output: Output::Linear, ..settings })?;
        linear.draw()?;
        let radiance = linear.radiance()?.into_iter().map(|pixel| pixel.to_array()).collect();
        let (error, halves) = self.reference.compare(shot, &Pixels { radiance, display })?;
        Ok(Some(Config {
            dimension: dimension.into(),
            flags: flags.into(),
            cost,
            bake,
            ratio,
            default_gpu_ms: default.gpu_ms.median,
            ms: cost.gpu_ms.median,
            error,
            halves,
            flip_over_default: 0.0,
            flip_noise: 0.0,
            dominated_by: None,
        }))
    }
}

/// Settings for this picture on this GPU; those that it does not support are the default then, and not measured.
fn settings_of(context: &Context, shot: Shot, settings: RenderSettings) -> RenderSettings {
    let Shot { eye, size, .. } = shot;
    let viewpoint = Viewpoint::new(eye.position(), 0.0, [eye.left, eye.right, eye.down, eye.up], size);
    RenderSettings { viewpoint: Some(viewpoint), textures: settings.textures.resolved(context), ..settings }
}

/// The scene with its textures stored so, loaded when it is first needed.
fn stored<'a>(
    context: &Context,
    scenes: &'a mut Vec<(Storage, Scene)>,
    (path, staging): (&Path, &Staging),
    settings: &RenderSettings,
) -> Result<&'a Scene> {
    let textures = settings.textures.options(context);
    let index = match scenes.iter().position(|(storage, _)| *storage == textures.storage) {
        Some(index) => index,
        None => {
            scenes.push((textures.storage, load_staged(path, staging.clone(), &textures, &Report::silent())?));
            scenes.len() - 1
        }
    };
    Ok(&scenes[index].1)
}

/// The same settings with nothing said of what is chosen for the scene anyway.
fn without_what_is_chosen_anyway(context: &Context, scene: &Scene, settings: RenderSettings) -> RenderSettings {
    let mut detail = settings.light_detail;
    let chosen = || LightmapNeed::new(scene, settings.model, context.cache.as_ref()).side;
    if detail.lightmap_size.is_some_and(|side| side == chosen()) {
        detail.lightmap_size = None;
    }
    RenderSettings { light_detail: detail, ..settings }
}
