//! What each approximation of the environment's light does to a sphere: in f64, one factor after the other swapped for its
//! exact version.

use glam::{DVec2, DVec3};
use half::f16;
use rayon::prelude::*;

use crate::asset::Panorama;
use crate::precompute::{Options, TABLE_SIZE};
use crate::reference::brdf::{DIELECTRIC_F0, Geometry};
use crate::reference::cube::{cube_direction, cube_face};
use crate::reference::energy::{Energy, Scattering};
use crate::reference::integrals::{PanoramaView, Surface, reflected};
use crate::reference::levels::{alpha_from_level, alpha_from_spread, level_from_spread};
use crate::reference::panorama_sums::prefiltered_around;
use crate::reference::sampling::hammersley;
use crate::reference::table::{Lobe, LobePart, table_arguments, table_entry, table_lobe, table_place};

const ROUGHNESSES: [f64; 5] = [0.2, 0.35, 0.5, 0.75, 1.0];
const COSINES: [f64; 4] = [0.95, 0.7, 0.4, 0.15];
/// Albedo and metalness: a dielectric and a metal.
const MATERIALS: [(f64, f64); 2] = [(0.5, 0.0), (0.9, 1.0)];

/// What is approximated, and by what; in the order of [`Parts`].
pub const CAUSES: [(&str, &str); 9] = [
    ("one lobe for the BRDF's", "split sum: F0 A + B times light around the lobe's mean vector"),
    ("along r instead", "classic split sum, n = v = r (--split-sum classic)"),
    ("ten levels", "two stored lobes mixed"),
    ("cube texels", "256² and coarser, bilinear"),
    ("half floats", "in the specular maps"),
    ("table", "128×96, bilinear"),
    ("diffuse by irradiance", "as if the cosine alone weighed light"),
    ("multiple scattering by irradiance", "likewise"),
    ("irradiance texels", "32², half floats, bilinear"),
];

/// Signed errors of one point's radiance, over that radiance.
pub type Parts = [f64; CAUSES.len()];

/// One point of a sphere.
struct Point {
    n: DVec3,
    v: DVec3,
    nv: f64,
    roughness: f64,
    albedo: f64,
    metallic: f64,
}

/// Errors at each point of spheres of all materials under a panorama, which counts as grey: `turns` views of each.
pub fn sweep(panorama: &Panorama, turns: u32) -> Vec<Parts> {
    points(turns).par_iter().filter_map(|point| parts(point, panorama)).collect()
}

fn points(turns: u32) -> Vec<Point> {
    let mut points = Vec::new();
    for (roughness, nv) in ROUGHNESSES.into_iter().flat_map(|r| COSINES.map(|nv| (r, nv))) {
        for (albedo, metallic) in MATERIALS {
            points.extend((0..turns).map(|i| {
                let u = hammersley(2 * i + 1, 6);
                let z = 1.0 - 2.0 * u.x;
                let (sin, cos) = (std::f64::consts::TAU * u.y).sin_cos();
                let n = DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin);
                let v = nv * n + (1.0 - nv * nv).sqrt() * n.any_orthonormal_vector();
                Point { n, v, nv, roughness, albedo, metallic }
            }));
        }
    }
    points
}

fn parts(point: &Point, panorama: &Panorama) -> Option<Parts> {
    let &Point { n, v, nv, roughness, albedo, metallic } = point;
    let Options { face_size, irradiance_size, .. } = Options::default();
    let geometry = Geometry::Smith;
    let view = PanoramaView::new(panorama.width, panorama.height, &panorama.texels)?;
    let surface = Surface { n, v, albedo: DVec3::splat(albedo), metallic, roughness };
    let all = reflected(view, &surface, geometry, Scattering::Multiple);
    let single = reflected(view, &surface, geometry, Scattering::Single).specular.x;
    let total = all.specular.x + all.diffuse.x;
    let f0 = DIELECTRIC_F0 + (albedo - DIELECTRIC_F0) * metallic;

    let light = |d: DVec3, alpha: f64| around(panorama, d, alpha);
    let exact = Direction::of(&table_lobe(nv, roughness, geometry), point, f0);
    let looked_up = Direction::of(&bilinear_lobe(nv, roughness, geometry), point, f0);
    let one_lobe = light(exact.towards, alpha_from_spread(exact.spread));
    let classic = light(2.0 * nv * n - v, roughness * roughness);
    let levels = mixed(exact, &light);
    let cube = |d: DVec3, level: usize, round: fn(f64) -> f64| {
        let size = (face_size >> (level / 2)).max(1);
        bilinear_cube(d, size, |d| round(light(d, alpha_from_level(level))))
    };
    let texels = mixed_levels(exact, |level| cube(exact.towards, level, |x| x));
    let halves = mixed_levels(exact, |level| cube(exact.towards, level, |x| f16::from_f64(x).to_f64()));

    let energy = Energy::new(roughness, geometry, Scattering::Multiple);
    let at_v = table_entry(nv, roughness, geometry);
    let albedo = DVec3::splat(albedo);
    let even = [energy.diffuse_even(albedo, metallic, at_v).x, energy.multiple_even(albedo, metallic, at_v).x];
    let irradiance = light(n, 1.0);
    let stored = bilinear_cube(n, irradiance_size, |d| f16::from_f64(light(d, 1.0)).to_f64());
    let errors = [
        exact.reflectance * one_lobe - single,
        exact.reflectance * classic - single,
        exact.reflectance * (levels - one_lobe),
        exact.reflectance * (texels - levels),
        exact.reflectance * (halves - texels),
        looked_up.reflectance * mixed(looked_up, &light) - exact.reflectance * levels,
        even[0] * irradiance - all.diffuse.x,
        even[1] * irradiance - (all.specular.x - single),
        (even[0] + even[1]) * (stored - irradiance),
    ];
    Some(errors.map(|error| error / total))
}

