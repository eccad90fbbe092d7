//! Importance sampling of a panorama: its cells in tiles, tiles drawn by their chance and cells of a tile by an alias table, in
//! the layout of `glsl/importance.glsl`. Chances of tiles may differ from place to place, by what of the sky is seen there.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::cube::panorama_texel_solid_angle;

/// Room for tiles: as many as 32 by 16.
pub const TILES: usize = 512;
/// Part of all samples that are drawn by the panorama alone, whatever was learned.
const UNLEARNED: f64 = 0.1;
/// Units of [`Tried::seen`].
pub const SEEN_STEPS: f64 = 63.0;

/// One cell of the grid.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Cell {
    /// Probability that this cell is taken and not its alias.
    pub threshold: f32,
    /// Counted in the tile, row by row.
    pub alias: u32,
    /// Probability density of the tile's samples in this cell, 1/sr.
    pub density: f32,
}

/// Rays towards a tile from points of one place, and what they met.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Tried {
    pub rays: u32,
    /// The sum of squared cosines at those points, of rays that met nothing, in 63rds.
    pub seen: u32,
}

/// A panorama's cells, and the chance of each tile of them.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportanceTable {
    pub size: [u32; 2],
    /// Cells along a side of a tile; those at the right and lower edge may be smaller.
    pub tile_side: u32,
    /// Rows from the top.
    pub cells: Vec<Cell>,
    /// The end of each tile's part of all random numbers of 32 bits.
    pub ends: Vec<u32>,
}

impl ImportanceTable {
    /// The table for `width · height` cells, each with the mean radiance of its part of a panorama, rows from the top.
    ///
    /// Walker (1977), built with Vose's two lists ("A Linear Algorithm for Generating Random Numbers with a Given
    /// Distribution" (1991)). The weight of a cell is its solid angle times its radiance with a share of its neighbours'
    /// (radiance is interpolated between texel centres); a black panorama is sampled uniformly.
    ///
    /// # Panics
    /// If the number of texels does not match the size: a defect of the caller.
    pub fn new(size: [u32; 2], texels: &[[f32; 4]]) -> Self {
        let [width, height] = size.map(|s| s as usize);
        assert_eq!(texels.len(), width * height, "cells of another panorama");
        let weights = weights(size, texels);
        let tile_side = size[0].div_ceil(32).max(size[1].div_ceil(16));
        let mut table = Self { size, tile_side, cells: vec![Cell::default(); weights.len()], ends: Vec::new() };
        let mut chances = Vec::new();
        for tile in 0..table.tiles() {
            let [columns, rows] = table.tile(tile);
            let indices: Vec<usize> =
                rows.flat_map(|y| columns.clone().map(move |x| y as usize * width + x as usize)).collect();
            let of_tile: Vec<f64> = indices.iter().map(|i| weights[*i]).collect();
            chances.push(of_tile.iter().sum());
            for ((index, mut cell), chance) in indices.iter().zip(alias_table(&of_tile)).zip(shares(&of_tile)) {
                cell.density = (chance / panorama_texel_solid_angle((index / width) as u32, size)) as f32;
                table.cells[*index] = cell;
            }
        }
        table.ends = ends(&chances);
        table
    }

    /// The number of tiles, at most [`TILES`].
    pub fn tiles(&self) -> u32 {
        let [across, down] = self.size.map(|cells| cells.div_ceil(self.tile_side));
        across * down
    }

    /// A tile's columns and rows of cells.
    fn tile(&self, tile: u32) -> [Range<u32>; 2] {
        let across = self.size[0].div_ceil(self.tile_side);
        let range = |at: u32, most: u32| at * self.tile_side..((at + 1) * self.tile_side).min(most);
        [range(tile % across, self.size[0]), range(tile / across, self.size[1])]
    }
}

/// The chance of a tile whose random numbers end there.
pub fn chance(ends: &[u32], tile: usize) -> f64 {
    let begin = if tile == 0 { 0 } else { ends[tile - 1] };
    f64::from(ends[tile] - begin) / f64::from(u32::MAX)
}

