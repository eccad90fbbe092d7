//! Light end to end on the GPU: furnace, inverse square, orientation, normal maps, point lights, masks, stereo.

use std::path::PathBuf;

use crate::common::{PictureOptions, Workshop, material, mean_at, pixel, sphere, square};
use glam::{DVec3, Vec2};
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::brdf::{Fresnel, Geometry, diffuse_karis2013, f0_from_metallic, specular};
use pbr_vr::reference::energy::{Energy, Scattering};
use pbr_vr::reference::table::specular_albedo;
use pbr_vr::reference::table::table_entry;
use pbr_vr::render::{IPD_METRES, Shading};

const BLACK: [f32; 3] = [0.0; 3];
const WHITE: [f32; 3] = [1.0; 3];

/// One model under one panorama, seen from +Z at `distance`.
fn scene(shop: &Workshop, obj: &str, mtl: &str, distance: f32, more: &str) -> PathBuf {
    shop.write("m.mtl", mtl);
    shop.write("model.obj", obj);
    let camera = format!(
        "[[camera]]\nname = \"front\"\nposition = [0, 0, {distance}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n"
    );
    let text = format!("environment = {{ panorama = \"sky.exr\" }}\n{more}\n[[model]]\nfile = \"model.obj\"\n{camera}");
    shop.write("scene.toml", &text)
}

#[test]
fn a_white_furnace_hides_a_white_dielectric() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |_| WHITE);
    for geometry in [Geometry::Smith, Geometry::Karis2013] {
        for roughness in [0.05, 0.3, 0.6, 1.0] {
            let scene = scene(&shop, &sphere("m.mtl"), &material(WHITE, 0.0, roughness), 3.5, "");
            let picture = &shop.render(&scene, &PictureOptions { geometry, ..PictureOptions::default() })[0];
            let worst = picture.pixels.iter().flatten().map(|v| (v - 1.0).abs()).fold(0.0, f32::max);
            assert!(worst <= 0.005, "roughness {roughness}, {geometry:?}: off by {worst}");
        }
    }
}

/// Where the ray through a pixel of a `size`² picture by the 40° camera at `distance` on +Z meets the unit sphere:
/// the normal and the ray's direction; `None` outside and within 3 % of the silhouette.
fn on_sphere(x: u32, y: u32, size: u32, distance: f64) -> Option<(DVec3, DVec3)> {
    let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0) * 20f64.to_radians().tan();
    let (eye, d) = (DVec3::Z * distance, DVec3::new(at(x), -at(y), -1.0).normalize());
    let b = eye.dot(d);
    let miss2 = eye.length_squared() - b * b;
    (miss2 < 0.94).then(|| (eye + d * (-b - (1.0 - miss2).sqrt()), d))
}

#[test]
fn a_white_furnace_shows_a_metal_that_scatters_once_by_its_directional_albedo() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |_| WHITE);
    for geometry in [Geometry::Smith, Geometry::Karis2013] {
        for roughness in [0.05, 0.3, 0.6, 1.0] {
            let (size, distance) = (384, 3.5);
            let scene = scene(&shop, &sphere("m.mtl"), &material(WHITE, 1.0, roughness), distance, "");
            let options = PictureOptions {
                geometry,
                scattering: Scattering::Single,
                size: [size, size],
                ..PictureOptions::default()
            };
            let picture = &shop.render(&scene, &options)[0];
            let mut compared = 0;
            for y in (0..size).step_by(12) {
                for x in (0..size).step_by(12) {
                    let Some((n, d)) = on_sphere(x, y, size, f64::from(distance)) else { continue };
                    let want = specular_albedo(DVec3::ONE, -n.dot(d), f64::from(roughness), geometry).x;
                    let got = pixel(picture, x, y)[0];
                    // Single scattering: less than 1, as the integral of the BRDF says.
                    let case = format!("{geometry:?}, roughness {roughness}, n·v {:.3}", -n.dot(d));
                    assert!((got - want).abs() <= 0.008, "{case}: {got} against {want}");
                    compared += 1;
                }
            }
            assert!(compared > 200, "{compared}");
        }
    }
}

