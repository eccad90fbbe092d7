//! A ball under panoramas: all its roughnesses and angles, and what each approximation changes of them.

use std::sync::Arc;

use glam::DVec3;

use super::chain::{Cause, CauseSet, Point, Way, radiance};
use super::stored::Stored;
use super::sums::Sums;
use super::{Change, Row, Swap};
use crate::asset::Panorama;
use crate::gpu::Gpu;
use crate::precompute::{BrdfTable, Cache, LightMaps, Options, TableTexels};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::integrals::{Surface, Terms};
use crate::reference::sampling::hammersley;
use crate::reference::table::SplitSum;
use crate::{Error, Result};

/// A metal's colour, gold; a dielectric's; and one that shows its mirrored light alone.
const MATERIALS: [(&str, f64, DVec3); 3] = [
    ("metal", 1.0, DVec3::new(1.0, 0.77, 0.34)),
    ("dielectric", 0.0, DVec3::splat(0.5)),
    ("black dielectric", 0.0, DVec3::ZERO),
];

/// What a ball is sampled by.
pub struct Grid {
    pub roughness: &'static [f64],
    pub nv: &'static [f64],
    /// Normals for each of them, of 2^n that are spread over the sphere.
    pub log2_normals: u32,
    /// Other sizes of the cube, for comparison.
    pub cubes: &'static [u32],
    /// Texels across a panorama at most; larger ones are averaged.
    pub width: u32,
}

pub const QUICK: Grid = Grid {
    roughness: &[0.1, 0.2, 0.35, 0.5, 0.75, 1.0],
    nv: &[0.95, 0.6, 0.2],
    log2_normals: 2,
    cubes: &[16, 64],
    width: 512,
};

pub const FULL: Grid = Grid {
    roughness: &[0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0],
    nv: &[0.98, 0.8, 0.6, 0.4, 0.2, 0.1],
    log2_normals: 3,
    cubes: &[16, 64, 128, 512],
    width: 1024,
};

/// One panorama's ball, ready to be judged.
pub struct Ball<'a> {
    gpu: &'a Arc<Gpu>,
    panorama: &'a Panorama,
    name: String,
    cache: Option<&'a Cache>,
    stored: Stored,
    sums: Sums<'a>,
    /// By material.
    points: [Vec<Point>; MATERIALS.len()],
    floor: [f64; MATERIALS.len()],
}

impl<'a> Ball<'a> {
    /// Precomputes the panorama with cubes of `size` and integrates the truth.
    pub fn new(
        gpu: &'a Arc<Gpu>,
        panorama: &'a Panorama,
        size: u32,
        grid: &Grid,
        cache: Option<&'a Cache>,
    ) -> Result<Self> {
        let stem = std::path::Path::new(&panorama.name).file_stem().unwrap_or_default();
        let name = stem.to_string_lossy().into_owned();
        let no_texels = || Error::Usage(format!("{}: a panorama without texels", panorama.name));
        let sums = Sums::new(panorama).ok_or_else(no_texels)?;
        let stored = maps(gpu, panorama, size, cache)?;
        let table = BrdfTable::new(gpu, Geometry::Smith, SplitSum::Slices, cache)?;
        let table = TableTexels::read(gpu, &table)?;
        let even = Panorama::from_fn(64, 32, |_| glam::Vec3::ONE);
        let even_sums = Sums::new(&even).ok_or_else(no_texels)?;
        let (mut points, mut floor) = ([const { Vec::new() }; MATERIALS.len()], [0.0; MATERIALS.len()]);
        for roughness in grid.roughness {
            let terms = Terms::new(*roughness, Geometry::Smith);
            for (material, points) in points.iter_mut().enumerate() {
                for surface in surfaces(material, *roughness, grid) {
                    points.push(Point::new(surface, &terms, &sums, &table));
                }
                // One normal tells as much as all.
                for surface in surfaces(material, *roughness, grid).step_by(1 << grid.log2_normals) {
                    let error = Point::new(surface, &terms, &even_sums, &table).even_error();
                    floor[material] += error / (grid.roughness.len() * grid.nv.len()) as f64;
                }
            }
        }
        Ok(Self { gpu, panorama, name, cache, stored, sums, points, floor })
    }

