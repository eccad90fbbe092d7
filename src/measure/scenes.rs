//! What frames cost in the thesis's six scenes, on the desktop and in stereo: physically based and Phong, with the features that
//! they need and with all, with each way to save time and without; and what starting costs.

use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use super::bench::{Bench, Budget, Cost, Spread, first_eye, interleaved, ratio, size_error};
use super::machine::Machine;
use super::plot::{Mark, Panel, Plot, Point};
use super::report::{write_json, write_table};
use super::request::MeasureRequest;
use crate::asset::{Report, shipped};
use crate::context::Context;
use crate::precompute::Cache;
use crate::reference::energy::Scattering;
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip};
use crate::render::{CullOptions, Eye, IPD_METRES, LightModel, Order, RenderSettings, Shading, TextureSettings};
use crate::scene::{Model, Scene};
use crate::view::load_scene;
use crate::{Result, say};

/// A scene of the thesis, with the results that it reports (GTX 1070, HTC Vive; Sponza with 512² textures).
#[derive(Clone, Copy)]
struct ThesisScene {
    /// The description's file name without `.toml`.
    name: &'static str,
    /// The folder of a model that does not come with the program.
    folder: Option<&'static str>,
    triangles: usize,
    /// Frames a second on the desktop, in stereo.
    fps: [f64; 2],
}

/// Smallest first, as in the thesis.
#[rustfmt::skip]
const SCENES: [ThesisScene; 6] = [
    ThesisScene { name: "sphere", folder: None, triangles: 20_479, fps: [1000.0, 100.0] },
    ThesisScene { name: "teapot", folder: None, triangles: 15_704, fps: [1000.0, 100.0] },
    ThesisScene { name: "head", folder: Some("lee-perry-smith"), triangles: 9_923, fps: [1000.0, 100.0] },
    ThesisScene { name: "tearoom", folder: None, triangles: 5_397, fps: [1000.0, 100.0] },
    ThesisScene { name: "dabrovic-sponza", folder: Some("dabrovic-sponza"), triangles: 66_450, fps: [333.0, 100.0] },
    ThesisScene { name: "crytek-sponza", folder: Some("crytek-sponza"), triangles: 262_267, fps: [90.0, 35.0] },
];

/// The scenes whose files are there; the others are named in warnings.
fn available(report: &Report) -> Result<Vec<ThesisScene>> {
    let folder = shipped::large_scenes()?;
    let is_there = |scene: &ThesisScene| scene.folder.is_none_or(|name| folder.join(name).is_dir());
    let (available, missing): (Vec<_>, Vec<_>) = SCENES.into_iter().partition(is_there);
    for ThesisScene { name, .. } in missing {
        report.warn(format!("{name}: not there, not measured (set PBR_VR_SCENES, or tools/fetch-assets)"));
    }
    Ok(available)
}

/// One scene drawn one way.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: &'static str,
    triangles: usize,
    thesis_triangles: usize,
    /// `desktop` or `stereo`.
    view: &'static str,
    /// Pixels of each eye's picture.
    size: [u32; 2],
    way: &'static str,
    draws: usize,
    #[serde(flatten)]
    cost: Cost,
    /// The frame rate that the slower of GPU and recording thread allows.
    fps: f64,
    thesis_fps: f64,
    texture_mib: f64,
    /// Wall time until the first desktop frame can be drawn, with an empty cache and with what that start left in it.
    cold_ms: f64,
    cached_ms: f64,
    /// The way that this one is compared with, and how many times its time this one takes.
    against: &'static str,
    times: Spread,
    /// Difference of both pictures: mean FLIP, and the largest step of 255.
    flip_mean: f32,
    largest_step: u8,
}

#[derive(Serialize)]
struct Results {
    #[serde(flatten)]
    machine: Machine,
    samples: u32,
    rows: Vec<Row>,
    warnings: Vec<String>,
}

