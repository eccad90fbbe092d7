//! Cases in which methods like ours are known to fail: the naive form is shown to fail, ours to hold. The test of each case:
//!
//! | case | tests |
//! |---|---|
//! | 1 D of smooth surfaces overflows at its peak | `reference::brdf`: `ggx_survives_small_roughness_in_f32`; `terms_survive_hostile_directions` |
//! | 2 1 − (n·h)² cancels near the lobe's centre | `reference::brdf`: `ggx_keeps_its_digits_near_the_centre_in_f32` |
//! | 3 division by n·l n·v at grazing angles | `reference::brdf`: `visibility_survives_grazing_angles` |
//! | 4 table lookups below the first texel's centre | split_sum: `grazing_views_are_not_clamped_to_the_first_texel` |
//! | 5, 6 a tiny bright sun, sampled or by fixed steps | `a_small_sun_is_missed_by_fixed_steps_and_sparkles_in_samples`; `a_small_sun_keeps_its_energy`; `the_sun_is_never_missed` |
//! | 7 fixed steps under even light | `fixed_steps_have_a_wrong_scale`; `uniform_light_stays_what_it_is` |
//! | 8 half floats overflow | `panoramas_beyond_half_floats_are_shown_as_bright_as_they_are`; `radiance_beyond_half_floats_keeps_its_energy` |
//! | 9 one NaN in a panorama | `one_bad_texel_of_a_panorama_changes_nothing_else` |
//! | 10 the panorama's seam | `render::seam_gpu_tests`: `the_seam_of_the_panorama_is_as_sharp_as_the_rest` |
//! | 11 poles | `reference::cube`: `poles_are_defined` |
//! | 12 texels of a cube differ in size | `reference::cube`: `corner_texels_are_small_and_exact_in_f32` |
//! | 13 edges of a cube's faces | `faces_filtered_each_for_itself_have_seams`; `faces_meet_without_seams` |
//! | 14 l = −v | `reference::brdf`: `opposite_directions_give_a_finite_brdf` |
//! | 15 Hammersley beyond 2²⁴ | `reference::sampling`: its tests |
//! | 16 Fresnel of a cosine above 1 | `reference::brdf`: `fresnel_survives_a_cosine_above_one` |
//! | 17 zero, tiny, huge and opposite normals | `triangles_with_unusable_normals_are_lit_all_over`; `normals_of_any_size_are_unit_vectors` |
//! | 18 texture coordinates without area, or mirrored | `mirrored_halves_and_coordinates_without_area_are_lit_from_the_right_side` |
//! | 19 roughness Fresnel on top of the split sum | `fresnel_is_counted_once` |
//! | 20 what single scattering loses | `reference::energy`: its tests |
//! | 21 sparkling normal maps, flashing pixels | stability_jitter, stability_walk |
//! | 22 near plane, inside, behind, far, scales, canted | stability_view |
//! | any input at all | `render::random_gpu_tests`; stability_view: `maps_full_of_nonsense_neither_break_a_picture_nor_make_light` |

use crate::common::light::{look_up, panorama, read_cube, texel_directions};
use crate::common::stage::{Stage, assert_sane, scene, with_gpu};
use crate::common::{Workshop, material, sphere, square};
use glam::{DVec2, DVec3, Vec2, Vec3};
use half::f16;
use pbr_vr::asset::{Panorama, Report};
use pbr_vr::context::Context;
use pbr_vr::precompute::{LightMaps, Options};
use pbr_vr::reference::brdf::{Geometry, f_schlick_roughness};
use pbr_vr::reference::cube::{cube_direction, cube_face};
use pbr_vr::reference::energy::Scattering;
use pbr_vr::reference::integrals::{PanoramaView, Surface, reflected};
use pbr_vr::reference::table::table_entry;
use pbr_vr::render::{Eye, Output, Shading};

const SIZE: [u32; 2] = [48, 48];
const CAMERA: &str =
    "[[camera]]\nname = \"c\"\nposition = [0, 0, 3.5]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n";

/// What the camera sees of `m.obj` under `sky.exr`.
fn seen(shop: &Workshop, shading: Shading) -> Vec<[f32; 4]> {
    let text = format!("environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"m.obj\"\n{CAMERA}");
    let scene = scene(&shop.write("scene.toml", &text));
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    with_gpu(|gpu| Stage::showing(gpu, &scene, SIZE, 4, Output::Linear, shading).radiance(&eye))
}

fn mirror_ball(shop: &Workshop) {
    shop.write("m.mtl", &material([1.0; 3], 1.0, 0.0));
    shop.write("m.obj", &sphere("m.mtl"));
}

