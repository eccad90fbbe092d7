//! Sample points, half vectors and their densities in f64: twins of `glsl/sampling.glsl`. Local space: +Z is the
//! normal.

use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3};

use super::{
    brdf::{d_ggx, d_ggx_stretched},
    math::{MIN_COS, TINY},
};

/// Base-2 radical inverse: van der Corput's sequence, by reversing the bits; exact.
pub fn radical_inverse(i: u32) -> f64 {
    f64::from(i.reverse_bits()) / 2f64.powi(32)
}

/// Point i of the 2^log2_count points of Hammersley's set (Niederreiter, "Random Number Generation and Quasi-Monte
/// Carlo Methods" (1992), chapter 3); i < 2^log2_count, log2_count ≤ 31. The GLSL twin keeps only the upper 24 bits of
/// both.
pub fn hammersley(i: u32, log2_count: u32) -> DVec2 {
    DVec2::new(f64::from(i) / 2f64.powi(log2_count as i32), radical_inverse(i))
}

/// Point i of Sobol's sequence in two dimensions, a (0, 2)-sequence: each aligned run of 2^k points has one in every one of
/// the 2^k boxes that halving both sides makes. Scrambled by 32 bits for each dimension: Kollig and Keller, "Efficient
/// Multidimensional Sampling" (2002), section 2.2. The GLSL twin keeps the upper 24 bits.
pub fn sobol(i: u32, scramble: [u32; 2]) -> DVec2 {
    // Each column is the one before, added to itself moved by a place: Pascal's triangle modulo 2.
    let columns = std::iter::successors(Some(1u32 << 31), |column| Some(column ^ (column >> 1)));
    let second =
        columns.take(32).enumerate().filter(|(bit, _)| i >> bit & 1 != 0).fold(0, |sum, (_, column)| sum ^ column);
    let fraction = |bits: u32| f64::from(bits) / 2f64.powi(32);
    DVec2::new(fraction(i.reverse_bits() ^ scramble[0]), fraction(second ^ scramble[1]))
}

/// A unit vector, evenly over the sphere for u over [0, 1)².
pub fn sphere_direction(u: DVec2) -> DVec3 {
    let up = 1.0 - 2.0 * u.x;
    let (sin, cos) = (TAU * u.y).sin_cos();
    let across = (1.0 - up * up).max(0.0).sqrt();
    DVec3::new(across * cos, across * sin, up)
}

/// A unit vector by the cosine to +Z, for u over [0, 1)²: Malley's method, a disc projected up.
pub fn cosine_direction(u: DVec2) -> DVec3 {
    let (sin, cos) = (TAU * u.y).sin_cos();
    DVec3::new(u.x.sqrt() * cos, u.x.sqrt() * sin, (1.0 - u.x).sqrt())
}

/// A right-handed basis around unit n, as columns tangent, bitangent, n: Duff et al., "Building an Orthonormal Basis,
/// Revisited" (2017), listing 3.
pub fn basis(n: DVec3) -> DMat3 {
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    DMat3::from_cols(DVec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x), DVec3::new(b, s + n.y * n.y * a, -n.y), n)
}

/// Half vector with density D(h) n·h: Walter et al. (2007), eqs. 35 and 36; u in [0, 1)².
pub fn sample_ggx(u: DVec2, alpha: f64) -> DVec3 {
    let scale = (1.0 - u.x + alpha * alpha * u.x).max(TINY).sqrt().recip();
    let sine = alpha * u.x.sqrt() * scale;
    let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
    DVec3::new(sine * cos_phi, sine * sin_phi, (1.0 - u.x).sqrt() * scale)
}

/// Density of l = reflect(−v, h) in 1/sr for h from [`sample_ggx`]: Walter et al. (2007), eqs. 24 and 14.
pub fn pdf_ggx(v: DVec3, h: DVec3, alpha: f64) -> f64 {
    d_ggx(DVec3::Z, h, alpha) * h.z / (4.0 * v.dot(h).max(MIN_COS))
}

/// Half vector of the distribution of visible normals: Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical
/// Caps" (2023), section 3; u in [0, 1)². `alphas`: along x and along y.
pub fn sample_vndf(v: DVec3, u: DVec2, alphas: DVec2) -> DVec3 {
    let stretched = DVec3::new(alphas.x * v.x, alphas.y * v.y, v.z.max(MIN_COS)).normalize();
    let rise = (1.0 - u.y) * (1.0 + stretched.z);
    let below = (stretched.x * stretched.x + stretched.y * stretched.y) / (1.0 + stretched.z);
    let sine = ((1.0 + stretched.z) * u.y * (below + rise)).sqrt();
    let (sin_phi, cos_phi) = (TAU * u.x).sin_cos();
    let across = sine * DVec2::new(cos_phi, sin_phi) + DVec2::new(stretched.x, stretched.y);
    DVec3::new(alphas.x * across.x, alphas.y * across.y, rise.max(MIN_COS)).normalize()
}

