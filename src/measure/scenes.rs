//! The thesis's six scenes, on the desktop and in stereo, physically based and Phong, with what each needs and with
//! everything: `measure scenes`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::clock::today;
use super::spread::{Spread, frames};
use super::{scene_chart, scene_table};
use crate::Result;
use crate::asset::{Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::render::{Eye, IPD_METRES, Renderer, Settings, Shading};
use crate::scene::needs::resolution::Viewpoint;
use crate::scene::{LoadOptions, Model, Scene, load};
use crate::view::TextureChoice;

/// A scene, and what the thesis says of it.
pub struct Known {
    pub name: &'static str,
    /// Whether its models come with the program.
    pub shipped: bool,
    /// Frames a second: GTX 760 on the desktop, GTX 1070 with a Vive.
    pub thesis_fps: [f64; 2],
}

/// All six; Crytek Sponza's frame rates are those with high-resolution textures.
pub const SCENES: [Known; 6] = [
    Known { name: "sphere", shipped: true, thesis_fps: [1000.0, 100.0] },
    Known { name: "teapot", shipped: true, thesis_fps: [1000.0, 100.0] },
    Known { name: "head", shipped: false, thesis_fps: [1000.0, 100.0] },
    Known { name: "tearoom", shipped: true, thesis_fps: [1000.0, 100.0] },
    Known { name: "dabrovic-sponza", shipped: false, thesis_fps: [333.0, 100.0] },
    Known { name: "crytek-sponza", shipped: false, thesis_fps: [40.0, 15.0] },
];

/// A way to look at a scene: name, eyes, pixels of an eye's picture in full and in a quick run.
const VIEWS: [(&str, usize, [u32; 2], [u32; 2]); 2] =
    [("desktop", 1, [1920, 1080], [320, 180]), ("stereo", 2, [1512, 1680], [252, 280])];
const SAMPLES: u32 = 4;
const WARM_UP: usize = 3;

/// One scene drawn in one way.
#[derive(Clone, Debug, Serialize)]
pub struct SceneRow {
    pub scene: &'static str,
    pub view: &'static str,
    pub eyes: usize,
    /// Pixels of one eye's picture.
    pub size: [u32; 2],
    pub samples: u32,
    pub model: String,
    pub shading: String,
    pub frames: usize,
    pub triangles: usize,
    /// GPU time of all passes.
    pub gpu_ms: Spread,
    /// Processor time of the thread that culls, records and submits.
    pub record_ms: Spread,
    /// Frames by wall time, the CPU as far ahead as in a window.
    pub fps: f64,
    /// The thesis's, physically based, on its own hardware.
    pub thesis_fps: f64,
    /// GPU memory of everything together, pictures included.
    pub gpu_mib: f64,
    pub texture_mib: f64,
    /// Reading and decoding the scene's files, for all rows of the scene.
    pub load_ms: f64,
    /// Upload, precomputation and pipelines, without a cache; for both shadings together.
    pub prepare_ms: f64,
}

/// All rows, and what they were measured on.
#[derive(Clone, Debug, Serialize)]
pub struct SceneTable {
    pub gpu: String,
    pub driver: String,
    /// UTC.
    pub date: String,
    pub thesis_hardware: &'static str,
    pub rows: Vec<SceneRow>,
    /// Time of each stage of loading and preparing, over all threads, ms; by scene.
    pub stages_ms: BTreeMap<&'static str, BTreeMap<&'static str, f64>>,
    /// Scenes that were left out, and why.
    pub left_out: Vec<String>,
    pub warnings: Vec<String>,
}

/// Measures and writes `scenes.csv`, `scenes.json`, `scenes.md` and `scenes.svg`; all are written anew after each row, so
/// that a run that is stopped leaves what it has.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<SceneTable> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let mut table = SceneTable {
        gpu: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        date: today(),
        thesis_hardware: "desktop: i5-4460, GTX 760; VR: i7-6700, GTX 1070, HTC Vive, 1080\u{d7}1200 an eye",
        rows: Vec::new(),
        stages_ms: BTreeMap::new(),
        left_out: Vec::new(),
        warnings: Vec::new(),
    };
    for known in &SCENES {
        let own = Report::silent();
        match load_one(&gpu, known, &own) {
            Ok((scene, load_ms)) => measure(&gpu, known, &scene, load_ms, full, &own, &mut |row| {
                print!("{}", scene_table::line(&row));
                table.rows.push(row);
                write_all(folder, &table)
            })?,
            Err(error) if !known.shipped => {
                println!("{}: left out: {error}", known.name);
                table.left_out.push(format!("{}: {error}", known.name));
            }
            Err(error) => return Err(error),
        }
        own.warnings().into_iter().for_each(|warning| report.warn(warning));
        table.warnings = report.warnings();
        table.stages_ms.insert(known.name, own.times_ms());
        write_all(folder, &table)?;
    }
    drop(gpu);
    messages.check()?;
    Ok(table)
}

