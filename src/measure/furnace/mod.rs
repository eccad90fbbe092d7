//! The white furnace: surfaces that absorb nothing must come out as bright as even light all around.
//!
//! As the renderer draws them, they reflect 1 by construction, whatever its table holds: F0 A + B, and the rest of 1. That the
//! BRDF itself does so is shown by integration: the reference picture samples D, V, F, the diffuse part and further bounces as
//! functions of l and v, and their sum is 1 only if the table holds what they integrate to. An error in V, with which the table
//! is made, cancels there; it shows in single scattering, compared with F0 A + B as integrated in f64.

mod picture;
mod scene;

use glam::DVec3;
use serde::Serialize;

use super::bench::Bench;
use super::machine::Machine;
use super::report::{write_json, write_table};
use super::request::MeasureRequest;
use crate::context::Context;
use crate::reference::brdf::{DIELECTRIC_F0, Geometry};
use crate::reference::energy::Scattering;
use crate::reference::table::specular_albedo;
use crate::render::{LightModel, RenderSettings, Shading};
use crate::{Result, say};
use scene::{Grid, bench, share};

/// Frames of 8 samples a pixel that are integrated.
const FRAMES: usize = 600;

/// One surface seen from one direction.
#[derive(Clone, Copy, Debug, Serialize)]
struct Row {
    method: &'static str,
    scattering: &'static str,
    base_color: f64,
    metallic: f64,
    roughness: f64,
    n_dot_v: f64,
    /// Share of the light that is reflected.
    reflected: f64,
    /// The standard error of `reflected`, if it was integrated: from the spread of the patch's independent pixels.
    standard_error: Option<f64>,
    expected: f64,
}

/// A summary of all surfaces for one method.
fn summary(rows: &[Row]) -> String {
    let most = |f: fn(&Row) -> f64| rows.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
    let (least, largest) = (-most(|row| -row.reflected), most(|row| row.reflected));
    let off = 100.0 * most(|row| (row.reflected - row.expected).abs());
    let error = 100.0 * most(|row| row.standard_error.unwrap_or(0.0));
    let (count, [method, scattering]) = (rows.len(), rows.first().map_or([""; 2], |row| [row.method, row.scattering]));
    format!(
        "{count} surfaces {method}, {scattering} scattering: {least:.4} to {largest:.4} of the light is reflected, off by {off:.2} % at \
         most; standard error {error:.3} %"
    )
}

#[derive(Serialize)]
struct Results {
    #[serde(flatten)]
    machine: Machine,
    summary: Vec<String>,
    rows: Vec<Row>,
}

/// Measures and writes `furnace.csv`, `furnace.json` and `furnace.png`.
pub fn run(request: &MeasureRequest, context: &Context) -> Result<()> {
    let folder = request.folder();
    picture::draw(context)?.write(&folder.join("furnace.png"))?;
    let mut results = Results { machine: Machine::new(&context.gpu), summary: vec![], rows: vec![] };
    let keep = |results: &mut Results, rows: Vec<Row>| {
        results.summary.push(summary(&rows));
        say!("{}", summary(&rows));
        results.rows.extend(rows);
    };
    let bar = context.report.progress("furnace", 2 + 2 * FRAMES as u64);
    for scattering in [Scattering::Single, Scattering::Multiple] {
        keep(&mut results, drawn(context, scattering)?);
        bar.inc(1);
        keep(&mut results, integrated(context, scattering, FRAMES)?);
        bar.inc(FRAMES as u64);
    }
    bar.finish_and_clear();
    let columns = "method scattering base_color metallic roughness n_dot_v reflected standard_error expected";
    write_table(folder, "furnace", &results.summary, &results.rows, columns)?;
    write_json(folder, "furnace", &results)
}

/// 21 × 11 × 16 roughnesses, metalnesses and views as the renderer draws them.
fn drawn(context: &Context, scattering: Scattering) -> Result<Vec<Row>> {
    const METALNESSES: usize = 11;
    let lines = (0..METALNESSES).map(|line| [1.0, share(line, METALNESSES)]).collect();
    let grid = Grid { roughnesses: 21, views: 16, lines, patch: 4 };
    let settings = RenderSettings { scattering, samples: 1, light: LightModel::Open, ..RenderSettings::default() };
    let mut bench = bench(context, &grid.scene(), grid.pixels(), settings)?;
    bench.draw()?;
    rows(&grid, &bench, "drawn", scattering)
}

