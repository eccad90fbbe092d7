//! The light maps of the GPU against sums over all texels of the panorama in f64.

use std::sync::LazyLock;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::*;
use crate::context::Context;
use crate::gpu::Subresource;
use crate::precompute::CubeTexels;
use crate::precompute::harness_tests::{Random, texels, with_gpu};
use crate::reference::cube::{cube_direction, cube_face, cube_texel_solid_angle, panorama_texel_solid_angle};
use crate::reference::integrals::{PanoramaView, grazing, irradiance, prefiltered};
use crate::reference::levels::alpha_from_level;

/// Half floats are stored to half of 2^-10; a cube's own texels to this much more.
const HALF: f64 = 6e-4;

/// One level: faces of size² texels, unscaled radiance.
struct Level {
    size: u32,
    faces: Vec<Vec<DVec3>>,
}

impl Level {
    fn read(gpu: &Arc<Gpu>, image: &Image, mip: u32, scale: f32) -> Self {
        let face =
            |layer| texels(gpu, image, Subresource { mip, layer }).iter().map(|t| *t * f64::from(scale)).collect();
        Self { size: image.mip_size(mip)[0], faces: (0..6).map(face).collect() }
    }

    /// Alpha, in all channels.
    fn read_alpha(gpu: &Arc<Gpu>, image: &Image, mip: u32) -> Self {
        let cube = CubeTexels::read(gpu, image, mip, 1.0).unwrap();
        let faces = cube.texels.chunks_exact((cube.size * cube.size) as usize);
        let face = |texels: &[[f32; 4]]| texels.iter().map(|t| DVec3::splat(t[3].into())).collect();
        Self { size: cube.size, faces: faces.map(face).collect() }
    }

    fn at(&self, [face, x, y]: [u32; 3]) -> DVec3 {
        self.faces[face as usize][(y * self.size + x) as usize]
    }

    fn direction(&self, [face, x, y]: [u32; 3]) -> DVec3 {
        cube_direction(face, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / f64::from(self.size))
    }

    /// The texel that direction d meets.
    fn texel(&self, d: DVec3) -> [u32; 3] {
        let (face, st) = cube_face(d);
        let [x, y] = (st * f64::from(self.size)).to_array().map(|c| (c as u32).min(self.size - 1));
        [face, x, y]
    }

    fn places(&self) -> impl Iterator<Item = [u32; 3]> {
        let size = self.size;
        (0..6).flat_map(move |face| (0..size * size).map(move |i| [face, i % size, i / size]))
    }

    /// `count` places of all, the corners of two faces among them.
    fn some_places(&self, count: usize) -> Vec<[u32; 3]> {
        let (mut random, last) = (Random(6), self.size - 1);
        let mut places = vec![[0, 0, 0], [0, last, last], [2, last, 0], [3, 0, last], [2, last / 2, last / 2]];
        places.resize_with(count.max(5), || [random.below(6), random.below(self.size), random.below(self.size)]);
        places
    }

    /// Σ radiance · solid angle.
    fn energy(&self) -> DVec3 {
        self.places().map(|p| self.at(p) * cube_texel_solid_angle([p[1], p[2]], self.size)).sum()
    }
}

/// Irradiance and specular levels of a panorama.
struct Maps {
    irradiance: Level,
    grazing: Level,
    specular: Vec<Level>,
    scale: f32,
}

impl Maps {
    fn of(panorama: &Panorama) -> Self {
        let maps = with_gpu(|gpu| {
            let maps = LightMaps::new(&Context::silent(gpu), panorama, Options::default()).unwrap();
            Self {
                irradiance: Level::read(gpu, &maps.irradiance_over_pi, 0, maps.scale),
                grazing: Level::read_alpha(gpu, &maps.irradiance_over_pi, 0),
                specular: (0..LEVELS)
                    .map(|i| Level::read(gpu, &maps.specular[i % 2], (i / 2) as u32, maps.scale))
                    .collect(),
                scale: maps.scale,
            }
        });
        assert!(maps.all_texels().all(|t| t.is_finite() && t.min_element() >= 0.0), "{}", panorama.name);
        maps
    }

    fn all_texels(&self) -> impl Iterator<Item = &DVec3> {
        let levels = self.specular.iter().chain([&self.irradiance]);
        levels.flat_map(|level| level.faces.iter().flatten())
    }
}

fn view(panorama: &Panorama) -> PanoramaView<'_> {
    PanoramaView::new(panorama.width, panorama.height, &panorama.texels).unwrap()
}

