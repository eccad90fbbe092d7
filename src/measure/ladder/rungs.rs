//! The settings that trade speed for accuracy: each as what stands on the command line, alone and combined.

use clap::Parser;

use super::front::Mark;
use crate::view::QualityOptions;
use crate::{Error, Result};

/// What can be set, and to what other than the default; a setting that is the default here is not measured twice.
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

/// Ways of others that are settings together.
pub const KNOWN: &[(&str, &str)] = &[("Karis 2013", "--geometry karis2013 --split-sum classic")];

/// Settings that save less of time or error, as parts of the default's, are not worth combining, nor a place on the front.
pub const WORTH: f64 = 0.01;

/// Other shading stands for itself: most other settings do nothing to it.
const SHADING: &str = "shading";

/// What a software renderer takes minutes a frame for.
pub const NOT_FOR_SOFTWARE: &[&str] = &["--anisotropy 4", "--anisotropy 16"];

/// The command line that has a look only.
#[derive(Parser)]
#[command(no_binary_name = true)]
struct Flags {
    #[command(flatten)]
    look: QualityOptions,
}

/// The look that flags, parted by spaces, stand for.
///
/// # Errors
/// Flags that this program does not know, such as those of another version's ladder.
pub fn look(flags: &str) -> Result<QualityOptions> {
    let parsed = Flags::try_parse_from(flags.split_whitespace());
    parsed.map(|flags| flags.look).map_err(|_| Error::Usage(format!("`{flags}` are no settings of this program")))
}

/// A setting's dimension, flags and how it came out.
pub struct Single<'a> {
    pub dimension: &'a str,
    pub flags: &'a str,
    pub mark: Mark,
}

/// What is worth trying together, once each setting has been measured alone: a greedy walk from the default along the
/// settings that save time, those first that give away least for it, each on top of those before; all that are quickest;
/// and all that are most accurate.
pub fn combinations(default: Mark, singles: &[Single<'_>]) -> Vec<String> {
    let of = |wanted: fn(&Single<'_>, &Single<'_>) -> bool| {
        let mut best: Vec<&Single<'_>> = Vec::new();
        for single in singles {
            match best.iter_mut().find(|known| known.dimension == single.dimension) {
                Some(known) if wanted(single, known) => *known = single,
                Some(_) => {}
                None => best.push(single),
            }
        }
        best
    };
    let mut quick = of(|a, b| a.mark.ms < b.mark.ms);
    quick.retain(|single| single.mark.ms < (1.0 - WORTH) * default.ms);
    // Error per halving of the time.
    let price = |single: &Single<'_>| (single.mark.error - default.error) / (default.ms / single.mark.ms).log2();
    quick.sort_by(|a, b| price(a).total_cmp(&price(b)));
    let joined = |singles: &[&Single<'_>]| singles.iter().map(|s| s.flags).collect::<Vec<_>>().join(" ");
    let physical: Vec<&Single<'_>> = quick.iter().filter(|s| s.dimension != SHADING).copied().collect();
    let mut combined: Vec<String> = (2..=physical.len()).map(|count| joined(&physical[..count])).collect();
    combined.push(joined(&quick));
    let mut accurate = of(|a, b| a.mark.error < b.mark.error);
    accurate.retain(|single| single.mark.error < (1.0 - WORTH) * default.error);
    combined.push(joined(&accurate));
    // One alone has been measured.
    combined.retain(|flags| flags.matches("--").count() > 1);
    let mut kept: Vec<String> = Vec::new();
    combined.into_iter().for_each(|flags| {
        if !kept.contains(&flags) {
            kept.push(flags);
        }
    });
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_one_of_the_program_s() {
        for flags in DIMENSIONS.iter().flat_map(|(_, all)| *all).chain(KNOWN.iter().map(|(_, flags)| flags)) {
            assert_ne!(look(flags).unwrap(), QualityOptions::default(), "{flags}");
        }
        assert_eq!(look("").unwrap(), QualityOptions::default());
        assert!(matches!(look("--antialiasing 4"), Err(Error::Usage(_))));
        assert!(NOT_FOR_SOFTWARE.iter().all(|flags| DIMENSIONS.iter().any(|(_, all)| all.contains(flags))));
    }

    #[test]
    fn combinations_go_from_the_best_bargain_to_the_quickest_and_the_most_accurate() {
        let default = Mark { ms: 8.0, error: 0.010 };
        let single = |dimension, flags, ms, error| Single { dimension, flags, mark: Mark { ms, error } };
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
        let expected = ["--n --c 1", "--n --c 1 --s 1", "--n --c 1 --s 1 --p", "--c 2 --a"];
        assert_eq!(combinations(default, &singles), expected);
        assert_eq!(combinations(default, &singles[5..6]), [""; 0], "what is slower alone is tried with nothing");
    }
}