    /// Every row: swaps, the chain, alternatives, the whole and the floor.
    pub fn rows(&mut self, grid: &Grid) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        let default = Way::default();
        let seen = self.values(CauseSet::ALL, default, None);
        let truth = self.truth();
        for (i, cause) in Cause::ALL.into_iter().enumerate() {
            let exact = self.values(CauseSet::without(cause), default, None);
            let [before, after] = [i, i + 1].map(|count| self.values(CauseSet::first(count), default, None));
            let words = cause.words();
            rows.extend(self.each(&truth, Swap::ReferenceAccumulator, words, &exact, &seen));
            rows.extend(self.each(&truth, Swap::Chain, words, &before, &after));
        }
        let classic = Way { split_sum: SplitSum::Classic, ..default };
        let single = Way { scattering: Scattering::Single, ..default };
        let slices = Way { split_sum: SplitSum::Slices, ..default };
        let twice = Way { fresnel_twice: true, ..default };
        for (way, words) in [
            (twice, ["Fresnel", "in the table", "twice: by roughness, too"]),
            (classic, ["n = v", "matched by its mean", "classic: along r, by roughness"]),
            (slices, ["slices", "the whole lobe", "two halves, each matched"]),
            (single, ["scattering", "as often as it takes", "once"]),
        ] {
            let other = self.values(CauseSet::ALL, way, None);
            rows.extend(self.each(&truth, Swap::Other, words, &other, &seen));
        }
        let own = self.stored.levels[0].size;
        for size in grid.cubes.iter().filter(|size| **size != own) {
            let maps = maps(self.gpu, self.panorama, *size, self.cache)?;
            let other = self.values(CauseSet::ALL, default, Some(&maps));
            let words = ["cube resolution", &format!("{own}²"), &format!("{size}²")];
            rows.extend(self.each(&truth, Swap::Other, words, &other, &seen));
        }
        for (material, (name, ..)) in MATERIALS.iter().enumerate() {
            let whole = relative(&seen[material], &truth[material], &truth[material]);
            let subject = format!("{}, {name}", self.name);
            rows.push(Row::ball(&subject, Swap::Whole, ["all", "as it is", "exact"], Change::of(whole, whole, 0.0)));
            let floor = self.floor[material];
            let words = ["floor", "f64 sums", "even light's known answer"];
            rows.push(Row::ball(&subject, Swap::Floor, words, Change::of(floor, floor, 0.0)));
        }
        Ok(rows)
    }

    fn truth(&self) -> [Vec<DVec3>; MATERIALS.len()] {
        std::array::from_fn(|material| self.points[material].iter().map(|point| point.truth).collect())
    }

    /// What all points show, by material.
    fn values(&mut self, set: CauseSet, way: Way, maps: Option<&Stored>) -> [Vec<DVec3>; MATERIALS.len()] {
        let (points, sums, stored) = (&self.points, &mut self.sums, maps.unwrap_or(&self.stored));
        loop {
            let values = std::array::from_fn(|material| {
                points[material].iter().map(|point| radiance(point, set, way, stored, sums)).collect()
            });
            if !sums.answer() {
                return values;
            }
        }
    }

    /// A row for each material: from `other` to `seen`.
    fn each(
        &self,
        truth: &[Vec<DVec3>],
        swap: Swap,
        words: [&str; 3],
        other: &[Vec<DVec3>],
        seen: &[Vec<DVec3>],
    ) -> Vec<Row> {
        let row = |material: usize| {
            let (truth, other, seen) = (&truth[material], &other[material], &seen[material]);
            let change =
                Change::of(relative(seen, other, truth), relative(seen, truth, truth), relative(other, truth, truth));
            Row::ball(&format!("{}, {}", self.name, MATERIALS[material].0), swap, words, change)
        };
        (0..MATERIALS.len()).map(row).collect()
    }
}

fn maps(gpu: &Arc<Gpu>, panorama: &Panorama, size: u32, cache: Option<&Cache>) -> Result<Stored> {
    let options = Options { face_size: size, cache: cache.cloned(), ..Options::default() };
    Stored::read(gpu, &LightMaps::new(gpu, panorama, &options)?)
}

fn surfaces(material: usize, roughness: f64, grid: &Grid) -> impl Iterator<Item = Surface> {
    let (_, metallic, albedo) = MATERIALS[material];
    let (views, log2) = (grid.nv, grid.log2_normals);
    views.iter().flat_map(move |nv| {
        (0..1 << log2).map(move |i| {
            // Turned from view to view, so that all see different light.
            let u = hammersley(i, log2);
            let z = 1.0 - 2.0 * (u.x + 0.5 / f64::from(1 << log2));
            let (sin, cos) = (std::f64::consts::TAU * (u.y + nv)).sin_cos();
            let n = DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin);
            let v = *nv * n + (1.0 - nv * nv).sqrt() * n.any_orthonormal_vector();
            Surface { n, v, albedo, metallic, roughness }
        })
    })
}

/// Mean over the points of |a − b| over the truth, each summed over RGB.
fn relative(a: &[DVec3], b: &[DVec3], truth: &[DVec3]) -> f64 {
    let one = |((a, b), truth): ((&DVec3, &DVec3), &DVec3)| {
        (*a - *b).abs().element_sum() / truth.element_sum().max(f64::MIN_POSITIVE)
    };
    a.iter().zip(b).zip(truth).map(one).sum::<f64>() / truth.len().max(1) as f64
}
