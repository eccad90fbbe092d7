//! The sweep over every way to fill the irradiance and specular maps.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::clock::{cpu_ms, today};
use super::maps::{IRRADIANCE, Map, own_maps, own_ms, read_cube, specular_targets};
use super::table::{Csv, Row, Sweep};
use super::texels::{Accuracy, Texel, prefiltered_truth, spread_texels};
use super::{MeasureRequest, chart, judge, synthetic};
use crate::asset::file::write_atomically;
use crate::asset::{Panorama, Report, shipped};
use crate::gpu::{Gpu, GpuOptions, Image, PassTime};
use crate::precompute::alternatives::{AlternativePass, Environment, Method, Quantity, Target};
use crate::precompute::{LightMaps, Options};
use crate::{Error, Result};

/// The ways by name: the program's own, then the usual ones.
pub const METHODS: [&str; 6] =
    ["ours", "monte-carlo", "filtered-sampling", "fixed-step", "fixed-step-without-sine", "spherical-harmonics"];

/// What `error` means in the results.
const ERROR: &str = "|value - truth| / truth of a texel, both summed over RGB; truth: f64 sum over all panorama texels";

/// Runs of one method, of which the fastest counts; one is enough where a run takes long.
const RUNS: u32 = 3;
const LONG_MS: f64 = 500.0;

/// How much is measured.
struct Extent {
    sizes: Vec<u32>,
    methods: Vec<Method>,
    ours: bool,
    /// Texels judged of each map.
    texels: usize,
}

impl Extent {
    fn new(request: &MeasureRequest<'_>) -> Self {
        let (default_sizes, log2_samples, steps, texels): (&[u32], &[u32], &[f32], usize) = if request.full {
            (&[128, 256, 512], &[4, 5, 6, 7, 8, 9, 10], &[0.2, 0.1, 0.05, 0.025, 0.0125], 1536)
        } else {
            (&[128, 256], &[4, 6, 8], &[0.2, 0.1, 0.05], 96)
        };
        let sizes = if request.sizes.is_empty() { default_sizes } else { request.sizes }.to_vec();
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
        Self { sizes, methods, ours: wanted("ours"), texels }
    }
}

/// Maps of one method, and what they took.
struct Made {
    method: String,
    parameter: String,
    cube_size: u32,
    maps: Vec<Map>,
    /// By quantity.
    gpu_ms: HashMap<Quantity, f64>,
    cpu_ms: Option<f64>,
}

/// Measures and writes `precompute.csv`, `precompute.json` and one chart for each panorama and size.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let extent = Extent::new(request);
    let panoramas = sources(request)?;
    let mut csv = Csv::new(&request.output.join("precompute.csv"))?;
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let mut sweep = Sweep {
        gpu: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        date: today(),
        error: ERROR,
        rows: Vec::new(),
        charts: Vec::new(),
        warnings: Vec::new(),
    };
    let steps = panoramas.len() * extent.sizes.len() * (extent.methods.len() + usize::from(extent.ours));
    let bar = report.progress("measuring", steps as u64);
    for source in &panoramas {
        let panorama = source.load(report)?;
        let mut truths = Truths { panorama: &panorama, most: extent.texels, known: HashMap::new() };
        let mut keep = |made: Made| -> Result<()> {
            let rows = truths.judge(&panorama.name, made);
            csv.add(&rows)?;
            sweep.rows.extend(rows);
            Ok(())
        };
        if let Some(folder) = request.judge {
            let maps = judge::read_maps(folder, report)?;
            keep(foreign(maps))?;
        }
        for size in &extent.sizes {
            let (light, ours) = own(&gpu, &panorama, *size)?;
            if extent.ours {
                keep(ours)?;
                bar.inc(1);
            }
            let environment = fastest(|| {
                let environment = Environment::new(&gpu, &light.panorama, light.scale, *size)?;
                let ms = total(&environment.times);
                Ok((environment, ms))
            })?;
            for method in &extent.methods {
                keep(alternative(&gpu, &environment, *size, *method)?)?;
                bar.inc(1);
            }
        }
    }
    bar.finish_and_clear();
    drop(gpu);
    messages.check()?;
    sweep.charts = chart::write_all(request.output, &sweep)?;
    sweep.warnings = report.warnings();
    let path = request.output.join("precompute.json");
    let text = serde_json::to_string_pretty(&sweep).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

/// Where a panorama comes from; loaded one at a time.
enum Source {
    Synthetic { sun: bool },
    File(PathBuf),
}

impl Source {
    fn load(&self, report: &Report) -> Result<Panorama> {
        match self {
            Self::Synthetic { sun } => Ok(synthetic::panorama(synthetic::WIDTH, *sun)),
            Self::File(path) => Panorama::load(path, report),
        }
    }
}