#[test]
fn panoramas_beyond_half_floats_are_shown_as_bright_as_they_are() {
    let half = f16::from_f32;
    assert!(half(70_000.0).is_infinite());
    let sum = [60_000.0; 4].map(half).into_iter().fold(f16::ZERO, |a, b| half(a.to_f32() + b.to_f32()));
    let mean = half(sum.to_f32() / 4.0);
    assert!(mean.is_infinite(), "a mean of halves no longer overflows");
    assert!((mean.to_f32() - mean.to_f32()).is_nan());

    let shop = Workshop::new();
    mirror_ball(&shop);
    for radiance in [60_000.0, 72_704.0, 1e7] {
        shop.panorama("sky.exr", 64, |_| [radiance, 0.5 * radiance, 0.0]);
        for texel in seen(&shop, Shading::Pbr) {
            let off = (texel[0] / radiance - 1.0).abs().max((texel[1] / radiance - 0.5).abs());
            assert!(off < 2e-3 && texel[2] == 0.0, "{texel:?} of {radiance}");
        }
    }
}

#[test]
fn one_bad_texel_of_a_panorama_changes_nothing_else() {
    // The naive chain: a mean of four for each smaller level. What is wrong is everything in the end.
    let mut level = vec![1.0f32; 64];
    level[19] = f32::NAN;
    while level.len() > 1 {
        level = level.chunks(4).map(|four| four.iter().sum::<f32>() / 4.0).collect();
    }
    assert!(level[0].is_nan());

    let shop = Workshop::new();
    shop.write("m.mtl", &material([0.9; 3], 0.5, 0.4));
    shop.write("m.obj", &sphere("m.mtl"));
    let bad = |d: [f64; 3]| d[0] > 0.995;
    let light = |d: [f64; 3]| d.map(|c| 1.0 + 0.5 * c as f32);
    shop.panorama("sky.exr", 64, |d| if bad(d) { [0.0; 3] } else { light(d) });
    let wanted = seen(&shop, Shading::Pbr);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e30] {
        let path = shop.panorama("sky.exr", 64, |d| if bad(d) { [value; 3] } else { light(d) });
        let report = Report::silent();
        let cleared = Panorama::load(&path, &report).expect("a panorama");
        assert!(cleared.texels.contains(&[0.0; 3]));
        let told = report.warnings().join("\n");
        assert!(report.warnings().len() == 1 && told.contains("(3"), "{value}: {told}");
        assert_eq!(seen(&shop, Shading::Pbr), wanted, "{value}");
    }
    assert_sane(&wanted, 1.6, "a panorama with a hole");
}

/// The step across the faces' edges over the variation of the whole, both of looked up values.
fn seam(cube: &[DVec3]) -> f64 {
    let mean = cube.iter().sum::<DVec3>() / cube.len() as f64;
    let variance = cube.iter().map(|v| (*v - mean).length_squared()).sum::<f64>() / cube.len() as f64;
    let (mut steps, mut count) = (0.0, 0.0);
    for face in 0..6 {
        for i in 0..32 {
            let along = (f64::from(i) + 0.5) / 32.0;
            for (inside, outside) in [(1e-9, -1e-9), (1.0 - 1e-9, 1.0 + 1e-9)] {
                for at in [|a, b| DVec2::new(a, b), |a, b| DVec2::new(b, a)] {
                    let [a, b] = [inside, outside].map(|edge| look_up(cube, cube_direction(face, at(edge, along))));
                    steps += (a - b).length_squared();
                    count += 1.0;
                }
            }
        }
    }
    (steps / count / variance).sqrt()
}

