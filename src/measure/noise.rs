//! A reference picture's own noise: its error in FLIP, and which differences of FLIP are real in spite of it.

use std::f64::consts::SQRT_2;

use glam::Vec3;

use crate::Result;

/// Pixels along the side of the blocks that [`blocks`] sums over: FLIP's filters reach 10 pixels (at 67 per degree), so that
/// noise of one block hardly depends on another's.
const BLOCK: u32 = 32;

/// The error in FLIP of the mean of all frames, as a share of the difference of its halves' FLIP.
///
/// Of noise with standard deviation σ in that mean, each half has √2 σ, and they differ by 2σ. FLIP is no multiple of σ: its
/// term of colours is raised to 0.7. The real share is 0.60 to 0.66: two noisy pictures have more edges in common than a noisy
/// and a smooth one.
pub fn floor_share() -> f64 {
    0.5f64.powf(0.7)
}

/// A picture averaged over many frames, and both halves of its frames.
pub struct MeanAndHalves<T> {
    pub all: T,
    pub halves: [T; 2],
}

impl<T> MeanAndHalves<T> {
    /// `draw` draws the next half of all frames, and returns the mean of all so far; `shown` converts means.
    pub fn new(mut draw: impl FnMut() -> Result<Vec<Vec3>>, shown: impl Fn(&[Vec3]) -> T) -> Result<Self> {
        let (first, all) = (draw()?, draw()?);
        let second: Vec<Vec3> =
            all.iter().zip(&first).map(|(all, first)| (2.0 * *all - *first).max(Vec3::ZERO)).collect();
        Ok(Self { all: shown(&all), halves: [shown(&first), shown(&second)] })
    }
}

/// A picture's FLIP against both halves of the reference, in parts by blocks of pixels that add up to the mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Halves(pub [Vec<f64>; 2]);

/// Sums over blocks of 32×32 pixels, over the number of all pixels.
pub fn blocks([width, height]: [u32; 2], errors: &[f32]) -> Vec<f64> {
    let columns = width.div_ceil(BLOCK);
    let mut sums = vec![0.0; (columns * height.div_ceil(BLOCK)) as usize];
    for (index, error) in (0..width * height).zip(errors) {
        let (x, y) = (index % width, index / width);
        sums[(y / BLOCK * columns + x / BLOCK) as usize] += f64::from(*error) / errors.len() as f64;
    }
    sums
}

