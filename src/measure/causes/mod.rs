//! Errors by cause: one approximation after the other replaced by its exact form, for balls and for pictures.

mod ball;
mod chain;
mod picture;
mod rows;
mod sums;

use super::machine::Machine;
use super::request::MeasureRequest;
use crate::asset::{Panorama, synthetic_panorama};
use crate::context::Context;
use crate::precompute::Options;
use crate::{Result, say};
use ball::Ball;
use picture::Subject;
use rows::{Results, Row};

/// The scenes that are measured if none is named.
const SCENES: [&str; 2] = ["teapot", "sphere"];

/// Measures, and after each row writes `causes.csv`, `causes.json` and `causes.md`; at the end `causes.svg`.
pub fn run(request: &MeasureRequest, context: &Context) -> Result<()> {
    let folder = request.folder();
    let detail = if request.full { picture::FULL } else { picture::QUICK };
    let size = request.picture.unwrap_or(detail.size);
    let mut results = Results { machine: Machine::new(&context.gpu), size, rows: Vec::new() };
    let mut keep = |rows: Vec<Row>| {
        results.rows.extend(rows);
        results.write(folder)
    };
    let grid = if request.full { ball::FULL } else { ball::QUICK };
    let files = request.panorama_files()?;
    let synthetic = request.panoramas.is_empty().then(|| Ok(synthetic_panorama(grid.width, true)));
    let shipped = files.iter().map(|path| Ok(smaller(Panorama::load(path, &context.report)?, grid.width)));
    let cube_size = request.sizes.first().copied().unwrap_or(Options::default().face_size);
    let bar = context.report.progress("balls", files.len() as u64);
    for panorama in synthetic.into_iter().chain(shipped) {
        keep(Ball::new(context, &panorama?, cube_size, &grid)?.rows(&grid)?)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    for path in request.scenes_or(&SCENES)? {
        Subject::new(context, &path, picture::Detail { size, ..detail })?.measure(&mut keep)?;
    }
    results.plot().write(folder, "causes")?;
    results.largest().iter().for_each(|line| say!("pbr-vr: {line}"));
    Ok(())
}

/// Halved until it is no wider than this; four texels become one.
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

#[cfg(test)]
#[path = "causes_tests.rs"]
mod gpu_tests;
