//! Maps of convex bodies, with which shaders find where light leaves one: the planes of its faces where these are few, else how far
//! the surface is from a centre in each direction, and its normal there (Szirmay-Kalos et al., "Approximate Ray-Tracing on the GPU
//! with Distance Impostors" (2005)).

use glam::{DVec2, DVec3, Mat4, Vec3};
use half::f16;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::needs::casting::is_convex;
use super::{Instance, Mesh};
use crate::asset::MipChain;
use crate::asset::ktx2::TexelFormat;
use crate::asset::material::Extension;
use crate::reference::octahedral::octahedral_decode;

/// Texels along a map, whose first and last ones lie on the edges of the unfolded octahedron.
const SIDE: u32 = 128;
/// A corner counts as behind a face within this part of the body's radius.
const FLAT_PART: f64 = 1e-4;
/// More faces are looked up by direction.
const MOST_FACES: usize = 48;
/// Cosine from which on two normals are one.
const SAME_NORMAL: f64 = 0.9999;
/// The nearest that the surface may be to the centre, over the radius, where it is looked up by direction: a thin plate's edges would
/// be a texel.
const LEAST_DISTANCE: f32 = 0.25;
/// More corners take too long.
const MOST_VERTICES: usize = 1 << 15;

/// A map and what it is about, local space.
pub struct BodyMap {
    pub centre: Vec3,
    /// The largest distance of the surface, in which the map has all distances.
    pub radius: f32,
    /// [`Extension::Faces`] or [`Extension::Body`]: a texel for each face with its normal, and in alpha the distance of its plane; or one
    /// for each direction, of the octahedron unfolded.
    pub of: Extension,
    pub map: MipChain,
}

impl BodyMap {
    /// Of the only body of a mesh; `None` if it is not convex.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let corners: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from(v.position.map(f64::from))).collect();
        let triangles: Vec<[DVec3; 3]> =
            mesh.indices.as_chunks().0.iter().map(|t: &[u32; 3]| t.map(|i| corners[i as usize])).collect();
        let centre = centroid(&triangles)?;
        let radius = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
        let fits = corners.len() <= MOST_VERTICES && radius > 0.0;
        if !fits || !is_convex(&triangles, &corners, FLAT_PART * radius) {
            return None;
        }
        if let Some(faces) = faces(mesh, &triangles, (centre, radius)) {
            let floats = faces.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            let size = [faces.len() as u32, 1];
            let map = map(mesh, size, TexelFormat::Rgba32Float, floats);
            return Some(Self { centre: centre.as_vec3(), radius: radius as f32, of: Extension::Faces, map });
        }
        let (centre, radius) = (centre.as_vec3(), radius as f32);
        let at_home = [Instance { mesh: 0, world_from_local: Mat4::IDENTITY }];
        let bvh = Bvh::new(std::slice::from_ref(mesh), &at_home).ok()?;
        let row = |y| (0..SIDE).map(|x| texel(&bvh, mesh, (centre, radius), [x, y])).collect::<Option<Vec<[f32; 4]>>>();
        let texels = (0..SIDE).into_par_iter().map(row).collect::<Option<Vec<_>>>()?.concat();
        let is_thick = texels.iter().all(|texel| texel[3] >= LEAST_DISTANCE);
        let halves = texels.iter().flatten().flat_map(|value| f16::from_f32(*value).to_le_bytes()).collect();
        let map = map(mesh, [SIDE; 2], TexelFormat::Rgba16Float, halves);
        is_thick.then_some(Self { centre, radius, of: Extension::Body, map })
    }
}

fn map(mesh: &Mesh, [width, height]: [u32; 2], format: TexelFormat, texels: Vec<u8>) -> MipChain {
    MipChain { name: format!("{}, body", mesh.name), width, height, format, levels: vec![texels] }
}

/// Normals and distances of the planes of a body's faces; `None` if these are many or shaded smoothly.
fn faces(mesh: &Mesh, triangles: &[[DVec3; 3]], (centre, radius): (DVec3, f64)) -> Option<Vec<[f32; 4]>> {
    let mut faces: Vec<(DVec3, f64)> = Vec::new();
    for (triangle, indices) in triangles.iter().zip(mesh.indices.as_chunks::<3>().0) {
        let [a, b, c] = triangle;
        let area = (*b - *a).cross(*c - *a);
        let Some(n) = area.try_normalize().filter(|_| area.length() > FLAT_PART * FLAT_PART * radius * radius) else {
            continue;
        };
        let own = |index: &u32| DVec3::from(mesh.vertices[*index as usize].normal.map(f64::from));
        let distance = n.dot(*a - centre) / radius;
        if !indices.iter().all(|index| own(index).dot(n) > SAME_NORMAL) || faces.len() > MOST_FACES {
            return None;
        }
        let is_same = |(m, far): &(DVec3, f64)| m.dot(n) > SAME_NORMAL && (far - distance).abs() < FLAT_PART;
        if !faces.iter().any(is_same) {
            faces.push((n, distance));
        }
    }
    let texel = |(n, distance): &(DVec3, f64)| n.extend(*distance).as_vec4().to_array();
    (faces.len() <= MOST_FACES).then(|| faces.iter().map(texel).collect())
}

