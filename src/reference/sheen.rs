//! Sheen of cloth in f64: what a layer of fibres adds, and what it leaves of the light of what is below.

use std::f64::consts::PI;

use glam::DVec3;

use super::math::MIN_COS;

/// Of a white sheen, below it, more would come back at grazing angles than arrives.
pub const MIN_SHEEN_ROUGHNESS: f64 = 0.2;

/// "Charlie", the distribution of normals of Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF" (2017), eq. 2, 1/sr;
/// h of any length.
pub fn d_charlie(n: DVec3, h: DVec3, alpha: f64) -> f64 {
    let squared = (n.cross(h).length_squared() / h.length_squared().max(f64::MIN_POSITIVE)).min(1.0);
    (2.0 + 1.0 / alpha) * squared.powf(0.5 / alpha) / (2.0 * PI)
}

/// L of the same paper's eq. 3, with the numbers of its table 1.
fn curve(x: f64, alpha: f64) -> f64 {
    let smoothness = (1.0 - alpha).powi(2);
    let mix = |rough: f64, smooth: f64| rough + smoothness * (smooth - rough);
    let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
    a / (1.0 + b * x.powf(c)) + mix(-1.97760, -1.27393) * x + mix(-4.32054, -4.85967)
}

/// Lambda of Smith's masking, the same paper's eq. 3.
pub fn sheen_lambda(cosine: f64, alpha: f64) -> f64 {
    let cosine = cosine.clamp(MIN_COS, 1.0 - MIN_COS);
    let exponent =
        if cosine < 0.5 { curve(cosine, alpha) } else { 2.0 * curve(0.5, alpha) - curve(1.0 - cosine, alpha) };
    exponent.exp()
}

/// BRDF of a white sheen, 1/sr, as `KHR_materials_sheen` has it.
pub fn sheen_brdf(n: DVec3, v: DVec3, l: DVec3, roughness: f64) -> f64 {
    let (alpha, nl, nv) = (roughness * roughness, n.dot(l).max(MIN_COS), n.dot(v).max(MIN_COS));
    let visibility = 1.0 / ((1.0 + sheen_lambda(nv, alpha) + sheen_lambda(nl, alpha)) * 4.0 * nl * nv);
    d_charlie(n, v + l, alpha) * visibility
}

/// The share of even light that a white sheen scatters, seen at this cosine: a polynomial's exponential, fitted by least squares for
/// roughnesses from [`MIN_SHEEN_ROUGHNESS`] to 1.
pub fn sheen_albedo(nv: f64, roughness: f64) -> f64 {
    const FIT: [[f64; 4]; 4] = [
        [1.163, -6.612, 10.185, -4.787],
        [-15.96, 47.943, -60.737, 25.91],
        [16.237, -52.29, 68.847, -30.245],
        [-15.128, 45.438, -53.416, 21.619],
    ];
    let polynomial = |factors: [f64; 4], x: f64| factors.into_iter().rev().fold(0.0, |sum, factor| sum * x + factor);
    polynomial(FIT.map(|row| polynomial(row, roughness)), nv).exp().min(1.0)
}

/// The mean of [`sheen_albedo`] under the cosine.
pub fn sheen_mean_albedo(roughness: f64) -> f64 {
    0.0314 + roughness * (-0.0752 + roughness * (0.8508 - 0.5066 * roughness))
}

/// The share of its light that what is below keeps, of the layer's albedo: the same paper, section 5.
pub fn under_sheen(sheen: DVec3, albedo: f64) -> f64 {
    1.0 - sheen.max_element() * albedo
}

/// The mean direction that the layer scatters light from: on the viewer's side, farther from the normal the smoother it is. Fitted to
/// within 8 degrees.
pub fn sheen_towards(n: DVec3, v: DVec3, nv: f64, roughness: f64) -> DVec3 {
    (n + (v - nv * n) / ((0.55 + 6.4 * roughness * roughness) * (1.0 - 0.9 * nv))).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::quadrature::gauss_legendre;

    const ROUGHNESSES: [f64; 5] = [0.2, 0.35, 0.5, 0.75, 1.0];

    /// The integral of BRDF times cosine, and of the direction with that weight.
    fn moments(nv: f64, roughness: f64) -> (f64, DVec3) {
        let v = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
        let turns = 240;
        let mut sum = (0.0, DVec3::ZERO);
        for [z, weight] in gauss_legendre(240) {
            let across = (1.0 - z * z).sqrt();
            for turn in 0..turns {
                let angle = (f64::from(turn) + 0.5) / f64::from(turns) * PI;
                let l = DVec3::new(across * angle.cos(), across * angle.sin(), z);
                let value = sheen_brdf(DVec3::Z, v, l, roughness) * z * weight * 2.0 * PI / f64::from(turns);
                sum.0 += value;
                // The other half of the sphere is its image.
                sum.1 += value * DVec3::new(l.x, 0.0, l.z);
            }
        }
        (sum.0, sum.1 / sum.0)
    }

    #[test]
    fn albedo_and_mean_are_those_of_the_integral() {
        for roughness in ROUGHNESSES {
            let mut mean = 0.0;
            for [nv, weight] in gauss_legendre(24) {
                let (albedo, _) = moments(nv, roughness);
                let fitted = sheen_albedo(nv, roughness);
                // Seen that flat, little of it is seen.
                let bound = if nv < 0.01 { 0.05 } else { 0.02 };
                assert!((fitted - albedo.min(1.0)).abs() < bound, "{roughness} {nv}: {fitted} for {albedo}");
                mean += 2.0 * nv * weight * albedo.min(1.0);
            }
            let fitted = sheen_mean_albedo(roughness);
            assert!((fitted - mean).abs() < 0.003, "{roughness}: {fitted} for {mean}");
        }
    }

    #[test]
    fn light_is_scattered_back_towards_where_it_is_seen_from() {
        for roughness in ROUGHNESSES {
            for nv in [0.1, 0.3, 0.5, 0.8] {
                let (_, mean) = moments(nv, roughness);
                let v = DVec3::new(f64::sqrt(1.0 - nv * nv), 0.0, nv);
                let off = sheen_towards(DVec3::Z, v, nv, roughness).angle_between(mean).to_degrees();
                assert!(off < 8.0, "{roughness} {nv}: {off} degrees");
            }
        }
    }

    /// It is as bright seen from either end.
    #[test]
    fn it_is_reciprocal() {
        let [a, b] = [DVec3::new(0.3, 0.2, 0.4).normalize(), DVec3::new(-0.9, 0.1, 0.2).normalize()];
        for roughness in ROUGHNESSES {
            let [there, back] = [sheen_brdf(DVec3::Z, a, b, roughness), sheen_brdf(DVec3::Z, b, a, roughness)];
            assert!(there > 0.0 && (there / back - 1.0).abs() < 1e-12);
        }
    }
}
