//! The thesis's sphere: 20,480 triangles, floor tiles wrapped around it.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::obj::{Material, Obj, Point};

const SLICES: usize = 160;
const STACKS: usize = 65;
const RADIUS_METRES: f64 = 0.5;

/// A ball around the origin with cylindrical UVs: the texture goes four times around and twice from pole to pole.
pub fn model() -> Obj {
    let mut obj = Obj::default();
    obj.object("sphere", "floor-tiles");
    ball(&mut obj, DVec3::ZERO, RADIUS_METRES, SLICES, STACKS, DVec2::new(4.0, 2.0));
    obj
}

/// A latitude–longitude sphere of 2 · slices · (stacks − 1) triangles.
///
/// The corner at a pole takes the u of its triangle's middle: a shared one would smear the texture across the slice.
pub fn ball(obj: &mut Obj, centre: DVec3, radius: f64, slices: usize, stacks: usize, repeats: DVec2) {
    let at = |u: f64, v: f64| {
        let (longitude, latitude) = (u * TAU, (v - 0.5) * PI);
        let normal = DVec3::new(longitude.sin() * latitude.cos(), latitude.sin(), longitude.cos() * latitude.cos());
        Point { position: centre + normal * radius, normal, uv: DVec2::new(u, v) * repeats }
    };
    for j in 0..stacks {
        let (south, north) = (j as f64 / stacks as f64, (j + 1) as f64 / stacks as f64);
        for i in 0..slices {
            let (west, east) = (i as f64 / slices as f64, (i + 1) as f64 / slices as f64);
            let middle = (west + east) * 0.5;
            match j {
                0 => obj.triangle([at(middle, south), at(east, north), at(west, north)]),
                _ if j + 1 == stacks => obj.triangle([at(west, south), at(east, south), at(middle, north)]),
                _ => {
                    obj.triangle([at(west, south), at(east, south), at(east, north)]);
                    obj.triangle([at(west, south), at(east, north), at(west, north)]);
                }
            }
        }
    }
}

/// Floor tiles.
pub fn materials() -> Vec<Material> {
    vec![Material { name: "floor-tiles", albedo: [1.0; 3], metallic: 1.0, roughness: 1.0, maps: Some("floor-tiles") }]
}
