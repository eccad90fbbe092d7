//! `bake SCENE`: writes a scene's lightmap and probes as KTX2 files, and what they mean as JSON.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::baked_file::{BakedFile, roughness_text, write_file};
use super::frame_clock::ms_since;
use super::loader::load_scene;
use crate::args::write_json;
use crate::asset::ktx2::Ktx2;
use crate::context::Setup;
use crate::gpu::Gpu;
use crate::precompute::{LightMaps, read_texture};
use crate::render::{Eye, FrameInputs, LightModel, ProbeMaps, RenderSettings, Renderer, lightmap_sides};
use crate::scene::needs::lightmap::needs_no_lightmap;
use crate::scene::sphere_lights::SphereLight;
use crate::scene::{Probe, Scene};
use crate::{Error, Result};

/// The files that `bake` writes for a scene; those of probes only where it needs any.
pub const SCENE_FILES: [&str; 3] = [LIGHTMAP, SPECULAR, MEANING];
const LIGHTMAP: &str = "lightmap.ktx2";
const SPECULAR: &str = "probe-specular.ktx2";
/// And what they hold.
pub const MEANING: &str = "light.json";

/// Times and facts of a scene's bake, for `--json`.
#[derive(Serialize)]
pub struct SceneBakeFacts {
    pub scene: PathBuf,
    pub gpu: String,
    pub driver: String,
    pub files: Vec<BakedFile>,
    pub triangles: usize,
    /// Reading and decoding the scene's files.
    pub load_ms: f64,
    /// Atlas, hierarchy, upload and the panorama's maps.
    pub prepare_ms: f64,
    /// Lightmap and probes; next to nothing where they were in the cache.
    pub light_ms: f64,
    pub warnings: Vec<String>,
}

/// What a scene's files of light hold: `light.json`.
#[derive(Serialize)]
struct Meaning<'a> {
    scene: &'a Path,
    lightmap: LightmapMeaning,
    /// Empty without probes; the cubes of the files are in this order.
    probes: Vec<ProbePlace>,
    /// What shines and is left out of the probes.
    sphere_lights: Vec<SphereLightPlace>,
    /// Of the specular levels of probes, from level 0 on.
    roughness: Vec<f64>,
}

#[derive(Serialize)]
struct LightmapMeaning {
    /// Texels along a side.
    size: u32,
    /// Layers of irradiance: fronts, and backs where some can be seen. As many of openness follow, and as many of what blocks.
    layers: u32,
}

/// Where a probe's light was captured, the box that it is taken to lie on, and the one in which mirror images show it: world space,
/// metres. The second is another than the first around a thing, whose probe shows what lies outside of it.
#[derive(Serialize)]
struct ProbePlace {
    position: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
    reach_low: [f32; 3],
    reach_high: [f32; 3],
    /// Outside of the second box, where its influence ends.
    border: f32,
}

impl ProbePlace {
    fn new(probe: &Probe) -> Self {
        let reach = probe.reach();
        Self {
            position: probe.position.into(),
            low: probe.bounds.min.into(),
            high: probe.bounds.max.into(),
            reach_low: reach.min.into(),
            reach_high: reach.max.into(),
            border: probe.border(),
        }
    }
}

/// A sphere that stands for a surface that shines: world space, metres.
#[derive(Serialize)]
struct SphereLightPlace {
    position: [f32; 3],
    radius: f32,
    /// W/(m² sr).
    radiance: [f32; 3],
}

impl SphereLightPlace {
    fn new(light: &SphereLight) -> Self {
        Self { position: light.position.into(), radius: light.radius, radiance: light.radiance.into() }
    }
}

