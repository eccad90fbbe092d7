//! `glsl/shadow_place.glsl` against `reference::shadow`.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};

use crate::precompute::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::shadow::{lamp_place, sun_place};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    q: [f32; 3],
    n: [f32; 3],
    near: f32,
    radius: f32,
    texels: f32,
    sizes: [f32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    uv: [f32; 2],
    layer: f32,
    depth: f32,
    slope: [f32; 2],
    spread: [f32; 2],
    sun_depth: f32,
    sun_slope: [f32; 2],
    sun_uv: [f32; 2],
    sun_back: [f32; 2],
}

#[test]
fn places_in_maps_agree() {
    let mut random = Random(14);
    let inputs: Vec<Input> = (0..4000)
        .map(|i| {
            let q = random.direction() * 10f64.powf(4.0 * random.unit() - 2.0);
            let n = random.direction();
            // Towards the lamp, and now and then away from it.
            let n = if i % 16 > 0 && n.dot(q) > 0.0 { -n } else { n };
            let near = 10f64.powf(-1.0 - 3.0 * random.unit()) as f32;
            let radius = if i % 3 == 0 { 0.0 } else { random.unit() as f32 };
            let sizes = [(); 3].map(|()| 10f64.powf(3.0 * random.unit() - 1.0) as f32);
            Input { q: q.as_vec3().into(), n: n.as_vec3().into(), near, radius, texels: 1024.0, sizes }
        })
        .collect();
    let mut judge = Judge::default();
    let outputs: Vec<Output> = with_gpu(|gpu| evaluate(gpu, "test_shadow.comp", &inputs));
    for (input, got) in inputs.iter().zip(&outputs) {
        let [q, n] = [input.q, input.n].map(|v| DVec3::from(v.map(f64::from)));
        let (near, radius) = (f64::from(input.near), f64::from(input.radius));
        let want = lamp_place(q, n, near, radius, 1024.0);
        judge.near("layer", input, &[got.layer], &[f64::from(want.layer)], [0.0, 0.0]);
        judge.near("uv", input, &got.uv, &want.uv.to_array(), [5e-7, 0.0]);
        judge.near("depth", input, &[got.depth], &[want.depth], [0.0, 2e-6]);
        judge.near("spread", input, &got.spread, &want.spread.to_array(), [0.0, 2e-6]);
        // The plane's height over the lamp cancels where it is seen at a slant.
        let slant = (-n.dot(q) / q.length()).max(0.01);
        judge.near(
            "slope",
            input,
            &got.slope,
            &want.slope.to_array(),
            [1e-6 * near / q.length() / slant, 1e-6 / slant],
        );
        let sizes = DVec3::from(input.sizes.map(f64::from));
        let sun = sun_place(q, n * sizes, sizes * sizes, DVec2::splat(radius), 1024.0);
        judge.near("sun's slope", input, &got.sun_slope, &sun.slope.to_array(), [1e-5, 1e-5]);
        let slip = 1e-6 * (1.0 + q.abs().max_element() + (sun.depth - q.z).abs());
        judge.near("sun's depth", input, &[got.sun_depth], &[sun.depth], [slip, 0.0]);
        judge.near("the way back", input, &got.sun_back, &sun.back.to_array(), [1e-9, 1e-5]);
        judge.near("sun's uv", input, &got.sun_uv, &sun.uv.to_array(), [slip, 1e-6]);
    }
}
