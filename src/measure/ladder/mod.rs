//! Speed against accuracy: every setting that trades one for the other, its time and its error against the reference picture.

mod bakes;
#[cfg(test)]
mod bakes_gpu_tests;
mod chart;
mod config;
mod reference;
pub(crate) mod settings;
mod settings_bench;
pub(crate) mod store;

use std::path::Path;

use serde::Serialize;

use super::machine::Machine;
use super::report::{stem, write_json, write_table};
use super::request::MeasureRequest;
use crate::context::Context;
use crate::{Result, say};
use config::{Config, Ladder};
use settings_bench::SettingsBench;

pub use store::{choose, measured};

/// The scenes that are measured if none is named.
const SCENES: [&str; 3] = ["sphere", "teapot", "tearoom"];

/// Measures, and after each configuration writes `ladder.csv`, `ladder.json` and `ladder.md`; after each scene, its chart, and
/// a ladder in the cache, which [`choose`] reads.
pub fn run(request: &MeasureRequest, context: &Context) -> Result<()> {
    let (folder, limit) = (request.folder(), request.limit());
    let mut done: Vec<Ladder> = Vec::new();
    for path in request.scenes_or(&SCENES)? {
        let ladder = measure(context, &path, request, |ladder| {
            write(folder, context, &done.iter().chain([ladder]).collect::<Vec<_>>())
        })?;
        chart::plot(&ladder).write(folder, &format!("ladder-{}", ladder.scene))?;
        if let Some(cache) = context.cache.as_ref().filter(|_| request.settings.is_empty()) {
            let stored = store::store(cache, &path, &context.gpu, &ladder);
            stored.unwrap_or_else(|error| {
                context.report.warn(format!("{error}; --tolerance and --budget-ms cannot use this ladder"));
            });
        }
        ladder.verdict().iter().for_each(|line| say!("pbr-vr: {line}"));
        if let Some(limit) = limit {
            let words = ladder.choice(limit).map(|config| ladder.words(limit, config));
            say!("pbr-vr: {}", words.unwrap_or_else(|problem| problem));
        }
        done.push(ladder);
    }
    Ok(())
}

/// All kinds of settings.
pub fn kinds() -> Vec<&'static str> {
    settings::DIMENSIONS.iter().map(|(kind, _)| *kind).collect()
}

/// Measures one scene's settings: each alone, then combinations that are worth it.
fn measure(
    context: &Context,
    path: &Path,
    request: &MeasureRequest,
    mut written: impl FnMut(&Ladder) -> Result<()>,
) -> Result<Ladder> {
    let mut bench = SettingsBench::new(context, path, request)?;
    let software = context.gpu.info().is_software();
    let mut ladder = Ladder {
        scene: stem(path),
        machine: Machine::new(&context.gpu),
        size: bench.shot.size,
        time: if software { "processor time" } else { "GPU time" }.into(),
        reference: bench.reference.facts.clone(),
        configs: Vec::new(),
        notes: Vec::new(),
    };
    let singles =
        settings::DIMENSIONS.iter().flat_map(|(dimension, all)| all.iter().map(move |flags| (*dimension, *flags)));
    let all = singles.chain(settings::KNOWN.iter().copied());
    let all = all.filter(|(kind, _)| request.settings.is_empty() || request.settings.iter().any(|name| name == kind));
    let all = [("default", "")].into_iter().chain(all);
    let (unfit, alone): (Vec<_>, Vec<_>) =
        all.partition(|(_, flags)| software && settings::NOT_FOR_SOFTWARE.contains(flags));
    ladder.notes.extend(unfit.iter().map(|(_, flags)| format!("{flags}: not measured on a software renderer")));
    let bar = context.report.progress("settings", alone.len() as u64);
    let mut add = |ladder: &mut Ladder, dimension: &str, flags: &str| -> Result<()> {
        if let Some(config) = bench.measure(dimension, flags)? {
            ladder.configs.push(config);
            ladder.settle();
            written(ladder)?;
        }
        bar.inc(1);
        Ok(())
    };
    for (dimension, flags) in alone {
        add(&mut ladder, dimension, flags)?;
    }
    let combined = if request.settings.is_empty() { ladder.combinations() } else { Vec::new() };
    bar.inc_length(combined.len() as u64);
    for flags in combined {
        add(&mut ladder, "combined", &flags)?;
    }
    bar.finish_and_clear();
    Ok(ladder)
}

#[derive(Serialize)]
struct Row<'a> {
    scene: &'a str,
    #[serde(flatten)]
    config: &'a Config,
}

#[derive(Serialize)]
struct Results<'a> {
    #[serde(flatten)]
    machine: Machine,
    ladders: &'a [&'a Ladder],
}

fn write(folder: &Path, context: &Context, ladders: &[&Ladder]) -> Result<()> {
    let mut rows = Vec::new();
    for ladder in ladders {
        rows.extend(ladder.configs.iter().map(|config| Row { scene: &ladder.scene, config }));
    }
    let notes: Vec<String> = ladders.iter().flat_map(|ladder| chart::notes(ladder)).collect();
    let columns = "scene dimension flags frames ms ratio_median ratio_low ratio_high gpu_ms_median cpu_ms_median bake_cpu_s bake_gpu_s flip flip_max \
                   flip_over_default flip_noise relative_mse dominated_by";
    write_table(folder, "ladder", &notes, &rows, columns)?;
    write_json(folder, "ladder", &Results { machine: Machine::new(&context.gpu), ladders })
}

#[cfg(test)]
#[path = "ladder_tests.rs"]
pub(crate) mod tests;
