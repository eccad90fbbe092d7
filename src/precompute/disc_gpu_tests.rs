//! glsl/disc.glsl on the GPU against its twin in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};

use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::disc::{
    DISC_MIN_ALPHA, disc_cosine, disc_coverage, disc_density, disc_ggx, disc_phong_exponent, disc_radiance,
    disc_specular, disc_versine, sample_disc,
};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    n: [f32; 3],
    v: [f32; 3],
    l: [f32; 3],
    f0: [f32; 3],
    alpha: f32,
    sine: f32,
    exponent: f32,
    angle: f32,
    radius: f32,
    pixel: f32,
    u: [f32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    versine: f32,
    cosine: f32,
    ggx: f32,
    phong: f32,
    coverage: f32,
    density_inside: f32,
    density_outside: f32,
    specular: [f32; 3],
    direction: [f32; 3],
    radiance: [f32; 3],
}

/// Unit vectors of any place, every third light near the mirror image of the eye, and every fifth near the horizon.
fn inputs() -> Vec<Input> {
    let mut random = Random(11);
    let alphas = [0.0, 4e-4, 0.0025, 0.01, 0.1, 0.5, 1.0];
    let make = |i: u32| {
        let n = random.direction();
        let mut v = random.direction();
        v *= v.dot(n).signum();
        let sine = f64::from(random.below(4)).mul_add(0.3, 0.2665).to_radians().sin();
        let mut l = random.direction();
        if i.is_multiple_of(3) {
            l = 2.0 * n.dot(v) * n - v + random.direction() * (2.0 * sine * random.unit());
        } else if i.is_multiple_of(5) {
            l += (2.0 * sine * (random.unit() - 0.5) - l.dot(n)) * n;
        }
        let single = |d: DVec3| d.normalize().as_vec3().to_array();
        Input {
            n: single(n),
            v: single(v),
            l: single(l),
            f0: random.colour().as_vec3().to_array(),
            alpha: alphas[random.below(7) as usize],
            sine: sine as f32,
            exponent: 10f64.powf(6.0 * random.unit() - 1.0) as f32,
            angle: (0.03 * random.unit()) as f32,
            radius: (0.004 + 0.02 * random.unit()) as f32,
            pixel: (0.03 * random.unit()) as f32,
            u: [random.unit() as f32, random.unit() as f32],
        }
    };
    (0..6000).map(make).collect()
}

#[test]
fn discs_agree() {
    let inputs = inputs();
    let mut judge = Judge::default();
    let outputs: Vec<Output> = with_gpu(|gpu| evaluate(gpu, "test_disc.comp", &inputs));
    for (input, output) in inputs.iter().zip(&outputs) {
        let [n, v, l, f0] = [input.n, input.v, input.l, input.f0].map(|v| Vec3::from(v).as_dvec3());
        let [alpha, sine] = [input.alpha, input.sine].map(f64::from);
        judge.near("disc_versine", input, &[output.versine], &[disc_versine(sine)], [0.0, 1e-6]);
        judge.near("disc_cosine", input, &[output.cosine], &[disc_cosine(n.dot(l), sine)], [2e-7, 0.0]);
        if n.dot(v) > 1e-3 && n.dot(l) > 1e-3 && (v + l).length() > 0.05 {
            // What D changes by where vectors change by an ulp: most beside the edge of a mirror's disc.
            let own = alpha.max(DISC_MIN_ALPHA);
            let d = disc_ggx(n, v, l, own, sine);
            let peak = disc_ggx(n, n, n, own, sine);
            judge.near("disc_ggx", input, &[output.ggx], &[d], [2e-4 * peak, 2e-3]);
            let specular = disc_specular(n, v, l, f0, alpha, sine);
            let most = specular.max_element() / d.max(1e-30) * peak;
            judge.near("disc_specular", input, &output.specular, &specular.to_array(), [5e-4 * most, 5e-3]);
        }
        let wide = disc_phong_exponent(input.exponent.into(), sine);
        judge.near("disc_phong_exponent", input, &[output.phong], &[wide], [0.0, 1e-5]);
        let coverage = disc_coverage(input.angle.into(), input.radius.into(), input.pixel.into());
        // The ramp runs over a pixel: the less, the steeper.
        let bound = 1e-6 + 1e-9 / f64::from(input.pixel);
        judge.near("disc_coverage", input, &[output.coverage], &[coverage], [bound, 1e-5]);
        let sample = sample_disc(DVec2::new(input.u[0].into(), input.u[1].into()), l, sine);
        judge.near("sample_disc", input, &output.direction, &sample.to_array(), [1e-6, 0.0]);
        let density = disc_density(l, l, sine);
        judge.near(
            "disc_density",
            input,
            &[output.density_inside, output.density_outside],
            &[density, 0.0],
            [0.0, 1e-5],
        );
        judge.near("disc_radiance", input, &output.radiance, &disc_radiance(f0, sine).to_array(), [0.0, 1e-5]);
    }
}
