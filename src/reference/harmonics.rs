//! Real spherical harmonics and the coefficients of the clamped cosine, in f64: twins of `glsl/harmonics.glsl`.

use std::f64::consts::FRAC_1_PI;

use glam::{DVec2, DVec3};

/// Real harmonic of degree l and order m in [−l, l] for unit d, polar axis z, without the Condon–Shortley sign: fully
/// normalised, by Holmes and Featherstone, "A Unified Approach to the Clenshaw Summation and the Recursive Computation
/// of Very High Degree and Order Normalised Associated Legendre Functions" (2002), eqs. 11 to 13; the factor sin^m of
/// the polar angle is part of (x + iy)^m, so that the poles are no special case.
pub fn harmonic(l: i32, m: i32, d: DVec3) -> f64 {
    let order = m.abs();
    let mut p = (0.25 * FRAC_1_PI).sqrt();
    let mut turn = DVec2::X;
    for i in 1..=order {
        p *= (f64::from(2 * i + 1) / f64::from(2 * i)).sqrt();
        turn = DVec2::new(turn.x * d.x - turn.y * d.y, turn.x * d.y + turn.y * d.x);
    }
    let mut below = 0.0;
    for i in order + 1..=l {
        let wide = (f64::from(4 * i * i - 1) / f64::from(i * i - order * order)).sqrt();
        let last = (f64::from((i - 1).pow(2) - order * order) / f64::from(4 * (i - 1).pow(2) - 1)).sqrt();
        let next = wide * (d.z * p - last * below);
        below = p;
        p = next;
    }
    match m {
        0 => p,
        1.. => std::f64::consts::SQRT_2 * p * turn.x,
        _ => std::f64::consts::SQRT_2 * p * turn.y,
    }
}

/// The factor of harmonics of degree l by convolution with the clamped cosine over π: Ramamoorthi and Hanrahan, "An
/// Efficient Representation for Irradiance Environment Maps" (2001), eq. 8, over π; even degrees by the ratio of
/// neighbours.
pub fn cosine_lobe(l: i32) -> f64 {
    match l {
        0 => 1.0,
        1 => 2.0 / 3.0,
        _ if l % 2 == 1 => 0.0,
        _ => (2..l).step_by(2).fold(0.25, |a, i| -a * f64::from(i - 1) / f64::from(i + 4)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::cube::{panorama_direction, panorama_texel_solid_angle};

    /// ∫ f dω by midpoints of a panorama.
    fn over_sphere(f: impl Fn(DVec3) -> f64) -> f64 {
        let size = [256, 128];
        let mut sum = 0.0;
        for y in 0..size[1] {
            let solid_angle = panorama_texel_solid_angle(y, size);
            for x in 0..size[0] {
                let at = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
                sum += solid_angle * f(panorama_direction(DVec2::new(at(x, size[0]), at(y, size[1]))));
            }
        }
        sum
    }

    #[test]
    fn harmonics_are_orthonormal() {
        let all: Vec<(i32, i32)> = (0..=8).flat_map(|l| (-l..=l).map(move |m| (l, m))).collect();
        assert_eq!(all.len(), 81);
        for (i, a) in all.iter().enumerate().step_by(3) {
            for b in all.iter().skip(i).step_by(5) {
                let product = over_sphere(|d| harmonic(a.0, a.1, d) * harmonic(b.0, b.1, d));
                let expected = f64::from(u8::from(a == b));
                assert!((product - expected).abs() < 2e-3, "{a:?}·{b:?}: {product}");
            }
        }
        let first = (0.75 * FRAC_1_PI).sqrt();
        let d = DVec3::new(0.48, 0.6, 0.64);
        for (m, cosine) in [(-1, d.y), (0, d.z), (1, d.x)] {
            assert!((harmonic(1, m, d) - first * cosine).abs() < 1e-15);
        }
    }

    #[test]
    fn the_cosine_lobe_is_that_of_the_integral() {
        for l in 0..=8 {
            // Funk–Hecke: the factor is ∫ max(cos, 0) P_l(cos) dω, and P_l(z) = Y_l0 / Y_l0(z = 1).
            let legendre = |d: DVec3| harmonic(l, 0, d) / harmonic(l, 0, DVec3::Z);
            let integral = over_sphere(|d| d.z.max(0.0) * legendre(d)) * FRAC_1_PI;
            assert!((cosine_lobe(l) - integral).abs() < 1e-3, "degree {l}: {integral}");
        }
    }
}
