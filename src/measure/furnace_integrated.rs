//! The white furnace by integration: the exact picture samples the BRDF's own terms, D, V and F, the diffuse part and further
//! bounces as functions of l and v. Their sum is 1 only if the table holds what D, V and F integrate to. What is wrong in V alike
//! for the table, which is made with it, still adds up to 1: it shows in single scattering, summed alike, beside F0 A + B as
//! integrated in f64.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::furnace::{Grid, draw_frames, patches};
use crate::asset::Report;
use crate::asset::file::write_atomically;
use crate::gpu::Gpu;
use crate::reference::brdf::{DIELECTRIC_F0, Geometry};
use crate::reference::energy::Scattering;
use crate::reference::table::specular_albedo;
use crate::render::{Settings, Shading};
use crate::{Result, say};

/// 0, 0.1 to 1.
const ROUGHNESSES: usize = 11;
/// n·v from 1/8 to 1.
const VIEWS: usize = 8;
/// Pixels along a patch's side; those at its edge are left out.
const PATCH: usize = 16;
/// Of 8 samples a pixel.
const FRAMES: usize = 600;
/// White dielectric, half metal, and metal: what they give back is 1.
const WHITE: [[f32; 2]; 3] = [[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]];
/// What has single scattering alone: white metal, F0 = 1, and black dielectric, F0 = 0.04, which tell A from B.
const MIRRORING: [[f32; 2]; 2] = [[1.0, 1.0], [0.0, 0.0]];

/// One surface seen from one side.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    pub albedo: f64,
    pub metallic: f64,
    pub roughness: f64,
    pub n_dot_v: f64,
    /// Share of the light that comes back.
    pub integrated: f64,
    /// Of `integrated`, from the spread of the patch's pixels, which are independent.
    pub standard_error: f64,
    /// What it should be.
    pub expected: f64,
}

/// All of one way of scattering.
#[derive(Clone, Debug, Serialize)]
pub struct Sums {
    pub least: f64,
    pub most: f64,
    /// Furthest from what is expected.
    pub off: f64,
    /// The largest one.
    pub standard_error: f64,
    pub rows: Vec<Row>,
}

/// What was integrated: surfaces that scatter once against F0 A + B, white ones that scatter as often as it takes against 1.
#[derive(Clone, Debug, Serialize)]
pub struct Integrated {
    /// Frames of 8 samples a pixel, and the pixels of a patch.
    pub frames: usize,
    pub pixels: usize,
    pub single: Sums,
    pub multiple: Sums,
}

impl Sums {
    fn of(rows: Vec<Row>) -> Self {
        let most = |f: fn(&Row) -> f64| rows.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
        Self {
            least: -most(|row| -row.integrated),
            most: most(|row| row.integrated),
            off: most(|row| (row.integrated - row.expected).abs()),
            standard_error: most(|row| row.standard_error),
            rows,
        }
    }
}

/// Integrates, and writes `furnace-integrated.csv`.
pub fn run(gpu: &Arc<Gpu>, folder: &Path, report: &Report) -> Result<Integrated> {
    let integrated = integrate(gpu, FRAMES, report)?;
    for (sums, what) in [(&integrated.multiple, "of the light comes back"), (&integrated.single, "scattered once")] {
        let Sums { least, most, off, standard_error, .. } = sums;
        let [off, standard_error] = [off, standard_error].map(|share| 100.0 * share);
        say!(
            "integrated: {least:.4} to {most:.4} {what}, off by {off:.2} % at most; standard error {standard_error:.3} %"
        );
    }
    let header = "scattering,albedo,metallic,roughness,n_dot_v,integrated,standard_error,expected\n".to_owned();
    let rows = [("single", &integrated.single), ("multiple", &integrated.multiple)];
    let rows = rows.into_iter().flat_map(|(name, sums)| sums.rows.iter().map(move |row| (name, row)));
    let csv = rows.fold(header, |text, (name, row)| {
        let Row { albedo, metallic, roughness, n_dot_v, integrated, standard_error, expected } = row;
        text + &format!("{name},{albedo},{metallic},{roughness:.1},{n_dot_v},")
            + &format!("{integrated:.5},{standard_error:.5},{expected:.5}\n")
    });
    write_atomically(&folder.join("furnace-integrated.csv"), csv.as_bytes())?;
    Ok(integrated)
}

