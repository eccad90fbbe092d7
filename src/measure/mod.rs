//! Speed against accuracy: sweeps over methods and parameters, their tables and charts.

mod ball;
mod chart;
mod clock;
mod frame;
mod furnace;
mod furnace_picture;
mod geometry;
mod judge;
mod maps;
mod precompute;
mod scenes;
mod scenes_chart;
mod scenes_table;
mod stereo;
mod synthetic;
mod table;
mod texels;
mod texture_chart;
mod textures;
mod turns;
mod widening;

use std::path::{Path, PathBuf};

use crate::asset::Report;
use crate::gpu::GpuOptions;
use crate::precompute::check_face_size;
use crate::{Error, Result};

pub use precompute::METHODS;
pub use synthetic::{panorama as synthetic_panorama, write_panoramas};
pub use table::{Row, Sweep};
pub use texels::{Accuracy, prefiltered_truth, spread_texels};

/// What can be measured: its name, and what it does.
pub const NAMES: [(&str, &str); 8] = [
    ("precompute", "time and error of every way to fill the irradiance and specular maps"),
    ("frame", "processor time of a frame and of recording it, with each saving and without"),
    ("scenes", "frame rate, memory and start of the thesis's six scenes, beside its own tables"),
    ("stereo", "what the second eye costs: one eye, two passes, one pass"),
    ("furnace", "whether white surfaces under even light give back all of it, and what that costs"),
    ("geometry", "what vertices lose in fewer bytes, and what ordering triangles gains"),
    ("textures", "memory, time and picture of ways to store and filter textures"),
    ("panoramas", "write the synthetic panoramas as OpenEXR, for other programs"),
];

/// What to measure, on what, and where results go.
pub struct MeasureRequest<'a> {
    /// Some of [`NAMES`]; empty for all.
    pub names: &'a [String],
    /// The folder for results; made if missing.
    pub output: &'a Path,
    /// All cube sizes and parameters, and more texels of each map.
    pub full: bool,
    /// Panorama files; empty for the synthetic and the shipped ones.
    pub panoramas: &'a [PathBuf],
    /// Some of [`METHODS`]; empty for all.
    pub methods: &'a [String],
    /// Texels along the cube's faces; empty for those of quick or full.
    pub sizes: &'a [u32],
    /// A folder of cube maps that cmgen wrote for the one panorama.
    pub judge: Option<&'a Path>,
}

/// Measures, writes the results into the folder, and returns the sweep if there was one.
///
/// # Errors
/// Unknown names, before anything is done; whatever stops reading, computing or writing.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<Option<Sweep>> {
    let known = NAMES.map(|(name, _)| name);
    check_names("measurement", request.names, &known)?;
    check_names("method", request.methods, &METHODS)?;
    request.sizes.iter().try_for_each(|size| check_face_size(*size))?;
    if request.judge.is_some() && request.panoramas.len() != 1 {
        return Err(Error::Usage("--judge needs the one --panorama that its maps were made from".into()));
    }
    std::fs::create_dir_all(request.output).map_err(Error::write(request.output))?;
    let wanted = |name: &str| request.names.is_empty() || request.names.iter().any(|n| n == name);
    if wanted("panoramas") {
        write_panoramas(request.output)?;
    }
    if wanted("frame") {
        frame::run(request.output, request.full, gpu, report)?;
    }
    if wanted("scenes") {
        scenes::run(request.output, request.full, gpu, report)?;
    }
    if wanted("stereo") {
        stereo::run(request.output, request.full, gpu, report)?;
    }
    if wanted("furnace") {
        furnace::run(request.output, request.full, gpu, report)?;
    }
    if wanted("geometry") {
        geometry::run(request.output, report)?;
    }
    if wanted("textures") {
        textures::run(request, gpu, report)?;
    }
    if wanted("precompute") { precompute::run(request, gpu, report).map(Some) } else { Ok(None) }
}

fn check_names(what: &'static str, names: &[String], known: &[&str]) -> Result<()> {
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => {
            Err(Error::UnknownName { what, name: name.clone(), known: known.iter().map(|k| (*k).to_owned()).collect() })
        }
    }
}
