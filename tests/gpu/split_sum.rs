//! The split sum: its table against f64 quadrature, and its reflections of an environment against the full integral.

use std::path::Path;

use crate::common::gpus::TestGpu;
use crate::common::light::Errors;
use crate::common::{PictureOptions, Workshop, material, pixel, square};
use glam::{DVec3, Vec3};
use pbr_vr::asset::{Panorama, Report};
use pbr_vr::context::Context;
use pbr_vr::precompute::{BrdfTable, TableTexels};
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::energy::Scattering;
use pbr_vr::reference::integrals::{PanoramaView, Surface, Terms, reflected_by};
use pbr_vr::reference::levels::{LEVELS, alpha_from_level, level_from_spread, spread_from_level};
use pbr_vr::reference::lobe::kernel_spread;
use pbr_vr::reference::panorama_sums::prefiltered_around;
use pbr_vr::reference::sampling::hammersley;
use pbr_vr::reference::split_sum::SplitSum;
use pbr_vr::reference::table::{Lobe, table_entry, table_lobe};
use pbr_vr::render::Shading;

/// The GPU's table, read back.
fn table(geometry: Geometry, split_sum: SplitSum) -> TableTexels {
    let gpu = TestGpu::take();
    let table = BrdfTable::new(&Context::silent(&gpu), geometry, split_sum).expect("a table");
    println!("{:?}", table.times);
    TableTexels::read(&gpu, &table).expect("its texels")
}

/// Points of [0.001, 1]², even and crowded towards 0.
fn arguments() -> impl Iterator<Item = (f64, f64)> {
    (0..512).map(|i| {
        let u = hammersley(i / 2, 8);
        if i % 2 == 0 {
            (0.001 + 0.999 * u.x, 0.001 + 0.999 * u.y)
        } else {
            (10f64.powf(-3.0 * u.x), 10f64.powf(-2.0 * u.y))
        }
    })
}

#[test]
fn the_table_holds_what_quadrature_gives() {
    for geometry in [Geometry::Smith, Geometry::Karis2013] {
        let table = table(geometry, SplitSum::Moment);
        let (mut albedo, mut mean) = (0.0f64, 0.0f64);
        for (nv, roughness) in arguments() {
            let (got, want) = (table.look_up(nv, roughness).lobe, table_lobe(nv, roughness, geometry));
            let off = (got.base.weight - want.base.weight).abs().max((got.fresnel.weight - want.fresnel.weight).abs());
            assert!(off <= 1e-3, "{geometry:?} ({nv}, {roughness}): {got:?} against {want:?}");
            albedo = albedo.max(off);
            for f0 in [0.04, 1.0] {
                let (got, want) = (got.mean(f0, nv), want.mean(f0, nv));
                let off = (got[0] - want[0]).hypot(got[1] - want[1]);
                assert!(off <= 4e-3, "{geometry:?} ({nv}, {roughness}), F0 {f0}: {got:?} against {want:?}");
                mean = mean.max(off);
            }
        }
        println!("{geometry:?}: albedo off by {albedo:.1e}, mean vector by {mean:.1e} at most");
    }
}

#[test]
fn the_table_has_the_spot_values() {
    let table = table(Geometry::Karis2013, SplitSum::Classic);
    // reference::table holds the published values of these spots to 1e-6.
    for (nv, roughness) in [(0.001, 0.5), (0.001, 1.0), (0.01, 0.1), (0.01, 0.01), (0.1, 0.5), (0.5, 0.5)] {
        let (got, want) = (table.look_up(nv, roughness).lobe, table_entry(nv, roughness, Geometry::Karis2013));
        let off = (got.base.weight - want.scale).abs().max((got.fresnel.weight - want.bias).abs());
        assert!(off <= 1e-3, "({nv}, {roughness}): {got:?}");
        // The classic way: along r, by the roughness's own lobe.
        let spread = kernel_spread(roughness * roughness);
        assert_eq!((got.base.across_over_sine, got.fresnel.across_over_sine), (0.0, 0.0));
        assert!((got.base.along - spread).abs() <= 1e-3 && (got.fresnel.along - spread).abs() <= 1e-3, "{got:?}");
    }
}

