//! Films of glsl/fresnel.glsl on the GPU against their twins in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::brdf::Fresnel;
use crate::reference::film::Film;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    base_color: [f32; 3],
    metallic: f32,
    base_f0: [f32; 3],
    f90: f32,
    /// Share, index of refraction, thickness.
    film: [f32; 3],
    cosine: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    film: [f32; 3],
    reflectance: [f32; 3],
    seen: [f32; 3],
}

#[test]
fn films_agree_with_their_twin() {
    let mut random = Random(41);
    let mut unit = || random.unit() as f32;
    let input = |i: u32| Input {
        base_color: [unit(), unit(), unit()],
        metallic: [0.0, 1.0, unit()][i as usize % 3],
        base_f0: [0.3 * unit(); 3],
        f90: [1.0, unit()][i as usize % 2],
        film: [1.0 - unit() * unit(), 1.0 + 1.5 * unit(), 1200.0 * unit()],
        cosine: if i < 2 { i as f32 } else { unit() },
    };
    let inputs: Vec<Input> = (0..4096).map(input).collect();
    let outputs: Vec<Output> = with_gpu(|gpu| evaluate(gpu, "test_fresnel.comp", &inputs));
    let mut judge = Judge::default();
    for (i, o) in inputs.iter().zip(&outputs) {
        let dvec3 = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let dielectric = Fresnel { f0: dvec3(i.base_f0), f90: i.f90.into() };
        let bare = dielectric.mixed(dvec3(i.base_color), i.metallic.into());
        let [share, ior, thickness] = i.film.map(f64::from);
        let film = Film { share, ior, thickness, base_f0: bare.f0 };
        let (cosine, want) = (f64::from(i.cosine), film.film_reflectance(i.cosine.into()).min(DVec3::ONE));
        // A phase of up to 40 is exact to 2e-6.
        judge.near("film_reflectance", i, &o.film, &want.to_array(), [2e-5, 0.0]);
        let want = film.reflectance(bare, cosine);
        judge.near("reflectance", i, &o.reflectance, &want.to_array(), [2e-5, 0.0]);
        // What is darker than Schlick's form of black cannot be said by it.
        let least = crate::reference::brdf::schlick_weight(cosine);
        judge.near("seen", i, &o.seen, &want.max(DVec3::splat(least)).to_array(), [3e-5, 0.0]);
    }
}
