//! What a pixel shows of the environment, with each approximation or with what is exact in its place: in f64, but for what is
//! read back from the GPU.

use glam::DVec3;

use super::stored::{Stored, bilinear};
use super::sums::Sums;
use crate::precompute::{TableAt, TableTexels};
use crate::reference::brdf::{Geometry, f_schlick_roughness, f0_from_metallic};
use crate::reference::energy::{Energy, Scattering};
use crate::reference::integrals::{Surface, Terms, reflected_by};
use crate::reference::levels::{LEVELS, alpha_from_level, alpha_from_spread, level_from_spread, spread_from_level};
use crate::reference::lobe::kernel_spread;
use crate::reference::math::round_to_half;
use crate::reference::table::{Entry, Lobe, SplitSum, table_lobe, table_slices};

/// An approximation, in the order in which a chain from the exact integral to the pixel adds them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Light averaged under a round lobe with the mean vector of the BRDF's own, which is grey: n = v, matched.
    Lobe,
    /// What is diffuse or scattered more than once from the irradiance alone.
    Diffuse,
    /// No lobe wider than the last level's.
    Range,
    /// Two stored lobes mixed instead of one between them.
    Mixing,
    /// Texels of finite size, bilinear.
    Cube,
    /// Texels rounded to half floats.
    Half,
    /// What the GPU's sums of the panorama lose.
    Sums,
    /// A table of texels for the BRDF's integrals.
    Table,
}

impl Cause {
    pub const ALL: [Self; 8] =
        [Self::Lobe, Self::Diffuse, Self::Range, Self::Mixing, Self::Cube, Self::Half, Self::Sums, Self::Table];

    /// A name, what is there, and what is exact.
    pub fn words(self) -> [&'static str; 3] {
        match self {
            Self::Lobe => {
                ["n = v (matched)", "one round, grey lobe with the mean of the BRDF's", "the BRDF's own lobe"]
            }
            Self::Diffuse => ["diffuse, multi-scatter", "even-light share × irradiance", "the BRDF's own integrals"],
            Self::Range => ["levels stored", "widest lobe that of the last level", "up to the widest of their kind"],
            Self::Mixing => ["level interpolation", "two of ten levels mixed", "the lobe itself"],
            Self::Cube => ["cube resolution", "texels, bilinear", "each direction's own mean"],
            Self::Half => ["half float", "f16 texels", "f64 texels"],
            Self::Sums => ["the GPU's sums", "texels as precomputed", "f64 sums, rounded likewise"],
            Self::Table => ["table", "bilinear in f32", "f64 integrals"],
        }
    }
}

/// Which approximations are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CauseSet([bool; Cause::ALL.len()]);

impl CauseSet {
    pub const NONE: Self = Self([false; Cause::ALL.len()]);
    pub const ALL: Self = Self([true; Cause::ALL.len()]);

    /// The first so many of the chain.
    pub fn first(count: usize) -> Self {
        Self(std::array::from_fn(|i| i < count))
    }

    /// All but one.
    pub fn without(cause: Cause) -> Self {
        let mut set = Self::ALL;
        set.0[cause as usize] = false;
        set
    }

    fn has(self, cause: Cause) -> bool {
        self.0[cause as usize]
    }
}

/// One surface, seen: its truth, and the table's answers.
pub struct Point {
    surface: Surface,
    /// All light that it reflects.
    pub truth: DVec3,
    /// Of that, what single scattering mirrors, over its reflectance: the mean under the BRDF's own lobe.
    own: DVec3,
    /// What is diffuse or scattered more than once.
    beyond: DVec3,
    exact: TableAt,
    stored: TableAt,
}

