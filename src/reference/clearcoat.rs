//! A clear coat over a surface, in f64: what it adds, and what it leaves of the light of what is below.

use glam::DVec3;

use super::brdf::{Geometry, d_ggx, f_schlick, v_environment};
use super::energy::{Curve, Energy, Scattering};

/// Reflectance at normal incidence, of an index of refraction of 1.5 (`KHR_materials_clearcoat`).
pub const CLEARCOAT_F0: f64 = 0.04;

/// A coat of one roughness.
pub struct Clearcoat {
    /// The share of the surface that has it.
    pub factor: f64,
    pub roughness: f64,
    energy: Energy,
    curve: Curve,
}

impl Clearcoat {
    /// Over this share of a surface, with a roughness in [0, 1].
    pub fn new(factor: f64, roughness: f64, scattering: Scattering) -> Self {
        let energy = Energy::new(roughness, Geometry::Smith, scattering);
        Self { factor, roughness, energy, curve: Curve::new(roughness, Geometry::Smith) }
    }

    /// The share of its light that the base keeps, seen at this cosine to the coat's normal: what the coat does not reflect of light
    /// from all sides. Albedo scaling: Kulla and Conty (2017).
    pub fn left(&self, nv: f64) -> f64 {
        1.0 - self.factor * self.energy.specular_albedo(DVec3::splat(CLEARCOAT_F0), self.curve.at(nv)).x
    }

    /// The coat's BRDF in 1/sr, times n·l; `n`: the coat's normal. For light from all around, with no least roughness.
    pub fn scattered(&self, n: DVec3, v: DVec3, l: DVec3) -> f64 {
        let (nl, nv, h, f0) = (n.dot(l), n.dot(v), v + l, DVec3::splat(CLEARCOAT_F0));
        if nl <= 0.0 {
            return 0.0;
        }
        let d = d_ggx(n, h, self.roughness * self.roughness);
        let single = f_schlick(f0, 0.5 * h.length()).x * d * v_environment(nl, nv, self.roughness, Geometry::Smith);
        let share = self.energy.multiple_share(f0);
        self.factor * nl * (single + self.energy.multiple(share, self.curve.at(nl), self.curve.at(nv)).x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::quadrature::gauss_legendre;
    use std::f64::consts::PI;

    /// Over a white base that loses nothing, a coat of any roughness reflects all of even light.
    #[test]
    fn what_the_coat_reflects_is_what_the_base_loses() {
        let (nodes, turns) = (gauss_legendre(200), 400);
        for (roughness, nv) in [(0.4, 0.9), (0.4, 0.2), (1.0, 0.5)] {
            let coat = Clearcoat::new(0.7, roughness, Scattering::Multiple);
            let v = DVec3::new(f64::sqrt(1.0 - nv * nv), 0.0, nv);
            let ring = |z: f64| {
                let s = (1.0 - z * z).sqrt();
                let at = |i| (f64::from(i) + 0.5) / f64::from(turns) * 2.0 * PI;
                let l = |i| DVec3::new(s * f64::cos(at(i)), s * f64::sin(at(i)), z);
                (0..turns).map(|i| coat.scattered(DVec3::Z, v, l(i))).sum::<f64>() * 2.0 * PI / f64::from(turns)
            };
            let reflected: f64 = nodes.iter().map(|[z, weight]| weight * ring(*z)).sum();
            let all = reflected + coat.left(nv);
            assert!((all - 1.0).abs() < 2e-4, "roughness {roughness}, n.v {nv}: {all}");
        }
    }
}
