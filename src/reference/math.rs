//! Constants and vector helpers: twins of `glsl/math.glsl`.

use glam::DVec3;

/// Smallest cosine that the terms divide by. Cosines of f32 unit vectors have an absolute error of about 1e-7, so
/// smaller values are noise; a maximum, unlike an added epsilon, does not change larger values.
pub const MIN_COS: f64 = 1e-7;

/// Smallest divisor where the dividend vanishes too: far above f32's smallest normal (1.2e-38), far below any value
/// that a term reaches with unit vectors.
pub const TINY: f64 = 1e-30;

/// The unit vector along v, or `otherwise` (unit) where v has no direction: zero, NaN, or above 1e30.
/// Divided by its 1-norm first, so that 1e-23 and 1e20 do not under- or overflow when squared in f32.
pub fn normalize_or(v: DVec3, otherwise: DVec3) -> DVec3 {
    let size = v.x.abs() + v.y.abs() + v.z.abs();
    if size > TINY && size < 1e30 { (v / size).normalize() } else { otherwise }
}

/// GLSL's: 0 up to `low`, 1 from `high` on, a cubic between.
pub fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let part = ((x - low) / (high - low)).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// x rounded to the ten mantissa bits of a half float, ties upwards; for 0 and x ≥ 6e-5.
pub fn round_to_half(x: DVec3) -> DVec3 {
    x.map(|c| {
        if c == 0.0 {
            return c;
        }
        let step = (c.log2().floor() - 10.0).exp2();
        (c / step + 0.5).floor() * step
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Case 17 of tests/gpu/stability.rs.
    #[test]
    fn normals_of_any_size_have_a_direction() {
        let textbook = |v: Vec3| v / v.dot(v).sqrt();
        let ours = |v: Vec3| {
            let size = v.x.abs() + v.y.abs() + v.z.abs();
            if size > TINY as f32 && size < 1e30 { textbook(v / size) } else { Vec3::Z }
        };
        let truth = DVec3::new(0.6, 0.0, 0.8);
        for scale in [1e-23f32, 1e20] {
            let v = Vec3::new(0.6, 0.0, 0.8) * scale;
            assert!((textbook(v).length() - 1.0).abs() > 0.1 || textbook(v).is_nan(), "v / |v| now survives {scale}");
            assert!(
                ours(v).as_dvec3().abs_diff_eq(truth, 1e-6)
                    && normalize_or(v.as_dvec3(), DVec3::Z).abs_diff_eq(truth, 1e-6)
            );
        }
        for v in [Vec3::ZERO, Vec3::NAN, Vec3::new(0.0, f32::NAN, 1.0), Vec3::INFINITY] {
            assert!(textbook(v).is_nan(), "v / |v| now survives {v}");
            assert!(ours(v) == Vec3::Z && normalize_or(v.as_dvec3(), DVec3::Z) == DVec3::Z, "{v}");
        }
    }
}
