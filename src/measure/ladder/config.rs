//! Results of each configuration of settings: Pareto front, choices, verdict.

use serde::{Deserialize, Serialize};

use super::super::bench::{BakeCost, Cost, Spread};
use super::super::machine::Machine;
use super::super::noise::{Halves, paired};
use super::super::pareto::{Limit, Score, dominated_by};
use super::reference::{PictureError, ReferenceFacts};
use super::settings::{self, SHADING, WORTH};
use crate::reference::metrics::PIXELS_PER_DEGREE;

/// One configuration of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Config {
    /// The kind of setting.
    pub dimension: String,
    /// As on the command line; empty for the default.
    pub flags: String,
    #[serde(flatten)]
    pub cost: Cost,
    /// What its lightmap and probes took once, before any frame; `None` without any.
    pub bake: Option<BakeCost>,
    /// Ratio to the default's time, both drawn interleaved.
    pub ratio: Spread,
    /// The default's GPU time in that run.
    pub default_gpu_ms: f64,
    /// The ratio times the default's time over all runs; configurations are compared by it.
    pub ms: f64,
    #[serde(flatten)]
    pub error: PictureError,
    /// Against the reference picture's halves; only while others are still compared with it.
    #[serde(skip)]
    pub halves: Halves,
    /// FLIP less the default's, and its uncertainty by the reference picture's noise ([`paired`]).
    pub flip_over_default: f64,
    pub flip_noise: f64,
    /// Flags of a configuration that is better in time or error and not worse in the other, where noise and less than
    /// [`WORTH`] count for nothing; `None` on the Pareto front.
    pub dominated_by: Option<String>,
}

impl Config {
    fn score(&self) -> Score {
        Score { ms: self.ms, error: self.error.flip }
    }

    pub fn is_default(&self) -> bool {
        self.flags.is_empty()
    }

    /// Its flags, or a name for the default.
    pub fn name(&self) -> &str {
        if self.is_default() { "default" } else { &self.flags }
    }

    /// Twice the standard error of the median ratio: of normal times it is 1.25 σ / √n, and a tenth lie beyond 1.28 σ. The
    /// default's own is none, as others' times are multiples of it.
    fn ratio_noise(&self) -> f64 {
        if self.is_default() {
            return 0.0;
        }
        2.0 * 1.25 * (self.ratio.high - self.ratio.low) / 2.56 / (self.cost.frames.max(1) as f64).sqrt()
    }
}

/// All configurations of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ladder {
    pub scene: String,
    #[serde(flatten)]
    pub machine: Machine,
    pub size: [u32; 2],
    /// The time that ratios compare: `GPU time`, or `processor time` on a software renderer.
    pub time: String,
    pub reference: ReferenceFacts,
    /// The default is the first.
    pub configs: Vec<Config>,
    pub notes: Vec<String>,
}

impl Ladder {
    /// Computes times as multiples of one default's, and which configuration dominates which.
    pub fn settle(&mut self) {
        let Some(default) = Spread::of(self.configs.iter().map(|config| config.default_gpu_ms).collect()) else {
            return;
        };
        for config in &mut self.configs {
            // The default's ratio to itself shows the noise; it is 1 by definition.
            config.ms = default.median * if config.is_default() { 1.0 } else { config.ratio.median };
        }
        let noise = |a: usize, b: usize| {
            let (a, b) = (&self.configs[a], &self.configs[b]);
            Score {
                ms: a.ratio_noise().hypot(b.ratio_noise()) * default.median,
                error: paired(&a.halves, &b.halves, a.error.flip - b.error.flip),
            }
        };
        let scores: Vec<Score> = self.configs.iter().map(Config::score).collect();
        let least = |a: usize, b: usize| {
            let noise = noise(a, b);
            // Errors differ by a factor of ten where light does: of the smaller one.
            let worth = scores[a].error.min(scores[b].error) * WORTH;
            Score { ms: noise.ms.max(default.median * WORTH), error: noise.error.max(worth) }
        };
        let flip_noise: Vec<f64> = (0..scores.len()).map(|index| noise(index, 0).error).collect();
        let dominated_by = dominated_by(&scores, least);
        let names: Vec<String> = self.configs.iter().map(|config| config.name().to_owned()).collect();
        for (index, config) in self.configs.iter_mut().enumerate() {
            config.flip_over_default = scores[index].error - scores[0].error;
            config.flip_noise = flip_noise[index];
            config.dominated_by = dominated_by[index].map(|by| names[by].clone());
        }
    }

