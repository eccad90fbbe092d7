//! What a pixel looks light up in, read back from the GPU: the maps' texels and the split sum's table.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::super::maps::read_cube;
use super::super::texels::Texel;
use crate::Result;
use crate::gpu::{Gpu, Image, Part, read_image};
use crate::precompute::{BrdfTable, LightMaps};
use crate::reference::cube::{cube_direction, cube_face};
use crate::reference::levels::LEVELS;
use crate::reference::table::{Entry, Lobe, LobePart, table_place};

/// One mip of a cube map: texels of a face's side, and radiance, face by face, rows from the top.
pub struct Cube {
    pub size: u32,
    texels: Vec<[f32; 3]>,
}

impl Cube {
    fn read(gpu: &Arc<Gpu>, image: &Image, mip: u32, scale: f32) -> Result<Self> {
        let texels = read_cube(gpu, image, mip, scale)?;
        Ok(Self { size: image.mip_size(mip)[0], texels })
    }

    /// Bilinear, as a sampler does, with weights that are not rounded.
    pub fn look_up(&self, d: DVec3) -> DVec3 {
        let at =
            |[x, y, face]: Texel| Vec3::from(self.texels[((face * self.size + y) * self.size + x) as usize]).as_dvec3();
        bilinear(d, self.size).into_iter().map(|(texel, weight)| weight * at(texel)).sum()
    }
}

/// The four texels around where a direction meets a cube, and their weights; across an edge, those of the next face.
pub fn bilinear(d: DVec3, size: u32) -> [(Texel, f64); 4] {
    let side = f64::from(size);
    let (face, st) = cube_face(d);
    let at = st * side - 0.5;
    let (low, part) = (at.floor(), at - at.floor());
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| {
        let weight = |right: f64, part: f64| if right > 0.0 { part } else { 1.0 - part };
        (texel_of(face, (low + DVec2::new(x, y) + 0.5) / side, size), weight(x, part.x) * weight(y, part.y))
    })
}

/// The texel that holds a point of a face, which may lie half a texel beyond the face's edge.
fn texel_of(face: u32, st: DVec2, size: u32) -> Texel {
    let (face, st) = cube_face(cube_direction(face, st));
    let [x, y] = (st * f64::from(size)).to_array().map(|c| (c as u32).min(size - 1));
    [x, y, face]
}

/// What the table says at n·v and a roughness.
#[derive(Clone, Copy, Debug)]
pub struct TableAt {
    pub lobe: Lobe,
    /// Both albedos averaged over directions.
    pub mean: Entry,
}

/// The GPU's table: two layers of texels.
pub struct Table {
    layers: [Vec<[f32; 4]>; 2],
    size: [usize; 2],
}

impl Table {
    /// Reads it back.
    pub fn read(gpu: &Arc<Gpu>, table: &BrdfTable) -> Result<Self> {
        let layer =
            |layer| Ok(bytemuck::pod_collect_to_vec(&read_image(gpu, &table.image, Part { mip: 0, layer }, 16)?));
        Ok(Self { layers: [layer(0)?, layer(1)?], size: table.image.desc().size.map(|side| side as usize) })
    }

    /// Bilinear between texels, as `glsl/environment.glsl` reads it.
    pub fn look_up(&self, nv: f64, roughness: f64) -> TableAt {
        let place = table_place(nv, roughness);
        let at: [f64; 2] = std::array::from_fn(|i| place[i].clamp(0.0, 1.0) * (self.size[i] - 1) as f64);
        let low: [usize; 2] = std::array::from_fn(|i| (at[i] as usize).min(self.size[i] - 2));
        let [u, v] = std::array::from_fn(|i| at[i] - low[i] as f64);
        let value = |layer: usize, channel: usize| {
            let texel =
                |x: usize, y: usize| f64::from(self.layers[layer][(low[1] + y) * self.size[0] + low[0] + x][channel]);
            let row = |y| texel(0, y) * (1.0 - u) + texel(1, y) * u;
            row(0) * (1.0 - v) + row(1) * v
        };
        let part =
            |i: usize| LobePart { weight: value(0, i), along: value(0, 2 + i).powi(2), across_over_sine: value(1, i) };
        let mean = Entry { scale: value(1, 2), bias: value(1, 3) };
        TableAt { lobe: Lobe { base: part(0), fresnel: part(1) }, mean }
    }
}

/// All maps of one panorama.
pub struct Stored {
    /// The mirror's level first.
    pub levels: Vec<Cube>,
    /// Irradiance / π.
    pub irradiance: Cube,
    /// Maps hold radiance / this.
    pub scale: f64,
}

impl Stored {
    /// Reads them back.
    pub fn read(gpu: &Arc<Gpu>, light: &LightMaps) -> Result<Self> {
        let level = |level: usize| Cube::read(gpu, &light.specular[level % 2], (level / 2) as u32, light.scale);
        Ok(Self {
            levels: (0..LEVELS).map(level).collect::<Result<_>>()?,
            irradiance: Cube::read(gpu, &light.irradiance_over_pi, 0, light.scale)?,
            scale: f64::from(light.scale),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::texels::texel_direction;
    use super::*;

    #[test]
    fn bilinear_lookups_are_continuous_across_edges_and_exact_at_centres() {
        let size = 8;
        let texels = (0..6)
            .flat_map(|face| (0..size).flat_map(move |y| (0..size).map(move |x| texel_direction([x, y, face], size))))
            .map(|d| (DVec3::ONE + 0.5 * d).as_vec3().to_array())
            .collect();
        let cube = Cube { size, texels };
        for texel in [[0, 0, 0], [7, 3, 2], [4, 4, 5]] {
            let d = texel_direction(texel, size);
            assert!(cube.look_up(d).abs_diff_eq(DVec3::ONE + 0.5 * d, 1e-6));
        }
        // Over the edge between +X and +Y, in small steps.
        let mut last = cube.look_up(DVec3::new(1.0, 0.9, 0.13));
        for i in 1..=200 {
            let next = cube.look_up(DVec3::new(1.0, 0.9 + 0.001 * f64::from(i), 0.13));
            assert!(next.abs_diff_eq(last, 3e-3), "a step at {i}: {last} to {next}");
            last = next;
        }
        for d in [DVec3::new(1.0, 1.0, 0.99), DVec3::new(-0.3, 1.0, 0.98)] {
            let sum: f64 = bilinear(d, size).iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-12);
            assert!(cube.look_up(d).abs_diff_eq(DVec3::ONE + 0.5 * d.normalize(), 0.05));
        }
    }
}
