//! What microfacets that shadow each other give back by second and later bounces, and a diffuse part that takes what the
//! specular part leaves: in f64, for light of any direction.
//!
//! Of three ways this is Kulla and Conty's, because it is reciprocal and keeps the energy exactly: Turquin's scaled lobe keeps
//! the energy too, but is not the same with light and eye exchanged; Fdez-Agüera's works for the environment alone.

use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use super::brdf::{DIELECTRIC_F0, Geometry};
use super::quadrature::gauss_legendre;
use super::table::{Entry, table_entry};

/// Share of the incoming light that must be at stake for multiple scattering to be modelled: half a step of an 8-bit sRGB
/// picture at white, 1 − (254/255)^2.2 = 0.9 %.
pub const VISIBLE: f64 = 0.0045;

/// Nodes over a cosine; E is smooth but for n·v → 0, which weighs nothing.
const NODES: usize = 24;

/// The terms at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct Energy {
    /// The table's entry averaged over directions, 2 ∫ E(μ) μ dμ.
    pub mean: Entry,
}

impl Energy {
    /// For a roughness in [0, 1].
    pub fn new(roughness: f64, geometry: Geometry) -> Self {
        let mut mean = Entry { scale: 0.0, bias: 0.0 };
        for [cosine, weight] in gauss_legendre(NODES) {
            let entry = table_entry(cosine, roughness, geometry);
            mean.scale += 2.0 * weight * cosine * entry.scale;
            mean.bias += 2.0 * weight * cosine * entry.bias;
        }
        Self { mean }
    }

    /// What the lost light is multiplied by before it comes back. Kulla and Conty, "Revisiting Physically Based Shading at
    /// Imageworks" (2017), section on Fresnel: Σ Favg (Favg (1 − Eavg))ⁿ Favg Eavg over bounces n, with Schlick's mean
    /// F0 + (1 − F0) / 21.
    pub fn multiple_share(&self, f0: DVec3) -> DVec3 {
        let mean = single(DVec3::ONE, self.mean);
        let f = f0 + (DVec3::ONE - f0) / 21.0;
        f * f * mean / (DVec3::ONE - f * (DVec3::ONE - mean))
    }

    /// The multiple-scattering lobe as a BRDF in 1/sr for the table's entries at n·l and n·v: Kulla and Conty (2017).
    pub fn multiple(&self, f0: DVec3, at_l: Entry, at_v: Entry) -> DVec3 {
        let [lost_l, lost_v, lost] = [at_l, at_v, self.mean].map(|e| 1.0 - single(DVec3::ONE, e).x);
        self.multiple_share(f0) * (lost_l * lost_v * FRAC_1_PI / lost.max(1e-9))
    }

    /// Share of light from all sides that single and multiple scattering send towards v.
    pub fn specular_albedo(&self, f0: DVec3, at_v: Entry) -> DVec3 {
        single(f0, at_v) + (DVec3::ONE - single(DVec3::ONE, at_v)) * self.multiple_share(f0)
    }

    /// The diffuse part as a BRDF in 1/sr: of what the dielectric's specular part leaves at both ends. Kelemen and
    /// Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling" (2001), eq. 6.
    pub fn diffuse(&self, albedo: DVec3, at_l: Entry, at_v: Entry) -> DVec3 {
        let f0 = DVec3::splat(DIELECTRIC_F0);
        let left = |e: Entry| DVec3::ONE - self.specular_albedo(f0, e);
        albedo * left(at_l) * left(at_v) * FRAC_1_PI / left(self.mean).max(DVec3::splat(1e-9))
    }

    /// All that is not single scattering, in 1/sr: a dielectric's and a metal's, mixed.
    pub fn beyond_single(&self, albedo: DVec3, metallic: f64, at_l: Entry, at_v: Entry) -> DVec3 {
        let dielectric = self.diffuse(albedo, at_l, at_v) + self.multiple(DVec3::splat(DIELECTRIC_F0), at_l, at_v);
        dielectric.lerp(self.multiple(albedo, at_l, at_v), metallic)
    }
}

/// Single scattering's share: F0 A + B.
fn single(f0: DVec3, entry: Entry) -> DVec3 {
    f0 * entry.scale + DVec3::splat(entry.bias)
}

/// Whether multiple scattering changes what a material with at most this roughness, metalness and largest albedo reflects
/// under even light by more than [`VISIBLE`] of that light, seen from anywhere.
pub fn is_multi_scatter_visible(roughness: f64, metallic: f64, albedo: f64) -> bool {
    let energy = Energy::new(roughness.clamp(0.0, 1.0), Geometry::Smith);
    let share = |f0: f64| energy.multiple_share(DVec3::splat(f0)).x;
    // A dielectric's diffuse part loses what its specular part gains, times the albedo: at most all of it stays.
    let mixed = (1.0 - metallic) * share(DIELECTRIC_F0) + metallic * share(albedo);
    let lost = |nv: f64| 1.0 - single(DVec3::ONE, table_entry(nv, roughness.clamp(0.0, 1.0), Geometry::Smith)).x;
    [0.05, 0.2, 0.4, 0.7, 1.0].into_iter().any(|nv| lost(nv) * mixed > VISIBLE)
}

