//! Oxidised gold: hammered gold under tarnish, with green patina in the hollows. The square is 18 cm wide.
//!
//! Gold's F0 is linear (1.0, 0.78, 0.34), from its complex index of refraction; patina is a dielectric powder.

use glam::{IVec2, Vec2, Vec3};

use super::Surface;
use super::map::{colour, step};
use super::noise::{cells, octaves};

const GOLD: Vec3 = Vec3::new(1.0, 0.78, 0.34);

pub fn at(uv: Vec2) -> Surface {
    let warp = Vec2::new(octaves(uv, IVec2::splat(5), 4, 1), octaves(uv, IVec2::splat(5), 4, 2));
    let dents = cells(uv + warp * 0.02, IVec2::splat(16), 3);
    // Each hammer blow leaves a shallow bowl; between two bowls stays a ridge.
    let bowl = 1.0 - dents.nearest.min(1.0);
    let ridge = step(0.35, 0.0, dents.second - dents.nearest);
    let broad = octaves(uv + warp * 0.05, IVec2::splat(3), 6, 5);
    let fine = octaves(uv, IVec2::splat(48), 4, 7);
    let blotches = octaves(uv + warp * 0.03, IVec2::splat(9), 6, 9);

    // Patina grows in patches, first in the hollows, and is rubbed off the ridges.
    let growth = broad * 0.9 + blotches * 0.6 + bowl * 0.10 - ridge * 0.12 + fine * 0.16;
    let patina = step(0.36, 0.48, growth);
    let tarnish = step(-0.45, 0.40, growth);
    let pits = step(0.20, 0.12, cells(uv, IVec2::splat(70), 11).nearest) * step(0.1, 0.5, blotches);

    let scratch = scratches(uv + warp * 0.012) * step(-0.3, 0.6, blotches);
    let metal = GOLD.lerp(colour(0xb9803f), tarnish * 0.75).lerp(colour(0x6e4420), tarnish * tarnish * 0.5);
    let metal = metal * (1.0 - 0.45 * pits) * (1.0 + 0.04 * fine - 0.05 * scratch);
    let powder = colour(0x3f7f6e).lerp(colour(0x84b59b), step(-0.4, 0.7, fine + 0.5 * blotches));
    let powder = powder.lerp(colour(0x3a3527), step(0.1, 0.8, octaves(uv, IVec2::splat(14), 4, 13)) * 0.75);

    let polish = 0.17 + 0.06 * (octaves(uv, IVec2::splat(7), 5, 15) * 0.5 + 0.5) + 0.05 * scratch + 0.03 * ridge;
    let metal_roughness = polish + 0.25 * tarnish + 0.2 * pits;
    Surface {
        height: -0.00035 * bowl * bowl + 0.00010 * ridge * ridge + 0.00014 * patina * (1.0 + 0.8 * fine)
            - 0.00010 * pits
            + 0.000008 * fine
            - 0.000004 * scratch
            + 0.0006,
        albedo: metal.lerp(powder, patina),
        metallic: 1.0 - patina,
        roughness: metal_roughness + (0.80 + 0.08 * fine - metal_roughness) * patina,
    }
}

/// Fine polishing marks in two directions, 0..1.
fn scratches(uv: Vec2) -> f32 {
    let across = octaves(uv, IVec2::new(6, 150), 1, 21).max(octaves(uv, IVec2::new(130, 5), 1, 22));
    step(0.35, 0.8, across)
}
