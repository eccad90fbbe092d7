//! Oiled walnut planks, grain along v. The square is 8 planks of about 16 cm, 1.25 m long.

use glam::{IVec2, Vec2};

use super::Surface;
use super::map::{colour, step};
use super::noise::{octaves, random};

const PLANKS: i32 = 8;

pub fn at(uv: Vec2) -> Surface {
    let across = uv.x * PLANKS as f32;
    let id = IVec2::new((across.floor() as i32).rem_euclid(PLANKS), 0);
    let from_edge = 0.5 - (across - across.floor() - 0.5).abs();
    let joint = step(0.016, 0.006, from_edge);
    // Every plank was sawn from another place of the log.
    let shift = Vec2::new(random(id, 1), random(id, 2));
    let along = uv + shift;
    let flow = octaves(along, IVec2::new(8, 1), 3, 3);
    let phase = across * 5.0 + flow * 2.2 + shift.x * 9.0;
    let ring = (phase - phase.floor()).powf(1.6) * step(1.0, 0.9, phase - phase.floor());
    let fibre = octaves(along, IVec2::new(110, 4), 3, 4);
    let pore = step(0.30, 0.75, octaves(along, IVec2::new(150, 9), 2, 5));
    let light = 0.82 + 0.36 * random(id, 6);
    let body = colour(0x8a5f3d).lerp(colour(0x54351f), ring * 0.75) * light;
    let body = body * (1.0 + 0.20 * fibre) * (1.0 - 0.35 * pore);
    Surface {
        height: 0.0008 * (1.0 - joint) + 0.00012 * fibre - 0.00025 * pore - 0.00005 * ring,
        albedo: body.lerp(colour(0x1d130c), joint),
        metallic: 0.0,
        roughness: 0.36 + 0.08 * ring + 0.06 * fibre + 0.15 * pore + 0.3 * joint,
    }
}
