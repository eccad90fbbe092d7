//! Movements of less than a pixel over a shiny normal map, whose bumps are much smaller than a pixel: the picture must not
//! sparkle. `stability.rs` lists all cases.

use crate::common::stage::{Stage, scene, with_gpu, without_mips};
use crate::common::{Workshop, square};
use glam::{DVec3, Vec3};
use pbr_vr::reference::tone::{srgb_encode, tone_neutral};
use pbr_vr::render::{Eye, Output};
use pbr_vr::scene::Scene;

/// Pixels of a picture's side, and samples along the side of a pixel of the reference, 64 in all.
const SIZE: u32 = 32;
const ACROSS: u32 = 8;
/// Positions of the camera.
const JITTERS: u32 = 12;

/// A golden square, smooth but for bumps of two texels of 1024², some 16 of which lie in a pixel; under a sky with a sun,
/// and a point light.
fn shiny(shop: &Workshop) -> Scene {
    let slope = |x: u32, y: u32| {
        let mut h = (x / 2).wrapping_mul(0x9e37_79b1) ^ (y / 2).wrapping_mul(0x85eb_ca77);
        h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
        h ^= h >> 13;
        [(h & 0xff) as f32, (h >> 8 & 0xff) as f32].map(|v| (v / 255.0 - 0.5) * 0.8)
    };
    let map = image::RgbImage::from_fn(1024, 1024, |x, y| {
        let [a, b] = slope(x, y);
        let n = Vec3::new(a, b, 1.0).normalize();
        image::Rgb((n * 127.5 + 127.5).round().to_array().map(|v| v as u8))
    });
    map.save(shop.path("n.png")).expect("a normal map");
    shop.panorama("sky.exr", 128, |[x, y, z]| {
        let sun = DVec3::new(0.3, 0.5, 0.8).normalize().dot(DVec3::new(x, y, z)) > 0.98;
        if sun { [8.0; 3] } else { [0.4 + 0.3 * y as f32; 3] }
    });
    shop.write("m.mtl", "newmtl m\nKd 0.9 0.7 0.3\nPm 1\nPr 0.15\nnorm n.png\n");
    shop.write("m.obj", &square("m.mtl"));
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"m.obj\"\n\
        [[light]]\npoint = { position = [-0.4, 0.6, 1.5], intensity = [0.2, 0.2, 0.2] }\n\
        [[camera]]\nname = \"c\"\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 14\n";
    scene(&shop.write("scene.toml", text))
}

/// The scene's camera, turned by a part of a pixel.
fn eye(scene: &Scene, jitter: u32) -> Eye {
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    // Roberts's R2 sequence: parts of the golden ratio's counterpart in two dimensions fill the square evenly.
    let [x, y] = [0.754_877_7f32, 0.569_840_3].map(|step| (jitter as f32 * step).fract());
    let (dx, dy) = (x * (eye.right - eye.left) / SIZE as f32, y * (eye.up - eye.down) / SIZE as f32);
    Eye { left: eye.left + dx, right: eye.right + dx, down: eye.down + dy, up: eye.up + dy, ..eye }
}

/// What a viewer sees of radiance, luminance only, three stops darker: white hides what sparkles.
fn shown(radiance: DVec3) -> f64 {
    srgb_encode(tone_neutral(radiance / 8.0)).dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// For each camera position, each pixel's shown value; `across`² samples of one picture make a pixel.
fn frames(scene: &Scene, samples: u32, across: u32) -> Vec<Vec<f64>> {
    let side = SIZE * across;
    with_gpu(|gpu| {
        let mut stage = Stage::new(gpu, scene, [side, side], samples, Output::Linear);
        let mut frame = |jitter| {
            let fine = stage.radiance(&eye(scene, jitter));
            let texel = |x: u32, y: u32| Vec3::from_slice(&fine[(y * side + x) as usize]).as_dvec3();
            let pixel = |x: u32, y: u32| {
                let all = (0..across * across).map(|i| texel(x * across + i % across, y * across + i / across));
                shown(all.sum::<DVec3>() / f64::from(across * across))
            };
            (0..SIZE * SIZE).map(|i| pixel(i % SIZE, i / SIZE)).collect()
        };
        (0..JITTERS).map(&mut frame).collect()
    })
}

/// A pixel's variance over the camera's positions, its mean over all pixels; and the mean of all values.
fn variance(frames: &[Vec<f64>]) -> [f64; 2] {
    let (count, pixels) = (frames.len() as f64, frames[0].len());
    let mut sums = [0.0; 2];
    for i in 0..pixels {
        let mean = frames.iter().map(|f| f[i]).sum::<f64>() / count;
        sums[0] += frames.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>() / (count - 1.0);
        sums[1] += mean;
    }
    sums.map(|sum| sum / pixels as f64)
}

#[test]
fn a_shiny_normal_map_sparkles_no_more_than_with_64_samples_a_pixel() {
    let shop = Workshop::new();
    let scene = shiny(&shop);
    // What the naive forms lack: levels of detail; and their roughness, grown by what the levels lose of the bumps.
    let sharp = without_mips(scene.clone());
    let mut smooth = scene.clone();
    smooth.materials[0].orm_map = None;
    assert!(scene.materials[0].orm_map.is_some(), "bumps give the material a map of roughness");
    let [truth, ours, naive, unwidened] =
        [frames(&sharp, 1, ACROSS), frames(&scene, 4, 1), frames(&sharp, 4, 1), frames(&smooth, 4, 1)]
            .map(|frames| variance(&frames));
    println!("variance and mean: 64 samples {truth:?}, ours {ours:?}, no levels {naive:?}, not widened {unwidened:?}");
    assert!(ours[0] <= 2.0 * truth[0], "{} times the variance of 64 samples", ours[0] / truth[0]);
    assert!(naive[0] > 10.0 * truth[0], "without levels only {} times the variance", naive[0] / truth[0]);
    // Nor may the light that sparkled be lost with the sparkle; these bumps are spread evenly, not as a rough surface's are.
    let off = |[_, mean]: [f64; 2]| (mean / truth[1] - 1.0).abs();
    assert!(off(ours) < 0.2 && off(unwidened) > 2.0 * off(ours), "ours {}, not widened {}", off(ours), off(unwidened));
}
