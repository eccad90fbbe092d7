//! Rays through the hierarchy against every triangle in f64.

use std::f32::consts::TAU;

use glam::{DVec3, EulerRot, Mat4, Quat};

use super::*;
use crate::scene::Vertex;

/// Numbers in [0, 1), the same in every run: Steele et al., "Fast Splittable Pseudorandom Number Generators" (2014).
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    pub fn point(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.unit(), self.unit(), self.unit()) - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        let (z, longitude) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let across = (1.0 - z * z).sqrt();
        Vec3::new(across * longitude.cos(), across * longitude.sin(), z)
    }
}

pub fn mesh(positions: &[Vec3], indices: Vec<u32>) -> Mesh {
    let vertex = |p: &Vec3| Vertex {
        position: (*p).into(),
        normal: [0.0, 1.0, 0.0],
        uv: [p.x, p.y],
        tangent: [1.0, 0.0, 0.0, 1.0],
        ..Vertex::default()
    };
    let bounds = Bounds::of(positions.iter().copied());
    Mesh { name: "m".into(), vertices: positions.iter().map(vertex).collect(), indices, material: 0, bounds }
}

/// Triangles of all sizes, some without area, twice placed.
pub fn soup(count: u32) -> (Vec<Mesh>, Vec<Instance>) {
    let mut random = Random(7);
    let mut positions = Vec::new();
    for i in 0..count {
        let (centre, size) = (random.point(), 0.002 + 0.3 * random.unit().powi(4));
        let mut corner = || centre + size * random.point();
        let [a, b, c] = [corner(), corner(), corner()];
        positions.extend(if i % 50 == 0 { [a, a, c] } else { [a, b, c] });
    }
    let turned = Quat::from_euler(EulerRot::XYZ, 0.4, 1.1, -0.3);
    let second = Mat4::from_scale_rotation_translation(Vec3::splat(0.5), turned, Vec3::new(1.5, 0.2, -0.4));
    let placed = |world_from_local| Instance { mesh: 0, world_from_local };
    (vec![mesh(&positions, (0..3 * count).collect())], vec![placed(Mat4::IDENTITY), placed(second)])
}

/// The distance to the nearest triangle of all, in f64, and how clearly it is hit: the least weight of a corner.
fn nearest(bvh: &Bvh, o: Vec3, d: Vec3) -> Option<(f64, f64)> {
    let (o, d) = (o.as_dvec3(), d.as_dvec3());
    let hit = |triangle: &BvhTriangle| {
        let [a, b, c] = triangle.corners.map(|corner| Vec3::from(corner).as_dvec3() - o);
        let volumes = DVec3::new(d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b)));
        let weights = volumes / volumes.element_sum();
        let t = (weights.x * a + weights.y * b + weights.z * c).dot(d);
        (weights.min_element() >= 0.0 && t >= 0.0).then_some((t, weights.min_element()))
    };
    bvh.triangles().iter().filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0))
}

#[test]
fn the_nearest_triangle_is_found() {
    let (meshes, instances) = soup(600);
    let bvh = Bvh::new(&meshes, &instances).unwrap();
    assert_eq!(bvh.triangles().len(), 2 * (600 - 12), "those without area are left out");
    let mut random = Random(3);
    let (mut hits, mut doubtful) = (0, 0);
    for _ in 0..4000 {
        let (o, d) = (1.5 * random.point(), random.direction());
        let (want, got) = (nearest(&bvh, o, d), bvh.trace(o, d, f32::INFINITY, |_| true));
        match (want, got) {
            (None, None) => {}
            (Some((want, _)), Some(got)) if (f64::from(got.t) - want).abs() < 2e-6 => {
                let [a, b, c] = bvh.triangles()[got.triangle].corners.map(Vec3::from);
                let place = got.weights.x * a + got.weights.y * b + got.weights.z * c;
                assert!((place - (o + got.t * d)).length() < 1e-5, "{got:?}");
                hits += 1;
            }
            // At an edge either answer is right.
            (Some((_, clear)), _) if clear < 1e-4 => doubtful += 1,
            (None, Some(got)) if got.weights.min_element() < 1e-4 => doubtful += 1,
            _ => panic!("{o} towards {d}: {got:?} is not {want:?}"),
        }
    }
    assert!(hits > 300 && doubtful < 8, "{hits} hits, {doubtful} doubtful");
}