/// A scene and the time that loading it took, ms.
pub fn load_one(gpu: &Gpu, known: &Known, report: &Report) -> Result<(Scene, f64)> {
    let file = shipped::folder()?.join("scenes").join(format!("{}.toml", known.name));
    let textures = TextureChoice::default().options(gpu, None, report);
    let started = Instant::now();
    let scene = load(&file, &LoadOptions { default_panorama: None, textures }, report)?;
    Ok((scene, ms_since(started)))
}

fn measure(
    gpu: &Arc<Gpu>,
    known: &Known,
    scene: &Scene,
    load_ms: f64,
    full: bool,
    report: &Report,
    keep: &mut dyn FnMut(SceneRow) -> Result<()>,
) -> Result<()> {
    let count = if full { 120 } else { 12 };
    for (place, (view, eye_count, large, small)) in VIEWS.into_iter().enumerate() {
        let size = if full { large } else { small };
        let eyes = eyes_of(scene, size, eye_count);
        for model in [Model::Needed, Model::Everything] {
            let started = Instant::now();
            let mut renderer = renderer(gpu, scene, model, &eyes, size, report)?;
            let prepare_ms = ms_since(started);
            for shading in [Shading::Pbr, Shading::Phong] {
                renderer.set_shading(shading)?;
                let taken = frames(gpu, &mut renderer, &eyes, WARM_UP, count)?;
                keep(SceneRow {
                    scene: known.name,
                    view,
                    eyes: eye_count,
                    size,
                    samples: SAMPLES,
                    model: name_of(&model),
                    shading: name_of(&shading),
                    frames: count,
                    triangles: scene.triangles(),
                    gpu_ms: Spread::of(&taken.gpu_ms),
                    record_ms: Spread::of(&taken.record_ms),
                    fps: 1e3 * count as f64 / taken.wall_ms,
                    thesis_fps: known.thesis_fps[place],
                    gpu_mib: mib(gpu.allocated_memory()),
                    texture_mib: mib(renderer.texture_facts().bytes),
                    load_ms,
                    prepare_ms,
                })?;
            }
            drop(renderer);
            gpu.wait_idle()?;
        }
    }
    Ok(())
}

/// The eyes of a scene's first camera, one or two.
pub fn eyes_of(scene: &Scene, size: [u32; 2], count: usize) -> Vec<Eye> {
    let eye = Eye::of_camera(&scene.cameras[0], size[0] as f32 / size[1] as f32);
    if count == 2 { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] }
}

/// A renderer as `render` makes it, without a cache.
pub fn renderer(
    gpu: &Arc<Gpu>,
    scene: &Scene,
    model: Model,
    eyes: &[Eye],
    size: [u32; 2],
    report: &Report,
) -> Result<Renderer> {
    let Eye { left, right, down, up, .. } = eyes[0];
    let middle = eyes.iter().map(Eye::position).sum::<glam::Vec3>() / eyes.len() as f32;
    let around_metres = eyes[0].position().distance(middle);
    let settings = Settings {
        model,
        viewpoint: Some(Viewpoint::new(middle, around_metres, [left, right, down, up], size)),
        samples: SAMPLES,
        textures: TextureChoice::default().options(gpu, None, report),
        ..Settings::default()
    };
    Renderer::new(gpu, scene, settings, Shading::Pbr, size, eyes.len() as u32, report)
}

fn write_all(folder: &Path, table: &SceneTable) -> Result<()> {
    scene_table::write(folder, table)?;
    scene_chart::write(folder, table)
}

/// As on the command line.
fn name_of(value: &impl clap::ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
