//! Differences of two pictures: FLIP, relative MSE, relative L1, mean and maximum error.

use std::ops::RangeInclusive;

/// Default pixels per degree of visual angle for FLIP: 0.7 m from a screen of 0.7 m and 3840 pixels
/// across, the default of Andersson et al., "FLIP: A Difference Evaluator for Alternating Images" (2020), section 6.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// Pixels per degree that FLIP accepts: with fewer its narrowest filter (standard deviation 0.041 degrees) falls
/// between pixels; with more, filters are wider than 130 pixels, beyond any display (the eye resolves about 120).
pub const PIXELS_PER_DEGREE_RANGE: RangeInclusive<f32> = 4.0..=500.0;

/// Mean and maximum of a FLIP error map, both in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    pub mean: f32,
    pub max: f32,
    /// Each pixel's, rows from the top.
    pub errors: Vec<f32>,
}

/// LDR-FLIP (Andersson et al. 2020) of two pictures of sRGB bytes, `width · height` each, at `pixels_per_degree` (in
/// [`PIXELS_PER_DEGREE_RANGE`]); `None` if a size does not match or is zero.
pub fn flip(size: [u32; 2], test: &[[u8; 3]], reference: &[[u8; 3]], pixels_per_degree: f32) -> Option<Flip> {
    let [width, height] = size;
    let count = u64::from(width) * u64::from(height);
    let fits = [test.len(), reference.len()].iter().all(|n| *n as u64 == count);
    // nv-flip multiplies the sizes in u32.
    if count == 0 || count * 3 > u64::from(u32::MAX) || !fits || !PIXELS_PER_DEGREE_RANGE.contains(&pixels_per_degree) {
        return None;
    }
    let image = |pixels: &[[u8; 3]]| nv_flip::FlipImageRgb8::with_data(width, height, pixels.as_flattened());
    let errors = nv_flip::flip(image(reference), image(test), pixels_per_degree).to_vec();
    let sum: f64 = errors.iter().copied().map(f64::from).sum();
    Some(Flip { mean: (sum / count as f64) as f32, max: errors.iter().copied().fold(0.0, f32::max), errors })
}

/// FLIP's errors, 0 to 1, as sRGB colours of matplotlib's magma (black, violet, light yellow), which its authors use.
pub fn flip_colours(errors: &[f32]) -> Vec<[u8; 3]> {
    let ramp = nv_flip::magma_lut().to_vec();
    let last = ramp.len() / 3 - 1;
    let colour = |error: &f32| {
        let at = 3 * (error.clamp(0.0, 1.0) * last as f32).round() as usize;
        [ramp[at], ramp[at + 1], ramp[at + 2]]
    };
    errors.iter().map(colour).collect()
}

/// Mean over pixels and channels of (test − reference)² / (reference² + 0.01): Rousselle et al., "Adaptive Sampling and
/// Reconstruction using Greedy Error Minimization" (2011), section 4, whose 0.01 limits the weight of black pixels. 0
/// for empty pictures; compares the pixels that both have.
pub fn relative_mse(test: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let terms = pairs(test, reference).map(|(t, r)| (t - r).powi(2) / (r * r + 0.01));
    mean(terms)
}

/// The sum over pixels and channels of |test − reference| over that of |reference|: the share of the light that is wrong.
/// Infinite where only the reference is black.
pub fn relative_l1(test: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let (wrong, light) =
        pairs(test, reference).fold((0.0, 0.0), |(wrong, light), (t, r)| (wrong + (t - r).abs(), light + r.abs()));
    if wrong > 0.0 { wrong / light } else { 0.0 }
}

/// Mean over pixels and channels of |test − reference|.
pub fn mean_error(test: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    mean(pairs(test, reference).map(|(t, r)| (t - r).abs()))
}

