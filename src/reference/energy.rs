//! Multiple scattering between microfacets, and an energy-conserving diffuse part, in f64, for light of any direction.
//! The method is Kulla and Conty's, because it is reciprocal and conserves energy exactly. Turquin's scaled lobe
//! conserves energy, too, but is not reciprocal; Fdez-Agüera's method works for the environment only.

use std::f64::consts::{FRAC_1_PI, PI};

use clap::ValueEnum;
use glam::DVec3;
use rayon::prelude::*;

use super::brdf::{DIELECTRIC_F0, Fresnel, Geometry};
use super::quadrature::gauss_legendre;
use super::table::{Entry, coarse_table_entry, table_arguments, table_entry, table_place};

/// Share of the incoming light from which on multiple scattering counts as visible: half a step of an 8-bit sRGB
/// picture at white, 1 − (254/255)^2.2 = 0.9 %.
pub const VISIBLE: f64 = 0.0045;

/// Smallest divisor: below, the lobe is 0 / 0.
const LEAST_LOST: f64 = 1e-6;

/// Nodes over a cosine; E is smooth except for n·v → 0, which has no weight.
const NODES: usize = 24;

/// Scattering between the microfacets of a surface; ignored with `Geometry::Karis2013`, which is always single.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Scattering {
    /// Single: rough metals lose up to 69 % of the light.
    Single,
    /// Multiple, where that is visible: no light is lost.
    #[default]
    Multiple,
}

/// The terms for one roughness.
#[derive(Clone, Copy, Debug)]
pub struct Energy {
    /// The table's entry averaged over directions, 2 ∫ E(μ) μ dμ.
    pub mean: Entry,
    /// What the surface's dielectric part reflects.
    pub dielectric: Fresnel,
    pub scattering: Scattering,
}

impl Energy {
    /// For a roughness in [0, 1], and an index of refraction of 1.5.
    pub fn new(roughness: f64, geometry: Geometry, scattering: Scattering) -> Self {
        let mean = mean(NODES, |cosine| table_entry(cosine, roughness, geometry));
        Self { mean, dielectric: Fresnel::dielectric(DIELECTRIC_F0), scattering }
    }

    /// Factor of the light that single scattering loses: Kulla and Conty, "Revisiting Physically Based Shading
    /// at Imageworks" (2017), section on Fresnel: Σ Favg (Favg (1 − Eavg))ⁿ Favg Eavg over bounces n, with Schlick's
    /// mean F0 + (F90 − F0) / 21. 0 with single scattering.
    pub fn multiple_share(&self, fresnel: impl Into<Fresnel>) -> DVec3 {
        if self.scattering == Scattering::Single {
            return DVec3::ZERO;
        }
        let mean = single(DVec3::ONE, self.mean);
        let f = fresnel.into().mean();
        f * f * mean / (DVec3::ONE - f * (DVec3::ONE - mean))
    }

    /// The same for a mix of dielectric and metal.
    pub fn mixed_share(&self, base_color: DVec3, metallic: f64) -> DVec3 {
        self.multiple_share(self.dielectric).lerp(self.multiple_share(base_color), metallic)
    }

    /// Multiple scattering as a BRDF in 1/sr for a share and the table's entries at n·l and n·v: Kulla and Conty
    /// (2017).
    pub fn multiple(&self, share: DVec3, at_l: Entry, at_v: Entry) -> DVec3 {
        let [lost_l, lost_v, lost] = [at_l, at_v, self.mean].map(lost);
        share * (lost_l * lost_v * FRAC_1_PI / lost.max(LEAST_LOST))
    }

    /// Directional albedo of single and multiple scattering.
    pub fn specular_albedo(&self, fresnel: impl Into<Fresnel>, at_v: Entry) -> DVec3 {
        let fresnel = fresnel.into();
        single(fresnel, at_v) + lost(at_v) * self.multiple_share(fresnel)
    }

    /// What the dielectric's specular part leaves, the same of all colours: of the one that it reflects most
    /// (KHR_materials_specular).
    pub fn left_by_dielectric(&self, entry: Entry) -> f64 {
        1.0 - self.specular_albedo(self.dielectric, entry).max_element()
    }