/// Ends of tiles at a place where these rays were tried, from the panorama's own.
///
/// Where samples of tiles differ by what is seen only, chances by the root of the mean square leave the least variance:
/// Owen, "Monte Carlo theory, methods and examples" (2013), section 9.1. A tile in which nothing was seen yet counts as if the next
/// ray met nothing.
pub fn learned_ends(panorama: &[u32], tried: &[Tried]) -> Vec<u32> {
    let even = |tile: usize| chance(panorama, tile);
    let worth = |tile: usize| even(tile) * seen_share(tried[tile]);
    let tiles = 0..panorama.len();
    let total: f64 = tiles.clone().map(worth).sum();
    let mixed: Vec<f64> = tiles
        .map(|tile| UNLEARNED * even(tile) + (1.0 - UNLEARNED) * worth(tile) / total.max(f64::MIN_POSITIVE))
        .collect();
    ends(&mixed)
}

/// How much samples of a tile are worth, 1 before any ray was tried.
pub fn seen_share(tried: Tried) -> f64 {
    let rays = f64::from(tried.rays);
    if tried.seen == 0 { 1.0 / (rays + 1.0) } else { (f64::from(tried.seen) / SEEN_STEPS / rays).sqrt() }
}

/// Ends of parts of all random numbers, [`TILES`] of them, the last ones empty.
fn ends(chances: &[f64]) -> Vec<u32> {
    let total: f64 = chances.iter().sum();
    let mut sum = 0.0;
    let mut ends = vec![u32::MAX; TILES];
    for (end, chance) in ends.iter_mut().zip(chances) {
        sum += chance / total;
        *end = (sum * f64::from(u32::MAX)).round() as u32;
    }
    let last = chances.iter().rposition(|chance| *chance > 0.0).unwrap_or(0);
    ends[last..].fill(u32::MAX);
    ends
}

fn shares(weights: &[f64]) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| if total > 0.0 { weight / total } else { 1.0 / weights.len() as f64 }).collect()
}

/// Cells without their densities.
fn alias_table(weights: &[f64]) -> Vec<Cell> {
    let count = weights.len();
    let mut cells: Vec<Cell> = (0..count).map(|i| Cell { threshold: 1.0, alias: i as u32, density: 0.0 }).collect();
    let mut filled: Vec<f64> = shares(weights).iter().map(|share| share * count as f64).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|i| filled[*i] < 1.0);
    while let (Some(&giver), Some(taker)) = (large.last(), small.pop()) {
        cells[taker].threshold = filled[taker] as f32;
        cells[taker].alias = giver as u32;
        filled[giver] -= 1.0 - filled[taker];
        if filled[giver] < 1.0 {
            large.pop();
            small.push(giver);
        }
    }
    cells
}

