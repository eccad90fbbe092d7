//! `bake`: writes the maps precomputed from a panorama, or a scene's baked light, as KTX2 files.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::bake_scene::{MEANING, SCENE_FILES, bake_scene};
use super::baked_file::{BakedFile, radiance, roughness_text, write_file};
use super::frame_clock::ms_since;
use crate::args::write_json;
use crate::asset::{Outputs, Panorama};
use crate::context::Setup;
use crate::gpu::{Gpu, PassTime};
use crate::precompute::{BrdfTable, LightMaps, Options, check_face_size, read_texture};
use crate::reference::brdf::Geometry;
use crate::reference::split_sum::SplitSum;
use crate::scene::is_scene;
use crate::scene::load::files as scene_files;
use crate::{Error, Result, say};

/// The files that `bake` writes.
pub const BAKED: [&str; 3] = ["irradiance.ktx2", "specular.ktx2", "brdf.ktx2"];

/// A panorama or a scene, and where its maps are written.
#[derive(Args, Clone, Debug)]
pub struct BakeRequest {
    /// A Radiance (.hdr) or OpenEXR (.exr) panorama; or a scene (.toml, .gltf, .glb, .obj).
    pub input: PathBuf,
    /// The folder for irradiance.ktx2, specular.ktx2 and brdf.ktx2; or a scene's lightmap.ktx2, light.json and, if it needs
    /// probes, probe-specular.ktx2. Made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Texels along a face of the largest specular levels: a power of two from 16 to 1024.
    #[arg(long, value_name = "N", default_value_t = Options::default().face_size)]
    pub size: u32,
    /// Write times and facts.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

impl BakeRequest {
    fn run_scene(&self, setup: &Setup<'_>) -> Result<()> {
        let mut outputs = Outputs::of(scene_files(&self.input));
        outputs.folder(&self.output, &SCENE_FILES)?;
        outputs.file_if(self.json.as_deref())?;
        let facts = bake_scene(&self.input, &self.output, setup)?;
        facts.files.iter().for_each(|file| say!("{file}"));
        say!("{}: what they hold, and where probes stand", self.output.join(MEANING).display());
        write_json(self.json.as_deref(), &facts)
    }

    /// The command: checks the outputs, bakes, prints a line for each file and writes the facts.
    ///
    /// # Errors
    /// Those of [`bake`]; outputs that cannot be written or are inputs.
    pub fn run(&self, setup: &Setup<'_>) -> Result<()> {
        if is_scene(&self.input) {
            return self.run_scene(setup);
        }
        let mut outputs = Outputs::of([&self.input]);
        outputs.folder(&self.output, &BAKED)?;
        outputs.file_if(self.json.as_deref())?;
        let facts = bake(self, setup)?;
        facts.files.iter().for_each(|file| say!("{file}"));
        write_json(self.json.as_deref(), &facts)
    }
}

/// Times and facts of a bake, for `--json`.
#[derive(Serialize)]
pub struct BakeFacts {
    pub panorama: PathBuf,
    /// Texels.
    pub panorama_size: [u32; 2],
    pub face_size: u32,
    pub gpu: String,
    pub driver: String,
    pub files: Vec<BakedFile>,
    /// In order; reading the panorama, opening the GPU and writing files are among them.
    pub stages: Vec<StageTime>,
    pub warnings: Vec<String>,
}

/// One step: how long it took on the clock, and its passes' times on the GPU.
#[derive(Serialize)]
pub struct StageTime {
    pub name: &'static str,
    pub wall_ms: f64,
    pub gpu: Vec<PassTime>,
}

/// Precomputes a panorama's light and writes `irradiance.ktx2`, `specular.ktx2` and `brdf.ktx2`. The second is an array of
/// two cubes: level i of `reference::levels` is mip i / 2 of layer i % 2.
///
/// # Errors
/// A bad size, an unreadable panorama, an unwritable folder, whatever stops the GPU; a validation message where
/// validation was asked for.
pub fn bake(request: &BakeRequest, setup: &Setup<'_>) -> Result<BakeFacts> {
    check_face_size(request.size)?;
    let mut stages = Stages(Vec::new());
    let panorama = stages.run("read panorama", || Panorama::load(&request.input, &setup.report), |_| &[])?;
    std::fs::create_dir_all(&request.output).map_err(Error::write(&request.output))?;
    let context = stages.run("open GPU", || setup.open(), |_| &[])?;
    let gpu = &context.gpu;
    let messages = gpu.messages();
    let options = Options { face_size: request.size, ..Options::default() };
    let light = stages.run("light maps", || LightMaps::new(&context, &panorama, options), |light| &light.times)?;
    let table = || BrdfTable::new(&context, Geometry::Smith, SplitSum::Moment);
    let table = stages.run("BRDF table", table, |table| &table.times)?;
    let files = stages.run("write files", || write(gpu, &request.output, &light, &table), |_| &[])?;
    let facts = BakeFacts {
        panorama: request.input.clone(),
        panorama_size: [panorama.width, panorama.height],
        face_size: request.size,
        gpu: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        files,
        stages: stages.0,
        warnings: setup.report.warnings(),
    };
    // Destroying the device may add validation messages, for example about leaks.
    drop((light, table, context));
    messages.check()?;
    Ok(facts)
}

struct Stages(Vec<StageTime>);

impl Stages {
    fn run<T>(
        &mut self,
        name: &'static str,
        step: impl FnOnce() -> Result<T>,
        gpu: impl FnOnce(&T) -> &[PassTime],
    ) -> Result<T> {
        let started = Instant::now();
        let done = step()?;
        self.0.push(StageTime { name, wall_ms: ms_since(started), gpu: gpu(&done).to_vec() });
        Ok(done)
    }
}

fn write(gpu: &Arc<Gpu>, folder: &Path, light: &LightMaps, table: &BrdfTable) -> Result<Vec<BakedFile>> {
    let mut irradiance = radiance(read_texture(gpu, &[&light.irradiance_over_pi])?, light.scale);
    irradiance.set_text("pbrvrContent", "irradiance / pi; alpha: how much of it is grazing, 1 for even light");
    let mut specular = radiance(read_texture(gpu, &light.specular.each_ref().map(|map| &**map))?, light.scale);
    specular.set_text("pbrvrContent", "radiance filtered by GGX lobes; level i: mip i / 2 of layer i % 2");
    specular.set_text("pbrvrRoughness", &roughness_text());
    let mut brdf = read_texture(gpu, &[&table.image])?;
    brdf.set_text("pbrvrContent", BrdfTable::MEANING);
    let textures = [irradiance, specular, brdf];
    BAKED.iter().zip(textures).map(|(name, texture)| write_file(folder.join(name), &texture)).collect()
}
