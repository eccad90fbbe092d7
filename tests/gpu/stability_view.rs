//! Difficult viewpoints: inside things, behind them, far from them, among tiny and huge ones, turned apart, at the near
//! plane; and surfaces as smooth, as rough and as broken as they come. `stability.rs` lists all cases.

use crate::common::stage::{Stage, assert_sane, scaled, scene, shipped, with_gpu};
use crate::common::{Workshop, material, sphere, square};
use glam::{Mat4, Quat, Vec3};
use pbr_vr::asset::comparison::compare;
use pbr_vr::render::{Eye, NEAR_METRES, Output, Shading};
use pbr_vr::scene::{Camera, Scene};

const SIZE: [u32; 2] = [64, 48];
const ASPECT: f32 = 64.0 / 48.0;

/// Models of `parts` (file, MTL, OBJ, more keys) under a panorama that looks different everywhere.
fn world(parts: &[(&str, String, String, &str)], more: &str) -> Scene {
    let shop = Workshop::new();
    shop.sky(0.0);
    let mut text = format!("environment = {{ panorama = \"sky.exr\" }}\n{more}\n");
    for (name, mtl, obj, keys) in parts {
        shop.write(&format!("{name}.mtl"), mtl);
        shop.write(&format!("{name}.obj"), obj);
        text += &format!("[[model]]\nfile = \"{name}.obj\"\n{keys}\n");
    }
    text += "[[camera]]\nname = \"c\"\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n";
    scene(&shop.write("scene.toml", &text))
}

fn ball(mtl: String) -> Scene {
    world(&[("m", mtl, sphere("m.mtl"), "")], "")
}

fn eye_of(camera: &Camera) -> Eye {
    Eye::of_camera(camera, ASPECT)
}

fn at(pixels: &[[f32; 4]], x: u32, y: u32) -> Vec3 {
    let [r, g, b, _] = pixels[(y * SIZE[0] + x) as usize];
    Vec3::new(r, g, b)
}

/// The direction that a pixel's centre looks in.
fn direction(eye: &Eye, x: u32, y: u32) -> Vec3 {
    let part = |i: u32, count: u32| (i as f32 + 0.5) / count as f32;
    let (u, v) = (part(x, SIZE[0]), part(y, SIZE[1]));
    let view = Vec3::new(eye.left + u * (eye.right - eye.left), eye.up + v * (eye.down - eye.up), -1.0);
    eye.world_from_view.transform_vector3(view).normalize()
}

#[test]
fn a_scene_of_any_scale_looks_the_same_to_eyes_that_scale_along() {
    with_gpu(|gpu| {
        for file in ["teapot.toml", "sphere.toml"] {
            let scene = scene(&shipped(file));
            let show = |scale: f32, size: [u32; 2]| {
                let scene = scaled(scene.clone(), scale);
                Stage::new(gpu, &scene, size, 4, Output::Display).picture(&eye_of(&scene.cameras[0]))
            };
            let (size, truth) = ([160, 120], show(1.0, [160, 120]));
            for scale in [1e-3, 1e3] {
                let flip = compare(&show(scale, size), &truth).expect("two pictures of one size");
                println!("{file} times {scale}: FLIP {:.5}, at most {:.3}", flip.flip_mean, flip.flip_max);
                assert!(flip.flip_mean < 5e-4, "{file} times {scale}: {}", flip.flip_mean);
            }
        }
    });
    // The naive near plane, the same for every scene: the tiny teapot, half a millimetre away, is cut away by it.
    let naive = Eye { near_metres: NEAR_METRES, ..eye_of(&scaled(scene(&shipped("teapot.toml")), 1e-3).cameras[0]) };
    let clip = naive.clip_from_world() * Vec3::ZERO.extend(1.0);
    assert!(clip.z / clip.w > 1.0, "{clip}");
}

