//! Old bricks: running bond, worn edges, chips, sandy mortar. The square is 4 bricks by 8 courses, 50 cm wide.

use glam::{IVec2, Vec2};

use super::Surface;
use super::map::{colour, step};
use super::noise::{cells, octaves, random};

const BRICKS: IVec2 = IVec2::new(4, 8);
/// Bricks are twice as long as high; distances below are in brick heights (62.5 mm with its joint).
const LENGTH: f32 = 2.0;
const HALF_JOINT: f32 = 0.075;
const JOINT_DEPTH_METRES: f32 = 0.0065;

pub fn at(uv: Vec2) -> Surface {
    let warp = Vec2::new(octaves(uv, IVec2::splat(10), 4, 1), octaves(uv, IVec2::splat(10), 4, 2));
    let ragged = octaves(uv, IVec2::splat(28), 4, 3);
    let fine = octaves(uv, IVec2::splat(72), 3, 4);
    let p = uv * BRICKS.as_vec2() + warp * Vec2::new(0.012, 0.024);
    let course = p.y.floor();
    let shifted = Vec2::new(p.x + 0.5 * course.rem_euclid(2.0), p.y);
    let cell = shifted.floor();
    let id = cell.as_ivec2().rem_euclid(BRICKS);

    // Each brick has its own size and seat in the mortar.
    let seat = Vec2::new(random(id, 5) - 0.5, random(id, 6) - 0.5) * Vec2::new(0.05, 0.035);
    let local = (shifted - cell - 0.5) * Vec2::new(LENGTH, 1.0) + seat;
    let half = Vec2::new(LENGTH * 0.5, 0.5) - HALF_JOINT;
    let inside = rounded_box(local, half, 0.09) + 0.035 * ragged * (0.4 + random(id, 7));
    let chips = step(0.25, 0.65, octaves(uv, IVec2::splat(13), 4, 8)) * step(0.28, 0.0, inside) * 0.16;
    let inside = inside - chips;
    let brick = step(-0.02, 0.03, inside);

    let pores = step(0.22, 0.08, cells(uv, IVec2::splat(60), 9).nearest);
    let pitted = pores * step(-0.1, 0.5, octaves(uv, IVec2::splat(9), 3, 10));
    let stain = octaves(uv + warp * 0.02, IVec2::splat(6), 6, 11);
    let fired = random(id, 12);
    let body = if fired < 0.2 {
        colour(0x5f3a31).lerp(colour(0x463631), random(id, 13))
    } else if fired > 0.82 {
        colour(0xa07358).lerp(colour(0xad8468), random(id, 13))
    } else {
        colour(0x864738).lerp(colour(0x9c5c45), random(id, 13))
    };
    let mottled = body * (1.0 + 0.38 * stain + 0.18 * fine + 0.10 * ragged) * (1.0 - 0.45 * pitted);
    let lime = step(0.28, 0.85, octaves(uv + warp * 0.03, IVec2::splat(4), 6, 14) + 0.15 * ragged);
    let soot = step(0.2, 0.9, octaves(uv, IVec2::new(5, 3), 5, 15));
    let faced = mottled.lerp(colour(0xc9bcaa), lime * 0.45) * (1.0 - 0.45 * soot);
    let sand = octaves(uv, IVec2::splat(110), 2, 16);
    let mortar =
        colour(0x9c9080).lerp(colour(0x776c5f), step(-0.5, 0.6, stain)) * (1.0 + 0.28 * sand) * (1.0 - 0.3 * soot);

    let crown = step(0.0, 0.22, inside);
    let face = JOINT_DEPTH_METRES * (0.70 + 0.30 * crown) + (random(id, 17) - 0.5) * 0.0018;
    let face = face + 0.00030 * ragged + 0.00011 * fine + 0.0004 * stain - 0.0011 * pitted;
    let bed = 0.0010 + 0.0007 * octaves(uv, IVec2::splat(16), 4, 18) + 0.00012 * sand;
    Surface {
        height: bed + (face - bed) * brick,
        albedo: mortar.lerp(faced, brick),
        metallic: 0.0,
        roughness: 0.93 + ((0.80 + 0.06 * fine - 0.08 * soot + 0.08 * lime) - 0.93) * brick,
    }
}

/// Distance inside a box with rounded corners, positive inside.
fn rounded_box(p: Vec2, half: Vec2, radius: f32) -> f32 {
    let q = p.abs() - half + radius;
    radius - q.max(Vec2::ZERO).length() - q.max_element().min(0.0)
}
