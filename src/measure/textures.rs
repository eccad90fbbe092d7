//! How textures are stored, filtered and made smaller: size and time against what it does to the picture.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3;
use serde::Serialize;

use super::clock::{cpu_ms, today};
use super::turns::{Cost, Limits, Way, take_turns};
use super::widening::{self, WideningRow};
use super::{MeasureRequest, texture_chart};
use crate::asset::file::write_atomically;
use crate::asset::{Cache, MipChain, Report, Storage, TextureOptions, shipped};
use crate::gpu::{Gpu, GpuOptions, Subresource, read_image};
use crate::precompute;
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip};
use crate::render::{Eye, Output, Renderer, Settings, Shading};
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Camera, Scene};
use crate::{Error, Result};

/// The truth has so many pixels along a pixel's side.
const TRUTH_SCALE: u32 = 4;
/// Samples along a slanted footprint of what everything else is judged against.
const MOST_ANISOTROPY: u32 = 16;

/// One scene with its textures stored and filtered one way.
#[derive(Clone, Debug, Serialize)]
pub struct TextureRow {
    pub scene: String,
    pub storage: &'static str,
    pub dropped_levels: u32,
    pub anisotropy: u32,
    pub mib: f64,
    pub raw_mib: f64,
    /// Reading, decoding, filtering and compressing, without a cache; wall time, and that of the process over all cores.
    pub load_ms: f64,
    pub load_cpu_ms: Option<f64>,
    /// Medians; none for compressed textures on a processor, which are drawn decompressed.
    pub frame_gpu_ms: Option<f64>,
    pub frame_cpu_ms: Option<f64>,
    /// Against plain textures with 16 samples of anisotropy.
    pub flip_mean: f32,
    pub flip_max: f32,
    /// Against the same drawn with 4×4 times the pixels.
    pub truth_flip_mean: f32,
}

/// Everything that was measured.
#[derive(Serialize)]
struct Results {
    gpu: String,
    driver: String,
    date: String,
    size: [u32; 2],
    rows: Vec<TextureRow>,
    widening: Vec<WideningRow>,
    charts: Vec<PathBuf>,
    warnings: Vec<String>,
}

/// A way to store and filter.
#[derive(Clone, Copy)]
struct Variant {
    dropped_levels: u32,
    anisotropy: u32,
}

/// What is measured of each scene, the first first: everything else is judged against it.
fn variants(storage: Storage) -> Vec<Variant> {
    match storage {
        Storage::Raw => [16, 8, 4, 2, 1].map(|anisotropy| Variant { dropped_levels: 0, anisotropy }).into(),
        Storage::Bc => [0, 1, 2, 3].map(|dropped_levels| Variant { dropped_levels, anisotropy: 8 }).into(),
    }
}

/// Measures and writes `textures.csv`, `textures-widening.csv`, `textures.json` and a chart for each scene.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let (size, frames) = if request.full { ([1920, 1080], 12) } else { ([384, 216], 3) };
    let sources = sources(request)?;
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let mut results = Results {
        gpu: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        date: today(),
        size,
        rows: Vec::new(),
        widening: widening::measure(&shipped::folder()?.join("textures"), request.full)?,
        charts: Vec::new(),
        warnings: Vec::new(),
    };
    let bar = report.progress("measuring", 9 * sources.len() as u64);
    for source in &sources {
        let mut stand = Stand { gpu: &gpu, source, size, frames, truth: None, plain: Vec::new() };
        for storage in [Storage::Raw, Storage::Bc] {
            if storage == Storage::Bc && !gpu.compresses_textures() {
                report.warn(format!("{}: no compressed textures; not measured", gpu.info().name));
                continue;
            }
            let mut loaded = source.load(storage)?;
            let software = storage == Storage::Bc && gpu.info().is_software();
            loaded.is_timed = !software;
            if software {
                loaded.scene.textures.iter_mut().for_each(|texture| *texture = texture.decompressed());
            }
            for variant in variants(storage) {
                results.rows.push(stand.measure(storage, &loaded, variant)?);
                // What is measured stays if the rest is not.
                write_tables(request.output, &results)?;
                bar.inc(1);
            }
        }
    }
    bar.finish_and_clear();
    drop(gpu);
    messages.check()?;
    results.charts = texture_chart::write_all(request.output, &results.rows, &results.gpu, &results.date)?;
    results.warnings = report.warnings();
    write_tables(request.output, &results)
}