/// The middle of a closed surface's volume; `None` without one.
fn centroid(triangles: &[[DVec3; 3]]) -> Option<DVec3> {
    let origin = triangles.first()?[0];
    let (volume, moment) = triangles.iter().fold((0.0, DVec3::ZERO), |(volume, moment), triangle| {
        let [a, b, c] = triangle.map(|corner| corner - origin);
        let six = a.dot(b.cross(c));
        (volume + six, moment + six * (a + b + c) / 4.0)
    });
    (volume > 0.0).then(|| origin + moment / volume)
}

/// Normal and distance in the direction that a texel stands for; `None` if no ray that way meets the surface.
fn texel(bvh: &Bvh, mesh: &Mesh, (centre, radius): (Vec3, f32), at: [u32; 2]) -> Option<[f32; 4]> {
    let [x, y] = at.map(|i| 2.0 * f64::from(i) / f64::from(SIDE - 1) - 1.0);
    let d = octahedral_decode(DVec2::new(x, y)).as_vec3();
    let hit = bvh.trace(centre, d, f32::INFINITY, |_| true)?;
    let first = bvh.triangles()[hit.triangle].first_index as usize;
    let normal = |corner: usize| Vec3::from(mesh.vertices[mesh.indices[first + corner] as usize].normal);
    let n = (0..3).map(|corner| hit.weights[corner] * normal(corner)).sum::<Vec3>().normalize_or(d);
    Some([n.x, n.y, n.z, hit.t / radius])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::{Bounds, Vertex};

    fn texels(map: &BodyMap) -> Vec<[f32; 4]> {
        let halves: Vec<f32> =
            map.map.levels[0].as_chunks().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect();
        halves.as_chunks().0.to_vec()
    }

    #[test]
    fn a_ball_is_as_far_everywhere() {
        let ball = BodyMap::of(&Mesh::ball(64, 0.5)).unwrap();
        assert!(ball.centre.length() < 1e-3 && (ball.radius - 0.5).abs() < 1e-3);
        for (i, [x, y, z, far]) in (0u32..).zip(texels(&ball)) {
            let [u, v] = [i % SIDE, i / SIDE].map(|i| 2.0 * f64::from(i) / f64::from(SIDE - 1) - 1.0);
            let d = octahedral_decode(DVec2::new(u, v)).as_vec3();
            assert!((far - 1.0).abs() < 2e-3 && Vec3::new(x, y, z).dot(d) > 0.998, "{i}: {far}");
        }
    }

    #[test]
    fn centres_and_distances_are_in_local_space() {
        let mut egg = Mesh::ball(32, 1.0);
        egg.vertices
            .iter_mut()
            .for_each(|v| (v.position[0], v.position[1]) = (2.0 * v.position[0], v.position[1] + 5.0));
        egg.bounds = Bounds::of(egg.vertices.iter().map(|v| v.position.into()));
        let map = BodyMap::of(&egg).unwrap();
        assert!((map.centre - 5.0 * Vec3::Y).length() < 1e-3 && (map.radius - 2.0).abs() < 1e-2, "{}", map.centre);
        let far = texels(&map).into_iter().map(|texel| map.radius * texel[3]);
        let (least, most) = far.fold((f32::INFINITY, 0.0f32), |(least, most), far| (least.min(far), most.max(far)));
        assert!((least - 1.0).abs() < 1e-2 && (most - 2.0).abs() < 1e-2, "{least} {most}");
    }

    #[test]
    fn a_body_of_few_faces_has_their_planes() {
        let cube = |smooth: bool| {
            let mut mesh = Mesh { indices: Vec::new(), vertices: Vec::new(), ..Mesh::ball(2, 1.0) };
            for (axis, sign) in (0..3).flat_map(|axis| [(axis, 1.0f32), (axis, -1.0)]) {
                let first = mesh.vertices.len() as u32;
                for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let (mut position, mut normal) = ([0.0f32; 3], [0.0f32; 3]);
                    (position[axis], position[(axis + 1) % 3], position[(axis + 2) % 3]) = (sign, sign * u, v);
                    normal[axis] = sign;
                    let normal = if smooth { Vec3::from(position).normalize().into() } else { normal };
                    mesh.vertices.push(Vertex { position, normal, ..Vertex::default() });
                }
                mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
            }
            BodyMap::of(&mesh).unwrap()
        };
        let flat = cube(false);
        assert_eq!((flat.of, flat.map.width, flat.map.height), (Extension::Faces, 6, 1));
        assert!(flat.centre.length() < 1e-6 && (flat.radius - 3f32.sqrt()).abs() < 1e-6);
        for plane in flat.map.levels[0].as_chunks::<16>().0 {
            let [n @ .., far] = bytemuck::pod_read_unaligned::<[f32; 4]>(plane);
            assert!(Vec3::from(n).abs().max_element() == 1.0 && (far * flat.radius - 1.0).abs() < 1e-6);
        }
        assert_eq!(cube(true).of, Extension::Body);
    }

    #[test]
    fn what_is_dented_flat_or_a_smooth_plate_has_no_map() {
        let mut plate = Mesh::ball(12, 0.3);
        plate.vertices.iter_mut().for_each(|v| v.position[1] *= 0.1);
        assert!(BodyMap::of(&plate).is_none());
        let mut dented = Mesh::ball(12, 0.3);
        dented.vertices.iter_mut().filter(|v| v.position[0] > 0.28).for_each(|v| v.position[0] = 0.1);
        assert!(BodyMap::of(&dented).is_none());
        let mut flat = Mesh::ball(12, 0.3);
        flat.vertices.iter_mut().for_each(|v| v.position[1] = 0.0);
        assert!(BodyMap::of(&flat).is_none());
    }
}