fn point_light(height: f32, intensity: f32) -> String {
    format!(
        "[[light]]\npoint = {{ position = [0, 0, {height}], intensity = [{intensity}, {intensity}, {intensity}] }}\n"
    )
}

fn lit_square(height: f32, intensity: f32, roughness: f32, geometry: Geometry, metallic: f32) -> f64 {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| BLACK);
    let mtl = material([0.5; 3], metallic, roughness);
    let scene = scene(&shop, &square("m.mtl"), &mtl, 1.0, &point_light(height, intensity));
    let picture = &shop.render(&scene, &PictureOptions { size: [65, 65], geometry, ..PictureOptions::default() })[0];
    pixel(picture, 32, 32)[0]
}

#[test]
fn a_point_light_twice_as_far_gives_a_quarter() {
    let (near, far) =
        (lit_square(1.0, 40.0, 0.5, Geometry::Smith, 0.0), lit_square(2.0, 40.0, 0.5, Geometry::Smith, 0.0));
    assert!((near / far - 4.0).abs() < 0.004, "{near} against {far}");
}

/// The BRDF of a surface of base color 0.5 whose normal is +Z. A dielectric's second bounces are left out as invisible.
fn brdf([v, l]: [DVec3; 2], [roughness, metallic, ior]: [f64; 3], geometry: Geometry) -> f64 {
    let base_color = DVec3::splat(0.5);
    let dielectric_f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
    let f0 = f0_from_metallic(base_color, metallic, dielectric_f0);
    let scattering = if metallic > 0.0 { Scattering::Multiple } else { Scattering::Single };
    let [at_v, at_l] = [v, l].map(|d| table_entry(d.z, roughness, geometry));
    let beyond = match geometry {
        Geometry::Smith => {
            Energy { dielectric: Fresnel::dielectric(dielectric_f0), ..Energy::new(roughness, geometry, scattering) }
                .beyond_single(base_color, metallic, at_l, at_v)
        }
        Geometry::Karis2013 => (1.0 - metallic) * diffuse_karis2013(base_color, f0, 0.5 * (v + l).length()),
    };
    (specular(DVec3::Z, v, l, f0, roughness, geometry) + beyond).x
}

#[test]
fn a_point_light_gives_the_radiance_that_the_f64_brdf_says() {
    let unit = |x, y, z| DVec3::new(x, y, z).normalize();
    // Head on, beside the mirror direction, out of the plane of incidence, either and both grazing, light from the eye's side.
    let directions = [
        [DVec3::Z, DVec3::Z],
        [unit(0.5, 0.1, 0.7), unit(-0.5, 0.1, 0.8)],
        [unit(0.6, 0.2, 0.5), unit(0.3, 0.8, 0.4)],
        [unit(0.9, 0.3, 0.2), unit(-0.2, 0.1, 0.9)],
        [unit(0.1, -0.3, 0.9), unit(0.2, 0.9, 0.15)],
        [unit(0.9, 0.2, 0.25), unit(-0.8, -0.3, 0.2)],
        [unit(-0.7, 0.2, 0.4), unit(-0.6, 0.4, 0.5)],
    ];
    let away = 2.0;
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| BLACK);
    for ([v, l], geometry) in directions.into_iter().flat_map(|d| [(d, Geometry::Smith), (d, Geometry::Karis2013)]) {
        for [roughness, metallic, ior] in
            [[0.3, 0.0, 1.5], [0.6, 1.0, 1.5], [1.0, 1.0, 1.5], [0.8, 0.5, 1.5], [0.2, 0.0, 2.0]]
        {
            shop.write("m.mtl", &format!("{}Ni {ior}\n", material([0.5; 3], metallic, roughness)));
            shop.write("model.obj", &square("m.mtl"));
            let ([ex, ey, ez], [lx, ly, lz]) = (v.to_array(), (away * l).to_array());
            let text = format!(
                "environment = {{ panorama = \"sky.exr\" }}\n[[light]]\n\
                 point = {{ position = [{lx}, {ly}, {lz}], intensity = [40, 40, 40] }}\n[[model]]\nfile = \"model.obj\"\n\
                 [[camera]]\nname = \"slanted\"\nposition = [{ex}, {ey}, {ez}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 2\n"
            );
            let scene = shop.write("scene.toml", &text);
            let picture =
                &shop.render(&scene, &PictureOptions { size: [65, 65], geometry, ..PictureOptions::default() })[0];
            // The middle pixel is the origin, wherever in its 0.03 degrees it is shaded.
            let got = pixel(picture, 32, 32)[0];
            let want = 40.0 / (away * away) * l.z * brdf([v, l], [roughness, metallic, ior].map(f64::from), geometry);
            let case = format!("{geometry:?} {roughness} {metallic} {ior}, v {v:.2}, l {l:.2}");
            assert!((got / want - 1.0).abs() < 5e-3, "{case}: {got} against {want}");
        }
    }
}

