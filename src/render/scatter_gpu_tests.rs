//! glsl/scatter.glsl: its value against f64, and its samples against its own density.

use std::f64::consts::TAU;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, Vec3};

use super::bindings::SCENE;
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Gpu, Pipeline, Sampler,
    read_buffer, submit_and_wait,
};
use crate::precompute::BrdfTable;
use crate::precompute::harness_tests::{Judge, Random, with_gpu};
use crate::reference::brdf::{
    Fresnel, Geometry, d_ggx_stretched, f_schlick, round_roughness, specular, stretched_alphas, v_smith_stretched,
};
use crate::reference::clearcoat::Clearcoat;
use crate::reference::energy::{Curve, Energy, Scattering};
use crate::reference::film::Film;
use crate::reference::sheen::{sheen_albedo, sheen_brdf, under_sheen};
use crate::reference::split_sum::SplitSum;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    v: [f32; 3],
    l: [f32; 3],
    base_color: [f32; 3],
    metallic: f32,
    /// F0 and F90.
    dielectric: [f32; 4],
    /// Share, index of refraction, thickness.
    film: [f32; 3],
    roughness: f32,
    clearcoat: f32,
    clearcoat_roughness: f32,
    clearcoat_n: [f32; 3],
    sheen: [f32; 3],
    sheen_roughness: f32,
    /// Strength, along (0.8, 0.6, 0).
    stretch: f32,
    bits: [u32; 4],
}

