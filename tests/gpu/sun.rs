//! The sun of a panorama as a light of its own, against the same sun left in the panorama.

use pbr_vr::asset::picture::Picture;
use pbr_vr::render::{LightModel, Shading};

use crate::common::{PictureOptions, Workshop, material, mean_at, sphere};

/// Towards the sun.
const SUN: [f64; 3] = [0.48, 0.6, 0.64];

/// A sky of 0.5 with a sun of 1.2° that gives about as much light, written as `sky.exr`.
fn sky(shop: &Workshop) {
    shop.panorama("sky.exr", 1024, |d| {
        let cosine: f64 = d.iter().zip(SUN).map(|(a, b)| a * b).sum();
        if cosine > 1.2f64.to_radians().cos() { [4000.0, 3800.0, 3400.0] } else { [0.5; 3] }
    });
}

/// A ball of one material that fills a quarter of the picture, seen from +Z, or with it the sun from below.
fn scene(shop: &Workshop, material: &str) -> std::path::PathBuf {
    sky(shop);
    shop.write("m.mtl", material);
    shop.write("ball.obj", &sphere("m.mtl"));
    shop.write(
        "scene.toml",
        "environment = { panorama = \"sky.exr\", rotation_degrees = 0 }\n\
         [[model]]\nfile = \"ball.obj\"\n\
         [[camera]]\nname = \"front\"\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n\
         [[camera]]\nname = \"sun\"\nposition = [4.8, 6, 6.4]\ntarget = [48, 60, 64]\nvertical_fov_degrees = 12\n",
    )
}

fn pictures(shop: &Workshop, scene: &std::path::Path, options: PictureOptions<'_>) -> [Picture; 2] {
    [LightModel::Open, LightModel::Direct]
        .map(|light| shop.render(scene, &PictureOptions { light, ..options }).swap_remove(0))
}

fn sum(picture: &Picture) -> f64 {
    picture.pixels.iter().map(|p| f64::from(p[0])).sum()
}

#[test]
fn the_sky_has_the_same_light_with_the_sun_drawn_as_a_disc() {
    let shop = Workshop::new();
    let scene = scene(&shop, &material([1.0; 3], 0.0, 1.0));
    // From 26 pixels across the disc down to 2, which hold a tenth more or less as the disc lies between them.
    for (side, bound) in [(128, 0.01), (48, 0.02), (10, 0.15)] {
        let [open, direct] = pictures(
            &shop,
            &scene,
            PictureOptions { camera: Some("sun"), size: [side; 2], ..PictureOptions::default() },
        );
        let [a, b] = [&open, &direct].map(sum);
        println!("{side} pixels: {a} open, {b} direct");
        assert!((a / b - 1.0).abs() < bound, "{side} pixels: {a} open, {b} direct");
    }
}

#[test]
fn rough_balls_look_the_same_with_the_sun_in_the_panorama_and_out_of_it() {
    let shop = Workshop::new();
    for shading in [Shading::Pbr, Shading::Phong] {
        let scene = scene(&shop, &material([0.6; 3], 0.0, 0.7));
        let [open, direct] = pictures(&shop, &scene, PictureOptions { shading, ..PictureOptions::default() });
        // Where the sun shines, at its edge, and in its shade. Phong's panorama has no highlight.
        for (x, y) in [(55, 38), (40, 40), (48, 60), (35, 55)] {
            let [a, b] = [&open, &direct].map(|picture| mean_at(picture, x, y, 2)[0]);
            let bound = if shading == Shading::Phong { 0.1 } else { 0.02 };
            assert!((a / b - 1.0).abs() < bound, "{shading:?} at {x}, {y}: {a} open, {b} direct");
        }
    }
}

/// A mirror's picture of the sky holds the disc once: as much light as the sampled reference, which sees the sky itself.
#[test]
fn mirrors_show_the_sun_once() {
    let shop = Workshop::new();
    for roughness in [0.0, 0.08, 0.3] {
        let scene = scene(&shop, &material([0.9; 3], 1.0, roughness));
        let options = PictureOptions { light: LightModel::Direct, ..PictureOptions::default() };
        let ours = shop.render(&scene, &options).swap_remove(0);
        let shading = Shading::Reference;
        let reference = shop.render(&scene, &PictureOptions { shading, frames: 64, ..options }).swap_remove(0);
        let [a, b] = [&ours, &reference].map(sum);
        println!("roughness {roughness}: {a}, reference {b}");
        assert!((a / b - 1.0).abs() < 0.06, "roughness {roughness}: {a}, reference {b}");
    }
}
