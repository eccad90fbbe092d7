//! Lime plaster, smoothed by hand and a little uneven. The square is 2 m wide.

use glam::{IVec2, Vec2};

use super::Surface;
use super::map::{colour, step};
use super::noise::octaves;

pub fn at(uv: Vec2) -> Surface {
    let warp = Vec2::new(octaves(uv, IVec2::splat(4), 3, 1), octaves(uv, IVec2::splat(4), 3, 2));
    let trowel = octaves(uv + warp * 0.04, IVec2::new(5, 8), 4, 3);
    let broad = octaves(uv, IVec2::splat(3), 4, 4);
    let grain = octaves(uv, IVec2::splat(90), 2, 5);
    let ridge = step(0.12, 0.0, trowel.abs());
    let tone = colour(0xe3d9c6).lerp(colour(0xcfc1a8), step(-0.5, 0.7, broad + 0.4 * trowel));
    Surface {
        height: 0.004 + 0.0011 * trowel + 0.0003 * ridge + 0.00035 * grain,
        albedo: tone * (1.0 + 0.05 * grain - 0.05 * ridge),
        metallic: 0.0,
        roughness: 0.80 + 0.05 * grain - 0.06 * ridge,
    }
}
