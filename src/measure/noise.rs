//! An exact picture's own noise: how far FLIP is off by it, and which differences of FLIP can be told in spite of it.

use std::f64::consts::SQRT_2;

use crate::Result;

/// Pixels along the side of the blocks that [`blocks`] sums over: FLIP's filters reach 10 pixels (at 67 per degree), so that
/// noise of one block says next to nothing of another's.
const BLOCK: u32 = 32;

/// A picture, and what independent parts of its frames show.
pub struct Parts<T> {
    pub all: T,
    pub halves: [T; 2],
    /// In the order in which they were drawn.
    pub quarters: [T; 4],
}

impl<T> Parts<T> {
    /// `draw` draws the next quarter of all frames, and gives the mean of all so far; `shown` is what parts show.
    pub fn new(
        mut draw: impl FnMut() -> Result<Vec<[f32; 4]>>,
        shown: impl Fn(&[[f32; 4]]) -> Result<T>,
    ) -> Result<Self> {
        // Full pictures are large: none is held longer than it is needed.
        let one = draw()?;
        let first = shown(&one)?;
        let two = draw()?;
        let second = shown(&since(&two, 2.0, &one, 1.0))?;
        drop(one);
        let three = draw()?;
        let third = shown(&since(&three, 3.0, &two, 2.0))?;
        let four = draw()?;
        let fourth = shown(&since(&four, 4.0, &three, 3.0))?;
        drop(three);
        let halves = [shown(&two)?, shown(&since(&four, 4.0, &two, 2.0))?];
        Ok(Self { all: shown(&four)?, halves, quarters: [first, second, third, fourth] })
    }

    /// What is left of the error of all frames' mean, as a share of what its halves differ by in FLIP; `flip` of two parts.
    ///
    /// Of noise with standard deviation σ in that mean, each half has √2 σ and each quarter 2σ: halves differ by 2σ, quarters
    /// by √2 times that. FLIP is no multiple of σ (its term of colours is raised to 0.7), but over so small a range a power
    /// of it, which quarters tell: from them to halves σ falls by √2, and from halves to the mean's own error by √2 twice. Of
    /// noise in colour or grey this is 0.56 to 0.64, and what is really left 0.60 to 0.66: two noisy pictures have more
    /// edges in common than a noisy and a smooth one. Frames are spread evenly over each pixel, so that edges' noise falls
    /// faster than σ, and parts of it are not quite independent: not below 1/2.
    pub fn floor_share(&self, flip: impl Fn(&T, &T) -> Result<f64>) -> Result<f64> {
        let [a, b, c, d] = &self.quarters;
        let quarters = 0.5 * (flip(a, b)? + flip(c, d)?);
        let halves = flip(&self.halves[0], &self.halves[1])?;
        Ok(if quarters > 0.0 { (halves / quarters).powi(2).clamp(0.5, 1.0) } else { 0.5 })
    }
}

/// The mean of frames that came after the first `earlier_count`, from means of all and of those.
fn since(all: &[[f32; 4]], all_count: f32, earlier: &[[f32; 4]], earlier_count: f32) -> Vec<[f32; 4]> {
    let mean = |a: f32, e: f32| ((all_count * a - earlier_count * e) / (all_count - earlier_count)).max(0.0);
    all.iter().zip(earlier).map(|(all, earlier)| std::array::from_fn(|c| mean(all[c], earlier[c]))).collect()
}

/// A picture's FLIP against both halves of the exact one, in parts by blocks of pixels that add up to the mean.
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

