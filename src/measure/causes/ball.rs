//! The errors of each approximation for balls under panoramas, over all roughnesses and angles.

use glam::DVec3;

use super::super::maps::own_maps;
use super::super::report::stem;
use super::super::sums::Sums;
use super::super::texels::Accuracy;
use super::chain::{Cause, Exact, Point, Stored, Variant, radiance};
use super::rows::{Ablation, Kind, Row};
use crate::Result;
use crate::asset::Panorama;
use crate::context::Context;
use crate::precompute::{BrdfTable, LightMaps, Options, TableTexels};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::integrals::{Surface, Terms};
use crate::reference::sampling::hammersley;
use crate::reference::split_sum::SplitSum;

/// A metal's colour, gold; a dielectric's; and one that shows its mirrored light alone.
const MATERIALS: [(&str, f64, DVec3); 3] = [
    ("metal", 1.0, DVec3::new(1.0, 0.77, 0.34)),
    ("dielectric", 0.0, DVec3::splat(0.5)),
    ("black dielectric", 0.0, DVec3::ZERO),
];

/// The sampling of a ball.
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
    context: &'a Context,
    panorama: &'a Panorama,
    name: String,
    stored: Stored,
    sums: Sums<'a>,
    /// By material.
    points: [Vec<Point>; MATERIALS.len()],
}

impl<'a> Ball<'a> {
    /// Precomputes the panorama with cubes of `size` and integrates the truth.
    pub fn new(context: &'a Context, panorama: &'a Panorama, size: u32, grid: &Grid) -> Result<Self> {
        let name = stem(&panorama.name);
        let sums = Sums::new(panorama)?;
        let stored = maps(context, panorama, size)?;
        let table = BrdfTable::new(context, Geometry::Smith, SplitSum::TwoLobes)?;
        let table = TableTexels::read(&context.gpu, &table)?;
        let mut points = [const { Vec::new() }; MATERIALS.len()];
        for roughness in grid.roughness {
            let terms = Terms::new(*roughness, Geometry::Smith);
            for (material, points) in points.iter_mut().enumerate() {
                points.extend(surfaces(material, *roughness, grid).map(|s| Point::new(s, &terms, &sums, &table)));
            }
        }
        Ok(Self { context, panorama, name, stored, sums, points })
    }

    /// Every row: the whole, exact replacements and other settings.
    pub fn rows(&mut self, grid: &Grid) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        let default = Variant::default();
        let seen = self.values(Exact::Nothing, default, None);
        let truth = self.truth();
        rows.extend(self.each(&truth, Ablation::Whole, ["all", "as it is", "exact"], &truth, &seen));
        for cause in Cause::ALL {
            let exact = self.values(Exact::Only(cause), default, None);
            rows.extend(self.each(&truth, Ablation::Exact, cause.words(), &exact, &seen));
        }
        for (variant, words) in [
            (Variant { fresnel_twice: true, ..default }, ["Fresnel", "in the table", "twice: by roughness, too"]),
            (
                Variant { split_sum: SplitSum::Classic, ..default },
                ["n = v", "two lobes by their mean", "classic: along r"],
            ),
            (
                Variant { split_sum: SplitSum::OneLobe, ..default },
                ["one lobe", "two and irradiance", "one and irradiance"],
            ),
            (
                Variant { split_sum: SplitSum::Moment, ..default },
                ["no irradiance", "two and irradiance", "one lobe alone"],
            ),
            (Variant { scattering: Scattering::Single, ..default }, ["scattering", "as often as it takes", "once"]),
        ] {
            let other = self.values(Exact::Nothing, variant, None);
            rows.extend(self.each(&truth, Ablation::Other, words, &other, &seen));
        }
        let own = self.stored.levels[0].size;
        for size in grid.cubes.iter().filter(|size| **size != own) {
            let maps = maps(self.context, self.panorama, *size)?;
            let other = self.values(Exact::Nothing, default, Some(&maps));
            let words = ["cube resolution", &format!("{own}²"), &format!("{size}²")];
            rows.extend(self.each(&truth, Ablation::Other, words, &other, &seen));
        }
        Ok(rows)
    }

    fn truth(&self) -> [Vec<DVec3>; MATERIALS.len()] {
        std::array::from_fn(|material| self.points[material].iter().map(|point| point.truth).collect())
    }

    /// The radiance of all points, by material.
    fn values(&mut self, exact: Exact, variant: Variant, maps: Option<&Stored>) -> [Vec<DVec3>; MATERIALS.len()] {
        let (points, sums, stored) = (&self.points, &mut self.sums, maps.unwrap_or(&self.stored));
        sums.settled(|sums| {
            points.each_ref().map(|all| all.iter().map(|p| radiance(p, exact, variant, stored, sums)).collect())
        })
    }

    /// A row for each material: `seen` against `other`, which replaces it.
    fn each(
        &self,
        truth: &[Vec<DVec3>],
        ablation: Ablation,
        words: [&str; 3],
        other: &[Vec<DVec3>],
        seen: &[Vec<DVec3>],
    ) -> Vec<Row> {
        let row = |material: usize| {
            let (truth, other, seen) = (&truth[material], &other[material], &seen[material]);
            let changes =
                [(seen, other), (seen, truth), (other, truth)].map(|(a, b)| 100.0 * Accuracy::new(a, b, truth).mean);
            let subject = format!("{}, {}", self.name, MATERIALS[material].0);
            Row::new(Kind::Ball, &subject, ablation, words, changes)
        };
        (0..MATERIALS.len()).map(row).collect()
    }
}

fn maps(context: &Context, panorama: &Panorama, size: u32) -> Result<Stored> {
    let options = Options { face_size: size, ..Options::default() };
    let (levels, irradiance) = own_maps(&context.gpu, &LightMaps::new(context, panorama, options)?)?;
    Ok(Stored { levels, irradiance })
}

fn surfaces(material: usize, roughness: f64, grid: &Grid) -> impl Iterator<Item = Surface> {
    let (_, metallic, base_color) = MATERIALS[material];
    let (views, log2) = (grid.nv, grid.log2_normals);
    views.iter().flat_map(move |nv| {
        (0..1 << log2).map(move |i| {
            // Turned from view to view, so that all see different light.
            let u = hammersley(i, log2);
            let z = 1.0 - 2.0 * (u.x + 0.5 / f64::from(1 << log2));
            let (sin, cos) = (std::f64::consts::TAU * (u.y + nv)).sin_cos();
            let n = DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin);
            let v = *nv * n + (1.0 - nv * nv).sqrt() * n.any_orthonormal_vector();
            Surface { n, v, base_color, metallic, roughness }
        })
    })
}
