//! The radiance that a pixel reflects from the environment, with any set of approximations and everything else exact: in
//! f64, except for values read back from the GPU.

use glam::DVec3;

use super::super::sums::Sums;
use crate::precompute::{CubeTexels, TableAt, TableTexels};
use crate::reference::brdf::{DIELECTRIC_F0, Fresnel, Geometry, f_schlick_roughness, f0_from_metallic};
use crate::reference::energy::{Energy, Scattering, diffuse_taken, multiple_taken};
use crate::reference::integrals::{Surface, Terms, grazing, reflected_by};
use crate::reference::levels::{LEVELS, alpha_from_level, alpha_from_spread, level_from_spread};
use crate::reference::lobe::kernel_spread;
use crate::reference::split_sum::{Match, SplitSum};
use crate::reference::table::{Entry, Lobe, table_lobe};

/// An approximation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Light averaged under a round lobe and the cosine's, with both moments of the BRDF's own, which is grey: n = v, matched.
    Lobe,
    /// The diffuse part and multiple scattering from the irradiance alone.
    Diffuse,
    /// Two of the stored lobes mixed instead of one between them; none wider than the last.
    Levels,
    /// Texels of finite size, bilinear, in half floats, from the GPU's sums.
    Texels,
    /// A table of texels for the BRDF's integrals.
    Table,
}

impl Cause {
    pub const ALL: [Self; 5] = [Self::Lobe, Self::Diffuse, Self::Levels, Self::Texels, Self::Table];

    /// A name, the default, and the exact form.
    pub fn words(self) -> [&'static str; 3] {
        match self {
            Self::Lobe => {
                ["n = v (matched)", "a round, grey lobe and irradiance for the BRDF's", "the BRDF's own lobe"]
            }
            Self::Diffuse => ["diffuse, multi-scatter", "even-light share × irradiance", "the BRDF's own integrals"],
            Self::Levels => ["level interpolation", "two of ten levels mixed", "the lobe itself"],
            Self::Texels => ["texels", "f16 texels of the GPU's sums, bilinear", "each direction's own f64 mean"],
            Self::Table => ["table", "bilinear in f32", "f64 integrals"],
        }
    }
}

/// The approximations that are replaced by their exact form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exact {
    Nothing,
    Only(Cause),
    All,
}

impl Exact {
    fn has(self, cause: Cause) -> bool {
        self == Self::All || self == Self::Only(cause)
    }
}

/// One surface in one view: the exact result, and the table's values.
pub struct Point {
    surface: Surface,
    /// All light that it reflects.
    pub truth: DVec3,
    /// The singly scattered part, divided by its reflectance: the mean under the BRDF's own lobe.
    own: DVec3,
    /// The diffuse and multiply scattered part.
    beyond: DVec3,
    /// How much of the light is grazing.
    grazing: f64,
    exact: TableAt,
    stored: TableAt,
}

impl Point {
    /// Integrates; `terms` are Smith's of the surface's roughness.
    pub fn new(surface: Surface, terms: &Terms, sums: &Sums<'_>, table: &TableTexels) -> Self {
        let exact = exact_table(&surface, terms);
        let truth = reflected_by(sums.view, &surface, terms, Scattering::Multiple);
        let truth = truth.diffuse + truth.specular;
        // As a metal of the same F0 it has single scattering alone.
        let f0 = f0_from_metallic(surface.base_color, surface.metallic, DIELECTRIC_F0);
        let mirror = Surface { base_color: f0, metallic: 1.0, ..surface };
        let single = reflected_by(sums.view, &mirror, terms, Scattering::Single).specular;
        let stored = table.look_up(surface.n.dot(surface.v), surface.roughness);
        let own = single / reflectance(&exact.lobe, f0);
        let grazing = grazing(sums.view, surface.n);
        Self { surface, truth, own, beyond: truth - single, grazing, exact, stored }
    }

    /// Share of the irradiance that comes back diffuse or after several bounces.
    fn even(&self, at: &TableAt, scattering: Scattering, grazing: f64) -> DVec3 {
        let Surface { base_color, metallic, roughness, .. } = self.surface;
        let (energy, entry) =
            (Energy { mean: at.mean, dielectric: Fresnel::dielectric(DIELECTRIC_F0), scattering }, entry(at));
        energy.diffuse_even(base_color, metallic, entry) * diffuse_taken(roughness, grazing)
            + energy.multiple_even(base_color, metallic, entry) * multiple_taken(roughness, grazing)
    }
}

fn exact_table(surface: &Surface, terms: &Terms) -> TableAt {
    let lobe = table_lobe(surface.n.dot(surface.v), surface.roughness, Geometry::Smith);
    // Smith's terms have one.
    let mean = terms.mean_entry().unwrap_or(Entry { scale: 0.0, bias: 0.0 });
    TableAt { lobe, mean }
}

fn entry(at: &TableAt) -> Entry {
    Entry { scale: at.lobe.base.weight, bias: at.lobe.fresnel.weight }
}

fn reflectance(lobe: &Lobe, f0: DVec3) -> DVec3 {
    f0 * lobe.base.weight + lobe.fresnel.weight
}

/// Settings beside the approximations.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    pub split_sum: SplitSum,
    pub scattering: Scattering,
    /// Fresnel's term once more than the table has it, by roughness, as the thesis has it.
    pub fresnel_twice: bool,
}