/// Uncertainty of a difference of two pictures' FLIP (`difference`, against the whole reference picture) by that one's noise.
///
/// Both are judged against the same noise, most of which cancels: what counts is the noise of the *paired* difference. It is
/// computed twice, against either half. Halves are alike but for noise, so that in each block of pixels the two differences
/// differ by noise alone; the sum of squares over all blocks is the variance of their total difference, and four times that of
/// their mean. Twice the standard error is thus the root of that sum. Noise also draws different errors together, about in
/// proportion to its standard deviation: halves, with √2 times the noise, show more of that; that much over √2 − 1 is added.
pub fn paired(a: &Halves, b: &Halves, difference: f64) -> f64 {
    let [first, second] = [0, 1].map(|half| a.0[half].iter().zip(&b.0[half]).map(|(a, b)| a - b).collect::<Vec<f64>>());
    let apart: f64 = first.iter().zip(&second).map(|(first, second)| (first - second).powi(2)).sum();
    let mean = 0.5 * (first.iter().sum::<f64>() + second.iter().sum::<f64>());
    apart.sqrt() + (mean - difference).abs() / (SQRT_2 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::metrics::{PIXELS_PER_DEGREE, flip};

    const SIZE: [u32; 2] = [128, 96];

    /// Normal deviates by a fixed sequence: sums of twelve even ones.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f32 {
            let mut even = || {
                self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 40) as f32 / (1u32 << 24) as f32
            };
            (0..12).map(|_| even()).sum::<f32>() - 6.0
        }
    }

    fn bytes(pixels: &[Vec3]) -> Vec<[u8; 3]> {
        pixels.iter().map(|pixel| pixel.to_array().map(|c| c.round() as u8)).collect()
    }

    fn errors(test: &[[u8; 3]], reference: &[[u8; 3]]) -> Vec<f32> {
        flip(SIZE, test, reference, PIXELS_PER_DEGREE).unwrap().errors
    }

    fn mean(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
        blocks(SIZE, &errors(a, b)).iter().sum()
    }

    /// Two halves of the truth with noise, all channels alike or each by itself.
    fn noisy(truth: &[f32], deviation: f32, grey: bool, noise: &mut Noise) -> MeanAndHalves<Vec<[u8; 3]>> {
        let (mut sum, mut count) = (vec![Vec3::ZERO; truth.len()], 0.0);
        let draw = || {
            count += 1.0;
            for (sum, truth) in sum.iter_mut().zip(truth) {
                let alike = noise.next();
                let each = [0; 3].map(|_| if grey { alike } else { noise.next() });
                *sum += *truth + deviation * Vec3::from(each);
            }
            Ok(sum.iter().map(|pixel| *pixel / count).collect())
        };
        MeanAndHalves::new(draw, bytes).unwrap()
    }

    #[test]
    fn halves_are_means_of_their_own_frames() {
        let mut means = [3.0, 5.0].into_iter();
        let parts = MeanAndHalves::new(|| Ok(vec![Vec3::splat(means.next().unwrap())]), |pixels| pixels[0].y).unwrap();
        assert_eq!((parts.all, parts.halves), (5.0, [3.0, 7.0]));
    }

    fn ramp() -> Vec<f32> {
        (0..SIZE[0] * SIZE[1]).map(|i| 60.0 + (i % SIZE[0]) as f32).collect()
    }

    fn shifted(truth: &[f32], by: f32) -> Vec<[u8; 3]> {
        bytes(&truth.iter().map(|t| Vec3::splat(t + by)).collect::<Vec<_>>())
    }

    /// Half of the halves' difference, as of any measure that is a multiple of the noise, would be a sixth too little.
    #[test]
    fn a_floor_is_the_mean_s_own_flip_against_the_truth() {
        let mut noise = Noise(1);
        for truth in [ramp(), vec![128.0; ramp().len()]] {
            let exact = shifted(&truth, 0.0);
            for (deviation, grey) in [(3.0, true), (6.0, true), (3.0, false), (6.0, false)] {
                let parts = noisy(&truth, deviation, grey, &mut noise);
                let real = mean(&parts.all, &exact) / mean(&parts.halves[0], &parts.halves[1]);
                assert!((floor_share() / real - 1.0).abs() < 0.1 && real > 0.57, "{deviation}: {real}");
            }
        }
    }

    #[test]
    fn blocks_add_up_to_the_mean_and_one_has_half_the_difference_of_its_halves_as_standard_error() {
        let errors: Vec<f32> = (0..70 * 40).map(|i| if i == 70 * 40 - 1 { 28.0 } else { 0.0 }).collect();
        let sums = blocks([70, 40], &errors);
        assert!(sums.len() == 6 && sums[..5].iter().all(|sum| *sum == 0.0) && (sums[5] - 0.01).abs() < 1e-9);
        let [a, b] = [[0.3, 0.2], [0.1, 0.1]].map(|halves| Halves(halves.map(|flip| vec![flip])));
        assert!((paired(&a, &b, 0.15) - 0.1).abs() < 1e-12);
        assert!((paired(&a, &b, 0.16) - 0.1 - 0.01 / (SQRT_2 - 1.0)).abs() < 1e-12, "and what it still moves");
    }

    /// Two pictures' difference of FLIP, judged again and again against other noise of the same kind.
    #[test]
    fn paired_differences_are_as_far_off_as_they_say_and_that_is_less_than_the_floor() {
        let truth = ramp();
        let [one, other, exact] = [6.0, 7.0, 0.0].map(|by| shifted(&truth, by));
        let real = mean(&other, &exact) - mean(&one, &exact);
        let mut noise = Noise(7);
        for grey in [true, false] {
            let mut seen = Vec::new();
            for _ in 0..10 {
                let parts = noisy(&truth, 3.0, grey, &mut noise);
                let halves =
                    |test: &[[u8; 3]]| Halves(parts.halves.each_ref().map(|half| blocks(SIZE, &errors(test, half))));
                let difference = mean(&other, &parts.all) - mean(&one, &parts.all);
                seen.push((difference, paired(&halves(&other), &halves(&one), difference)));
                let floor = mean(&parts.all, &exact);
                assert!(seen.iter().all(|(_, width)| *width < 0.1 * floor), "{seen:?}, floor {floor}");
            }
            let middle = seen.iter().map(|(difference, _)| difference).sum::<f64>() / seen.len() as f64;
            let far = seen.iter().filter(|(difference, width)| (difference - middle).abs() > *width).count();
            assert!(far <= 1, "{far} are farther off than they say: {seen:?}");
            // Noise that is larger than the errors draws these together by a little more than is seen of it.
            let off = |(difference, width): &(f64, f64)| (difference - real).abs() < width + 0.02 * real;
            assert!(seen.iter().all(off), "{seen:?} for {real}");
        }
    }
}
