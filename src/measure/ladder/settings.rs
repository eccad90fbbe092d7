//! The settings that trade speed for accuracy, as command-line flags, alone and combined.

use clap::Parser;

use super::super::pareto::Score;
use crate::render::RenderSettings;
use crate::{Error, Result};

/// Settings and their values other than the default; one that is the default on this machine is not measured twice.
///
/// The table of the split sum has one size: a fragment's time does not depend on it, and what lookups lose is below 1e-3.
/// Irradiance comes from a map in all settings; spherical harmonics are only a way to fill it (`measure precompute`).
pub const DIMENSIONS: &[(&str, &[&str])] = &[
    (SHADING, &["--shading phong"]),
    ("masking", &["--geometry karis2013"]),
    ("scattering", &["--scattering single"]),
    ("split sum", &["--split-sum classic", "--split-sum slices"]),
    ("model", &["--model everything"]),
    ("mirrored light", &["--cube-size 32", "--cube-size 64", "--cube-size 128", "--cube-size 512", "--cube-size 1024"]),
    ("diffuse light", &["--irradiance-size 8", "--irradiance-size 64"]),
    ("samples", &["--samples 1"]),
    ("scale", &["--scale 0.5", "--scale 0.7", "--scale 0.85"]),
    ("texture storage", &["--textures raw", "--textures bc"]),
    ("texture size", &["--drop-levels 2", "--drop-levels 4"]),
    ("slanted textures", &["--anisotropy 1", "--anisotropy 4", "--anisotropy 16"]),
];

/// Combinations that others are known for.
pub const KNOWN: &[(&str, &str)] = &[("Karis 2013", "--geometry karis2013 --split-sum classic")];

/// Differences of time and error below this share of the default's do not count.
pub const WORTH: f64 = 0.01;

/// Other shading is combined last: most other settings do not affect it.
const SHADING: &str = "shading";

/// Not measured on a software renderer, which takes minutes for a frame.
pub const NOT_FOR_SOFTWARE: &[&str] = &["--anisotropy 4", "--anisotropy 16"];

/// A command line of render settings alone.
#[derive(Parser)]
#[command(no_binary_name = true)]
struct Flags {
    #[command(flatten)]
    options: RenderSettings,
}

/// Parses settings from flags that are separated by spaces.
///
/// # Errors
/// Flags that this program does not know, such as those of another version's ladder.
pub fn options(flags: &str) -> Result<RenderSettings> {
    let parsed = Flags::try_parse_from(flags.split_whitespace());
    parsed.map(|flags| flags.options).map_err(|_| Error::Usage(format!("`{flags}` are not settings of this program")))
}

/// A setting that was measured alone.
pub struct Single {
    pub dimension: String,
    pub flags: String,
    pub score: Score,
}

/// Combinations worth measuring, once each setting has been measured alone: a greedy walk from the default along the
/// settings that save time, those first that lose least accuracy for it, each on top of those before; all that are quickest;
/// and all that are most accurate.
pub fn combinations(default: Score, singles: &[Single]) -> Vec<String> {
    let best = |key: fn(&Single) -> f64, most: f64| {
        let mut sorted: Vec<&Single> = singles.iter().filter(|single| key(single) < (1.0 - WORTH) * most).collect();
        sorted.sort_by(|a, b| key(a).total_cmp(&key(b)));
        let mut dimensions = Vec::new();
        sorted.retain(|single| {
            let is_first = !dimensions.contains(&&single.dimension);
            dimensions.push(&single.dimension);
            is_first
        });
        sorted
    };
    let mut quick = best(|single| single.score.ms, default.ms);
    // Error per halving of the time; other shading last.
    let price = |single: &Single| (single.score.error - default.error) / (default.ms / single.score.ms).log2();
    quick.sort_by(|a, b| (a.dimension == SHADING).cmp(&(b.dimension == SHADING)).then(price(a).total_cmp(&price(b))));
    let joined = |singles: &[&Single]| singles.iter().map(|s| s.flags.as_str()).collect::<Vec<_>>().join(" ");
    let mut combined: Vec<String> = (2..=quick.len()).map(|count| joined(&quick[..count])).collect();
    combined.push(joined(&best(|single| single.score.error, default.error)));
    // One alone has been measured.
    combined.retain(|flags| flags.matches("--").count() > 1);
    combined.dedup();
    combined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_one_of_the_program_s() {
        for flags in DIMENSIONS.iter().flat_map(|(_, all)| *all).chain(KNOWN.iter().map(|(_, flags)| flags)) {
            assert_ne!(options(flags).unwrap(), RenderSettings::default(), "{flags}");
        }
        assert_eq!(options("").unwrap(), RenderSettings::default());
        assert!(matches!(options("--antialiasing 4"), Err(Error::Usage(_))));
        assert!(NOT_FOR_SOFTWARE.iter().all(|flags| DIMENSIONS.iter().any(|(_, all)| all.contains(flags))));
    }

    #[test]
    fn combinations_go_from_the_best_bargain_to_the_quickest_and_the_most_accurate() {
        let default = Score { ms: 8.0, error: 0.010 };
        let single = |dimension, flags, ms, error| Single {
            dimension: String::from(dimension),
            flags: String::from(flags),
            score: Score { ms, error },
        };
        let singles = [
            single("shading", "--p", 2.0, 0.2),
            single("scale", "--s 1", 4.0, 0.030),
            single("scale", "--s 2", 6.0, 0.020),
            single("cube", "--c 1", 7.0, 0.011),
            single("cube", "--c 2", 9.0, 0.009),
            single("model", "--m", 10.0, 0.010),
            single("samples", "--n", 4.0, 0.012),
            single("slant", "--a", 9.0, 0.008),
        ];
        let expected = ["--n --c 1", "--n --c 1 --s 1", "--n --c 1 --s 1 --p", "--a --c 2"];
        assert_eq!(combinations(default, &singles), expected);
        assert_eq!(combinations(default, &singles[5..6]), [""; 0], "what is slower alone is tried with nothing");
    }
}
