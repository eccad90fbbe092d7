//! The height of the floor under a point of a scene, for placing a standing user.

use glam::Vec3;

use super::Scene;

/// World height of the topmost surface at or below a point: the triangles crossed by the vertical line through the point are
/// searched. Without one, the scene's lowest height; 0 in an empty scene.
pub fn floor_under(scene: &Scene, point_world: Vec3) -> f32 {
    let mut highest = None;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh];
        for triangle in mesh.indices.chunks_exact(3) {
            let corner = |i: usize| {
                let local = Vec3::from(mesh.vertices[triangle[i] as usize].position);
                instance.world_from_local.transform_point3(local)
            };
            let height = height_at([corner(0), corner(1), corner(2)], point_world);
            highest = height.filter(|y| *y <= point_world.y && highest.is_none_or(|h| *y > h)).or(highest);
        }
    }
    let lowest = scene.bounds().min.y;
    highest.unwrap_or(if lowest.is_finite() { lowest } else { 0.0 })
}

/// Height of a triangle on the vertical line through a point, by barycentric coordinates in the xz plane.
fn height_at([a, b, c]: [Vec3; 3], point: Vec3) -> Option<f32> {
    let cross = |u: Vec3, v: Vec3| u.x * v.z - u.z * v.x;
    let area = cross(b - a, c - a);
    let (s, t) = (cross(point - a, c - a) / area, cross(b - a, point - a) / area);
    // Vertical triangles divide by zero; every comparison with the result is then false.
    (s >= 0.0 && t >= 0.0 && s + t <= 1.0).then_some(a.y + s * (b.y - a.y) + t * (c.y - a.y))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::asset::{Report, shipped};
    use crate::scene::{LoadOptions, load};

    #[test]
    fn the_floor_is_the_nearest_surface_below_the_camera() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        let options = LoadOptions { default_panorama: Some(assets.join(shipped::PANORAMA)), ..LoadOptions::default() };
        let scene = |name: &str| load(&assets.join("scenes").join(name), &options, &Report::silent()).unwrap();
        let room = scene("tearoom.toml");
        let floor = floor_under(&room, room.cameras[0].position);
        assert!((floor - room.bounds().min.y).abs() < 0.3, "{floor}");
        // Above the table it is the table's top; beside the teapot, the lowest height of the scene.
        assert!(floor_under(&room, Vec3::new(0.0, 1.5, 0.0)) > floor + 0.5);
        let teapot = scene("teapot.toml");
        assert_eq!(floor_under(&teapot, Vec3::new(0.0, 0.22, 0.52)), teapot.bounds().min.y);
    }

    #[test]
    fn a_vertical_triangle_is_no_floor() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(height_at([a, b, c], Vec3::new(0.5, 2.0, 0.0)), None);
        assert_eq!(height_at([a, b, Vec3::Z], Vec3::new(0.2, 2.0, 0.2)), Some(0.0));
        assert_eq!(height_at([a, b, Vec3::Z], Vec3::new(0.7, 2.0, 0.7)), None);
    }
}