/// Measures, and after each scene writes `scenes.csv`, `scenes.json`, `scenes.md` and `scenes.svg`.
pub fn run(request: &MeasureRequest, context: &Context) -> Result<()> {
    let [desktop, eye] = if request.full { [[1920, 1080], [1512, 1680]] } else { [[480, 270], [378, 420]] };
    let budget = Budget { least: 3, seconds: if request.full { 10 } else { 2 } };
    let views = [View { name: "desktop", size: desktop, eyes: 1 }, View { name: "stereo", size: eye, eyes: 2 }];
    let available = available(&context.report)?;
    let (machine, warnings) = (Machine::new(&context.gpu), context.report.warnings());
    let mut results = Results { machine, samples: RenderSettings::default().samples, rows: vec![], warnings };
    for thesis in &available {
        let started = start(context, *thesis, views[0])?;
        for view in views {
            let rows = started.measure(context, view, budget)?;
            for Row { way, cost, fps, against, times, .. } in &rows {
                let (name, ms, times) = (thesis.name, cost.gpu_ms.median, times.median);
                say!("{name}, {}, {way}: {ms:.2} ms, {fps:.0} frames a second, {times:.2} times {against}", view.name);
            }
            results.rows.extend(rows);
            write(request.folder(), &results)?;
        }
        plot(&results).write(request.folder(), "scenes")?;
    }
    Ok(())
}

/// A view of a scene: in the window or in stereo.
#[derive(Clone, Copy)]
struct View {
    name: &'static str,
    /// Pixels of each eye's picture.
    size: [u32; 2],
    eyes: u32,
}

impl View {
    fn eyes(self, scene: &Scene) -> Vec<Eye> {
        let eye = first_eye(scene, self.size);
        if self.eyes == 2 { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] }
    }
}

/// A loaded scene, and the wall times of two starts.
struct Started {
    thesis: ThesisScene,
    scene: Scene,
    cold_ms: f64,
    cached_ms: f64,
}

/// Starts with an empty cache, then with the one that this left.
fn start(context: &Context, thesis: ThesisScene, view: View) -> Result<Started> {
    let folder = std::env::temp_dir().join(format!("pbr-vr-measure-{}-{}", std::process::id(), thesis.name));
    let cache = Cache::in_folder(folder.clone());
    let context = &Context { cache: Some(cache), ..context.clone() };
    let textures = TextureSettings::default().options(context);
    let path = shipped::folder()?.join("scenes").join(thesis.name).with_extension("toml");
    let once = || -> Result<_> {
        let started = Instant::now();
        let scene = load_scene(&path, &textures, &Report::silent())?;
        Bench::new(context, &scene, settings(), view.size, view.eyes(&scene))?;
        Ok((scene, started.elapsed().as_secs_f64() * 1e3))
    };
    let both = once().and_then(|(_, cold_ms)| Ok((cold_ms, once()?)));
    // A leftover in the folder for temporary files is harmless.
    let _ = std::fs::remove_dir_all(&folder);
    let (cold_ms, (scene, cached_ms)) = both?;
    Ok(Started { thesis, scene, cold_ms, cached_ms })
}

/// The default settings, but without light between things: it is computed once for a scene, not in each start.
fn settings() -> RenderSettings {
    RenderSettings { light: LightModel::Direct, ..RenderSettings::default() }
}