/// Largest |test − reference| of any channel, and the index of its pixel (the first of equal ones).
pub fn max_error(test: &[[f32; 3]], reference: &[[f32; 3]]) -> (f64, usize) {
    let errors = pairs(test, reference).map(|(t, r)| (t - r).abs()).enumerate();
    let (error, channel) = errors.fold((0.0, 0), |worst, (i, e)| if e > worst.0 { (e, i) } else { worst });
    (error, channel / 3)
}

fn pairs<'a>(test: &'a [[f32; 3]], reference: &'a [[f32; 3]]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let channels = test.as_flattened().iter().zip(reference.as_flattened());
    channels.map(|(t, r)| (f64::from(*t), f64::from(*r)))
}

fn mean(terms: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = terms.fold((0.0, 0u64), |(sum, count), term| (sum + term, count + 1));
    sum / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_errors() {
        let reference = [[0.0, 1.0, 2.0], [3.0, 0.0, 0.0]];
        assert_eq!(relative_mse(&reference, &reference), 0.0);
        assert_eq!(max_error(&reference, &reference), (0.0, 0));
        let test = [[0.0, 1.5, 2.0], [3.0, 0.0, -1.0]];
        let truth = (0.25 / 1.01 + 1.0 / 0.01) / 6.0;
        assert!((relative_mse(&test, &reference) - truth).abs() < 1e-9);
        assert_eq!(max_error(&test, &reference), (1.0, 1));
        assert!((mean_error(&test, &reference) - 0.25).abs() < 1e-12);
        assert!((relative_l1(&test, &reference) - 1.5 / 6.0).abs() < 1e-12);
        let black = [[0.0; 3]; 2];
        assert_eq!([relative_l1(&black, &black), relative_l1(&test, &black)], [0.0, f64::INFINITY]);
    }

    #[test]
    fn flip_of_equal_and_of_opposite_pictures() {
        let size = [32, 16];
        let (black, white) = (vec![[0u8; 3]; 512], vec![[255u8; 3]; 512]);
        let same = flip(size, &white, &white, PIXELS_PER_DEGREE).unwrap();
        assert!(same.mean == 0.0 && same.max == 0.0, "{same:?}");
        let far = flip(size, &black, &white, PIXELS_PER_DEGREE).unwrap();
        assert!(far.mean > 0.9 && far.max <= 1.0, "{far:?}");

        let mut speck = white.clone();
        speck[8 * 32 + 16] = [0; 3];
        let near = flip(size, &speck, &white, PIXELS_PER_DEGREE).unwrap();
        assert!(near.mean > 0.0 && near.mean < 0.1 && near.max > 3.0 * near.mean, "{near:?}");
    }

    #[test]
    fn flip_rejects_sizes_that_do_not_match() {
        let pixels = vec![[0u8; 3]; 4];
        assert_eq!(flip([2, 3], &pixels, &pixels, PIXELS_PER_DEGREE), None);
        assert_eq!(flip([0, 0], &[], &[], PIXELS_PER_DEGREE), None);
        assert!(flip([2, 2], &pixels, &pixels, PIXELS_PER_DEGREE).is_some());
        for wrong in [0.0, 3.9, -67.0, 501.0, f32::NAN, f32::INFINITY] {
            assert_eq!(flip([2, 2], &pixels, &pixels, wrong), None, "{wrong}");
        }
    }

    #[test]
    fn fewer_pixels_per_degree_show_larger_errors() {
        let size = [48, 32];
        let even = vec![[128u8; 3]; 48 * 32];
        let odd: Vec<_> = (0..48 * 32u32).map(|i| [if (i % 48 + i / 48) % 2 == 0 { 108 } else { 148 }; 3]).collect();
        let seen = [4.0, 11.0, 20.0, PIXELS_PER_DEGREE, 500.0].map(|n| flip(size, &odd, &even, n).unwrap());
        assert!(seen.iter().all(|f| f.mean > 0.0 && f.errors.iter().all(|e| e.is_finite())), "the whole range");
        assert!(seen[1].mean > 5.0 * seen[3].mean, "{} and {}", seen[1].mean, seen[3].mean);
    }
}