/// The weight of each cell; their sum is positive.
fn weights(size: [u32; 2], texels: &[[f32; 4]]) -> Vec<f64> {
    let [width, height] = size.map(|s| s as usize);
    let light = |x: usize, y: usize| texels[y * width + x][..3].iter().map(|c| f64::from(*c)).sum::<f64>();
    // A texel's integral of the linear interpolation between centres: 1/8, 3/4, 1/8 along each axis.
    let along = |x: usize, y: usize| {
        0.75 * light(x, y) + 0.125 * (light((x + width - 1) % width, y) + light((x + 1) % width, y))
    };
    let weigh = |i: usize| {
        let (x, y) = (i % width, i / width);
        let smooth = 0.75 * along(x, y) + 0.125 * (along(x, y.saturating_sub(1)) + along(x, (y + 1).min(height - 1)));
        (smooth, panorama_texel_solid_angle(y as u32, size))
    };
    let mut weights: Vec<f64> = (0..width * height).map(weigh).map(|(light, sr)| light * sr).collect();
    let total: f64 = weights.iter().sum();
    if !(total.is_finite() && total > 0.0) {
        weights = (0..width * height).map(|i| weigh(i).1).collect();
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The probability of each cell.
    fn chances(table: &ImportanceTable) -> Vec<f64> {
        let width = table.size[0];
        let mut chances = vec![0.0; table.cells.len()];
        for tile in 0..table.tiles() {
            let [columns, rows] = table.tile(tile);
            let index = |i: usize| {
                let [x, y] = [i % columns.len(), i / columns.len()].map(|i| i as u32);
                ((rows.start + y) * width + columns.start + x) as usize
            };
            let count = columns.len() * rows.len();
            let each = chance(&table.ends, tile as usize) / count as f64;
            for i in 0..count {
                let cell = table.cells[index(i)];
                chances[index(i)] += each * f64::from(cell.threshold);
                chances[index(cell.alias as usize)] += each * (1.0 - f64::from(cell.threshold));
            }
        }
        chances
    }

    /// Also where tiles do not fill the panorama evenly.
    #[test]
    fn the_probability_of_cells_matches_their_density() {
        for size in [[16, 8], [100, 50], [1, 1], [4, 4]] {
            let count = size[0] * size[1];
            let mut texels: Vec<[f32; 4]> = (0..count).map(|i| [(i % 7) as f32, 0.5, 0.0, 1.0]).collect();
            texels[count as usize / 3] = [5e4, 5e4, 5e4, 1.0];
            let table = ImportanceTable::new(size, &texels);
            let chances = chances(&table);
            assert!((chances.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            for tile in 0..table.tiles() {
                let [columns, rows] = table.tile(tile);
                let of_tile = chance(&table.ends, tile as usize);
                for (y, x) in rows.flat_map(|y| columns.clone().map(move |x| (y, x))) {
                    let i = (y * size[0] + x) as usize;
                    let want = of_tile * f64::from(table.cells[i].density) * panorama_texel_solid_angle(y, size);
                    assert!((chances[i] - want).abs() < 1e-7, "cell {i}: {} against {want}", chances[i]);
                }
            }
            assert!(chances[count as usize / 3] > 0.5 || count == 1);
        }
    }

    #[test]
    fn a_black_panorama_is_sampled_uniformly() {
        let table = ImportanceTable::new([8, 4], &[[0.0; 4]; 32]);
        for (i, chance) in chances(&table).iter().enumerate() {
            let even = panorama_texel_solid_angle(i as u32 / 8, [8, 4]) / (4.0 * std::f64::consts::PI);
            assert!((chance / even - 1.0).abs() < 1e-6, "cell {i}");
        }
    }

    #[test]
    fn tiles_that_are_seen_are_drawn() {
        let table = ImportanceTable::new([64, 32], &[[1.0; 4]; 2048]);
        let tiles = table.tiles() as usize;
        assert_eq!(tiles, TILES);
        let untried = learned_ends(&table.ends, &[Tried::default(); TILES]);
        assert!((0..tiles).all(|t| (chance(&untried, t) - chance(&table.ends, t)).abs() < 1e-8));
        let mut tried = [Tried { rays: 100_000, seen: 0 }; TILES];
        tried[200] = Tried { rays: 1000, seen: 63_000 };
        tried[201] = Tried { rays: 1000, seen: 630 };
        let ends = learned_ends(&table.ends, &tried);
        assert!(ends.is_sorted() && ends[TILES - 1] == u32::MAX);
        let total: f64 = (0..tiles).map(|t| chance(&ends, t)).sum();
        assert!((total - 1.0).abs() < 1e-9);
        // A tile that is seen in a hundredth of all tries has a tenth of the chance.
        let ratio = |a: usize, b: usize| {
            (chance(&ends, a) - 0.1 * chance(&table.ends, a)) / (chance(&ends, b) - 0.1 * chance(&table.ends, b))
        };
        assert!((ratio(200, 201) - 10.0).abs() < 0.01, "{}", ratio(200, 201));
        assert!(chance(&ends, 200) > 0.75, "{}", chance(&ends, 200));
        assert!((0..tiles).all(|t| chance(&ends, t) > 0.099 * chance(&table.ends, t)));
    }
}
