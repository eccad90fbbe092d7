//! Importance sampling of a panorama: an alias table over cells of a grid, in the layout of `glsl/importance.glsl`.

use bytemuck::{Pod, Zeroable};

use super::cube::panorama_texel_solid_angle;

/// One cell of the grid.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Cell {
    /// Probability that this cell is taken and not its alias.
    pub threshold: f32,
    pub alias: u32,
    /// Probability density of samples in this cell, 1/sr.
    pub density: f32,
}

/// The table for `width · height` cells, each with the mean radiance of its part of a panorama, rows from the top.
///
/// Walker (1977), built with Vose's two lists ("A Linear Algorithm for Generating Random Numbers with a Given
/// Distribution" (1991)). The weight of a cell is its solid angle times its radiance with a share of its neighbours'
/// (radiance is interpolated between texel centres); a black panorama is sampled uniformly.
///
/// # Panics
/// If the number of texels does not match the size: a defect of the caller.
pub fn alias_table(size: [u32; 2], texels: &[[f32; 4]]) -> Vec<Cell> {
    let [width, height] = size.map(|s| s as usize);
    assert_eq!(texels.len(), width * height, "cells of another panorama");
    let weights = weights(size, texels);
    let total: f64 = weights.iter().sum();
    let chance = |i: usize| weights[i] / total;
    let count = weights.len();
    let mut cells: Vec<Cell> = (0..count)
        .map(|i| {
            let solid_angle = panorama_texel_solid_angle((i / width) as u32, size);
            Cell { threshold: 1.0, alias: i as u32, density: (chance(i) / solid_angle) as f32 }
        })
        .collect();
    let mut filled: Vec<f64> = (0..count).map(|i| chance(i) * count as f64).collect();
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
    fn chances(cells: &[Cell]) -> Vec<f64> {
        let mut chances = vec![0.0; cells.len()];
        for (i, cell) in cells.iter().enumerate() {
            chances[i] += f64::from(cell.threshold) / cells.len() as f64;
            chances[cell.alias as usize] += (1.0 - f64::from(cell.threshold)) / cells.len() as f64;
        }
        chances
    }

    #[test]
    fn the_probability_of_cells_matches_their_density() {
        let size = [16, 8];
        let mut texels: Vec<[f32; 4]> = (0..128).map(|i| [(i % 7) as f32, 0.5, 0.0, 1.0]).collect();
        texels[40] = [5e4, 5e4, 5e4, 1.0];
        let cells = alias_table(size, &texels);
        for (i, (cell, chance)) in cells.iter().zip(chances(&cells)).enumerate() {
            let want = f64::from(cell.density) * panorama_texel_solid_angle((i / 16) as u32, size);
            assert!((chance - want).abs() < 1e-7, "cell {i}: {chance} against {want}");
        }
        assert!(chances(&cells)[40] > 0.5);
    }

    #[test]
    fn a_black_panorama_is_sampled_uniformly() {
        let cells = alias_table([8, 4], &[[0.0; 4]; 32]);
        let even = 1.0 / (4.0 * std::f64::consts::PI);
        assert!(cells.iter().all(|c| (f64::from(c.density) / even - 1.0).abs() < 1e-6));
    }
}