impl Default for Variant {
    fn default() -> Self {
        Self { split_sum: SplitSum::default(), scattering: Scattering::Multiple, fresnel_twice: false }
    }
}

/// The radiance of a point with some approximations; without any, it is the exact result. To be called by
/// [`Sums::settled`].
pub fn radiance(point: &Point, exact: Exact, variant: Variant, stored: &Stored, sums: &mut Sums<'_>) -> DVec3 {
    let Surface { n, base_color, metallic, .. } = point.surface;
    let at = if !exact.has(Cause::Table) { &point.stored } else { &point.exact };
    let mut maps = Maps { stored, sums };
    let f0 = f0_from_metallic(base_color, metallic, DIELECTRIC_F0);
    let mut mirrored = maps.mirrored(point, at, variant, exact);
    if exact.has(Cause::Lobe) {
        // What follows from the approximated lobe is carried over to the own one.
        let round = maps.mirrored(point, &point.exact, variant, Exact::All);
        mirrored += reflectance(&at.lobe, f0) * (point.own - round / reflectance(&point.exact.lobe, f0));
    }
    let mut beyond = point.even(at, variant.scattering, maps.grazing(point, exact)) * maps.irradiance(n, exact);
    if exact.has(Cause::Diffuse) {
        let even = point.even(&point.exact, Scattering::Multiple, maps.grazing(point, Exact::All));
        beyond += point.beyond - even * maps.irradiance(n, Exact::All);
    }
    mirrored + beyond
}

/// What is looked up for the mirrored light at a point.
struct Lookup {
    /// Of the round lobes.
    towards: [DVec3; 2],
    /// Of each.
    spread: f64,
    /// The weight of irradiance beside them.
    even: f64,
}

impl Lookup {
    /// As `specular_lobe` in `glsl/environment.glsl`.
    fn new(point: &Point, lobe: &Lobe, split_sum: SplitSum) -> Self {
        let Surface { n, v, base_color, metallic, roughness } = point.surface;
        let nv = n.dot(v);
        let r = 2.0 * nv * n - v;
        if split_sum == SplitSum::Classic {
            return Self { towards: [r; 2], spread: kernel_spread(roughness * roughness), even: 0.0 };
        }
        let grey = f0_from_metallic(base_color, metallic, DIELECTRIC_F0).element_sum() / 3.0;
        let found = lobe.matched(grey, nv, roughness, split_sum);
        let across = (n - nv * r).normalize_or_zero();
        let Match { even, each_spread, .. } = found;
        Self { towards: found.lobes().map(|[x, y]| x * r + y * across), spread: each_spread, even }
    }
}

/// The maps of one panorama, read back from the GPU.
pub struct Stored {
    /// The mirror's level first.
    pub levels: Vec<CubeTexels>,
    /// Irradiance / π, and in alpha how much of it is grazing.
    pub irradiance: CubeTexels,
}

/// The environment's maps, or the exact means that they approximate.
struct Maps<'a, 'p> {
    stored: &'a Stored,
    sums: &'a mut Sums<'p>,
}

impl Maps<'_, '_> {
    /// The singly scattered part.
    fn mirrored(&mut self, point: &Point, at: &TableAt, variant: Variant, exact: Exact) -> DVec3 {
        let Surface { n, v, base_color, metallic, roughness } = point.surface;
        let mut f0 = f0_from_metallic(base_color, metallic, DIELECTRIC_F0);
        if variant.fresnel_twice {
            f0 = f_schlick_roughness(f0, n.dot(v), roughness);
        }
        let Lookup { towards: [first, second], spread, even } = Lookup::new(point, &at.lobe, variant.split_sum);
        let mut round = self.specular(first, spread, exact);
        if second != first {
            round = round.midpoint(self.specular(second, spread, exact));
        }
        let light = if even > 0.0 { round.lerp(self.irradiance(n, exact), even) } else { round };
        reflectance(&at.lobe, f0) * light
    }

    /// Mean radiance under a lobe.
    fn specular(&mut self, d: DVec3, spread: f64, exact: Exact) -> DVec3 {
        // The two levels around the spread, and the second one's share.
        let level = level_from_spread(spread.max(0.0));
        let (low, share) = (level as usize, level.fract());
        let high = (low + 1).min(LEVELS - 1);
        let mut level = |level| self.sums.around(d, alpha_from_level(level));
        let exact_mix = level(low).lerp(level(high), share);
        let mean =
            if !exact.has(Cause::Levels) { exact_mix } else { self.sums.around(d, alpha_from_spread(spread.max(0.0))) };
        if exact.has(Cause::Texels) {
            return mean;
        }
        // The texels' error is carried over to whatever else is exact.
        let levels = &self.stored.levels;
        mean + levels[low].look_up(d).lerp(levels[high].look_up(d), share).truncate() - exact_mix
    }

    /// How much of the light is grazing.
    fn grazing(&self, point: &Point, exact: Exact) -> f64 {
        if !exact.has(Cause::Texels) { self.stored.irradiance.look_up(point.surface.n).w } else { point.grazing }
    }

    /// Irradiance / π.
    fn irradiance(&mut self, n: DVec3, exact: Exact) -> DVec3 {
        if !exact.has(Cause::Texels) { self.stored.irradiance.look_up(n).truncate() } else { self.sums.around(n, 1.0) }
    }
}
