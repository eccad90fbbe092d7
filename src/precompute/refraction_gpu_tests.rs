//! glsl/refraction.glsl on the GPU against its twin in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};

use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::refraction::{ball_path, ball_spread2, ball_variance, cross_boundary, fresnel_dielectric};
use crate::reference::sampling::sample_vndf;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    v: [f32; 3],
    h: [f32; 3],
    /// Of a ball's surface, on the side of v.
    n: [f32; 3],
    alpha: f32,
    eta: f32,
    which: f32,
    ior: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    fresnel: f32,
    l: [f32; 3],
    transmitted: f32,
    weight: f32,
    inside: [f32; 3],
    chord: f32,
    through: [f32; 3],
    variance: f32,
    spread2: f32,
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

/// Views from all sides and both sides of boundaries, of smooth and rough ones, at their horizon, too.
fn inputs() -> Vec<Input> {
    let mut random = Random(31);
    let mut make = |i: u32| {
        let mut v = random.direction();
        v.z = v.z.abs() * if i.is_multiple_of(4) { 0.05 } else { 1.0 };
        let v = v.normalize();
        let alpha = if i.is_multiple_of(3) { 0.0 } else { random.unit() };
        let h = sample_vndf(v, DVec2::new(random.unit(), random.unit()), DVec2::splat(alpha));
        let ior = 1.0 + 1.5 * random.unit();
        let n = random.direction();
        let single = |d: DVec3| d.as_vec3().to_array();
        Input {
            v: single(v),
            h: single(if alpha == 0.0 { DVec3::Z } else { h }),
            n: single(n * n.dot(v).signum()),
            ior: ior as f32,
            alpha: alpha as f32,
            eta: (if i.is_multiple_of(2) { ior } else { 1.0 / ior }) as f32,
            which: random.unit() as f32,
        }
    };
    (0..4000).map(&mut make).collect()
}

#[test]
fn boundaries_are_crossed_as_in_f64() {
    let inputs = inputs();
    let outputs: Vec<Output> = with_gpu(|gpu| evaluate(gpu, "test_refraction.comp", &inputs));
    let mut judge = Judge::default();
    let mut counts = [0; 3];
    for (input, got) in inputs.iter().zip(&outputs) {
        let path = ball_path(dvec3(input.n), dvec3(input.v), input.ior.into());
        judge.near("inside a ball", input, &got.inside, &path.inside.to_array(), [2e-6, 0.0]);
        judge.near("chord", input, &[got.chord], &[path.chord], [2e-6, 0.0]);
        judge.near("through a ball", input, &got.through, &path.l.to_array(), [2e-5, 0.0]);
        judge.near("variance", input, &[got.variance], &[ball_variance(input.ior.into())], [1e-6, 1e-5]);
        let spread2 = ball_spread2(dvec3(input.n).dot(dvec3(input.v)).max(0.0), input.ior.into());
        judge.near("spread", input, &[got.spread2], &[spread2], [1e-5, 1e-2]);
        let (v, h, eta) = (dvec3(input.v), dvec3(input.h), f64::from(input.eta));
        let vh = v.dot(h).max(0.0);
        let fresnel = fresnel_dielectric(vh, eta);
        let square = eta * eta - 1.0 + vh * vh;
        // At total reflection's edge the root has few digits.
        judge.near("Fresnel", input, &[got.fresnel], &[fresnel], [if square.abs() < 1e-3 { 4e-3 } else { 4e-5 }, 0.0]);
        let want = cross_boundary(v, h, input.alpha.into(), eta, input.which.into());
        // What rounding decides.
        if (f64::from(input.which) - fresnel).abs() < 5e-3 || square.abs() < 1e-3 {
            continue;
        }
        if want.weight == 0.0 || got.weight == 0.0 {
            assert!(want.l.z.abs() < 1e-3 && got.l[2].abs() < 1e-3, "{input:?}: {want:?}, {got:?}");
            counts[2] += usize::from(want.weight == 0.0);
            continue;
        }
        counts[usize::from(want.transmitted)] += 1;
        assert_eq!(got.transmitted, f32::from(u8::from(want.transmitted)), "{input:?}");
        judge.near("direction", input, &got.l, &want.l.to_array(), [1e-4, 0.0]);
        judge.near("weight", input, &[got.weight], &[want.weight], [1e-4, 2e-4]);
    }
    assert!(counts.iter().all(|count| *count > 30), "mirrored, gone through, lost: {counts:?}");
}
