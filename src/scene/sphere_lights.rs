//! Small closed surfaces that shine, such as bulbs: mirror images show them as spheres, which a room's probes would show too faint
//! and in the wrong place.

use glam::Vec3;

use super::culling_bounds::connected_components;
use super::mesh::{Bounds, Mesh};
use super::{GeometryView, Material};

/// Lights at most: shaders take each of them for each pixel.
pub const MAX_SPHERE_LIGHTS: usize = 8;
/// Of the strongest, so many are compared with each other.
const MOST_EXAMINED: usize = 64;
/// Larger meshes are no bulbs.
const MOST_TRIANGLES: usize = 1 << 17;
/// The longest side of a light's bounds over the shortest, at most.
const LONGEST: f32 = 3.0;
/// The area of a light over that of its bounds: an octahedron has less than the first, nothing convex more than the second.
const AREA: [f32; 2] = [0.25, 1.02];
/// What the areas of its parts add up to as vectors, over their sum as numbers: a bulb may be open at its socket.
const MOST_OPEN: f32 = 0.15;
/// Its radius over the scene's, at most: what shines around everything is no lamp.
const LARGEST: f32 = 0.2;

/// A surface that shines, as a sphere of the same area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereLight {
    /// World space, as the scene's file places it, metres.
    pub position: Vec3,
    pub radius: f32,
    /// Radiance per channel, W/(m² sr).
    pub radiance: Vec3,
    /// The distance from `position` to what is farthest of the surface.
    pub reach: f32,
    /// Of the surface; nothing else that shines is inside.
    pub bounds: Bounds,
}

impl SphereLight {
    /// The strongest of a scene; of those that are equal all or none.
    pub fn all(geometry: GeometryView<'_>, materials: &[Material]) -> Vec<Self> {
        let scene_radius = geometry.bounds().radius();
        let mut all = Vec::new();
        for instance in geometry.instances {
            let mesh = &geometry.meshes[instance.mesh];
            if mesh.indices.len() / 3 > MOST_TRIANGLES {
                continue;
            }
            if let Some(radiance) = materials.get(mesh.material).and_then(even_radiance) {
                let surfaces = surfaces(mesh, |p| instance.world_from_local.transform_point3(p));
                all.extend(surfaces.iter().filter_map(|surface| surface.light(radiance, scene_radius)));
            }
        }
        // What shines inside of another surface that does is hidden.
        all.sort_by(|a: &Self, b| b.power().total_cmp(&a.power()));
        all.truncate(MOST_EXAMINED);
        let hides = |(a, outer): (usize, &Self), (b, inner): (usize, &Self)| {
            // Of two in one place the first is seen.
            a != b && contains(outer.bounds, inner.bounds) && (a < b || !contains(inner.bounds, outer.bounds))
        };
        let is_seen = |light: &(usize, &Self)| !all.iter().enumerate().any(|other| hides(other, *light));
        let mut seen: Vec<Self> = all.iter().enumerate().filter(is_seen).map(|(_, light)| *light).collect();
        if let Some(next) = seen.get(MAX_SPHERE_LIGHTS).map(Self::power) {
            seen.retain(|light| light.power() > 1.01 * next);
        }
        seen
    }

    /// Radiant intensity, W/sr.
    pub fn intensity(&self) -> Vec3 {
        self.radiance * (std::f32::consts::PI * self.radius * self.radius)
    }

    /// Whether a triangle of a material that shines is a part of it.
    pub fn has(&self, corners: [Vec3; 3]) -> bool {
        contains(self.bounds, Bounds::of(corners))
    }

    fn power(&self) -> f32 {
        self.intensity().element_sum()
    }
}

/// The radiance of a material that is the same all over.
fn even_radiance(material: &Material) -> Option<Vec3> {
    let is_even =
        material.emissive_map.is_none() && !material.unlit && !material.blends && material.alpha_cutoff.is_none();
    let radiance = material.emissive_factor;
    (is_even && radiance.max_element() > 0.0 && radiance.is_finite()).then_some(radiance)
}

/// With a slack for rounding: a rotated triangle need not have the corners that its surface's bounds were made of.
fn contains(outer: Bounds, inner: Bounds) -> bool {
    outer.grown(1e-3 * outer.radius()).contains(inner)
}

/// A connected surface, in world space.
struct Surface {
    bounds: Bounds,
    /// The distance from the middle of the bounds to what is farthest.
    reach: f32,
    area: f32,
    /// The sum of its triangles' normals times their areas.
    vector_area: Vec3,
}

