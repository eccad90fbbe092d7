//! A ball as a mesh, and one of gold under a panorama: what is drawn where no model is needed.

use std::f32::consts::{PI, TAU};

use glam::{Mat4, Vec3};

use super::synthetic;
use crate::scene::{Bounds, Camera, Environment, Instance, Material, Mesh, Scene, Vertex};

/// Rings and sectors of the gold one: 2 · 100 · (101 − 1) = 20,000 triangles.
const FINE: [u32; 2] = [101, 100];

/// A ball of radius 1 around the origin.
pub fn ball([rings, sectors]: [u32; 2], material: usize) -> Mesh {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for ring in 0..=rings {
        for sector in 0..=sectors {
            let (v, u) = (ring as f32 / rings as f32, sector as f32 / sectors as f32);
            let ((across, y), (sin, cos)) = ((v * PI).sin_cos(), (u * TAU).sin_cos());
            let position = [across * cos, y, -across * sin];
            vertices.push(Vertex { position, normal: position, uv: [u, v], tangent: [-sin, 0.0, -cos, 1.0] });
            if ring == rings || sector == sectors {
                continue;
            }
            let a = ring * (sectors + 1) + sector;
            let (b, c, d) = (a + sectors + 1, a + sectors + 2, a + 1);
            // Rings at the poles are of triangles.
            if ring + 1 < rings {
                indices.extend([a, b, c]);
            }
            if ring > 0 {
                indices.extend([a, c, d]);
            }
        }
    }
    Mesh { name: "ball".into(), vertices, indices, material, bounds: Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE } }
}

/// A ball of gold of radius 1 that fills three quarters of the picture's height.
pub fn gold_ball(roughness: f32) -> Scene {
    let position = Vec3::Z * 3.4;
    Scene {
        meshes: vec![ball(FINE, 0)],
        instances: vec![Instance { mesh: 0, world_from_local: Mat4::IDENTITY }],
        materials: vec![Material::plain("gold", Vec3::new(1.0, 0.77, 0.34), 1.0, roughness)],
        textures: Vec::new(),
        lights: Vec::new(),
        cameras: vec![Camera { name: "front".into(), position, target: Vec3::ZERO, vertical_fov_degrees: 45.0 }],
        environment: Environment { panorama: synthetic::panorama(synthetic::WIDTH, true), rotation_degrees: 0.0 },
        exposure_ev: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_is_round_and_has_the_triangles_it_is_named_for() {
        let Mesh { vertices, indices, .. } = gold_ball(0.3).meshes.remove(0);
        assert_eq!(indices.len() / 3, 20_000);
        for t in indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| Vec3::from(vertices[i as usize].position));
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "a triangle without area or inside out: {a} {b} {c}");
        }
    }
}