#[test]
fn an_eye_inside_of_a_ball_sees_its_inside_in_every_pixel() {
    with_gpu(|gpu| {
        let scene = ball(material([0.25, 0.5, 1.0], 0.0, 0.3));
        let mut colour = Stage::showing(gpu, &scene, SIZE, 4, Output::Linear, Shading::BaseColor);
        let mut light = Stage::new(gpu, &scene, SIZE, 4, Output::Linear);
        for place in [Vec3::ZERO, Vec3::new(0.0, 0.999, 0.0), Vec3::new(-0.5, 0.3, 0.81)] {
            for target in [Vec3::new(3.0, 1.0, 0.2), Vec3::new(0.0, 9.0, 0.0), Vec3::new(-2.0, -5.0, 1.0)] {
                let eye = Eye { near_metres: 1e-5, ..Eye::looking(place, target, 90.0, ASPECT) };
                for texel in colour.radiance(&eye) {
                    assert_eq!(texel[..3], [0.25, 0.5, 1.0], "from {place} to {target}");
                }
                // The sky sends at most 1.5, and nothing reflects more than it gets.
                assert_sane(&light.radiance(&eye), 1.51, &format!("from {place} to {target}"));
            }
        }
    });
}

#[test]
fn what_is_behind_the_eye_or_far_away_leaves_the_sky_as_it_is() {
    with_gpu(|gpu| {
        let mut with_ball = Stage::new(gpu, &ball(material([1.0; 3], 1.0, 0.2)), SIZE, 4, Output::Linear);
        // A thousandth of a metre in size, a thousand kilometres away: the sky, as far as anyone sees.
        let speck = world(
            &[("m", material([1.0; 3], 1.0, 0.2), sphere("m.mtl"), "translation = [0, 1e6, 0]\nscale = 1e-3")],
            "",
        );
        let mut empty = Stage::new(gpu, &speck, SIZE, 4, Output::Linear);
        for (place, target) in [
            (Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.3, 0.1, 9.0)),
            (Vec3::new(1e6, 2e6, 0.0), Vec3::new(2e6, 2e6, 1e6)),
            (Vec3::new(3.0, -2.0, 0.0), Vec3::new(9.0, -6.2, 1.0)),
        ] {
            let eye = Eye::looking(place, target, 60.0, ASPECT);
            assert_eq!(with_ball.radiance(&eye), empty.radiance(&eye), "from {place} to {target}");
        }
        // Seen from a thousand kilometres it is less than a pixel of the sky.
        let eye = Eye::looking(Vec3::new(0.0, 0.0, 1e6), Vec3::ZERO, 60.0, ASPECT);
        let (far, sky) = (with_ball.radiance(&eye), empty.radiance(&eye));
        assert_sane(&far, 1.51, "far away");
        let differing = far.iter().zip(&sky).filter(|(a, b)| a != b).count();
        assert!(differing <= 4, "{differing} pixels show a ball of two metres from a thousand kilometres");
    });
}

/// A floor of 4 km under an eye at half a metre: its triangles reach far behind the eye and through its near plane.
#[test]
fn triangles_through_the_near_plane_and_behind_the_eye_cover_what_they_should() {
    let floor = || {
        let keys = "rotation_degrees = [-90, 0, 0]\nscale = 4000.0";
        world(&[("m", material([0.25, 0.5, 1.0], 0.0, 0.5), square("m.mtl"), keys)], "")
    };
    let eye = Eye::looking(Vec3::new(1.0, 0.5, 2.0), Vec3::new(2.0, 0.3, 1.0), 80.0, ASPECT);
    let on_floor = |x: u32, y: u32| {
        let d = direction(&eye, x, y);
        let t = -0.5 / d.y;
        // What a pixel's samples may see differently lies within two rows of the horizon.
        if d.y.abs() < 0.06 { None } else { Some(d.y < 0.0 && (t * d).length() < 1990.0) }
    };
    with_gpu(|gpu| {
        let mut stage = Stage::showing(gpu, &floor(), SIZE, 4, Output::Linear, Shading::BaseColor);
        let pixels = stage.radiance(&eye);
        let mut seen = [0, 0];
        for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
            let Some(wanted) = on_floor(x, y) else { continue };
            assert_eq!(at(&pixels, x, y) == Vec3::new(0.25, 0.5, 1.0), wanted, "pixel {x}, {y}");
            seen[usize::from(wanted)] += 1;
        }
        assert!(seen.iter().all(|count| *count > 500), "{seen:?}");
    });
    // The naive way: corners divided by their w, those behind the eye too. They come out above the horizon.
    let corners = [[-2e3, -2e3], [2e3, -2e3], [2e3, 2e3], [-2e3, 2e3]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let behind = corners.map(|c| eye.clip_from_world() * c.extend(1.0)).into_iter().filter(|c| c.w < 0.0);
    let middle = direction(&eye, SIZE[0] / 2, 0);
    assert!(middle.y > 0.0);
    assert!(behind.clone().count() >= 1 && behind.into_iter().all(|c| c.y / c.w < 0.0), "above: Vulkan's y is down");
}