/// The panorama as a sampler sees it, `factor` times finer.
fn filtered(panorama: &Panorama, factor: u32) -> Panorama {
    let (width, height) = (panorama.width, panorama.height);
    let texel = |x: f64, y: f64| {
        let x = (x as i64).rem_euclid(i64::from(width)) as u32;
        let y = (y as i64).clamp(0, i64::from(height) - 1) as u32;
        Vec3::from(panorama.texels[(y * width + x) as usize])
    };
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(factor) - 0.5;
    let place = |i: u32| {
        let (x, y) = (at(i % (width * factor)), at(i / (width * factor)));
        let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let (x, y) = (x.floor(), y.floor());
        let row = |y: f64| texel(x, y).lerp(texel(x + 1.0, y), fx);
        row(y).lerp(row(y + 1.0), fy).to_array()
    };
    let (wide, high) = (width * factor, height * factor);
    Panorama { name: "filtered".into(), width: wide, height: high, texels: (0..wide * high).map(place).collect() }
}

/// Relative errors of the worst channel over some places: mean and greatest.
fn errors(level: &Level, truth: impl Fn(DVec3) -> DVec3 + Sync) -> [f64; 2] {
    let places = level.some_places(24);
    let each: Vec<f64> = places
        .par_iter()
        .map(|place| {
            let want = truth(level.direction(*place));
            ((level.at(*place) - want).abs() / want.max(DVec3::splat(1e-9))).max_element()
        })
        .collect();
    [each.iter().sum::<f64>() / each.len() as f64, each.iter().copied().fold(0.0, f64::max)]
}

/// Checks irradiance and specular levels 1.. against the truth; bounds are [mean, greatest], for irradiance and for
/// levels.
fn judge(what: &str, maps: &Maps, truth: PanoramaView<'_>, bounds: [[f64; 2]; 2]) {
    let pi = std::f64::consts::PI;
    let mut measured = vec![errors(&maps.irradiance, |n| irradiance(truth, n) / pi)];
    for (i, level) in maps.specular.iter().enumerate().skip(1) {
        measured.push(errors(level, |r| prefiltered(truth, r, alpha_from_level(i).sqrt())));
    }
    let describe = |m: &[f64; 2]| format!("{:.3} % (at most {:.3} %)", 100.0 * m[0], 100.0 * m[1]);
    println!(
        "{what}: irradiance, then levels 1 to 9: {}",
        measured.iter().map(describe).collect::<Vec<_>>().join(", ")
    );
    for (i, m) in measured.iter().enumerate() {
        let bound = bounds[i.min(1)];
        assert!(
            m[0] <= bound[0] && m[1] <= bound[1],
            "{what}, level {i} (0: irradiance): {} of {bound:?}",
            describe(m)
        );
    }
}

/// The shaders are part of the cache's key; this pins what the CPU gives them. Where it fails because the numbers have
/// changed on purpose: raise the version of [`CACHE_KIND`], and put the new hash here. Linux only: the last digits of
/// sines and logarithms are those of the system's library.
#[test]
#[cfg_attr(not(all(target_os = "linux", target_arch = "x86_64")), ignore = "other systems round other digits")]
fn numbers_change_only_with_the_version() {
    let hash = hierarchical_convolution::input_hash([512, 256], 32, 8);
    assert_eq!((CACHE_KIND.version, &hash[..16]), (1, "6f378475b5c72d81"));
    assert_eq!([0.0, 6e4, 7e4, 1e30].map(scale), [1.0, 1.0, 2.0, 2f32.powi(84)]);
}

#[test]
fn uniform_light_stays_what_it_is() {
    let radiance = Vec3::new(0.25, 1.0, 3.0);
    let maps = Maps::of(&Panorama::uniform(radiance));
    for texel in maps.all_texels() {
        let error = ((*texel - radiance.as_dvec3()) / radiance.as_dvec3()).abs().max_element();
        assert!(error <= HALF, "{texel} instead of {radiance}");
    }
}

/// Largest difference from the sums over all texels, over 1 plus what they give.
fn grazing_error(maps: &Maps, truth: PanoramaView<'_>) -> f64 {
    let off = |place| {
        let want = grazing(truth, maps.grazing.direction(place));
        (maps.grazing.at(place).x - want).abs() / (1.0 + want)
    };
    maps.grazing.some_places(24).into_par_iter().map(off).reduce(|| 0.0, f64::max)
}

