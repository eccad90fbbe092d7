//! Places of a scene's surfaces that are alike to light from afar: steps of a grid, by the axis that a surface faces.

use glam::{UVec3, Vec3};

use super::bvh::Bvh;
use super::lightmap_texels::Sides;

/// Steps along the scene's longest side; the finest is taken that has few enough places.
const STEPS: [u32; 10] = [48, 32, 24, 16, 12, 8, 6, 4, 2, 1];
/// Height of a triangle, part of its longest side, up to which it has no place.
const THIN: f32 = 1e-6;
/// The axes that surfaces may face, of either sign.
const FACINGS: usize = 6;

/// A grid over a scene's surfaces, and the place of each step and facing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Places {
    pub size: [u32; 3],
    /// In the space in which models stand, metres.
    pub origin: Vec3,
    /// Steps per metre.
    pub scale: f32,
    /// For each step, x first, its places for +X, -X, +Y, -Y, +Z, -Z, from 1 on; 0 where no surface is.
    pub of_sides: Vec<u32>,
    pub count: u32,
}

impl Places {
    /// The places of a hierarchy's triangles, with the sides of each that are seen.
    pub fn new(bvh: &Bvh, sides: &[Sides], most: u32) -> Self {
        STEPS.iter().map(|steps| Self::with_steps(bvh, sides, *steps)).find(|p| p.count <= most).unwrap_or_default()
    }

    fn with_steps(bvh: &Bvh, sides: &[Sides], steps: u32) -> Self {
        let bounds = bvh.bounds();
        let extent = bounds.max - bounds.min;
        let scale = steps as f32 / extent.max_element();
        if !(scale.is_finite() && scale > 0.0) {
            return Self::default();
        }
        let size = (extent * scale).ceil().as_uvec3().clamp(UVec3::ONE, UVec3::splat(steps));
        let mut places = Self { size: size.to_array(), origin: bounds.min, scale, ..Self::default() };
        places.of_sides = vec![0; FACINGS * size.element_product() as usize];
        for (triangle, sides) in bvh.triangles().iter().zip(sides) {
            places.add(triangle.corners.map(Vec3::from), *sides == Sides::Both);
        }
        places
    }

    /// Adds a triangle's places, found by points that are at most half a step apart: a step that it only touches may be left out.
    fn add(&mut self, corners: [Vec3; 3], from_both_sides: bool) {
        let edges = [0, 1, 2].map(|i| (corners[(i + 1) % 3] - corners[i]).length());
        let first = if edges[0] >= edges[1].max(edges[2]) {
            0
        } else if edges[1] >= edges[2] {
            1
        } else {
            2
        };
        // The longest edge from a to b: slivers have a row of points along it.
        let [a, b, c] = [0, 1, 2].map(|i| corners[(first + i) % 3]);
        let (normal, longest) = ((b - a).cross(c - a), edges[first]);
        // No ray meets a triangle without an area, whose normal is rounding.
        if normal.length() <= THIN * longest * longest {
            return;
        }
        let parts = |length: f32| (2.0 * length * self.scale).ceil().max(1.0) as u32;
        let [along, across] = [parts(longest), parts(normal.length() / longest)];
        for i in 0..=along {
            let foot = a.lerp(b, i as f32 / along as f32);
            for j in 0..=across {
                let point = foot.lerp(c, j as f32 / across as f32);
                self.mark(point, normal);
                if from_both_sides {
                    self.mark(point, -normal);
                }
            }
        }
    }

    fn mark(&mut self, point: Vec3, side: Vec3) {
        let size = UVec3::from(self.size);
        let at = ((point - self.origin) * self.scale).as_uvec3().min(size - 1);
        let index = FACINGS * ((at.z * size.y + at.y) * size.x + at.x) as usize + facing(side);
        if self.of_sides[index] == 0 {
            self.count += 1;
            self.of_sides[index] = self.count;
        }
    }
}

/// The axis that a normal lies nearest to: +X, -X, +Y, -Y, +Z, -Z.
fn facing(side: Vec3) -> usize {
    let size = side.abs();
    let axis = if size.x >= size.y.max(size.z) {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(side[axis] < 0.0)
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;
    use crate::scene::{Instance, Mesh};

    fn ball_places(rows: u32, sides: Sides, most: u32) -> Places {
        let ball = Mesh::ball(rows, 2.0);
        let bvh = Bvh::new(&[ball], &[Instance { mesh: 0, world_from_local: Mat4::IDENTITY }]).unwrap();
        let all = vec![sides; bvh.triangles().len()];
        Places::new(&bvh, &all, most)
    }

    /// Each point of a ball has a place of its own facing, whether its triangles are smaller than a step or larger.
    #[test]
    fn surfaces_have_places_where_they_are_and_where_they_face() {
        for rows in [8, 64] {
            let places = ball_places(rows, Sides::Front, 800);
            assert!((200..=800).contains(&places.count), "{} places", places.count);
            let mut met = vec![false; places.count as usize + 1];
            for vertex in Mesh::ball(16, 1.95).vertices {
                let (position, n) = (Vec3::from(vertex.position), Vec3::from(vertex.normal));
                let at = ((position - places.origin) * places.scale).floor().as_uvec3();
                let [x, y, _] = places.size;
                let first = FACINGS * ((at.z * y + at.y) * x + at.x) as usize;
                let place = places.of_sides[first + facing(n)];
                let is_clear = n.abs().max_element() > 0.8;
                assert!(place > 0 || !is_clear || rows == 8, "{rows}: none at {position}");
                assert!(!is_clear || places.of_sides[first + facing(-n)] == 0, "{rows}: the back of {position}");
                met[place as usize] = true;
            }
            assert!(met.iter().filter(|met| **met).count() > 80);
        }
    }

    #[test]
    fn grids_get_coarser_where_there_is_little_room() {
        let [few, many] = [30, 4096].map(|most| ball_places(16, Sides::Both, most));
        assert!(few.count <= 30 && many.count > 1000, "{} and {}", few.count, many.count);
        assert!(few.scale < many.scale);
        // Backs are other places.
        assert_eq!(ball_places(16, Sides::Both, 1 << 20).count, 2 * ball_places(16, Sides::Front, 1 << 20).count);
        assert_eq!(ball_places(16, Sides::Both, 3), Places::default());
        assert_eq!(Places::new(&Bvh::new(&[], &[]).unwrap(), &[], 100).count, 0);
    }
}
