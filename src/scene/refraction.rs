//! Which bodies light is bent by, and which of them pictures show their surroundings through: balls and convex bodies.

use std::collections::HashMap;

use glam::Vec3;

use super::body_map::BodyMap;
use super::culling_bounds::{Component, connected_components};
use super::mesh::{Bounds, Mesh, Vertex};
use super::{GeometryView, Instance, Lookup, MAPS, Material};
use crate::asset::material::{BodyShape, Refraction, Sampling, Wrap};
use crate::asset::{MipChain, Report};

/// By what a ball's corners may be nearer to its centre or farther than its radius, over this.
const MOST_UNEVEN: f32 = 0.01;
/// The least cosine of a ball's normals to its radii.
const LEAST_ROUND: f32 = 0.99;

/// What may get other parts where light is bent.
pub struct Parts<'a> {
    pub meshes: &'a mut Vec<Mesh>,
    pub instances: &'a mut Vec<Instance>,
    pub materials: &'a mut Vec<Material>,
    pub textures: &'a mut Vec<MipChain>,
}

/// Leaves thin sheets where surfaces are not closed: light that goes into a body must leave it. Balls that share a material with other
/// bodies get one of their own, and so does each convex body.
pub fn settle(mut parts: Parts<'_>, report: &Report) {
    for index in 0..parts.materials.len() {
        if parts.materials[index].refraction.is_none() {
            continue;
        }
        let of_it = parts.meshes.iter().enumerate().filter(|(_, mesh)| mesh.material == index);
        let bodies: Vec<(usize, Vec<Component>)> =
            of_it.map(|(i, mesh)| (i, connected_components(&mesh.vertices, &mesh.indices))).collect();
        if bodies.iter().flat_map(|(_, bodies)| bodies).all(Component::closed) {
            parts.shape(index, bodies);
            continue;
        }
        let material = &mut parts.materials[index];
        material.refraction = None;
        report.warn(format!(
            "material {}: it refracts, but is on surfaces that are not closed, with fronts outwards; drawn as thin sheets",
            material.name
        ));
    }
}

impl Parts<'_> {
    fn geometry(&self) -> GeometryView<'_> {
        GeometryView { meshes: self.meshes, instances: self.instances }
    }

    /// Says what the bodies of a material are: those of each of its meshes.
    fn shape(&mut self, material: usize, bodies: Vec<(usize, Vec<Component>)>) {
        let (balls, others): (Vec<_>, Vec<_>) =
            bodies.into_iter().partition(|(mesh, bodies)| is_balls(self.geometry(), *mesh, bodies));
        if others.is_empty() {
            self.materials[material] = self.shaped(material, BodyShape::Balls);
            return;
        }
        if !balls.is_empty() {
            balls.iter().for_each(|(mesh, _)| self.meshes[*mesh].material = self.materials.len());
            let shaped = self.shaped(material, BodyShape::Balls);
            self.materials.push(Material { name: format!("{}, balls", shaped.name), ..shaped });
        }
        let of_one_mesh = balls.is_empty() && others.len() == 1;
        for (mesh, bodies) in others {
            match convex_bodies(self.geometry(), mesh, bodies) {
                Some(maps) if of_one_mesh && maps.len() == 1 => {
                    maps.into_iter().for_each(|(_, map)| self.materials[material] = self.mapped(material, map));
                }
                Some(maps) => self.give_maps(material, mesh, maps),
                None => {}
            }
        }
    }

    /// A mesh and a material for each convex body of a mesh.
    fn give_maps(&mut self, material: usize, mesh: usize, maps: Vec<(Mesh, BodyMap)>) {
        let placed: Vec<Instance> = self.instances.iter().filter(|instance| instance.mesh == mesh).copied().collect();
        for (number, (body, map)) in maps.into_iter().enumerate() {
            let body = Mesh { material: self.materials.len(), ..body };
            let mapped = self.mapped(material, map);
            self.materials.push(Material { name: format!("{}, {}", mapped.name, body.name), ..mapped });
            if number == 0 {
                self.meshes[mesh] = body;
            } else {
                self.instances.extend(placed.iter().map(|instance| Instance { mesh: self.meshes.len(), ..*instance }));
                self.meshes.push(body);
            }
        }
    }

    /// A material with bodies of this shape.
    fn shaped(&self, material: usize, shape: BodyShape) -> Material {
        let material = &self.materials[material];
        let refraction = material.refraction.map(|refraction| Refraction { shape, ..refraction });
        Material { refraction, ..material.clone() }
    }

    /// One with the map of a convex body.
    fn mapped(&mut self, material: usize, BodyMap { centre, radius, of, map }: BodyMap) -> Material {
        let mut mapped = self.shaped(material, BodyShape::Convex { centre, radius });
        mapped.extension_map = Some((of, self.textures.len()));
        mapped.lookups[MAPS - 1] = Lookup { sampling: BODY_SAMPLING, second_uv: false };
        self.textures.push(map);
        mapped
    }
}

