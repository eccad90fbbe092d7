//! The furnace as a picture: two grids of white balls on white, roughness 0 to 1 to the right, metalness 0 to 1 downwards; on the
//! left light scatters once, on the right as often as it takes. Black is 0.5 of the light, white 1.05.

use glam::{Mat4, Vec3};

use super::scene::{bench, in_furnace, share};
use crate::Result;
use crate::asset::picture::{Kind, Picture};
use crate::context::Context;
use crate::reference::energy::Scattering;
use crate::render::{LightModel, RenderSettings};
use crate::scene::{Instance, Material, Mesh, Scene};

const COLUMNS: usize = 11;
const LINES: usize = 6;
/// Pixels of a ball's cell, and between the grids.
const CELL: usize = 42;
const GAP: usize = 12;
const WIDTH: usize = COLUMNS * CELL;
const SHOWN: [f32; 2] = [0.5, 1.05];

/// Draws both grids.
pub fn draw(context: &Context) -> Result<Picture> {
    let [width, height] = [2 * WIDTH + GAP, LINES * CELL];
    let mut pixels = vec![[1.0; 3]; width * height];
    for (i, scattering) in [Scattering::Single, Scattering::Multiple].into_iter().enumerate() {
        let settings = RenderSettings { scattering, light: LightModel::Open, ..RenderSettings::default() };
        let mut bench = bench(context, &balls(), [WIDTH as u32, height as u32], settings)?;
        bench.draw()?;
        for (j, radiance) in bench.radiance()?.iter().enumerate() {
            let value = (radiance.x - SHOWN[0]) / (SHOWN[1] - SHOWN[0]);
            pixels[j / WIDTH * width + i * (WIDTH + GAP) + j % WIDTH] = [value.clamp(0.0, 1.0); 3];
        }
    }
    let [width, height] = [width as u32, height as u32];
    Ok(Picture { name: "furnace".into(), width, height, kind: Kind::Display, pixels })
}

/// Balls of diameter 0.9 in cells of side 1, the first at the upper left, at the origin.
fn balls() -> Scene {
    let (mut meshes, mut instances, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for (line, column) in (0..LINES).flat_map(|line| (0..COLUMNS).map(move |column| (line, column))) {
        let at = Vec3::new(column as f32 + 0.5, -(line as f32 + 0.5), 0.0);
        let world_from_local = Mat4::from_translation(at) * Mat4::from_scale(Vec3::splat(0.45));
        instances.push(Instance { mesh: meshes.len(), world_from_local });
        meshes.push(Mesh { material: materials.len(), ..Mesh::ball(48, 1.0) });
        materials.push(Material::plain("white", Vec3::ONE, share(line, LINES), share(column, COLUMNS)));
    }
    in_furnace(meshes, instances, materials)
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::precompute::harness_tests::with_gpu;

    /// The grid on the right is as white as what is behind it; on the left the last ball of rough metal is not.
    #[test]
    fn balls_are_seen_on_the_left_only() {
        let picture = with_gpu(|gpu| draw(&Context::silent(gpu)).unwrap());
        let behind = (1.0 - SHOWN[0]) / (SHOWN[1] - SHOWN[0]);
        let middle = |grid: usize, column: usize, line: usize| {
            let x = grid * (WIDTH + GAP) + column * CELL + CELL / 2;
            picture.pixels[(line * CELL + CELL / 2) * picture.width as usize + x][0]
        };
        for (line, column) in (0..LINES).flat_map(|line| (0..COLUMNS).map(move |column| (line, column))) {
            assert!((middle(1, column, line) - behind).abs() < 0.01, "{column}, {line}");
        }
        assert!(middle(0, COLUMNS - 1, LINES - 1) < 0.5 * behind);
    }
}