#[test]
fn surfaces_a_hand_apart_are_told_apart_two_kilometres_away() {
    const GAP: f32 = 0.1;
    let paint = |albedo| material(albedo, 0.0, 0.5);
    let wall = |z: f32| format!("translation = [0, 0, {z}]\nscale = 2000.0");
    let (front, back) = (wall(-2000.0), wall(-2000.0 - GAP));
    with_gpu(|gpu| {
        for first in [true, false] {
            let mut parts = vec![
                ("red", paint([1.0, 0.0, 0.0]), square("red.mtl"), front.as_str()),
                ("green", paint([0.0, 1.0, 0.0]), square("green.mtl"), back.as_str()),
            ];
            if first {
                parts.reverse();
            }
            let scene = world(&parts, "");
            let mut stage = Stage::showing(gpu, &scene, SIZE, 4, Output::Linear, Shading::BaseColor);
            let eye = Eye { near_metres: NEAR_METRES, ..Eye::looking(Vec3::ZERO, -Vec3::Z, 30.0, ASPECT) };
            let pixels = stage.radiance(&eye);
            assert!(pixels.iter().all(|p| p[..3] == [1.0, 0.0, 0.0]), "the wall behind shows through");
        }
    });
    // The naive depth, from 0 at the near plane to 1 at a far one.
    let naive = |z: f32| {
        let (near, far) = (NEAR_METRES, 1e4);
        far / (far - near) - far * near / (far - near) / z
    };
    assert_eq!(naive(2000.0), naive(2000.0 + GAP), "a depth that grows keeps them apart after all");
}

/// Headsets turn their displays outwards, and lenses see more to the outside than to the nose.
#[test]
fn canted_eyes_with_uneven_frusta_see_each_direction_where_it_is() {
    let (mut worst, mut naive) = (0.0f32, f32::MAX);
    with_gpu(|gpu| {
        let speck = world(
            &[("m", material([1.0; 3], 0.0, 0.2), sphere("m.mtl"), "translation = [0, 1e6, 0]\nscale = 1e-3")],
            "",
        );
        let mut stage = Stage::new(gpu, &speck, SIZE, 4, Output::Linear);
        for (cant_degrees, left, right) in [(10.0f32, -1.4, 1.1), (-10.0, -1.1, 1.4)] {
            let head = Mat4::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::new(1.0, 1.6, -2.0));
            let cant = Mat4::from_rotation_y(cant_degrees.to_radians());
            let eye = |cant| Eye { world_from_view: head * cant, left, right, down: -1.3, up: 1.2, near_metres: 0.02 };
            let pixels = stage.radiance(&eye(cant));
            let off = |eye: &Eye| {
                let mut off = 0.0f32;
                for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
                    // The sky is 1 + d / 2, of 64 texels.
                    off = off.max((at(&pixels, x, y) - (1.0 + 0.5 * direction(eye, x, y))).abs().max_element());
                }
                off
            };
            worst = worst.max(off(&eye(cant)));
            naive = naive.min(off(&eye(Mat4::IDENTITY)));
        }
    });
    println!("off by {worst:.4}; with parallel axes by {naive:.4}");
    assert!(worst < 0.02 && naive > 0.08, "{worst} and {naive}");
}

