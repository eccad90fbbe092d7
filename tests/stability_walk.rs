//! Walks of 300 frames through each of six scenes, in which pixels may not flash. `stability.rs` lists all cases.

mod common;

use common::scenes;
use common::stage::{Stage, scene, shipped, with_gpu, without_mips};
use pbr_vr::render::{Eye, Output};
use pbr_vr::scene::Scene;

const SIZE: [u32; 2] = [160, 90];
/// At 90 Hz, 3.3 s.
const FRAMES: usize = 300;
/// What that is at a brisk pace.
const FARTHEST_METRES: f32 = 5.0;
/// A flash is so far from what the pixel is otherwise, and so far from everything around it; of 255.
const APART_IN_TIME: i16 = 64;
const APART_IN_SPACE: i16 = 32;

/// From the scene's first camera towards its second.
fn walk(scene: &Scene) -> Vec<Eye> {
    let [from, to] = [0, 1].map(|i| &scene.cameras[i]);
    let share = (FARTHEST_METRES / from.position.distance(to.position)).min(1.0);
    let eye = |i: usize| {
        let t = share * i as f32 / (FRAMES - 1) as f32;
        let (position, target) = (from.position.lerp(to.position, t), from.target.lerp(to.target, t));
        Eye::looking(position, target, from.vertical_fov_degrees, SIZE[0] as f32 / SIZE[1] as f32)
    };
    (0..FRAMES).map(eye).collect()
}

/// Luma of each frame, 0 to 255.
fn film(stage: &mut Stage, eyes: &[Eye]) -> Vec<Vec<i16>> {
    let luma = |p: &[u8; 4]| ((54 * u32::from(p[0]) + 183 * u32::from(p[1]) + 19 * u32::from(p[2])) >> 8) as i16;
    eyes.iter().map(|eye| stage.shown(eye).iter().map(luma).collect()).collect()
}

fn median(mut values: [i16; 4]) -> i16 {
    values.sort_unstable();
    (values[1] + values[2]) / 2
}

/// Pixels that are far from the median of the two frames before and after, and brighter or darker than all around them.
fn flashes(film: &[Vec<i16>]) -> usize {
    let (width, height) = (SIZE[0] as usize, SIZE[1] as usize);
    let mut count = 0;
    for t in 2..film.len() - 2 {
        for (x, y) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y))) {
            let here = film[t][y * width + x];
            let other = median([t - 2, t - 1, t + 1, t + 2].map(|t| film[t][y * width + x]));
            if (here - other).abs() > APART_IN_TIME {
                let around = [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1), (0, 2), (1, 2), (2, 2)]
                    .map(|(dx, dy)| film[t][(y + dy - 1) * width + x + dx - 1]);
                let apart =
                    |other: &i16| (here - other).abs() > APART_IN_SPACE && (here > *other) == (here > around[0]);
                count += usize::from(around.iter().all(apart));
            }
        }
    }
    count
}

/// Walks through a scene. What flashes at most is stated in flashes per million pixels: with so few and such large pixels
/// rims of cups, leaves and twigs remain that are thinner than a pixel, which four samples may all hit or all miss.
fn assert_calm(file: &str, most_per_million: usize) {
    let scene = scene(&shipped(file));
    let flashes = with_gpu(|gpu| flashes(&film(&mut Stage::new(gpu, &scene, SIZE, 4, Output::Display), &walk(&scene))));
    let most = most_per_million * FRAMES * (SIZE[0] * SIZE[1]) as usize / 1_000_000;
    println!("{file}: {flashes} flashes, at most {most}");
    assert!(flashes <= most, "{file}: {flashes} flashes, more than {most}");
}

/// The same without levels of detail and with one sample per pixel: it flashes so often at least.
fn assert_restless(file: &str, least: usize) {
    let scene = without_mips(scene(&shipped(file)));
    let flashes = with_gpu(|gpu| flashes(&film(&mut Stage::new(gpu, &scene, SIZE, 1, Output::Display), &walk(&scene))));
    println!("{file}, naive: {flashes} flashes, at least {least}");
    assert!(flashes >= least, "{file}: unfiltered textures no longer flash: {flashes}");
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_around_the_sphere() {
    assert_calm("sphere.toml", 7);
    assert_restless("sphere.toml", 2000);
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_around_the_teapot() {
    assert_calm("teapot.toml", 2);
    assert_restless("teapot.toml", 200);
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_through_the_tearoom() {
    assert_calm("tearoom.toml", 8);
    assert_restless("tearoom.toml", 500);
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_around_the_head() {
    if scenes("a walk around the head").is_some() {
        assert_calm("head.toml", 8);
    }
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_through_dabrovic_sponza() {
    if scenes("a walk through Dabrovic Sponza").is_some() {
        assert_calm("dabrovic-sponza.toml", 8);
    }
}

#[test]
fn hardly_a_pixel_flashes_on_a_walk_through_crytek_sponza() {
    if scenes("a walk through Crytek Sponza").is_some() {
        assert_calm("crytek-sponza.toml", 120);
    }
}
