//! `bake`: writes the maps precomputed from a panorama, or a scene's lightmap, as KTX2 files.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use half::f16;
use serde::Serialize;

use super::bake_scene::{LIGHTMAP, bake_scene};
use super::baked_file::{BakedFile, write_file};
use super::frame_clock::ms_since;
use crate::args::write_json;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::asset::{Outputs, Panorama};
use crate::context::Setup;
use crate::gpu::{Gpu, PassTime};
use crate::precompute::{BrdfTable, LightMaps, Options, check_face_size, read_texture};
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
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
    /// The folder for irradiance.ktx2, specular.ktx2 and brdf.ktx2, or a scene's lightmap.ktx2; made if it is not there.
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
        outputs.folder(&self.output, &[LIGHTMAP])?;
        outputs.file_if(self.json.as_deref())?;
        let facts = bake_scene(&self.input, &self.output, setup)?;
        say!("{}", facts.file);
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
    let mut irradiance = radiance(gpu, &[&light.irradiance_over_pi], light.scale)?;
    irradiance.set_text("pbrvrContent", "irradiance / pi");
    let mut specular = radiance(gpu, &light.specular.each_ref().map(|map| &**map), light.scale)?;
    specular.set_text("pbrvrContent", "radiance filtered by GGX lobes; level i: mip i / 2 of layer i % 2");
    let roughness: Vec<String> = LightMaps::specular_roughness().map(|r| format!("{r:.6}")).into();
    specular.set_text("pbrvrRoughness", &roughness.join(" "));
    let mut brdf = read_texture(gpu, &[&table.image])?;
    brdf.set_text("pbrvrContent", BrdfTable::MEANING);
    let textures = [irradiance, specular, brdf];
    BAKED.iter().zip(textures).map(|(name, texture)| write_file(folder.join(name), &texture)).collect()
}

/// A texture of radiance from maps of radiance / `scale`: half floats, bit for bit, if the scale is 1, else full floats,
/// because halves might overflow.
fn radiance(gpu: &Arc<Gpu>, maps: &[&crate::gpu::Image], scale: f32) -> Result<Ktx2> {
    let texture = read_texture(gpu, maps)?;
    Ok(if scale > 1.0 && texture.format == TexelFormat::Rgba16Float { widen(texture, scale) } else { texture })
}

/// Halves to floats with RGB times `scale`; exact, as scale is a power of two.
fn widen(mut texture: Ktx2, scale: f32) -> Ktx2 {
    let number = |(i, bytes): (usize, &[u8])| {
        let half = f32::from(f16::from_le_bytes([bytes[0], bytes[1]]));
        // Rounding to halves may have rounded the largest float up.
        let value = if i % 4 < 3 { (half * scale).min(f32::MAX) } else { half };
        value.to_le_bytes()
    };
    for level in &mut texture.levels {
        *level = level.chunks_exact(2).enumerate().flat_map(number).collect();
    }
    texture.format = TexelFormat::Rgba32Float;
    texture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widening_multiplies_colour_and_keeps_alpha() {
        let halves = [1.5, 65504.0, 0.0, 1.0].map(|v| f16::from_f32(v).to_le_bytes()).concat();
        let format = TexelFormat::Rgba16Float;
        let texture = Ktx2 { format, size: [1, 1], layers: 0, faces: 1, levels: vec![halves], key_values: [].into() };
        let wide = widen(texture.clone(), 4.0);
        assert_eq!(wide.format, TexelFormat::Rgba32Float);
        assert_eq!(wide.levels[0], [6f32, 262_016.0, 0.0, 1.0].map(f32::to_le_bytes).concat());
        let widest = widen(texture, 2f32.powi(113));
        assert_eq!(widest.levels[0][4..8], f32::MAX.to_le_bytes());
    }
}
