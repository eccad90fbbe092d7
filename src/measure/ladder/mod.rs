//! Speed against accuracy: every setting that trades one for the other, its time beside its error against the exact picture.

mod bench;
mod chart;
mod exact;
mod front;
mod kept;
mod rungs;
mod table;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::MeasureRequest;
use super::clock::today;
use super::turns::{Cost, Spread};
use crate::asset::{Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::{Result, say};
use bench::Bench;
use exact::{ExactFacts, PictureError};
use front::Mark;
use rungs::Single;

pub use front::Limit;
pub use kept::choose;

/// Measured where no scene is named.
const SCENES: [&str; 3] = ["sphere", "teapot", "tearoom"];

/// One setting of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Rung {
    /// What kind of setting it is.
    dimension: String,
    /// As on the command line; empty for the default.
    flags: String,
    #[serde(flatten)]
    cost: Cost,
    /// How many times the default's time it takes, both drawn in turn.
    ratio: Spread,
    /// The default's GPU time in that run.
    default_gpu_ms: f64,
    /// That ratio of the default's time over all runs: what settings are compared by.
    ms: f64,
    #[serde(flatten)]
    error: PictureError,
    /// Flags of a setting that is quicker and more accurate; none on the front.
    beaten_by: Option<String>,
    /// Whether that is less than what the measurement can tell.
    within_noise: bool,
}

/// Every setting of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Ladder {
    scene: String,
    gpu: String,
    driver: String,
    date: String,
    size: [u32; 2],
    /// What ratios are of: GPU time, or the processor's where it draws.
    time: String,
    exact: ExactFacts,
    /// The default is the first.
    rungs: Vec<Rung>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Results<'a> {
    gpu: &'a str,
    driver: &'a str,
    date: String,
    ladders: &'a [Ladder],
}

/// Measures, and after each setting writes `ladder.csv`, `ladder.json` and `ladder.md`; after each scene, its chart, and a
/// ladder in the cache, which [`choose`] reads.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let mut done = Vec::new();
    for path in scenes(request)? {
        let ladder = climb(&gpu, &path, request, report, |ladder| {
            let all: Vec<Ladder> = done.iter().chain([ladder]).cloned().collect();
            table::write(request.output, &gpu, &all)
        })?;
        chart::write(request.output, &ladder)?;
        if let Some(cache) = request.cache {
            let kept = kept::keep(cache, &path, &gpu, &ladder);
            kept.unwrap_or_else(|error| {
                report.warn(format!("{error}; --tolerance and --budget-ms cannot use this ladder"))
            });
        }
        ladder.verdict().iter().for_each(|line| say!("pbr-vr: {line}"));
        if let Some(limit) = request.limit {
            say!("pbr-vr: {}", ladder.choice(limit).map_or_else(|problem| problem, |rung| ladder.words(limit, rung)));
        }
        done.push(ladder);
    }
    drop(gpu);
    messages.check()
}

fn scenes(request: &MeasureRequest<'_>) -> Result<Vec<PathBuf>> {
    if !request.scenes.is_empty() {
        return Ok(request.scenes.to_vec());
    }
    let folder = shipped::folder()?.join("scenes");
    Ok(SCENES.iter().map(|name| folder.join(name).with_extension("toml")).collect())
}

/// Measures one scene's settings: each alone, then what is worth combining.
fn climb(
    gpu: &Arc<Gpu>,
    path: &Path,
    request: &MeasureRequest<'_>,
    report: &Report,
    mut written: impl FnMut(&Ladder) -> Result<()>,
) -> Result<Ladder> {
    let mut bench = Bench::new(gpu, path, request, report)?;
    let info = gpu.info();
    let mut ladder = Ladder {
        scene: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        gpu: info.name.clone(),
        driver: info.driver.clone(),
        date: today(),
        size: bench.size(),
        time: if info.is_software() { "processor time" } else { "GPU time" }.into(),
        exact: bench.exact.facts.clone(),
        rungs: Vec::new(),
        notes: Vec::new(),
    };
    let singles =
        rungs::DIMENSIONS.iter().flat_map(|(dimension, all)| all.iter().map(move |flags| (*dimension, *flags)));
    let all = [("default", "")].into_iter().chain(singles).chain(rungs::KNOWN.iter().copied());
    let (unfit, alone): (Vec<_>, Vec<_>) =
        all.partition(|(_, flags)| info.is_software() && rungs::NOT_FOR_SOFTWARE.contains(flags));
    ladder.notes.extend(unfit.iter().map(|(_, flags)| format!("`{flags}`: not measured where the processor draws")));
    let bar = report.stage("settings", alone.len() as u64);
    let mut measure = |ladder: &mut Ladder, dimension: &str, flags: &str| -> Result<()> {
        if let Some(rung) = bench.measure(dimension, flags)? {
            ladder.rungs.push(rung);
            ladder.settle();
            written(ladder)?;
        }
        bar.inc(1);
        Ok(())
    };
    for (dimension, flags) in alone {
        measure(&mut ladder, dimension, flags)?;
    }
    let combined = ladder.combinations();
    bar.inc_length(combined.len() as u64);
    for flags in combined {
        measure(&mut ladder, "combined", &flags)?;
    }
    bar.finish_and_clear();
    Ok(ladder)
}

