//! The texels of a scene's lightmap that pictures read, and the place of the surface that each stands for.

use std::collections::HashSet;

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::bvh::{Bvh, BvhTriangle};
use super::culling_bounds::{ComponentOf, components_of_triangles};
use super::random_paths::{before, path_direction, random_direction};
use super::surroundings::normal;
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

/// The sides of a scene's surfaces that light can be seen on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// A closed surface with no camera inside: only fronts are ever seen.
    Closed,
    /// An open surface whose back no path from the cameras has met.
    Front,
    /// An open surface that is seen from both sides.
    Both,
}

/// Paths that look for backs, and how often each is reflected.
const PATHS: u32 = 8192;
const REFLECTIONS: u32 = 8;
/// Directions in which one looks for what is around a camera.
const LOOKS: u32 = 256;

/// For each of a hierarchy's triangles the sides that are seen, by random paths that begin at cameras and lamps.
pub fn sides(bvh: &Bvh, meshes: &[Mesh], instances: &[Instance], [cameras, lamps]: [&[Vec3]; 2]) -> Vec<Sides> {
    let of_mesh: Vec<Vec<ComponentOf>> =
        meshes.par_iter().map(|mesh| components_of_triangles(&mesh.vertices, &mesh.indices)).collect();
    let of = |t: &BvhTriangle| of_mesh[instances[t.instance as usize].mesh][t.first_index as usize / 3];
    let part = |index: usize| {
        let triangle = &bvh.triangles()[index];
        (triangle.instance, of(triangle).component)
    };
    let seen: HashSet<(u32, u32)> = cameras
        .iter()
        .chain(lamps)
        .enumerate()
        .flat_map(|(i, start)| {
            let walk = move |path: u32| backs_met(bvh, *start, i as u32 * PATHS + path);
            (0..PATHS).into_par_iter().flat_map_iter(walk).collect::<Vec<usize>>()
        })
        .map(part)
        .collect();
    // Rooms are made of closed boxes, too.
    let around: HashSet<(u32, u32)> = cameras.iter().flat_map(|camera| first_backs(bvh, *camera)).map(part).collect();
    let side = |t: &BvhTriangle| match of(t) {
        ComponentOf { closed: true, component } if around.contains(&(t.instance, component)) => Sides::Both,
        ComponentOf { closed: true, .. } => Sides::Closed,
        ComponentOf { component, .. } if seen.contains(&(t.instance, component)) => Sides::Both,
        _ => Sides::Front,
    };
    bvh.triangles().iter().map(side).collect()
}

/// The triangles whose backs are what is seen first from a place, if that is so in most directions.
fn first_backs(bvh: &Bvh, from: Vec3) -> Vec<usize> {
    let look = |i| {
        let d = random_direction(i);
        let hit = bvh.trace(from, d, f32::INFINITY, |_| true)?;
        let [a, b, c] = bvh.triangles()[hit.triangle].corners.map(Vec3::from);
        ((b - a).cross(c - a).dot(d) > 0.0).then_some(hit.triangle)
    };
    let backs: Vec<usize> = (0..LOOKS).filter_map(look).collect();
    if 2 * backs.len() > LOOKS as usize { backs } else { Vec::new() }
}

/// The triangles whose backs one random path meets.
fn backs_met(bvh: &Bvh, start: Vec3, path: u32) -> Vec<usize> {
    let (mut met, mut o, mut axis) = (Vec::new(), start, None);
    for reflection in 0..=REFLECTIONS {
        let d = path_direction(axis, path * (REFLECTIONS + 1) + reflection);
        let Some(hit) = bvh.trace(o, d, f32::INFINITY, |_| true) else { break };
        if normal(bvh, &hit).dot(d) > 0.0 {
            met.push(hit.triangle);
        }
        let side;
        (o, side) = before(bvh, o, d, &hit);
        axis = Some(side);
    }
    met
}

/// The texels of a square atlas that bilinear filtering reads on some triangle.
#[derive(Debug, Default)]
pub struct LightmapTexels {
    /// First those of all fronts, then of backs that are seen, then of other backs. Each is of the triangle that its centre
    /// lies nearest to.
    pub all: Vec<LightmapTexel>,
    /// How many of them are seen.
    pub seen: usize,
}