#[test]
fn the_share_of_grazing_light_comes_out_right() {
    let grey = |radiance: f32| Maps::of(&Panorama::uniform(Vec3::splat(radiance)));
    for maps in [grey(0.0), grey(3.0)] {
        assert!(maps.grazing.places().all(|place| (maps.grazing.at(place).x - 1.0).abs() <= HALF));
    }
    let linear = Panorama::from_fn(128, 64, |d| Vec3::new(1.0 + d.y, 1.0 - d.y, 1.0 + 0.9 * d.x));
    let sun = sunny(100);
    let (coarse, _, noise) = &*NOISE;
    for (what, error, bound) in [
        ("linear", grazing_error(&Maps::of(&linear), view(&linear)), 0.001),
        ("noise", grazing_error(noise, view(coarse)), 0.002),
        ("a small sun", grazing_error(&Maps::of(&sun), view(&sun)), 0.02),
    ] {
        println!("{what}: {error:.5}");
        assert!(error < bound, "{what}: off by {error}");
    }
}

/// A window in alpha, amid light that has nothing to do with it and is not there at all in one half.
#[test]
fn a_share_in_alpha_is_averaged_as_light_is() {
    let [_, mut light] = noise();
    light.texels.iter_mut().step_by(2).for_each(|texel| *texel = [0.0; 3]);
    let [width, height] = [light.width, light.height];
    let half = |i: usize| i as u32 / width < height / 2;
    light.texels.iter_mut().enumerate().filter(|(i, _)| half(*i)).for_each(|(_, texel)| *texel = [0.0; 3]);
    let share = Panorama::from_fn(width, height, |d| Vec3::splat((d.x > 0.7 && d.y.abs() < 0.4) as u32 as f32));
    let texels: Vec<[f32; 4]> =
        light.texels.iter().zip(&share.texels).map(|([r, g, b], [a, ..])| [*r, *g, *b, *a]).collect();
    let levels: Vec<Level> = with_gpu(|gpu| {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
        let desc = ImageDesc::flat(Format::R32G32B32A32_SFLOAT, [width, height], usage);
        let image = Image::new(gpu, "a share in alpha", desc).unwrap();
        upload_rows(gpu, &image, size_of::<[f32; 4]>() as u64, |rows| {
            let [first, end] = [rows.start, rows.end].map(|row| (row * width) as usize);
            bytemuck::cast_slice(&texels[first..end]).to_vec()
        })
        .unwrap();
        let specular = ["even", "odd"].map(|name| cube(gpu, name, 128, (LEVELS / 2) as u32).unwrap());
        let filter = HierarchicalConvolution::new(gpu, (&image, Alpha::Share), &specular, None).unwrap();
        filter.run(gpu, 1.0).unwrap();
        (0..LEVELS).map(|i| Level::read_alpha(gpu, &specular[i % 2], (i / 2) as u32)).collect()
    });
    for (i, level) in levels.iter().enumerate().skip(1) {
        let off = |place: &[u32; 3]| {
            let want = prefiltered(view(&share), level.direction(*place), alpha_from_level(i).sqrt()).x;
            (level.at(*place).x - want).abs()
        };
        let each: Vec<f64> = level.some_places(48).par_iter().map(off).collect();
        let (mean, worst) = (each.iter().sum::<f64>() / each.len() as f64, each.iter().copied().fold(0.0, f64::max));
        println!("level {i}: off by {mean:.4}, {worst:.4} at most");
        // Where nodes that are half dark are as large as the lobe, it is evaluated off their middle.
        assert!(mean < 0.01 && worst < if i == 1 { 0.15 } else { 0.04 }, "level {i}: {mean}, {worst}");
    }
}

#[test]
fn a_linear_sky_comes_out_within_half_a_percent() {
    let gradient = Vec3::new(0.3, -0.3, 0.4);
    let panorama = Panorama::from_fn(256, 128, |d| Vec3::new(1.0 + gradient.dot(d), 1.0 + 0.5 * d.y, 1.0 - 0.5 * d.x));
    let maps = Maps::of(&panorama);
    let level_0 =
        errors(&maps.specular[0], |d| DVec3::new(1.0 + gradient.as_dvec3().dot(d), 1.0 + 0.5 * d.y, 1.0 - 0.5 * d.x));
    // Within half a texel of a pole, 0.7 degrees, the panorama itself holds no gradient.
    assert!(level_0[0] <= 1e-3 && level_0[1] <= 0.006, "level 0: {level_0:?}");
    // Measured: 0.03 (at most 0.07) %.
    judge("linear", &maps, view(&panorama), [[0.001, 0.002], [0.001, 0.002]]);
}

