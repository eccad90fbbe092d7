//! Steps of random paths over a scene's surfaces, each reflected as by a matt wall.

use glam::Vec3;

use super::bvh::{Bvh, Hit};
use super::surroundings::normal;

/// Cameras that paths begin at, spread evenly over all.
const MOST_CAMERAS: usize = 64;

/// The cameras that paths begin at, of those at these places.
pub fn starts(cameras: &[Vec3]) -> Vec<Vec3> {
    cameras.iter().copied().step_by(cameras.len().div_ceil(MOST_CAMERAS).max(1)).collect()
}

/// Evenly over the sphere, the same for the same number.
pub fn random_direction(number: u32) -> Vec3 {
    // O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms" (2014), section 6.3.
    let pcg = |x: u32| {
        let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    };
    let unit = |bits: u32| (bits >> 8) as f32 / (1 << 24) as f32;
    let (first, second) = (pcg(number), pcg(pcg(number) ^ 0x9e37_79b9));
    let (up, longitude) = (2.0 * unit(first) - 1.0, std::f32::consts::TAU * unit(second));
    let across = (1.0 - up * up).sqrt();
    Vec3::new(across * longitude.cos(), across * longitude.sin(), up)
}

/// The direction of a path that goes on from a surface with this normal, under the cosine, or begins in any; the same for the same
/// number.
pub fn path_direction(n: Option<Vec3>, number: u32) -> Vec3 {
    let d = random_direction(number);
    n.map_or(d, |n| (n + 0.999 * d).normalize_or(n))
}

/// Just before where a ray meets a triangle, and the triangle's normal on that side.
pub fn before(bvh: &Bvh, o: Vec3, d: Vec3, hit: &Hit) -> (Vec3, Vec3) {
    let n = normal(bvh, hit);
    let side = if n.dot(d) > 0.0 { -n } else { n };
    let place = o + hit.t * d;
    (place + 1e-5 * (hit.t + place.abs().max_element()) * side, side)
}