/// A table whose texels are even in n·v, 512 of them, knows nothing below its first texel's centre, 0.00098.
#[test]
fn grazing_views_are_not_clamped_to_the_first_texel() {
    for (geometry, most) in [(Geometry::Smith, 1e-3), (Geometry::Karis2013, 5e-3)] {
        let table = table(geometry, SplitSum::Moment);
        let albedo = |lobe: Lobe| lobe.base.weight + lobe.fresnel.weight;
        let (mut ours, mut clamped) = (0.0f64, 0.0f64);
        for roughness in [0.0, 0.02, 0.05, 0.1] {
            for nv in [0.0, 1e-6, 1e-5, 1e-4, 3e-4, 9e-4] {
                let truth = albedo(table_lobe(nv, roughness, geometry));
                ours = ours.max((albedo(table.look_up(nv, roughness).lobe) - truth).abs());
                clamped = clamped.max((albedo(table_lobe(0.5 / 512.0, roughness, geometry)) - truth).abs());
            }
        }
        println!("{geometry:?}: off by {ours:.1e}; clamped, by {clamped:.1e}");
        assert!(ours <= most && clamped > 0.05, "{geometry:?}: off by {ours}; clamped, by {clamped}");
    }
}

/// A square under light that is linear in direction, over the same under even light.
#[test]
fn linear_light_is_reflected_exactly() {
    let a = DVec3::new(0.5, 0.7, -0.2);
    let shop = Workshop::new();
    shop.panorama("linear.exr", 512, |d| [(1.0 + 0.9 * a.dot(d.into())) as f32; 3]);
    shop.panorama("even.exr", 512, |_| [1.0; 3]);
    shop.write("model.obj", &square("m.mtl"));
    let surfaces = [(0.04, 0.2), (0.04, 0.7), (1.0, 0.4), (1.0, 0.9)];
    let ways = [SplitSum::Moment, SplitSum::OneLobe, SplitSum::TwoLobes]
        .map(|way| surfaces.map(|(f0, roughness)| (way, f0, roughness)));
    for (split_sum, f0, roughness) in ways.into_iter().flatten() {
        shop.write("m.mtl", &material([f0 as f32; 3], 1.0, roughness as f32));
        for nv in [1.0, 0.7, 0.4, 0.15f64] {
            let (n, v) = (DVec3::Z, DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv));
            let [x, y, z] = (30.0 * v).to_array();
            let show = |sky: &str| {
                let scene = format!(
                    "environment = {{ panorama = \"{sky}\" }}\n[[model]]\nfile = \"model.obj\"\n[[camera]]\n\
                     name = \"c\"\nposition = [{x}, {y}, {z}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 0.5\n"
                );
                let scene = shop.write("scene.toml", &scene);
                // Scattered more than once, light is looked up as irradiance, not along the lobe.
                let scattering = Scattering::Single;
                let options = PictureOptions {
                    size: [17, 17],
                    shading: Shading::Specular,
                    scattering,
                    split_sum,
                    ..PictureOptions::default()
                };
                pixel(&shop.render(&scene, &options)[0], 8, 8)[0]
            };
            // The lobe's own mean vector, but for what is wider than the last level.
            let found = table_lobe(nv, roughness, Geometry::Smith).matched(f0, nv, roughness, split_sum);
            let [along, across] = found.mean(nv, spread_from_level(LEVELS - 1));
            let r = 2.0 * nv * n - v;
            let mean = along * r + across * (n - nv * r).normalize_or_zero();
            let want = 1.0 + 0.9 * a.dot(mean);
            let off = (show("linear.exr") / show("even.exr") / want - 1.0).abs();
            println!("{split_sum:?}, F0 {f0}, roughness {roughness}, n·v {nv}: off by {off:.4}");
            assert!(off <= 0.005, "{split_sum:?}, F0 {f0}, roughness {roughness}, n·v {nv}: off by {off}");
        }
    }
}

/// Mean radiance that a level pair shows, as the shader mixes it.
fn mixed(directions: &[DVec3], spread: f64, panorama: &Panorama) -> Vec<DVec3> {
    let level = level_from_spread(spread);
    let (low, share) = (level.floor() as usize, level.fract());
    let size = [panorama.width, panorama.height];
    let at = |level| prefiltered_around(directions, alpha_from_level(level), size, &panorama.texels);
    let high = if share > 0.0 { at(low + 1) } else { at(low) };
    at(low).into_iter().zip(high).map(|(low, high)| low.lerp(high, share)).collect()
}

/// The ways that are matched to the lobe.
const MATCHED: [SplitSum; 3] = [SplitSum::Moment, SplitSum::OneLobe, SplitSum::TwoLobes];