/// Where a lobe looks, and how much of it comes back.
#[derive(Clone, Copy)]
struct Direction {
    towards: DVec3,
    spread: f64,
    reflectance: f64,
}

impl Direction {
    fn of(lobe: &Lobe, point: &Point, f0: f64) -> Self {
        let [along, across] = lobe.mean(f0, point.nv);
        let r = 2.0 * point.nv * point.n - point.v;
        let mean = along * r + across * (point.n - point.nv * r).normalize_or_zero();
        let reflectance = f0 * lobe.base.weight + lobe.fresnel.weight;
        Self { towards: mean.normalize(), spread: 1.0 - mean.length(), reflectance }
    }
}

/// Mean radiance around d, of the first channel.
fn around(panorama: &Panorama, d: DVec3, alpha: f64) -> f64 {
    prefiltered_around(&[d], alpha, [panorama.width, panorama.height], &panorama.texels)[0].x
}

fn mixed(at: Direction, light: &impl Fn(DVec3, f64) -> f64) -> f64 {
    mixed_levels(at, |level| light(at.towards, alpha_from_level(level)))
}

/// Two levels as shaders mix them.
fn mixed_levels(at: Direction, level: impl Fn(usize) -> f64) -> f64 {
    let place = level_from_spread(at.spread);
    let (low, share) = (place.floor() as usize, place.fract());
    if share > 0.0 { level(low) * (1.0 - share) + level(low + 1) * share } else { level(low) }
}

/// Between the four nearest texels of a face of a cube of `size`² texels; beyond its edge, the edge's.
fn bilinear_cube(d: DVec3, size: u32, texel: impl Fn(DVec3) -> f64) -> f64 {
    let (face, st) = cube_face(d);
    let last = f64::from(size - 1);
    let at = (st * f64::from(size) - 0.5).clamp(DVec2::ZERO, DVec2::splat(last));
    let low = at.floor().min(DVec2::splat((last - 1.0).max(0.0)));
    let part = at - low;
    let value = |x: f64, y: f64| {
        let place = (low + DVec2::new(x, y)).min(DVec2::splat(last));
        texel(cube_direction(face, (place + 0.5) / f64::from(size)))
    };
    let row = |y| value(0.0, y) * (1.0 - part.x) + value(1.0, y) * part.x;
    row(0.0) * (1.0 - part.y) + row(1.0) * part.y
}

/// The table as a sampler reads it: between four texels, each what quadrature gives there.
fn bilinear_lobe(nv: f64, roughness: f64, geometry: Geometry) -> Lobe {
    let place = table_place(nv, roughness);
    let at: [f64; 2] = std::array::from_fn(|i| place[i] * f64::from(TABLE_SIZE[i] - 1));
    let low: [u32; 2] = std::array::from_fn(|i| (at[i] as u32).min(TABLE_SIZE[i] - 2));
    let part: [f64; 2] = std::array::from_fn(|i| at[i] - f64::from(low[i]));
    let texel = |x: u32, y: u32| {
        let [nv, roughness] = table_arguments([low[0] + x, low[1] + y], TABLE_SIZE);
        let lobe = table_lobe(nv, roughness, geometry);
        // Spreads are stored as their roots.
        [lobe.base, lobe.fresnel].map(|part| [part.weight, part.along.max(0.0).sqrt(), part.across_over_sine])
    };
    let corners = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
    let value = |lobe: usize, channel: usize| {
        let [a, b, c, d] = corners.map(|corner| corner[lobe][channel]);
        let (top, bottom) = (a + (b - a) * part[0], c + (d - c) * part[0]);
        top + (bottom - top) * part[1]
    };
    let part =
        |lobe| LobePart { weight: value(lobe, 0), along: value(lobe, 1).powi(2), across_over_sine: value(lobe, 2) };
    Lobe { base: part(0), fresnel: part(1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Over a few of the sweep's points.
    fn worst(panorama: &Panorama) -> Parts {
        let some = points(1).into_iter().step_by(7);
        let all: Vec<Parts> = some.filter_map(|point| parts(&point, panorama)).collect();
        assert_eq!(all.len(), (ROUGHNESSES.len() * COSINES.len() * MATERIALS.len()).div_ceil(7));
        std::array::from_fn(|cause| all.iter().map(|parts| parts[cause].abs()).fold(0.0, f64::max))
    }

    /// What approximates where light comes from cannot matter where it comes from everywhere alike.
    #[test]
    fn under_even_light_the_table_alone_is_off() {
        let worst = worst(&Panorama::from_fn(64, 32, |_| Vec3::ONE));
        for (cause, (name, _)) in CAUSES.iter().enumerate() {
            let bound = if *name == "half floats" { 1e-12 } else { 2e-3 };
            assert!(worst[cause] <= bound, "{name}: {}", worst[cause]);
        }
    }

    /// In linear light the matched moment leaves nothing, in contrast to the mirror direction.
    #[test]
    fn linear_light_is_the_classic_split_sum_s_error_alone() {
        let a = Vec3::new(0.5, 0.7, -0.2);
        let worst = worst(&Panorama::from_fn(128, 64, |d| Vec3::splat(1.0 + 0.9 * a.dot(d))));
        let of = |name: &str| worst[CAUSES.iter().position(|(cause, _)| *cause == name).expect("a cause")];
        for (name, bound) in [("one lobe for the BRDF's", 6e-3), ("ten levels", 6e-3), ("table", 2e-3)] {
            assert!(of(name) <= bound, "{name}: {}", of(name));
        }
        assert!(of("along r instead") > 10.0 * of("one lobe for the BRDF's"), "{}", of("along r instead"));
    }
}
