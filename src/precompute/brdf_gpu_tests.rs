//! glsl/brdf.glsl and glsl/sampling.glsl on the GPU against their twins in f64.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};

use super::harness_tests::{Judge, Random, evaluate, with_gpu};
use crate::reference::brdf::{self, Fresnel, Geometry, MIN_ROUGHNESS};
use crate::reference::sampling;

fn dvec3(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BrdfInput {
    n: [f32; 3],
    v: [f32; 3],
    l: [f32; 3],
    h: [f32; 3],
    base_color: [f32; 3],
    metallic: f32,
    /// F0 and F90.
    dielectric: [f32; 4],
    roughness: f32,
    alpha: f32,
    nl: f32,
    nv: f32,
    vh: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BrdfOutput {
    alpha: f32,
    d: f32,
    stretched_d: f32,
    stretched_smith: f32,
    smith: f32,
    karis: f32,
    karis_direct: f32,
    karis_ibl: f32,
    direct: [f32; 2],
    environment: [f32; 2],
    weight: f32,
    exponent: f32,
    phong: f32,
    widened: f32,
    slanted: f32,
    schlick: [f32; 3],
    schlick_roughness: [f32; 3],
    lambert: [f32; 3],
    thesis: [f32; 3],
    fresnel: [f32; 4],
    specular: [[f32; 3]; 2],
}

const GEOMETRIES: [Geometry; 2] = [Geometry::Smith, Geometry::Karis2013];

fn input(n: DVec3, v: DVec3, l: DVec3, base_color: DVec3, metallic: f64, roughness: f64) -> BrdfInput {
    let [n, v, l] = [n, v, l].map(|d| d.as_vec3());
    BrdfInput {
        n: n.into(),
        v: v.into(),
        l: l.into(),
        h: (v + l).into(),
        base_color: base_color.as_vec3().into(),
        metallic: metallic as f32,
        dielectric: [0.04, 0.04, 0.04, 1.0],
        roughness: roughness as f32,
        alpha: (roughness * roughness) as f32,
        nl: n.dot(l),
        nv: n.dot(v),
        vh: 0.5 * (v + l).length(),
    }
}

fn slanted(cosine: f64, longitude: f64) -> DVec3 {
    let across = (1.0 - cosine * cosine).sqrt();
    DVec3::new(across * longitude.cos(), across * longitude.sin(), cosine)
}

/// Cases 1, 2, 3, 14 and 16 of tests/gpu/stability.rs: every roughness, grazing light and view, l = −v, lobes' centres.
fn hostile_inputs() -> Vec<BrdfInput> {
    let cosines = [1.0, 0.5, 0.01, 1e-3, 1e-7, 0.0, -1e-7, -0.5, -1.0];
    let mut inputs = Vec::new();
    for roughness in [0.0, 1e-3, 0.01, 0.02, MIN_ROUGHNESS, 0.1, 0.5, 1.0] {
        for v in cosines.map(|c| slanted(c, 0.3)) {
            let mut lights = cosines.map(|c| slanted(c, 2.0)).to_vec();
            let mirror = DVec3::new(-v.x, -v.y, v.z);
            lights.extend([mirror, -v, (-v + DVec3::Z * 1e-7).normalize(), (mirror + DVec3::X * 1e-3).normalize()]);
            for (i, l) in lights.into_iter().enumerate() {
                let base_color = [DVec3::ZERO, DVec3::ONE, DVec3::new(1.0, 0.5, 0.02)][i % 3];
                inputs.push(input(DVec3::Z, v, l, base_color, [0.0, 1.0, 0.5][i % 3], roughness));
            }
        }
    }
    // Rounding takes v·h above 1.
    inputs.extend([1.000_000_1, f32::MAX, -1.0].map(|vh| BrdfInput { vh, ..inputs[0] }));
    inputs
}

fn random_inputs() -> Vec<BrdfInput> {
    let mut random = Random(4);
    let mut inputs = Vec::new();
    while inputs.len() < 20_000 {
        let (n, v, l) = (random.direction(), random.direction(), random.direction());
        // Half of them close to the mirror direction, where lobes are.
        let mirror = 2.0 * n.dot(v) * n - v;
        let l = if inputs.len() % 2 == 0 { l } else { (mirror + 0.1 * random.unit() * l).normalize() };
        let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * random.unit();
        if n.dot(v) > 0.0 && n.dot(l) > 0.0 {
            let like_glass = input(n, v, l, random.colour(), random.unit(), roughness);
            inputs.push(BrdfInput { dielectric: random.colour().extend(random.unit()).as_vec4().into(), ..like_glass });
        }
    }
    inputs
}

fn fresnel_of(i: &BrdfInput) -> Fresnel {
    let [r, g, b, f90] = i.dielectric.map(f64::from);
    Fresnel { f0: DVec3::new(r, g, b), f90 }.mixed(dvec3(i.base_color), i.metallic.into())
}

/// Compares all terms but the lobes, whose error bounds depend on the directions.
fn judge_terms(judge: &mut Judge, i: &BrdfInput, o: &BrdfOutput) {
    let [r, alpha, nl, nv, vh, metallic] = [i.roughness, i.alpha, i.nl, i.nv, i.vh, i.metallic].map(f64::from);
    let base_color = dvec3(i.base_color);
    let close = [0.0, 3e-6];
    judge.near("alpha_from_roughness", i, &[o.alpha], &[brdf::alpha_from_roughness(r)], close);
    // In the frame of x, y and z, whatever n is there; metallic is any strength.
    let (alphas, [l, h, v]) = (brdf::stretched_alphas(alpha, metallic), [i.l, i.h, i.v].map(dvec3));
    judge.near("d_ggx_stretched", i, &[o.stretched_d], &[brdf::d_ggx_stretched(h, alphas)], [1e-30, 1e-5]);
    judge.near("v_smith_stretched", i, &[o.stretched_smith], &[brdf::v_smith_stretched(l, v, alphas)], close);
    judge.near("v_smith", i, &[o.smith], &[brdf::v_smith_height_correlated(nl, nv, alpha)], close);
    judge.near("v_karis2013", i, &[o.karis], &[brdf::v_karis2013(nl, nv, alpha)], close);
    judge.near("v_karis2013_direct", i, &[o.karis_direct], &[brdf::v_karis2013_direct(nl, nv, r)], close);
    judge.near("v_karis2013_ibl", i, &[o.karis_ibl], &[brdf::v_karis2013_ibl(nl, nv, r)], close);
    let direct = GEOMETRIES.map(|g| brdf::v_direct(nl, nv, r, g));
    judge.near("v_direct", i, &o.direct, &direct, close);
    let environment = GEOMETRIES.map(|g| brdf::v_environment(nl, nv, r, g));
    judge.near("v_environment", i, &o.environment, &environment, close);
    // 1 − cosine is exact to 6e-8; its fifth power keeps five times that, relative to itself.
    judge.near("schlick_weight", i, &[o.weight], &[brdf::schlick_weight(vh)], [1e-30, 1e-6]);
    let want = brdf::f_schlick_roughness(base_color, nv, r).to_array();
    judge.near("f_schlick_roughness", i, &o.schlick_roughness, &want, [3e-7, 0.0]);
    judge.near("diffuse_lambert", i, &o.lambert, &brdf::diffuse_lambert(base_color).to_array(), close);
    let fresnel = fresnel_of(i);
    let want = fresnel.f0.extend(fresnel.f90).to_array();
    judge.near("fresnel_from_metallic", i, &o.fresnel, &want, [2e-7, 0.0]);
    judge.near("f_schlick", i, &o.schlick, &brdf::f_schlick(fresnel, vh).to_array(), [3e-7, 0.0]);
    let want = brdf::diffuse_karis2013(base_color, fresnel, vh).to_array();
    judge.near("diffuse_karis2013", i, &o.thesis, &want, [3e-7, 0.0]);
    judge.near("widened_roughness", i, &[o.widened], &[brdf::widened_roughness(r, metallic)], close);
    judge.near("slanted_coverage", i, &[o.slanted], &[brdf::slanted_coverage(metallic, vh)], [1e-6, 0.0]);
    judge.near("phong_exponent", i, &[o.exponent], &[brdf::phong_exponent(r)], [1e-6, 2e-6]);
    let terms = [o.d, o.smith, o.karis, o.karis_direct, o.karis_ibl, o.weight, o.phong];
    let colours = [o.schlick, o.schlick_roughness, o.lambert, [o.fresnel[0], o.fresnel[1], o.fresnel[2]]].concat();
    let lowest = terms.iter().chain(&o.direct).chain(&o.environment).chain(&colours).copied().fold(0.0, f32::min);
    assert!(lowest >= 0.0, "{i:?}: {o:?}");
}

#[test]
fn terms_agree_for_random_directions() {
    let inputs = random_inputs();
    let mut judge = Judge::default();
    let outputs: Vec<BrdfOutput> = with_gpu(|gpu| evaluate(gpu, "test_brdf.comp", &inputs));
    for (i, o) in inputs.iter().zip(&outputs) {
        judge_terms(&mut judge, i, o);
        let ([n, v, l, h], r) = ([i.n, i.v, i.l, i.h].map(dvec3), f64::from(i.roughness));
        // n × h has an error of 1e-7 |h|, and D turns over alpha: 4 · 1e-7 / 0.002 at MIN_ROUGHNESS.
        let lobe = 5e-7 + 4e-7 / f64::from(i.alpha);
        judge.near("d_ggx", i, &[o.d], &[brdf::d_ggx(n, h, i.alpha.into())], [0.0, lobe]);
        for (got, geometry) in o.specular.iter().zip(GEOMETRIES) {
            let want = brdf::specular(n, v, l, fresnel_of(i), r, geometry);
            let opposite = 1e-6 / h.length(); // h = v + l is rounded
            judge.near("specular", i, got, &want.to_array(), [1e-6, 5e-6 + lobe + opposite]);
        }
        // The power multiplies the error of r·v by its exponent.
        let power = 1e-5 + 1e-6 * brdf::phong_exponent(r);
        judge.near("phong_specular", i, &[o.phong], &[brdf::phong_specular(n, v, l, r)], [1e-6, power]);
    }
}

#[test]
fn terms_survive_hostile_directions() {
    let inputs = hostile_inputs();
    let mut judge = Judge::default();
    let outputs: Vec<BrdfOutput> = with_gpu(|gpu| evaluate(gpu, "test_brdf.comp", &inputs));
    for (i, o) in inputs.iter().zip(&outputs) {
        judge_terms(&mut judge, i, o);
        let [n, h] = [i.n, i.h].map(dvec3);
        // With n = +Z no digit is lost in n × h, however small alpha is.
        let alpha = f64::from(i.alpha);
        judge.near("d_ggx, n = +Z", i, &[o.d], &[brdf::d_ggx(n, h, alpha)], [1e-30, 5e-6]);
        let numbers = o.specular.concat();
        assert!(numbers.iter().chain(&[o.phong]).all(|x| x.is_finite() && *x >= 0.0), "{i:?}: {o:?}");
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SamplingInput {
    n: [f32; 3],
    v: [f32; 3],
    h: [f32; 3],
    u: [f32; 2],
    alpha: f32,
    alphas: [f32; 2],
    index: u32,
    log2_count: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SamplingOutput {
    unit: f32,
    inverse: f32,
    point: [f32; 2],
    tangent: [f32; 3],
    bitangent: [f32; 3],
    normal: [f32; 3],
    ggx: [f32; 3],
    vndf: [f32; 3],
    pdf_ggx: f32,
    pdf_vndf: f32,
    sobol: [f32; 2],
    sphere: [f32; 3],
    cosine: [f32; 3],
}

fn sampling_inputs() -> Vec<SamplingInput> {
    const LAST: f32 = 1.0 - 1.0 / 16_777_216.0; // the greatest that hammersley gives
    let mut random = Random(5);
    let mut inputs = Vec::new();
    let alphas = [0.0, 1e-6, 1e-4, 0.01, 0.1, 0.5, 1.0];
    let cosines = [1.0, 0.7, 0.1, 1e-3, 1e-7, 0.0];
    // Case 15 of tests/gpu/stability.rs.
    let indices = [0, 1, 2, 0xff_ffff, 0x100_0000, 0x100_0001, (1 << 30) - 2, (1 << 30) - 1];
    let poles = [DVec3::Z, -DVec3::Z, DVec3::X, -DVec3::Y, DVec3::new(0.6, 0.0, -0.8), DVec3::new(1e-4, 0.0, -1.0)];
    for alpha in alphas {
        for cosine in cosines {
            for (u, v0) in [(0.0, 0.0), (LAST, LAST), (0.0, LAST), (LAST, 0.0), (0.5, 0.5)] {
                let n = poles[inputs.len() % poles.len()].normalize().as_vec3().into();
                let index = indices[inputs.len() % indices.len()];
                let v3 = slanted(cosine, 1.0).as_vec3();
                let alphas = [alpha, alphas[inputs.len() % alphas.len()]];
                let v = v3.into();
                inputs.push(SamplingInput { n, v, h: [0.0; 3], u: [u, v0], alpha, alphas, index, log2_count: 30 });
            }
        }
    }
    for _ in 0..10_000 {
        let log2_count = random.below(32);
        inputs.push(SamplingInput {
            n: random.direction().as_vec3().into(),
            v: slanted(random.unit(), 6.3 * random.unit()).as_vec3().into(),
            h: [0.0; 3],
            u: [random.unit() as f32 * LAST, random.unit() as f32 * LAST],
            alpha: random.unit().powi(3) as f32,
            alphas: [random.unit().powi(3) as f32, random.unit().powi(3) as f32],
            index: random.bits() as u32 & ((1u32 << log2_count) - 1),
            log2_count,
        });
    }
    // Densities where samples of them lie.
    for input in &mut inputs {
        let u = DVec2::new(input.u[0].into(), input.u[1].into());
        input.h = sampling::sample_ggx(u, input.alpha.into()).as_vec3().into();
    }
    inputs
}

#[test]
fn samples_and_densities_agree() {
    let inputs = sampling_inputs();
    let mut judge = Judge::default();
    let outputs: Vec<SamplingOutput> = with_gpu(|gpu| evaluate(gpu, "test_sampling.comp", &inputs));
    for (i, o) in inputs.iter().zip(&outputs) {
        let [n, v, h] = [i.n, i.v, i.h].map(dvec3);
        let (u, alpha) = (DVec2::new(i.u[0].into(), i.u[1].into()), f64::from(i.alpha));
        // 24 bits are kept, the rest is cut off.
        let cut = 2f64.powi(-25);
        let near = |x: f64| x - cut;
        judge.near("unit_from_bits", i, &[o.unit], &[near(f64::from(i.index) / 2f64.powi(32))], [cut, 0.0]);
        judge.near("radical_inverse", i, &[o.inverse], &[near(sampling::radical_inverse(i.index))], [cut, 0.0]);
        let point = sampling::hammersley(i.index, i.log2_count).to_array();
        judge.near("hammersley", i, &o.point, &point.map(near), [cut, 0.0]);
        let sobol = sampling::sobol(i.index, [i.log2_count, !i.index]).to_array();
        judge.near("sobol", i, &o.sobol, &sobol.map(near), [cut, 0.0]);
        // Roots of differences of a few 1e-8, at the poles and the horizon.
        judge.near("sphere_direction", i, &o.sphere, &sampling::sphere_direction(u).to_array(), [5e-6, 0.0]);
        judge.near("cosine_direction", i, &o.cosine, &sampling::cosine_direction(u).to_array(), [5e-6, 0.0]);
        assert!(o.point.iter().all(|x| (0.0..1.0).contains(x)), "{i:?}: {o:?}");
        let basis = sampling::basis(n);
        for (got, want) in [o.tangent, o.bitangent, o.normal].iter().zip([basis.x_axis, basis.y_axis, basis.z_axis]) {
            // Close to −Z, 1 / (1 + |z|) loses nothing; the columns stay unit vectors to 1e-6.
            judge.near("basis", i, got, &want.to_array(), [1e-6, 0.0]);
        }
        judge.near("sample_ggx", i, &o.ggx, &sampling::sample_ggx(u, alpha).to_array(), [5e-6, 0.0]);
        let alphas = DVec2::from_array(i.alphas.map(f64::from));
        let vndf = sampling::sample_vndf(v, u, alphas);
        // The rounding of an angle grows by how much longer than wide the lobe is.
        let stretch = (alphas.max_element() / alphas.min_element().max(1e-9)).min(1e4);
        judge.near("sample_vndf", i, &o.vndf, &vndf.to_array(), [1e-5 + 3e-7 * (stretch - 1.0).max(0.0), 0.0]);
        // Divided by v·h, which carries an error of 1e-7.
        let cosine = 2e-7 / v.dot(h).abs();
        judge.near("pdf_ggx", i, &[o.pdf_ggx], &[sampling::pdf_ggx(v, h, alpha)], [1e-30, 1e-5 + cosine]);
        judge.near("pdf_vndf", i, &[o.pdf_vndf], &[sampling::pdf_vndf(v, h, alphas)], [1e-30, 1e-5]);
        let lowest = [o.ggx[2], o.vndf[2], o.pdf_ggx, o.pdf_vndf].into_iter().fold(0.0, f32::min);
        assert!(lowest >= 0.0, "{i:?}: {o:?}");
    }
}
