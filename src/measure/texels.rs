//! The texels of a map that are judged, and their errors.

use std::collections::HashSet;

use glam::{DVec2, DVec3};
use serde::Serialize;

use crate::reference::cube::cube_direction;

/// A texel of a cube map: column, row, face.
pub type Texel = [u32; 3];

/// Up to `most` texels of a cube of `size`² faces, evenly spread, the same at every call; all if there are no more.
///
/// Columns and rows follow the sequence of multiples of 1/g and 1/g², g³ = g + 1, which leaves no gaps (Roberts, "The
/// Unreasonable Effectiveness of Quasirandom Sequences", 2018); faces take turns.
pub fn spread_texels(size: u32, most: usize) -> Vec<Texel> {
    let all = 6 * u64::from(size).pow(2);
    if all <= most as u64 {
        return (0..6).flat_map(|face| (0..size).flat_map(move |y| (0..size).map(move |x| [x, y, face]))).collect();
    }
    const G: f64 = 1.324_717_957_244_746;
    let (mut seen, mut texels) = (HashSet::new(), Vec::new());
    for i in 0u32.. {
        let at = |step: f64| ((0.5 + f64::from(i / 6) * step).fract() * f64::from(size)) as u32;
        let texel = [at(1.0 / G), at(1.0 / (G * G)), i % 6];
        if seen.insert(texel) {
            texels.push(texel);
        }
        // Rounding may close the sequence before it has met every texel; half of them it surely meets.
        if texels.len() >= most.min(all as usize / 2) {
            break;
        }
    }
    texels
}

/// Unit direction of a texel's centre.
pub fn texel_direction([x, y, face]: Texel, size: u32) -> DVec3 {
    cube_direction(face, (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / f64::from(size))
}

/// Relative errors of a map's texels: Σ|value − truth| / Σ truth, both over the three channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    pub mean: f64,
    /// 95 of 100 texels are no worse.
    pub p95: f64,
    pub max: f64,
}

impl Accuracy {
    /// The errors of at least one value; an exact value of zero counts as the smallest normal number, to avoid NaN.
    pub fn new(values: &[DVec3], truths: &[DVec3]) -> Self {
        let error = |(value, truth): (&DVec3, &DVec3)| {
            (*value - *truth).abs().element_sum() / truth.element_sum().max(f64::MIN_POSITIVE)
        };
        let mut errors: Vec<f64> = values.iter().zip(truths).map(error).collect();
        errors.sort_by(f64::total_cmp);
        let last = errors.len().saturating_sub(1);
        let at = |i: usize| errors.get(i).copied().unwrap_or(f64::INFINITY);
        let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        Self { mean, p95: at((0.95 * last as f64).ceil() as usize), max: at(last) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_distinct_and_spread_over_every_face() {
        assert_eq!(spread_texels(4, 96).len(), 96);
        for (size, most) in [(4, 95), (8, 100), (256, 600)] {
            let texels = spread_texels(size, most);
            assert!(texels.len() >= most.min(3 * (size * size) as usize), "{}", texels.len());
            let distinct: HashSet<_> = texels.iter().collect();
            assert_eq!(distinct.len(), texels.len());
            for face in 0..6 {
                for quarter in 0..4 {
                    let inside = |t: &&Texel| t[2] == face && (2 * t[0] / size) + 2 * (2 * t[1] / size) == quarter;
                    assert!(texels.iter().filter(inside).count() >= most / 48, "{size} {face} {quarter}");
                }
            }
        }
    }

    #[test]
    fn errors_are_relative_and_sorted() {
        let truths = vec![DVec3::splat(2.0); 100];
        let values: Vec<DVec3> = (0..100).map(|i| DVec3::splat(2.0 + 0.02 * f64::from(i))).collect();
        let Accuracy { mean, p95, max } = Accuracy::new(&values, &truths);
        assert!((mean - 0.495).abs() < 1e-12 && (p95 - 0.95).abs() < 1e-12 && (max - 0.99).abs() < 1e-12);
        assert_eq!(Accuracy::new(&[DVec3::ZERO], &[DVec3::ZERO]).max, 0.0);
    }
}