/// Noise of 32×16 texels, drawn 16 times as large, so that filtering hardly widens it.
fn noise() -> [Panorama; 2] {
    let mut random = Random(7);
    let (width, height, factor) = (32, 16, 16);
    let texels: Vec<_> = (0..width * height).map(|_| random.colour().as_vec3().to_array()).collect();
    let coarse = Panorama { name: "noise".into(), width, height, texels };
    let texel = |i: u32| {
        let (x, y) = (i % (width * factor) / factor, i / (width * factor) / factor);
        coarse.texels[(y * width + x) as usize]
    };
    let (wide, high) = (width * factor, height * factor);
    let fine =
        Panorama { name: "noise".into(), width: wide, height: high, texels: (0..wide * high).map(texel).collect() };
    [coarse, fine]
}

static NOISE: LazyLock<(Panorama, Panorama, Maps)> = LazyLock::new(|| {
    let [coarse, fine] = noise();
    let maps = Maps::of(&fine);
    (coarse, fine, maps)
});

#[test]
fn noise_comes_out_right() {
    let (coarse, _, maps) = &*NOISE;
    // Measured: irradiance 0.02 (at most 0.05) %, level 1 0.35 (at most 0.99) %, falling to 0.03 (at most 0.07) % at
    // level 8.
    judge("noise", maps, view(coarse), [[0.001, 0.002], [0.006, 0.02]]);
}

/// Solid angle of a disc 0.53° wide.
const SUN_SR: f64 = 6.72e-5;

/// A sky of 0.1 and one texel of 512×256 so bright that it sends as much as the sun of cases 5 and 6.
fn sunny(row: u32) -> Panorama {
    let mut panorama = Panorama::from_fn(512, 256, |_| Vec3::splat(0.1));
    let radiance = 50_000.0 * SUN_SR / panorama_texel_solid_angle(row, [512, 256]);
    panorama.texels[(row * 512 + 100) as usize] = [radiance as f32; 3];
    panorama
}

/// Cases 5 and 6 of tests/gpu/stability.rs: at middle latitudes, and by the pole. What is lost is lost where the cube's
/// taps miss parts of a sun of one texel. Measured: mean 0.3 (at most 0.8) %, by the pole 2.4 (at most 4.6) %.
#[test]
fn a_small_sun_keeps_its_energy() {
    for (row, irradiance, levels, energy) in
        [(100, [0.006, 0.015], [0.006, 0.015], 0.01), (3, [0.04, 0.06], [0.04, 0.06], 0.05)]
    {
        let panorama = sunny(row);
        let maps = Maps::of(&panorama);
        judge(&format!("sun in row {row}"), &maps, view(&panorama), [irradiance, levels]);
        let truth = 0.1 * 4.0 * std::f64::consts::PI + 50_000.0 * SUN_SR;
        let worst = maps.specular.iter().map(|level| (level.energy().x / truth - 1.0).abs()).fold(0.0, f64::max);
        println!("sun in row {row}: energy off by {worst:.4}");
        assert!(worst <= energy, "sun in row {row}: energy off by {worst}");
    }
}

/// Case 13 of tests/gpu/stability.rs: what the two faces of an edge say of the light on it, against how much light varies.
fn seam(level: &Level) -> f64 {
    let size = f64::from(level.size);
    // The line from the two outermost texels of a row to the edge.
    let on_edge = |inside: DVec3, outside: DVec3| 1.5 * inside - 0.5 * outside;
    let step_in = |place: [u32; 3], axis: usize| {
        let mut inner = place;
        inner[axis] = if place[axis] == 0 { 1 } else { place[axis] - 1 };
        on_edge(level.at(place), level.at(inner))
    };
    let (mut steps, mut count) = (0.0, 0.0);
    for face in 0..6 {
        for i in 0..level.size {
            let along = (f64::from(i) + 0.5) / size;
            let last = level.size - 1;
            for (place, axis, beyond) in [
                ([face, 0, i], 1, DVec2::new(-1e-9, along)),
                ([face, last, i], 1, DVec2::new(1.0 + 1e-9, along)),
                ([face, i, 0], 2, DVec2::new(along, -1e-9)),
                ([face, i, last], 2, DVec2::new(along, 1.0 + 1e-9)),
            ] {
                let (_, st) = cube_face(cube_direction(face, beyond));
                let there = level.texel(cube_direction(face, beyond));
                let their_axis = if (st.x - 0.5).abs() > (st.y - 0.5).abs() { 1 } else { 2 };
                steps += (step_in(place, axis) - step_in(there, their_axis)).length_squared();
                count += 1.0;
            }
        }
    }
    let mean = level.places().map(|p| level.at(p)).sum::<DVec3>() / (6.0 * size * size);
    let variance = level.places().map(|p| (level.at(p) - mean).length_squared()).sum::<f64>() / (6.0 * size * size);
    (steps / count / variance).sqrt()
}

