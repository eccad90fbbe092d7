//! Which bodies light is bent by, and which of them are balls, through which pictures show their surroundings.

use glam::Vec3;

use super::culling_bounds::{Component, connected_components};
use super::mesh::{Bounds, Mesh, Vertex};
use super::{GeometryView, Instance, Material};
use crate::asset::Report;
use crate::asset::material::Refraction;

/// By what a ball's corners may be nearer to its centre or farther than its radius, over this.
const MOST_UNEVEN: f32 = 0.01;
/// The least cosine of a ball's normals to its radii.
const LEAST_ROUND: f32 = 0.99;

/// Leaves thin sheets where surfaces are not closed: light that goes into a body must leave it. Balls that share a material with other
/// bodies get one of their own.
pub fn settle(meshes: &mut [Mesh], instances: &[Instance], materials: &mut Vec<Material>, report: &Report) {
    for index in 0..materials.len() {
        let Some(refraction) = materials[index].refraction else { continue };
        let of_it = meshes.iter().enumerate().filter(|(_, mesh)| mesh.material == index);
        let bodies: Vec<(usize, Vec<Component>)> =
            of_it.map(|(i, mesh)| (i, connected_components(&mesh.vertices, &mesh.indices))).collect();
        if !bodies.iter().flat_map(|(_, bodies)| bodies).all(Component::closed) {
            let material = &mut materials[index];
            material.refraction = None;
            report.warn(format!(
                "material {}: it refracts, but is on surfaces that are not closed, with fronts outwards; drawn as thin sheets",
                material.name
            ));
            continue;
        }
        let geometry = GeometryView { meshes, instances };
        let of_balls = bodies.iter().filter(|(mesh, bodies)| is_balls(geometry, *mesh, bodies));
        let balls: Vec<usize> = of_balls.map(|(mesh, _)| *mesh).collect();
        let refraction = Some(Refraction { balls: true, ..refraction });
        if balls.len() == bodies.len() {
            materials[index].refraction = refraction;
        } else if !balls.is_empty() {
            balls.iter().for_each(|mesh| meshes[*mesh].material = materials.len());
            let name = format!("{}, balls", materials[index].name);
            materials.push(Material { name, refraction, ..materials[index].clone() });
        }
    }
}

/// Whether these bodies of a mesh are balls with nothing inside, wherever it is placed.
fn is_balls(geometry: GeometryView<'_>, mesh: usize, bodies: &[Component]) -> bool {
    let vertices = &geometry.meshes[mesh].vertices;
    geometry.instances.iter().filter(|instance| instance.mesh == mesh).all(|instance| {
        let ball = |body| Ball::of(vertices, body, instance);
        bodies.iter().all(|body| ball(body).is_some_and(|ball| !ball.holds_something(geometry)))
    })
}

/// World space.
struct Ball {
    centre: Vec3,
    radius: f32,
}

impl Ball {
    fn of(vertices: &[Vertex], body: &Component, instance: &Instance) -> Option<Self> {
        let world = instance.world_from_local;
        let normals = world.inverse().transpose();
        let corners = || body.triangles.iter().flatten().map(|corner| &vertices[*corner as usize]);
        let place = |vertex: &Vertex| world.transform_point3(vertex.position.into());
        let bounds = Bounds::of(corners().map(place));
        let (centre, radius) = (bounds.centre(), 0.5 * (bounds.max - bounds.min).max_element());
        let is_round = |vertex: &Vertex| {
            let (from, n) = (place(vertex) - centre, normals.transform_vector3(vertex.normal.into()));
            (from.length() - radius).abs() <= MOST_UNEVEN * radius
                && n.dot(from) >= LEAST_ROUND * n.length() * from.length()
        };
        (radius > 0.0 && corners().all(is_round)).then_some(Self { centre, radius })
    }

    /// Whether a corner of anything is inside.
    fn holds_something(&self, geometry: GeometryView<'_>) -> bool {
        let radius = (1.0 - 2.0 * MOST_UNEVEN) * self.radius;
        let own = Bounds { min: self.centre - radius, max: self.centre + radius };
        geometry.instances.iter().any(|instance| {
            let (world, mesh) = (instance.world_from_local, &geometry.meshes[instance.mesh]);
            let bounds = mesh.bounds.placed(world);
            let is_inside =
                |vertex: &Vertex| world.transform_point3(vertex.position.into()).distance(self.centre) < radius;
            bounds.common(own).min.cmple(bounds.common(own).max).all() && mesh.vertices.iter().any(is_inside)
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;

    /// Whether each of these meshes of one material, each at its place, is drawn as balls; `None` for sheets.
    fn all_settled(placed: &[(Mesh, Mat4)]) -> Vec<Option<bool>> {
        let glass = Refraction {
            ior: 1.5,
            ior_spread: 0.0,
            surface_transmission: Vec3::ONE,
            absorption: Vec3::ZERO,
            balls: false,
        };
        let mut materials = vec![Material { refraction: Some(glass), ..Material::plain("glass", Vec3::ONE, 0.0, 0.0) }];
        let mut meshes: Vec<Mesh> = placed.iter().map(|(mesh, _)| mesh.clone()).collect();
        let instance = |(mesh, (_, world)): (usize, &(Mesh, Mat4))| Instance { mesh, world_from_local: *world };
        let instances: Vec<Instance> = placed.iter().enumerate().map(instance).collect();
        settle(&mut meshes, &instances, &mut materials, &Report::silent());
        meshes.iter().map(|mesh| materials[mesh.material].refraction.map(|refraction| refraction.balls)).collect()
    }

    fn settled(placed: &[(Mesh, Mat4)]) -> Option<bool> {
        all_settled(placed)[0]
    }

    #[test]
    fn balls_are_round_closed_and_empty() {
        let ball = Mesh::ball(24, 1.0);
        let alone = |world: Mat4| settled(&[(ball.clone(), world)]);
        assert_eq!(alone(Mat4::IDENTITY), Some(true));
        assert_eq!(alone(Mat4::from_translation(Vec3::splat(7.0)) * Mat4::from_scale(Vec3::splat(0.3))), Some(true));
        assert_eq!(alone(Mat4::from_scale(Vec3::new(1.0, 1.1, 1.0))), Some(false));
        let flat = Mesh {
            vertices: ball.vertices.iter().map(|vertex| Vertex { normal: [0.0, 1.0, 0.0], ..*vertex }).collect(),
            ..ball.clone()
        };
        assert_eq!(settled(&[(flat, Mat4::IDENTITY)]), Some(false));
        let half = Mesh { indices: ball.indices[..ball.indices.len() / 2].to_vec(), ..ball.clone() };
        assert_eq!(settled(&[(half, Mat4::IDENTITY)]), None);
        let beside = |x: f32| Mat4::from_translation(Vec3::X * x) * Mat4::from_scale(Vec3::splat(0.1));
        for (x, want) in [(0.3, false), (1.2, true)] {
            let both = all_settled(&[(ball.clone(), Mat4::IDENTITY), (ball.clone(), beside(x))]);
            assert_eq!(both, [Some(want), Some(true)]);
        }
    }
}
