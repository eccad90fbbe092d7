//! Mips in f64: box averages of any size, and roughness for the variance of averaged normals.
//!
//! `asset::mips` is the fast twin.

use glam::DVec4;

/// Smallest length of a mean normal: below it the normals point in all directions, and the lobe has its maximum width.
const SHORTEST: f64 = 1e-3;

/// Texel `i` of `to` along one axis covers [i, i + 1) · from / to texels of the larger level: the first of them and
/// their shares, which add up to 1.
pub fn box_weights(from: u32, to: u32, i: u32) -> (u32, Vec<f64>) {
    let scale = f64::from(from) / f64::from(to);
    let (start, end) = (f64::from(i) * scale, f64::from(i + 1) * scale);
    let first = (start + 1e-9).floor();
    let last = (end - 1e-9).ceil().min(f64::from(from));
    let count = (last - first) as u32;
    let share = |k: u32| {
        let left = first + f64::from(k);
        (end.min(left + 1.0) - start.max(left)).max(0.0) / scale
    };
    (first as u32, (0..count).map(share).collect())
}

/// Box average of `from[0] · from[1]` texels, rows from the top, onto `to[0] · to[1]`.
pub fn box_average(texels: &[DVec4], from: [u32; 2], to: [u32; 2]) -> Vec<DVec4> {
    let texel = |x: u32, y: u32| {
        let ((left, across), (top, down)) = (box_weights(from[0], to[0], x), box_weights(from[1], to[1], y));
        let mut sum = DVec4::ZERO;
        for (row, wy) in (top..).zip(&down) {
            for (column, wx) in (left..).zip(&across) {
                sum += texels[(row * from[0] + column) as usize] * (wx * wy);
            }
        }
        sum
    };
    (0..to[1]).flat_map(|y| (0..to[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect()
}

/// α² of a surface whose normals were averaged to a vector of length r ≤ 1: the normals as a von Mises–Fisher lobe,
/// convolved with the surface's, so that 1/κ add up (Han et al., "Frequency Domain Normal Map Filtering", 2007) and
/// α² ≈ 2/κ.
pub fn widened(alpha_squared: f64, r: f64) -> f64 {
    (alpha_squared + fisher_width(r)).min(1.0)
}

/// 2/κ of normals whose mean has length r: κ = r (3 − r²) / (1 − r²) (Banerjee et al., "Clustering on the Unit
/// Hypersphere", 2005, eq. 4.4).
pub fn fisher_width(r: f64) -> f64 {
    let r = r.clamp(SHORTEST, 1.0);
    2.0 * (1.0 - r * r) / (r * (3.0 - r * r))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::reference::brdf::d_ggx;
    use crate::reference::sampling::hammersley;

    #[test]
    fn shares_add_up_to_one_and_no_texel_is_dropped() {
        for (from, to) in [(8, 4), (7, 3), (5, 2), (3, 1), (1, 1), (13, 6), (4, 6), (6, 4)] {
            let mut used = vec![0.0; from as usize];
            for i in 0..to {
                let (first, shares) = box_weights(from, to, i);
                assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{from} to {to}");
                shares.iter().enumerate().for_each(|(k, share)| used[first as usize + k] += share);
            }
            let even = f64::from(to) / f64::from(from);
            assert!(used.iter().all(|u| (u - even).abs() < 1e-6), "{from} to {to}: {used:?}");
        }
    }

    /// Normals of a patch with normally distributed slopes, similar to those of photographed bricks.
    fn bumps(deviation: f64) -> Vec<DVec3> {
        let normal = |i| {
            let u = hammersley(i, 8);
            let (radius, around) = (deviation * (-2.0 * (1.0 - u.y).ln()).sqrt(), std::f64::consts::TAU * u.x);
            DVec3::new(radius * around.cos(), radius * around.sin(), 1.0).normalize()
        };
        (0..256).map(normal).collect()
    }

    fn mean(normals: &[DVec3]) -> DVec3 {
        normals.iter().sum::<DVec3>() / normals.len() as f64
    }

    /// Mean over half vectors of |D of one lobe, `wide` about the mean − mean of D over all normals|, over the mean of
    /// the latter.
    fn error(normals: &[DVec3], alpha: f64, wide: f64) -> f64 {
        let mean = mean(normals);
        let (mut wrong, mut all) = (0.0, 0.0);
        for degrees in 0..60 {
            let h = DVec3::new(f64::from(degrees).to_radians().sin(), 0.0, f64::from(degrees).to_radians().cos());
            let truth = normals.iter().map(|n| d_ggx(*n, h, alpha)).sum::<f64>() / normals.len() as f64;
            // Rings of directions: their circumference.
            wrong += (d_ggx(mean.normalize(), h, wide) - truth).abs() * h.x;
            all += truth * h.x;
        }
        wrong / all
    }

    #[test]
    fn widening_comes_close_to_the_mean_of_all_lobes() {
        for (bump, alpha) in [(0.1, 0.1), (0.15, 0.1), (0.2, 0.2), (0.2, 0.1)] {
            let normals = bumps(bump);
            let plain = error(&normals, alpha, alpha);
            let error = error(&normals, alpha, widened(alpha * alpha, mean(&normals).length()).sqrt());
            assert!(error < 0.6 * plain, "bumps {bump}, α {alpha}: {error} against {plain}");
        }
    }

    #[test]
    fn equal_normals_do_not_widen_and_scattered_ones_never_beyond_one() {
        for alpha_squared in [1e-4, 0.04, 1.0] {
            assert!((widened(alpha_squared, 1.0) - alpha_squared).abs() < 1e-9);
            let scattered = widened(alpha_squared, 0.0);
            assert!((alpha_squared..=1.0).contains(&scattered), "{scattered}");
            let steps: Vec<f64> = (0..=50).map(|i| widened(alpha_squared, f64::from(i) / 50.0)).collect();
            assert!(steps.windows(2).all(|w| w[0] >= w[1] - 1e-12), "shorter means are wider");
        }
    }
}
