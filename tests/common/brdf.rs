//! The BRDF of grey materials in f64, for light that tests compute by themselves.

use std::f64::consts::TAU;

use glam::DVec3;
use pbr_vr::reference::brdf::{DIELECTRIC_F0, Geometry, f0_from_metallic, specular};
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::reference::quadrature::gauss_legendre;
use pbr_vr::scene::Material;

/// The BRDF of a grey material in f64.
pub struct Brdf {
    base_color: DVec3,
    metallic: f64,
    roughness: f64,
    energy: Energy,
    curve: Curve,
}

impl Brdf {
    pub fn new(material: &Material) -> Self {
        let roughness = f64::from(material.roughness_factor);
        Self {
            base_color: material.base_color_factor.as_dvec3(),
            metallic: material.metallic_factor.into(),
            roughness,
            energy: Energy::new(roughness, Geometry::Smith, Scattering::Multiple),
            curve: Curve::new(roughness, Geometry::Smith),
        }
    }

    /// For directions above a surface whose normal is +Z, in 1/sr.
    pub fn value(&self, l: DVec3, v: DVec3) -> f64 {
        let f0 = f0_from_metallic(self.base_color, self.metallic, DIELECTRIC_F0);
        let single = specular(DVec3::Z, v, l, f0, self.roughness, Geometry::Smith);
        let [at_l, at_v] = [l, v].map(|d| self.curve.at(d.z));
        (single + self.energy.beyond_single(self.base_color, self.metallic, at_l, at_v)).x
    }

    /// The same in world space.
    pub fn at(&self, n: DVec3, l: DVec3, v: DVec3) -> f64 {
        let (t, b) = (n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector()));
        let local = |d: DVec3| DVec3::new(d.dot(t), d.dot(b), d.dot(n));
        self.value(local(l), local(v))
    }

    /// The sum over all longitudes of light that comes at a cosine, for light that leaves at another.
    pub fn around(&self, from: f64, to: f64) -> f64 {
        const AROUND: u32 = 128;
        let v = slanted(to, 0.0);
        let at = |k: u32| self.value(slanted(from, (f64::from(k) + 0.5) / f64::from(AROUND) * TAU), v);
        (0..AROUND).map(at).sum::<f64>() * TAU / f64::from(AROUND)
    }

    /// The part of light from all sides that is given back.
    pub fn even_albedo(&self) -> f64 {
        let nodes = gauss_legendre(32);
        let from = |[l, of_l]: &[f64; 2]| {
            nodes.iter().map(|[v, of_v]| 2.0 * l * of_l * v * of_v * self.around(*l, *v)).sum::<f64>()
        };
        nodes.iter().map(from).sum()
    }
}

/// A unit vector by its z and its longitude.
pub fn slanted(cosine: f64, longitude: f64) -> DVec3 {
    let across = (1.0 - cosine * cosine).sqrt();
    DVec3::new(across * longitude.cos(), across * longitude.sin(), cosine)
}
