//! Errors by cause: one approximation after the other replaced by what is exact, for a ball and for pictures.

mod ball;
mod chain;
mod chart;
mod picture;
mod stored;
mod sums;
mod table;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::clock::today;
use super::{MeasureRequest, synthetic};
use crate::asset::{Panorama, Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::precompute::Options;
use crate::{Result, say};
use ball::Ball;
use picture::Bench;

/// Measured where no scene is named.
const SCENES: [&str; 2] = ["teapot", "sphere"];

/// What a row compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Swap {
    /// As it is, but for one cause, which is exact.
    ReferenceAccumulator,
    /// ReferenceAccumulator but for the causes up to this one: the differences of these errors add up to the whole.
    Chain,
    /// As it is, but for one setting, which is another.
    Other,
    /// As it is.
    Whole,
    /// What the exact one is itself off by.
    Floor,
}

/// What one swap does by one measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Change {
    /// From one to the other.
    change: f64,
    /// Against the exact one: with the approximation, and with what it was swapped for.
    error: f64,
    error_swapped: f64,
    /// The difference; below 0 where two causes had cancelled each other.
    falls_by: f64,
}

impl Change {
    fn of(change: f64, error: f64, error_swapped: f64) -> Self {
        Self { change, error, error_swapped, falls_by: error - error_swapped }
    }
}

/// One cause of one subject.
#[derive(Clone, Debug, Serialize)]
struct Row {
    kind: Kind,
    /// A panorama and a material, or a scene.
    subject: String,
    swap: Swap,
    cause: String,
    /// What is there, and what it was swapped for.
    is: String,
    swapped: String,
    /// Of a ball: mean of |difference| over the exact radiance. Of a picture: FLIP; none where that cannot tell.
    main: Option<Change>,
    /// Of a picture: relative MSE of display light.
    relative_mse: Option<Change>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Ball,
    Picture,
}

impl Row {
    fn ball(subject: &str, swap: Swap, [cause, is, swapped]: [&str; 3], change: Change) -> Self {
        let [subject, cause, is, swapped] = [subject, cause, is, swapped].map(str::to_owned);
        Self { kind: Kind::Ball, subject, swap, cause, is, swapped, main: Some(change), relative_mse: None }
    }
}

/// Everything that was measured.
#[derive(Serialize)]
struct Results {
    gpu: String,
    driver: String,
    date: String,
    /// Of the pictures.
    size: [u32; 2],
    rows: Vec<Row>,
}

/// Measures, and after each row writes `causes.csv`, `causes.json` and `causes.md`; at the end `causes.svg`.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let extent = if request.full { picture::FULL } else { picture::QUICK };
    let mut results = Results {
        gpu: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        date: today(),
        size: request.picture.unwrap_or(extent.size),
        rows: Vec::new(),
    };
    let mut keep = |rows: Vec<Row>| {
        results.rows.extend(rows);
        table::write(request.output, &results)
    };
    balls(request, &gpu, report, &mut keep)?;
    for path in scenes(request)? {
        Bench::new(&gpu, &path, request, extent, report)?.measure(&mut keep)?;
    }
    chart::write(request.output, &results)?;
    table::largest(&results.rows).iter().for_each(|line| say!("pbr-vr: {line}"));
    drop(gpu);
    messages.check()
}

fn balls(
    request: &MeasureRequest<'_>,
    gpu: &Arc<Gpu>,
    report: &Report,
    keep: &mut impl FnMut(Vec<Row>) -> Result<()>,
) -> Result<()> {
    let grid = if request.full { ball::FULL } else { ball::QUICK };
    let panoramas = panoramas(request, grid.width, report)?;
    let size = request.sizes.first().copied().unwrap_or(Options::default().face_size);
    let bar = report.stage("balls", panoramas.len() as u64);
    for panorama in &panoramas {
        let rows = Ball::new(gpu, panorama, size, &grid, request.cache)?.rows(&grid)?;
        keep(rows)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

/// Those named, else one with a sun and the shipped ones, in the size of the grid.
fn panoramas(request: &MeasureRequest<'_>, width: u32, report: &Report) -> Result<Vec<Panorama>> {
    let load = |path: &Path| Ok(smaller(Panorama::load(path, report)?, width));
    if !request.panoramas.is_empty() {
        return request.panoramas.iter().map(|path| load(path)).collect();
    }
    let folder = shipped::folder()?;
    let shipped = shipped::PANORAMAS.iter().map(|name| load(&folder.join(name)));
    [Ok(synthetic::panorama(width, true))].into_iter().chain(shipped).collect()
}

/// Of half the size until it is no wider than this; four texels become one.
fn smaller(mut panorama: Panorama, width: u32) -> Panorama {
    while panorama.width > width && panorama.width.is_multiple_of(2) && panorama.height.is_multiple_of(2) {
        let (half, height) = (panorama.width / 2, panorama.height / 2);
        let texel = |x: u32, y: u32| glam::Vec3::from(panorama.texels[(y * panorama.width + x) as usize]);
        let mean = |i: u32| {
            let (x, y) = (2 * (i % half), 2 * (i / half));
            ((texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) / 4.0).to_array()
        };
        let texels = (0..half * height).map(mean).collect();
        panorama = Panorama { name: panorama.name, width: half, height, texels };
    }
    panorama
}

fn scenes(request: &MeasureRequest<'_>) -> Result<Vec<PathBuf>> {
    if !request.scenes.is_empty() {
        return Ok(request.scenes.to_vec());
    }
    let folder = shipped::folder()?.join("scenes");
    Ok(SCENES.iter().map(|name| folder.join(name).with_extension("toml")).collect())
}

#[cfg(test)]
#[path = "causes_tests.rs"]
mod gpu_tests;
