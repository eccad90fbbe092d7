//! The thesis's tables of frame rates: its six scenes on the desktop and in stereo, physically based and Phong, with what
//! they need modelled and with everything; and what starting costs.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::clock::{peak_ram_mib, reset_peak_ram, today};
use super::turns::{Cost, Limits, Way, take_turns};
use super::{scenes_chart, scenes_table};
use crate::asset::{Report, TextureOptions, shipped};
use crate::gpu::{CommandBuffer, Gpu, GpuOptions, Subresource, read_image};
use crate::precompute::{self, Cache};
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip};
use crate::render::{Eye, IPD_METRES, Output, Renderer, Settings, Shading};
use crate::scene::needs::SceneFeatures;
use crate::scene::{Model, Scene};
use crate::view::{QualityOptions, load_scene};
use crate::{Error, Result, say};

/// Samples per pixel of every picture.
pub const SAMPLES: u32 = 4;

/// A scene of the thesis, and its Table of results (GTX 1070, HTC Vive; Sponza with 512² textures).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// The description's file name without `.toml`.
    pub name: &'static str,
    /// The folder of a model that does not come with the program.
    pub folder: Option<&'static str>,
    pub thesis_triangles: usize,
    /// Frames a second on the desktop, in stereo.
    pub thesis_fps: [f64; 2],
}

impl Known {
    const fn new(name: &'static str, folder: Option<&'static str>, thesis_triangles: usize, fps: [f64; 2]) -> Self {
        Self { name, folder, thesis_triangles, thesis_fps: fps }
    }

    /// Loads the shipped description.
    pub fn load(&self, textures: &TextureOptions, report: &Report) -> Result<Scene> {
        load_scene(&shipped::folder()?.join("scenes").join(self.name).with_extension("toml"), textures, report)
    }
}

/// Smallest first, as in the thesis.
pub const SCENES: [Known; 6] = [
    Known::new("sphere", None, 20_479, [1000.0, 100.0]),
    Known::new("teapot", None, 15_704, [1000.0, 100.0]),
    Known::new("head", Some("lee-perry-smith"), 9_923, [1000.0, 100.0]),
    Known::new("tearoom", None, 5_397, [1000.0, 100.0]),
    Known::new("dabrovic-sponza", Some("dabrovic-sponza"), 66_450, [333.0, 100.0]),
    Known::new("crytek-sponza", Some("crytek-sponza"), 262_267, [90.0, 35.0]),
];

/// Those of the scenes whose files are there; the others are named in warnings.
pub fn there(report: &Report) -> Result<Vec<Known>> {
    let mut there = Vec::new();
    for known in SCENES {
        match known.folder {
            Some(folder) if !shipped::large_scenes()?.join(folder).is_dir() => {
                report.warn(format!(
                    "{}: not there, not measured (set PBR_VR_SCENES, or tools/fetch-assets)",
                    known.name
                ));
            }
            _ => there.push(known),
        }
    }
    Ok(there)
}

/// Sizes of pictures, and how long each is measured.
pub struct BenchConfig {
    pub desktop_size: [u32; 2],
    pub eye_size: [u32; 2],
    pub limits: Limits,
}

impl BenchConfig {
    pub fn new(full: bool) -> Self {
        let limits = |seconds| Limits { least: 3, most: 200, time: Duration::from_secs(seconds) };
        if full {
            Self { desktop_size: [1920, 1080], eye_size: [1512, 1680], limits: limits(10) }
        } else {
            Self { desktop_size: [480, 270], eye_size: [378, 420], limits: limits(2) }
        }
    }

    /// As `pbr-vr view` has them on this GPU.
    pub fn settings(&self, gpu: &Gpu, cache: Option<&Cache>, report: &Report) -> Settings {
        Settings { samples: SAMPLES, ..QualityOptions::default().settings(gpu, cache, report) }
    }
}

/// One scene drawn one way.
#[derive(Clone, Debug, Serialize)]
pub struct SceneRow {
    pub scene: &'static str,
    pub triangles: usize,
    /// `desktop` or `stereo`.
    pub view: &'static str,
    /// Of each eye's picture.
    pub size: [u32; 2],
    /// `pbr` or `phong`.
    pub shading: &'static str,
    /// `needed` or `everything`.
    pub model: &'static str,
    /// Pipelines for materials.
    pub pipelines: usize,
    #[serde(flatten)]
    pub cost: Cost,
    /// What the slower of GPU and recording thread allows.
    pub fps: f64,
    pub thesis_fps: f64,
    /// Of this way's objects alone, once everything is uploaded.
    pub gpu_mib: f64,
    pub texture_mib: f64,
    /// Mean FLIP, and the largest step of 255, against the same picture with what is needed.
    pub flip_mean: f32,
    pub largest_step: u8,
}

