//! Speed against accuracy: sweeps over methods and parameters, their tables and charts.

mod ball;
mod causes;
mod chart;
mod clock;
mod frame;
mod furnace;
mod furnace_integrated;
mod furnace_picture;
mod geometry;
mod judge;
mod ladder;
mod maps;
mod noise;
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

use crate::asset::file::write_atomically;
use crate::asset::{Outputs, Report};
use crate::gpu::GpuOptions;
use crate::precompute::{Cache, check_face_size};
use crate::{Error, Result, say};

pub use ladder::{Limit, choose};
pub use precompute::METHODS;
pub use synthetic::{panorama as synthetic_panorama, write_panoramas};
pub use table::{Row, Sweep};
pub use texels::{Accuracy, prefiltered_truth, spread_texels};

/// One thing that can be measured.
pub struct Measurement {
    pub name: &'static str,
    /// What it does, in a line.
    pub what: &'static str,
    run: fn(&MeasureRequest<'_>, GpuOptions<'_>, &Report) -> Result<()>,
}

const fn measurement(
    name: &'static str,
    what: &'static str,
    run: fn(&MeasureRequest<'_>, GpuOptions<'_>, &Report) -> Result<()>,
) -> Measurement {
    Measurement { name, what, run }
}

/// All there are, in the order in which they run. Each writes what it has into the folder as it goes, `NAME.json` among it.
#[rustfmt::skip]
pub const MEASUREMENTS: &[Measurement] = &[
    measurement("panoramas", "write the synthetic panoramas as OpenEXR, for other programs",
        |request, _, _| write_panoramas(request.output)),
    measurement("frame", "processor time of a frame and of recording it, with each saving and without",
        |request, gpu, report| frame::run(request.output, request.full, gpu, report).map(drop)),
    measurement("scenes", "frame rate, memory and start of the thesis's six scenes, beside its own tables",
        |request, gpu, report| scenes::run(request.output, request.full, gpu, report)),
    measurement("stereo", "what the second eye costs: one eye, two passes, one pass",
        |request, gpu, report| stereo::run(request.output, request.full, gpu, report)),
    measurement("furnace", "whether white surfaces under even light give back all of it, and what that costs",
        |request, gpu, report| furnace::run(request.output, request.full, gpu, report).map(drop)),
    measurement("geometry", "what vertices lose in fewer bytes, and what ordering triangles gains",
        |request, _, report| geometry::run(request.output, report).map(drop)),
    measurement("textures", "memory, time and picture of ways to store and filter textures", textures::run),
    measurement("ladder", "GPU time and error of every setting that trades one for the other, against the exact picture",
        ladder::run),
    measurement("causes", "errors by cause: one approximation after the other swapped for what is exact", causes::run),
    measurement("precompute", "time and error of every way to fill the irradiance and specular maps", precompute::run),
];

/// The name for all of them.
const ALL: &str = "all";

/// What to measure, on what, and where results go.
pub struct MeasureRequest<'a> {
    /// Of some of [`MEASUREMENTS`]; empty, or `all` among them, for all.
    pub names: &'a [String],
    /// The folder for results; made if missing.
    pub output: &'a Path,
    /// All cube sizes and parameters, and more texels of each map.
    pub full: bool,
    /// Descriptions or models; empty for some that are shipped. Only ladder and causes take them.
    pub scenes: &'a [PathBuf],
    /// Pixels of the ladder's and the causes' pictures; `None` for those of quick or full.
    pub picture: Option<[u32; 2]>,
    /// What is to be chosen from each ladder.
    pub limit: Option<Limit>,
    /// Of visual angle, for the ladder's FLIP.
    pub pixels_per_degree: f32,
    /// Where precomputed light is taken from, and where ladders are kept.
    pub cache: Option<&'a Cache>,
    /// Panorama files; empty for the synthetic and the shipped ones.
    pub panoramas: &'a [PathBuf],
    /// Some of [`METHODS`]; empty for all.
    pub methods: &'a [String],
    /// Texels along the cube's faces; empty for those of quick or full.
    pub sizes: &'a [u32],
    /// A folder of cube maps that cmgen wrote for the one panorama.
    pub judge: Option<&'a Path>,
    /// Where everything that was measured is written beside its own files: one measurement's facts, or those of several by
    /// name.
    pub json: Option<&'a Path>,
}

