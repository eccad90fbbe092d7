//! Surfaces that shine, as a table that rays draw points from by their power: `glsl/emitters.glsl`.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::scene::bvh::BvhTriangle;

/// What `RAY_EMITTERS` begins with.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Head {
    count: u32,
    /// One over the sum of all triangles' areas times their materials' emission.
    scale: f32,
}

/// A triangle that shines.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Emitter {
    triangle: u32,
    /// Share of all power up to this one's end.
    cumulative: f32,
}

/// The table's bytes, for triangles whose materials have these emissions, the sums of their channels. Without any that shines
/// it has one element that is never read.
pub fn table(triangles: &[BvhTriangle], emission: impl Fn(&BvhTriangle) -> f32) -> Vec<u8> {
    let power = |triangle: &BvhTriangle| {
        let [a, b, c] = triangle.corners.map(|corner| DVec3::from(corner.map(f64::from)));
        0.5 * (b - a).cross(c - a).length() * f64::from(emission(triangle))
    };
    let powers: Vec<(u32, f64)> = (0..).zip(triangles.iter().map(power)).filter(|(_, power)| *power > 0.0).collect();
    let total: f64 = powers.iter().map(|(_, power)| power).sum();
    let mut sum = 0.0;
    let mut emitters: Vec<Emitter> = Vec::with_capacity(powers.len().max(1));
    for (triangle, power) in powers {
        sum += power;
        emitters.push(Emitter { triangle, cumulative: (sum / total) as f32 });
    }
    let scale = if total > 0.0 { (1.0 / total) as f32 } else { 0.0 };
    let head = Head { count: emitters.len() as u32, scale };
    if emitters.is_empty() {
        emitters.push(Emitter::default());
    }
    [bytemuck::bytes_of(&head), bytemuck::cast_slice(&emitters)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(size: f32, instance: u32) -> BvhTriangle {
        let corners = [[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0]];
        BvhTriangle { corners, instance, first_index: 0 }
    }

    #[test]
    fn triangles_are_drawn_by_area_times_emission() {
        let emission = [0.0, 3.0, 1.0];
        let bytes = table(&[triangle(1.0, 0), triangle(1.0, 1), triangle(2.0, 2)], |t| emission[t.instance as usize]);
        let head: Head = *bytemuck::from_bytes(&bytes[..8]);
        let emitters: Vec<Emitter> = bytemuck::pod_collect_to_vec(&bytes[8..]);
        // Powers of 1.5 and 2.
        assert_eq!((head.count, head.scale), (2, 1.0 / 3.5));
        let first = Emitter { triangle: 1, cumulative: (1.5_f64 / 3.5) as f32 };
        assert_eq!(emitters, [first, Emitter { triangle: 2, cumulative: 1.0 }]);
    }

    #[test]
    fn without_any_the_table_says_so() {
        let bytes = table(&[triangle(1.0, 0)], |_| 0.0);
        assert_eq!((bytes.len(), &bytes[..8]), (16, &[0; 8][..]));
    }
}
