//! Panoramas that are hard to prefilter, and how far maps are from the sums in f64.

use std::fmt;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use half::f16;
use pbr_vr::asset::Panorama;
use pbr_vr::gpu::{Gpu, Image, Subresource, read_image};
use pbr_vr::reference::cube::{cube_direction, cube_face};
use pbr_vr::reference::panorama_sums::prefiltered_around;

/// A number in [0, 1) that depends on a direction to about a quarter of a degree.
fn noise(d: Vec3) -> f32 {
    let [x, y, z] = (d * 256.0).floor().to_array().map(|c| c as i32 as u32);
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ z.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    (h >> 8) as f32 / 16_777_216.0
}

/// Sky above checkers, noise on both, windows of 22 nit, and perhaps a sun of 1° radius at 2000.
pub fn panorama(width: u32, sun: bool) -> Panorama {
    let to_sun = Vec3::new(0.5, 0.6, -0.62).normalize();
    Panorama::from_fn(width, width / 2, |d| {
        if sun && d.dot(to_sun) > 1f32.to_radians().cos() {
            return Vec3::new(2000.0, 1900.0, 1700.0);
        }
        let azimuth = d.z.atan2(d.x).to_degrees().rem_euclid(60.0);
        let elevation = d.y.asin().to_degrees();
        if azimuth < 8.0 && (10.0..22.0).contains(&elevation) {
            return Vec3::new(22.0, 20.0, 17.0);
        }
        let base = if d.y > 0.0 {
            Vec3::new(0.4, 0.6, 1.0).lerp(Vec3::ONE, 1.0 - d.y)
        } else {
            let p = d / d.y.min(-0.02);
            let light = ((p.x * 2.0).floor() + (p.z * 2.0).floor()).rem_euclid(2.0);
            Vec3::new(0.5, 0.4, 0.3) * (0.1 + 0.9 * light)
        };
        base * (0.5 + noise(d))
    })
}

/// All faces of one mip of a cube map of halves, rows from the top.
pub fn read_cube(gpu: &Arc<Gpu>, image: &Image, mip: u32) -> Vec<DVec3> {
    let face = |layer| {
        let bytes = read_image(gpu, image, Subresource { mip, layer }, 8).expect("a face");
        let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        halves.into_iter().map(|[r, g, b, _]| DVec3::new(r.to_f64(), g.to_f64(), b.to_f64()))
    };
    (0..6).flat_map(face).collect()
}

/// Directions of a cube's texels, in the order of `read_cube`.
pub fn texel_directions(cube: &[DVec3]) -> impl Iterator<Item = DVec3> + use<> {
    let size = (cube.len() as f64 / 6.0).sqrt().round() as u32;
    (0..cube.len() as u32).map(move |i| {
        let (face, y, x) = (i / (size * size), i / size % size, i % size);
        cube_direction(face, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / f64::from(size))
    })
}

/// Relative errors over texels.
pub struct Errors {
    pub mean: f64,
    pub p95: f64,
    pub max: f64,
}

impl Errors {
    pub fn new(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let count = errors.len();
        Self { mean: errors.iter().sum::<f64>() / count as f64, p95: errors[count * 95 / 100], max: errors[count - 1] }
    }
}

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |v: f64| 100.0 * v;
        write!(f, "mean {:.3} %, p95 {:.3} %, max {:.3} %", percent(self.mean), percent(self.p95), percent(self.max))
    }
}

/// |got − want| over want, all channels added.
pub fn relative(got: DVec3, want: DVec3) -> f64 {
    (got - want).abs().element_sum() / want.element_sum()
}

/// Errors of about `count` texels of a level, spread evenly.
pub fn level_errors(cube: &[DVec3], alpha: f64, panorama: &Panorama, count: usize) -> Errors {
    // A step that is no divisor of a row.
    let step = (cube.len() / count).max(1) | 1;
    let chosen: Vec<(DVec3, DVec3)> = texel_directions(cube).zip(cube.iter().copied()).step_by(step).collect();
    let directions: Vec<DVec3> = chosen.iter().map(|(d, _)| *d).collect();
    let wanted = prefiltered_around(&directions, alpha, [panorama.width, panorama.height], &panorama.texels);
    Errors::new(chosen.iter().zip(wanted).map(|((_, got), want)| relative(*got, want)).collect())
}

/// A cube's value in a direction, bilinear inside faces.
pub fn look_up(cube: &[DVec3], d: DVec3) -> DVec3 {
    let size = (cube.len() as f64 / 6.0).sqrt().round() as usize;
    let (face, st) = cube_face(d);
    let at = (st * size as f64 - 0.5).clamp(DVec2::ZERO, DVec2::splat(size as f64 - 1.0));
    let (x, y) = ((at.x as usize).min(size - 2), (at.y as usize).min(size - 2));
    let texel = |x: usize, y: usize| cube[(face as usize * size + y) * size + x];
    let row = |y: usize| texel(x, y).lerp(texel(x + 1, y), at.x - x as f64);
    row(y).lerp(row(y + 1), at.y - y as f64)
}