#[test]
fn the_smoothest_and_the_roughest_surfaces_are_finite_and_next_to_their_neighbours() {
    let lights = "[[light]]\npoint = { position = [0, 0, 3], intensity = [20, 20, 20] }\n";
    with_gpu(|gpu| {
        for metallic in [0.0, 1.0] {
            let show = |roughness: f32, lights: &str| {
                let mtl = material([0.9; 3], metallic, roughness);
                let scene = world(&[("m", mtl, sphere("m.mtl"), "")], lights);
                let eye = eye_of(&scene.cameras[0]);
                let radiance = Stage::new(gpu, &scene, SIZE, 4, Output::Linear).radiance(&eye);
                // The point light's irradiance is 5 W/m², its highlight at most 1 / (4 π 0.045⁴) / sr.
                let most = if lights.is_empty() { 1.51 } else { 1.51 + 5.0 * 19_500.0 };
                assert_sane(&radiance, most, &format!("metallic {metallic}, roughness {roughness}"));
                radiance
            };
            for (end, neighbour) in [(0.0, 1e-4), (1.0, 0.999)] {
                for lights in ["", lights] {
                    let (a, b) = (show(end, lights), show(neighbour, lights));
                    let off = |(a, b): (&[f32; 4], &[f32; 4])| (a[0] - b[0]).abs() / (0.1 + a[0]);
                    let worst = a.iter().zip(&b).map(off).fold(0.0, f32::max);
                    assert!(worst < 0.01, "metallic {metallic}: {end} and {neighbour} differ by {worst}");
                }
            }
        }
    });
}

/// Nothing that is in a map makes a NaN: 0 in a normal map is no vector, 255 none of unit length.
#[test]
fn maps_full_of_nonsense_neither_break_a_picture_nor_make_light() {
    type Texel = fn(u32, u32) -> [u8; 3];
    let maps: [(&str, Texel); 5] = [
        ("zero", |_, _| [0; 3]),
        ("full", |_, _| [255; 3]),
        ("middle", |_, _| [127, 128, 0]),
        ("checker", |x, y| [255 * ((x + y) % 2) as u8; 3]),
        ("noise", |x, y| [x * 97 + y * 31, (x * 13) ^ (y * 71), x * 7 + y * 193].map(|v| v as u8)),
    ];
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    for (name, texel) in maps {
        let image = image::RgbImage::from_fn(32, 32, |x, y| image::Rgb(texel(x, y)));
        image.save(shop.path(&format!("{name}.png"))).expect("a map");
    }
    shop.write("m.obj", &sphere("m.mtl"));
    let camera = "[[camera]]\nname = \"c\"\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n";
    let light = "[[light]]\npoint = { position = [0, 0, 1], intensity = [1, 1, 1] }\n"; // in the very surface
    let text = |light: &str| {
        format!("environment = {{ panorama = \"sky.exr\" }}\n{light}[[model]]\nfile = \"m.obj\"\n{camera}")
    };
    let (dark, lit) = (shop.write("dark.toml", &text("")), shop.write("lit.toml", &text(light)));
    with_gpu(|gpu| {
        let show = |mtl: &str, path, most: f32, case: &str| {
            shop.write("m.mtl", mtl);
            let scene = scene(path);
            let radiance = Stage::new(gpu, &scene, SIZE, 4, Output::Linear).radiance(&eye_of(&scene.cameras[0]));
            assert_sane(&radiance, most, case);
            radiance
        };
        for (normals, _) in maps {
            for (others, _) in [maps[0], maps[1], maps[4]] {
                let norm = format!("norm {normals}.png\n");
                // In a furnace a white dielectric cannot be seen, whatever its normals and its roughness are.
                let white = material([1.0; 3], 0.0, 1.0) + &norm + &format!("map_Pr {others}.png\n");
                for texel in show(&white, &dark, 1.005, &white) {
                    assert!((texel[0] - 1.0).abs() < 0.005, "{texel:?} for {white}");
                }
                let all = format!("{white}map_Kd {others}.png\nmap_Pm {others}.png\nmap_Ka {others}.png\n");
                show(&all, &dark, 1.005, &all);
                // The nearest fragments are a millimetre from the light.
                show(&all, &lit, 1e13, &all);
            }
        }
    });
}
