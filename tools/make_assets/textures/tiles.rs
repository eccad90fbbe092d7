//! Floor tiles: glazed octagons with small squares between them, in sunken grout. The square is 4 × 4 tiles of 15 cm.

use glam::{IVec2, Vec2};

use super::Surface;
use super::map::{colour, step};
use super::noise::{octaves, random};

const TILES: i32 = 4;
/// How far the small squares reach along the tiles' edges, in tiles.
const INSET: f32 = 0.24;
/// Half the grout's width, in tiles: 2 mm.
const GROUT: f32 = 0.014;
/// A tile stands this far above its grout.
const STEP_METRES: f32 = 0.0022;

pub fn at(uv: Vec2) -> Surface {
    let p = uv * TILES as f32;
    let cell = p.floor();
    let from_centre = (p - cell - 0.5).abs();
    // Signed distances to the edges, positive inside: the octagon is the cell less its four corners.
    let corner = (1.0 - from_centre.x - from_centre.y - INSET) * std::f32::consts::FRAC_1_SQRT_2;
    let octagon = (0.5 - from_centre.max_element()).min(corner);
    let square = -corner;
    let wobble = 0.002 * octaves(uv, IVec2::splat(24), 2, 3);
    let inside = octagon.max(square) - GROUT + wobble;
    let glazed = step(-0.004, 0.004, inside);
    let is_square = square > octagon;
    let id = if is_square { (p.round().as_ivec2()).rem_euclid(IVec2::splat(TILES)) + 64 } else { cell.as_ivec2() };

    let grain = octaves(uv, IVec2::splat(64), 3, 17);
    let cloud = octaves(uv, IVec2::splat(6), 5, id.x as u32 * 31 + id.y as u32 * 57 + 5);
    let vein = vein(uv, id);
    let light = 0.94 + 0.12 * random(id, 7);
    let body = if is_square {
        colour(0x1d4a4f) * (1.0 + 0.35 * cloud) * light
    } else {
        let base = colour(0xd9c9ab).lerp(colour(0xc8ae88), random(id, 8) * 0.7);
        let clouded = base.lerp(colour(0xa88560), step(0.0, 0.9, cloud) * 0.45);
        clouded.lerp(colour(0x8b6a49), vein * 0.55) * light
    };
    let dirt = step(0.05, 0.0, inside) * (0.6 + 0.4 * octaves(uv, IVec2::splat(12), 4, 23));
    let grout = colour(0x6f675b) * (1.0 + 0.25 * grain);
    let worn = step(0.1, 0.7, octaves(uv, IVec2::splat(5), 5, 41));

    let crown = step(0.0, 0.035, inside);
    let tilt = (p - cell - 0.5).dot(Vec2::new(random(id, 11), random(id, 12)) - 0.5) * 0.0012;
    let glaze = 0.00006 * octaves(uv, IVec2::splat(16), 3, 29);
    let tile_height = STEP_METRES * (0.72 + 0.28 * crown) + if is_square { 0.0 } else { tilt } + glaze;
    let grout_height = 0.0004 * (1.0 + 0.5 * grain);
    Surface {
        height: grout_height + (tile_height - grout_height) * glazed,
        albedo: grout.lerp(body * (1.0 - 0.3 * dirt), glazed),
        metallic: 0.0,
        roughness: 0.88 + ((0.16 + 0.2 * worn + 0.15 * dirt + 0.02 * grain) - 0.88) * glazed,
    }
}

/// Thin dark veins, different in each tile: where warped noise crosses zero.
fn vein(uv: Vec2, id: IVec2) -> f32 {
    let shift = Vec2::new(random(id, 13), random(id, 14));
    let warp = Vec2::new(octaves(uv, IVec2::splat(8), 4, 51), octaves(uv, IVec2::splat(8), 4, 52)) * 0.06;
    let n = octaves(uv + shift + warp, IVec2::splat(7), 4, 53);
    step(0.09, 0.0, n.abs()) * step(-0.2, 0.5, octaves(uv, IVec2::splat(9), 2, 54))
}