fn write_tables(folder: &Path, results: &Results) -> Result<()> {
    let ms = |ms: Option<f64>| ms.map_or(String::new(), |ms| format!("{ms:.1}"));
    let mut csv = String::from(
        "scene,storage,dropped_levels,anisotropy,mib,raw_mib,load_ms,load_cpu_ms,frame_gpu_ms,frame_cpu_ms,flip_mean,flip_max,\
         truth_flip_mean\n",
    );
    for r in &results.rows {
        csv += &format!(
            "{},{},{},{},{:.3},{:.3},{:.0},{},{},{},{:.5},{:.4},{:.5}\n",
            r.scene,
            r.storage,
            r.dropped_levels,
            r.anisotropy,
            r.mib,
            r.raw_mib,
            r.load_ms,
            ms(r.load_cpu_ms),
            ms(r.frame_gpu_ms),
            ms(r.frame_cpu_ms),
            r.flip_mean,
            r.flip_max,
            r.truth_flip_mean
        );
    }
    write_atomically(&folder.join("textures.csv"), csv.as_bytes())?;
    let mut csv = String::from("map,texels,roughness,method,error,flicker\n");
    for r in &results.widening {
        csv += &format!("{},{},{},{},{:.4},{:.4}\n", r.map, r.texels, r.roughness, r.method, r.error, r.flicker);
    }
    write_atomically(&folder.join("textures-widening.csv"), csv.as_bytes())?;
    let path = folder.join("textures.json");
    let text = serde_json::to_string_pretty(results).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

/// A scene to measure with.
struct Source {
    name: &'static str,
    path: PathBuf,
    /// Instead of the scene's own.
    camera: Option<Camera>,
}

/// A loaded scene, and what loading took.
struct Loaded {
    scene: Scene,
    /// Of the textures without so many top levels.
    bytes: [u64; 4],
    raw_bytes: u64,
    is_timed: bool,
    ms: f64,
    cpu_ms: Option<f64>,
}

impl Source {
    fn load(&self, storage: Storage) -> Result<Loaded> {
        let (start, before) = (Instant::now(), cpu_ms());
        let textures = TextureOptions { storage, ..TextureOptions::default() };
        let default_panorama = Some(shipped::folder()?.join(shipped::PANORAMA));
        // What is wrong with a scene is told by other commands.
        let mut scene = load(&self.path, &LoadOptions { default_panorama, textures }, &Report::silent())?;
        let cpu_ms = cpu_ms().zip(before).map(|(now, before)| now - before);
        if let Some(camera) = &self.camera {
            scene.cameras = vec![camera.clone()];
        }
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let first = |dropped: u32, texture: &MipChain| dropped.min(texture.levels.len() as u32 - 1);
        let bytes = |dropped| scene.textures.iter().map(|t| t.bytes_from(first(dropped, t))).sum();
        let bytes = [0, 1, 2, 3].map(bytes);
        let raw_bytes = scene.textures.iter().map(MipChain::raw_bytes).sum();
        Ok(Loaded { scene, bytes, raw_bytes, is_timed: true, ms, cpu_ms })
    }
}

/// Shipped scenes, a floor that recedes, and Sponza where it is at hand.
fn sources(request: &MeasureRequest<'_>) -> Result<Vec<Source>> {
    let folder = shipped::folder()?;
    let own = |name: &'static str| Source {
        name,
        path: folder.join("scenes").join(name).with_extension("toml"),
        camera: None,
    };
    let large = shipped::large_scenes()?;
    let tiles = Some(large.join("pbr-sets/copper-tiles")).filter(|folder| folder.is_dir());
    let mut sources = vec![own("sphere"), own("teapot"), floor(request.output, &folder, tiles.as_deref())?];
    if large.join("crytek-sponza").is_dir() {
        sources.push(own("crytek-sponza"));
    }
    Ok(sources)
}

fn camera(position: Vec3, target: Vec3) -> Camera {
    Camera { name: "measure".into(), position, target, vertical_fov_degrees: 60.0 }
}

/// A floor of five-map tiles that reaches far, written into the folder of results: 2048² where they are at hand, else the
/// shipped 1024².
fn floor(output: &Path, shipped: &Path, large: Option<&Path>) -> Result<Source> {
    let small = shipped.join("textures/floor-tiles");
    let map = |large_name: &str, small_name: &str| match large {
        Some(folder) => folder.join(format!("Copper_tiles_01_{large_name}.png")),
        None => small.join(format!("{small_name}.jpg")),
    };
    let absolute = |path: PathBuf| std::path::absolute(&path).map_err(Error::read(&path));
    let mut mtl = String::from("newmtl floor\nPr 1\nPm 1\n");
    for (key, large_name, small_name) in [
        ("map_Kd", "Color", "albedo"),
        ("norm", "Normal", "normal"),
        ("map_Pr", "Roughness", "roughness"),
        ("map_Pm", "Metallic", "metallic"),
        ("map_ao", "AO", "ao"),
    ] {
        mtl += &format!("{key} {}\n", absolute(map(large_name, small_name))?.display());
    }
    let obj = "mtllib floor.mtl\nv -10 0 -20\nv 10 0 -20\nv 10 0 2\nv -10 0 2\nvt 0 0\nvt 10 0\nvt 10 11\nvt 0 11\nvn 0 1 0\n\
        usemtl floor\nf 4/1/1 3/2/1 2/3/1 1/4/1\n";
    write_atomically(&output.join("floor.mtl"), mtl.as_bytes())?;
    write_atomically(&output.join("floor.obj"), obj.as_bytes())?;
    let camera = camera(Vec3::new(0.0, 1.0, 1.5), Vec3::new(0.0, 0.0, -2.0));
    Ok(Source { name: "floor", path: output.join("floor.obj"), camera: Some(camera) })
}

