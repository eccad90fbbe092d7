//! The terms of the BRDF in f64, one function each: twins of `glsl/brdf.glsl`.
//!
//! n, v, l: unit vectors away from the surface (normal, to the eye, to the light); h = v + l of any length.
//! nl, nv, vh: the cosines between them. Colours are linear RGB.

use std::f64::consts::{FRAC_1_PI, PI};

use clap::ValueEnum;
use glam::{DVec2, DVec3};

use super::math::{MIN_COS, TINY};

/// Reflectance of a dielectric at normal incidence: ((1.5 − 1) / (1.5 + 1))², 1.5 being the index of glass and most
/// plastics.
pub const DIELECTRIC_F0: f64 = 0.04;

/// Smallest roughness for point lights: there D falls to a quarter over 4α = 0.46°, less than the sun's disc (0.53°)
/// and about five pixels of an HTC Vive (0.09°). Real lights have no smaller highlights, and those would flicker
/// between pixels.
pub const MIN_ROUGHNESS: f64 = 0.045;

/// A set of terms; the values are those of the GLSL constants `GEOMETRY_…`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
#[repr(i32)]
pub enum Geometry {
    /// Height-correlated Smith (Heitz 2014) for every light, and an energy-conserving diffuse part.
    #[default]
    Smith = 0,
    /// As in the thesis: Schlick's G1 with Karis's two values of k (2013), and Lambert times 1 − F(v·h); for the
    /// environment, times 1 − specular albedo. The thesis's additional Fresnel by roughness, which the table includes
    /// already, is measured separately (`measure causes`).
    Karis2013 = 1,
}

/// α = roughness²: Burley, "Physically-Based Shading at Disney" (2012), section 5.4.
pub fn alpha_from_roughness(roughness: f64) -> f64 {
    roughness.max(MIN_ROUGHNESS).powi(2)
}

/// Upper bound of what [`widened_roughness`] adds to α²: Tokuyoshi and Kaplanyan (2019).
pub const MOST_WIDENED: f64 = 0.18;

/// Roughness of a lobe that includes the variance of the normals within a pixel (both axes summed): Tokuyoshi and
/// Kaplanyan, "Improved Geometric Specular Antialiasing" (2019).
pub fn widened_roughness(roughness: f64, variance: f64) -> f64 {
    let alpha = alpha_from_roughness(roughness);
    (alpha * alpha + variance.min(MOST_WIDENED)).min(1.0).powf(0.25)
}

/// GGX in 1/sr: Walter et al., "Microfacet Models for Refraction through Rough Surfaces" (2007), eq. 33.
///
/// 1 − (n·h)² is written |n × h|², and both are scaled by |h|² instead of normalising h. 0 for h = 0.
pub fn d_ggx(n: DVec3, h: DVec3, alpha: f64) -> f64 {
    let sine_squared = n.cross(h).length_squared();
    let k = alpha * h.length_squared() / (sine_squared + (alpha * n.dot(h)).powi(2)).max(TINY);
    k * k * FRAC_1_PI
}

/// Alphas along the direction in which highlights are stretched, and across it, for a strength from 0 to 1:
/// KHR_materials_anisotropy.
pub fn stretched_alphas(alpha: f64, strength: f64) -> DVec2 {
    DVec2::new(alpha + (1.0 - alpha) * strength * strength, alpha)
}

/// Roughness of the round lobe that stands for a stretched one where it is averaged over all views: of the root mean square
/// of both alphas, which is what masking sees. Its albedo is that of the stretched lobe to 5 %.
pub fn round_roughness(alphas: DVec2) -> f64 {
    (0.5 * alphas.length_squared()).sqrt().sqrt()
}

/// GGX over an ellipse of slopes: Burley, "Physically-Based Shading at Disney" (2012), appendix B.2; h of any length in a
/// frame whose x is the direction of `alphas.x` and whose z is the normal.
pub fn d_ggx_stretched(h: DVec3, alphas: DVec2) -> f64 {
    let (ratio, product) = (alphas.x.max(TINY) / alphas.y.max(TINY), alphas.x * alphas.y);
    let below = h.x * h.x / ratio + h.y * h.y * ratio + product * h.z * h.z;
    let k = product.sqrt() * h.length_squared() / below.max(TINY);
    k * k * FRAC_1_PI
}