/// Filtered as six pictures, as cubes are without seamless filtering, the smaller levels of a mip chain have steps; our
/// levels stop at 16² texels, and `faces_meet_without_seams` has their bound, 0.15.
#[test]
fn faces_filtered_each_for_itself_have_seams() {
    let mut cube = with_gpu(|gpu| {
        let maps = LightMaps::new(
            &Context::silent(gpu),
            &panorama(256, false),
            Options { face_size: 64, ..Options::default() },
        )
        .expect("maps");
        read_cube(gpu, &maps.specular[0], 0)
    });
    let mut size = 64;
    while size > 2 {
        size /= 2;
        let texel = |i: usize| {
            let (face, y, x) = (i / (size * size), i / size % size, i % size);
            let at = |dx: usize, dy: usize| cube[(face * 2 * size + 2 * y + dy) * 2 * size + 2 * x + dx];
            (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4.0
        };
        cube = (0..6 * size * size).map(texel).collect();
        let seam = seam(&cube);
        println!("{size} texels wide: seam {seam:.3}");
        assert!(size > 8 || seam > 0.15, "{size} texels wide: no seam, {seam}");
    }
    // The last mip of all, one texel a face: its colour is that of the middle, out to the corner.
    let off = |size: f64| {
        let corner = cube_direction(0, DVec2::ZERO);
        corner.angle_between(cube_direction(0, DVec2::splat(0.5 / size))).to_degrees()
    };
    assert!((off(1.0) - 54.7).abs() < 0.1 && off(16.0) < 4.0, "{} and {}", off(1.0), off(16.0));
    assert_eq!(texel_directions(&cube).next().map(|d| cube_face(d).0), Some(0));
}

#[test]
fn triangles_with_unusable_normals_are_lit_all_over() {
    let naive = |n: Vec3| n / n.dot(n).sqrt();
    let normals = ["0 0 0", "0 0 1e-23", "0 0 1e20", "0 0 -1", "nan 0 1"];
    for n in [Vec3::ZERO, Vec3::Z * 1e-23, Vec3::Z * 1e20, Vec3::Z.lerp(-Vec3::Z, 0.5)] {
        assert!((naive(n).length() - 1.0).abs() > 0.5 || naive(n).is_nan(), "{n} can be normalised after all");
    }
    let shop = Workshop::new();
    // In even light a white dielectric looks white, whatever its normals are, as long as they are normals.
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    shop.write("m.mtl", &material([1.0; 3], 0.0, 0.5));
    for a in normals {
        for b in normals {
            // The first corner's is good; it is opposite to the fourth.
            let obj = square("m.mtl").replace("vn 0 0 1\n", &format!("vn 0 0 1\nvn {a}\nvn {b}\n"));
            shop.write("m.obj", &obj.replace("f 1/1/1 2/2/1 3/3/1 4/4/1", "f 1/1/1 2/2/2 3/3/3\nf 1/1/1 3/3/2 4/4/3"));
            for texel in seen(&shop, Shading::Pbr) {
                assert!((texel[0] - 1.0).abs() < 0.005, "normals {a} and {b}: {texel:?}");
            }
        }
    }
}

/// The tangent of a triangle by its edges (e) and their texture coordinates (t).
fn naive_tangent(e: [Vec3; 2], t: [Vec2; 2]) -> Vec3 {
    (e[0] * t[1].y - e[1] * t[0].y) / t[0].perp_dot(t[1])
}

#[test]
fn mirrored_halves_and_coordinates_without_area_are_lit_from_the_right_side() {
    let edges = [Vec3::X, Vec3::Y];
    assert!(!naive_tangent(edges, [Vec2::ZERO; 2]).is_finite());
    // Left and right of a common edge; what a shared vertex sums up is nothing.
    let [right, left] = [Vec2::X, -Vec2::X].map(|u| naive_tangent(edges, [u, Vec2::Y]));
    assert!((right + left).normalize().is_nan(), "mirrored tangents no longer cancel");

    let lean = 30f32.to_radians();
    let shop = Workshop::new();
    let texel = [lean.sin(), 0.0, lean.cos()].map(|c| (127.5 + 127.5 * c).round() as u8);
    image::RgbImage::from_pixel(4, 4, image::Rgb(texel)).save(shop.path("n.png")).expect("a normal map");
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    shop.write("m.mtl", &(material([1.0; 3], 0.0, 0.5) + "norm n.png\n"));
    // Two squares that share the edge x = 0, where u is 0 for both and grows to either side.
    let places = "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0\nvn 0 0 1\n";
    let faces = "usemtl m\nf 1/2/1 2/1/1 3/3/1 4/4/1\nf 2/1/1 5/2/1 6/4/1 3/3/1\n";
    let at = |pixels: &[[f32; 4]], x: u32, y: u32| {
        let [r, g, b, _] = pixels[(y * SIZE[0] + x) as usize];
        2.0 * Vec3::new(r, g, b) - 1.0
    };
    shop.write("m.obj", &format!("mtllib m.mtl\n{places}vt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n{faces}"));
    let pixels = seen(&shop, Shading::Normal);
    for y in [12, 24, 36] {
        for (x, side) in [(15, -1.0), (22, -1.0), (25, 1.0), (32, 1.0)] {
            let n = at(&pixels, x, y);
            assert!((n.x - 0.5 * side).abs() < 0.01 && n.z > 0.85, "pixel {x}, {y}: {n}");
        }
    }
    // All corners at one place of the texture: any tangent will do.
    shop.write("m.obj", &format!("mtllib m.mtl\n{places}{}{faces}", "vt 0.5 0.5\n".repeat(4)));
    let pixels = seen(&shop, Shading::Normal);
    for (x, y) in [(16, 24), (32, 12)] {
        let n = at(&pixels, x, y);
        assert!((n.z - lean.cos()).abs() < 0.02 && (n.length() - 1.0).abs() < 0.02, "pixel {x}, {y}: {n}");
    }
}

#[test]
fn fresnel_is_counted_once() {
    let (mut ours, mut naive) = (0.0f64, 0.0f64);
    let white = vec![[1.0; 3]; 64 * 32];
    let view = PanoramaView::new(64, 32, &white).expect("a panorama");
    for roughness in [0.3, 0.6, 0.9] {
        for nv in [0.05, 0.2, 0.5, 1.0f64] {
            let (n, v) = (DVec3::Z, DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv));
            let f0 = DVec3::splat(0.04);
            let surface = Surface { n, v, base_color: f0, metallic: 1.0, roughness };
            let truth = reflected(view, &surface, Geometry::Smith, Scattering::Single).specular.x;
            let entry = table_entry(nv, roughness, Geometry::Smith);
            let reflectance = |f0: f64| f0 * entry.scale + entry.bias;
            let twice = f_schlick_roughness(f0, nv, roughness).x;
            ours = ours.max((reflectance(f0.x) / truth - 1.0).abs());
            naive = naive.max((reflectance(twice) / truth - 1.0).abs());
        }
    }
    println!("worst relative error: ours {ours:.5}, with Fresnel twice {naive:.3}");
    assert!(ours < 0.005 && naive > 0.5, "ours {ours}, with Fresnel twice {naive}");
}
