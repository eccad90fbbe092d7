//! Periodic noise: gradient noise, its octaves, and cells; the same numbers on every run.

use glam::{IVec2, Vec2};

/// A well-mixed number for a lattice point (Jarzynski and Olano, "Hash Functions for GPU Rendering", 2020: PCG).
fn hash(cell: IVec2, seed: u32) -> u32 {
    let pcg = |x: u32| {
        let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    };
    pcg(pcg(pcg(cell.x as u32) ^ cell.y as u32) ^ seed)
}

/// A number in 0..1 for a lattice point.
pub fn random(cell: IVec2, seed: u32) -> f32 {
    (hash(cell, seed) >> 8) as f32 / (1 << 24) as f32
}

/// Gradient noise with unit cells (Perlin, "Improving Noise", 2002), about −1..1, repeating after `period` cells.
pub fn gradient(p: Vec2, period: IVec2, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let corner = |offset: IVec2| {
        let angle = random((cell.as_ivec2() + offset).rem_euclid(period), seed) * std::f32::consts::TAU;
        Vec2::from_angle(angle).dot(f - offset.as_vec2())
    };
    let t = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let bottom = corner(IVec2::ZERO) + (corner(IVec2::X) - corner(IVec2::ZERO)) * t.x;
    let top = corner(IVec2::Y) + (corner(IVec2::ONE) - corner(IVec2::Y)) * t.x;
    (bottom + (top - bottom) * t.y) * 1.5
}

/// Octaves of gradient noise over the unit square, each twice as fine and half as strong; about −1..1.
pub fn octaves(uv: Vec2, cells: IVec2, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..octaves {
        let cells = cells * (1 << octave);
        sum += weight * gradient(uv * cells.as_vec2(), cells, seed.wrapping_add(octave * 101));
        total += weight;
        weight *= 0.5;
    }
    sum / total * 1.4
}

/// The two nearest of one scattered point per cell (Worley, "A Cellular Texture Basis Function", 1996).
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// Distance to the nearest, in cells.
    pub nearest: f32,
    /// Distance to the second.
    pub second: f32,
}

/// Cell noise over the unit square, cut into `cells`.
pub fn cells(uv: Vec2, cells: IVec2, seed: u32) -> Cells {
    let p = uv * cells.as_vec2();
    let home = p.floor().as_ivec2();
    let mut found = Cells { nearest: f32::MAX, second: f32::MAX };
    for y in -1..=1 {
        for x in -1..=1 {
            let cell = home + IVec2::new(x, y);
            let wrapped = cell.rem_euclid(cells);
            let jitter = Vec2::new(random(wrapped, seed), random(wrapped, seed ^ 0x9e37_79b9));
            let distance = (cell.as_vec2() + jitter).distance(p);
            if distance < found.nearest {
                found = Cells { nearest: distance, second: found.nearest };
            } else {
                found.second = found.second.min(distance);
            }
        }
    }
    found
}
