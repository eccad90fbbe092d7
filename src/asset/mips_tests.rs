//! Tests of mips: against the f64 twin, and for their purpose.

use glam::{DVec3, DVec4};

use super::*;
use crate::asset::texture::Encoding;
use crate::reference::brdf::d_ggx;
use crate::reference::mip::{self, box_average};
use crate::reference::tone::{srgb_decode, srgb_encode};

/// Sizes that halve evenly and unevenly, and that reach 1 early on one side.
const SIZES: [[u32; 2]; 6] = [[16, 16], [13, 7], [1, 9], [6, 1], [31, 33], [1, 1]];

fn noise(i: u32, seed: u32) -> u8 {
    let mut bits = i.wrapping_mul(0x9e37_79b1) ^ seed.wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    (bits >> 24) as u8
}

fn texture([width, height]: [u32; 2], texel: impl Fn(u32, u32) -> [u8; 4]) -> Texture {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
    Texture { name: "t".into(), width, height, encoding: Encoding::Linear, pixels }
}

fn noisy(size: [u32; 2]) -> Texture {
    texture(size, |x, y| [0, 1, 2, 3].map(|c| noise(y * size[0] + x, c)))
}

fn texels(level: &[u8]) -> &[[u8; 4]] {
    level.as_chunks().0
}

/// All levels in f64, each from the one before, as in the fast version.
fn reference(texture: &Texture, read: impl Fn([u8; 4]) -> DVec4) -> Vec<([u32; 2], Vec<DVec4>)> {
    let size = [texture.width, texture.height];
    let mut levels = vec![(size, texture.texels().map(|t| read(*t)).collect::<Vec<_>>())];
    for level in 1..level_count(size) {
        let (from, last) = &levels[level as usize - 1];
        let to = level_size(size, level);
        levels.push((to, box_average(last, *from, to)));
    }
    levels
}

fn unit([r, g, b, a]: [u8; 4]) -> DVec4 {
    DVec4::new(f64::from(r), f64::from(g), f64::from(b), f64::from(a)) / 255.0
}

fn close(got: &[u8], truth: &[f64], what: &str) {
    assert_eq!(got.len(), truth.len(), "{what}");
    for (i, (got, truth)) in got.iter().zip(truth).enumerate() {
        // Half a step of rounding, and the error of f32.
        assert!((f64::from(*got) - truth * 255.0).abs() < 0.51, "{what}, value {i}: {got}, {}", truth * 255.0);
    }
}

#[test]
fn every_kind_of_level_agrees_with_its_f64_twin() {
    for size in SIZES {
        let noisy = noisy(size);
        let what = |kind: &str, level: usize| format!("{kind} of {size:?}, level {level}");
        let decode = |t| srgb_decode(unit(t).truncate()).extend(unit(t).w);
        let colour = base_color_levels(noisy.clone(), None);
        for (i, (_, truth)) in reference(&noisy, decode).iter().enumerate() {
            let truth: Vec<f64> = truth.iter().flat_map(|t| srgb_encode(t.truncate()).extend(t.w).to_array()).collect();
            close(&colour[i], &truth, &what("colour", i));
        }
        let surface = orm_levels(noisy.clone(), None);
        let read = |t| DVec4::new(unit(t).x, unit(t).y.powi(4), unit(t).z, unit(t).w);
        for (i, (_, truth)) in reference(&noisy, read).iter().enumerate().skip(1) {
            let truth: Vec<f64> = truth.iter().flat_map(|t| [t.x, t.y.powf(0.25), t.z, t.w]).collect();
            close(&surface[i], &truth, &what("surface", i));
        }
        assert_eq!(surface[0], noisy.pixels, "the first level stays");
        let bumpy = bumpy(size, 90);
        let normal = |[x, y, z, _]: [u8; 4]| {
            (DVec3::new(f64::from(x), f64::from(y), f64::from(z)) / 127.5 - 1.0).normalize().extend(1.0)
        };
        let normals = normal_levels(&bumpy);
        for (i, (_, truth)) in reference(&bumpy, normal).iter().enumerate() {
            let stored = |n: &DVec4| ((n.truncate().normalize() + 1.0) * 0.5).extend(1.0).to_array();
            close(&normals[i], &truth.iter().flat_map(stored).collect::<Vec<_>>(), &what("normals", i));
        }
    }
}

