//! How finely shadows, soft light and reflection probes are computed: settings for speed against error.

use clap::Args;

use crate::precompute::check_face_size;
use crate::scene::atlas::SIDES;

/// Samples of a lightmap's texel at last by default, a power of two, and how many of them are taken at once.
pub const SAMPLES: u32 = 64;
pub const AT_ONCE: u32 = 8;
/// Texels along a face of the probes' specular levels 0 and 1 by default.
pub const FACE: u32 = 128;
/// Most samples of a lightmap's texel.
const MOST_SAMPLES: u32 = 4096;
/// Texels along the sun's shadow map, in powers of two.
const SHADOW_SIZES: std::ops::RangeInclusive<u32> = 256..=8192;

/// The sizes of shadow maps, lightmap and probes; whatever is left out is chosen for scene and GPU.
#[derive(Args, Clone, Copy, Debug, PartialEq)]
pub struct LightDetail {
    /// Texels along the sun's shadow map, a power of two from 256 to 8192, and half as many along each face of a lamp's,
    /// as far as there is memory; 0: no shadow maps. What suits the GPU if left out.
    #[arg(long, value_name = "N", value_parser = parse_shadow_size)]
    pub shadow_size: Option<u32>,
    /// Texels along the lightmap: 64, 96, 128, 192, 256, 384, 512 and so on up to 2048. What suits the scene's extent if left out.
    #[arg(long, value_name = "N", value_parser = parse_lightmap_size)]
    pub lightmap_size: Option<u32>,
    /// Samples of the light that each of its texels gets: a power of two from 8 to 4096.
    #[arg(long, value_name = "N", default_value_t = SAMPLES, value_parser = parse_lightmap_samples)]
    pub lightmap_samples: u32,
    /// Texels along a face of the probes that rooms are mirrored by: a power of two from 16 to 1024, or 0 for no probes.
    #[arg(long, value_name = "N", default_value_t = FACE, value_parser = parse_probe_size)]
    pub probe_size: u32,
}

impl Default for LightDetail {
    fn default() -> Self {
        Self { shadow_size: None, lightmap_size: None, lightmap_samples: SAMPLES, probe_size: FACE }
    }
}

impl LightDetail {
    /// Whether shadow maps are drawn where something casts shadows.
    pub fn has_shadow_maps(&self) -> bool {
        self.shadow_size != Some(0)
    }
}

type Parsed = std::result::Result<u32, String>;

fn parse_if(text: &str, fits: impl Fn(u32) -> bool, expected: String) -> Parsed {
    text.parse().ok().filter(|number| fits(*number)).ok_or(expected)
}

fn parse_shadow_size(text: &str) -> Parsed {
    let [least, most] = [SHADOW_SIZES.start(), SHADOW_SIZES.end()];
    let fits = |size: u32| size == 0 || (size.is_power_of_two() && SHADOW_SIZES.contains(&size));
    parse_if(text, fits, format!("0, or a power of two from {least} to {most}"))
}

fn parse_lightmap_size(text: &str) -> Parsed {
    parse_if(text, |size| SIDES.contains(&size), format!("one of {SIDES:?}"))
}

fn parse_lightmap_samples(text: &str) -> Parsed {
    let fits = |samples: u32| samples.is_power_of_two() && (AT_ONCE..=MOST_SAMPLES).contains(&samples);
    parse_if(text, fits, format!("a power of two from {AT_ONCE} to {MOST_SAMPLES}"))
}

fn parse_probe_size(text: &str) -> Parsed {
    parse_if(text, |size| size == 0 || check_face_size(size).is_ok(), "0, or a power of two from 16 to 1024".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_sizes_that_can_be_made_are_taken() {
        type Parse = fn(&str) -> Parsed;
        let cases: [(Parse, &[&str], &[&str]); 4] = [
            (parse_shadow_size, &["0", "256", "8192"], &["1", "128", "300", "16384", "-1", "x"]),
            (parse_lightmap_size, &["64", "96", "384", "512", "2048"], &["0", "32", "4096", "600"]),
            (parse_lightmap_samples, &["8", "64", "4096"], &["0", "4", "24", "8192", ""]),
            (parse_probe_size, &["0", "16", "1024"], &["8", "2048", "100", "99999999999"]),
        ];
        for (parse, good, bad) in cases {
            assert!(good.iter().all(|text| parse(text) == Ok(text.parse().unwrap())), "{good:?}");
            assert!(bad.iter().all(|text| parse(text).is_err()), "{bad:?}");
        }
    }
}
