//! Small surfaces that shine: what smooth ones mirror of them beside what probes captured.

use std::sync::Arc;

use glam::{Mat4, Quat, Vec3};
use pbr_vr::gpu::Gpu;
use pbr_vr::render::LightModel;
use pbr_vr::scene::{Bounds, Material, Mesh, Probe, Scene};

use crate::common::solids::{Shot, Taken, ball, block, eye, flat, grey, level, take, turned, uniform, world};
use crate::common::stage::with_gpu;

const SIZE: u32 = 48;

/// A room of 2 m with a metal floor, lit by a bulb off its middle alone.
fn room(things: Vec<Mesh>) -> Scene {
    let walls = flat(0, &turned(block([-1.0; 3], [1.0; 3])));
    let floor = flat(1, &[level([-0.9, 0.9], -0.95, [-0.9, 0.9])]);
    let bulb = ball(2, [0.45, 0.2, -0.3], 0.06, 16, false);
    let shining = Material { emissive_factor: Vec3::splat(60.0), ..grey(0.5, 0.0, 1.0) };
    let meshes = [walls, floor, bulb].into_iter().chain(things).collect();
    let scene = world(meshes, vec![grey(0.4, 0.0, 1.0), grey(0.9, 1.0, 0.3), shining], vec![], uniform(0.0));
    let bounds = Bounds { min: -Vec3::ONE, max: Vec3::ONE };
    Scene { probes: vec![Probe { position: Vec3::ZERO, bounds, thing: None }], ..scene }
}

/// The floor around the bulb's mirror image, with the models and the eye placed so.
fn floor(gpu: &Arc<Gpu>, scene: &Scene, shot: Shot) -> Taken {
    let at = |p: [f32; 3]| shot.world_from_models.transform_point3(p.into()).as_dvec3().to_array();
    let up = shot.world_from_models.transform_vector3(Vec3::Y);
    assert!((up - Vec3::Y).length() < 1e-6, "eyes stand upright");
    take(gpu, scene, &eye(at([-0.3, 0.6, 0.8]), at([0.13, -0.95, 0.17]), 30.0), shot)
}

/// Means of blocks of 6 by 6 pixels.
fn blocks(taken: &Taken) -> Vec<f64> {
    let mean = |x: u32, y: u32| {
        let pixels = (0..36).map(|i| taken.pixels[((6 * y + i / 6) * SIZE + 6 * x + i % 6) as usize]);
        pixels.sum::<f64>() / 36.0
    };
    (0..SIZE / 6).flat_map(|y| (0..SIZE / 6).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect()
}

/// The share of the light that is wrong.
fn off(got: &Taken, want: &Taken) -> f64 {
    let (got, want) = (blocks(got), blocks(want));
    let wrong: f64 = got.iter().zip(&want).map(|(got, want)| (got - want).abs()).sum();
    wrong / want.iter().sum::<f64>()
}

#[test]
fn a_floor_mirrors_a_bulb_where_it_hangs_and_not_where_a_thing_hides_it() {
    let thing = flat(0, &block([0.14, -0.4, -0.2], [0.44, -0.35, 0.08]));
    with_gpu(|gpu| {
        let pictures = |things| {
            let scene = room(things);
            let exact = floor(gpu, &scene, Shot::reference(LightModel::Baked, SIZE, 96));
            (floor(gpu, &scene, Shot::new(LightModel::Baked, SIZE)), exact)
        };
        let ((bare, exact), (hidden, exact_hidden)) = (pictures(vec![]), pictures(vec![thing]));
        let (seen, behind) = (off(&bare, &exact), off(&hidden, &exact_hidden));
        let (brightest, left) = (bare.largest() / exact.quantile(0.999), hidden.largest() / bare.largest());
        println!("off by {seen:.3}, {behind:.3} behind a thing; brightest {brightest:.3}; {left:.3} behind the thing");
        assert!(seen < 0.12 && behind < 0.2, "{seen}, {behind}");
        assert!((0.8..1.2).contains(&brightest) && left < 0.5, "{brightest}, {left}");
    });
}

#[test]
fn mirrored_bulbs_and_their_shadows_move_with_the_models() {
    let thing = flat(0, &block([0.2, -0.4, -0.2], [0.44, -0.35, 0.0]));
    let scene = room(vec![thing]);
    let placed = Mat4::from_rotation_translation(Quat::from_rotation_y(2.0), Vec3::new(3.0, -1.0, 0.5));
    with_gpu(|gpu| {
        let [still, moved] = [Mat4::IDENTITY, placed].map(|world_from_models| {
            floor(gpu, &scene, Shot { world_from_models, ..Shot::new(LightModel::Baked, SIZE) })
        });
        let off = off(&moved, &still);
        println!("off by {off:.4}");
        assert!(off < 0.03, "{off}");
    });
}
