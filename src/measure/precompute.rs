//! Time and error of every way to fill the irradiance and specular maps.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::cmgen;
use super::machine::{Machine, cpu_ms};
use super::maps::{IRRADIANCE, Map, own_maps, own_ms, specular_targets};
use super::pareto::{Score, front};
use super::plot::{Mark, Panel, Plot, Point, Series, YAxis};
use super::report::{stem, write_json, write_table};
use super::request::MeasureRequest;
use super::sums::Sums;
use super::texels::{Accuracy, spread_texels, texel_direction};
use crate::asset::picture::Picture;
use crate::asset::{Panorama, synthetic_panorama};
use crate::context::Context;
use crate::gpu::{Gpu, Image, PassTime};
use crate::precompute::alternatives::{AlternativePass, Environment, Method, Quantity, Target};
use crate::precompute::{CubeTexels, LightMaps, Options};
use crate::reference::levels::alpha_from_level;
use crate::{Result, say};

/// The ways by name: the renderer's own, then the usual ones.
pub const METHODS: [&str; 6] =
    ["ours", "monte-carlo", "filtered-sampling", "fixed-step", "fixed-step-without-sine", "spherical-harmonics"];
/// Texels across the synthetic panoramas.
const WIDTH: u32 = 2048;

/// Runs of one method, of which the fastest counts; one is enough where a run takes long.
const RUNS: u32 = 3;
const LONG_MS: f64 = 500.0;

/// One map of one method.
#[derive(Clone, Debug, Serialize)]
struct Row {
    panorama: String,
    /// Texels along a face of the environment's cube.
    cube_size: u32,
    method: String,
    /// Samples, step in radians, or degree; empty for methods without.
    parameter: String,
    quantity: Quantity,
    level: u32,
    alpha: f64,
    /// Texels along a face of this map.
    face_size: u32,
    /// The number of judged texels.
    judged: usize,
    #[serde(flatten)]
    error: Accuracy,
    /// GPU time for all of this quantity's maps together, cube and mips included; `None` for other programs' maps.
    gpu_ms: Option<f64>,
    /// Processor time of the process for the same; for `ours` for both quantities, upload and pipelines included.
    cpu_ms: Option<f64>,
}

#[derive(Serialize)]
struct Results {
    #[serde(flatten)]
    machine: Machine,
    rows: Vec<Row>,
    warnings: Vec<String>,
}

/// Sizes and numbers of samples.
struct Sweep {
    sizes: Vec<u32>,
    methods: Vec<Method>,
    ours: bool,
    /// Of the texels judged of each face of each map.
    log2_texels: u32,
}

impl Sweep {
    fn new(request: &MeasureRequest) -> Self {
        let (default_sizes, log2_samples, steps, log2_texels): (&[u32], &[u32], &[f32], u32) = if request.full {
            (&[128, 256, 512], &[4, 5, 6, 7, 8, 9, 10], &[0.2, 0.1, 0.05, 0.025, 0.0125], 8)
        } else {
            (&[128, 256], &[4, 6, 8], &[0.2, 0.1, 0.05], 4)
        };
        let sizes = if request.sizes.is_empty() { default_sizes } else { &request.sizes }.to_vec();
        let wanted = |name: &str| request.methods.is_empty() || request.methods.iter().any(|m| m == name);
        let mut methods: Vec<Method> = log2_samples
            .iter()
            .flat_map(|&log2_samples| [Method::MonteCarlo { log2_samples }, Method::FilteredSampling { log2_samples }])
            .collect();
        for with_sine in [true, false] {
            methods.extend(steps.iter().map(|&step_radians| Method::FixedStep { step_radians, with_sine }));
        }
        methods.extend([2, 4, 6, 8].map(|order| Method::Harmonics { order }));
        methods.retain(|method| wanted(method.name()));
        Self { sizes, methods, ours: wanted("ours"), log2_texels }
    }
}

/// Maps of one method and their times.
struct Filled {
    method: String,
    parameter: String,
    cube_size: u32,
    maps: Vec<Map>,
    /// By quantity: specular, irradiance.
    gpu_ms: [Option<f64>; 2],
    cpu_ms: Option<f64>,
}