fn sources(request: &MeasureRequest<'_>) -> Result<Vec<Source>> {
    if !request.panoramas.is_empty() {
        return Ok(request.panoramas.iter().cloned().map(Source::File).collect());
    }
    let folder = shipped::folder()?;
    let files = shipped::PANORAMAS.map(|name| Source::File(folder.join(name)));
    Ok([Source::Synthetic { sun: true }, Source::Synthetic { sun: false }].into_iter().chain(files).collect())
}

/// The fastest of several runs, with its GPU and processor time.
struct Fastest<T> {
    made: T,
    ms: f64,
    cpu_ms: Option<f64>,
}

/// Runs `work`, which also tells its GPU time, `RUNS` times, or once if that took long.
fn fastest<T>(mut work: impl FnMut() -> Result<(T, f64)>) -> Result<Fastest<T>> {
    let mut run = || {
        let before = cpu_ms();
        let (made, ms) = work()?;
        Ok(Fastest { made, ms, cpu_ms: cpu_ms().zip(before).map(|(now, before)| now - before) })
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

/// The program's own stage.
fn own(gpu: &Arc<Gpu>, panorama: &Panorama, size: u32) -> Result<(LightMaps, Made)> {
    let options = Options { face_size: size, ..Options::default() };
    let Fastest { made: light, cpu_ms, .. } = fastest(|| {
        let light = LightMaps::new(gpu, panorama, &options)?;
        let ms = total(&light.times);
        Ok((light, ms))
    })?;
    let gpu_ms = [Quantity::Specular, Quantity::Irradiance].map(|q| (q, own_ms(&light.times, q)));
    let made = Made {
        method: "ours".into(),
        parameter: String::new(),
        cube_size: size,
        maps: own_maps(gpu, &light)?,
        gpu_ms: gpu_ms.into(),
        cpu_ms,
    };
    Ok((light, made))
}

/// One of the usual ways, from a cube of `size`.
fn alternative(gpu: &Arc<Gpu>, environment: &Fastest<Environment>, size: u32, method: Method) -> Result<Made> {
    let quantity = method.quantity();
    let targets: Vec<(u32, Target)> = match quantity {
        Quantity::Specular => specular_targets(size),
        Quantity::Irradiance => vec![(0, IRRADIANCE)],
    };
    let only: Vec<Target> = targets.iter().map(|(_, target)| *target).collect();
    let job = AlternativePass::new(gpu, &environment.made, method, &only)?;
    let own = fastest(|| Ok(((), total(&job.run(gpu)?))))?;
    let map = |(cube, (level, target)): (&Arc<Image>, &(u32, Target))| {
        let texels = read_cube(gpu, cube, 0, environment.made.scale)?;
        Ok(Map { quantity, level: *level, target: *target, texels })
    };
    Ok(Made {
        method: method.name().into(),
        parameter: method.parameter(),
        cube_size: size,
        maps: job.cubes.iter().zip(&targets).map(map).collect::<Result<_>>()?,
        gpu_ms: [(quantity, environment.ms + own.ms)].into(),
        cpu_ms: own.cpu_ms.zip(environment.cpu_ms).map(|(a, b)| a + b),
    })
}

fn foreign(maps: Vec<Map>) -> Made {
    let cube_size = maps.iter().filter(|m| m.level == 0).map(|m| m.target.size).max().unwrap_or(0);
    let maps = maps.into_iter().filter(|map| map.target.alpha > 0.0).collect();
    Made { method: "cmgen".into(), parameter: String::new(), cube_size, maps, gpu_ms: HashMap::new(), cpu_ms: None }
}

fn total(times: &[PassTime]) -> f64 {
    times.iter().map(|pass| pass.ms).sum()
}

/// What maps of one panorama should hold, computed once for each lobe and size.
struct Truths<'a> {
    panorama: &'a Panorama,
    most: usize,
    known: HashMap<(u64, u32), (Vec<Texel>, Vec<DVec3>)>,
}

impl Truths<'_> {
    fn judge(&mut self, panorama: &str, made: Made) -> Vec<Row> {
        let mut rows = Vec::new();
        for map in &made.maps {
            let Target { alpha, size } = map.target;
            let (texels, truths) = self.known.entry((alpha.to_bits(), size)).or_insert_with(|| {
                let texels = spread_texels(size, self.most);
                let truths = prefiltered_truth(self.panorama, &texels, size, alpha);
                (texels, truths)
            });
            let values: Vec<DVec3> = texels.iter().map(|texel| Vec3::from(map.at(*texel)).as_dvec3()).collect();
            rows.push(Row {
                panorama: panorama.to_owned(),
                cube_size: made.cube_size,
                method: made.method.clone(),
                parameter: made.parameter.clone(),
                quantity: map.quantity,
                level: map.level,
                alpha,
                face_size: size,
                judged: values.len(),
                error: Accuracy::new(&values, truths),
                gpu_ms: made.gpu_ms.get(&map.quantity).copied(),
                cpu_ms: made.cpu_ms,
            });
        }
        rows
    }
}
