//! The demo scene's own pieces: a tiled slab, a brick plinth, a brick ball. Teapot and sphere come from their files.

use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DVec2, DVec3};

use super::obj::{Material, Obj};
use super::shapes::{Sheet, lathe};
use super::sphere;

/// One repeat of the brick texture is 4 bricks long.
const BRICK_REPEATS_PER_METRE: f64 = 2.0;
const TILE_REPEATS_PER_METRE: f64 = 1.0 / 0.6;

/// The slab's top is y = 0; the plinth stands at the origin, 0.125 m high; the ball to its right.
pub fn model() -> Obj {
    let mut obj = Obj::default();
    let (slab, plinth, courses) = (0.9, 0.2, 0.125);
    obj.object("slab", "floor-tiles");
    lid(&mut obj, slab, 0.0, TILE_REPEATS_PER_METRE);
    obj.object("slab edge", "old-bricks");
    walls(&mut obj, slab, -courses, 0.0);
    obj.object("plinth", "old-bricks");
    walls(&mut obj, plinth, 0.0, courses);
    lid(&mut obj, plinth, courses, BRICK_REPEATS_PER_METRE);
    obj.object("ball", "old-bricks");
    sphere::ball(&mut obj, DVec3::new(0.42, 0.13, 0.16), 0.13, 96, 49, DVec2::new(2.0, 1.0));
    obj.object("bowl", "copper");
    let at = DAffine3::from_translation(DVec3::new(0.2, 0.0, 0.45));
    lathe(&mut obj, at, &BOWL, 64, 4.0);
    obj
}

/// A level square around the y axis.
fn lid(obj: &mut Obj, half: f64, y: f64, repeats_per_metre: f64) {
    let corner = DVec3::new(-half, y, half);
    let (right, up) = (DVec3::X * 2.0 * half, DVec3::NEG_Z * 2.0 * half);
    Sheet { corner, right, up, uv_origin: DVec2::ZERO, repeats_per_metre }.build(obj, 8, 8);
}

/// Four upright brick faces around the y axis.
fn walls(obj: &mut Obj, half: f64, bottom: f64, top: f64) {
    for turn in 0..4 {
        let turned = DAffine3::from_rotation_y(f64::from(turn) * FRAC_PI_2);
        let sheet = Sheet {
            corner: turned.transform_point3(DVec3::new(-half, bottom, half)),
            right: turned.transform_vector3(DVec3::X * 2.0 * half),
            up: DVec3::Y * (top - bottom),
            uv_origin: DVec2::ZERO,
            repeats_per_metre: BRICK_REPEATS_PER_METRE,
        };
        sheet.build(obj, 8, 1);
    }
}

/// Outside from the foot to the lip, then back inside; (radius, y) in metres.
const BOWL: [[f64; 2]; 18] = [
    [0.0, 0.004],
    [0.030, 0.004],
    [0.032, 0.0],
    [0.036, 0.0],
    [0.038, 0.006],
    [0.055, 0.014],
    [0.072, 0.028],
    [0.083, 0.046],
    [0.088, 0.064],
    [0.089, 0.066],
    [0.088, 0.068],
    [0.086, 0.066],
    [0.080, 0.047],
    [0.069, 0.031],
    [0.053, 0.018],
    [0.036, 0.011],
    [0.018, 0.008],
    [0.0, 0.007],
];

/// Tiles, bricks, and polished copper (F0 from its complex index of refraction: linear 0.955, 0.638, 0.538).
pub fn materials() -> Vec<Material> {
    let mapped = |name| Material { name, albedo: [1.0; 3], metallic: 1.0, roughness: 1.0, maps: Some(name) };
    vec![
        mapped("floor-tiles"),
        mapped("old-bricks"),
        Material { name: "copper", albedo: [0.955, 0.638, 0.538], metallic: 1.0, roughness: 0.22, maps: None },
    ]
}
