//! Errors by cause: one approximation after the other replaced by its exact form, for balls, for pictures' shading, and for
//! the light between their things.

mod ball;
mod chain;
mod light;
mod picture;
mod rows;

use glam::{DVec4, Vec4};

use super::machine::Machine;
use super::request::MeasureRequest;
use crate::asset::{Panorama, synthetic_panorama};
use crate::context::Context;
use crate::precompute::Options;
use crate::reference::mip::box_average;
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
        let subject = Subject::new(context, &path, &request.staging(), picture::Detail { size, ..detail })?;
        subject.measure(&mut keep)?;
        subject.measure_light(&mut keep)?;
    }
    results.plot().write(folder, "causes")?;
    results.largest().iter().for_each(|line| say!("pbr-vr: {line}"));
    Ok(())
}

/// Averaged to this width if it is wider.
fn smaller(panorama: Panorama, width: u32) -> Panorama {
    if panorama.width <= width {
        return panorama;
    }
    let height = (panorama.height * width / panorama.width).max(1);
    let texels: Vec<DVec4> = panorama.texels.iter().map(|[r, g, b]| Vec4::new(*r, *g, *b, 0.0).as_dvec4()).collect();
    let means = box_average(&texels, [panorama.width, panorama.height], [width, height]);
    let texels = means.into_iter().map(|mean| mean.truncate().as_vec3().to_array()).collect();
    Panorama { name: panorama.name, width, height, texels }
}

#[cfg(test)]
#[path = "causes_tests.rs"]
mod gpu_tests;