#[test]
fn faces_meet_without_seams() {
    let maps = &NOISE.2;
    for level in maps.specular.iter().skip(1).chain([&maps.irradiance]) {
        let seam = seam(level);
        println!("{} texels wide: seam {seam:.4}", level.size);
        assert!(seam <= 0.15, "{} texels wide: seam {seam}", level.size);
    }
}

/// Case 8 of tests/gpu/stability.rs.
#[test]
fn radiance_beyond_half_floats_keeps_its_energy() {
    for peak in [70_000.0, 1e6] {
        let mut panorama = Panorama::from_fn(512, 256, |_| Vec3::splat(0.5));
        for y in 60..68 {
            panorama.texels[y * 512 + 200..y * 512 + 208].fill([peak, 0.5 * peak, 0.0]);
        }
        let maps = Maps::of(&panorama);
        assert!(maps.scale > 1.0 && peak / maps.scale < 65_504.0, "{peak} / {}", maps.scale);
        let truth: DVec3 = (0..512 * 256)
            .map(|i| {
                let solid_angle = panorama_texel_solid_angle(i / 512, [512, 256]);
                Vec3::from(panorama.texels[i as usize]).as_dvec3() * solid_angle
            })
            .sum();
        let worst = maps
            .specular
            .iter()
            .map(|level| ((level.energy() - truth) / truth).abs().max_element())
            .fold(0.0, f64::max);
        println!("peak {peak}: energy off by {worst:.4}");
        assert!(worst <= 0.02, "peak {peak}: energy off by {worst}");
    }
}

#[test]
fn one_texel_of_1e30_is_held_and_nothing_overflows() {
    let mut panorama = Panorama::from_fn(128, 64, |_| Vec3::splat(0.5));
    panorama.texels[20 * 128 + 30] = [1e30; 3];
    let maps = Maps::of(&panorama);
    assert!(maps.all_texels().all(|t| t.is_finite() && t.min_element() >= 0.0));
    let truth = 1e30 * panorama_texel_solid_angle(20, [128, 64]);
    for (i, level) in maps.specular.iter().enumerate() {
        let off = (level.energy().x - truth).abs() / truth;
        println!("level {i}: energy off by {off:.4}");
        assert!(off <= 0.05, "level {i}: energy off by {off}");
    }
}

#[test]
fn panoramas_of_any_shape_come_out() {
    for (width, height) in [(1, 1), (1, 8), (8, 1), (37, 19), (3, 400)] {
        let mut random = Random(8);
        let texels: Vec<_> = (0..width * height).map(|_| random.colour().as_vec3().to_array()).collect();
        let panorama = Panorama { name: format!("{width}x{height}"), width, height, texels };
        let maps = Maps::of(&panorama);
        let fine = filtered(&panorama, 128_u32.div_ceil(width.max(height)));
        let errors = errors(&maps.irradiance, |n| irradiance(view(&fine), n) / std::f64::consts::PI);
        println!("{width}x{height}: irradiance off by {:.4}, at most {:.4}", errors[0], errors[1]);
        assert!(errors[1] <= 0.01, "{width}x{height}: irradiance off by {}", errors[1]);
    }
    let black = Maps::of(&Panorama::uniform(Vec3::ZERO));
    assert!(black.all_texels().all(|t| *t == DVec3::ZERO) && black.scale == 1.0);
}

#[test]
fn two_runs_give_the_same_bits() {
    let (_, panorama, maps) = &*NOISE;
    assert!(maps.all_texels().eq(Maps::of(panorama).all_texels()));
}

#[test]
fn turning_the_panorama_turns_the_maps() {
    let (_, fine, before) = &*NOISE;
    let mut turned = fine.clone();
    for row in turned.texels.chunks_exact_mut(fine.width as usize) {
        row.rotate_right(fine.width as usize / 4); // u + 1/4: from +X to +Z
    }
    let after = Maps::of(&turned);
    let pairs = before.specular.iter().zip(&after.specular).enumerate();
    for (i, (a, b)) in pairs.chain([(0, (&before.irradiance, &after.irradiance))]) {
        let turn = |d: DVec3| DVec3::new(-d.z, d.y, d.x);
        let off = a.places().map(|p| ((a.at(p) - b.at(b.texel(turn(a.direction(p))))) / a.at(p)).abs().max_element());
        let off = off.fold(0.0, f64::max);
        println!("level {i}, {} texels wide: {off:.5}", a.size);
        assert!(off <= 0.002, "level {i}, {} texels wide: {off}", a.size);
    }
}