/// Bodies of one mesh that get a map each, at most; more are drawn as sheets.
const MOST_BODIES: usize = 16;
const BODY_SAMPLING: Sampling = Sampling { wrap: [Wrap::Clamp; 2], nearest: false };

/// A mesh for each of these bodies of one, with its map; `None` if some is not convex or holds something.
fn convex_bodies(geometry: GeometryView<'_>, mesh: usize, bodies: Vec<Component>) -> Option<Vec<(Mesh, BodyMap)>> {
    let whole = &geometry.meshes[mesh];
    let of_body = |body: Component| {
        let part = part(whole, &body);
        let map = BodyMap::of(&part)?;
        let mut placed = geometry.instances.iter().filter(|instance| instance.mesh == mesh);
        let is_empty = placed.all(|instance| !holds_something(&part, instance, geometry));
        is_empty.then_some((part, map))
    };
    if bodies.len() > MOST_BODIES { None } else { bodies.into_iter().map(of_body).collect() }
}

/// Twice the area of triangles whose planes count, over the body's size, squared, at least.
const LEAST_AREA_PART: f32 = 1e-6;

/// Whether a corner of anything is in a convex body.
fn holds_something(body: &Mesh, placed: &Instance, geometry: GeometryView<'_>) -> bool {
    let corner = |index: &u32| Vec3::from(body.vertices[*index as usize].position);
    let size = (body.bounds.max - body.bounds.min).max_element();
    let plane = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.each_ref().map(corner);
        let area = (b - a).cross(c - a);
        // Rounding turns slivers anywhere.
        let n = area.try_normalize().filter(|_| area.length() > LEAST_AREA_PART * size * size)?;
        Some((n, n.dot(a)))
    };
    let planes: Vec<(Vec3, f32)> = body.indices.as_chunks().0.iter().filter_map(plane).collect();
    let margin = MOST_UNEVEN * size;
    let is_inside = |p: Vec3| {
        body.bounds.min.cmple(p).all()
            && p.cmple(body.bounds.max).all()
            && planes.iter().all(|(n, at)| n.dot(p) < at - margin)
    };
    geometry.instances.iter().any(|instance| {
        let (mesh, to_local) =
            (&geometry.meshes[instance.mesh], placed.world_from_local.inverse() * instance.world_from_local);
        let common = mesh.bounds.placed(to_local).common(body.bounds);
        common.min.cmple(common.max).all()
            && mesh.vertices.iter().any(|vertex| is_inside(to_local.transform_point3(vertex.position.into())))
    })
}