impl MeasureRequest<'_> {
    fn wants(&self, name: &str) -> bool {
        self.names.is_empty() || self.names.iter().any(|n| n == name || n == ALL)
    }
}

/// Measures, and writes the results into the folder.
///
/// # Errors
/// Unknown names, before anything is done; whatever stops reading, computing or writing.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let known: Vec<&str> = MEASUREMENTS.iter().map(|measurement| measurement.name).chain([ALL]).collect();
    check_names("measurement", request.names, &known)?;
    check_names("method", request.methods, &METHODS)?;
    request.sizes.iter().try_for_each(|size| check_face_size(*size))?;
    if request.judge.is_some() && request.panoramas.len() != 1 {
        return Err(Error::Usage("--judge needs the one --panorama that its maps were made from".into()));
    }
    if !request.scenes.is_empty() && !["ladder", "causes"].iter().any(|name| request.wants(name)) {
        return Err(Error::Usage("scenes are for `measure ladder` and `causes`; the others have their own".into()));
    }
    check_flags(request)?;
    for path in request.scenes.iter().chain(request.panoramas) {
        // Better now than after the first has been measured.
        std::fs::metadata(path).map_err(Error::read(path))?;
    }
    let mut outputs = Outputs::of(request.scenes.iter().chain(request.panoramas));
    outputs.folder(request.output, &[])?;
    outputs.file_if(request.json)?;
    std::fs::create_dir_all(request.output).map_err(Error::write(request.output))?;
    let wanted: Vec<&Measurement> = MEASUREMENTS.iter().filter(|measurement| request.wants(measurement.name)).collect();
    for (number, measurement) in (1..).zip(&wanted) {
        if wanted.len() > 1 {
            say!("pbr-vr: {} ({number} of {})", measurement.name, wanted.len());
        }
        (measurement.run)(request, gpu, report)?;
    }
    request.json.map_or(Ok(()), |path| write_json(path, request.output, &wanted))
}

/// Writes the facts that measurements left in `folder` as one file; those of a single one as they are.
fn write_json(path: &Path, folder: &Path, measured: &[&Measurement]) -> Result<()> {
    let mut facts = Vec::new();
    for name in measured.iter().map(|measurement| measurement.name) {
        let own = folder.join(name).with_extension("json");
        // Some write pictures or tables alone.
        if own.is_file() {
            facts.push((name, std::fs::read_to_string(&own).map_err(Error::read(&own))?));
        }
    }
    let text = match facts.as_slice() {
        [(_, only)] => only.clone(),
        several => {
            let members: Vec<String> =
                several.iter().map(|(name, text)| format!("\"{name}\": {}", text.trim_end())).collect();
            format!("{{{}}}\n", members.join(",\n"))
        }
    };
    write_atomically(path, text.as_bytes())
}

/// Refuses what none of the wanted measurements looks at.
fn check_flags(request: &MeasureRequest<'_>) -> Result<()> {
    let precompute = ["precompute"].as_slice();
    for (given, flag, users) in [
        (!request.panoramas.is_empty(), "--panorama", ["precompute", "causes"].as_slice()),
        (!request.sizes.is_empty(), "--size", &["precompute", "causes"]),
        (!request.methods.is_empty(), "--method", precompute),
        (request.judge.is_some(), "--judge", precompute),
        (request.picture.is_some(), "--picture", &["ladder", "causes"]),
        (matches!(request.limit, Some(Limit::Tolerance(_))), "--tolerance", &["ladder"]),
        (matches!(request.limit, Some(Limit::BudgetMs(_))), "--budget-ms", &["ladder"]),
    ] {
        if given && !users.iter().any(|name| request.wants(name)) {
            return Err(Error::Usage(format!("{flag} is for `measure {}`; leave it out", users.join("` and `"))));
        }
    }
    Ok(())
}

fn check_names(what: &'static str, names: &[String], known: &[&str]) -> Result<()> {
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => {
            Err(Error::UnknownName { what, name: name.clone(), known: known.iter().map(|k| (*k).to_owned()).collect() })
        }
    }
}