/// White dielectric, half metal and metal; of what scatters once, white metal, F0 = 1, and black dielectric, F0 = 0.04, which
/// tell A from B.
fn integrated(context: &Context, scattering: Scattering, frames: usize) -> Result<Vec<Row>> {
    let lines = match scattering {
        Scattering::Single => vec![[1.0, 1.0], [0.0, 0.0]],
        Scattering::Multiple => vec![[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]],
    };
    let grid = Grid { roughnesses: 11, views: 8, lines, patch: 16 };
    let settings = RenderSettings {
        scattering,
        shading: Shading::Reference,
        light: LightModel::Open,
        ..RenderSettings::default()
    };
    let mut bench = bench(context, &grid.scene(), grid.pixels(), settings)?;
    for _ in 0..frames {
        bench.draw()?;
    }
    rows(&grid, &bench, "integrated", scattering)
}

fn rows(grid: &Grid, bench: &Bench, method: &'static str, scattering: Scattering) -> Result<Vec<Row>> {
    let (picture, is_integrated) = (bench.radiance()?, method == "integrated");
    let name = if scattering == Scattering::Single { "single" } else { "multiple" };
    let mut rows = Vec::new();
    for (line, [color, metallic]) in grid.lines.iter().enumerate() {
        let [base_color, metallic] = [*color, *metallic].map(f64::from);
        for column in 0..grid.columns() {
            let [roughness, n_dot_v] = grid.at(column).map(f64::from);
            let [reflected, error] = mean_and_error(grid.patch(&picture, [column, line]));
            let expected = match scattering {
                Scattering::Single if is_integrated => {
                    let f0 = DIELECTRIC_F0 + metallic * (base_color - DIELECTRIC_F0);
                    specular_albedo(DVec3::splat(f0), n_dot_v, roughness, Geometry::Smith).x
                }
                _ => 1.0,
            };
            let standard_error = is_integrated.then_some(error);
            rows.push(Row {
                method,
                scattering: name,
                base_color,
                metallic,
                roughness,
                n_dot_v,
                reflected,
                standard_error,
                expected,
            });
        }
    }
    Ok(rows)
}

/// The standard error of the mean of independent numbers.
fn mean_and_error(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let squares = values.map(|value| (value - mean).powi(2)).sum::<f64>();
    [mean, (squares / (count * (count - 1.0))).sqrt()]
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::precompute::harness_tests::with_gpu;
    use crate::reference::energy::furnace;

    /// Case 20 of tests/gpu/stability.rs: the renderer itself. Its terms add up to 1 by construction; what they hold is tested by
    /// integration below.
    #[test]
    fn the_renderer_s_furnace_hides_every_white_surface() {
        let [single, multiple] = [Scattering::Single, Scattering::Multiple]
            .map(|scattering| with_gpu(|gpu| drawn(&Context::silent(gpu), scattering).unwrap()));
        assert_eq!([single.len(), multiple.len()], [21 * 11 * 16; 2]);
        println!("{}\n{}", summary(&single), summary(&multiple));
        assert!(multiple.iter().all(|row| (row.reflected - 1.0).abs() < 0.005));
        assert!(single.iter().any(|row| row.reflected < 0.5) && single.iter().all(|row| row.reflected < 1.005));
        for (rows, scattering) in [(single, Scattering::Single), (multiple, Scattering::Multiple)] {
            for row in rows.iter().step_by(397) {
                let truth = furnace(DVec3::ONE, row.metallic, row.roughness, row.n_dot_v, scattering).x;
                assert!((row.reflected - truth).abs() < 0.005, "{row:?} is not {truth}");
            }
        }
    }

    /// Case 20 of tests/gpu/stability.rs: what the BRDF's terms add up to, not what they were built to add up to.
    #[test]
    fn the_sampled_brdf_reflects_all_light_and_scatters_once_what_the_table_says() {
        let [single, multiple] = [Scattering::Single, Scattering::Multiple]
            .map(|scattering| with_gpu(|gpu| integrated(&Context::silent(gpu), scattering, 300).unwrap()));
        assert_eq!([single.len(), multiple.len()], [2 * 11 * 8, 3 * 11 * 8]);
        for row in &multiple {
            assert!(row.standard_error.unwrap() < 0.0016, "too noisy to be judged: {row:?}");
            assert!((row.reflected - 1.0).abs() < 0.005, "{row:?}");
        }
        for row in &single {
            let bound = 4.5 * row.standard_error.unwrap() + 3e-4;
            assert!((row.reflected - row.expected).abs() < bound, "{row:?}: beyond {bound}");
        }
    }
}
