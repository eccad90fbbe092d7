//! The settings that trade speed for accuracy, as command-line flags, alone and combined.

use clap::Parser;

use crate::render::RenderSettings;
use crate::{Error, Result};

/// Settings and their values other than the default; one that is the default on this machine is not measured twice.
///
/// The table of the split sum has one size: a fragment's time does not depend on it, and what lookups lose is below 1e-3.
/// Irradiance comes from a map in all settings; spherical harmonics are only a way to fill it (`measure precompute`).
pub const DIMENSIONS: &[(&str, &[&str])] = &[
    (SHADING, &["--shading phong"]),
    // One dimension: none but baked light has a lightmap and probes.
    (
        "light",
        &[
            "--light open",
            "--light direct",
            "--light direct --shadow-size 512",
            "--light direct --shadow-size 4096",
            "--light baked",
            "--light baked --shadow-size 512",
            "--light baked --shadow-size 4096",
            "--light baked --shadow-size 8192",
            "--light baked --lightmap-size 256",
            "--light baked --lightmap-size 512",
            "--light baked --lightmap-size 1024",
            "--light baked --lightmap-size 2048",
            "--light baked --lightmap-samples 16",
            "--light baked --lightmap-samples 256",
            "--light baked --probe-size 0",
            "--light baked --probe-size 64",
            "--light baked --probe-size 256",
        ],
    ),
    ("masking", &["--geometry karis2013"]),
    ("scattering", &["--scattering single"]),
    ("split sum", &["--split-sum classic", "--split-sum moment", "--split-sum one-lobe"]),
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

/// Differences of time below this share of the default's do not count, nor of error below this share of the smaller one.
pub const WORTH: f64 = 0.01;

/// Other shading is combined last: most other settings do not affect it.
pub const SHADING: &str = "shading";

/// Not measured on a software renderer, which takes minutes for a frame, or for the light before the first one.
pub const NOT_FOR_SOFTWARE: &[&str] = &[
    "--anisotropy 4",
    "--anisotropy 16",
    "--light baked --shadow-size 8192",
    "--light baked --lightmap-size 1024",
    "--light baked --lightmap-size 2048",
    "--light baked --lightmap-samples 256",
    "--light baked --probe-size 256",
];

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_one_of_the_program_s() {
        for flags in DIMENSIONS.iter().flat_map(|(_, all)| *all).chain(KNOWN.iter().map(|(_, flags)| flags)) {
            let is_default = options(flags).unwrap() == RenderSettings::default();
            // One model of light is the default, whichever.
            assert!(!is_default || flags.strip_prefix("--light ").is_some_and(|model| !model.contains(' ')), "{flags}");
        }
        assert_eq!(options("").unwrap(), RenderSettings::default());
        assert!(matches!(options("--antialiasing 4"), Err(Error::Usage(_))));
        assert!(NOT_FOR_SOFTWARE.iter().all(|flags| DIMENSIONS.iter().any(|(_, all)| all.contains(flags))));
    }
}