    /// The diffuse part as a BRDF in 1/sr, from what the dielectric's specular part does not reflect towards l and v:
    /// Kelemen and Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling"
    /// (2001), eq. 6.
    pub fn diffuse(&self, albedo: DVec3, at_l: Entry, at_v: Entry) -> DVec3 {
        let [at_l, at_v, mean] = [at_l, at_v, self.mean].map(|entry| self.left_by_dielectric(entry));
        albedo * (at_l * at_v * FRAC_1_PI / mean.max(LEAST_LOST))
    }

    /// Light that diffuses through a sheet, in 1/sr; multiply by |n·l| and by the irradiance on the side that is not seen. Of what the
    /// dielectric's specular part leaves towards the eye, `share` takes this way instead of being reflected, and is multiplied by
    /// `color`: KHR_materials_diffuse_transmission. Reflected is then (1 − `share`) of the base color.
    pub fn diffuse_transmission(&self, share: f64, color: DVec3, metallic: f64, at_v: Entry) -> DVec3 {
        color * (share * (1.0 - metallic) * self.left_by_dielectric(at_v) * FRAC_1_PI)
    }

    /// Diffuse reflection and multiple scattering, in 1/sr.
    pub fn beyond_single(&self, base_color: DVec3, metallic: f64, at_l: Entry, at_v: Entry) -> DVec3 {
        (1.0 - metallic) * self.diffuse(base_color, at_l, at_v)
            + self.multiple(self.mixed_share(base_color, metallic), at_l, at_v)
    }

    /// Diffuse albedo under uniform light: the integral over l, with n·l.
    pub fn diffuse_even(&self, base_color: DVec3, metallic: f64, at_v: Entry) -> DVec3 {
        (1.0 - metallic) * base_color * self.left_by_dielectric(at_v)
    }

    /// Albedo of multiple scattering under uniform light.
    pub fn multiple_even(&self, base_color: DVec3, metallic: f64, at_v: Entry) -> DVec3 {
        lost(at_v) * self.mixed_share(base_color, metallic)
    }
}

/// What the diffuse part takes of light from all around, over what it takes of the same irradiance of even light, by how much of
/// that light is [grazing](super::integrals::grazing): 1 − t (grazing − 1), t being 1/20 for smooth surfaces, where it is exact,
/// and less for rough ones. Twin: `diffuse_taken` in `glsl/energy.glsl`.
pub fn diffuse_taken(roughness: f64, grazing: f64) -> f64 {
    (1.0 - (grazing - 1.0) / (20.0 + 460.0 * roughness.powi(3))).max(0.0)
}

/// The same for multiple scattering, 1 + u (grazing − 1): smooth metals lose light at grazing angles alone, the roughest least
/// there. Twin: `multiple_taken` in `glsl/energy.glsl`.
pub fn multiple_taken(roughness: f64, grazing: f64) -> f64 {
    (1.0 + (grazing - 1.0) * (0.047 / (roughness * roughness) - 0.157).clamp(-0.065, 1.0)).max(0.0)
}

/// 2 ∫ E(μ) μ dμ.
fn mean(nodes: usize, entry: impl Fn(f64) -> Entry) -> Entry {
    let mut mean = Entry { scale: 0.0, bias: 0.0 };
    for [cosine, weight] in gauss_legendre(nodes) {
        let Entry { scale, bias } = entry(cosine);
        mean.scale += 2.0 * weight * cosine * scale;
        mean.bias += 2.0 * weight * cosine * bias;
    }
    mean
}

/// The table's entries for one roughness as an interpolated function of the cosine: for sums over many directions.
pub struct Curve(Vec<Entry>);

impl Curve {
    /// Finer than `precompute::BrdfTable`: accurate to 1e-4.
    const COUNT: u32 = 129;

    /// For a roughness in [0, 1].
    pub fn new(roughness: f64, geometry: Geometry) -> Self {
        let cosine = |i: u32| table_arguments([i, 0], [Self::COUNT, 2])[0];
        Self((0..Self::COUNT).into_par_iter().map(|i| table_entry(cosine(i), roughness, geometry)).collect())
    }

    /// The entry at a cosine in [0, 1].
    pub fn at(&self, cosine: f64) -> Entry {
        let place = table_place(cosine.clamp(0.0, 1.0), 0.0)[0] * f64::from(Self::COUNT - 1);
        let first = (place as usize).min(Self::COUNT as usize - 2);
        let (a, b, share) = (self.0[first], self.0[first + 1], place - first as f64);
        Entry { scale: a.scale + share * (b.scale - a.scale), bias: a.bias + share * (b.bias - a.bias) }
    }
}

