//! The texels of a map that are judged, and their errors.

use glam::{DVec2, DVec3};
use serde::Serialize;

use crate::reference::cube::cube_direction;
use crate::reference::sampling::hammersley;

/// A texel of a cube map: column, row, face.
pub type Texel = [u32; 3];

/// Up to 2^`log2` texels of each face of a cube of `size`² faces, evenly spread; all if there are no more.
pub fn spread_texels(size: u32, log2: u32) -> Vec<Texel> {
    let on_face: Vec<[u32; 2]> = if size * size <= 1 << log2 {
        (0..size * size).map(|i| [i % size, i / size]).collect()
    } else {
        let middle = 0.5 / f64::from(1 << log2);
        let texel = |i| ((hammersley(i, log2) + middle) * f64::from(size)).as_uvec2().to_array();
        (0..1 << log2).map(texel).collect()
    };
    (0..6).flat_map(|face| on_face.iter().map(move |[x, y]| [*x, *y, face])).collect()
}

/// Unit direction of a texel's centre.
pub fn texel_direction([x, y, face]: Texel, size: u32) -> DVec3 {
    cube_direction(face, (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / f64::from(size))
}

/// Relative errors: Σ|value − other| / Σ truth, both over the three channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    pub mean: f64,
    /// 95 of 100 texels are no worse.
    pub p95: f64,
    pub max: f64,
}

impl Accuracy {
    /// The errors of at least one value; an exact value of zero counts as the smallest normal number, to avoid NaN.
    pub fn new(values: &[DVec3], others: &[DVec3], truths: &[DVec3]) -> Self {
        let truths = truths.iter().map(|truth| truth.element_sum().max(f64::MIN_POSITIVE));
        let differences = values.iter().zip(others).map(|(value, other)| (*value - *other).abs().element_sum());
        let mut errors: Vec<f64> = differences.zip(truths).map(|(difference, truth)| difference / truth).collect();
        errors.sort_by(f64::total_cmp);
        let last = errors.len().saturating_sub(1);
        let at = |i: usize| errors.get(i).copied().unwrap_or(f64::INFINITY);
        let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        Self { mean, p95: at((0.95 * last as f64).ceil() as usize), max: at(last) }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn texels_are_distinct_and_spread_over_every_face() {
        for (size, log2, count) in [(4, 6, 96), (8, 4, 96), (256, 8, 1536)] {
            let texels = spread_texels(size, log2);
            let distinct: HashSet<_> = texels.iter().collect();
            assert_eq!([distinct.len(), texels.len()], [count; 2]);
            for face in 0..6 {
                for quarter in 0..4 {
                    let inside = |t: &&Texel| t[2] == face && (2 * t[0] / size) + 2 * (2 * t[1] / size) == quarter;
                    assert_eq!(texels.iter().filter(inside).count(), count / 24, "{size} {face} {quarter}");
                }
            }
        }
    }

    #[test]
    fn errors_are_relative_and_sorted() {
        let truths = vec![DVec3::splat(2.0); 100];
        let values: Vec<DVec3> = (0..100).map(|i| DVec3::splat(2.0 + 0.02 * f64::from(i))).collect();
        let Accuracy { mean, p95, max } = Accuracy::new(&values, &truths, &truths);
        assert!((mean - 0.495).abs() < 1e-12 && (p95 - 0.95).abs() < 1e-12 && (max - 0.99).abs() < 1e-12);
        assert_eq!(Accuracy::new(&[DVec3::ZERO], &[DVec3::ZERO], &[DVec3::ZERO]).max, 0.0);
    }
}