#[test]
fn rays_end_where_they_are_told_and_holes_let_them_through() {
    let square = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]].map(Vec3::from);
    let positions: Vec<Vec3> = [square(-1.0), square(-2.0)].concat();
    let indices = [0, 4].into_iter().flat_map(|f| [0, 1, 2, 0, 2, 3].map(|i| i + f)).collect();
    let instance = Instance { mesh: 0, world_from_local: Mat4::IDENTITY };
    let bvh = Bvh::new(&[mesh(&positions, indices)], &[instance]).unwrap();
    let (o, d) = (Vec3::new(0.25, 0.5, 0.0), Vec3::NEG_Z);
    let t = |far, accept: &dyn Fn(&Hit) -> bool| bvh.trace(o, d, far, accept).map(|hit| hit.t);
    assert_eq!(t(f32::INFINITY, &|_| true), Some(1.0));
    assert_eq!(t(1.0, &|_| true), None);
    assert_eq!(t(f32::INFINITY, &|hit| hit.t > 1.5), Some(2.0));
    assert_eq!(t(f32::INFINITY, &|_| false), None);
    assert_eq!(bvh.trace(o, Vec3::Z, f32::INFINITY, |_| true), None);
    // The corners of boxes and the edges that triangles share.
    for (x, y) in [(0.0, 0.0), (1.0, 1.0), (-1.0, 0.5), (0.5, 0.5), (-1.0, -1.0)] {
        assert!(bvh.trace(Vec3::new(x, y, 0.0), d, 9.0, |_| true).is_some(), "{x}, {y}");
    }
}

/// A ball whose seam and poles have one position each.
pub fn closed_ball() -> Mesh {
    let mut ball = Mesh::ball(24, 1.0);
    ball.vertices.iter_mut().for_each(|v| v.position = v.position.map(|c| (c * 4096.0).round() / 4096.0));
    ball
}

#[test]
fn no_ray_leaves_a_closed_surface() {
    let ball = closed_ball();
    let place = Mat4::from_translation(Vec3::new(3.1, -2.7, 0.3));
    let bvh = Bvh::new(std::slice::from_ref(&ball), &[Instance { mesh: 0, world_from_local: place }]).unwrap();
    let mut random = Random(11);
    let o = place.transform_point3(Vec3::new(0.1, 0.2, -0.3));
    let corners = ball.vertices.iter().map(|v| place.transform_point3(v.position.into()) - o);
    let middles = ball.indices.windows(2).map(|edge| {
        let [a, b] = [0, 1].map(|i| Vec3::from(ball.vertices[edge[i] as usize].position));
        place.transform_point3(0.5 * (a + b)) - o
    });
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let random: Vec<Vec3> = (0..50_000).map(|_| random.direction()).collect();
    for d in corners.chain(middles).chain(axes).chain(random) {
        assert!(bvh.trace(o, d, f32::INFINITY, |_| true).is_some(), "{d} finds a gap");
    }
}

#[test]
fn nothing_and_hostile_shapes_are_traced_or_refused() {
    let empty = Bvh::new(&[], &[]).unwrap();
    assert_eq!(empty.trace(Vec3::ZERO, Vec3::X, f32::INFINITY, |_| true), None);
    assert_eq!((empty.node_bytes().len(), empty.bounds()), (80, Bounds::EMPTY));
    let instance = [Instance { mesh: 0, world_from_local: Mat4::IDENTITY }];
    // Copies of a triangle; boxes that are all the same; ever smaller triangles in one corner; slivers; far away.
    let one = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let copies: Vec<Vec3> = one.repeat(5000);
    let boxes: Vec<Vec3> =
        (0..20_000).flat_map(|i| [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(i as f32 / 2e4, 1.0, 0.0)]).collect();
    let nested: Vec<Vec3> = (0..120).flat_map(|i| one.map(|p| p * 0.5f32.powi(i))).collect();
    let slivers: Vec<Vec3> =
        (0..20_000).flat_map(|i| [Vec3::ZERO, Vec3::X * 1e3, Vec3::new(1e3, 1e-4 * i as f32 + 1.0, 0.0)]).collect();
    let far: Vec<Vec3> = (0..2000).flat_map(|i| one.map(|p| p + Vec3::splat(1e6 + i as f32))).collect();
    for positions in [copies, boxes, nested, slivers, far] {
        let count = positions.len() as u32;
        let bvh = Bvh::new(&[mesh(&positions, (0..count).collect())], &instance).unwrap();
        let target = (positions[0] + positions[1] + positions[2]) / 3.0;
        let o = target + Vec3::new(0.0, 0.0, 10.0);
        assert!(bvh.trace(o, Vec3::NEG_Z, f32::INFINITY, |_| true).is_some());
    }
}