/// Draws one scene in all variants, and what they are judged against.
struct Stand<'a> {
    gpu: &'a Arc<Gpu>,
    source: &'a Source,
    size: [u32; 2],
    frames: usize,
    truth: Option<Vec<[u8; 3]>>,
    plain: Vec<[u8; 3]>,
}

struct Drawn {
    pixels: Vec<[u8; 3]>,
    cost: Option<Cost>,
}

impl Stand<'_> {
    fn measure(&mut self, storage: Storage, loaded: &Loaded, variant: Variant) -> Result<TextureRow> {
        let scene = &loaded.scene;
        if self.truth.is_none() {
            let most = Variant { dropped_levels: 0, anisotropy: MOST_ANISOTROPY };
            let large = self.size.map(|side| side * TRUTH_SCALE);
            self.truth = Some(averaged(&self.draw(scene, most, large, 1)?.pixels, large));
        }
        let drawn = self.draw(scene, variant, self.size, self.frames)?;
        if self.plain.is_empty() {
            self.plain = drawn.pixels.clone();
        }
        let against = |reference: &[[u8; 3]]| {
            let flip = flip(self.size, &drawn.pixels, reference, PIXELS_PER_DEGREE);
            flip.ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))
        };
        let plain = against(&self.plain)?;
        let truth = against(self.truth.as_deref().unwrap_or_default())?;
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let cost = drawn.cost.filter(|_| loaded.is_timed);
        Ok(TextureRow {
            scene: self.source.name.into(),
            storage: if storage == Storage::Raw { "raw" } else { "bc" },
            dropped_levels: variant.dropped_levels,
            anisotropy: variant.anisotropy,
            mib: mib(loaded.bytes[variant.dropped_levels as usize]),
            raw_mib: mib(loaded.raw_bytes),
            load_ms: loaded.ms,
            load_cpu_ms: loaded.cpu_ms,
            frame_gpu_ms: cost.map(|cost| cost.gpu_ms.median),
            frame_cpu_ms: cost.and_then(|cost| cost.cpu_ms).map(|ms| ms.median),
            flip_mean: plain.mean,
            flip_max: plain.max,
            truth_flip_mean: truth.mean,
        })
    }

    fn draw(&self, scene: &Scene, variant: Variant, size: [u32; 2], frames: usize) -> Result<Drawn> {
        let Variant { dropped_levels, anisotropy } = variant;
        let textures =
            TextureOptions { dropped_levels, anisotropy, budget_bytes: Some(u64::MAX), ..TextureOptions::default() };
        // Light is the same in all of them.
        let precompute = precompute::Options { cache: Cache::of_user(), ..precompute::Options::default() };
        let settings = Settings { textures, precompute, ..Settings::default() };
        let renderer = Renderer::new(self.gpu, scene, settings, Shading::Pbr, size, 1, &Report::silent())?;
        // A scene has a camera.
        let eye = Eye::of_camera(&scene.cameras[0], size[0] as f32 / size[1] as f32);
        let mut way = [Way { renderer, pictures: vec![vec![eye]] }];
        let limits = Limits { least: frames, most: frames, time: Duration::ZERO };
        let cost = take_turns(self.gpu, &mut way, limits)?.pop();
        let bytes =
            read_image(self.gpu, way[0].renderer.picture(), Subresource { mip: 0, layer: 0 }, Output::Display.bytes())?;
        let pixels = bytes.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
        Ok(Drawn { pixels, cost })
    }
}

/// Each block of [`TRUTH_SCALE`]² pixels as one, averaged as they are displayed, like samples.
fn averaged(pixels: &[[u8; 3]], [width, height]: [u32; 2]) -> Vec<[u8; 3]> {
    let (scale, width) = (TRUTH_SCALE as usize, width as usize);
    let pixel = |x: usize, y: usize| {
        let of = |c: usize| {
            let block = (0..scale).flat_map(|v| (0..scale).map(move |u| (u, v)));
            let sum: u32 = block.map(|(u, v)| u32::from(pixels[(y * scale + v) * width + x * scale + u][c])).sum();
            ((sum + TRUTH_SCALE * TRUTH_SCALE / 2) / (TRUTH_SCALE * TRUTH_SCALE)) as u8
        };
        [of(0), of(1), of(2)]
    };
    (0..height as usize / scale)
        .flat_map(|y| (0..width / scale).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged() {
        let pixels: Vec<[u8; 3]> =
            (0..8 * 4).map(|i| if i % 8 < 4 { [10, 0, 255] } else { [(i % 2) as u8 * 20, 7, 1] }).collect();
        assert_eq!(averaged(&pixels, [8, 4]), [[10, 0, 255], [10, 7, 1]]);
    }
}
