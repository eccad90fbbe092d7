//! Equirectangular HDR panoramas: the light of a scene.

use std::f32::consts::{PI, TAU};
use std::path::Path;

use glam::{Vec2, Vec3};

use super::radiance_image::RadianceImage;
use super::{Report, file, openexr, radiance};
use crate::{Error, Result};

/// Largest accepted width and height: 1.6 GB in memory.
const MAX_SIZE: (u64, u64) = (16384, 8192);
const MAX_FILE_BYTES: u64 = 2 << 30;

/// Linear RGB radiance over the sphere; every value is finite and not negative.
///
/// Direction d of texel centre (u, v), v from the top: u = atan2(d.z, d.x)/2π + 0.5, v = 0.5 − asin(d.y)/π.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    /// For messages and GPU debug names.
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// Rows from the top; `width * height` texels, in f32 and not clamped.
    pub texels: Vec<[f32; 3]>,
}

impl Panorama {
    /// Reads a Radiance (.hdr) or OpenEXR file; its first bytes decide which it is.
    ///
    /// Values that are negative or not finite become 0, with a warning.
    ///
    /// # Errors
    /// The file cannot be read, has neither format, is broken, or is larger than 16384×8192.
    pub fn load(path: &Path, report: &Report) -> Result<Self> {
        let bytes = file::read(path, "panorama", MAX_FILE_BYTES)?;
        let decoded = if openexr::is_openexr(&bytes) {
            openexr::decode(path, &bytes, check_size, report)?
        } else if radiance::is_radiance(&bytes) {
            radiance::decode(path, &bytes, check_size)?
        } else {
            return Err(Error::Broken {
                path: path.into(),
                what: "panorama",
                problem: "it is neither a Radiance (.hdr) nor an OpenEXR (.exr) picture".into(),
                remedy: "give an equirectangular picture in one of the two formats",
            });
        };
        let RadianceImage { width, height, mut texels } = decoded;
        if width != height * 2 {
            let name = file::short_name(path);
            report.warn(format!(
                "{name}: {width}x{height} is not twice as wide as high; stretched over the whole sphere"
            ));
        }
        clear_unusable(path, width, &mut texels, report);
        Ok(Self { name: file::short_name(path), width, height, texels })
    }

    /// The same radiance from all directions.
    pub fn uniform(radiance: Vec3) -> Self {
        Self::from_fn(8, 4, |_| radiance)
    }

    /// A panorama whose texels are `radiance_from(direction of the texel's centre)`.
    pub fn from_fn(width: u32, height: u32, radiance_from: impl Fn(Vec3) -> Vec3) -> Self {
        let mut panorama = Self { name: "computed".into(), width, height, texels: Vec::new() };
        panorama.texels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| radiance_from(panorama.direction(x, y)).to_array())
            .collect();
        panorama
    }

    /// Unit direction of the centre of texel (x, y), y from the top.
    pub fn direction(&self, x: u32, y: u32) -> Vec3 {
        let azimuth = ((x as f32 + 0.5) / self.width as f32 - 0.5) * TAU;
        let elevation = (0.5 - (y as f32 + 0.5) / self.height as f32) * PI;
        Vec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin())
    }

    /// Where a unit direction lies in the picture: (u, v) in 0..=1, v from the top.
    pub fn uv(direction: Vec3) -> Vec2 {
        let u = direction.z.atan2(direction.x) / TAU + 0.5;
        Vec2::new(u, 0.5 - direction.y.clamp(-1.0, 1.0).asin() / PI)
    }
}

/// Whether a panorama of this size is accepted; called before memory is allocated for it.
fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
    if width == 0 || height == 0 {
        let remedy = "save it again as Radiance RGBE (.hdr) or OpenEXR";
        return Err(Error::Broken { path: path.into(), what: "panorama", problem: "it is empty".into(), remedy });
    }
    if width > MAX_SIZE.0 || height > MAX_SIZE.1 {
        let limit = format!("{}x{}", MAX_SIZE.0, MAX_SIZE.1);
        return Err(Error::TooLarge { path: path.into(), what: "panorama", size: format!("{width}x{height}"), limit });
    }
    Ok(())
}

