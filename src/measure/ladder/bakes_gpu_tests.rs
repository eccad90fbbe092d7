//! What baked light takes is measured once, for all configurations that have the same.

use glam::{Mat4, Vec3};

use super::bakes::Bakes;
use super::reference::Shot;
use super::settings::options;
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::with_gpu;
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::render::Eye;
use crate::scene::{Camera, Environment, Instance, Material, Mesh, Scene};

#[test]
fn light_is_baked_once_for_each_kind_of_it() {
    let placed = |x: f32| Instance { mesh: 0, world_from_local: Mat4::from_translation(x * Vec3::X) };
    let position = Vec3::new(0.3, 0.4, 2.0);
    let scene = Scene {
        meshes: vec![Mesh::ball(8, 0.5)],
        instances: vec![placed(0.0), placed(1.1)],
        sources: Vec::new(),
        materials: vec![Material::plain("matt", Vec3::splat(0.5), 0.0, 1.0)],
        textures: vec![],
        lights: vec![],
        cameras: vec![Camera { name: "c".into(), position, target: Vec3::ZERO, vertical_fov_degrees: 15.0 }],
        environment: Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    };
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    let shot = Shot { eye, size: [16; 2], exposure_ev: 0.0, pixels_per_degree: PIXELS_PER_DEGREE };
    with_gpu(|gpu| {
        let (context, mut bakes) = (Context::silent(gpu), Bakes::new("light-is-baked-once".as_ref()));
        let mut cost = |flags: &str| {
            let settings = options(&format!("--cube-size 16 {flags}")).unwrap();
            let (bench, cost) = bakes.bench(&context, &scene, settings, shot).unwrap();
            (bench.baked.is_some(), cost)
        };
        let small = "--light baked --lightmap-size 64 --lightmap-samples";
        assert_eq!(cost("--light direct"), (false, None));
        let (now, first) = cost(&format!("{small} 8"));
        assert!(now && first.is_some_and(|cost| cost.gpu_s > 0.0), "{first:?}");
        for same in ["8 --shadow-size 512", "8 --samples 1"] {
            assert_eq!(cost(&format!("{small} {same}")), (false, first), "{same}");
        }
        let (now, other) = cost(&format!("{small} 16"));
        assert!(now && other != first, "{other:?}");
    });
}