/// Normals that lean up to `lean` (of 127) every way.
fn bumpy(size: [u32; 2], lean: i32) -> Texture {
    texture(size, |x, y| {
        let at = |seed| (i32::from(noise(y * size[0] + x, seed)) - 128) * lean / 128;
        let (x, y) = (at(5) as f32, at(6) as f32);
        let z = (127.5f32.powi(2) - x * x - y * y).max(400.0).sqrt();
        [x + 127.5, y + 127.5, z + 127.5, 255.0].map(|v| v.round() as u8)
    })
}

#[test]
fn constants_stay_and_ramps_keep_their_mean() {
    for size in SIZES {
        let flat = [200, 90, 13, 255];
        assert!(
            base_color_levels(texture(size, |_, _| flat), None).iter().all(|l| texels(l).iter().all(|t| *t == flat))
        );
        let levels = orm_levels(texture(size, |_, _| flat), None);
        assert!(levels.iter().all(|l| texels(l).iter().all(|t| *t == flat)));
        let straight = [128, 128, 255, 255];
        let levels = normal_levels(&texture(size, |_, _| straight));
        assert!(levels.iter().all(|l| texels(l).iter().all(|t| *t == straight)), "{size:?}");
        let ramp = texture(size, |x, y| [(x * 7 % 256) as u8, 0, (y * 5 % 256) as u8, 255]);
        let mean = |level: &[u8], c: usize| {
            texels(level).iter().map(|t| f64::from(t[c])).sum::<f64>() / texels(level).len() as f64
        };
        let levels = orm_levels(ramp.clone(), None);
        for c in [0, 2] {
            let last = mean(levels.last().unwrap(), c);
            assert!((last - mean(&ramp.pixels, c)).abs() < 0.51, "{size:?}, channel {c}: no texel may be dropped");
        }
    }
}