impl Point {
    /// Integrates; `terms` are Smith's of the surface's roughness.
    pub fn new(surface: Surface, terms: &Terms, sums: &Sums<'_>, table: &TableTexels) -> Self {
        let exact = exact_table(&surface, terms);
        let truth = reflected_by(sums.view(), &surface, terms, Scattering::Multiple);
        let truth = truth.diffuse + truth.specular;
        // As a metal of the same F0 it has single scattering alone.
        let f0 = f0_from_metallic(surface.albedo, surface.metallic);
        let mirror = Surface { albedo: f0, metallic: 1.0, ..surface };
        let single = reflected_by(sums.view(), &mirror, terms, Scattering::Single).specular;
        let stored = table.look_up(surface.n.dot(surface.v), surface.roughness);
        Self { surface, truth, own: single / reflectance(&exact.lobe, f0), beyond: truth - single, exact, stored }
    }

    /// How far the integral under even light of radiance 1 (`truth`, then) is from what is known, relatively: what f64 sums
    /// are good to.
    pub fn even_error(&self) -> f64 {
        let f0 = f0_from_metallic(self.surface.albedo, self.surface.metallic);
        let known = reflectance(&self.exact.lobe, f0) + self.even(&self.exact, Scattering::Multiple);
        (self.truth - known).abs().element_sum() / known.element_sum()
    }

    /// Share of even light that comes back diffuse or after several bounces.
    fn even(&self, at: &TableAt, scattering: Scattering) -> DVec3 {
        let Surface { albedo, metallic, .. } = self.surface;
        let (energy, entry) = (Energy { mean: at.mean, scattering }, entry(at));
        energy.diffuse_even(albedo, metallic, entry) + energy.multiple_even(albedo, metallic, entry)
    }
}

fn exact_table(surface: &Surface, terms: &Terms) -> TableAt {
    let lobe = table_lobe(surface.n.dot(surface.v), surface.roughness, Geometry::Smith);
    // Smith's terms have one.
    let mean = terms.mean_entry().unwrap_or(Entry { scale: 0.0, bias: 0.0 });
    let slices = table_slices(surface.n.dot(surface.v), surface.roughness, Geometry::Smith);
    TableAt { lobe, slices: Some(slices), mean }
}

fn entry(at: &TableAt) -> Entry {
    Entry { scale: at.lobe.base.weight, bias: at.lobe.fresnel.weight }
}

fn reflectance(lobe: &Lobe, f0: DVec3) -> DVec3 {
    f0 * lobe.base.weight + lobe.fresnel.weight
}

/// How a pixel is computed beside the approximations.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    pub split_sum: SplitSum,
    pub scattering: Scattering,
    /// Fresnel's term once more than the table has it, by roughness, as the thesis has it.
    pub fresnel_twice: bool,
}

impl Default for Way {
    fn default() -> Self {
        Self { split_sum: SplitSum::Moment, scattering: Scattering::Multiple, fresnel_twice: false }
    }
}

/// Radiance of a point with some approximations; to be asked again after `sums` has answered. None of them is the truth.
pub fn radiance(point: &Point, set: CauseSet, way: Way, stored: &Stored, sums: &mut Sums<'_>) -> DVec3 {
    let Surface { n, albedo, metallic, .. } = point.surface;
    let at = if set.has(Cause::Table) { &point.stored } else { &point.exact };
    let mut maps = Maps { stored, sums };
    let f0 = f0_from_metallic(albedo, metallic);
    let mut mirrored = maps.mirrored(point, at, way, set);
    if !set.has(Cause::Lobe) {
        // What follows from the approximated lobe is carried over to the own one.
        let round = maps.mirrored(point, &point.exact, way, CauseSet::NONE);
        mirrored += reflectance(&at.lobe, f0) * (point.own - round / reflectance(&point.exact.lobe, f0));
    }
    let mut beyond = point.even(at, way.scattering) * maps.irradiance(n, set);
    if !set.has(Cause::Diffuse) {
        beyond += point.beyond - point.even(&point.exact, Scattering::Multiple) * maps.irradiance(n, CauseSet::NONE);
    }
    mirrored + beyond
}

/// Where a lobe at a point points, and its spread: as `lobe_part` in `glsl/environment.glsl`.
fn mean_and_spread(point: &Point, lobe: &Lobe) -> (DVec3, f64) {
    let Surface { n, v, albedo, metallic, .. } = point.surface;
    let nv = n.dot(v);
    let r = 2.0 * nv * n - v;
    let grey = f0_from_metallic(albedo, metallic).element_sum() / 3.0;
    let [along, across] = lobe.mean(grey, nv);
    let mean = along * r + across * (n - nv * r).normalize_or_zero();
    (mean, 1.0 - mean.length())
}

