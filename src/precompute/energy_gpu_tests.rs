//! glsl/energy.glsl and the means of the split sum's table on the GPU against their twins in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::BrdfTable;
use super::brdf_table::SIZE;
use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::context::Context;
use crate::gpu::{Subresource, read_image};
use crate::reference::brdf::{Fresnel, Geometry};
use crate::reference::energy::{Energy, Scattering, diffuse_taken, multiple_taken};
use crate::reference::split_sum::SplitSum;
use crate::reference::table::{Entry, table_arguments, table_entry};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    mean: [f32; 2],
    at_l: [f32; 2],
    at_v: [f32; 2],
    base_color: [f32; 3],
    metallic: f32,
    multiple: u32,
    fresnel: [f32; 4],
    dielectric: [f32; 4],
    roughness: f32,
    /// From all light at the normal to all at the horizon.
    grazing: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    share: [f32; 3],
    mixed: [f32; 3],
    lobe: [f32; 3],
    specular: [f32; 3],
    diffuse: [f32; 3],
    beyond: [f32; 3],
    diffuse_even: [f32; 3],
    multiple_even: [f32; 3],
    diffuse_taken: f32,
    multiple_taken: f32,
}

fn entry([scale, bias]: [f32; 2]) -> Entry {
    Entry { scale: scale.into(), bias: bias.into() }
}

/// F0 and F90.
fn any_fresnel(random: &mut Random) -> [f32; 4] {
    random.colour().extend(random.unit()).as_vec4().into()
}

fn fresnel([r, g, b, f90]: [f32; 4]) -> Fresnel {
    Fresnel { f0: Vec3::new(r, g, b).as_dvec3(), f90: f90.into() }
}

/// Any A and B with A + B ≤ 1, also with no loss and with rounding above 1.
fn inputs() -> Vec<Input> {
    let mut random = Random(6);
    let mut inputs = Vec::new();
    let ends = [[1.0, 0.0], [0.0, 1.0], [0.5, 0.500_000_1], [0.4, 0.1]];
    for i in 0..4000usize {
        let mut entry = || {
            let [total, share] = [random.unit(), random.unit()];
            [total * share, total * (1.0 - share)].map(|v| v as f32)
        };
        let mut input = Input {
            mean: entry(),
            at_l: entry(),
            at_v: entry(),
            base_color: random.colour().as_vec3().into(),
            metallic: [0.0, 1.0, random.unit() as f32][i % 3],
            multiple: u32::from(i % 5 != 0),
            fresnel: any_fresnel(&mut random),
            dielectric: [[0.04, 0.04, 0.04, 1.0], any_fresnel(&mut random)][i % 2],
            roughness: random.unit() as f32,
            grazing: 21.0 * random.unit() as f32,
        };
        if i < 64 {
            [input.mean, input.at_l, input.at_v] = [ends[i % 4], ends[i / 4 % 4], ends[i / 16]];
            input.base_color = [0.0, 1.0, 0.5];
        }
        inputs.push(input);
    }
    inputs
}

#[test]
fn what_comes_beside_single_scattering_agrees() {
    let inputs = inputs();
    let mut judge = Judge::default();
    let outputs: Vec<Output> = with_gpu(|gpu| evaluate(gpu, "test_energy.comp", &inputs));
    for (i, o) in inputs.iter().zip(&outputs) {
        let scattering = if i.multiple == 0 { Scattering::Single } else { Scattering::Multiple };
        let energy = Energy { mean: entry(i.mean), dielectric: fresnel(i.dielectric), scattering };
        let (base_color, metallic) = (Vec3::from(i.base_color).as_dvec3(), f64::from(i.metallic));
        let (at_l, at_v) = (entry(i.at_l), entry(i.at_v));
        let mixed = energy.mixed_share(base_color, metallic);
        let mut near = |what, got: [f32; 3], want: DVec3, bound| judge.near(what, i, &got, &want.to_array(), bound);
        near("multiple_share", o.share, energy.multiple_share(fresnel(i.fresnel)), [1e-6, 2e-6]);
        near("mixed_share", o.mixed, mixed, [1e-6, 2e-6]);
        near("specular_albedo", o.specular, energy.specular_albedo(fresnel(i.fresnel), at_v), [1e-6, 1e-6]);
        // What is lost is a difference of numbers near 1, and is divided by another.
        let lost = (1.0 - energy.mean.scale - energy.mean.bias).max(1e-6);
        let rounding = 3e-7 / lost;
        near("multiple", o.lobe, energy.multiple(mixed, at_l, at_v), [1e-6 + rounding, 1e-5 + rounding]);
        let want = energy.beyond_single(base_color, metallic, at_l, at_v);
        near("beyond_single", o.beyond, want, [1e-6 + rounding, 1e-5 + rounding]);
        let left = energy.left_by_dielectric(energy.mean);
        let rounding = 5e-7 / left.max(1e-6);
        near("diffuse", o.diffuse, energy.diffuse(base_color, at_l, at_v), [1e-6 + rounding, 1e-5 + rounding]);
        near("diffuse_even", o.diffuse_even, energy.diffuse_even(base_color, metallic, at_v), [1e-6, 2e-6]);
        near("multiple_even", o.multiple_even, energy.multiple_even(base_color, metallic, at_v), [1e-6, 2e-6]);
        let [roughness, grazing] = [i.roughness.into(), i.grazing.into()];
        judge.near("diffuse_taken", i, &[o.diffuse_taken], &[diffuse_taken(roughness, grazing)], [1e-6, 0.0]);
        judge.near("multiple_taken", i, &[o.multiple_taken], &[multiple_taken(roughness, grazing)], [1e-6, 1e-5]);
    }
}

/// Every row's mean, and the entries it is the mean of.
#[test]
fn the_table_holds_the_mean_of_its_rows() {
    let texels: Vec<[f32; 4]> = with_gpu(|gpu| {
        let table = BrdfTable::new(&Context::silent(gpu), Geometry::Smith, SplitSum::Moment).unwrap();
        let layer = |layer| read_image(gpu, &table.image, Subresource { mip: 0, layer }, 16).unwrap();
        bytemuck::pod_collect_to_vec(&[layer(0), layer(1)].concat())
    });
    let [width, height] = SIZE.map(|s| s as usize);
    let mut judge = Judge::default();
    for row in (0..height).step_by(19) {
        let roughness = table_arguments([0, row as u32], SIZE)[1];
        // Where both are 0 the limit depends on the way there.
        for column in (usize::from(row == 0)..width).step_by(21) {
            let [scale, bias, ..] = texels[row * width + column];
            let cosine = table_arguments([column as u32, 0], SIZE)[0];
            let want = table_entry(cosine, roughness, Geometry::Smith);
            judge.near("entry", &(cosine, roughness), &[scale, bias], &[want.scale, want.bias], [2e-4, 0.0]);
        }
        let means = &texels[(height + row) * width..][..width];
        assert!(means.iter().all(|texel| texel[2..] == means[0][2..]), "row {row}");
        let Entry { scale, bias } = Energy::new(roughness, Geometry::Smith, Scattering::Multiple).mean;
        judge.near("mean", &roughness, &means[0][2..], &[scale, bias], [2e-4, 0.0]);
    }
}