/// What it took until the first frame could be drawn.
#[derive(Clone, Debug, Serialize)]
pub struct StartRow {
    pub scene: &'static str,
    /// With an empty cache, and with what that start left in it; wall time.
    pub cold_ms: f64,
    pub cached_ms: f64,
    /// By stage, over all threads together.
    pub cold_stages_ms: BTreeMap<&'static str, f64>,
    pub cached_stages_ms: BTreeMap<&'static str, f64>,
    /// The process's most during the cold start, where the system tells it.
    pub peak_ram_mib: Option<f64>,
    /// The GPU's after it.
    pub gpu_mib: f64,
}

/// Everything that was measured.
#[derive(Serialize)]
pub struct Results {
    pub gpu: String,
    pub driver: String,
    pub date: String,
    pub samples: u32,
    pub rows: Vec<SceneRow>,
    pub starts: Vec<StartRow>,
    pub warnings: Vec<String>,
}

/// Measures, and after each scene writes `scenes.csv`, `scenes-start.csv`, `scenes.json`, `scenes.md` and `scenes.svg`.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let stage = BenchConfig::new(full);
    let (name, driver) = (gpu.info().name.clone(), gpu.info().driver.clone());
    let known = there(report)?;
    let warnings = report.warnings();
    let mut results =
        Results { gpu: name, driver, date: today(), samples: SAMPLES, rows: vec![], starts: vec![], warnings };
    for known in &known {
        let (scene, start, settings) = start(&gpu, known, &stage)?;
        results.starts.push(start);
        for view in [View::desktop(&stage), View::stereo(&stage)] {
            let rows = measure(&gpu, known, &scene, &settings, &stage, view)?;
            rows.iter().for_each(|row| say!("{}", scenes_table::line(row)));
            results.rows.extend(rows);
            scenes_table::write(folder, &results)?;
        }
        scenes_chart::write(folder, &results)?;
    }
    drop(gpu);
    messages.check()
}

/// Starts with an empty cache, then with the one that this made; returns what the second loaded.
fn start(gpu: &Arc<Gpu>, known: &Known, stage: &BenchConfig) -> Result<(Scene, StartRow, Settings)> {
    let folder = std::env::temp_dir().join(format!("pbr-vr-measure-{}-{}", std::process::id(), known.name));
    let cache = Cache::in_folder(folder.clone());
    let settings = stage.settings(gpu, Some(&cache), &Report::silent());
    let once = || -> Result<_> {
        let (report, started) = (Report::silent(), Instant::now());
        let scene = known.load(&settings.textures, &report)?;
        let own = settings.clone();
        let renderer = Renderer::new(gpu, &scene, own, Shading::Pbr, stage.desktop_size, 1, &report)?;
        let ms = started.elapsed().as_secs_f64() * 1e3;
        let gpu_mib = settled_mib(gpu)?;
        drop(renderer);
        Ok((scene, ms, report.times_ms(), gpu_mib))
    };
    let can_tell_peak = reset_peak_ram();
    let cold = once();
    let peak_ram_mib = can_tell_peak.then(peak_ram_mib).flatten();
    let cached = cold.and_then(|(_, ms, stages, gpu_mib)| Ok((ms, stages, gpu_mib, once()?)));
    // What is left behind in a folder for such things harms nobody.
    let _ = std::fs::remove_dir_all(&folder);
    let (cold_ms, cold_stages_ms, gpu_mib, (scene, cached_ms, cached_stages_ms, _)) = cached?;
    let scene_name = known.name;
    let row =
        StartRow { scene: scene_name, cold_ms, cached_ms, cold_stages_ms, cached_stages_ms, peak_ram_mib, gpu_mib };
    // The rows' renderers keep nothing.
    let precompute = precompute::Options { cache: None, ..settings.precompute.clone() };
    Ok((scene, row, Settings { precompute, ..settings }))
}

