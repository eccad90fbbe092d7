//! Whether light reaches what cameras see, found by paths: a room with hardly an opening and no lamp is black, which looks like a
//! fault.

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::{Bvh, Hit};
use super::random_paths::{before, path_direction, random_direction};
use super::surroundings::normal;

/// Directions in which surfaces are looked for, how many are enough, and how many are too few to judge by.
const LOOKS: u32 = 16384;
const ENOUGH: usize = 48;
const TOO_FEW: usize = 8;
/// Paths from each surface, how often each is reflected, and by what part.
const PATHS: u32 = 256;
const REFLECTIONS: u32 = 6;
const ALBEDO: f32 = 0.5;
/// Part of the light of an open sky below which it is dark: six stops, which leaves white hardly lighter than black.
const DARK: f32 = 1.0 / 64.0;

/// What light does at a triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct TriangleLight {
    /// Cameras see through its back.
    pub culls_back: bool,
    /// It may let light through.
    pub is_open: bool,
    pub shines: bool,
}

/// Whether most of the surfaces that are seen from the cameras get almost no light, neither from afar nor from what shines. `of`
/// says what a triangle of the hierarchy is.
pub fn is_dark(bvh: &Bvh, cameras: &[Vec3], of: &(impl Fn(usize) -> TriangleLight + Sync)) -> bool {
    if cameras.is_empty() {
        return false;
    }
    let seen = |i: u32| {
        let (from, d) = (cameras[i as usize % cameras.len()], random_direction(i));
        let is_seen = |hit: &Hit| !(of(hit.triangle).culls_back && normal(bvh, hit).dot(d) > 0.0);
        let hit = bvh.trace(from, d, f32::INFINITY, is_seen)?;
        Some(before(bvh, from, d, &hit))
    };
    let places: Vec<(Vec3, Vec3)> = (0..LOOKS).filter_map(seen).take(ENOUGH).collect();
    let is_dark = |(i, place): (usize, &(Vec3, Vec3))| {
        let first = i as u32 * PATHS;
        let light: f32 = (first..first + PATHS).map(|path| light_of_path(bvh, *place, path, of)).sum();
        light < DARK * PATHS as f32
    };
    let dark = places.par_iter().enumerate().filter(|place| is_dark(*place)).count();
    places.len() >= TOO_FEW && 2 * dark > places.len()
}

/// What is left of the light on a path of diffuse reflections that leaves the scene, or meets something that shines.
fn light_of_path(bvh: &Bvh, start: (Vec3, Vec3), path: u32, of: &impl Fn(usize) -> TriangleLight) -> f32 {
    let (mut p, mut n) = start;
    let mut left = 1.0;
    for reflection in 0..=REFLECTIONS {
        let d = path_direction(Some(n), path * (REFLECTIONS + 1) + reflection);
        let Some(hit) = bvh.trace(p, d, f32::INFINITY, |hit| !of(hit.triangle).is_open) else { return left };
        if of(hit.triangle).shines {
            return left;
        }
        left *= ALBEDO;
        (p, n) = before(bvh, p, d, &hit);
    }
    0.0
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;
    use crate::scene::bvh::tests::mesh;
    use crate::scene::{Instance, Mesh};

    /// A box from -1 to 1 with its fronts inwards, without its last `open` triangles.
    fn room(open: usize) -> Mesh {
        let corners: Vec<Vec3> =
            (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0).collect();
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let mut indices: Vec<u32> = sides.iter().flat_map(|[a, b, c, d]| [*a, *c, *b, *a, *d, *c]).collect();
        indices.truncate(indices.len() - 3 * open);
        mesh(&corners, indices)
    }

    fn is_dark_from(camera: Vec3, open: usize, light: TriangleLight) -> bool {
        let place = Instance { mesh: 0, world_from_local: Mat4::IDENTITY };
        let bvh = Bvh::new(&[room(open)], &[place]).unwrap();
        is_dark(&bvh, &[camera], &|_| light)
    }

    #[test]
    fn a_closed_room_is_dark_and_one_with_an_opening_or_something_that_shines_is_not() {
        let none = TriangleLight::default();
        assert!(is_dark_from(Vec3::ZERO, 0, none));
        assert!(!is_dark_from(Vec3::ZERO, 1, none));
        assert!(!is_dark_from(Vec3::ZERO, 0, TriangleLight { shines: true, ..none }));
        assert!(!is_dark_from(Vec3::ZERO, 0, TriangleLight { is_open: true, ..none }));
    }

    #[test]
    fn from_outside_a_room_is_dark_where_one_looks_into_it() {
        let outside = Vec3::new(0.0, 0.0, 4.0);
        assert!(!is_dark_from(outside, 0, TriangleLight::default()));
        assert!(is_dark_from(outside, 0, TriangleLight { culls_back: true, ..TriangleLight::default() }));
        assert!(!is_dark_from(Vec3::splat(1e6), 0, TriangleLight { culls_back: true, ..TriangleLight::default() }));
    }
}