impl Rung {
    fn mark(&self) -> Mark {
        Mark { ms: self.ms, error: self.error.flip }
    }

    fn single(&self) -> Single<'_> {
        Single { dimension: &self.dimension, flags: &self.flags, mark: self.mark() }
    }

    /// Its flags, or what stands for none.
    fn name(&self) -> &str {
        if self.flags.is_empty() { "default" } else { &self.flags }
    }

    /// Twice the standard error of the median ratio: of normal times it is 1.25 σ / √n, and a tenth lie beyond 1.28 σ.
    fn ratio_noise(&self) -> f64 {
        2.0 * 1.25 * (self.ratio.high - self.ratio.low) / 2.56 / (self.cost.frames.max(1) as f64).sqrt()
    }
}

impl Ladder {
    fn marks(&self) -> Vec<Mark> {
        self.rungs.iter().map(Rung::mark).collect()
    }

    /// Times as parts of one default's, and who beats whom.
    fn settle(&mut self) {
        let Some(default) = Spread::of(self.rungs.iter().map(|rung| rung.default_gpu_ms).collect()) else { return };
        for rung in &mut self.rungs {
            // The default against itself tells the noise; it is one time itself by definition.
            rung.ms = default.median * if rung.flags.is_empty() { 1.0 } else { rung.ratio.median };
        }
        let beaten = front::beaten_by(&self.marks());
        for (index, by) in beaten.into_iter().enumerate() {
            let (name, within) = match by.map(|by| (&self.rungs[by], &self.rungs[index])) {
                Some((by, rung)) => {
                    let noise = by.ratio_noise().hypot(rung.ratio_noise()) * default.median;
                    let same_error = rung.error.flip - by.error.flip <= self.exact.floor.flip;
                    (Some(by.name().to_owned()), rung.ms - by.ms <= noise && same_error)
                }
                None => (None, false),
            };
            (self.rungs[index].beaten_by, self.rungs[index].within_noise) = (name, within);
        }
    }

    fn combinations(&self) -> Vec<String> {
        let Some((default, others)) = self.rungs.split_first() else { return Vec::new() };
        let known = |rung: &&Rung| rungs::KNOWN.iter().all(|(dimension, _)| *dimension != rung.dimension);
        rungs::combinations(default.mark(), &others.iter().filter(known).map(Rung::single).collect::<Vec<_>>())
    }

    /// What it says about the default, and whether the exact picture is exact enough to say so.
    fn verdict(&self) -> Vec<String> {
        let Some(default) = self.rungs.first() else { return Vec::new() };
        let (scene, ms, flip) = (&self.scene, default.ms, default.error.flip);
        let of = format!("{scene}: the default ({ms:.2} ms, FLIP {flip:.4})");
        let mut lines = vec![match (&default.beaten_by, default.within_noise) {
            (None, _) => format!("{of} is on the front"),
            (Some(by), true) => format!("{of} is beaten by {by}, but by less than can be told"),
            (Some(by), false) => format!("{of} IS NOT ON THE FRONT: it is beaten by {by}"),
        }];
        let floor = self.exact.floor.flip;
        if floor > 0.2 * flip {
            lines.push(format!(
                "{scene}: the exact picture's own error, FLIP {floor:.4}, blurs this; --full makes it smaller"
            ));
        }
        lines
    }

    /// The rung that a limit takes, or in words why none.
    fn choice(&self, limit: Limit) -> std::result::Result<&Rung, String> {
        let marks = self.marks();
        let best = |better: fn(&Mark) -> f64| marks.iter().map(better).fold(f64::INFINITY, f64::min);
        limit.choose(&marks).map(|index| &self.rungs[index]).ok_or_else(|| {
            let there = match limit {
                Limit::Tolerance(_) => format!("FLIP {:.4}", best(|mark| mark.error)),
                Limit::BudgetMs(_) => format!("{:.2} ms", best(|mark| mark.ms)),
            };
            format!("{}: no setting is {}; the best has {there}", self.scene, limit.words())
        })
    }

    fn words(&self, limit: Limit, rung: &Rung) -> String {
        let ([width, height], Rung { ms, error, .. }) = (self.size, rung);
        let (scene, name, date) = (&self.scene, rung.name(), &self.date);
        format!(
            "{scene}, {}: {name} ({ms:.2} ms, FLIP {:.4}, measured at {width}x{height} on {date})",
            limit.words(),
            error.flip
        )
    }
}

#[cfg(test)]
#[path = "ladder_tests.rs"]
mod tests;