/// Density of l = reflect(−v, h) in 1/sr for h from [`sample_vndf`]: Heitz, "Sampling the GGX Distribution of Visible
/// Normals" (2018), eq. 17, with G1 written out so that n·v cancels.
pub fn pdf_vndf(v: DVec3, h: DVec3, alphas: DVec2) -> f64 {
    let nv = v.z.max(MIN_COS);
    d_ggx_stretched(h, alphas) * 0.5 / (nv + DVec3::new(alphas.x * v.x, alphas.y * v.y, nv).length())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fraction as the shader computes it.
    fn unit_from_bits_f32(bits: u32) -> f32 {
        (bits >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    fn hammersley_f32(i: u32, log2_count: u32) -> [f32; 2] {
        [unit_from_bits_f32((i << (31 - log2_count)) << 1), unit_from_bits_f32(i.reverse_bits())]
    }

    #[test]
    fn hammersley_is_exact() {
        assert_eq!(hammersley(0, 0), DVec2::ZERO);
        assert_eq!(hammersley(3, 2), DVec2::new(0.75, 0.75));
        assert_eq!(hammersley(1, 3), DVec2::new(0.125, 0.5));
        for log2_count in 0..=12 {
            let count = 1u32 << log2_count;
            let mut seen = vec![false; count as usize];
            for i in 0..count {
                let exact = hammersley(i, log2_count);
                let ours = hammersley_f32(i, log2_count);
                assert_eq!([exact.x, exact.y], ours.map(f64::from));
                // Each of the count strips in the second coordinate holds exactly one point.
                let strip = (exact.y * f64::from(count)) as usize;
                assert!(!std::mem::replace(&mut seen[strip], true), "two points in strip {strip}");
            }
        }
    }

    /// Case 15 of tests/gpu/stability.rs.
    #[test]
    fn hammersley_holds_beyond_24_bits() {
        let count = 1u32 << 30;
        assert_eq!((count - 1) as f32 / count as f32, 1.0, "i / N in f32 no longer reaches 1");
        assert_eq!(u32::MAX as f32 / 2f32.powi(32), 1.0, "a reversed index in f32 no longer reaches 1");
        assert_eq!(16_777_216f32 + 1.0, 16_777_216f32, "a f32 counter no longer stalls");
        for i in [0, 1, 0xff_ffff, 0x100_0001, count - 2, count - 1] {
            let (exact, ours) = (hammersley(i, 30), hammersley_f32(i, 30));
            for (exact, ours) in [(exact.x, ours[0]), (exact.y, ours[1])] {
                let below = exact - f64::from(ours);
                assert!(ours < 1.0 && (0.0..2f64.powi(-24)).contains(&below), "{exact} against {ours} at {i}");
            }
        }
    }

    #[test]
    fn aligned_runs_of_sobol_s_points_fill_every_box() {
        for (first, scramble) in [(0u32, [0, 0]), (64, [0x1234_5678, 0x9abc_def0]), (4096, [!0, 1])] {
            for log2_x in 0..=6 {
                let [across, down] = [1usize << log2_x, 64 >> log2_x];
                let mut seen = [false; 64];
                for i in first..first + 64 {
                    let u = sobol(i, scramble);
                    let place = (u.x * across as f64) as usize + across * (u.y * down as f64) as usize;
                    assert!(!std::mem::replace(&mut seen[place], true), "two in a box of {across} × {down}");
                }
            }
        }
    }

    #[test]
    fn directions_follow_their_densities() {
        let mean = |f: fn(DVec3) -> f64, of: fn(DVec2) -> DVec3| {
            (0..1 << 14).map(|i| f(of(sobol(i, [0; 2])))).sum::<f64>() / f64::from(1 << 14)
        };
        let squares: [fn(DVec3) -> f64; 3] = [|d| d.x * d.x, |d| d.y * d.y, |d| d.z * d.z];
        for (f, by_cosine) in squares.into_iter().zip([0.25, 0.25, 0.5]) {
            assert!((mean(f, sphere_direction) - 1.0 / 3.0).abs() < 1e-3);
            assert!((mean(f, cosine_direction) - by_cosine).abs() < 1e-3);
        }
        assert!(mean(|d| d.z, sphere_direction).abs() < 1e-3);
        assert!((mean(|d| d.z, cosine_direction) - 2.0 / 3.0).abs() < 1e-3);
        let ends = [DVec2::ZERO, DVec2::splat(1.0 - 2f64.powi(-24))];
        assert!(ends.iter().all(|u| (sphere_direction(*u).length() - 1.0).abs() < 1e-12));
        assert!(ends.iter().all(|u| (cosine_direction(*u).length() - 1.0).abs() < 1e-12));
    }

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for i in 0..1000 {
            let u = hammersley(i % 512, 9);
            let h = sample_ggx(u, 1.0);
            let n = if i % 2 == 0 { h } else { -h };
            let m = basis(n);
            assert!((m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, 1e-12), "{n}");
            assert!((m.determinant() - 1.0).abs() < 1e-12);
        }
        assert!(basis(-DVec3::Z).is_finite() && basis(DVec3::new(0.0, 0.0, -0.0)).is_finite());
    }

    /// Counts sampled directions in equal cells of (cos polar, azimuth) and compares with the density's integral.
    /// Stratified points lie far below χ²'s mean; a wrong density lies far above it.
    fn chi_squared_per_cell(
        v: DVec3,
        alphas: DVec2,
        half: impl Fn(DVec3, DVec2, DVec2) -> DVec3,
        pdf: impl Fn(DVec3, DVec3, DVec2) -> f64,
    ) -> f64 {
        const CELLS: usize = 16;
        const LOG2: u32 = 16;
        const FINE: usize = 24;
        let mut counts = [[0f64; CELLS]; CELLS];
        for i in 0..1u32 << LOG2 {
            let h = half(v, hammersley(i, LOG2), alphas);
            let l = 2.0 * v.dot(h) * h - v;
            let row = ((l.z + 1.0) / 2.0 * CELLS as f64) as usize;
            let column = ((l.y.atan2(l.x) / TAU + 0.5) * CELLS as f64) as usize;
            counts[row.min(CELLS - 1)][column.min(CELLS - 1)] += 1.0;
        }
        let steps = CELLS * FINE;
        let cell = 2.0 / steps as f64 * TAU / steps as f64;
        let mut expected = [[0f64; CELLS]; CELLS];
        for row in 0..steps {
            let z = (row as f64 + 0.5) * 2.0 / steps as f64 - 1.0;
            for column in 0..steps {
                let phi = ((column as f64 + 0.5) / steps as f64 - 0.5) * TAU;
                let across = (1.0 - z * z).sqrt();
                let h = (DVec3::new(across * phi.cos(), across * phi.sin(), z) + v).normalize();
                if h.z > 0.0 {
                    expected[row / FINE][column / FINE] += pdf(v, h, alphas) * cell * f64::from(1u32 << LOG2);
                }
            }
        }
        let total: f64 = expected.iter().flatten().sum();
        assert!((total / f64::from(1u32 << LOG2) - 1.0).abs() < 2e-3, "density integrates to {total} of 65536");
        let pairs = counts.iter().flatten().zip(expected.iter().flatten());
        let (sum, cells) =
            pairs.filter(|(_, e)| **e > 5.0).fold((0.0, 0), |(s, n), (c, e)| (s + (c - e).powi(2) / e, n + 1));
        sum / f64::from(cells)
    }

    #[test]
    fn samples_follow_their_density() {
        let ggx = |_, u, alphas: DVec2| sample_ggx(u, alphas.x);
        let ggx_density = |v, h, alphas: DVec2| pdf_ggx(v, h, alphas.x);
        for nv in [0.2f64, 0.7, 1.0] {
            let v = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
            for (alpha, across) in [(0.4, 0.4), (1.0, 1.0), (0.9, 0.3), (0.3, 0.7)] {
                let alphas = DVec2::new(alpha, across);
                let good = chi_squared_per_cell(v, alphas, sample_vndf, pdf_vndf);
                assert!(good < 1.0, "visible normals: {good} at n·v {nv}, {alphas}");
                // h seen from behind reflects below; its density is not defined there, so only steep views are
                // compared.
                if nv == 1.0 && alpha == across {
                    let good = chi_squared_per_cell(v, alphas, ggx, ggx_density);
                    assert!(good < 1.0, "normals: {good} at n·v {nv}, alpha {alpha}");
                }
            }
        }
        let v = DVec3::new(0.6, 0.0, 0.8);
        let wrong = chi_squared_per_cell(
            v,
            DVec2::new(0.4, 0.6),
            |v, u, alphas| sample_vndf(v, u, DVec2::new(alphas.y, alphas.x)),
            pdf_vndf,
        );
        assert!(wrong > 10.0, "the test no longer sees a wrong density: {wrong}");
    }

    #[test]
    fn samples_at_the_ends() {
        let v = DVec3::new(1.0, 0.0, 0.0);
        for u in [DVec2::ZERO, DVec2::splat(1.0 - 2f64.powi(-24)), DVec2::new(1.0 - 2f64.powi(-24), 0.0)] {
            for alpha in [0.0, 1e-6, 1.0] {
                for h in [
                    sample_ggx(u, alpha),
                    sample_vndf(v, u, DVec2::splat(alpha)),
                    sample_vndf(DVec3::Z, u, DVec2::splat(alpha)),
                ] {
                    assert!((h.length() - 1.0).abs() < 1e-9 && h.z >= 0.0, "{h} for {u}, alpha {alpha}");
                }
            }
        }
    }
}