/// Albedo of single scattering: F0 A + F90 B.
fn single(fresnel: impl Into<Fresnel>, entry: Entry) -> DVec3 {
    let Fresnel { f0, f90 } = fresnel.into();
    f0 * entry.scale + DVec3::splat(f90 * entry.bias)
}

/// The share that single scattering loses for F = 1: 1 − E.
fn lost(entry: Entry) -> f64 {
    (1.0 - entry.scale - entry.bias).max(0.0)
}

/// Whether multiple scattering changes the reflection of uniform light by more than [`VISIBLE`] of it, from any
/// direction, for a material with at most this roughness, metalness and base color, and this F0 of its dielectric part.
pub fn is_multi_scatter_visible(roughness: f64, metallic: f64, base_color: f64, dielectric_f0: f64) -> bool {
    // The usual dielectric reflects too little at any roughness: F² is 0.7 %, of which half is not lost.
    if metallic <= 0.0 && dielectric_f0 <= DIELECTRIC_F0 {
        return false;
    }
    most_changed(roughness.clamp(0.0, 1.0), metallic, base_color, dielectric_f0) > VISIBLE
}

/// Largest share of uniform light that multiple scattering adds, over all directions. The loss of a dielectric's
/// diffuse part, which is at most as large, is neglected.
fn most_changed(roughness: f64, metallic: f64, base_color: f64, dielectric_f0: f64) -> f64 {
    let entry = |cosine| coarse_table_entry(cosine, roughness, Geometry::Smith);
    let dielectric = Fresnel::dielectric(dielectric_f0);
    let energy = Energy { mean: mean(NODES / 3, entry), dielectric, scattering: Scattering::Multiple };
    let share = energy.mixed_share(DVec3::splat(base_color), metallic).x;
    let lost = [0.05, 0.2, 0.4, 0.7, 1.0].map(|nv| lost(entry(nv)));
    share * lost.into_iter().fold(0.0, f64::max)
}