/// Negative values down to this part of the mean radiance are ringing of lossy compression around bright texels.
const RINGING: f64 = 0.01;

/// Sets negative and non-finite values to 0: a single NaN would spread over the whole last level of every filtered map.
fn clear_unusable(path: &Path, width: u32, texels: &mut [[f32; 3]], report: &Report) {
    let unusable = |texel: &[f32; 3]| !texel.iter().all(|v| v.is_finite() && *v >= 0.0);
    let bad: Vec<usize> = (0..texels.len()).filter(|i| unusable(&texels[*i])).collect();
    let Some(first) = bad.first() else { return };
    let (x, y) = (first % width as usize, first / width as usize);
    // A NaN or an infinity is never ringing.
    let lowest = bad
        .iter()
        .flat_map(|i| texels[*i])
        .fold(0.0, |low, v| if v.is_finite() { f32::min(low, v) } else { f32::NEG_INFINITY });
    for i in &bad {
        texels[*i] = texels[*i].map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 });
    }
    let sum: f64 = texels.iter().flatten().map(|v| f64::from(*v)).sum();
    let mean = sum / (3 * texels.len()) as f64;
    let (name, count) = (file::short_name(path), bad.len());
    let message =
        format!("{name}: {count} texel(s) with negative or non-finite values, the first at ({x}, {y}); set to 0");
    if f64::from(lowest) < -RINGING * mean {
        report.warn(message);
    } else {
        tracing::info!("{message}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_follow_the_convention() {
        let panorama = Panorama::uniform(Vec3::ONE);
        assert_eq!((panorama.width, panorama.height, panorama.texels.len()), (8, 4, 32));
        for y in 0..4 {
            for x in 0..8 {
                let d = panorama.direction(x, y);
                assert!(d.is_normalized());
                let expected = Vec2::new((x as f32 + 0.5) / 8.0, (y as f32 + 0.5) / 4.0);
                assert!((Panorama::uv(d) - expected).length() < 1e-6, "{x} {y}");
            }
        }
        assert_eq!(Panorama::uv(Vec3::X), Vec2::new(0.5, 0.5));
        assert_eq!(Panorama::uv(Vec3::Z), Vec2::new(0.75, 0.5));
        assert_eq!(Panorama::uv(Vec3::Y).y, 0.0);
        assert_eq!(Panorama::uv(Vec3::NEG_Y * 1.000_000_1).y, 1.0, "a unit vector may be an ulp too long");
    }

    #[test]
    fn from_fn_puts_the_sky_at_the_top() {
        let p = Panorama::from_fn(4, 2, |d| Vec3::splat(f32::from(u8::from(d.y > 0.0))));
        assert_eq!((p.texels[0], p.texels[7]), ([1.0; 3], [0.0; 3]));
    }

    #[test]
    fn content_decides_the_format_not_the_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("really-radiance.exr");
        std::fs::write(&path, b"#?RADIANCE\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81").unwrap();
        assert_eq!(Panorama::load(&path, &Report::silent()).unwrap().texels, [[1.0; 3]; 2]);
        std::fs::write(&path, b"GIF89a").unwrap();
        assert!(matches!(Panorama::load(&path, &Report::silent()), Err(Error::Broken { .. })));
    }

    #[test]
    fn unusable_values_become_zero_with_a_warning() {
        let report = Report::silent();
        let mut texels = [[1.0; 3], [0.5, f32::NAN, 2.0], [1.0; 3], [f32::INFINITY, -1.0, 3.0]];
        clear_unusable(Path::new("sky.exr"), 2, &mut texels, &report);
        assert_eq!(texels, [[1.0; 3], [0.5, 0.0, 2.0], [1.0; 3], [0.0, 0.0, 3.0]]);
        assert_eq!(report.warnings().len(), 1);
        assert!(report.warnings()[0].contains("2 texel(s)") && report.warnings()[0].contains("(1, 0)"));
    }
}