fn surfaces(mesh: &Mesh, place: impl Fn(Vec3) -> Vec3) -> Vec<Surface> {
    let corner = |index: &u32| place(mesh.vertices[*index as usize].position.into());
    let surface = |triangles: &[[u32; 3]]| {
        let bounds = Bounds::of(triangles.iter().flatten().map(corner));
        let far = triangles.iter().flatten().map(|index| corner(index).distance(bounds.centre()));
        let reach = far.fold(0.0, f32::max);
        let mut surface = Surface { bounds, reach, area: 0.0, vector_area: Vec3::ZERO };
        for triangle in triangles {
            let [a, b, c] = triangle.each_ref().map(corner);
            let area = 0.5 * (b - a).cross(c - a);
            surface.area += area.length();
            surface.vector_area += area;
        }
        surface
    };
    connected_components(&mesh.vertices, &mesh.indices).iter().map(|part| surface(&part.triangles)).collect()
}

impl Surface {
    /// Where a sphere can stand for it. The area of a convex body's shadow is a quarter of its surface's on average (Cauchy 1832).
    fn light(&self, radiance: Vec3, scene_radius: f32) -> Option<SphereLight> {
        let size = self.bounds.max - self.bounds.min;
        let of_bounds = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let radius = (self.area * 0.25 * std::f32::consts::FRAC_1_PI).sqrt();
        let is_round = size.max_element() <= LONGEST * size.min_element()
            && (AREA[0] * of_bounds..=AREA[1] * of_bounds).contains(&self.area)
            && self.vector_area.length() <= MOST_OPEN * self.area;
        let is_small = radius > 0.0 && radius <= LARGEST * scene_radius;
        let Self { bounds, reach, .. } = *self;
        let light = SphereLight { position: bounds.centre(), radius, radiance, reach, bounds };
        (is_round && is_small).then_some(light)
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;
    use crate::scene::Instance;
    use crate::scene::material::default_material;

    /// A room's corner, so that the scene is large, and balls of 0.1 m that shine at these places, stretched so.
    fn found(radiance: f32, places: &[Mat4]) -> Vec<SphereLight> {
        let shining = Material { emissive_factor: Vec3::splat(radiance), ..default_material() };
        let ball = |material| Mesh { material, ..Mesh::ball(16, 0.1) };
        let far = Instance { mesh: 0, world_from_local: Mat4::from_translation(Vec3::splat(8.0)) };
        let placed = places.iter().map(|place| Instance { mesh: 1, world_from_local: *place });
        let (meshes, instances) = ([ball(0), ball(1)], [far].into_iter().chain(placed).collect::<Vec<_>>());
        let geometry = GeometryView { meshes: &meshes, instances: &instances };
        SphereLight::all(geometry, &[default_material(), shining])
    }

    #[test]
    fn a_ball_that_shines_is_a_sphere_light_of_its_size() {
        let place = Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0)) * Mat4::from_scale(Vec3::splat(2.0));
        let [light] = found(5.0, &[place])[..] else { panic!("not one") };
        assert!((light.position - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-5 && (light.radius / 0.2 - 1.0).abs() < 0.02);
        assert!(light.radiance == Vec3::splat(5.0) && (light.reach / 0.2 - 1.0).abs() < 1e-3, "{light:?}");
        assert!(light.has([Vec3::new(1.0, 2.2, 3.0); 3]) && !light.has([Vec3::new(1.0, 2.3, 3.0); 3]));
        assert!(found(0.0, &[place]).is_empty());
    }

    #[test]
    fn what_is_long_flat_or_as_large_as_the_scene_is_none() {
        for (size, count) in [([1.0, 2.5, 1.0], 1), ([1.0, 4.0, 1.0], 0), ([1.0, 0.2, 1.0], 0), ([20.0; 3], 0)] {
            assert_eq!(found(1.0, &[Mat4::from_scale(size.into())]).len(), count, "{size:?}");
        }
    }

    #[test]
    fn what_shines_inside_of_another_is_hidden() {
        let lights = found(1.0, &[Mat4::from_scale(Vec3::splat(0.5)), Mat4::IDENTITY]);
        assert!(lights.len() == 1 && lights[0].radius > 0.09, "{lights:?}");
        assert_eq!(found(1.0, &[Mat4::IDENTITY; 3]).len(), 1, "three in one place");
    }

    #[test]
    fn of_too_many_that_are_equal_there_is_none() {
        let row = |count: usize, first: f32| -> Vec<Mat4> {
            let scale = |i| Vec3::splat(if i == 0 { first } else { 1.0 });
            (0..count).map(|i| Mat4::from_translation(i as f32 * Vec3::X) * Mat4::from_scale(scale(i))).collect()
        };
        let count = |count, first| found(1.0, &row(count, first)).len();
        assert_eq!([count(8, 1.0), count(9, 1.0), count(9, 2.0)], [8, 0, 1]);
    }
}
