//! Whether anything in a scene could lie between a light and something else.

use glam::{DVec3, Mat4};
use rayon::prelude::*;

use crate::asset::material::BodyShape;
use crate::scene::culling_bounds::connected_components;
use crate::scene::mesh::Mesh;
use crate::scene::{Instance, Scene};

/// Larger scenes are taken to cast shadows; the test for convexity takes their number squared, divided by [`BLOCK`].
const MOST_TRIANGLES: usize = 1 << 15;
/// Corners in a box of their own, all of which are behind a plane if the box is. In files, corners next to each other are mostly
/// neighbours.
const BLOCK: usize = 32;
/// A corner counts as behind a face within this part of the scene's size: what rounding in files moves it.
const FLAT_PART: f64 = 1e-4;

/// Why nothing in a scene casts a shadow on anything; `None` if something may.
pub fn nothing_casts(scene: &Scene) -> Option<&'static str> {
    let shown: Vec<&Instance> = scene.instances.iter().filter(|i| !scene.meshes[i.mesh].indices.is_empty()).collect();
    if shown.is_empty() {
        return Some("nothing is shown");
    }
    if scene.triangles() > MOST_TRIANGLES {
        return None;
    }
    let all: Vec<[DVec3; 3]> =
        shown.iter().flat_map(|i| triangles(&scene.meshes[i.mesh], i.world_from_local)).collect();
    let margin = FLAT_PART * f64::from(scene.bounds().radius());
    if is_flat(&all, margin) {
        return Some("all is in one plane, which casts no shadow on itself");
    }
    let [instance] = shown[..] else { return None };
    let mesh = &scene.meshes[instance.mesh];
    let material = &scene.materials[mesh.material];
    // Light goes through a convex body of glass, which shows its surroundings by itself.
    let is_seen_through = material.refraction.is_some_and(|refraction| refraction.shape != BodyShape::Other);
    let lets_light_in = material.diffuse_transmission.is_some();
    let has_holes = material.alpha_cutoff.is_some() || (material.blends && !is_seen_through) || lets_light_in;
    let parts = connected_components(&mesh.vertices, &mesh.indices);
    let closed = parts.len() == 1 && parts[0].closed() && !has_holes;
    // From inside it is a room.
    let is_room = || scene.cameras.iter().any(|camera| is_behind_all(&all, camera.position.as_dvec3(), margin));
    (closed && is_convex(&all, &corners(mesh, instance.world_from_local), margin) && !is_room())
        .then_some("all is one convex thing, which casts no shadow on itself")
}

/// A mesh's vertices in world space.
fn corners(mesh: &Mesh, world_from_local: Mat4) -> Vec<DVec3> {
    let place = world_from_local.as_dmat4();
    mesh.vertices.iter().map(|v| place.transform_point3(DVec3::from(v.position.map(f64::from)))).collect()
}

fn triangles(mesh: &Mesh, world_from_local: Mat4) -> Vec<[DVec3; 3]> {
    let corners = corners(mesh, world_from_local);
    mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| corners[i as usize])).collect()
}

/// A triangle's unit normal; `None` if it is no wider than `margin`, and rounding turns it anywhere.
fn normal([a, b, c]: &[DVec3; 3], margin: f64) -> Option<DVec3> {
    let both = (*b - *a).cross(*c - *a);
    let longest = a.distance(*b).max(b.distance(*c)).max(c.distance(*a));
    (both.length() > margin * longest).then(|| both.normalize())
}

fn is_flat(triangles: &[[DVec3; 3]], margin: f64) -> bool {
    let Some((first, n)) = triangles.iter().find_map(|t| Some((t[0], normal(t, margin)?))) else { return true };
    triangles.iter().flatten().all(|corner| n.dot(*corner - first).abs() <= margin)
}

/// Whether no corner lies before the plane of any triangle.
pub fn is_convex(triangles: &[[DVec3; 3]], corners: &[DVec3], margin: f64) -> bool {
    let boxed = |block: &'_ [DVec3]| {
        let (min, max) = block.iter().fold((block[0], block[0]), |(min, max), c| (min.min(*c), max.max(*c)));
        (min.midpoint(max), 0.5 * (max - min))
    };
    let blocks: Vec<_> = corners.chunks(BLOCK).map(|block| (boxed(block), block)).collect();
    triangles.par_iter().filter_map(|t| Some((t[0], normal(t, margin)?))).all(|(at, n)| {
        let most = n.dot(at) + margin;
        blocks.iter().all(|((middle, half), block)| {
            n.dot(*middle) + n.abs().dot(*half) <= most || block.iter().all(|corner| n.dot(*corner) <= most)
        })
    })
}