/// Errors of the classic split sum and of those against the full integral, for F0 0.04 and 1.
fn split_sum_errors(name: &str, panorama: &Panorama, roughnesses: [f64; 4]) -> [[Errors; 4]; 2] {
    const F0: [f64; 2] = [0.04, 1.0];
    let view = PanoramaView::new(panorama.width, panorama.height, &panorama.texels).expect("a panorama");
    let mut errors: [[Vec<f64>; 4]; 2] = Default::default();
    for roughness in roughnesses {
        let terms = Terms::new(roughness, Geometry::Smith);
        for nv in [1.0, 0.7, 0.4, 0.1f64] {
            let lobe = table_lobe(nv, roughness, Geometry::Smith);
            for i in 0..6 {
                let u = hammersley(2 * i + 1, 4);
                let z = 1.0 - 2.0 * u.x;
                let (sin, cos) = (std::f64::consts::TAU * u.y).sin_cos();
                let n = DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin);
                let v = nv * n + (1.0 - nv * nv).sqrt() * n.any_orthonormal_vector();
                let base_color = DVec3::new(F0[0], F0[1], 0.0);
                let surface = Surface { n, v, base_color, metallic: 1.0, roughness };
                let truth = reflected_by(view, &surface, &terms, Scattering::Single).specular;
                let r = 2.0 * nv * n - v;
                let classic = prefiltered_around(
                    &[r],
                    roughness * roughness,
                    [panorama.width, panorama.height],
                    &panorama.texels,
                )[0];
                let irradiance = prefiltered_around(&[n], 1.0, [panorama.width, panorama.height], &panorama.texels)[0];
                for (k, f0) in F0.into_iter().enumerate() {
                    let albedo = f0 * lobe.base.weight + lobe.fresnel.weight;
                    let matched = |split_sum| {
                        let found = lobe.matched(f0, nv, roughness, split_sum);
                        let across = (n - nv * r).normalize_or_zero();
                        let towards = found.lobes().map(|[x, y]| (x * r + y * across).normalize());
                        let round = mixed(&towards, found.each_spread, panorama);
                        round[0].midpoint(round[1]).lerp(irradiance, found.even)
                    };
                    let [moment, one, two] = MATCHED.map(matched);
                    let methods = [classic, moment, one, two];
                    for (method, light) in methods.into_iter().enumerate() {
                        errors[k][method].push((albedo * light[k] / truth[k] - 1.0).abs());
                    }
                }
            }
        }
    }
    let errors = errors.map(|methods| methods.map(Errors::new));
    for (f0, [classic, moment, one, two]) in F0.iter().zip(&errors) {
        println!("{name}, F0 {f0}: classic {classic}; moment {moment}; one lobe {one}; two {two}");
    }
    errors
}

fn grey(panorama: Panorama) -> Panorama {
    let texels = panorama.texels.iter().map(|[r, g, b]| [(r + g + b) / 3.0; 3]).collect();
    Panorama { texels, ..panorama }
}

#[test]
fn each_step_takes_part_of_the_error() {
    // From a dim ground to a bright zenith, and with a sharp horizon.
    let sky = Panorama::from_fn(128, 64, |d| Vec3::splat((0.15 + 0.425 * (1.0 + d.y)).powi(2)));
    let horizon = Panorama::from_fn(128, 64, |d| Vec3::splat(if d.y > 0.0 { 1.0 - 0.7 * d.y } else { 0.2 }));
    let sunset = half_size(&half_size(&shipped("sunset")));
    let mut good = true;
    for (name, panorama, most) in [("sky gradient", sky, 0.5), ("horizon", horizon, 0.8), ("sunset", sunset, 0.5)] {
        for [classic, moment, one, two] in split_sum_errors(name, &grey(panorama), [0.25, 0.5, 0.75, 1.0]) {
            good &= moment.mean <= most * classic.mean && one.mean <= 0.75 * moment.mean && two.mean <= 1.2 * one.mean;
        }
    }
    assert!(good, "see above");
}

/// Where light has detail, unlike a gradient, and the lobe is long, unlike a very smooth or rough surface's.
#[test]
fn two_lobes_are_nearer_than_one() {
    for name in ["courtyard", "forest"] {
        for [_, _, one, two] in split_sum_errors(name, &grey(half_size(&shipped(name))), [0.2, 0.3, 0.4, 0.5]) {
            assert!(two.mean <= 0.9 * one.mean, "{name}: {one}; two {two}");
        }
    }
}

fn shipped(name: &str) -> Panorama {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("assets/panoramas/{name}.exr"));
    Panorama::load(&file, &Report::silent()).expect("a shipped panorama")
}

/// Four texels become one, weighted alike.
fn half_size(panorama: &Panorama) -> Panorama {
    let (width, height) = (panorama.width / 2, panorama.height / 2);
    let texel = |x: u32, y: u32| Vec3::from(panorama.texels[(y * panorama.width + x) as usize]);
    let mean = |i: u32| {
        let (x, y) = (2 * (i % width), 2 * (i / width));
        ((texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) / 4.0).to_array()
    };
    Panorama { name: panorama.name.clone(), width, height, texels: (0..width * height).map(mean).collect() }
}
