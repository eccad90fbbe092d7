//! Speed against accuracy: studies of methods, settings and costs, their tables and charts.

mod bench;
mod causes;
mod cmgen;
mod furnace;
pub(crate) mod ladder;
mod machine;
mod maps;
mod noise;
mod pareto;
mod plot;
mod precompute;
mod report;
mod request;
mod scenes;
mod sums;
mod texels;

use std::path::Path;

use crate::asset::Outputs;
use crate::asset::file::write_atomically;
use crate::context::{Context, Setup};
use crate::{Error, Result, say};

pub use ladder::{choose, measured};
pub use pareto::Limit;
pub use request::MeasureRequest;

/// A study's name, what it does in a line, and its function.
type Measurement = (&'static str, &'static str, fn(&MeasureRequest, &Context) -> Result<()>);

/// All there are, in the order in which they run. Each writes what it has into the folder as it goes, `NAME.json` among it.
#[rustfmt::skip]
const MEASUREMENTS: [Measurement; 6] = [
    (PANORAMAS, "write the synthetic panoramas as OpenEXR, for other programs", |_, _| Ok(())),
    ("scenes", "what frames and starts of the thesis's six scenes cost, beside its own numbers", scenes::run),
    ("furnace", "whether white surfaces reflect all of even light", furnace::run),
    ("ladder", "time and error of every setting that trades one for the other", ladder::run),
    ("causes", "errors by cause: one approximation after the other replaced by its exact form", causes::run),
    ("precompute", "time and error of every way to fill the irradiance and specular maps", precompute::run),
];
/// The one that needs no GPU.
const PANORAMAS: &str = "panoramas";

/// Measures, and writes the results into the folder; or lists what can be measured.
///
/// # Errors
/// Unknown names and useless flags, before anything is done; whatever stops reading, computing or writing.
pub fn run(request: &MeasureRequest, setup: &Setup<'_>) -> Result<()> {
    if request.list {
        MEASUREMENTS.iter().for_each(|measurement| say!("{:12} {}", measurement.0, measurement.1));
        say!("methods      {}", precompute::METHODS.join(", "));
        say!("settings     {}", ladder::kinds().join(", "));
        return Ok(());
    }
    request.check(&MEASUREMENTS.map(|measurement| measurement.0), &precompute::METHODS, &ladder::kinds())?;
    for path in request.inputs() {
        // Now rather than after the first has been measured.
        std::fs::metadata(&path).map_err(Error::read(&path))?;
    }
    let mut outputs = Outputs::of(request.inputs());
    outputs.folder(request.folder(), &[])?;
    outputs.file_if(request.json.as_deref())?;
    std::fs::create_dir_all(request.folder()).map_err(Error::write(request.folder()))?;
    let wanted: Vec<&Measurement> = MEASUREMENTS.iter().filter(|measurement| request.wants(measurement.0)).collect();
    for (number, (name, _, run)) in (1..).zip(&wanted) {
        if wanted.len() > 1 {
            say!("pbr-vr: {name} ({number} of {})", wanted.len());
        }
        if *name == PANORAMAS {
            precompute::write_panoramas(request.folder())?;
            continue;
        }
        let context = setup.open()?;
        let messages = context.gpu.messages();
        run(request, &context)?;
        drop(context);
        messages.check()?;
    }
    request.json.as_deref().map_or(Ok(()), |path| merge_json(path, request.folder(), &wanted))
}

/// Writes the JSON files that measurements left in `folder` as one: a single one as it is, several by name.
fn merge_json(path: &Path, folder: &Path, measured: &[&Measurement]) -> Result<()> {
    let mut parts = Vec::new();
    // `panoramas` writes none.
    for (name, ..) in measured.iter().filter(|(name, ..)| *name != PANORAMAS) {
        let own = folder.join(name).with_extension("json");
        parts.push((name, std::fs::read_to_string(&own).map_err(Error::read(&own))?));
    }
    let member = |(name, text): &(&&str, String)| format!("\"{name}\": {}", text.trim_end());
    let text = match parts.as_slice() {
        [(_, only)] => only.clone(),
        several => format!("{{{}}}\n", several.iter().map(member).collect::<Vec<_>>().join(",\n")),
    };
    write_atomically(path, text.as_bytes())
}