    /// Combinations that are worth measuring, as flags, once each setting has been measured alone: a greedy walk from the default
    /// along the settings that save time, those first that lose least accuracy for it, each on top of those before; all
    /// that are quickest; and all that are most accurate.
    pub fn combinations(&self) -> Vec<String> {
        let Some((default, others)) = self.configs.split_first() else { return Vec::new() };
        let best = |key: fn(&Config) -> f64| {
            let is_single = |c: &&Config| settings::KNOWN.iter().all(|(dimension, _)| *dimension != c.dimension);
            let is_better = |c: &&Config| key(c) < (1.0 - WORTH) * key(default);
            let mut sorted: Vec<&Config> = others.iter().filter(is_single).filter(is_better).collect();
            sorted.sort_by(|a, b| key(a).total_cmp(&key(b)));
            let mut dimensions = Vec::new();
            sorted.retain(|config| {
                let is_first = !dimensions.contains(&&config.dimension);
                dimensions.push(&config.dimension);
                is_first
            });
            sorted
        };
        let mut quick = best(|config| config.ms);
        // Error per halving of the time; other shading last.
        let price = |c: &Config| (c.error.flip - default.error.flip) / (default.ms / c.ms).log2();
        let is_shading = |config: &Config| config.dimension == SHADING;
        quick.sort_by(|a, b| is_shading(a).cmp(&is_shading(b)).then(price(a).total_cmp(&price(b))));
        let joined = |configs: &[&Config]| configs.iter().map(|c| c.flags.as_str()).collect::<Vec<_>>().join(" ");
        let mut combined: Vec<String> = (2..=quick.len()).map(|count| joined(&quick[..count])).collect();
        combined.push(joined(&best(|config| config.error.flip)));
        // One alone has been measured.
        combined.retain(|flags| flags.matches("--").count() > 1);
        combined.dedup();
        combined
    }

    /// The verdict on the default, and whether the reference is accurate enough for it.
    pub fn verdict(&self) -> Vec<String> {
        let Some(default) = self.configs.first() else { return Vec::new() };
        let (scene, flip) = (&self.scene, default.error.flip);
        let subject = format!("{scene}: the default ({:.2} ms, FLIP {flip:.4})", default.ms);
        let by = default.dominated_by.as_ref().and_then(|by| self.configs.iter().find(|config| config.name() == by));
        let stands = by.map_or(format!("{subject} is on the Pareto front"), |by| {
            let (ratio, noise, name) = (by.ratio.median, by.ratio_noise(), by.name());
            let (over, flip_noise) = (by.flip_over_default, by.flip_noise);
            format!(
                "{subject} is dominated by {name}: {ratio:.2} ± {noise:.2} of its time, FLIP {over:+.5} ± {flip_noise:.5}"
            )
        });
        let mut lines = vec![stands];
        let floor = self.reference.floor.flip;
        if floor > 0.2 * flip {
            lines.push(format!(
                "{scene}: the reference picture's own error, FLIP {floor:.4}, is a large part of these; --full makes it smaller"
            ));
        }
        lines
    }

    /// The configuration that a limit chooses, or a message that none holds it.
    pub fn choice(&self, limit: Limit) -> std::result::Result<&Config, String> {
        let scores: Vec<Score> = self.configs.iter().map(Config::score).collect();
        limit.choose(&scores).map(|index| &self.configs[index]).ok_or_else(|| {
            let least = |of: fn(&Score) -> f64| scores.iter().map(of).fold(f64::INFINITY, f64::min);
            let there = match limit {
                Limit::Tolerance(_) => format!("FLIP {:.4}", least(|score| score.error)),
                Limit::BudgetMs(_) => format!("{:.2} ms", least(|score| score.ms)),
            };
            format!("{}: no setting is {limit}; the best has {there}", self.scene)
        })
    }

    /// A line that reports a choice.
    pub fn words(&self, limit: Limit, config: &Config) -> String {
        let (Self { scene, size: [width, height], .. }, Config { ms, error, .. }) = (self, config);
        let (name, date, seen) = (config.name(), &self.machine.date, self.reference.pixels_per_degree);
        let seen = if seen == PIXELS_PER_DEGREE { String::new() } else { format!(" at {seen} pixels per degree") };
        let flip = error.flip;
        format!("{scene}, {limit}: {name} ({ms:.2} ms, FLIP {flip:.4}{seen}, measured at {width}x{height} on {date})")
    }
}