/// Whether a point is behind the planes of all triangles.
fn is_behind_all(triangles: &[[DVec3; 3]], p: DVec3, margin: f64) -> bool {
    triangles.par_iter().filter_map(|t| Some((t[0], normal(t, margin)?))).all(|(at, n)| n.dot(p - at) < 0.0)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::asset::material::Refraction;
    use crate::scene::material::default_material;
    use crate::scene::mesh::{Bounds, Vertex};
    use crate::scene::needs::tests::scene;
    use crate::scene::{Camera, Material};

    fn square() -> Mesh {
        let vertex = |x: f32, y: f32| Vertex {
            position: [x, y, 0.0],
            normal: [0.0, 0.0, 1.0],
            uv: [x, y],
            tangent: [1.0, 0.0, 0.0, 1.0],
            ..Vertex::default()
        };
        let vertices = vec![vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(1.0, 1.0), vertex(0.0, 1.0)];
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) };
        Mesh { name: "square".into(), vertices, indices: vec![0, 1, 2, 0, 2, 3], material: 0, bounds }
    }

    fn reason(meshes: Vec<Mesh>, places: &[(usize, Mat4)]) -> Option<&'static str> {
        let instances =
            places.iter().map(|(mesh, world_from_local)| Instance { mesh: *mesh, world_from_local: *world_from_local });
        let instances = instances.collect();
        nothing_casts(&Scene { meshes, instances, ..scene(vec![default_material()], 1) })
    }

    fn ball_of(material: Material) -> Scene {
        let instances = vec![Instance { mesh: 0, world_from_local: Mat4::IDENTITY }];
        Scene { meshes: vec![Mesh::ball(12, 0.3)], instances, ..scene(vec![material], 1) }
    }

    #[test]
    fn a_lone_ball_and_a_lone_plane_cast_nothing() {
        let (turned, aside) = (Mat4::from_rotation_x(0.7), Mat4::from_translation(3.0 * Vec3::X));
        assert!(reason(vec![Mesh::ball(12, 0.3)], &[(0, turned)]).unwrap().contains("convex"));
        assert!(reason(vec![square()], &[(0, turned), (0, turned * aside)]).unwrap().contains("plane"));
        assert!(reason(vec![], &[]).unwrap().contains("nothing is shown"));
        assert_eq!(reason(vec![Mesh::ball(12, 0.3)], &[(0, turned), (0, aside)]), None, "two balls");
        assert_eq!(reason(vec![square()], &[(0, turned), (0, Mat4::IDENTITY)]), None, "two planes");
    }

    #[test]
    fn a_ball_with_a_camera_in_it_is_a_room() {
        let from = |position: Vec3| {
            let mut scene = ball_of(default_material());
            scene.cameras.push(Camera { name: "eye".into(), position, target: Vec3::ZERO, vertical_fov_degrees: 60.0 });
            nothing_casts(&scene).is_none()
        };
        assert_eq!([Vec3::splat(0.1), Vec3::splat(0.2)].map(from), [true, false]);
    }

    #[test]
    fn what_is_open_dented_or_full_of_holes_casts() {
        let mut open = Mesh::ball(12, 0.3);
        open.indices.truncate(open.indices.len() / 2);
        assert_eq!(reason(vec![open], &[(0, Mat4::IDENTITY)]), None, "a bowl");
        let mut dented = Mesh::ball(12, 0.3);
        dented.vertices.iter_mut().filter(|v| v.position[0] > 0.28).for_each(|v| v.position[0] = 0.1);
        assert_eq!(reason(vec![dented], &[(0, Mat4::IDENTITY)]), None, "a dent");
        let holes = Material { alpha_cutoff: Some(0.5), ..default_material() };
        assert_eq!(nothing_casts(&ball_of(holes)), None);
    }

    #[test]
    fn a_lone_ball_of_glass_casts_nothing_and_a_vase_does() {
        let glass = |shape| {
            let refraction = Refraction {
                ior: 1.5,
                ior_spread: 0.0,
                surface_transmission: Vec3::ONE,
                absorption: Vec3::ZERO,
                shape,
            };
            Material { blends: true, refraction: Some(refraction), ..default_material() }
        };
        assert!(nothing_casts(&ball_of(glass(BodyShape::Balls))).is_some_and(|why| why.contains("convex")));
        assert_eq!(nothing_casts(&ball_of(glass(BodyShape::Other))), None);
    }
}