/// What objects of this process take on the GPU once those given back are gone.
fn settled_mib(gpu: &Arc<Gpu>) -> Result<f64> {
    // An empty submission: what was given back lives until the next one has finished.
    let mut recorder = CommandBuffer::new(gpu)?;
    let (commands, _) = recorder.begin()?;
    commands.submit(None)?;
    recorder.finish()?;
    gpu.wait_idle()?;
    Ok(gpu.taken_memory() as f64 / f64::from(1 << 20))
}

/// Where a scene is seen.
#[derive(Clone, Copy)]
struct View {
    name: &'static str,
    size: [u32; 2],
    eyes: u32,
}

impl View {
    fn desktop(stage: &BenchConfig) -> Self {
        Self { name: "desktop", size: stage.desktop_size, eyes: 1 }
    }

    fn stereo(stage: &BenchConfig) -> Self {
        Self { name: "stereo", size: stage.eye_size, eyes: 2 }
    }

    fn eyes(self, scene: &Scene) -> Vec<Eye> {
        // A loaded scene has a camera.
        let eye = Eye::of_camera(&scene.cameras[0], self.size[0] as f32 / self.size[1] as f32);
        if self.eyes == 2 { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] }
    }
}

/// What is needed stands before everything, which is compared with it.
const WAYS: [(&str, Shading, &str, Model); 4] = [
    ("pbr", Shading::Pbr, "needed", Model::Needed),
    ("pbr", Shading::Pbr, "everything", Model::Everything),
    ("phong", Shading::Phong, "needed", Model::Needed),
    ("phong", Shading::Phong, "everything", Model::Everything),
];

fn measure(
    gpu: &Arc<Gpu>,
    known: &Known,
    scene: &Scene,
    settings: &Settings,
    stage: &BenchConfig,
    view: View,
) -> Result<Vec<SceneRow>> {
    let (mut ways, mut mib) = (Vec::new(), Vec::new());
    for (_, shading, _, model) in WAYS {
        let before = settled_mib(gpu)?;
        let settings = Settings { model, ..settings.clone() };
        let renderer = Renderer::new(gpu, scene, settings, shading, view.size, view.eyes, &Report::silent())?;
        mib.push(settled_mib(gpu)? - before);
        ways.push(Way { renderer, pictures: vec![view.eyes(scene)] });
    }
    let costs = take_turns(gpu, &mut ways, stage.limits)?;
    let pictures = ways.iter().map(|way| picture(gpu, way, view)).collect::<Result<Vec<_>>>()?;
    let mut rows = Vec::new();
    for (i, (cost, (shading, _, model, kind))) in costs.into_iter().zip(WAYS).enumerate() {
        let (flip_mean, largest_step) = difference(view, &pictures[i], &pictures[i / 2 * 2])?;
        rows.push(SceneRow {
            scene: known.name,
            triangles: scene.triangles(),
            view: view.name,
            size: view.size,
            shading,
            model,
            pipelines: SceneFeatures::of(scene, kind, None).pipelines(),
            cost,
            fps: 1e3 / cost.gpu_ms.median.max(cost.record_ms.median),
            thesis_fps: known.thesis_fps[view.eyes as usize - 1],
            gpu_mib: mib[i],
            texture_mib: ways[i].renderer.texture_facts().bytes as f64 / f64::from(1 << 20),
            flip_mean,
            largest_step,
        });
    }
    Ok(rows)
}

/// The last frame's pixels, one eye below the other.
fn picture(gpu: &Arc<Gpu>, way: &Way, view: View) -> Result<Vec<[u8; 3]>> {
    let mut pixels = Vec::new();
    for layer in 0..view.eyes {
        let bytes = read_image(gpu, way.renderer.picture(), Subresource { mip: 0, layer }, Output::Display.bytes())?;
        pixels.extend(bytes.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]));
    }
    Ok(pixels)
}

fn difference(view: View, test: &[[u8; 3]], reference: &[[u8; 3]]) -> Result<(f32, u8)> {
    let size = [view.size[0], view.size[1] * view.eyes];
    let steps = test.iter().flatten().zip(reference.iter().flatten()).map(|(a, b)| a.abs_diff(*b));
    let flip = flip(size, test, reference, PIXELS_PER_DEGREE)
        .ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))?;
    Ok((flip.mean, steps.max().unwrap_or(0)))
}
