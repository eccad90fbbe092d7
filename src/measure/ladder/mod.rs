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
use super::noise::{Halves, paired};
use super::turns::{Cost, Spread};
use crate::asset::{Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::{Result, say};
use bench::Bench;
use exact::{ExactFacts, PictureError};
use front::{Beaten, Mark};
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
    /// Against the exact picture's halves; only while others are still compared with it.
    #[serde(skip)]
    halves: Halves,
    /// FLIP less the default's, and how far that may be off by the exact picture's noise ([`paired`]).
    flip_over_default: f64,
    flip_noise: f64,
    /// Flags of a setting that is quicker or more accurate and not the opposite of the other ([`Mark::beats`]), where what
    /// noise hides and what is less than [`rungs::WORTH`] count for nothing; none on the front.
    beaten_by: Option<String>,
    /// Whether the other of time and error differs by no more than that, in whichever direction.
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
    let bar = report.progress("settings", alone.len() as u64);
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

    /// How it stands beside the default.
    fn beside_default(&self) -> String {
        let Self { ratio, flip_over_default, flip_noise, .. } = self;
        let (ratio, noise) = (ratio.median, self.ratio_noise());
        format!(" at {ratio:.2} ± {noise:.2} of its time (FLIP {flip_over_default:+.5} ± {flip_noise:.5})")
    }

    /// Twice the standard error of the median ratio: of normal times it is 1.25 σ / √n, and a tenth lie beyond 1.28 σ. The
    /// default's own is none, as others' times are told as multiples of it.
    fn ratio_noise(&self) -> f64 {
        if self.flags.is_empty() {
            return 0.0;
        }
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
        let noise = |a: usize, b: usize| {
            let (a, b) = (&self.rungs[a], &self.rungs[b]);
            Mark {
                ms: a.ratio_noise().hypot(b.ratio_noise()) * default.median,
                error: paired(&a.halves, &b.halves, a.error.flip - b.error.flip),
            }
        };
        let worth = self.rungs[0].error.flip * rungs::WORTH;
        let least = |a: usize, b: usize| {
            let Mark { ms, error } = noise(a, b);
            Mark { ms: ms.max(rungs::WORTH * default.median), error: error.max(worth) }
        };
        let beaten = front::beaten_by(&self.marks(), least);
        let over_default: Vec<(f64, f64)> = (0..self.rungs.len())
            .map(|index| (self.rungs[index].error.flip - self.rungs[0].error.flip, noise(index, 0).error))
            .collect();
        for (index, (beaten, over_default)) in beaten.into_iter().zip(over_default).enumerate() {
            let by = beaten.map(|Beaten { by, .. }| self.rungs[by].name().to_owned());
            let rung = &mut self.rungs[index];
            rung.within_noise = beaten.is_some_and(|beaten| !beaten.surely);
            (rung.beaten_by, (rung.flip_over_default, rung.flip_noise)) = (by, over_default);
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
        let by = default.beaten_by.as_ref().and_then(|by| self.rungs.iter().find(|rung| rung.name() == by));
        let mut lines = vec![match by {
            None => format!("{of} is on the front"),
            Some(by) if !default.within_noise => {
                format!("{of} IS NOT ON THE FRONT: it is beaten by {}{}", by.name(), by.beside_default())
            }
            Some(by) => {
                // By what the default is better, if by anything: hidden by noise, or too little to count.
                let (quicker, better) = (by.ratio.median - 1.0, by.flip_over_default);
                let told = quicker > by.ratio_noise() || better > by.flip_noise;
                let what = if better > 0.0 { "FLIP" } else { "time" };
                let (place, less) = match (quicker < 0.0 && better <= 0.0, told) {
                    (true, _) => {
                        ("is beaten by".to_owned(), ", but in one of both by less than can be told, or than 1 %")
                    }
                    (false, true) => (format!("is on the front, but in {what} less than 1 % better than"), ""),
                    (false, false) => (format!("is on the front, but in {what} cannot be told from"), ""),
                };
                format!("{of} {place} {}{}{less}", by.name(), by.beside_default())
            }
        }];
        let floor = self.exact.floor.flip;
        if floor > 0.2 * flip {
            lines.push(format!(
                "{scene}: the exact picture's own error, FLIP {floor:.4}, is a large part of these; --full makes it smaller"
            ));
        }
        lines
    }

    /// How near FLIP sees the pictures, if not as usual.
    fn seen(&self) -> String {
        let seen = self.exact.pixels_per_degree;
        if seen == PIXELS_PER_DEGREE { String::new() } else { format!(" at {seen} pixels per degree") }
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
            "{scene}, {}: {name} ({ms:.2} ms, FLIP {:.4}{}, measured at {width}x{height} on {date})",
            limit.words(),
            error.flip,
            self.seen()
        )
    }
}

#[cfg(test)]
#[path = "ladder_tests.rs"]
mod tests;