#[test]
fn a_checker_is_half_as_bright_in_linear_light() {
    let checker = texture([8, 8], |x, y| if (x + y) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
    // srgb(0.5) is 187.5.
    for level in &base_color_levels(checker.clone(), None)[1..] {
        assert!(texels(level).iter().all(|t| *t == [188, 188, 188, 255]), "{level:?}");
    }
    for level in &orm_levels(checker, None)[1..] {
        assert!(texels(level).iter().all(|t| t[0] == 128), "occlusion is a plain number");
    }
}

/// Blades of grass with soft edges, a few texels apart, black where transparent.
fn grass(size: [u32; 2]) -> Texture {
    texture(size, |x, y| {
        let bend = f32::from(noise(y / 8, 1)) / 255.0;
        let wave = (x as f32 * 1.9 + 4.0 * bend + y as f32 * 0.13).sin() + 0.4 * (y as f32 * 0.7 + bend).cos();
        let alpha = ((wave - 0.5) * 400.0).clamp(0.0, 255.0) as u8;
        if alpha > 0 { [60, 180, 40, alpha] } else { [0; 4] }
    })
}

#[test]
fn plants_neither_thin_out_nor_darken() {
    let covered =
        |level: &[u8]| texels(level).iter().filter(|t| t[3] >= 128).count() as f64 / texels(level).len() as f64;
    for size in [[128, 128], [100, 75]] {
        let grass = grass(size);
        let first = covered(&grass.pixels);
        let levels = base_color_levels(grass.clone(), Some(0.5));
        let plain = base_color_levels(grass, None);
        for (i, level) in levels.iter().enumerate().take(5) {
            let tolerance = 0.03 + 1.0 / texels(level).len() as f64;
            assert!((covered(level) - first).abs() < tolerance, "{size:?} level {i}: {} of {first}", covered(level));
            let there = texels(level).iter().filter(|t| t[3] >= 16);
            for texel in there {
                assert!((0..3).all(|c| texel[c].abs_diff([60, 180, 40][c]) <= 2), "{size:?} level {i}: {texel:?}");
            }
        }
        assert!(covered(&plain[3]) < 0.5 * first, "unscaled, it thins out: {}", covered(&plain[3]));
    }
}

#[test]
fn alpha_of_all_or_nothing_is_left_alone() {
    for alpha in [0, 255] {
        let levels = base_color_levels(texture([9, 8], |_, _| [9, 9, 9, alpha]), Some(0.5));
        assert!(levels.iter().all(|l| texels(l).iter().all(|t| *t == [9, 9, 9, alpha])));
    }
}

/// D of a pixel that covers a whole texture: the mean over all of its normals.
fn mean_lobe(normals: &Texture, alpha: f64, h: DVec3) -> f64 {
    let d = |t: &[u8; 4]| d_ggx(DVec3::from(unit_normal(*t).map(f64::from)), h, alpha);
    normals.texels().map(d).sum::<f64>() / f64::from(normals.width * normals.height)
}

#[test]
fn widened_roughness_matches_the_mean_lobe_of_all_normals() {
    let roughness: u8 = 80;
    let alpha = (f64::from(roughness) / 255.0).powi(2);
    for lean in [20, 45] {
        let normals = bumpy([32, 32], lean);
        let flat = || texture([32, 32], |_, _| [255, roughness, 0, 255]);
        let last = |levels: Vec<Vec<u8>>| (f64::from(levels[5][1]) / 255.0).powi(2);
        let widened = last(orm_levels(flat(), Some(&NormalLoss::new(&normals))));
        let plain = last(orm_levels(flat(), None));
        let mean = texels(&normal_levels(&normals)[5])[0];
        let mean = DVec3::from(unit_normal(mean).map(f64::from));
        let error = |alpha_of_lobe: f64| -> f64 {
            let angles = (0..45).map(|i| f64::from(i).to_radians());
            let wrong = |a: f64| {
                let h = DVec3::new(a.sin(), 0.0, a.cos());
                (d_ggx(mean, h, alpha_of_lobe) - mean_lobe(&normals, alpha, h)).abs() * a.sin()
            };
            angles.map(wrong).sum()
        };
        assert!((plain - alpha).abs() < 1e-9);
        assert!(error(widened) < 0.5 * error(plain), "lean {lean}: {} against {}", error(widened), error(plain));
    }
}

#[test]
fn widening_agrees_with_its_f64_twin_for_different_sizes_too() {
    for (surface, normals) in [([16, 16], [16, 16]), ([16, 16], [64, 32]), ([32, 32], [8, 8]), ([12, 10], [31, 33])] {
        let map = bumpy(normals, 60);
        let levels = orm_levels(texture(surface, |_, _| [255, 60, 0, 255]), Some(&NormalLoss::new(&map)));
        for (level, bytes) in (0u32..).zip(&levels) {
            let size = level_size(surface, level);
            let full = size[0] >= normals[0] && size[1] >= normals[1];
            let vectors: Vec<DVec4> =
                map.texels().map(|t| DVec3::from(unit_normal(*t).map(f64::from)).extend(0.0)).collect();
            let means = box_average(&vectors, normals, size);
            for (texel, mean) in texels(bytes).iter().zip(means) {
                let own = (60.0f64 / 255.0).powi(4);
                let widened = mip::widened(own, mean.truncate().length());
                let truth = if full || level == 0 { own } else { widened }.powf(0.25) * 255.0;
                // The mean of means of uneven sizes is not exactly the mean.
                let even = surface == normals || normals.iter().chain(&surface).all(|s| s.is_power_of_two());
                let tolerance = if even { 0.6 } else { 6.0 };
                assert!(
                    (f64::from(texel[1]) - truth).abs() < tolerance,
                    "{surface:?} {normals:?} level {level}: {} {truth}",
                    texel[1]
                );
            }
        }
    }
}

#[test]
fn the_f32_width_agrees_with_the_reference() {
    for r in [0.0f32, 0.01, 0.5, 0.9, 0.999, 1.0] {
        let truth = mip::fisher_width(f64::from(r));
        assert!((f64::from(fisher_width(r)) - truth).abs() <= 1e-4 * truth.max(1e-3), "{r}");
    }
}
