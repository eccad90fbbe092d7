//! glsl/math.glsl, levels.glsl, tone.glsl, cube.glsl, openness.glsl, importance_chances.glsl, probe_box.glsl and split_sum.glsl on the
//! GPU against their twins in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};

use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::brdf::Geometry;
use crate::reference::cube::{
    cube_direction, cube_face, cube_texel_solid_angle, panorama_direction, panorama_texel_solid_angle, panorama_uv,
    rotate_y,
};
use crate::reference::importance::{Tried, seen_share};
use crate::reference::levels::level_from_spread;
use crate::reference::lobe::{grazing_kernel, grazing_second_derivative, kernel, kernel_second_derivative};
use crate::reference::math::{normalize_or, round_to_half};
use crate::reference::openness::{image_bound, most_radiance, openness_from_mean, visibility};
use crate::reference::probe::{box_exit, is_in_image, probe_weight};
use crate::reference::split_sum::{Match, SplitSum, turned_spread};
use crate::reference::table::{Lobe, LobePart, table_arguments, table_lobe, table_place};
use crate::reference::tone::{exposure_scale, luminance, srgb_decode, srgb_encode, tone_neutral};

fn dvec3(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

fn dvec2(v: [f32; 2]) -> DVec2 {
    DVec2::new(v[0].into(), v[1].into())
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct MathInput {
    v: [f32; 3],
    otherwise: [f32; 3],
}

/// Case 17 of tests/gpu/stability.rs.
#[test]
fn normals_of_any_size_are_unit_vectors() {
    let mut random = Random(1);
    let otherwise = [0.0, 0.6, 0.8];
    let mut vectors = vec![[0.0; 3], [f32::NAN, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0], [f32::MAX, 0.0, 0.0]];
    for exponent in -44..=37 {
        let size = 10f64.powi(exponent);
        vectors.extend((0..8).map(|_| (random.direction() * size).as_vec3().to_array()));
        vectors.push([0.0, -size as f32, 0.0]);
    }
    let inputs: Vec<_> = vectors.into_iter().map(|v| MathInput { v, otherwise }).collect();
    let mut judge = Judge::default();
    let outputs: Vec<[[f32; 3]; 2]> = with_gpu(|gpu| evaluate(gpu, "test_math.comp", &inputs));
    for (input, [unit, half]) in inputs.iter().zip(&outputs) {
        let v = dvec3(input.v).abs();
        if v.is_finite() && v.min_element() > 6e-5 && v.max_element() < 65_000.0 {
            judge.near("round_to_half", input, half, &round_to_half(v).to_array(), [0.0, 1e-9]);
            assert!(half.iter().all(|c| half::f16::from_f32(*c).to_f32() == *c), "{input:?}: {half:?} is no half");
        }
        let want = normalize_or(dvec3(input.v), dvec3(input.otherwise));
        // At the thresholds themselves both answers are right.
        let size: f64 = input.v.iter().map(|c| f64::from(c.abs())).sum();
        if [1e-30, 1e30].iter().any(|t| (size / t - 1.0).abs() < 1e-5) {
            continue;
        }
        judge.near("normalize_or", input, unit, &want.to_array(), [5e-7, 0.0]);
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LevelsInput {
    spread: f32,
    alpha: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LevelsOutput {
    level: f32,
    mean: f32,
    grazing: f32,
    coordinate: [f32; 2],
    arguments: [f32; 2],
}

#[test]
fn levels_lobes_and_table_places_agree() {
    let mut inputs = Vec::new();
    for alpha in [1.0 / 64.0, 0.1, 0.5, 1.0, 4.0] {
        inputs.extend((0..=1000).map(|i| LevelsInput { spread: i as f32 / 1000.0, alpha }));
    }
    let mut judge = Judge::default();
    let outputs: Vec<LevelsOutput> = with_gpu(|gpu| evaluate(gpu, "test_levels.comp", &inputs));
    for ((i, input), got) in (0u32..).zip(&inputs).zip(&outputs) {
        let (spread, alpha) = (f64::from(input.spread), f64::from(input.alpha));
        judge.near("level_from_spread", input, &[got.level], &[level_from_spread(spread)], [5e-5, 0.0]);
        // The sign of a cosine of 0 is rounding's.
        let c = 2.0 * spread - 1.0;
        if c.abs() > 1e-6 {
            let variance = 0.01 * spread * (1.0 - c * c);
            let mean = kernel(c, alpha) + variance * kernel_second_derivative(c, alpha);
            judge.near("lobe_mean", input, &[got.mean], &[mean], [0.0, 1e-3]);
            let grazing = grazing_kernel(c) + variance * grazing_second_derivative(c);
            judge.near("grazing_mean", input, &[got.grazing], &[grazing], [1e-6, 1e-5]);
        }
        let place = table_place(spread, alpha.min(1.0));
        let size = [128.0, 96.0];
        let coordinate = [0, 1].map(|i| (place[i] * (size[i] - 1.0) + 0.5) / size[i]);
        judge.near("table_coordinate", input, &got.coordinate, &coordinate, [1e-5, 0.0]);
        let arguments = table_arguments([i % 128, i % 96], [128, 96]);
        judge.near("table_arguments", input, &got.arguments, &arguments, [1e-6, 1e-5]);
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ToneInput {
    rgb: [f32; 3],
    ev: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ToneOutput {
    scale: f32,
    luminance: f32,
    neutral: [f32; 3],
    encoded: [f32; 3],
    decoded: [f32; 3],
}

#[test]
fn tone_agrees() {
    let mut random = Random(2);
    let mut colours = vec![
        [0.0; 3],
        [0.0031308; 3],
        [0.0031309; 3],
        [0.04045; 3],
        [0.76; 3],
        [0.08; 3],
        [1.0; 3],
        [1e30; 3],
        [1e20, 0.0, 1e-20],
        [1e-40, 1e-38, 0.0],
    ];
    for exponent in -6..=6 {
        colours.extend((0..64).map(|_| (random.colour() * 10f64.powi(exponent)).as_vec3().to_array()));
    }
    let mut inputs: Vec<_> =
        colours.into_iter().map(|rgb| ToneInput { rgb, ev: 40.0 * random.unit() as f32 - 20.0 }).collect();
    let ordinary = inputs.len();
    inputs.extend(
        [[f32::INFINITY; 3], [f32::INFINITY, 1.0, 0.0], [-1.0, -0.0, 0.5], [-1e30, 1e30, 0.0]]
            .map(|rgb| ToneInput { rgb, ev: 0.0 }),
    );
    let mut judge = Judge::default();
    let outputs: Vec<ToneOutput> = with_gpu(|gpu| evaluate(gpu, "test_tone.comp", &inputs));
    for (i, (input, output)) in inputs.iter().zip(&outputs).enumerate() {
        let rgb = dvec3(input.rgb);
        judge.near("tone_neutral", input, &output.neutral, &tone_neutral(rgb).to_array(), [1e-6, 1e-6]);
        let encoded = srgb_encode(rgb.clamp(DVec3::ZERO, DVec3::ONE));
        // A byte is 4e-3; pow may be off by 2e-5 where a driver takes the specification's leave.
        judge.near("srgb_encode", input, &output.encoded, &encoded.to_array(), [2e-5, 0.0]);
        let decoded = srgb_decode(rgb.clamp(DVec3::ZERO, DVec3::ONE));
        judge.near("srgb_decode", input, &output.decoded, &decoded.to_array(), [2e-5, 0.0]);
        judge.near("exposure_scale", input, &[output.scale], &[exposure_scale(input.ev.into())], [0.0, 1e-5]);
        let lowest = output.neutral.iter().chain(&output.encoded).chain(&output.decoded).copied().fold(0.0, f32::min);
        assert!(lowest >= 0.0, "{input:?}: {output:?}");
        if i < ordinary {
            judge.near("luminance", input, &[output.luminance], &[luminance(rgb)], [1e-37, 1e-6]);
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct CubeInput {
    d: [f32; 3],
    st: [f32; 2],
    uv: [f32; 2],
    cos_sin: [f32; 2],
    face: u32,
    cube_size: u32,
    row: u32,
    texel: [u32; 2],
    panorama_size: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct CubeOutput {
    direction: [f32; 3],
    face: [f32; 3],
    panorama_direction: [f32; 3],
    turned: [f32; 3],
    uv: [f32; 2],
    cube_texel: f32,
    panorama_texel: f32,
}

fn cube_inputs() -> Vec<CubeInput> {
    let mut random = Random(3);
    // Cases 10 and 11 of tests/gpu/stability.rs: the poles, all but the poles, the seam from both sides; then edges and
    // corners.
    let tiny = 1e-7f32;
    let mut directions =
        vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [-0.0, 1.0, -0.0], [1e-30, 1.0, -1e-30], [tiny, 1.0, tiny]];
    directions.extend([
        [-1.0, 0.0, 0.0],
        [-1.0, 0.0, -0.0],
        [-1.0, 0.0, tiny],
        [-1.0, 0.0, -tiny],
        [0.0, 1.000_000_1, 0.0],
    ]);
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            directions.extend([-1.0, 0.0, 1.0].map(|z| [x, y, z]).into_iter().filter(|d| *d != [0.0; 3]));
        }
    }
    directions.extend((0..2000).map(|_| {
        let length = 10f64.powf(6.0 * random.unit() - 3.0);
        (random.direction() * length).as_vec3().to_array()
    }));
    let corners = [0.0, 0.5, 1.0];
    let make = |(i, d)| {
        let i: usize = i;
        let cube_size = 1 << random.below(12);
        let panorama_size = [1 + random.below(16384), 1 + random.below(8192)];
        let mut point = || [random.unit() as f32, random.unit() as f32];
        let (mut st, mut uv) = (point(), point());
        if i < 9 {
            (st, uv) = ([corners[i % 3], corners[i / 3]], [corners[i % 3], corners[i / 3]]);
        }
        let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
        // The first and last texels of faces and rows of panoramas come often.
        let mut texel = || match random.below(4) {
            0 => 0,
            1 => cube_size - 1,
            _ => random.below(cube_size),
        };
        let texel = [texel(), texel()];
        let row = [0, panorama_size[1] - 1, random.below(panorama_size[1])][i % 3];
        CubeInput {
            d,
            st,
            uv,
            cos_sin: [cos as f32, sin as f32],
            face: i as u32 % 6,
            cube_size,
            row,
            texel,
            panorama_size,
        }
    };
    directions.into_iter().enumerate().map(make).collect()
}

#[test]
fn directions_and_solid_angles_agree() {
    let inputs = cube_inputs();
    let mut judge = Judge::default();
    let outputs: Vec<CubeOutput> = with_gpu(|gpu| evaluate(gpu, "test_cube.comp", &inputs));
    for (input, output) in inputs.iter().zip(&outputs) {
        let d = dvec3(input.d);
        let want = cube_direction(input.face, dvec2(input.st)).to_array();
        judge.near("cube_direction", input, &output.direction, &want, [5e-7, 0.0]);
        let (face, st) = cube_face(d);
        judge.near("cube_face", input, &output.face, &[st.x, st.y, f64::from(face)], [5e-7, 0.0]);
        let want = panorama_direction(dvec2(input.uv)).to_array();
        judge.near("panorama_direction", input, &output.panorama_direction, &want, [2e-6, 0.0]);
        let want = rotate_y(d, dvec2(input.cos_sin)).to_array();
        judge.near("rotate_y", input, &output.turned, &want, [5e-7 * d.length(), 0.0]);
        let mut want = panorama_uv(d);
        // u = 0 and u = 1 are one meridian.
        want.x += (f64::from(output.uv[0]) - want.x).round();
        if d.x.hypot(d.z) < 1e-18 {
            want.x = output.uv[0].into(); // at the poles any meridian will do
        }
        judge.near("panorama_uv", input, &output.uv, &want.to_array(), [2e-6, 0.0]);
        assert!(output.uv.iter().all(|c| (0.0..=1.0).contains(c)), "{input:?}: {:?}", output.uv);
        // Mesa's atan is 2.1e-5 too low near 0, the same for all small texels.
        let want = cube_texel_solid_angle(input.texel, input.cube_size);
        judge.near("cube_texel_solid_angle", input, &[output.cube_texel], &[want], [0.0, 3e-5]);
        let want = panorama_texel_solid_angle(input.row, input.panorama_size);
        judge.near("panorama_texel_solid_angle", input, &[output.panorama_texel], &[want], [0.0, 2e-6]);
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ProbeInput {
    p: [f32; 3],
    d: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
    border: f32,
    t: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ProbeOutput {
    exit: [f32; 3],
    weight: f32,
    is_in_image: u32,
}

#[test]
fn rays_leave_boxes_and_weights_fall_as_in_f64() {
    let mut random = Random(21);
    let (low, high) = (DVec3::new(-1.0, 0.5, -4.0), DVec3::new(2.0, 3.0, -1.0));
    let input = |p: DVec3, d: DVec3| ProbeInput {
        p: p.as_vec3().into(),
        d: d.as_vec3().into(),
        low: low.as_vec3().into(),
        high: high.as_vec3().into(),
        border: 0.5,
        t: 1.5,
    };
    let mut inputs: Vec<_> = (0..2000)
        .map(|i| {
            let far = if i % 2 == 0 { 1.2 } else { 2.2 };
            input(0.5 * (low + high) + far * random.direction(), 3.0 * random.direction())
        })
        .collect();
    // Along an axis, and on a side of the box.
    inputs.extend([DVec3::X, -DVec3::Y, DVec3::Z].map(|d| input(0.5 * (low + high), d)));
    inputs.extend([DVec3::X, -DVec3::Y, DVec3::Z].map(|d| input(low, d)));
    let outputs: Vec<ProbeOutput> = with_gpu(|gpu| evaluate(gpu, "test_probe.comp", &inputs));
    let mut judge = Judge::default();
    let (mut inside, mut between, mut in_image) = (0, 0, 0);
    for (input, got) in inputs.iter().zip(&outputs) {
        let [p, d, low, high] = [input.p, input.d, input.low, input.high].map(dvec3);
        let want = box_exit(p, d, [low, high]);
        judge.near("box_exit", input, &got.exit, &want.to_array(), [2e-5, 2e-5]);
        let on_a_side = (want - low).abs().min((want - high).abs()).min_element();
        assert!(on_a_side < 1e-6 && (want.clamp(low, high) - want).length() < 1e-6, "{input:?}: {want}");
        let weight = probe_weight(p, [low, high], input.border.into());
        judge.near("probe_weight", input, &[got.weight], &[weight], [5e-6, 0.0]);
        let shown = is_in_image(p, d.normalize(), input.t.into(), [low, high]);
        // Far enough from where it changes for digits to tell.
        if (0.75 * p.distance(want) - 1.5).abs() > 1e-4 {
            assert_eq!(got.is_in_image, u32::from(shown), "{input:?}");
        }
        in_image += usize::from(shown);
        inside += usize::from(weight == 1.0);
        between += usize::from(weight > 0.0 && weight < 1.0);
    }
    assert!(inside > 200 && between > 200, "{inside} inside, {between} on the border");
    assert!(in_image > 200 && in_image < inputs.len() - 200, "{in_image} in the image");
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ImportanceInput {
    tried: Tried,
    chance: f32,
}

#[test]
fn chances_of_tiles_are_learned_as_in_f64() {
    let mut random = Random(31);
    let mut inputs: Vec<_> = (0..2000)
        .map(|i| {
            let rays = (1e6 * random.unit().powi(4)) as u32;
            let seen = if i % 3 == 0 { 0 } else { (63.0 * random.unit() * f64::from(rays)) as u32 };
            ImportanceInput { tried: Tried { rays, seen }, chance: random.unit() as f32 }
        })
        .collect();
    inputs.extend([0.0, 1.0, 1.0 + f32::EPSILON].map(|chance| ImportanceInput { tried: Tried::default(), chance }));
    let outputs: Vec<[f32; 2]> = with_gpu(|gpu| evaluate(gpu, "test_importance.comp", &inputs));
    let mut judge = Judge::default();
    for (input, got) in inputs.iter().zip(&outputs) {
        let want = [seen_share(input.tried), f64::from(input.chance).min(1.0)];
        judge.near("share and chance", input, got, &want, [1e-6, 1e-6]);
    }
    assert_eq!([outputs[2000][1], outputs[2001][1], outputs[2002][1]], [0.0, 1.0, 1.0]);
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct OpennessInput {
    n: [f32; 3],
    mean: [f32; 3],
    d: [f32; 3],
    spread: f32,
    cosine: f32,
    over_pi: f32,
    open_over_pi: f32,
}

#[test]
fn openness_is_as_in_f64() {
    let mut random = Random(22);
    let mut inputs: Vec<_> = (0..4000)
        .map(|i| {
            let (n, tilt) = (random.direction(), random.direction());
            // No mean is longer than an open sky's.
            let mean = (n * random.unit() + 0.5 * tilt * f64::from(i % 2)).clamp_length_max(2.0 / 3.0);
            let [n, mean, d] = [n, mean, random.direction()].map(|v| v.as_vec3().into());
            let (spread, cosine) = (random.unit() as f32, (2.0 * random.unit() - 1.0) as f32);
            let [over_pi, open_over_pi] = [random.unit() as f32, random.unit() as f32];
            OpennessInput { n, mean, d, spread, cosine, over_pi, open_over_pi }
        })
        .collect();
    // Closed; a mirror; all from one side.
    let closed = OpennessInput {
        n: [0.0, 1.0, 0.0],
        mean: [0.0; 3],
        d: [1.0, 0.0, 0.0],
        spread: 0.0,
        cosine: 1.0,
        over_pi: 0.0,
        open_over_pi: 1.0,
    };
    inputs.extend([closed, OpennessInput { spread: 1.0, ..closed }]);
    let outputs: Vec<[f32; 3]> = with_gpu(|gpu| evaluate(gpu, "test_openness.comp", &inputs));
    let mut judge = Judge::default();
    let mut between = 0;
    for (input, got) in inputs.iter().zip(&outputs) {
        let [n, mean, d] = [input.n, input.mean, input.d].map(dvec3);
        let want = visibility(openness_from_mean(n, mean), d);
        let most = most_radiance(input.spread.into(), input.cosine.into());
        judge.near("visibility", input, &got[..1], &[want], [2e-5, 0.0]);
        judge.near("most radiance", input, &got[1..2], &[most], [0.0, 2e-5]);
        let bound = image_bound(1.0, input.over_pi.into(), input.open_over_pi.into(), 1.0);
        judge.near("image's bound", input, &got[2..], &[bound], [1e-6, 0.0]);
        between += usize::from(want > 0.0 && want < 1.0);
    }
    assert!(between > 1000, "{between} between 0 and 1");
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SplitSumInput {
    along: f32,
    lean: f32,
    nv: f32,
    sin2: f32,
    roughness: f32,
    variance: f32,
}

#[test]
fn the_split_sum_is_as_in_f64() {
    let mut random = Random(23);
    let mut drawn: Vec<_> = (0..600).map(|_| [random.unit(), random.unit()]).collect();
    drawn.extend([[0.0, 0.3], [1.0, 0.3], [0.2, 0.0], [0.2, 1.0], [1.0, 1.0], [1e-3, 1e-2]]);
    // What the shader has of n.v and roughness is rounded.
    let drawn = drawn.into_iter().map(|pair| pair.map(|x| f64::from(x as f32)));
    let base = |[nv, roughness]: [f64; 2]| (nv, roughness, table_lobe(nv, roughness, Geometry::Smith).base);
    let cases: Vec<_> = drawn.map(base).collect();
    let input = |&(nv, roughness, base): &(f64, f64, LobePart)| SplitSumInput {
        along: base.along as f32,
        lean: base.across_over_sine as f32,
        nv: nv as f32,
        sin2: (1.0 - nv * nv) as f32,
        roughness: roughness as f32,
        variance: (0.2 * roughness) as f32,
    };
    let inputs: Vec<_> = cases.iter().map(input).collect();
    let outputs: Vec<[f32; 8]> = with_gpu(|gpu| evaluate(gpu, "test_split_sum.comp", &inputs));
    let mut judge = Judge::default();
    for ((nv, roughness, base), (input, got)) in cases.iter().zip(inputs.iter().zip(&outputs)) {
        let lobe = Lobe { base: LobePart { weight: 1.0, ..*base }, fresnel: LobePart::default() };
        let Match { even, towards, spread, apart, each_spread } =
            lobe.matched(1.0, *nv, *roughness, SplitSum::TwoLobes);
        // The shader's are along n - (n.v) r, which is as long as the sine.
        let sine = (1.0 - nv * nv).sqrt();
        let [x, y] = [f64::from(got[2]), f64::from(got[5])].map(|across| across * sine);
        judge.near("irradiance", input, &got[..1], &[even], [1e-6, 1e-5]);
        judge.near("towards", input, &[got[1], x as f32], &towards, [2e-6, 1e-5]);
        judge.near("apart", input, &[got[4], y as f32], &apart, [2e-6, 2e-4]);
        let turned = turned_spread(spread, *nv, input.variance.into());
        judge.near("spreads", input, &[got[3], got[6], got[7]], &[spread, each_spread, turned], [2e-7, 2e-4]);
    }
}