/// [`v_smith_height_correlated`] for it, in the same frame: Heitz (2014), eq. 86.
pub fn v_smith_stretched(l: DVec3, v: DVec3, alphas: DVec2) -> f64 {
    let stretched = |d: DVec3| DVec3::new(alphas.x * d.x, alphas.y * d.y, d.z.max(MIN_COS)).length();
    0.5 / (l.z.max(MIN_COS) * stretched(v) + v.z.max(MIN_COS) * stretched(l))
}

/// Height-correlated Smith masking and shadowing over 4 nl nv: Heitz, "Understanding the Masking-Shadowing Function"
/// (2014), eq. 99, with Λ of GGX, eq. 72.
pub fn v_smith_height_correlated(nl: f64, nv: f64, alpha: f64) -> f64 {
    let (nl, nv, a2) = (nl.max(MIN_COS), nv.max(MIN_COS), alpha * alpha);
    let towards_v = nl * (a2 + (1.0 - a2) * nv * nv).sqrt();
    let towards_l = nv * (a2 + (1.0 - a2) * nl * nl).sqrt();
    0.5 / (towards_v + towards_l)
}

/// Schlick's G1(l) G1(v) over 4 nl nv for a given k: Karis, "Real Shading in Unreal Engine 4" (2013), eq. 4.
pub fn v_karis2013(nl: f64, nv: f64, k: f64) -> f64 {
    let (nl, nv) = (nl.max(MIN_COS), nv.max(MIN_COS));
    0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k))
}

/// The visibility for point lights, k = (roughness + 1)² / 8: Karis (2013), eq. 4 and the remapping above it.
pub fn v_karis2013_direct(nl: f64, nv: f64, roughness: f64) -> f64 {
    v_karis2013(nl, nv, (roughness + 1.0).powi(2) / 8.0)
}

/// The visibility for the environment, k = roughness² / 2: Karis (2013), section on the geometric term.
pub fn v_karis2013_ibl(nl: f64, nv: f64, roughness: f64) -> f64 {
    v_karis2013(nl, nv, roughness.powi(2) / 2.0)
}

/// The visibility of `geometry` for a point light.
pub fn v_direct(nl: f64, nv: f64, roughness: f64, geometry: Geometry) -> f64 {
    match geometry {
        Geometry::Smith => v_smith_height_correlated(nl, nv, alpha_from_roughness(roughness)),
        Geometry::Karis2013 => v_karis2013_direct(nl, nv, roughness),
    }
}

/// The visibility of `geometry` for the environment. Any roughness from 0: integrals need no minimum.
pub fn v_environment(nl: f64, nv: f64, roughness: f64, geometry: Geometry) -> f64 {
    match geometry {
        Geometry::Smith => v_smith_height_correlated(nl, nv, roughness * roughness),
        Geometry::Karis2013 => v_karis2013_ibl(nl, nv, roughness),
    }
}