/// How far a difference of two pictures' FLIP, `difference` against the whole exact picture, may be off by that one's noise.
///
/// Both are judged against the same noise, most of which cancels: what counts is the noise of the *paired* difference. It is
/// taken twice, against either half. Halves are alike but for noise, so that in each block of pixels the two differences
/// differ by noise alone; the sum of squares over all blocks is the variance of what the two differ by in all, and four
/// times that of their mean. Twice the standard error is thus the root of that sum. Noise also draws different errors
/// together, about as its standard deviation grows: by what halves, with √2 times the noise, show more of that,
/// over √2 − 1. That much is added.
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

    fn bytes(pixels: &[[f32; 4]]) -> Result<Vec<[u8; 3]>> {
        Ok(pixels.iter().map(|[r, g, b, _]| [*r, *g, *b].map(|c| c.round() as u8)).collect())
    }

    fn errors(test: &[[u8; 3]], reference: &[[u8; 3]]) -> Vec<f32> {
        flip(SIZE, test, reference, PIXELS_PER_DEGREE).unwrap().errors
    }

    fn mean(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
        blocks(SIZE, &errors(a, b)).iter().sum()
    }

    /// Four quarters of the truth with noise, all channels alike or each by itself.
    fn noisy(truth: &[f32], deviation: f32, grey: bool, noise: &mut Noise) -> Parts<Vec<[u8; 3]>> {
        let (mut sum, mut count) = (vec![[0.0; 4]; truth.len()], 0.0);
        let draw = || {
            count += 1.0;
            for (sum, truth) in sum.iter_mut().zip(truth) {
                let alike = noise.next();
                for channel in sum.iter_mut() {
                    *channel += truth + deviation * if grey { alike } else { noise.next() };
                }
            }
            Ok(sum.iter().map(|pixel| pixel.map(|c| c / count)).collect())
        };
        Parts::new(draw, bytes).unwrap()
    }

    #[test]
    fn parts_are_means_of_their_own_frames() {
        let frames = [3.0, 5.0, 10.0, 2.0];
        let mut drawn = Vec::new();
        let draw = || {
            drawn.push(frames[drawn.len()]);
            Ok(vec![[drawn.iter().sum::<f32>() / drawn.len() as f32; 4]])
        };
        let parts = Parts::new(draw, |pixels| Ok(pixels[0][1])).unwrap();
        assert!((parts.all - 5.0).abs() < 1e-5, "{}", parts.all);
        let near =
            |parts: &[f32], means: &[f32]| parts.iter().zip(means).all(|(part, mean)| (part - mean).abs() < 1e-4);
        assert!(near(&parts.halves, &[4.0, 6.0]) && near(&parts.quarters, &frames));
    }

    fn ramp() -> Vec<f32> {
        (0..SIZE[0] * SIZE[1]).map(|i| 60.0 + (i % SIZE[0]) as f32).collect()
    }

    fn shifted(truth: &[f32], by: f32) -> Vec<[u8; 3]> {
        bytes(&truth.iter().map(|t| [t + by; 4]).collect::<Vec<_>>()).unwrap()
    }

    /// Half of what halves differ by, as of any measure that is a multiple of the noise, would be a sixth too little.
    #[test]
    fn a_floor_is_the_mean_s_own_flip_against_the_truth() {
        let mut noise = Noise(1);
        for truth in [ramp(), vec![128.0; ramp().len()]] {
            let exact = shifted(&truth, 0.0);
            for (deviation, grey) in [(4.0, true), (8.0, true), (4.0, false), (8.0, false)] {
                let parts = noisy(&truth, deviation, grey, &mut noise);
                let share = parts.floor_share(|a, b| Ok(mean(a, b))).unwrap();
                let real = mean(&parts.all, &exact) / mean(&parts.halves[0], &parts.halves[1]);
                assert!((share / real - 1.0).abs() < 0.14, "{deviation}: {share} for {real}");
                assert!(share > 0.55 && real > 0.58, "{deviation}: {share} and {real} are not half");
            }
        }
        let exact = shifted(&ramp(), 0.0);
        let same = Parts { all: &exact, halves: [&exact; 2], quarters: [&exact; 4] };
        assert_eq!(same.floor_share(|a, b| Ok(mean(a, b))).unwrap(), 0.5);
    }

    #[test]
    fn blocks_add_up_to_the_mean() {
        let errors: Vec<f32> = (0..70 * 40).map(|i| if i % 70 == 69 && i / 70 == 39 { 28.0 } else { 0.0 }).collect();
        let sums = blocks([70, 40], &errors);
        assert!(sums.len() == 6 && sums[..5].iter().all(|sum| *sum == 0.0) && (sums[5] - 0.01).abs() < 1e-9);
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
                let parts = noisy(&truth, 4.0, grey, &mut noise);
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

    #[test]
    fn one_block_has_half_the_difference_of_its_halves_as_standard_error() {
        let [a, b] = [[0.3, 0.2], [0.1, 0.1]].map(|halves| Halves(halves.map(|flip| vec![flip])));
        assert!((paired(&a, &b, 0.15) - 0.1).abs() < 1e-12);
        assert!((paired(&a, &b, 0.16) - 0.1 - 0.01 / (SQRT_2 - 1.0)).abs() < 1e-12, "and what it still moves");
    }
}