/// Share of even light from all sides that a surface sends towards v, all terms integrated over the light's directions: what a
/// white furnace shows.
pub fn furnace(albedo: DVec3, metallic: f64, roughness: f64, nv: f64, geometry: Geometry) -> DVec3 {
    let energy = Energy::new(roughness, geometry);
    let at_v = table_entry(nv, roughness, geometry);
    let f0 = DVec3::splat(DIELECTRIC_F0).lerp(albedo, metallic);
    let mut sum = single(f0, at_v);
    // Other nodes than those of the mean: with the same the sum would be 1 whatever the terms are.
    for [nl, weight] in gauss_legendre(37) {
        let at_l = table_entry(nl, roughness, geometry);
        sum += energy.beyond_single(albedo, metallic, at_l, at_v) * (2.0 * PI * weight * nl);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::brdf::schlick_weight;
    use rayon::prelude::*;

    const ROUGHNESSES: usize = 21;

    /// Entries at Gauss's nodes for one roughness, so that each is computed once.
    struct Row {
        energy: Energy,
        nodes: Vec<([f64; 2], Entry)>,
        views: Vec<(f64, Entry)>,
    }

    fn row(i: usize) -> Row {
        let roughness = i as f64 / (ROUGHNESSES - 1) as f64;
        let at = |c: f64| table_entry(c, roughness, Geometry::Smith);
        Row {
            energy: Energy::new(roughness, Geometry::Smith),
            // Other nodes than those of the mean: with the same the sum would be 1 whatever the terms are.
            nodes: gauss_legendre(37).into_iter().map(|n| (n, at(n[0]))).collect(),
            views: (1..=16).map(|k| f64::from(k) / 16.0).map(|nv| (nv, at(nv))).collect(),
        }
    }

    fn integral(row: &Row, f: impl Fn(f64, Entry) -> f64) -> f64 {
        row.nodes.iter().map(|([nl, weight], at_l)| f(*nl, *at_l) * 2.0 * PI * weight * nl).sum()
    }

    /// failures.md row 20, over 21 × 11 × 16 roughnesses, metalnesses and views; and what single scattering loses.
    #[test]
    fn a_white_furnace_hides_every_white_surface() {
        let rows: Vec<Row> = (0..ROUGHNESSES).into_par_iter().map(row).collect();
        let (mut worst, mut most, mut least_single) = (0.0f64, 0.0f64, 1.0f64);
        for row in &rows {
            for &(nv, at_v) in &row.views {
                for m in 0..=10 {
                    let metallic = f64::from(m) / 10.0;
                    let f0 = DIELECTRIC_F0 + (1.0 - DIELECTRIC_F0) * metallic;
                    let specular = f0 * at_v.scale + at_v.bias;
                    let more = |_, at_l| row.energy.beyond_single(DVec3::ONE, metallic, at_l, at_v).x;
                    let ours = specular + integral(row, more);
                    worst = worst.max((ours - 1.0).abs());
                    most = most.max(ours);
                    let shirley = |nl, _| {
                        let through = (1.0 - schlick_weight(nl)) * (1.0 - schlick_weight(nv));
                        (1.0 - metallic) * (1.0 - f0) * 1.05 * FRAC_1_PI * through
                    };
                    least_single = least_single.min(specular + integral(row, shirley));
                }
            }
        }
        println!("furnace: off by {worst:.1e} at most, up to {most:.7}; single scattering down to {least_single:.3}");
        assert!(worst < 0.005 && most < 1.005, "off by {worst}, up to {most}");
        assert!(least_single < 0.5, "single scattering no longer loses light: {least_single}");
    }

    #[test]
    fn the_terms_are_reciprocal_and_scaling_the_lobe_is_not() {
        let energy = Energy::new(1.0, Geometry::Smith);
        let [a, b] = [0.2, 0.9].map(|c| table_entry(c, 1.0, Geometry::Smith));
        let albedo = DVec3::new(0.9, 0.5, 0.1);
        let there = energy.beyond_single(albedo, 0.5, a, b);
        assert!(there.abs_diff_eq(energy.beyond_single(albedo, 0.5, b, a), 1e-12));
        // Turquin, "Practical multiple scattering compensation for microfacet models" (2019): the lobe over E(v).
        let [scaled_a, scaled_b] = [a, b].map(|e| 1.0 / (e.scale + e.bias));
        assert!((scaled_a / scaled_b - 1.0).abs() > 0.05, "{scaled_a} and {scaled_b}");
    }

    #[test]
    fn nothing_is_added_to_what_is_smooth_or_black() {
        let smooth = Energy::new(0.0, Geometry::Smith);
        let at = table_entry(0.5, 0.0, Geometry::Smith);
        assert!(smooth.multiple(DVec3::ONE, at, at).x < 1e-6);
        let rough = Energy::new(1.0, Geometry::Smith);
        assert!(rough.multiple_share(DVec3::ZERO).x < 0.01);
        assert!((rough.multiple_share(DVec3::ONE).x - 1.0).abs() < 1e-12);
    }

    #[test]
    fn multiple_scattering_is_visible_on_metals_that_are_not_smooth() {
        for (roughness, metallic, albedo, want) in
            [(1.0, 1.0, 0.9, true), (0.5, 1.0, 0.9, true), (0.02, 1.0, 1.0, false), (1.0, 0.0, 0.8, false)]
        {
            let got = is_multi_scatter_visible(roughness, metallic, albedo);
            assert_eq!(got, want, "roughness {roughness}, metallic {metallic}, albedo {albedo}");
        }
    }

    #[test]
    fn the_furnace_s_number_is_that_of_its_terms() {
        for (metallic, roughness, nv) in [(0.0, 0.5, 0.3), (1.0, 1.0, 0.9), (0.5, 0.7, 0.6)] {
            let share = furnace(DVec3::ONE, metallic, roughness, nv, Geometry::Smith);
            assert!(share.abs_diff_eq(DVec3::ONE, 0.005), "{share}");
            assert!(furnace(DVec3::splat(0.5), metallic, roughness, nv, Geometry::Smith).x < 0.75);
        }
    }
}