/// The environment's maps, or what they stand for.
struct Maps<'a, 'p> {
    stored: &'a Stored,
    sums: &'a mut Sums<'p>,
}

impl Maps<'_, '_> {
    /// What is mirrored once.
    fn mirrored(&mut self, point: &Point, at: &TableAt, way: Way, set: CauseSet) -> DVec3 {
        let Surface { n, v, albedo, metallic, roughness } = point.surface;
        let mut f0 = f0_from_metallic(albedo, metallic);
        if way.fresnel_twice {
            f0 = f_schlick_roughness(f0, n.dot(v), roughness);
        }
        let mut under = |lobe: &Lobe| {
            let (d, spread) = mean_and_spread(point, lobe);
            reflectance(lobe, f0) * self.specular(d, spread, set)
        };
        match way.split_sum {
            SplitSum::Moment => under(&at.lobe),
            SplitSum::Slices => at.slices.iter().flatten().map(under).sum(),
            SplitSum::Classic => {
                let r = 2.0 * n.dot(v) * n - v;
                reflectance(&at.lobe, f0) * self.specular(r, kernel_spread(roughness * roughness), set)
            }
        }
    }

    /// Mean radiance under a lobe.
    fn specular(&mut self, d: DVec3, spread: f64, set: CauseSet) -> DVec3 {
        let ideal = self.ideal(d, spread, set);
        if !set.has(Cause::Sums) {
            return ideal;
        }
        // What the GPU's texels have instead of those that they should, carried over to whatever else is exact.
        let (low, share) = mixed(spread);
        let high = self.stored.levels[(low + 1).min(LEVELS - 1)].look_up(d);
        let seen = self.stored.levels[low].look_up(d).lerp(high, share);
        ideal + seen - self.ideal(d, spread, CauseSet::ALL)
    }

    fn ideal(&mut self, d: DVec3, spread: f64, set: CauseSet) -> DVec3 {
        let last = spread_from_level(LEVELS - 1);
        let spread = if set.has(Cause::Range) { spread.min(last) } else { spread };
        let (low, share) = mixed(spread);
        if !set.has(Cause::Mixing) || spread > last {
            return self.one(d, alpha_from_spread(spread), self.stored.levels[low].size, set);
        }
        let mut level = |level: usize| self.one(d, alpha_from_level(level), self.stored.levels[level].size, set);
        level(low).lerp(level((low + 1).min(LEVELS - 1)), share)
    }

    /// One lobe, in cubes of this size where cubes are.
    fn one(&mut self, d: DVec3, alpha: f64, size: u32, set: CauseSet) -> DVec3 {
        if !set.has(Cause::Cube) {
            let mean = self.sums.around(d, alpha);
            return self.rounded(mean, set);
        }
        let mut light = DVec3::ZERO;
        for (texel, weight) in bilinear(d, size) {
            let value = self.sums.texel(texel, size, alpha);
            light += weight * self.rounded(value, set);
        }
        light
    }

    fn rounded(&self, radiance: DVec3, set: CauseSet) -> DVec3 {
        let scale = self.stored.scale;
        if set.has(Cause::Half) { scale * round_to_half(radiance / scale) } else { radiance }
    }

    /// Irradiance / π.
    fn irradiance(&mut self, n: DVec3, set: CauseSet) -> DVec3 {
        let size = self.stored.irradiance.size;
        let ideal = self.one(n, 1.0, size, set);
        if !set.has(Cause::Sums) {
            return ideal;
        }
        ideal + self.stored.irradiance.look_up(n) - self.one(n, 1.0, size, CauseSet::ALL)
    }
}

/// The lower of the two levels around a spread, and the share of the other.
fn mixed(spread: f64) -> (usize, f64) {
    let level = level_from_spread(spread.max(0.0));
    (level as usize, level.fract())
}
