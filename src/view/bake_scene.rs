//! `bake SCENE`: writes a scene's lightmap as a KTX2 file.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::baked_file::{BakedFile, write_file};
use super::frame_clock::ms_since;
use super::loader::load_scene;
use crate::context::Setup;
use crate::precompute::read_texture;
use crate::render::{Eye, FrameInputs, LightModel, RenderSettings, Renderer};
use crate::scene::needs::lightmap::{LightmapNeed, lightmap_need};
use crate::{Error, Result};

/// The file that `bake` writes for a scene.
pub const LIGHTMAP: &str = "lightmap.ktx2";

/// Times and facts of a scene's bake, for `--json`.
#[derive(Serialize)]
pub struct SceneBakeFacts {
    pub scene: PathBuf,
    pub gpu: String,
    pub driver: String,
    pub file: BakedFile,
    pub triangles: usize,
    /// Reading and decoding the scene's files.
    pub load_ms: f64,
    /// Atlas, hierarchy, upload and the panorama's maps.
    pub prepare_ms: f64,
    /// The lightmap alone; next to nothing where it was in the cache.
    pub lightmap_ms: f64,
    pub warnings: Vec<String>,
}

/// Computes a scene's lightmap and writes it into `folder`: irradiance of soft light, W/m², by the coordinates of the
/// program's own atlas; layer 0 for fronts, layer 1 for backs where some can be seen; then as many layers of openness: the
/// mean of directions that meet nothing, in the models' space, and the mean radiance of what the others meet over that of
/// all.
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
    if let LightmapNeed::None(reason) = lightmap_need(&scene, settings.model) {
        return Err(Error::Usage(format!("{}: it needs no lightmap: {reason}", path.display())));
    }
    let started = Instant::now();
    let mut renderer = Renderer::new(&context, &scene, settings, [16, 16], 1)?;
    let prepare_ms = ms_since(started);
    let started = Instant::now();
    renderer.finish_lightmap(&FrameInputs::of(&scene, &[Eye::of_camera(&scene.cameras[0], 1.0)]))?;
    let lightmap_ms = ms_since(started);
    let Some(lightmap) = renderer.lightmap() else {
        return Err(Error::Usage(format!("{}: no atlas can be made of it", path.display())));
    };
    let mut texture = read_texture(&context.gpu, &[lightmap])?;
    let content =
        "irradiance of soft light, of fronts and where there are any of backs; then as many layers of openness";
    texture.set_text("pbrvrContent", content);
    let facts = SceneBakeFacts {
        scene: path.to_owned(),
        gpu: context.gpu.info().name.clone(),
        driver: context.gpu.info().driver.clone(),
        file: write_file(folder.join(LIGHTMAP), &texture)?,
        triangles: scene.triangles(),
        load_ms,
        prepare_ms,
        lightmap_ms,
        warnings: context.report.warnings(),
    };
    // Destroying the device may add validation messages, for example about leaks.
    drop((renderer, context));
    messages.check()?;
    Ok(facts)
}