/// A part of a mesh as one of its own.
fn part(whole: &Mesh, body: &Component) -> Mesh {
    let mut known = HashMap::new();
    let mut vertices = Vec::new();
    let mut index = |corner: u32| {
        *known.entry(corner).or_insert_with(|| {
            vertices.push(whole.vertices[corner as usize]);
            vertices.len() as u32 - 1
        })
    };
    let indices = body.triangles.iter().flatten().map(|corner| index(*corner)).collect();
    let bounds = Bounds::of(vertices.iter().map(|vertex: &Vertex| vertex.position.into()));
    Mesh { name: whole.name.clone(), vertices, indices, material: whole.material, bounds }
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

    /// What each of these meshes of one material, each at its place, is drawn as, and each that is added; `None` for sheets.
    fn all_settled(placed: &[(Mesh, Mat4)]) -> Vec<Option<BodyShape>> {
        let glass = Refraction {
            ior: 1.5,
            ior_spread: 0.0,
            surface_transmission: Vec3::ONE,
            absorption: Vec3::ZERO,
            shape: BodyShape::Other,
        };
        let mut materials = vec![Material { refraction: Some(glass), ..Material::plain("glass", Vec3::ONE, 0.0, 0.0) }];
        let mut meshes: Vec<Mesh> = placed.iter().map(|(mesh, _)| mesh.clone()).collect();
        let instance = |(mesh, (_, world)): (usize, &(Mesh, Mat4))| Instance { mesh, world_from_local: *world };
        let (mut instances, mut textures) = (placed.iter().enumerate().map(instance).collect(), Vec::new());
        let parts = Parts {
            meshes: &mut meshes,
            instances: &mut instances,
            materials: &mut materials,
            textures: &mut textures,
        };
        settle(parts, &Report::silent());
        let shape = |mesh: &Mesh| materials[mesh.material].refraction.map(|refraction| refraction.shape);
        let is_mapped = |mesh: &&Mesh| matches!(shape(mesh), Some(BodyShape::Convex { .. }));
        assert_eq!(meshes.iter().filter(is_mapped).count(), textures.len());
        let is_placed = |mesh: usize| instances.iter().any(|instance| instance.mesh == mesh);
        assert!((0..meshes.len()).all(is_placed), "a mesh that nothing shows");
        meshes.iter().map(shape).collect()
    }

    fn settled(placed: &[(Mesh, Mat4)]) -> Option<BodyShape> {
        all_settled(placed)[0]
    }

    #[test]
    fn balls_are_round_closed_and_empty() {
        let ball = Mesh::ball(24, 1.0);
        let alone = |world: Mat4| settled(&[(ball.clone(), world)]);
        assert_eq!(alone(Mat4::IDENTITY), Some(BodyShape::Balls));
        let placed = Mat4::from_translation(Vec3::splat(7.0)) * Mat4::from_scale(Vec3::splat(0.3));
        assert_eq!(alone(placed), Some(BodyShape::Balls));
        let flat = Mesh {
            vertices: ball.vertices.iter().map(|vertex| Vertex { normal: [0.0, 1.0, 0.0], ..*vertex }).collect(),
            ..ball.clone()
        };
        assert!(matches!(settled(&[(flat, Mat4::IDENTITY)]), Some(BodyShape::Convex { .. })));
        let half = Mesh { indices: ball.indices[..ball.indices.len() / 2].to_vec(), ..ball.clone() };
        assert_eq!(settled(&[(half, Mat4::IDENTITY)]), None);
        let beside = |x: f32| Mat4::from_translation(Vec3::X * x) * Mat4::from_scale(Vec3::splat(0.1));
        for (x, want) in [(0.3, false), (1.2, true)] {
            let both = all_settled(&[(ball.clone(), Mat4::IDENTITY), (ball.clone(), beside(x))]);
            assert_eq!([both[0] == Some(BodyShape::Balls), both[1] == Some(BodyShape::Balls)], [want, true]);
            assert!(want || both[0] == Some(BodyShape::Other), "it holds the other one");
        }
    }

    /// An egg that is moved along x; corners of pairs are of one mesh.
    fn egg(x: f32) -> Mesh {
        let mut egg = Mesh::ball(12, 0.4);
        egg.vertices.iter_mut().for_each(|v| (v.position[0], v.position[1]) = (v.position[0] + x, 1.3 * v.position[1]));
        egg.bounds = Bounds::of(egg.vertices.iter().map(|v| v.position.into()));
        egg
    }

    #[test]
    fn each_convex_body_gets_a_map() {
        let mut pair = egg(0.0);
        let other = egg(3.0);
        let first = pair.vertices.len() as u32;
        pair.vertices.extend(&other.vertices);
        pair.indices.extend(other.indices.iter().map(|index| index + first));
        pair.bounds = Bounds::of(pair.vertices.iter().map(|v| v.position.into()));
        let found = all_settled(&[(pair, Mat4::from_rotation_x(1.0))]);
        let centre = |shape: &Option<BodyShape>| match shape {
            Some(BodyShape::Convex { centre, radius }) => centre.x * f32::from(u8::from((radius - 0.52).abs() < 1e-2)),
            other => panic!("{other:?}"),
        };
        let centres: Vec<f32> = found.iter().map(centre).collect();
        assert!(centres.len() == 2 && centres[0].abs() < 1e-3 && (centres[1] - 3.0).abs() < 1e-3, "{centres:?}");
        let mut dented = egg(0.0);
        dented.vertices.iter_mut().filter(|v| v.position[0] > 0.37).for_each(|v| v.position[0] = 0.33);
        assert!(!matches!(settled(&[(dented, Mat4::IDENTITY)]), Some(BodyShape::Convex { .. })));
    }
}
