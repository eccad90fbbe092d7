//! The furnace as a picture: white balls on white, roughness by metalness, scattering once on the left, as often as it takes
//! on the right.

use std::sync::Arc;

use font8x8::legacy::BASIC_LEGACY;
use glam::{Mat4, Vec3};

use super::ball::ball;
use super::furnace::{WAYS, draw, in_furnace, white};
use crate::Result;
use crate::asset::picture::{Kind, Picture};
use crate::gpu::Gpu;
use crate::scene::{Instance, Scene};

const COLUMNS: usize = 11;
const LINES: usize = 6;
/// Pixels of a ball's place.
const CELL: usize = 42;
/// Pixels left of each grid, between the lines of text, above and below.
const MARGIN: usize = 34;
/// What is shown as black and as white: the contrast is stretched.
const SHOWN: [f32; 2] = [0.5, 1.05];
const INK: f32 = 0.0;
/// Behind text, and in front of the light: paper.
const PAPER: f32 = 1.0;

/// Draws both grids and writes beside them what they are.
pub fn make(gpu: &Arc<Gpu>) -> Result<Picture> {
    let scene = balls();
    let grid = [COLUMNS * CELL, LINES * CELL];
    let size = [2 * (grid[0] + MARGIN) + 4, grid[1] + 2 * MARGIN];
    let mut canvas = WindowPresenter { size, values: vec![PAPER; size[0] * size[1]] };
    for (i, (scattering, title)) in WAYS.into_iter().zip(["scattered once", "scattered as often as needed"]).enumerate()
    {
        let radiance = draw(gpu, &scene, grid.map(|s| s as u32), 4, scattering)?;
        let [x, y] = [MARGIN + i * (grid[0] + MARGIN), MARGIN];
        for (j, pixel) in radiance.iter().enumerate() {
            let value = (pixel[0] - SHOWN[0]) / (SHOWN[1] - SHOWN[0]);
            canvas.values[(y + j / grid[0]) * size[0] + x + j % grid[0]] = value.clamp(0.0, 1.0);
        }
        canvas.text([x, 12], title);
        canvas.text([x, y + grid[1] + 8], "roughness 0");
        canvas.text([x + grid[0] - 24, y + grid[1] + 8], "1.0");
        canvas.text([x - 28, y + CELL / 2], "0.0");
        canvas.text([x - 28, y + grid[1] - CELL / 2], "1.0");
        canvas.text([x + grid[0] / 2 - 84, y + grid[1] + 8], "metalness downwards");
    }
    let shown = format!("black: {}, white: {} of the light", SHOWN[0], SHOWN[1]);
    canvas.text([MARGIN + grid[0] - 8 * shown.len(), 12], &shown);
    let pixels = canvas.values.into_iter().map(|value| [value; 3]).collect();
    let [width, height] = size.map(|s| s as u32);
    Ok(Picture { name: "furnace".into(), width, height, kind: Kind::Display, pixels })
}

/// Balls of diameter 0.9 in cells of side 1, the first at the upper left, at the origin.
fn balls() -> Scene {
    let (mut meshes, mut instances, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for line in 0..LINES {
        for column in 0..COLUMNS {
            let share = |i: usize, count: usize| i as f32 / (count - 1) as f32;
            let at = Vec3::new(column as f32 + 0.5, -(line as f32 + 0.5), 0.0);
            let world_from_local = Mat4::from_translation(at) * Mat4::from_scale(Vec3::splat(0.45));
            instances.push(Instance { mesh: meshes.len(), world_from_local });
            meshes.push(ball([48, 48], materials.len()));
            materials.push(white(share(line, LINES), share(column, COLUMNS)));
        }
    }
    in_furnace(meshes, instances, materials)
}

/// Grey values, rows from the top.
struct WindowPresenter {
    size: [usize; 2],
    values: Vec<f32>,
}

impl WindowPresenter {
    /// Writes ASCII with its first letter's upper left corner at `at`; what does not fit is cut.
    fn text(&mut self, at: [usize; 2], text: &str) {
        for (i, character) in text.bytes().enumerate() {
            let glyph = BASIC_LEGACY.get(usize::from(character)).copied().unwrap_or_default();
            for (y, row) in glyph.iter().enumerate() {
                for x in (0..8).filter(|x| row >> x & 1 == 1) {
                    let [x, y] = [at[0] + 8 * i + x, at[1] + y];
                    if x < self.size[0] && y < self.size[1] {
                        self.values[y * self.size[0] + x] = INK;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::precompute::harness_tests::with_gpu;

    /// The grid on the right is as white as what is behind it; on the left the last ball of rough metal is not.
    #[test]
    fn balls_are_seen_on_the_left_alone() {
        let picture = with_gpu(|gpu| make(gpu).unwrap());
        let behind = (1.0 - SHOWN[0]) / (SHOWN[1] - SHOWN[0]);
        let centre = |grid: usize, column: usize, line: usize| {
            let x = MARGIN + grid * (COLUMNS * CELL + MARGIN) + column * CELL + CELL / 2;
            picture.pixels[(MARGIN + line * CELL + CELL / 2) * picture.width as usize + x][0]
        };
        for line in 0..LINES {
            for column in 0..COLUMNS {
                assert!((centre(1, column, line) - behind).abs() < 0.01, "{column}, {line}");
            }
        }
        assert!(centre(0, COLUMNS - 1, LINES - 1) < 0.5 * behind);
    }
}
