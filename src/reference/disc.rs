//! A light that is a disc far away, in f64: the twin of `glsl/disc.glsl`.
//!
//! n, v, l: unit vectors away from the surface (normal, to the eye, to the disc's centre). `sine`: of the disc's angular
//! radius a. A disc of irradiance E, facing it, has the radiance E / (π sine²) and fills 2π (1 − cos a).

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use glam::{DVec2, DVec3};

use super::brdf::{f_schlick, v_smith_height_correlated};
use super::math::{MIN_COS, TINY};
use super::sampling::basis;

/// Smallest α for a disc: its lobe (0.05°) is narrower than a headset's pixel (0.09°), so that a mirror shows the disc and
/// not a blur, and wide enough for f32.
pub const DISC_MIN_ALPHA: f64 = 4e-4;

/// Smallest n·h: beyond, slopes run away, and a disc would fill all of them. It changes D by at most 0.5 %.
const LEAST_NH: f64 = 0.05;

/// 1 − cos a.
pub fn disc_versine(sine: f64) -> f64 {
    sine * sine / (1.0 + (1.0 - sine * sine).max(0.0).sqrt())
}

/// Mean of max(n·l, 0) over the disc: n·l where all of it is above the horizon. Below, a parabola with the same value and
/// slope at both ends; off by at most 0.04 sine.
pub fn disc_cosine(nl: f64, sine: f64) -> f64 {
    let above = (nl + sine).max(0.0);
    if nl >= sine { nl } else { above * above / (4.0 * sine) }
}

/// Mean of GGX over the disc's half vectors.
///
/// Over slopes x = tan θ of half vectors, GGX is α² / (π (α² + x²)²): the stereographic projection of an even sphere, so that
/// its integral over a circle is the area of a spherical cap (the same property as in Dupuy, Heitz and Belcour, "A Spherical
/// Cap Preserving Parameterization for Spherical Distributions" (2017)). With centre t, radius ρ, A = α² + t² − ρ² and
/// H² = A² + 4 α² ρ² the mean is 2 α² / (π H (H + A)), a point light's D for ρ = 0.
///
/// The disc's half vectors fill an ellipse: half its size in the plane of v and l, that over v·h across it. The circle has
/// the ellipse's area; as far as the disc is wider than the lobe, t is measured in the ellipse's own radii, so that a
/// mirror shows the disc's outline.
pub fn disc_ggx(n: DVec3, v: DVec3, l: DVec3, alpha: f64, sine: f64) -> f64 {
    let sum = v + l;
    let vh = (0.5 * sum.length()).max(MIN_COS);
    let h = sum / (2.0 * vh);
    let nh = n.dot(h).max(LEAST_NH);
    // All squares of slopes are times nh² from here on.
    let a2 = (alpha * nh).powi(2);
    let radius2 = 0.5 * disc_versine(sine) / (vh * nh);
    let across = v.cross(l);
    let aside = n.dot(across).powi(2) / across.length_squared().max(TINY);
    let round = n.cross(h).length_squared();
    let own_radii = (round - aside).max(0.0) / vh + aside * vh;
    let wider = radius2 / (radius2 + a2);
    let t2 = round + (own_radii - round) * wider * wider;
    let (a, b2) = (a2 + t2 - radius2, 4.0 * a2 * radius2);
    let hypotenuse = (a * a + b2).sqrt().max(TINY);
    // H + A cancels for A < 0: (H + A) (H − A) = 4 α² ρ².
    let mean =
        if a >= 0.0 { 2.0 * alpha * alpha / (hypotenuse + a) } else { (hypotenuse - a) / (2.0 * radius2 * nh * nh) };
    // At most D's peak, also where h has no direction (l = −v).
    (mean / hypotenuse).min(1.0 / (alpha * alpha)) * FRAC_1_PI
}

/// Single scattering of the disc's light with height-correlated Smith, in 1/sr; multiply by [`disc_cosine`] and the
/// irradiance. Fresnel and masking are those of its centre.
pub fn disc_specular(n: DVec3, v: DVec3, l: DVec3, f0: DVec3, alpha: f64, sine: f64) -> DVec3 {
    let alpha = alpha.max(DISC_MIN_ALPHA);
    let nl = disc_cosine(n.dot(l), sine);
    let l = l + (nl - n.dot(l)) * n; // what is above the horizon
    let visibility = v_smith_height_correlated(nl, n.dot(v), alpha);
    f_schlick(f0, 0.5 * (v + l).length()) * (disc_ggx(n, v, l, alpha, sine) * visibility)
}

/// Phong exponent of a lobe that is widened by the disc: variances, 1 / exponent and sine² / 4 along each axis, add up.
pub fn disc_phong_exponent(exponent: f64, sine: f64) -> f64 {
    1.0 / (1.0 / exponent.max(TINY) + 0.25 * sine * sine)
}

/// A direction within the disc, evenly over its solid angle, for u in [0, 1)².
pub fn sample_disc(u: DVec2, towards: DVec3, sine: f64) -> DVec3 {
    let versine = u.x * disc_versine(sine);
    let across = (versine * (2.0 - versine)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
    basis(towards) * DVec3::new(across * cos_phi, across * sin_phi, 1.0 - versine)
}

/// Density of [`sample_disc`] at a unit direction, 1/sr; 0 outside of the disc.
pub fn disc_density(d: DVec3, towards: DVec3, sine: f64) -> f64 {
    let versine = disc_versine(sine);
    // |d − towards|² is 2 (1 − cos), without its cancellation.
    let inside = 0.5 * (d - towards).length_squared() <= versine;
    if inside { 1.0 / (TAU * versine) } else { 0.0 }
}

/// The part of a disc's radiance that a pixel sees at an angle from its centre, both in radians, as is the pixel's width: 1
/// inside, a ramp as wide as the pixel at the edge, and dimmer where the disc is smaller than the pixel, so that the
/// picture's sum of light stays the disc's. The ramp's integral is π (R² + w² / 12).
pub fn disc_coverage(angle: f64, radius: f64, pixel: f64) -> f64 {
    let wide = radius.max(0.5 * pixel);
    let ramp = ((wide - angle) / pixel.max(TINY) + 0.5).clamp(0.0, 1.0);
    ramp * radius * radius / (wide * wide + pixel * pixel / 12.0)
}

/// The disc's radiance for an irradiance at normal incidence.
pub fn disc_radiance(irradiance: DVec3, sine: f64) -> DVec3 {
    irradiance / (PI * sine * sine)
}

#[cfg(test)]
#[path = "disc_tests.rs"]
mod tests;