/// Measures and writes `precompute.csv`, `precompute.json` and one chart for each panorama and size.
pub fn run(request: &MeasureRequest, context: &Context) -> Result<()> {
    let Context { gpu, report, .. } = context;
    let (sweep, folder) = (Sweep::new(request), request.folder());
    let files = request.panorama_files()?;
    let suns: &[bool] = if request.panoramas.is_empty() { &[true, false] } else { &[] };
    let synthetic = suns.iter().map(|sun| Ok(synthetic_panorama(WIDTH, *sun)));
    let mut results = Results { machine: Machine::new(gpu), rows: vec![], warnings: vec![] };
    let steps = (files.len() + suns.len()) * sweep.sizes.len() * (sweep.methods.len() + usize::from(sweep.ours));
    let bar = report.progress("measuring", steps as u64);
    for panorama in synthetic.chain(files.iter().map(|path| Panorama::load(path, report))) {
        let panorama = panorama?;
        let mut sums = Sums::new(&panorama)?;
        let mut keep = |results: &mut Results, filled: Filled| {
            results.rows.extend(judge(filled, &panorama.name, &mut sums, sweep.log2_texels));
            write(folder, &results.rows)
        };
        if let Some(folder) = &request.judge {
            keep(&mut results, foreign(cmgen::read_maps(folder)?))?;
        }
        for size in &sweep.sizes {
            let (light, ours) = own(gpu, &panorama, *size)?;
            if sweep.ours {
                keep(&mut results, ours)?;
                bar.inc(1);
            }
            let environment = fastest(|| {
                let environment = Environment::new(gpu, &light.panorama, light.scale, *size)?;
                let ms = total(&environment.times);
                Ok((environment, ms))
            })?;
            for method in &sweep.methods {
                keep(&mut results, alternative(gpu, &environment, *size, *method)?)?;
                bar.inc(1);
            }
            let name = format!("precompute-{}-{size}", stem(&panorama.name));
            chart(&results, &panorama.name, *size).write(folder, &name)?;
        }
    }
    bar.finish_and_clear();
    results.warnings = report.warnings();
    write_json(folder, "precompute", &results)
}

fn write(folder: &Path, rows: &[Row]) -> Result<()> {
    let columns =
        "panorama cube_size method parameter quantity level alpha face_size judged mean p95 max gpu_ms cpu_ms";
    let note =
        "Error: |value - truth| / truth of a texel, both summed over RGB; truth: f64 sum over all panorama texels.";
    write_table(folder, "precompute", &[note.into()], rows, columns)
}

/// Writes the synthetic panoramas, `synthetic.exr` and `synthetic-sun.exr`.
pub fn write_panoramas(folder: &Path) -> Result<()> {
    for sun in [false, true] {
        let Panorama { name, width, height, texels } = synthetic_panorama(WIDTH, sun);
        let rgba: Vec<[f32; 4]> = texels.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
        let path = folder.join(format!("{name}.exr"));
        Picture::from_radiance(name, width, height, &rgba).write(&path)?;
        say!("{}", path.display());
    }
    Ok(())
}

/// The result of the fastest of several runs, with its GPU and processor time.
struct Fastest<T> {
    result: T,
    ms: f64,
    cpu_ms: Option<f64>,
}

/// Runs `work`, which also returns its GPU time, [`RUNS`] times, or once if that took long.
fn fastest<T>(mut work: impl FnMut() -> Result<(T, f64)>) -> Result<Fastest<T>> {
    let mut run = || {
        let before = cpu_ms();
        let (result, ms) = work()?;
        Ok(Fastest { result, ms, cpu_ms: cpu_ms().zip(before).map(|(now, before)| now - before) })
    };
    let mut best = run()?;
    for _ in 1..RUNS {
        if best.ms > LONG_MS {
            break;
        }
        let next = run()?;
        if next.ms < best.ms {
            best = next;
        }
    }
    Ok(best)
}

/// The renderer's own maps.
fn own(gpu: &Arc<Gpu>, panorama: &Panorama, size: u32) -> Result<(LightMaps, Filled)> {
    let options = Options { face_size: size, ..Options::default() };
    let Fastest { result: light, cpu_ms, .. } = fastest(|| {
        let light = LightMaps::new(&Context::silent(gpu), panorama, options)?;
        let ms = total(&light.times);
        Ok((light, ms))
    })?;
    let gpu_ms = [Quantity::Specular, Quantity::Irradiance].map(|quantity| Some(own_ms(&light.times, quantity)));
    let (levels, irradiance) = own_maps(gpu, &light)?;
    let specular = (0..).zip(levels).skip(1).map(|(level, cube)| Map {
        quantity: Quantity::Specular,
        level,
        alpha: alpha_from_level(level as usize),
        cube,
    });
    let irradiance = Map { quantity: Quantity::Irradiance, level: 0, alpha: IRRADIANCE.alpha, cube: irradiance };
    let maps = specular.chain([irradiance]).collect();
    let filled = Filled { method: METHODS[0].into(), parameter: String::new(), cube_size: size, maps, gpu_ms, cpu_ms };
    Ok((light, filled))
}

