//! How different two pictures are: FLIP and other metrics, of pictures of one size and kind.

use std::path::PathBuf;

use glam::Vec3;
use serde::Serialize;

use super::picture::{Kind, Picture};
use crate::reference::metrics;
use crate::{Error, Result};

/// The difference of two pictures, as `pbr-vr compare --json` writes it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub width: u32,
    pub height: u32,
    /// What the numbers below compare: `Display` sRGB-encoded values, `Radiance` linear ones.
    pub kind: Kind,
    /// LDR-FLIP of the pictures' eight-bit display values; radiance goes through the program's tone curve at 0 EV
    /// first.
    pub flip_mean: f32,
    pub flip_max: f32,
    /// Pixels per degree of visual angle: the viewing distance.
    pub flip_pixels_per_degree: f32,
    /// Mean of (test − reference)² / (reference² + 0.01) over pixels and channels.
    pub relative_mse: f64,
    /// Sum of |test − reference| over the sum of |reference|, of all pixels and channels; infinite (`null` in JSON) where only
    /// the reference is black.
    pub relative_l1: f64,
    /// Mean and largest |test − reference| of a channel.
    pub mean_error: f64,
    pub max_error: f64,
    /// Column and row, from the top left, of the largest error.
    pub max_error_at: [u32; 2],
    /// FLIP of each pixel, rows from the top.
    #[serde(skip)]
    pub flip: Vec<f32>,
}

impl Comparison {
    /// FLIP of each pixel as a picture, dark where the two agree.
    pub fn flip_map(&self) -> Picture {
        let pixels = metrics::flip_colours(&self.flip).into_iter().map(|p| p.map(|c| f32::from(c) / 255.0)).collect();
        Picture { name: "FLIP".into(), width: self.width, height: self.height, kind: Kind::Display, pixels }
    }
}

/// Compares two pictures at [`metrics::PIXELS_PER_DEGREE`].
///
/// # Errors
/// Their sizes or kinds differ, or a value is not finite.
pub fn compare(test: &Picture, reference: &Picture) -> Result<Comparison> {
    compare_seen(test, reference, metrics::PIXELS_PER_DEGREE)
}

/// The same for another viewing distance, in [`metrics::PIXELS_PER_DEGREE_RANGE`].
///
/// # Errors
/// As for [`compare`], and where the distance is out of range.
pub fn compare_seen(test: &Picture, reference: &Picture, pixels_per_degree: f32) -> Result<Comparison> {
    check_pair(test, reference)?;
    let size @ [width, height] = [test.width, test.height];
    let flip = metrics::flip(size, &test.srgb8(0.0), &reference.srgb8(0.0), pixels_per_degree).ok_or_else(|| {
        let count = test.pixels.len();
        unusable(test, format!("{count} pixels for {width} × {height}, {pixels_per_degree} to a degree"))
    })?;
    let (max_error, at) = metrics::max_error(&test.pixels, &reference.pixels);
    Ok(Comparison {
        width,
        height,
        kind: test.kind,
        flip_mean: flip.mean,
        flip_max: flip.max,
        flip_pixels_per_degree: pixels_per_degree,
        relative_mse: metrics::relative_mse(&test.pixels, &reference.pixels),
        relative_l1: metrics::relative_l1(&test.pixels, &reference.pixels),
        mean_error: metrics::mean_error(&test.pixels, &reference.pixels),
        max_error,
        max_error_at: [at as u32 % width, at as u32 / width],
        flip: flip.errors,
    })
}

fn check_pair(test: &Picture, reference: &Picture) -> Result<()> {
    if (test.width, test.height) != (reference.width, reference.height) {
        let Picture { name, width, height, .. } = reference;
        let problem = format!("{} × {} pixels, but {name} has {width} × {height}", test.width, test.height);
        return Err(unusable(test, problem));
    }
    if test.kind != reference.kind {
        let what = |kind| if kind == Kind::Display { "display values" } else { "linear radiance" };
        let problem = format!("it holds {}, but {} {}", what(test.kind), reference.name, what(reference.kind));
        return Err(unusable(test, problem));
    }
    for picture in [test, reference] {
        if let Some(at) = picture.pixels.iter().position(|p| !Vec3::from(*p).is_finite()) {
            let (x, y) = (at as u32 % picture.width.max(1), at as u32 / picture.width.max(1));
            return Err(unusable(picture, format!("pixel ({x}, {y}) is not finite: {:?}", picture.pixels[at])));
        }
    }
    Ok(())
}

fn unusable(picture: &Picture, problem: String) -> Error {
    let remedy = "compare two PNGs or two EXRs of one size, without NaN or infinity";
    Error::Broken { path: PathBuf::from(&picture.name), what: "picture for this comparison", problem, remedy }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn display() -> Picture {
        let bytes: Vec<u8> = (0..23 * 11).flat_map(|i| [i as u8, (i * 7) as u8, (i * 31) as u8, 255]).collect();
        Picture::from_srgb8("display", 23, 11, &bytes)
    }

    fn radiance() -> Picture {
        let values: Vec<_> = (0..23 * 11).map(|i| [i as f32 * 300.0, 1e-5 * i as f32, 0.3, 1.0]).collect();
        Picture::from_radiance("radiance", 23, 11, &values)
    }

    #[test]
    fn comparisons_measure() {
        for picture in [display(), radiance()] {
            let same = compare(&picture, &picture).unwrap();
            assert_eq!((same.flip_mean, same.relative_mse, same.relative_l1, same.max_error), (0.0, 0.0, 0.0, 0.0));
        }
        let mut dim = radiance();
        dim.pixels[5 * 23 + 7] = [0.1, 0.1, 0.3];
        let mut other = dim.clone();
        other.pixels[5 * 23 + 7][2] = 2.3;
        let far = compare(&other, &dim).unwrap();
        assert!((far.max_error - 2.0).abs() < 1e-6 && far.max_error_at == [7, 5], "{far:?}");
        let truth = 4.0 / (0.09 + 0.01) / (3.0 * 23.0 * 11.0);
        assert!((far.relative_mse / truth - 1.0).abs() < 1e-5, "{far:?}");
        assert!(far.flip_mean > 0.0 && far.flip_max > far.flip_mean);
        let map = far.flip_map();
        let brightest = (0..map.pixels.len()).max_by(|a, b| map.pixels[*a][0].total_cmp(&map.pixels[*b][0])).unwrap();
        assert_eq!((map.width, map.height, brightest), (23, 11, 5 * 23 + 7));
        let json = serde_json::to_value(&far).unwrap();
        assert_eq!(json["kind"], "radiance");
        assert_eq!(json["max_error_at"][1], 5);
    }

    #[test]
    fn pictures_that_do_not_match_are_errors() {
        let small = Picture { width: 11, height: 23, ..display() };
        let error = compare(&small, &display()).unwrap_err().to_string();
        assert!(error.contains("11 × 23") && error.contains("23 × 11"), "{error}");
        let error = compare(&radiance(), &display()).unwrap_err().to_string();
        assert!(error.contains("radiance"), "{error}");
        let mut bad = radiance();
        bad.pixels[24][0] = f32::NAN;
        let error = compare(&radiance(), &bad).unwrap_err().to_string();
        assert!(error.contains("(1, 1)"), "{error}");
        let empty = Picture { width: 0, height: 0, pixels: vec![], ..display() };
        assert!(compare(&empty, &empty).is_err());
        assert!(compare_seen(&display(), &display(), 0.0).unwrap_err().to_string().contains("0 to a degree"));
    }
}