fn integrate(gpu: &Arc<Gpu>, frames: usize, report: &Report) -> Result<Integrated> {
    let bar = report.stage("integrated", 2 * frames as u64);
    let sums = |scattering, lines: &[[f32; 2]]| -> Result<Sums> {
        let grid = Grid { roughnesses: ROUGHNESSES, views: VIEWS, lines: lines.to_vec() };
        let settings = Settings { scattering, ..Settings::default() };
        let mut counted = (0..frames).inspect(|_| bar.inc(1));
        let picture =
            draw_frames(gpu, &patches(&grid), grid.pixels(PATCH), settings, Shading::Reference, &mut counted)?;
        Ok(Sums::of(rows(&grid, &picture, scattering)))
    };
    let (single, multiple) = (sums(Scattering::Single, &MIRRORING)?, sums(Scattering::Multiple, &WHITE)?);
    bar.finish_and_clear();
    Ok(Integrated { frames, pixels: (PATCH - 2).pow(2), single, multiple })
}

fn rows(grid: &Grid, picture: &[[f32; 4]], scattering: Scattering) -> Vec<Row> {
    let mut rows = Vec::new();
    for (line, [albedo, metallic]) in grid.lines.iter().enumerate() {
        let [albedo, metallic] = [*albedo, *metallic].map(f64::from);
        for column in 0..grid.columns() {
            let [roughness, n_dot_v] = grid.at(column).map(f64::from);
            let inner = 1..PATCH - 1;
            let row_at = |y: usize| (line * PATCH + y) * grid.columns() * PATCH + column * PATCH;
            let pixels = inner.clone().flat_map(|y| inner.clone().map(move |x| row_at(y) + x));
            let [integrated, standard_error] = mean_and_error(pixels.map(|at| f64::from(picture[at][0])));
            let expected = match scattering {
                Scattering::Single => {
                    let f0 = DIELECTRIC_F0 + metallic * (albedo - DIELECTRIC_F0);
                    specular_albedo(DVec3::splat(f0), n_dot_v, roughness, Geometry::Smith).x
                }
                Scattering::Multiple => 1.0,
            };
            rows.push(Row { albedo, metallic, roughness, n_dot_v, integrated, standard_error, expected });
        }
    }
    rows
}

/// Of independent numbers.
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

    /// Case 20 of tests/gpu/stability.rs: what the terms add up to, not what they were built to add up to.
    #[test]
    fn the_sampled_brdf_gives_back_all_light_and_scatters_once_what_the_table_says() {
        let Integrated { single, multiple, .. } = with_gpu(|gpu| integrate(gpu, 300, &Report::silent()).unwrap());
        for Sums { least, most, off, standard_error, .. } in [&single, &multiple] {
            println!("{least:.5} to {most:.5}, off by {off:.5}, standard error up to {standard_error:.5}");
        }
        assert_eq!([single.rows.len(), multiple.rows.len()], [2, 3].map(|lines| lines * ROUGHNESSES * VIEWS));
        for row in &multiple.rows {
            assert!(row.standard_error < 0.0016, "too noisy to tell: {row:?}");
            assert!((row.integrated - 1.0).abs() < 0.005, "{row:?}");
        }
        assert!(multiple.most < 1.005);
        for row in &single.rows {
            let bound = 4.5 * row.standard_error + 3e-4;
            assert!((row.integrated - row.expected).abs() < bound, "{row:?}: beyond {bound}");
        }
    }
}