/// One of the usual ways, from a cube of `size`.
fn alternative(gpu: &Arc<Gpu>, environment: &Fastest<Environment>, size: u32, method: Method) -> Result<Filled> {
    let quantity = method.quantity();
    let targets: Vec<(u32, Target)> = match quantity {
        Quantity::Specular => specular_targets(size),
        Quantity::Irradiance => vec![(0, IRRADIANCE)],
    };
    let only: Vec<Target> = targets.iter().map(|(_, target)| *target).collect();
    let pass = AlternativePass::new(gpu, &environment.result, method, &only)?;
    let own = fastest(|| Ok(((), total(&pass.run(gpu)?))))?;
    let map = |(cube, (level, target)): (&Arc<Image>, &(u32, Target))| {
        let cube = CubeTexels::read(gpu, cube, 0, environment.result.scale)?;
        Ok(Map { quantity, level: *level, alpha: target.alpha, cube })
    };
    Ok(Filled {
        method: method.name().into(),
        parameter: method.parameter(),
        cube_size: size,
        maps: pass.cubes.iter().zip(&targets).map(map).collect::<Result<_>>()?,
        gpu_ms: [Some(environment.ms + own.ms); 2],
        cpu_ms: own.cpu_ms.zip(environment.cpu_ms).map(|(a, b)| a + b),
    })
}

fn foreign(maps: Vec<Map>) -> Filled {
    let cube_size = maps.iter().filter(|m| m.level == 0).map(|m| m.cube.size).max().unwrap_or(0);
    let maps = maps.into_iter().filter(|map| map.alpha > 0.0).collect();
    Filled { method: "cmgen".into(), parameter: String::new(), cube_size, maps, gpu_ms: [None; 2], cpu_ms: None }
}

fn total(times: &[PassTime]) -> f64 {
    times.iter().map(|pass| pass.ms).sum()
}

/// The errors of maps against exact values (f64 sums over all of the panorama's texels).
fn judge(filled: Filled, name: &str, sums: &mut Sums<'_>, log2_texels: u32) -> Vec<Row> {
    let row = |map: &Map| {
        let texels = spread_texels(map.cube.size, log2_texels);
        let directions: Vec<DVec3> = texels.iter().map(|texel| texel_direction(*texel, map.cube.size)).collect();
        let truths: Vec<DVec3> = sums.settled(|sums| directions.iter().map(|d| sums.around(*d, map.alpha)).collect());
        let values: Vec<DVec3> = texels.iter().map(|texel| map.cube.at(*texel).truncate()).collect();
        Row {
            panorama: name.to_owned(),
            cube_size: filled.cube_size,
            method: filled.method.clone(),
            parameter: filled.parameter.clone(),
            quantity: map.quantity,
            level: map.level,
            alpha: map.alpha,
            face_size: map.cube.size,
            judged: values.len(),
            error: Accuracy::new(&values, &truths, &truths),
            gpu_ms: filled.gpu_ms[map.quantity as usize],
            cpu_ms: filled.cpu_ms,
        }
    };
    filled.maps.iter().map(row).collect()
}

/// The chart of one panorama and cube size.
fn chart(results: &Results, panorama: &str, size: u32) -> Plot {
    let Machine { gpu, date, .. } = &results.machine;
    let own: Vec<&Row> = results.rows.iter().filter(|row| row.panorama == panorama && row.cube_size == size).collect();
    Plot {
        title: format!("Filling light maps from {}, cube of {size}² texels a face", stem(panorama)),
        panels: vec![
            panel(&own, Quantity::Specular, "specular levels"),
            panel(&own, Quantity::Irradiance, "irradiance"),
        ],
        caption: vec![
            format!("{gpu}, {date}. Error: mean over maps of the texels' mean relative error against f64 sums."),
            "Labels: samples, step in radians, degree.".into(),
        ],
        key: Vec::new(),
    }
}

/// Error over time, a series for each method and one for the Pareto front.
fn panel(rows: &[&Row], quantity: Quantity, title: &str) -> Panel {
    let rows: Vec<&Row> = rows.iter().copied().filter(|row| row.quantity == quantity && row.gpu_ms.is_some()).collect();
    let mut series = vec![Series { name: "Pareto front".into(), colour: 6, mark: Mark::Band, ..Series::default() }];
    for (colour, method) in METHODS.into_iter().enumerate() {
        let own = || rows.iter().filter(|row| row.method == method);
        let mut points: Vec<Point> = Vec::new();
        for row in own() {
            if points.iter().any(|point| point.label == row.parameter) {
                continue;
            }
            let errors: Vec<f64> = own().filter(|o| o.parameter == row.parameter).map(|o| o.error.mean).collect();
            let y = 100.0 * errors.iter().sum::<f64>() / errors.len() as f64;
            points.push(Point { x: row.gpu_ms.unwrap_or(0.0), y, label: row.parameter.clone(), ..Point::default() });
        }
        if !points.is_empty() {
            series.push(Series { name: method.into(), colour, joined: true, points, ..Series::default() });
        }
    }
    let points: Vec<Point> = series.iter().flat_map(|series| &series.points).cloned().collect();
    let scores: Vec<Score> = points.iter().map(|point| Score { ms: point.x, error: point.y }).collect();
    let front = front(&scores).into_iter().map(|i| Point { label: String::new(), ..points[i].clone() });
    series[0].points = front.collect();
    Panel {
        title: title.into(),
        x_label: "GPU time, ms".into(),
        y: YAxis::Log("mean relative error, %".into()),
        series,
        floor: None,
    }
}
