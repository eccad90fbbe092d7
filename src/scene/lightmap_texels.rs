//! The texels of a scene's lightmap that pictures read, and the place of the surface that each stands for.

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2};

use super::bvh::{Bvh, BvhTriangle};
use super::culling_bounds::closed_triangles;
use super::{Instance, Mesh};

/// A texel: an element of `LIGHTMAP_TEXELS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct LightmapTexel {
    /// Column and row, 16 bits each.
    pub place: u32,
    /// Index of a triangle of the [`Bvh`]; the upper bit is set for its back.
    pub triangle: u32,
}

/// The bit of [`LightmapTexel::triangle`] for a triangle's back.
pub const BACK: u32 = 1 << 31;

/// For each of a hierarchy's triangles whether it is part of a closed surface, whose backs are never seen.
pub fn closed(bvh: &Bvh, meshes: &[Mesh], instances: &[Instance]) -> Vec<bool> {
    let of_mesh: Vec<Vec<bool>> = meshes.iter().map(|mesh| closed_triangles(&mesh.vertices, &mesh.indices)).collect();
    let is_closed = |t: &BvhTriangle| of_mesh[instances[t.instance as usize].mesh][t.first_index as usize / 3];
    bvh.triangles().iter().map(is_closed).collect()
}

/// The texels of a square atlas that bilinear filtering reads on some triangle: of the fronts of all, and of the backs of
/// those that are not `closed`. Texels of the front layer come first; each lies nearest to the triangle that it is of.
pub fn lightmap_texels(
    bvh: &Bvh,
    meshes: &[Mesh],
    instances: &[Instance],
    side: u32,
    closed: &[bool],
) -> Vec<LightmapTexel> {
    let coordinates = |t: &BvhTriangle| -> [Vec2; 3] {
        let mesh = &meshes[instances[t.instance as usize].mesh];
        let first = t.first_index as usize;
        [0, 1, 2].map(|i| Vec2::from(mesh.vertices[mesh.indices[first + i] as usize].lightmap_uv) * side as f32)
    };
    let mut nearest = vec![Nearest::NONE; side as usize * side as usize];
    for (index, triangle) in (0u32..).zip(bvh.triangles()) {
        cover(&mut nearest, side, index, coordinates(triangle));
    }
    let of_side = |back: u32| {
        let texels = (0u32..).zip(&nearest).filter(|(_, n)| n.triangle != u32::MAX);
        texels.filter(move |(_, n)| back == 0 || !closed[n.triangle as usize]).map(move |(texel, n)| LightmapTexel {
            place: texel % side | (texel / side) << 16,
            triangle: n.triangle | back,
        })
    };
    of_side(0).chain(of_side(BACK)).collect()
}

/// The triangle nearest to a texel's centre.
#[derive(Clone, Copy)]
struct Nearest {
    /// Squared distance in texels.
    squared: f32,
    triangle: u32,
}

impl Nearest {
    const NONE: Self = Self { squared: f32::INFINITY, triangle: u32::MAX };
}

/// Enters a triangle where it is the nearest so far of those that a texel is read on.
fn cover(nearest: &mut [Nearest], side: u32, triangle: u32, corners: [Vec2; 3]) {
    let [a, b, c] = corners;
    // Without an area it has no place of its own.
    if (b - a).perp_dot(c - a) == 0.0 {
        return;
    }
    let (low, high) = (a.min(b).min(c) - 1.5, a.max(b).max(c) + 0.5);
    let last = IVec2::splat(side as i32 - 1);
    let (low, high) =
        (low.floor().as_ivec2().clamp(IVec2::ZERO, last), high.ceil().as_ivec2().clamp(IVec2::ZERO, last));
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            let off = from_triangle(IVec2::new(x, y).as_vec2() + 0.5, corners);
            let texel = &mut nearest[y as usize * side as usize + x as usize];
            if off.abs().max_element() < 1.0 && off.length_squared() < texel.squared {
                *texel = Nearest { squared: off.length_squared(), triangle };
            }
        }
    }
}

/// From the nearest point of a triangle to p.
fn from_triangle(p: Vec2, corners: [Vec2; 3]) -> Vec2 {
    let [a, b, c] = corners;
    let turn = (b - a).perp_dot(c - a).signum();
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().all(|(from, to)| turn * (to - from).perp_dot(p - from) >= 0.0) {
        return Vec2::ZERO;
    }
    let from_edge = |(from, to): (Vec2, Vec2)| {
        let along = (p - from).dot(to - from) / (to - from).length_squared().max(f32::MIN_POSITIVE);
        p - from - (to - from) * along.clamp(0.0, 1.0)
    };
    let [first, second, third] = edges.map(from_edge);
    let nearer = |a: Vec2, b: Vec2| if b.length_squared() < a.length_squared() { b } else { a };
    nearer(nearer(first, second), third)
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Vec3};

    use super::*;
    use crate::scene::bvh::tests::mesh;

    #[test]
    fn a_texel_is_listed_where_filtering_reads_it() {
        // A square from (2, 2) to (5, 5) of an 8 × 8 atlas, of two triangles.
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions: Vec<Vec3> = corners.iter().map(|[x, y]| Vec3::new(*x, *y, 0.0)).collect();
        let mut square = mesh(&positions, vec![0, 1, 2, 0, 2, 3]);
        for (vertex, [x, y]) in square.vertices.iter_mut().zip(corners) {
            vertex.lightmap_uv = [(2.0 + 3.0 * x) / 8.0, (2.0 + 3.0 * y) / 8.0];
        }
        let (meshes, instances) = ([square], [Instance { mesh: 0, world_from_local: Mat4::IDENTITY }]);
        let bvh = Bvh::new(&meshes, &instances).unwrap();
        assert_eq!(closed(&bvh, &meshes, &instances), [false; 2]);
        let front = lightmap_texels(&bvh, &meshes, &instances, 8, &[true; 2]);
        // Centres nearer than 1 to [2, 5]: 1.5 to 5.5.
        let places: Vec<u32> = (1..=5).flat_map(|y| (1..=5).map(move |x| x | y << 16)).collect();
        assert_eq!(front.iter().map(|t| t.place).collect::<Vec<_>>(), places);
        let both = lightmap_texels(&bvh, &meshes, &instances, 8, &[false; 2]);
        assert_eq!(both.len(), 50);
        assert_eq!(both[..25], front[..]);
        assert!(
            both[25..].iter().zip(&front).all(|(back, f)| *back == LightmapTexel { triangle: f.triangle | BACK, ..*f })
        );
        // Below and above the diagonal each triangle has its own texels.
        let of = |x: u32, y: u32| front.iter().find(|t| t.place == x | y << 16).unwrap().triangle as usize;
        let third = |index: usize| bvh.triangles()[index].first_index;
        assert_eq!([third(of(4, 2)), third(of(2, 4))], [0, 3]);
    }

    #[test]
    fn distances_to_triangles_are_those_to_their_nearest_points() {
        for turned in [false, true] {
            let mut corners = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]].map(Vec2::from);
            if turned {
                corners.swap(1, 2);
            }
            let off = |x: f32, y: f32| from_triangle(Vec2::new(x, y), corners);
            assert_eq!(off(1.0, 1.0), Vec2::ZERO);
            assert_eq!(off(1.0, -2.0), Vec2::new(0.0, -2.0));
            assert_eq!(off(-3.0, -4.0), Vec2::new(-3.0, -4.0));
            assert!((off(3.0, 3.0) - Vec2::ONE).length() < 1e-6);
            assert_eq!(off(6.0, 0.0), Vec2::new(2.0, 0.0));
        }
    }
}