/// Computes a scene's light and writes it into `folder`:
///
/// - `lightmap.ktx2`: irradiance of soft light, W/m², as diffuse parts take it (`taken` in `glsl/lightmap_gather.comp`), by the
///   coordinates of the program's own atlas; layer 0 for fronts, layer 1 for backs where some can be seen; then as many layers
///   of openness: the mean of directions that meet nothing before the sky or the walls that probes show, in the models' space,
///   with 0 for all others; and as many of the mean radiance, W/(m² sr), of what these others meet.
/// - `probe-specular.ktx2`, where the scene needs probes: an array of cubes of radiance, W/(m² sr), of surfaces but sphere lights,
///   filtered as a panorama is; alpha is the share of the panorama, whose own levels lie behind. Level i of probe p of n is mip i / 2 of cube
///   p + n (i % 2).
/// - `light.json`: sizes, and where probes and sphere lights are.
///
/// # Errors
/// A scene that needs no lightmap; whatever stops loading, the GPU or writing; a validation message where validation was
/// asked for.
pub fn bake_scene(path: &Path, folder: &Path, setup: &Setup<'_>) -> Result<SceneBakeFacts> {
    std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
    let context = setup.open()?;
    let messages = context.gpu.messages();
    let settings = RenderSettings { light: LightModel::Baked, ..RenderSettings::default() };
    let started = Instant::now();
    let scene = load_scene(path, &settings.textures.options(&context), &context.report)?;
    let load_ms = ms_since(started);
    if let Some(reason) = needs_no_lightmap(&scene, settings.model) {
        return Err(Error::Usage(format!("{}: it needs no lightmap: {reason}", path.display())));
    }
    let started = Instant::now();
    let mut renderer = Renderer::requiring_lightmap(&context, &scene, settings)?;
    let prepare_ms = ms_since(started);
    let started = Instant::now();
    renderer.finish_lightmap(&FrameInputs::of(&scene, &[Eye::of_camera(&scene.cameras[0], 1.0)]))?;
    let light_ms = ms_since(started);
    let files = write(&context.gpu, &renderer, (path, &scene), folder)?;
    let facts = SceneBakeFacts {
        scene: path.to_owned(),
        gpu: context.gpu.info().name.clone(),
        driver: context.gpu.info().driver.clone(),
        files,
        triangles: scene.triangles(),
        load_ms,
        prepare_ms,
        light_ms,
        warnings: context.report.warnings(),
    };
    // Destroying the device may add validation messages, for example about leaks.
    drop((renderer, context));
    messages.check()?;
    Ok(facts)
}

fn write(gpu: &Arc<Gpu>, renderer: &Renderer, (path, scene): (&Path, &Scene), folder: &Path) -> Result<Vec<BakedFile>> {
    let Some(lightmap) = renderer.lightmap() else {
        return Err(Error::Usage(format!("{}: no lightmap was made; the warning says why", path.display())));
    };
    let mut texture = read_texture(gpu, &[lightmap])?;
    let content = "irradiance of soft light, of fronts and where there are any of backs; then as many layers of openness, and of what blocks";
    texture.set_text("pbrvrContent", content);
    let lightmap = LightmapMeaning { size: texture.size[0], layers: lightmap_sides(lightmap) };
    // All is read before the first file is written: they belong together.
    let mut textures = vec![(LIGHTMAP, texture)];
    let (probes, sphere_lights, roughness) = (Vec::new(), Vec::new(), Vec::new());
    let mut meaning = Meaning { scene: path, lightmap, probes, sphere_lights, roughness };
    if let Some(probes) = renderer.probes() {
        textures.push((SPECULAR, specular_levels(gpu, probes)?));
        meaning.probes = places(probes);
        let lights = SphereLight::all(scene.geometry(), &scene.materials);
        meaning.sphere_lights = lights.iter().map(SphereLightPlace::new).collect();
        meaning.roughness = LightMaps::specular_roughness().into();
    }
    let written = textures.iter().map(|(name, texture)| write_file(folder.join(name), texture));
    let files = written.collect::<Result<_>>()?;
    write_json(Some(&folder.join(MEANING)), &meaning)?;
    Ok(files)
}

/// The even levels of all probes, then the odd ones.
fn specular_levels(gpu: &Arc<Gpu>, probes: &ProbeMaps) -> Result<Ktx2> {
    let [even, odd] = &probes.specular;
    let (mut specular, odd) = (read_texture(gpu, &[even])?, read_texture(gpu, &[odd])?);
    specular.levels.iter_mut().zip(&odd.levels).for_each(|(level, odd)| level.extend(odd));
    specular.layers += odd.layers;
    let content = "radiance of surfaces filtered by GGX lobes; level i of probe p of n: mip i / 2 of cube p + n (i % 2); alpha: share of the panorama behind them";
    specular.set_text("pbrvrContent", content);
    specular.set_text("pbrvrRoughness", &roughness_text());
    Ok(specular)
}

fn places(probes: &ProbeMaps) -> Vec<ProbePlace> {
    probes.placed().iter().map(ProbePlace::new).collect()
}