impl Input {
    /// White of index 1.5, half rough, without a coat.
    fn plain(v: Vec3, l: Vec3, bits: [u32; 4]) -> Self {
        Self {
            v: v.into(),
            l: l.into(),
            base_color: [1.0; 3],
            metallic: 0.0,
            dielectric: [0.04, 0.04, 0.04, 1.0],
            film: [0.0, 1.0, 0.0],
            roughness: 0.5,
            clearcoat: 0.0,
            clearcoat_roughness: 1.0,
            clearcoat_n: [0.0, 0.0, 1.0],
            sheen: [0.0; 3],
            sheen_roughness: 1.0,
            stretch: 0.0,
            bits,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    value: [f32; 3],
    density: f32,
    l: [f32; 3],
    mirrored: u32,
    sample_value: [f32; 3],
    sample_density: f32,
    share: f32,
}

fn run(gpu: &Arc<Gpu>, inputs: &[Input]) -> Vec<Output> {
    let table = BrdfTable::new(&Context::silent(gpu), Geometry::Smith, SplitSum::Moment).unwrap();
    let sampler = Sampler::new(gpu, "clamped", AddressMode::Clamp, 1).unwrap();
    let from = Buffer::with_bytes(gpu, "inputs", BufferKind::FromCpu, bytemuck::cast_slice(inputs)).unwrap();
    let to = Buffer::new(gpu, "outputs", BufferKind::Storage, (size_of::<Output>() * inputs.len()) as u64).unwrap();
    let io = DescriptorSetLayout::new(gpu, "io", &[BindingType::Storage; 2]).unwrap();
    let kinds: Vec<BindingType> = SCENE.bindings.iter().map(|(_, kind)| *kind).collect();
    let scene = DescriptorSetLayout::new(gpu, "scene", &kinds).unwrap();
    // Only the table is read.
    let bound = kinds.iter().map(|kind| match kind {
        BindingType::Sampled => Binding::Sampled(&table.image, &sampler),
        BindingType::Uniform => Binding::Uniform(&from, 16),
        _ => Binding::Storage(&from),
    });
    let scene_set = DescriptorSet::new(gpu, "scene", &scene, &bound.collect::<Vec<_>>()).unwrap();
    let io_set = DescriptorSet::new(gpu, "io", &io, &[Binding::Storage(&from), Binding::Storage(&to)]).unwrap();
    let pipeline = Pipeline::compute(gpu, "test_scatter.comp", &[], &[&io, &scene, &io], 0).unwrap();
    submit_and_wait(gpu, |commands| {
        commands.bind(&pipeline, &[&io_set, &scene_set, &io_set]);
        commands.dispatch([inputs.len().div_ceil(64) as u32, 1, 1]);
        Ok(())
    })
    .unwrap();
    bytemuck::pod_collect_to_vec(&read_buffer(gpu, &to).unwrap())
}

fn slanted(cosine: f64, longitude: f64) -> DVec3 {
    let across = (1.0 - cosine * cosine).sqrt();
    DVec3::new(across * longitude.cos(), across * longitude.sin(), cosine)
}

/// Across and around, cells of equal solid angle.
const GRID: [u32; 2] = [256, 512];

/// The density's integral is the part of samples that lie above the surface, and the mean of value over density is the
/// value's integral: two ways to the same light.
#[test]
fn samples_have_the_density_that_is_said() {
    with_gpu(|gpu| {
        // The last: factor, roughness and inclination of a clear coat; gray and roughness of sheen, and how much
        // highlights are stretched.
        let no_sheen = [0.0f32, 1.0, 0.0];
        for (
            metallic,
            roughness,
            base_color,
            cosine,
            [clearcoat, clearcoat_roughness, inclination],
            [sheen, sheen_roughness, stretch],
        ) in [
            (0.0f32, 1.0f32, 0.8f32, 0.9, [0.0f32; 3], no_sheen),
            (0.0, 0.4, 0.5, 0.3, [0.0; 3], no_sheen),
            (1.0, 0.5, 0.9, 0.7, [0.0; 3], no_sheen),
            (1.0, 1.0, 1.0, 0.1, [0.0; 3], no_sheen),
            (0.5, 0.7, 0.3, 0.5, [0.0; 3], no_sheen),
            (0.0, 0.3, 0.0, 0.8, [0.0; 3], no_sheen),
            (0.0, 0.8, 0.1, 0.8, [1.0, 0.3, 0.0], no_sheen),
            (1.0, 0.6, 0.9, 0.4, [0.7, 0.5, 0.3], no_sheen),
            (0.0, 0.8, 0.4, 0.4, [0.0; 3], [0.8, 0.5, 0.0]),
            (1.0, 0.3, 0.6, 0.2, [0.0; 3], [1.0, 0.7, 0.0]),
            (0.0, 0.5, 0.2, 0.6, [0.5, 0.4, 0.2], [0.9, 0.3, 0.5]),
            (1.0, 0.4, 0.9, 0.5, [0.0; 3], [0.0, 1.0, 0.9]),
            (0.0, 0.5, 0.5, 0.2, [0.0; 3], [0.0, 1.0, 0.6]),
        ] {
            let v = slanted(cosine, 0.4).as_vec3();
            let mut random = Random(3);
            let cell = |i: u32| {
                let z = (f64::from(i / GRID[1]) + 0.5) / f64::from(GRID[0]);
                slanted(z, (f64::from(i % GRID[1]) + 0.5) / f64::from(GRID[1]) * TAU).as_vec3()
            };
            let mut bits = || [0; 4].map(|_: u32| random.bits() as u32);
            let count = GRID[0] * GRID[1];
            let input = |i: u32| Input {
                base_color: [base_color; 3],
                metallic,
                roughness,
                clearcoat,
                clearcoat_roughness,
                clearcoat_n: [inclination.sin(), 0.0, inclination.cos()],
                sheen: [sheen; 3],
                sheen_roughness,
                stretch,
                ..Input::plain(v, cell(i), bits())
            };
            let inputs: Vec<Input> = (0..count).map(input).collect();
            let outputs = run(gpu, &inputs);
            let solid_angle = TAU / f64::from(count);
            let density: f64 = outputs.iter().map(|o| f64::from(o.density) * solid_angle).sum();
            let value: f64 = outputs.iter().map(|o| f64::from(o.value[0]) * solid_angle).sum();
            let above: Vec<&Output> = outputs.iter().filter(|o| o.l[2] > 0.0).collect();
            let part = above.len() as f64 / f64::from(count);
            let ratio = |o: &&Output| f64::from(o.sample_value[0]) / f64::from(o.sample_density);
            let sampled = above.iter().map(ratio).sum::<f64>() / f64::from(count);
            let most = above.iter().map(ratio).fold(0.0, f64::max);
            let name = format!(
                "metallic {metallic}, roughness {roughness}, n.v {cosine}, coat {clearcoat}, sheen {sheen}, {stretch}"
            );
            println!("{name}: density {density:.4} for {part:.4}; {sampled:.4} for {value:.4}; at most {most:.2}");
            assert!((density - part).abs() < 0.006, "{name}: {density}, not {part}");
            assert!((sampled / value - 1.0).abs() < 0.01, "{name}: {sampled}, not {value}");
            // Cosine samples are few at grazing angles, where sheen is brightest.
            let bound = if sheen > 0.0 { 6.0 } else { 2.5 };
            assert!(most < bound && outputs.iter().all(|o| o.mirrored == 0), "{name}: {most}");
        }
    });
}

/// Fresnel over the share for a mirror's own direction; its other samples are diffuse, and metal has none.
#[test]
fn mirrors_have_a_direction_of_their_own() {
    with_gpu(|gpu| {
        for metallic in [0.0f32, 1.0] {
            let mut random = Random(5);
            let v = slanted(0.6, 1.0).as_vec3();
            let mut input = |_| Input {
                base_color: [0.5; 3],
                metallic,
                roughness: 0.0,
                ..Input::plain(v, Vec3::Z, [0; 4].map(|_: u32| random.bits() as u32))
            };
            let inputs: Vec<Input> = (0..4096).map(&mut input).collect();
            let outputs = run(gpu, &inputs);
            let mirrored = outputs.iter().filter(|o| o.mirrored == 1).count() as f32 / 4096.0;
            let share = outputs[0].share;
            println!("metallic {metallic}: {mirrored} mirrored, share {share}");
            assert!((mirrored - share).abs() < 0.04);
            assert!(if metallic == 1.0 { share == 1.0 } else { share < 0.5 });
            let own = Vec3::new(-v.x, -v.y, v.z);
            assert!(outputs.iter().filter(|o| o.mirrored == 1).all(|o| Vec3::from(o.l) == own));
            assert!(outputs.iter().filter(|o| o.mirrored == 0).all(|o| o.sample_density > 0.0));
        }
    });
}

#[test]
fn the_value_agrees() {
    let mut random = Random(9);
    let mut inputs = Vec::new();
    let roughnesses = [0.2f32, 0.35, 0.5, 0.75, 1.0];
    for i in 0..4000usize {
        let [v, l] = [0; 2].map(|_| slanted(0.05 + 0.95 * random.unit(), TAU * random.unit()).as_vec3());
        let base_color = random.colour().as_vec3().into();
        // A coat on every second one, inclined where it is seen from above.
        let inclined = slanted(0.9 + 0.1 * random.unit(), TAU * random.unit()).as_vec3();
        let clearcoat_n = if inclined.dot(v) > 0.05 { inclined } else { Vec3::Z }.into();
        let metallic = [0.0, 1.0, random.unit() as f32][i % 3];
        let any = (0.5 * random.colour()).extend(random.unit()).as_vec4();
        let dielectric = [[0.04, 0.04, 0.04, 1.0], any.into()][i % 2];
        let (roughness, clearcoat) = (roughnesses[i % 5], [0.0, 0.7][i / 5 % 2]);
        let coat = Input { clearcoat, clearcoat_roughness: 0.4, clearcoat_n, ..Input::plain(v, l, [0; 4]) };
        // Sheen on every fourth two.
        let sheen = [[0.0; 3], random.colour().as_vec3().into()][usize::from(i / 10 % 4 == 3)];
        let sheen_roughness = [0.2, 0.45, 1.0][i / 40 % 3];
        let film = [[0.0, 1.0, 0.0], [0.8, 1.4, 600.0 * random.unit() as f32]][usize::from(i % 7 == 3)];
        inputs.push(Input { film, base_color, metallic, dielectric, roughness, sheen, sheen_roughness, ..coat });
    }
    let coats = [0.0, 0.7].map(|factor| Clearcoat::new(factor, f64::from(0.4f32), Scattering::Multiple));
    let terms = roughnesses.map(|r| {
        let r = f64::from(r);
        (Energy::new(r, Geometry::Smith, Scattering::Multiple), Curve::new(r, Geometry::Smith))
    });
    let mut judge = Judge::default();
    let outputs = with_gpu(|gpu| run(gpu, &inputs));
    for (i, (input, output)) in inputs.iter().zip(&outputs).enumerate() {
        let (energy, curve) = &terms[i % 5];
        let [r, g, b, f90] = input.dielectric.map(f64::from);
        let energy = Energy { dielectric: Fresnel { f0: DVec3::new(r, g, b), f90 }, ..*energy };
        let [v, l, base_color] = [input.v, input.l, input.base_color].map(|v| Vec3::from(v).as_dvec3());
        let (metallic, roughness) = (f64::from(input.metallic), f64::from(input.roughness));
        let fresnel = energy.dielectric.mixed(base_color, metallic);
        let mut single = specular(DVec3::Z, v, l, fresnel, roughness, Geometry::Smith);
        let [share, ior, thickness] = input.film.map(f64::from);
        if share > 0.0 {
            let film = Film { share, ior, thickness, base_f0: fresnel.f0 };
            let vh = 0.5 * (v + l).length();
            single *= film.reflectance(fresnel, vh) / f_schlick(fresnel, vh);
        }
        let below = single + energy.beyond_single(base_color, metallic, curve.at(l.z), curve.at(v.z));
        let (sheen, sheen_roughness) = (Vec3::from(input.sheen).as_dvec3(), input.sheen_roughness.into());
        let left = under_sheen(sheen, sheen_albedo(v.z, sheen_roughness));
        let base = (left * below + sheen * sheen_brdf(DVec3::Z, v, l, sheen_roughness)) * l.z;
        let (coat, n) = (&coats[i / 5 % 2], Vec3::from(input.clearcoat_n).as_dvec3());
        let want = coat.left(n.dot(v)) * base + coat.scattered(n, v, l);
        // The table's entries are good to 2e-4; what is lost is a difference from 1, and divided by another.
        judge.near("scattered", input, &output.value, &want.to_array(), [1e-3, 2e-3]);
        assert!(output.density > 0.0 && output.share >= 0.1 && output.share <= 1.0);
    }
}

/// In a frame along the stretch; what is not single scattering is that of a round lobe of the root mean square of both alphas.
#[test]
fn stretched_highlights_agree_with_their_twin() {
    let mut random = Random(9);
    let mut judge = Judge::default();
    for (roughness, stretch) in [(0.3f32, 0.5f32), (0.5, 1.0), (0.7, 0.8)] {
        let alphas = stretched_alphas(f64::from(roughness * roughness), stretch.into());
        let round = round_roughness(alphas);
        let energy = Energy::new(round, Geometry::Smith, Scattering::Multiple);
        let curve = Curve::new(round, Geometry::Smith);
        let input = |_| {
            let [v, l] = [0; 2].map(|_| slanted(0.05 + 0.95 * random.unit(), TAU * random.unit()).as_vec3());
            let base_color = random.colour().as_vec3().into();
            Input { base_color, metallic: 1.0, roughness, stretch, ..Input::plain(v, l, [0; 4]) }
        };
        let inputs: Vec<Input> = (0..1000).map(input).collect();
        let outputs = with_gpu(|gpu| run(gpu, &inputs));
        let frame = DMat3::from_cols(DVec3::new(0.8, 0.6, 0.0), DVec3::new(-0.6, 0.8, 0.0), DVec3::Z);
        for (input, output) in inputs.iter().zip(&outputs) {
            let [v, l] = [input.v, input.l].map(|d| frame.transpose() * Vec3::from(d).as_dvec3());
            let base_color = Vec3::from(input.base_color).as_dvec3();
            let lobe = d_ggx_stretched(v + l, alphas) * v_smith_stretched(l, v, alphas);
            let single = f_schlick(base_color, 0.5 * (v + l).length()) * lobe;
            let want = (single + energy.beyond_single(base_color, 1.0, curve.at(l.z), curve.at(v.z))) * l.z;
            judge.near("scattered", input, &output.value, &want.to_array(), [1e-3, 2e-3]);
        }
    }
}
