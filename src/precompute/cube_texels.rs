//! Cube maps read back from the GPU, and looked up as samplers do.

use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4, Vec4};
use half::f16;

use crate::Result;
use crate::gpu::{Gpu, Image, Subresource, read_image};
use crate::reference::cube::{cube_direction, cube_face};

/// One mip of a cube map: texels of a face's side, and radiance and alpha, face by face, rows from the top.
pub struct CubeTexels {
    pub size: u32,
    pub texels: Vec<[f32; 4]>,
}

impl CubeTexels {
    /// Reads one mip of a cube map in half floats that holds radiance / `scale`.
    pub fn read(gpu: &Arc<Gpu>, image: &Image, mip: u32, scale: f32) -> Result<Self> {
        let mut texels = Vec::new();
        for layer in 0..6 {
            let bytes = read_image(gpu, image, Subresource { mip, layer }, 8)?;
            let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
            let texel = |[r, g, b, alpha]: [f32; 4]| [r * scale, g * scale, b * scale, alpha];
            texels.extend(halves.iter().map(|t| texel(t.map(f16::to_f32))));
        }
        Ok(Self { size: image.mip_size(mip)[0], texels })
    }

    /// Of a column, row and face.
    pub fn at(&self, [x, y, face]: [u32; 3]) -> DVec4 {
        Vec4::from(self.texels[((face * self.size + y) * self.size + x) as usize]).as_dvec4()
    }

    /// Bilinear, as a sampler does, but with weights that are not rounded; across an edge, texels of the next face.
    pub fn look_up(&self, d: DVec3) -> DVec4 {
        let side = f64::from(self.size);
        let (face, st) = cube_face(d);
        let at = st * side - 0.5;
        let (low, part) = (at.floor(), at - at.floor());
        let texel = |x: f64, y: f64| {
            let (face, st) = cube_face(cube_direction(face, (low + DVec2::new(x, y) + 0.5) / side));
            let [x, y] = (st * side).to_array().map(|c| (c as u32).min(self.size - 1));
            self.at([x, y, face])
        };
        let row = |y: f64| texel(0.0, y).lerp(texel(1.0, y), part.x);
        row(0.0).lerp(row(1.0), part.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bilinear_lookups_are_continuous_across_edges_and_exact_at_centres() {
        let size = 8;
        let texel_direction = |[x, y, face]: [u32; 3], size: u32| {
            cube_direction(face, (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / f64::from(size))
        };
        let texels = (0..6)
            .flat_map(|face| (0..size).flat_map(move |y| (0..size).map(move |x| texel_direction([x, y, face], size))))
            .map(|d| (DVec3::ONE + 0.5 * d).extend(2.0 + d.x).as_vec4().to_array())
            .collect();
        let cube = CubeTexels { size, texels };
        for texel in [[0, 0, 0], [7, 3, 2], [4, 4, 5]] {
            let d = texel_direction(texel, size);
            assert!(cube.look_up(d).abs_diff_eq((DVec3::ONE + 0.5 * d).extend(2.0 + d.x), 1e-6));
        }
        // Over the edge between +X and +Y, in small steps.
        let mut last = cube.look_up(DVec3::new(1.0, 0.9, 0.13));
        for i in 1..=200 {
            let next = cube.look_up(DVec3::new(1.0, 0.9 + 0.001 * f64::from(i), 0.13));
            assert!(next.abs_diff_eq(last, 3e-3), "a step at {i}: {last} to {next}");
            last = next;
        }
        for d in [DVec3::new(1.0, 1.0, 0.99), DVec3::new(-0.3, 1.0, 0.98)] {
            assert!(cube.look_up(d).truncate().abs_diff_eq(DVec3::ONE + 0.5 * d.normalize(), 0.05), "at a corner");
        }
    }
}