/// White furnace: the share of uniform light that a surface reflects towards v, all terms integrated over the light's
/// directions. With height-correlated Smith.
pub fn furnace(base_color: DVec3, metallic: f64, roughness: f64, nv: f64, scattering: Scattering) -> DVec3 {
    let geometry = Geometry::Smith;
    let energy = Energy::new(roughness, geometry, scattering);
    let at_v = table_entry(nv, roughness, geometry);
    let f0 = DVec3::splat(DIELECTRIC_F0).lerp(base_color, metallic);
    let mut sum = single(f0, at_v);
    // Other nodes than those of the mean: with the same ones the sum would be 1 for any terms.
    for [nl, weight] in gauss_legendre(37) {
        let at_l = table_entry(nl, roughness, geometry);
        sum += energy.beyond_single(base_color, metallic, at_l, at_v) * (2.0 * PI * weight * nl);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUGHNESSES: usize = 21;

    /// Entries at the quadrature nodes for one roughness, each computed once.
    struct Row {
        energy: Energy,
        single: Energy,
        nodes: Vec<([f64; 2], Entry)>,
        views: Vec<(f64, Entry)>,
    }

    fn row(i: usize) -> Row {
        let roughness = i as f64 / (ROUGHNESSES - 1) as f64;
        let at = |c: f64| table_entry(c, roughness, Geometry::Smith);
        let energy = Energy::new(roughness, Geometry::Smith, Scattering::Multiple);
        Row {
            energy,
            single: Energy { scattering: Scattering::Single, ..energy },
            // Other nodes than those of the mean: with the same ones the sum would be 1 for any terms.
            nodes: gauss_legendre(37).into_iter().map(|n| (n, at(n[0]))).collect(),
            views: (1..=16).map(|k| f64::from(k) / 16.0).map(|nv| (nv, at(nv))).collect(),
        }
    }

    fn integral(row: &Row, f: impl Fn(f64, Entry) -> f64) -> f64 {
        row.nodes.iter().map(|([nl, weight], at_l)| f(*nl, *at_l) * 2.0 * PI * weight * nl).sum()
    }

    /// Case 20 of tests/gpu/stability.rs, over 21 × 11 × 16 roughnesses, metalnesses and views; and what single scattering
    /// loses.
    #[test]
    fn white_surfaces_pass_the_white_furnace_test() {
        let rows: Vec<Row> = (0..ROUGHNESSES).into_par_iter().map(row).collect();
        let (mut worst, mut most, mut least_single) = (0.0f64, 0.0f64, 1.0f64);
        for row in &rows {
            for &(_, at_v) in &row.views {
                for m in 0..=10 {
                    let metallic = f64::from(m) / 10.0;
                    let f0 = DIELECTRIC_F0 + (1.0 - DIELECTRIC_F0) * metallic;
                    let specular = f0 * at_v.scale + at_v.bias;
                    let more = |_, at_l| row.energy.beyond_single(DVec3::ONE, metallic, at_l, at_v).x;
                    let ours = specular + integral(row, more);
                    worst = worst.max((ours - 1.0).abs());
                    most = most.max(ours);
                    let single = |_, at_l| row.single.beyond_single(DVec3::ONE, metallic, at_l, at_v).x;
                    least_single = least_single.min(specular + integral(row, single));
                }
            }
        }
        println!("furnace: off by {worst:.1e} at most, up to {most:.7}; single scattering down to {least_single:.3}");
        assert!(worst < 0.005 && most < 1.005, "off by {worst}, up to {most}");
        assert!(least_single < 0.5, "single scattering no longer loses light: {least_single}");
    }

    #[test]
    fn terms_for_uniform_light_equal_their_integrals() {
        for i in [3, 12, 20] {
            let Row { energy, nodes, views, .. } = &row(i);
            let base_color = DVec3::new(0.9, 0.5, 0.1);
            for (nv, at_v) in views {
                let sum = nodes.iter().fold(DVec3::ZERO, |sum, ([nl, weight], at_l)| {
                    sum + energy.beyond_single(base_color, 0.3, *at_l, *at_v) * (2.0 * PI * weight * nl)
                });
                let even = energy.diffuse_even(base_color, 0.3, *at_v) + energy.multiple_even(base_color, 0.3, *at_v);
                assert!(sum.abs_diff_eq(even, 1e-3), "{sum} and {even} at n·v {nv}");
            }
        }
    }

    /// What a term takes from a direction, over its mean, less 1, as a multiple of Schlick's term less its mean: the best factor by
    /// least squares under the cosine, and roots of the mean square that `factor` and no factor leave.
    fn fit(row: &Row, factor: f64, taken: impl Fn(Entry) -> f64) -> [f64; 3] {
        let schlick = |nl: f64| 21.0 * (1.0 - nl).powi(5) - 1.0;
        let product = integral(row, |nl, at_l| taken(at_l) * schlick(nl));
        let left = |factor: f64| (integral(row, |nl, at_l| (taken(at_l) - factor * schlick(nl)).powi(2)) / PI).sqrt();
        [product / integral(row, |nl, _| schlick(nl).powi(2)), left(factor), left(0.0)]
    }

    #[test]
    fn what_terms_take_of_grazing_light_is_fitted_to_what_they_are() {
        for i in 0..ROUGHNESSES {
            let row = row(i);
            let roughness = i as f64 / (ROUGHNESSES - 1) as f64;
            let left = |entry| 1.0 - row.energy.specular_albedo(DVec3::splat(DIELECTRIC_F0), entry).x;
            let ours = diffuse_taken(roughness, 2.0) - 1.0;
            let [best, rest, all] = fit(&row, ours, |at_l| left(at_l) / left(row.energy.mean) - 1.0);
            println!("roughness {roughness:.2}: diffuse {ours:.4}, best {best:.4}, {rest:.4} of {all:.4} left");
            assert!(
                (ours - best).abs() < 0.002 && rest < 0.016 && rest < 0.5 * all,
                "diffuse at roughness {roughness}"
            );
            let lost_mean = lost(row.energy.mean);
            if lost_mean < 0.01 {
                continue; // hardly any is scattered more than once
            }
            let ours = multiple_taken(roughness, 2.0) - 1.0;
            let [best, rest, all] = fit(&row, ours, |at_l| lost(at_l) / lost_mean - 1.0);
            println!("    of {lost_mean:.3} multiple {ours:.3}, best {best:.3}, {rest:.3} of {all:.3} left");
            assert!((ours - best).abs() * lost_mean < 0.005 && rest < 1.05 * all, "multiple at roughness {roughness}");
        }
    }

    #[test]
    fn the_terms_are_reciprocal_and_scaling_the_lobe_is_not() {
        let energy = Energy::new(1.0, Geometry::Smith, Scattering::Multiple);
        let [a, b] = [0.2, 0.9].map(|c| table_entry(c, 1.0, Geometry::Smith));
        let base_color = DVec3::new(0.9, 0.5, 0.1);
        let there = energy.beyond_single(base_color, 0.5, a, b);
        assert!(there.abs_diff_eq(energy.beyond_single(base_color, 0.5, b, a), 1e-12));
        // Turquin, "Practical multiple scattering compensation for microfacet models" (2019): the lobe over E(v).
        let [scaled_a, scaled_b] = [a, b].map(|e| 1.0 / (e.scale + e.bias));
        assert!((scaled_a / scaled_b - 1.0).abs() > 0.05, "{scaled_a} and {scaled_b}");
    }

    #[test]
    fn smooth_or_black_surfaces_have_no_multiple_scattering() {
        let smooth = Energy::new(0.0, Geometry::Smith, Scattering::Multiple);
        let at = table_entry(0.5, 0.0, Geometry::Smith);
        assert!(smooth.multiple(smooth.multiple_share(DVec3::ONE), at, at).x < 1e-6);
        let rough = Energy::new(1.0, Geometry::Smith, Scattering::Multiple);
        assert!(rough.multiple_share(DVec3::ZERO).x < 0.01);
        assert!((rough.multiple_share(DVec3::ONE).x - 1.0).abs() < 1e-12);
    }

    #[test]
    fn multiple_scattering_is_visible_on_metals_that_are_not_smooth() {
        for (roughness, metallic, base_color, f0, want) in [
            (1.0, 1.0, 0.9, 0.04, true),
            (0.5, 1.0, 0.9, 0.04, true),
            (0.02, 1.0, 1.0, 0.04, false),
            (1.0, 0.0, 0.8, 0.04, false),
            (1.0, 0.0, 0.8, 0.17, true),
        ] {
            let got = is_multi_scatter_visible(roughness, metallic, base_color, f0);
            assert_eq!(got, want, "roughness {roughness}, metallic {metallic}, base_color {base_color}, F0 {f0}");
        }
    }

    /// The assumptions of `is_multi_scatter_visible`.
    #[test]
    fn dielectrics_never_need_it_and_rougher_metals_need_it_more() {
        let roughnesses: Vec<f64> = (0..=8).map(|i| f64::from(i) / 8.0).collect();
        let changes = |metallic, base_color| -> Vec<f64> {
            roughnesses.par_iter().map(|r| most_changed(*r, metallic, base_color, DIELECTRIC_F0)).collect()
        };
        let dielectric = changes(0.0, 1.0);
        assert!(dielectric.iter().all(|change| *change < VISIBLE), "{dielectric:?}");
        for (metallic, base_color) in [(1.0, 1.0), (0.1, 0.5)] {
            let visible: Vec<bool> = changes(metallic, base_color).iter().map(|change| *change > VISIBLE).collect();
            assert!(visible.is_sorted(), "{visible:?}");
        }
    }

    #[test]
    fn the_curve_is_the_table() {
        for roughness in [0.1, 0.6, 1.0] {
            let curve = Curve::new(roughness, Geometry::Smith);
            for nv in [0.0, 0.003, 0.31, 0.77, 0.93, 1.0] {
                let (got, want) = (curve.at(nv), table_entry(nv, roughness, Geometry::Smith));
                let off = (got.scale - want.scale).abs().max((got.bias - want.bias).abs());
                assert!(off < 3e-4, "{got:?} is not {want:?}: {nv}, {roughness}");
            }
        }
    }

    #[test]
    fn the_furnace_equals_the_sum_of_its_terms() {
        for (metallic, roughness, nv) in [(0.0, 0.5, 0.3), (1.0, 1.0, 0.9), (0.5, 0.7, 0.6)] {
            let share = |base_color, scattering| furnace(DVec3::splat(base_color), metallic, roughness, nv, scattering);
            let multiple = share(1.0, Scattering::Multiple);
            assert!(multiple.abs_diff_eq(DVec3::ONE, 0.005), "{multiple}");
            assert!(share(0.5, Scattering::Multiple).x < 0.75);
            // A dielectric reflects the rest diffusely; a metal has no diffuse part.
            let single = share(1.0, Scattering::Single).x;
            assert!(if metallic == 0.0 { (single - 1.0).abs() < 0.005 } else { single < 0.95 }, "{single}");
        }
    }
}