impl LightmapTexels {
    /// Lists the texels of an atlas of `side` × `side`, with the sides that are seen of each triangle.
    pub fn new(bvh: &Bvh, meshes: &[Mesh], instances: &[Instance], side: u32, sides: &[Sides]) -> Self {
        let coordinates = |t: &BvhTriangle| -> [Vec2; 3] {
            let mesh = &meshes[instances[t.instance as usize].mesh];
            let first = t.first_index as usize;
            [0, 1, 2].map(|i| Vec2::from(mesh.vertices[mesh.indices[first + i] as usize].lightmap_uv) * side as f32)
        };
        let mut nearest = vec![Nearest::NONE; side as usize * side as usize];
        for (index, triangle) in (0u32..).zip(bvh.triangles()) {
            cover(&mut nearest, side, index, coordinates(triangle));
        }
        let texels = |back: u32, of: &[Sides]| -> Vec<LightmapTexel> {
            let used = (0u32..).zip(&nearest).filter(|(_, n)| n.triangle != u32::MAX);
            let listed = used.filter(|(_, n)| of.contains(&sides[n.triangle as usize]));
            let texel = |(texel, n): (u32, &Nearest)| LightmapTexel {
                place: (texel % side) | ((texel / side) << 16),
                triangle: n.triangle | back,
            };
            listed.map(texel).collect()
        };
        let mut all = texels(0, &[Sides::Closed, Sides::Front, Sides::Both]);
        all.extend(texels(BACK, &[Sides::Both]));
        let seen = all.len();
        all.extend(texels(BACK, &[Sides::Front]));
        Self { all, seen }
    }

    /// For each texel of each layer, of fronts and then of backs, its index among those that are seen, or [`u32::MAX`].
    pub fn indices(&self, side: u32, layers: u32) -> Vec<u32> {
        let mut indices = vec![u32::MAX; (side * side * layers) as usize];
        for (index, texel) in (0u32..).zip(&self.all[..self.seen]) {
            let [x, y, layer] = [texel.place & 0xffff, texel.place >> 16, u32::from(texel.triangle & BACK != 0)];
            indices[((layer * side + y) * side + x) as usize] = index;
        }
        indices
    }

    /// Whether some are of backs.
    pub fn has_backs(&self) -> bool {
        self.all.iter().any(|texel| texel.triangle & BACK != 0)
    }
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
        let both = LightmapTexels::new(&bvh, &meshes, &instances, 8, &[Sides::Both; 2]);
        // Centres nearer than 1 to [2, 5]: 1.5 to 5.5.
        let places: Vec<u32> = (1..=5).flat_map(|y| (1..=5).map(move |x| x | (y << 16))).collect();
        let (front, backs) = both.all.split_at(25);
        assert_eq!(front.iter().map(|t| t.place).collect::<Vec<_>>(), places);
        assert!(backs.iter().zip(front).all(|(b, f)| *b == LightmapTexel { triangle: f.triangle | BACK, ..*f }));
        assert_eq!((backs.len(), both.seen), (25, 50));
        for (sides, all, seen) in [(Sides::Front, 50, 25), (Sides::Closed, 25, 25)] {
            let texels = LightmapTexels::new(&bvh, &meshes, &instances, 8, &[sides; 2]);
            assert_eq!((texels.all.len(), texels.seen), (all, seen), "{sides:?}");
            assert_eq!(texels.all[..25], *front);
        }
        // Those of backs are in the second layer.
        let indices = both.indices(8, 2);
        assert_eq!(indices.iter().filter(|index| **index != u32::MAX).count(), 50);
        assert!((0..50).all(|i| indices[(64 * (i / 25) + 8 * (i % 25 / 5 + 1) + i % 5 + 1) as usize] == i));
        // Below and above the diagonal each triangle has its own texels.
        let of = |x: u32, y: u32| front.iter().find(|t| t.place == x | (y << 16)).unwrap().triangle as usize;
        let third = |index: usize| bvh.triangles()[index].first_index;
        assert_eq!([third(of(4, 2)), third(of(2, 4))], [0, 3]);
    }

    #[test]
    fn backs_count_where_paths_meet_them() {
        // A ball around the start, and a square inside of it that is seen from the side of its front, and from behind.
        let square = |z: f32| {
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
            let positions: Vec<Vec3> = corners.iter().map(|[x, y]| Vec3::new(*x, *y, z)).collect();
            mesh(&positions, vec![0, 1, 2, 0, 2, 3])
        };
        let of = |meshes: &[Mesh], start: Vec3| {
            let placed = |mesh| Instance { mesh, world_from_local: Mat4::IDENTITY };
            let instances: Vec<Instance> = (0..meshes.len()).map(placed).collect();
            let bvh = Bvh::new(meshes, &instances).unwrap();
            let sides = sides(&bvh, meshes, &instances, [&[start], &[]]);
            bvh.triangles().iter().zip(sides).map(|(t, side)| (t.instance, side)).collect::<Vec<_>>()
        };
        assert!(of(&[square(0.0)], Vec3::Z).iter().all(|(_, side)| *side == Sides::Front));
        assert!(of(&[square(0.0)], -Vec3::Z).iter().all(|(_, side)| *side == Sides::Both));
        let room = crate::scene::bvh::tests::closed_ball();
        let found = of(&[square(0.0), room], 0.5 * Vec3::Z);
        // Paths that come back from the walls meet the back.
        assert!(found.iter().all(|(_, side)| *side == Sides::Both));
        let room = crate::scene::bvh::tests::closed_ball();
        let found = of(&[square(0.0), room], 5.0 * Vec3::Z);
        assert!(found.iter().all(|(mesh, side)| *side == [Sides::Front, Sides::Closed][*mesh as usize]));
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