/// A name, the way that it is compared with, and what is different from [`settings`].
type Way = (&'static str, usize, fn(&mut RenderSettings, &mut CullOptions));

const WAYS: [Way; 11] = [
    ("physically based", 2, |_, _| ()),
    ("physically based, everything", 0, |settings, _| settings.model = Model::Everything),
    ("Phong", 2, |settings, _| settings.shading = Shading::Phong),
    ("Phong, everything", 2, |settings, _| (settings.model, settings.shading) = (Model::Everything, Shading::Phong)),
    ("single scattering", 0, |settings, _| settings.scattering = Scattering::Single),
    ("back faces drawn", 0, |_, culling| culling.backs = false),
    ("no frustum culling", 0, |_, culling| culling.frusta = false),
    ("order as listed", 0, |_, culling| culling.order = Order::Listed),
    ("back faces drawn, order as listed", 0, |_, culling| (culling.backs, culling.order) = (false, Order::Listed)),
    ("open light", 0, |settings, _| settings.light = LightModel::Open),
    ("baked light", 9, |settings, _| settings.light = LightModel::Baked),
];
/// The first of them, which the chart shows.
const CHARTED: usize = 4;

impl Started {
    /// Draws every way interleaved.
    fn measure(&self, context: &Context, view: View, budget: Budget) -> Result<Vec<Row>> {
        let Self { thesis, scene, cold_ms, cached_ms } = self;
        let mut benches = Vec::new();
        for (_, _, change) in WAYS {
            let (mut settings, mut culling) = (settings(), CullOptions::default());
            change(&mut settings, &mut culling);
            let mut bench = Bench::new(context, scene, settings, view.size, view.eyes(scene))?;
            bench.inputs.culling = culling;
            benches.push(bench);
        }
        let times = interleaved(&mut benches.iter_mut().collect::<Vec<_>>(), budget)?;
        let pictures = benches.iter().map(Bench::display).collect::<Result<Vec<_>>>()?;
        let size = [view.size[0], view.size[1] * view.eyes];
        let mut rows = Vec::new();
        for (i, (way, against, _)) in WAYS.into_iter().enumerate() {
            let ratio = ratio(&context.gpu, &times[against], &times[i]);
            let Some((cost, ratio)) = Cost::of(&times[i]).zip(ratio) else { continue };
            let (test, reference) = (&pictures[i], &pictures[against]);
            let steps = test.iter().flatten().zip(reference.iter().flatten()).map(|(a, b)| a.abs_diff(*b));
            rows.push(Row {
                scene: thesis.name,
                triangles: scene.triangles(),
                thesis_triangles: thesis.triangles,
                view: view.name,
                size: view.size,
                way,
                draws: benches[i].renderer.draw_counts().calls,
                cost,
                fps: 1e3 / cost.gpu_ms.median.max(cost.record_ms.median),
                thesis_fps: thesis.fps[view.eyes as usize - 1],
                texture_mib: benches[i].renderer.texture_facts().bytes as f64 / f64::from(1 << 20),
                cold_ms: *cold_ms,
                cached_ms: *cached_ms,
                against: WAYS[against].0,
                times: ratio,
                flip_mean: flip(size, test, reference, PIXELS_PER_DEGREE).ok_or_else(size_error)?.mean,
                largest_step: steps.max().unwrap_or(0),
            });
        }
        Ok(rows)
    }
}

fn write(folder: &Path, results: &Results) -> Result<()> {
    let columns = "scene triangles thesis_triangles view size_0 size_1 way draws frames gpu_ms_median gpu_ms_low gpu_ms_high \
                   cpu_ms_median record_ms_median fps thesis_fps texture_mib cold_ms cached_ms against times_median flip_mean largest_step";
    let mut notes = vec![
        "Thesis: GTX 1070 (i7-6700, Windows 10; stereo: HTC Vive, 1080×1200 per eye, 90 Hz). Frames a second are what the slower of GPU \
         and recording thread allows; times are medians, low and high deciles."
            .into(),
    ];
    notes.extend(results.warnings.iter().map(|warning| format!("Left out: {warning}")));
    write_table(folder, "scenes", &notes, &results.rows, columns)?;
    write_json(folder, "scenes", results)
}

/// GPU times: a line for each scene, a mark for each way of drawing.
fn plot(results: &Results) -> Plot {
    let Results { machine: Machine { gpu, date, .. }, rows, .. } = results;
    let mut names = Vec::new();
    let mut panel = |view: &str| {
        let own = rows.iter().filter(|row| row.view == view && WAYS[..CHARTED].iter().any(|way| way.0 == row.way));
        let point = |row: &Row| {
            let Spread { median, low, high } = row.cost.gpu_ms;
            let point = Point { x: median, x_range: Some([low, high]), ..Point::default() };
            (row.way.to_owned(), Mark::Circle, row.scene.to_owned(), point)
        };
        let [width, height] = rows.iter().find(|row| row.view == view).map_or([0; 2], |row| row.size);
        let each = if view == "stereo" { " per eye" } else { "" };
        Panel::named(&format!("{view}, {width}×{height}{each}"), "ms", &mut names, own.map(point))
    };
    let caption = format!("{gpu}, {date}. Marks: medians; lines: from the first to the last decile.");
    let panels = vec![panel("desktop"), panel("stereo")];
    Plot { title: "GPU time of a frame".into(), panels, caption: vec![caption], key: Vec::new() }
}