/// (1 − cosine)⁵, multiplied out.
pub fn schlick_weight(cosine: f64) -> f64 {
    (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// What a surface reflects at normal incidence and at grazing angles; of F0 alone, all at the latter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fresnel {
    /// Linear RGB.
    pub f0: DVec3,
    /// The same of all colours.
    pub f90: f64,
}

impl From<DVec3> for Fresnel {
    fn from(f0: DVec3) -> Self {
        Self { f0, f90: 1.0 }
    }
}

impl Fresnel {
    /// That of a dielectric of gray F0.
    pub fn dielectric(f0: f64) -> Self {
        DVec3::splat(f0).into()
    }

    /// That of a mix with a metal, whose base color is its F0. Karis (2013), section "Material Model".
    pub fn mixed(self, base_color: DVec3, metallic: f64) -> Self {
        Self { f0: self.f0.lerp(base_color, metallic), f90: self.f90 + metallic * (1.0 - self.f90) }
    }

    /// Its mean over directions under the cosine: F0 + (F90 − F0) / 21.
    pub fn mean(self) -> DVec3 {
        self.f0 + (DVec3::splat(self.f90) - self.f0) / 21.0
    }
}

/// Schlick, "An Inexpensive BRDF Model for Physically-based Rendering" (1994), eq. 15.
pub fn f_schlick(fresnel: impl Into<Fresnel>, vh: f64) -> DVec3 {
    let Fresnel { f0, f90 } = fresnel.into();
    f0 + (DVec3::splat(f90) - f0) * schlick_weight(vh)
}

/// Schlick's weight towards max(1 − roughness, f0) instead of 1: Lagarde, "Adopting a physically based shading model"
/// (2011). With a split-sum table, which includes this effect, Fresnel would be applied twice.
pub fn f_schlick_roughness(f0: DVec3, nv: f64, roughness: f64) -> DVec3 {
    f0 + (f0.max(DVec3::splat(1.0 - roughness)) - f0) * schlick_weight(nv)
}

/// Lambert's cosine law as a BRDF in 1/sr: albedo / π.
pub fn diffuse_lambert(albedo: DVec3) -> DVec3 {
    albedo * FRAC_1_PI
}

/// The thesis's diffuse part for point lights, in 1/sr: Lambert times 1 − F(v·h). Reflects up to 1.86 of the incoming
/// light.
pub fn diffuse_karis2013(albedo: DVec3, fresnel: impl Into<Fresnel>, vh: f64) -> DVec3 {
    (DVec3::ONE - f_schlick(fresnel, vh)) * diffuse_lambert(albedo)
}

/// Reflectance at normal incidence: that of dielectrics, or the base color of a metal. Karis (2013), section "Material
/// Model".
pub fn f0_from_metallic(base_color: DVec3, metallic: f64, dielectric_f0: f64) -> DVec3 {
    Fresnel::dielectric(dielectric_f0).mixed(base_color, metallic).f0
}

/// Coverage of a sheet that transmits light, at a cosine, from that of light from all sides: by Schlick's form it transmits
/// 1 − F = (1 − F0) (1 − weight), whose mean under the cosine is (1 − F0) 20 / 21.
pub fn slanted_coverage(coverage: f64, cosine: f64) -> f64 {
    (1.0 - (1.0 - coverage) * 1.05 * (1.0 - schlick_weight(cosine))).max(0.0)
}

/// Single scattering for a point light, in 1/sr; multiply by max(n·l, 0) and the light's irradiance.
///
/// F V D: Cook and Torrance, "A Reflectance Model for Computer Graphics" (1982), with V = G / (4 nl nv);
/// v·h = |v + l| / 2 for unit vectors.
pub fn specular(
    n: DVec3,
    v: DVec3,
    l: DVec3,
    fresnel: impl Into<Fresnel>,
    roughness: f64,
    geometry: Geometry,
) -> DVec3 {
    let h = v + l;
    let d = d_ggx(n, h, alpha_from_roughness(roughness));
    f_schlick(fresnel, 0.5 * h.length()) * (d * v_direct(n.dot(l), n.dot(v), roughness, geometry))
}

/// Phong exponent of a lobe as wide as Beckmann's for this roughness: 2/α² − 2 is the exponent over n·h (Walter et
/// al. 2007, section 5.2); the angle to the mirror direction is twice that to h, which takes a quarter of it.
pub fn phong_exponent(roughness: f64) -> f64 {
    0.5 / alpha_from_roughness(roughness).powi(2) - 0.5
}

/// Energy-normalised Phong lobe in 1/sr for a specular reflectance of 1: Lafortune and Willems, "Using the Modified
/// Phong Reflectance Model for Physically Based Rendering" (1994), section 3.
pub fn phong_specular(n: DVec3, v: DVec3, l: DVec3, roughness: f64) -> f64 {
    let exponent = phong_exponent(roughness);
    let rv = (2.0 * n.dot(l) * n - l).dot(v).clamp(MIN_COS, 1.0);
    (exponent + 2.0) / (2.0 * PI) * rv.powf(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::table::specular_albedo;
    use std::f32::consts::PI as PI32;

    use glam::Vec3;

    const Z: DVec3 = DVec3::Z;

    fn direction(polar: f64, azimuth: f64) -> DVec3 {
        DVec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
    }

    /// Integral of f over the upper hemisphere: midpoints in azimuth and in t with tan(polar) = scale · tan(t), so that
    /// a lobe of that width around n is resolved.
    fn over_hemisphere(scale: f64, f: impl Fn(DVec3) -> DVec3) -> DVec3 {
        const STEPS: usize = 400;
        let dt = PI / 2.0 / STEPS as f64;
        let dphi = 2.0 * PI / STEPS as f64;
        let mut sum = DVec3::ZERO;
        for i in 0..STEPS {
            let (s, c) = ((i as f64 + 0.5) * dt).sin_cos();
            let polar = (scale * s).atan2(c);
            let dpolar = scale / (c * c + scale * scale * s * s) * dt;
            for j in 0..STEPS {
                sum += f(direction(polar, (j as f64 + 0.5) * dphi)) * (polar.sin() * dpolar * dphi);
            }
        }
        sum
    }

    /// `d_ggx` as the shader computes it.
    fn d_ggx_f32(n: Vec3, h: Vec3, alpha: f32) -> f32 {
        let k =
            alpha * h.length_squared() / (n.cross(h).length_squared() + (alpha * n.dot(h)).powi(2)).max(TINY as f32);
        k * k * std::f32::consts::FRAC_1_PI
    }

    fn d_textbook_f32(nh: f32, alpha: f32) -> f32 {
        let t = nh * nh * (alpha * alpha - 1.0) + 1.0;
        alpha * alpha / (PI32 * t * t)
    }

    #[test]
    fn ggx_projected_area_is_one() {
        for roughness in [0.01, 0.045, 0.2, 0.5, 1.0] {
            let alpha = roughness * roughness;
            let area = over_hemisphere(alpha, |h| DVec3::splat(d_ggx(Z, h, alpha) * h.z)).x;
            assert!((area - 1.0).abs() < 1e-5, "roughness {roughness}: {area}");
        }
    }

    #[test]
    fn ggx_ignores_the_length_of_h() {
        let h = direction(0.3, 1.0);
        let at = |scale: f64| d_ggx(Z, h * scale, 0.1);
        assert!((at(1.7) / at(1.0) - 1.0).abs() < 1e-12);
        assert_eq!(d_ggx(Z, DVec3::ZERO, 0.1), 0.0);
    }

    /// Case 1 of tests/gpu/stability.rs.
    #[test]
    fn ggx_survives_small_roughness_in_f32() {
        assert!(d_textbook_f32(1.0, 0.01f32.powi(2)).is_infinite(), "the textbook form no longer overflows");
        assert!(d_textbook_f32(1.0, 0.0).is_nan(), "the textbook form no longer divides 0 by 0");
        for roughness in [1e-3f32, 0.01, 0.02, 0.045, 1.0] {
            let alpha = roughness * roughness;
            let truth = 1.0 / (PI * f64::from(alpha).powi(2));
            let ours = f64::from(d_ggx_f32(Vec3::Z, Vec3::Z, alpha));
            assert!((ours / truth - 1.0).abs() < 1e-5, "roughness {roughness}: {ours} against {truth}");
        }
        assert_eq!(d_ggx_f32(Vec3::Z, Vec3::Z, 0.0), 0.0);
    }

    /// Case 2 of tests/gpu/stability.rs.
    #[test]
    fn ggx_keeps_its_digits_near_the_centre_in_f32() {
        let alpha = MIN_ROUGHNESS.powi(2);
        let mut worst = [0f64; 2];
        for i in 1..200 {
            let h = direction(f64::from(i) * 5e-5, 0.7).as_vec3();
            let exact = h.as_dvec3();
            let truth = d_ggx(Z, exact / exact.length(), alpha);
            let errors = [d_textbook_f32(h.z, alpha as f32), d_ggx_f32(Vec3::Z, h, alpha as f32)];
            for (worst, error) in worst.iter_mut().zip(errors) {
                *worst = worst.max((f64::from(error) / truth - 1.0).abs());
            }
        }
        assert!(worst[0] > 1e-2, "the textbook form is no longer off: {}", worst[0]);
        assert!(worst[1] < 1e-5, "ours is off by {}", worst[1]);
    }

    /// Case 3 of tests/gpu/stability.rs.
    #[test]
    fn visibility_survives_grazing_angles() {
        let smith_g = |c: f64, a2: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
        let naive = |c: f64, epsilon: f64| smith_g(c, 0.0625).powi(2) / (4.0 * c * c + epsilon);
        assert!(naive(0.0, 0.0).is_nan(), "dividing by 4 nl nv no longer fails");
        for (cosine, bias) in [(0.01, 0.20), (0.001, 0.96)] {
            let loss = 1.0 - naive(cosine, 1e-4) / naive(cosine, 0.0);
            assert!((loss - bias).abs() < 0.01, "an added epsilon now loses {loss} at {cosine}");
        }
        for alpha in [0.0, alpha_from_roughness(0.0), 0.25, 1.0] {
            for cosine in [-1.0, -1e-9, 0.0, 1e-30, 1e-8] {
                for v in [
                    v_smith_height_correlated(cosine, cosine, alpha),
                    v_karis2013_direct(cosine, 1.0, alpha.sqrt()),
                    v_karis2013_ibl(cosine, cosine, alpha.sqrt()),
                ] {
                    assert!(v >= 0.0 && v < f64::from(f32::MAX), "{v} at alpha {alpha}, cosine {cosine}");
                }
            }
        }
        // Above MIN_COS the value is the untouched formula.
        let (nl, nv, a2) = (0.001f64, 0.002f64, 0.0625f64);
        let lambda = |c: f64| 0.5 * ((1.0 + a2 * (1.0 - c * c) / (c * c)).sqrt() - 1.0);
        let truth = 1.0 / (1.0 + lambda(nl) + lambda(nv)) / (4.0 * nl * nv);
        assert!((v_smith_height_correlated(nl, nv, 0.25) / truth - 1.0).abs() < 1e-9);
    }

    #[test]
    fn visibility_limits() {
        for roughness in [0.0, 0.3, 1.0] {
            // Nothing is masked head on by a smooth surface: G = 1, V = 1/4.
            assert!((v_smith_height_correlated(1.0, 1.0, roughness) - 0.25).abs() < 1e-12);
            assert!((v_karis2013_ibl(1.0, 1.0, roughness) - 0.25).abs() < 1e-12);
        }
        for i in 1..20 {
            for j in 1..20 {
                let (nl, nv) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                let a2 = 0.3f64.powi(2);
                let g1 = |c: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
                let g2 = v_smith_height_correlated(nl, nv, 0.3) * 4.0 * nl * nv;
                // Correlated masking lies between independent masking and the stronger of the two.
                assert!(g2 >= g1(nl) * g1(nv) - 1e-12 && g2 <= g1(nl).min(g1(nv)) + 1e-12, "{g2} at {nl}, {nv}");
                let karis = v_karis2013_direct(nl, nv, 0.3) * 4.0 * nl * nv;
                assert!((0.0..=1.0).contains(&karis), "{karis} at {nl}, {nv}");
            }
        }
        // Karis chose k = alpha / 2 so that Schlick's G1 follows Smith's: alike at alpha = 1, below it by 0.17 at most.
        for i in 1..=100 {
            for alpha in [0.01, 0.1, 0.5, 1.0] {
                let c = f64::from(i) / 100.0;
                let smith = 2.0 * c / (c + (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt());
                let schlick = v_karis2013_ibl(c, c, alpha.sqrt()).sqrt() * 2.0 * c;
                let most = if alpha == 1.0 { 1e-12 } else { 0.17 };
                assert!((-1e-12..most).contains(&(smith - schlick)), "{smith} and {schlick} at {c}, alpha {alpha}");
            }
        }
    }

    #[test]
    fn fresnel_ends() {
        let f0 = DVec3::new(0.04, 0.5, 1.0);
        assert_eq!(f_schlick(f0, 1.0), f0);
        assert!(f_schlick(f0, 0.0).abs_diff_eq(DVec3::ONE, 1e-15));
        assert_eq!(f_schlick_roughness(f0, 1.0, 0.3), f0);
        assert!(f_schlick_roughness(f0, 0.0, 0.3).abs_diff_eq(DVec3::new(0.7, 0.7, 1.0), 1e-15));
        assert_eq!(f0_from_metallic(f0, 0.0, 0.04), DVec3::splat(0.04));
        assert_eq!(f0_from_metallic(f0, 1.0, 0.04), f0);
    }

    /// Case 16 of tests/gpu/stability.rs.
    #[test]
    fn fresnel_survives_a_cosine_above_one() {
        // GLSL's pow(x, y) is exp2(y log2(x)).
        let pow = |x: f32, y: f32| (y * x.log2()).exp2();
        assert!(pow(1.0 - 1.000_000_1, 5.0).is_nan(), "a power of a negative base is no longer NaN");
        assert_eq!(schlick_weight(1.000_000_1), 0.0);
        assert_eq!(schlick_weight(-1e-9), 1.0);
    }

    /// Case 14 of tests/gpu/stability.rs.
    #[test]
    fn opposite_directions_give_a_finite_brdf() {
        let v = direction(1.2, 0.4);
        assert!(((v - v) / (v - v).length()).is_nan(), "normalising 0 is no longer NaN");
        for geometry in [Geometry::Smith, Geometry::Karis2013] {
            let f = specular(Z, v, -v, DVec3::splat(0.5), 0.3, geometry);
            assert!(f.is_finite() && f.min_element() >= 0.0, "{f}");
        }
        assert_eq!(d_ggx_f32(Vec3::Z, Vec3::ZERO, 0.002), 0.0);
        assert!(phong_specular(Z, v, -v, 0.3).is_finite());
    }

    #[test]
    fn single_scattering_is_reciprocal_and_not_negative() {
        let f0 = DVec3::new(0.9, 0.5, 0.1);
        for i in 0..200 {
            let t = f64::from(i);
            let (v, l) = (direction((0.37 * t) % 1.57, t), direction((0.73 * t) % 1.57, 2.3 * t));
            for geometry in [Geometry::Smith, Geometry::Karis2013] {
                let roughness = (0.17 * t) % 1.0;
                let there = specular(Z, v, l, f0, roughness, geometry);
                let back = specular(Z, l, v, f0, roughness, geometry);
                assert!(there.abs_diff_eq(back, 1e-9 * there.max_element()), "{there} and {back}");
                assert!(there.min_element() >= 0.0);
            }
        }
    }

    fn eye(nv: f64) -> DVec3 {
        DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv)
    }

    /// Directional albedo of a white metal, by quadrature over h.
    fn metal_albedo(nv: f64, roughness: f64, geometry: Geometry) -> f64 {
        let v = eye(nv);
        let at = |h: DVec3| {
            let (vh, l) = (v.dot(h), 2.0 * v.dot(h) * h - v);
            let seen = l.z > 0.0 && vh > 0.0;
            if seen { specular(Z, v, l, DVec3::ONE, roughness, geometry) * l.z * 4.0 * vh } else { DVec3::ZERO }
        };
        over_hemisphere(alpha_from_roughness(roughness), at).x
    }

    #[test]
    fn a_white_metal_conserves_energy() {
        for roughness in [0.05, 0.3, 0.6, 1.0] {
            for nv in [0.05, 0.3, 0.7, 1.0] {
                for (geometry, least) in [(Geometry::Smith, 0.3), (Geometry::Karis2013, 0.05)] {
                    let share = metal_albedo(nv, roughness, geometry);
                    assert!(share > least && share < 1.0 + 1e-3, "{share}: {roughness}, n·v {nv}, {geometry:?}");
                }
            }
        }
        // Case 20 of tests/gpu/stability.rs.
        let head_on: f64 = over_hemisphere(1.0, |h| {
            let l = 2.0 * h.z * h - Z;
            DVec3::splat(d_ggx(Z, h, 1.0) * v_karis2013_ibl(l.z, 1.0, 1.0) * l.z.max(0.0) * 4.0 * h.z)
        })
        .x;
        assert!((head_on - 0.31).abs() < 0.005, "{head_on}");
    }

    /// The diffuse part of `reference::energy` does not.
    #[test]
    fn the_white_dielectric_of_the_thesis_reflects_more_than_it_receives() {
        let f0 = DVec3::splat(DIELECTRIC_F0);
        let mut most = 0.0f64;
        for nv in [0.01, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0] {
            let v = eye(nv);
            let diffuse = over_hemisphere(1.0, |l| diffuse_karis2013(DVec3::ONE, f0, 0.5 * (v + l).length()) * l.z).x;
            for roughness in [0.045, 0.1, 0.3, 0.6, 1.0] {
                most = most.max(diffuse + specular_albedo(f0, nv, roughness, Geometry::Smith).x);
            }
        }
        assert!((1.8..1.87).contains(&most), "1 − F(v·h) no longer creates energy: {most}");
    }

    #[test]
    fn phong_reflects_all_at_normal_incidence_and_is_as_wide_as_beckmann() {
        for roughness in [0.1, 0.3, 0.7, 1.0] {
            let scale = 2.0 * alpha_from_roughness(roughness);
            let share = over_hemisphere(scale, |l| DVec3::splat(phong_specular(Z, Z, l, roughness) * l.z)).x;
            assert!((share - 1.0).abs() < 1e-4, "roughness {roughness}: {share}");
        }
        // Near the lobe's centre both fall off equally.
        let alpha = 0.04;
        let l = direction(0.2 * alpha, 0.0);
        let beckmann = (-(0.1 * alpha).tan().powi(2) / (alpha * alpha)).exp();
        let phong = phong_specular(Z, Z, l, 0.2) / phong_specular(Z, Z, Z, 0.2);
        assert!((beckmann - phong).abs() < 1e-3 && phong < 0.995, "{beckmann} and {phong}");
    }
}