#[test]
fn sixteen_point_lights_add_up() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| BLACK);
    let render = |lights: &str| {
        let scene = scene(&shop, &square("m.mtl"), &material([0.5; 3], 0.0, 0.4), 1.0, lights);
        shop.render(&scene, &PictureOptions::default()).remove(0)
    };
    let (one, many) = (render(&point_light(1.5, 32.0)), render(&point_light(1.5, 2.0).repeat(16)));
    for (a, b) in one.pixels.iter().zip(&many.pixels) {
        assert!((a[0] - b[0]).abs() <= 1e-4 * a[0].max(1e-3), "{a:?} against {b:?}");
    }
}

/// Radiance 1/2 + d/2: different in every direction.
fn compass(d: [f64; 3]) -> [f32; 3] {
    d.map(|c| (0.5 + 0.5 * c) as f32)
}

fn sky_scene(shop: &Workshop, turn_degrees: f64, target: [f64; 3]) -> PathBuf {
    shop.write("m.mtl", &material(WHITE, 0.0, 0.5));
    shop.write("model.obj", &square("m.mtl"));
    let text = format!(
        "environment = {{ panorama = \"sky.exr\", rotation_degrees = {turn_degrees} }}\n\
         [[model]]\nfile = \"model.obj\"\ntranslation = [0, 0, -1000]\nscale = 0.001\n\
         [[camera]]\nname = \"c\"\nposition = [0, 0, 0]\ntarget = {target:?}\nvertical_fov_degrees = 60\n"
    );
    shop.write("sky.toml", &text)
}

