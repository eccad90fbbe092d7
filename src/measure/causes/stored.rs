//! The maps that a pixel looks light up in, read back from the GPU.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::super::maps::read_cube;
use super::super::texels::Texel;
use crate::Result;
use crate::gpu::{Gpu, Image};
use crate::precompute::LightMaps;
use crate::reference::cube::{cube_direction, cube_face};
use crate::reference::levels::LEVELS;

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
