//! The lobe of specular levels in closed form: twin of `glsl/lobe.glsl`.
//!
//! With n = v = r and c = r·l the half vector lies halfway between r and l, so (n·h)² = (1 + c)/2, and cos · GGX of the
//! split sum's levels (Karis 2013, the sum below eq. 7) is, up to a factor, K(c) = c/q² with q = α² + k(1 − c),
//! k = (1 − α²)/2, and 0 below the horizon. At α = 1 it is the clamped cosine: irradiance is the last level.

use std::f64::consts::TAU;

/// K(c).
pub fn kernel(c: f64, alpha: f64) -> f64 {
    let q = alpha * alpha + steepness(alpha) * (1.0 - c);
    c.max(0.0) / (q * q)
}

/// K″(c) above the horizon, 0 below: 4k/q³ + 6k²c/q⁴.
pub fn kernel_second_derivative(c: f64, alpha: f64) -> f64 {
    if c <= 0.0 {
        return 0.0;
    }
    let k = steepness(alpha);
    let q = alpha * alpha + k * (1.0 - c);
    4.0 * k / q.powi(3) + 6.0 * k * k * c / q.powi(4)
}

/// Schlick's Fresnel term under the cosine, G(c) = c (1 − c)⁵, and 0 below the horizon. ∫ G dω is π/21.
pub fn grazing_kernel(c: f64) -> f64 {
    c.max(0.0) * (1.0 - c).powi(5)
}

/// G″(c) above the horizon, 0 below.
pub fn grazing_second_derivative(c: f64) -> f64 {
    if c <= 0.0 { 0.0 } else { (1.0 - c).powi(3) * (30.0 * c - 10.0) }
}

/// ∫ K dω over the sphere: with x = k/α² it is 2π/k² · (x − ln(1 + x)), and π at α = 1, where k = 0.
pub fn kernel_integral(alpha: f64) -> f64 {
    let (k, a2) = (steepness(alpha), alpha * alpha);
    let x = k / a2;
    if x < 1e-3 {
        // As a power series: the difference below would cancel.
        return TAU / (a2 * a2) * (0.5 - x / 3.0 + x * x / 4.0 - x.powi(3) / 5.0);
    }
    TAU / (k * k) * (x - x.ln_1p())
}

/// 1 − |m|, m being the lobe's mean vector ∫ K l dω / ∫ K dω: 0 for a mirror (α = 0), 1/3 for the cosine (α = 1).
///
/// ∫ c²/q² dc over 0 to 1 is α²/k³ · ((1 + x)² − 1 − 2(1 + x) ln(1 + x)).
pub fn kernel_spread(alpha: f64) -> f64 {
    let (k, a2) = (steepness(alpha), alpha * alpha);
    if a2 < 1e-12 {
        return 0.0;
    }
    let x = k / a2;
    let first_moment = if x < 1e-3 {
        (1.0 / 3.0 - x / 6.0 + x * x / 10.0 - x.powi(3) / 15.0) / (a2 * a2)
    } else {
        a2 / k.powi(3) * ((2.0 + x) * x - 2.0 * (1.0 + x) * x.ln_1p())
    };
    1.0 - TAU * first_moment / kernel_integral(alpha)
}

fn steepness(alpha: f64) -> f64 {
    0.5 * (1.0 - alpha * alpha)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::reference::brdf::d_ggx;

    /// ∫ f(c) dω by midpoints in t, 1 − c = α² (e^t − 1), which resolves the peak.
    fn over_sphere(alpha: f64, f: impl Fn(f64) -> f64) -> f64 {
        const STEPS: u32 = 20_000;
        let a2 = alpha * alpha;
        let end = (1.0 / a2).ln_1p();
        let dt = end / f64::from(STEPS);
        let at = |i: u32| {
            let t = (f64::from(i) + 0.5) * dt;
            f(1.0 - a2 * t.exp_m1()) * a2 * t.exp() * dt
        };
        TAU * (0..STEPS).map(at).sum::<f64>()
    }

    const ALPHAS: [f64; 8] = [1.0 / 256.0, 1.0 / 64.0, 0.1, 0.5, 0.9, 0.9995, 0.999_999, 1.0];

    #[test]
    fn closed_forms_agree_with_quadrature() {
        for alpha in ALPHAS {
            let integral = over_sphere(alpha, |c| kernel(c, alpha));
            assert!((kernel_integral(alpha) / integral - 1.0).abs() < 1e-6, "alpha {alpha}");
            let spread = over_sphere(alpha, |c| (1.0 - c) * kernel(c, alpha)) / integral;
            assert!((kernel_spread(alpha) / spread - 1.0).abs() < 1e-6, "alpha {alpha}");
        }
        assert_eq!(kernel_spread(0.0), 0.0);
    }

    #[test]
    fn the_kernel_is_ggx_times_the_cosine() {
        for alpha in [0.05, 0.3, 1.0] {
            let ratio = |c: f64| {
                let l = DVec3::new((1.0 - c * c).sqrt(), 0.0, c);
                kernel(c, alpha) / (c * d_ggx(DVec3::Z, DVec3::Z + l, alpha))
            };
            for c in [0.01, 0.5, 0.99] {
                assert!((ratio(c) / ratio(1.0) - 1.0).abs() < 1e-9, "alpha {alpha}, c {c}");
            }
            assert_eq!(kernel(-0.1, alpha), 0.0);
        }
    }

    #[test]
    fn the_second_derivative_agrees_with_differences() {
        for alpha in [0.05, 0.3, 1.0] {
            for c in [0.1, 0.6, 0.95] {
                let h = 1e-4;
                let k = |c| kernel(c, alpha);
                let numeric = (k(c + h) - 2.0 * k(c) + k(c - h)) / (h * h);
                let exact = kernel_second_derivative(c, alpha);
                assert!(
                    (numeric - exact).abs() < 1e-3 * exact.abs().max(1.0),
                    "{numeric}, {exact}: alpha {alpha}, {c}"
                );
            }
        }
        assert_eq!(kernel_second_derivative(-0.1, 0.3), 0.0);
    }
}