#[test]
fn the_sky_shows_every_direction_where_it_is() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 512, compass);
    for target in
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    {
        let picture = &shop
            .render(&sky_scene(&shop, 0.0, target), &PictureOptions { size: [64, 64], ..PictureOptions::default() })[0];
        let forward = DVec3::from(target);
        // The camera's own axes: right is forward × up, and looking along Y the picture's up is ∓Z.
        let right = if forward.y.abs() > 0.5 { DVec3::X } else { forward.cross(DVec3::Y) };
        let up = right.cross(forward);
        let tangent = 30f64.to_radians().tan();
        for y in 0..64 {
            for x in 0..64 {
                let at = |i: u32| (f64::from(i) + 0.5) / 32.0 - 1.0;
                let d = (forward + right * (at(x) * tangent) - up * (at(y) * tangent)).normalize();
                let (got, want) = (pixel(picture, x, y), compass(d.into()));
                for c in 0..3 {
                    // Filtering is as wide as a texel of 0.7 degrees; at the poles u and v are coarse.
                    assert!(
                        (got[c] - f64::from(want[c])).abs() < 0.012,
                        "to {target:?} at {x},{y}: {got:?}, not {want:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn turning_the_panorama_turns_it_counter_clockwise_from_above() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 512, compass);
    // +X turned by 90 degrees about +Y is −Z.
    let picture = &shop.render(
        &sky_scene(&shop, 90.0, [0.0, 0.0, -1.0]),
        &PictureOptions { size: [65, 65], ..PictureOptions::default() },
    )[0];
    let (got, want) = (pixel(picture, 32, 32), compass([1.0, 0.0, 0.0]));
    assert!((0..3).all(|c| (got[c] - f64::from(want[c])).abs() < 0.01), "{got:?}");
}

#[test]
fn a_mirror_ball_shows_every_direction_where_it_is() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 512, compass);
    let scene = scene(&shop, &sphere("m.mtl"), &material(WHITE, 1.0, 0.0), 6.0, "");
    let size = 128;
    let picture = &shop.render(&scene, &PictureOptions { size: [size, size], ..PictureOptions::default() })[0];
    let mut compared = 0;
    for y in 0..size {
        for x in 0..size {
            let Some((n, d)) = on_sphere(x, y, size, 6.0) else { continue };
            let (got, want) = (pixel(picture, x, y), compass(d.reflect(n).into()));
            assert!((0..3).all(|c| (got[c] - f64::from(want[c])).abs() < 0.03), "at {x},{y}: {got:?}, not {want:?}");
            compared += 1;
        }
    }
    assert!(compared > 1000);
}

/// A square whose normal map leans by 30 degrees towards +u or +v.
fn leaning(shop: &Workshop, towards: [f64; 2], mirror: bool) -> [f64; 3] {
    let lean = 30f64.to_radians();
    let n = [lean.sin() * towards[0], lean.sin() * towards[1], lean.cos()];
    let texel = n.map(|c| (127.5 + 127.5 * c).round() as u8);
    let image = image::RgbImage::from_pixel(4, 4, image::Rgb(texel));
    image.save(shop.path("n.png")).expect("a normal map");
    let obj = square("m.mtl");
    let obj =
        if mirror { obj.replace("vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1", "vt 1 0\nvt 0 0\nvt 0 1\nvt 1 1") } else { obj };
    shop.panorama("sky.exr", 16, |_| BLACK);
    let mtl = material(WHITE, 0.0, 0.5) + "norm n.png\n";
    let scene = scene(shop, &obj, &mtl, 1.0, "");
    let picture = &shop.render(&scene, &PictureOptions { shading: Shading::Normal, ..PictureOptions::default() })[0];
    mean_at(picture, 48, 48, 4).map(|c| 2.0 * c - 1.0)
}

#[test]
fn normal_maps_lean_towards_u_and_up_also_where_uvs_are_mirrored() {
    let shop = Workshop::new();
    for (towards, mirror, want) in [
        ([1.0, 0.0], false, [0.5, 0.0]),
        ([0.0, 1.0], false, [0.0, 0.5]),
        ([1.0, 0.0], true, [-0.5, 0.0]),
        ([0.0, 1.0], true, [0.0, 0.5]),
    ] {
        let n = leaning(&shop, towards, mirror);
        let off = (n[0] - want[0]).abs().max((n[1] - want[1]).abs());
        assert!(off < 0.01 && n[2] > 0.85, "{towards:?}, mirrored {mirror}: {n:?}");
    }
}

#[test]
fn a_mask_cuts_holes() {
    let shop = Workshop::new();
    let mask = image::GrayImage::from_fn(64, 64, |x, _| image::Luma([if x < 32 { 0 } else { 255 }]));
    mask.save(shop.path("mask.png")).expect("a mask");
    shop.panorama("sky.exr", 16, |_| [0.0, 0.0, 1.0]);
    let mtl = material([1.0, 0.0, 0.0], 0.0, 1.0) + "map_d mask.png\n";
    let scene = scene(&shop, &square("m.mtl"), &mtl, 1.0, "");
    let picture = &shop.render(&scene, &PictureOptions { shading: Shading::BaseColor, ..PictureOptions::default() })[0];
    assert_eq!(mean_at(picture, 30, 48, 2), [0.0, 0.0, 1.0], "left of the middle the sky shows through");
    assert_eq!(mean_at(picture, 66, 48, 2), [1.0, 0.0, 0.0]);
}

#[test]
fn edges_of_holes_are_as_smooth_as_those_of_triangles() {
    let shop = Workshop::new();
    let hole = |x: u32, y: u32| Vec2::new(x as f32 - 63.5, y as f32 - 63.5).length() < 40.0;
    let mask = image::GrayImage::from_fn(128, 128, |x, y| image::Luma([if hole(x, y) { 0 } else { 255 }]));
    mask.save(shop.path("mask.png")).expect("a mask");
    shop.panorama("sky.exr", 16, |_| [0.0, 0.0, 1.0]);
    let mtl = material([1.0, 0.0, 0.0], 0.0, 1.0) + "map_d mask.png\n";
    let scene = scene(&shop, &square("m.mtl"), &mtl, 1.0, "");
    let seen = |side| {
        shop.render(
            &scene,
            &PictureOptions { size: [side; 2], shading: Shading::BaseColor, ..PictureOptions::default() },
        )
        .remove(0)
    };
    let (ours, fine) = (seen(96), seen(96 * 7));
    let mut errors = Vec::new();
    for (x, y) in (0..96).flat_map(|y| (0..96).map(move |x| (x, y))) {
        let truth = mean_at(&fine, 7 * x + 3, 7 * y + 3, 3)[0];
        if (0.25..0.75).contains(&truth) {
            errors.push((pixel(&ours, x, y)[0] - truth).abs());
        }
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("{} pixels at the edge, off by {mean}", errors.len());
    // Four samples that come and go together would be off by 0.25 at least.
    assert!(errors.len() > 40 && mean < 0.13, "{} pixels at the edge, off by {mean}", errors.len());
}

#[test]
fn stereo_eyes_see_what_two_single_eyes_see_and_differ_by_the_disparity() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| BLACK);
    shop.write("m.mtl", &material(WHITE, 0.0, 0.5));
    shop.write("model.obj", &square("m.mtl"));
    let half = f64::from(IPD_METRES) / 2.0;
    let camera = |name: &str, x: f64| {
        format!(
            "[[camera]]\nname = \"{name}\"\nposition = [{x}, 0, 2]\ntarget = [{x}, 0, 0]\nvertical_fov_degrees = 40\n"
        )
    };
    let text = format!(
        "environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"model.obj\"\n{}{}{}",
        camera("middle", 0.0),
        camera("left", -half),
        camera("right", half)
    );
    let scene = shop.write("stereo.toml", &text);
    let options = PictureOptions { size: [320, 240], shading: Shading::BaseColor, ..PictureOptions::default() };
    let both = shop.render(&scene, &PictureOptions { stereo: true, ..options });
    assert_eq!(both.len(), 2);
    for (eye, name) in both.iter().zip(["left", "right"]) {
        let alone = &shop.render(&scene, &PictureOptions { camera: Some(name), file: "alone.exr", ..options })[0];
        let differing = eye.pixels.iter().zip(&alone.pixels).filter(|(a, b)| (a[0] - b[0]).abs() > 0.26).count();
        assert!(differing <= 4, "{name}: {differing} pixels differ by more than one sample");
    }
    let middle = |picture: &Picture| {
        let weights = (0..320).map(|x| pixel(picture, x, 120)[0]);
        let (sum, moment) = weights.enumerate().fold((0.0, 0.0), |(s, m), (x, w)| (s + w, m + w * x as f64));
        moment / sum
    };
    let disparity = middle(&both[0]) - middle(&both[1]);
    let want = f64::from(IPD_METRES) / 2.0 * 120.0 / 20f64.to_radians().tan();
    assert!((disparity - want).abs() < 0.3, "{disparity} pixels, not {want}");
}

#[test]
fn every_shading_mode_draws_without_a_message() {
    use clap::ValueEnum;
    let shop = Workshop::new();
    shop.panorama("sky.exr", 32, compass);
    let scene = scene(&shop, &sphere("m.mtl"), &material([0.8, 0.3, 0.2], 0.2, 0.4), 3.5, &point_light(3.0, 10.0));
    let mut seen: Vec<Vec<[f32; 3]>> = Vec::new();
    for &shading in Shading::value_variants() {
        let picture =
            shop.render(&scene, &PictureOptions { shading, size: [48, 48], ..PictureOptions::default() }).remove(0);
        assert!(picture.pixels.iter().flatten().all(|v| v.is_finite()), "{shading:?} has a NaN or infinity");
        assert!(!seen.contains(&picture.pixels), "{shading:?} shows the same as another mode");
        seen.push(picture.pixels);
    }
}
