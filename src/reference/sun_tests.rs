//! Suns found in panoramas, computed and shipped.

use std::f64::consts::TAU;
use std::path::Path;

use super::*;
use crate::asset::{Panorama, Report, synthetic_panorama};

const SIZE: [u32; 2] = [512, 256];

/// A panorama of `sky`, with a disc of `radiance` around each of some directions; texels hold their share of it.
fn panorama(size: [u32; 2], sky: impl Fn(DVec3) -> DVec3, discs: &[(DVec3, f64, f64)]) -> Vec<[f32; 3]> {
    const POINTS: u32 = 8;
    let at = |x: f64, y: f64| panorama_direction(DVec2::new(x / f64::from(size[0]), y / f64::from(size[1])));
    let texel = |x: u32, y: u32| {
        let mut value = sky(at(f64::from(x) + 0.5, f64::from(y) + 0.5));
        for (towards, degrees, radiance) in discs {
            let inside = |i: u32| {
                let part = |i: u32| (f64::from(i) + 0.5) / f64::from(POINTS);
                let d = at(f64::from(x) + part(i % POINTS), f64::from(y) + part(i / POINTS));
                angle(d, *towards) < degrees.to_radians()
            };
            let share =
                f64::from((0..POINTS * POINTS).filter(|i| inside(*i)).count() as u32) / f64::from(POINTS * POINTS);
            value += share * (*radiance - value);
        }
        value.as_vec3().to_array()
    };
    (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect()
}

fn even(_: DVec3) -> DVec3 {
    DVec3::new(0.4, 0.5, 0.6)
}

fn light(size: [u32; 2], texels: &[[f32; 3]]) -> DVec3 {
    let texel = |(i, t): (usize, &[f32; 3])| {
        DVec3::from_array(t.map(f64::from)) * panorama_texel_solid_angle((i / size[0] as usize) as u32, size)
    };
    texels.iter().enumerate().map(texel).sum()
}

/// What is left of a panorama, after checking that no light is lost or made.
fn remainder(size: [u32; 2], texels: &[[f32; 3]], split: &SunSplit) -> Vec<[f32; 3]> {
    let mut left = texels.to_vec();
    for (index, texel) in &split.changed {
        let darker = (0..3).all(|c| (0.0..=texels[*index][c]).contains(&texel[c]));
        assert!(darker, "{texel:?} of {:?}", texels[*index]);
        left[*index] = *texel;
    }
    // Over all texels the sums' own rounding is larger.
    let of_changed = |texels: &[[f32; 3]]| {
        let value = |i: usize| DVec3::from_array(texels[i].map(f64::from));
        let solid_angle = |i: usize| panorama_texel_solid_angle((i / size[0] as usize) as u32, size);
        split.changed.iter().map(|(i, _)| value(*i) * solid_angle(*i)).sum::<DVec3>()
    };
    for [before, after, bound] in [
        [of_changed(texels), of_changed(&left), DVec3::splat(1e-13)],
        [light(size, texels), light(size, &left), DVec3::splat(1e-11)],
    ] {
        let error = (after + split.sun.light() - before).abs() / before.max(DVec3::splat(f64::MIN_POSITIVE));
        assert!(error.cmple(bound).all(), "{before} became {after} and {}", split.sun.light());
    }
    left
}

#[test]
fn an_analytic_sun_is_found_anywhere() {
    let at = |x: f64, y: f64| panorama_direction(DVec2::new(x / f64::from(SIZE[0]), y / f64::from(SIZE[1])));
    // In the middle, on the seam, on both poles, beside them, on the border of four texels.
    for (x, y) in [(200.5, 90.5), (0.0, 100.0), (511.9, 100.2), (7.0, 0.0), (7.0, 256.0), (300.0, 1.5), (90.0, 254.0)] {
        let towards = at(x, y);
        for (degrees, radiance) in [(0.6, 3e4), (1.0, 1e4), (1.8, 2e3)] {
            let texels = panorama(SIZE, even, &[(towards, degrees, radiance)]);
            let split = find_sun(SIZE, &texels).unwrap_or_else(|| panic!("no sun at {x}, {y}"));
            let Sun { direction, angular_radius, share, .. } = split.sun;
            let name = format!("({x}, {y}), {degrees}°");
            let texel = 360.0 / f64::from(SIZE[0]);
            assert!(angle(direction, towards).to_degrees() < 0.1 * texel, "{name}: {direction} is not {towards}");
            let found = angular_radius.to_degrees();
            assert!(found > 0.98 * degrees && found < degrees + 0.4 * texel, "{name}: {found}°");
            let (all, sky) = (light(SIZE, &texels), 4.0 * PI * even(towards));
            assert!(split.sun.light().abs_diff_eq(all - sky, 1e-4), "{name}: {:?}", split.sun);
            assert!((share - 1.0 + sky.element_sum() / all.element_sum()).abs() < 1e-5, "{name}: {share}");
            // The sky closes over it.
            let left = remainder(SIZE, &texels, &split);
            let even = even(towards).as_vec3().to_array();
            assert!(left.iter().all(|texel| *texel == even), "{name}: the sky has a mark");
        }
    }
}

/// Glare falls off smoothly: the sky keeps it, and has neither a hole nor a spot.
#[test]
fn the_sky_around_keeps_its_glare() {
    let towards = panorama_direction(DVec2::new(0.3, 0.35));
    let glare = |d: DVec3| even(d) * (1.0 + 20.0 / (1.0 + angle(d, towards).to_degrees().powi(2)));
    let texels = panorama(SIZE, glare, &[(towards, 0.7, 4e4)]);
    let split = find_sun(SIZE, &texels).unwrap();
    let left = remainder(SIZE, &texels, &split);
    for (index, texel) in &split.changed {
        let view = View { size: SIZE, texels: &left };
        let around: Vec<f64> = view.neighbours(*index).map(|i| power(&left[i])).collect();
        let (low, high) = around.iter().fold((f64::MAX, 0.0f64), |(low, high), p| (low.min(*p), high.max(*p)));
        assert!(high < 3.0 * low, "{low} to {high} around {index}, {texel:?}");
    }
}

#[test]
fn a_sun_in_a_bright_window_is_the_sun_alone() {
    let towards = panorama_direction(DVec2::new(0.3, 0.35));
    let window =
        |d: DVec3| if (d - towards).abs().max_element() < 0.25 { DVec3::splat(30.0) } else { DVec3::splat(0.2) };
    let texels = panorama(SIZE, window, &[(towards, 0.8, 3e4)]);
    let split = find_sun(SIZE, &texels).unwrap();
    assert!(split.sun.angular_radius.to_degrees() < 1.1, "{:?}", split.sun);
    let left = remainder(SIZE, &texels, &split);
    assert!(split.changed.iter().all(|(index, _)| left[*index] == [30.0; 3]), "the window has a mark");
}

#[test]
fn lamps_windows_and_skies_are_no_sun() {
    let at = |u, v| panorama_direction(DVec2::new(u, v));
    let lamp = |u, v| (at(u, v), 1.0, 5e3);
    assert!(find_sun(SIZE, &panorama(SIZE, even, &[lamp(0.3, 0.3)])).is_some());
    let windows = |count: u32| {
        move |d: DVec3| {
            let of_window = |i: u32| (d - panorama_direction(DVec2::new(0.2 + 0.2 * f64::from(i), 0.45))).abs();
            let inside = (0..count).any(|i| of_window(i).max_element() < 0.15);
            DVec3::splat(if inside { 500.0 } else { 0.3 })
        }
    };
    for (what, texels) in [
        ("an even sky", panorama(SIZE, even, &[])),
        ("black", panorama(SIZE, |_| DVec3::ZERO, &[])),
        ("a gradient", panorama(SIZE, |d| DVec3::splat(1.5 + d.y), &[])),
        ("two lamps", panorama(SIZE, even, &[lamp(0.3, 0.3), lamp(0.7, 0.4)])),
        ("five lamps", panorama(SIZE, even, &[0.1, 0.3, 0.5, 0.7, 0.9].map(|u| lamp(u, 0.3)))),
        ("a window", panorama(SIZE, windows(1), &[])),
        ("three windows", panorama(SIZE, windows(3), &[])),
        ("a lamp of 5°", panorama(SIZE, even, &[(at(0.3, 0.3), 5.0, 500.0)])),
        ("a dim sun", panorama(SIZE, even, &[(at(0.3, 0.3), 0.8, 50.0)])),
        ("too little light", panorama(SIZE, |_| DVec3::splat(1e-35), &[(at(0.3, 0.3), 0.8, 1e-30)])),
        ("too much", panorama(SIZE, even, &[(at(0.3, 0.3), 0.8, 3e38)])),
    ] {
        let found = find_sun(SIZE, &texels);
        assert!(found.is_none(), "{what}: {:?}", found.map(|split| split.sun));
    }
    assert!(find_sun([0, 0], &[]).is_none() && find_sun([8, 4], &[[1.0; 3]; 32]).is_none());
    assert!(find_sun([1, 1], &[[1.0; 3]]).is_none());
}

/// One texel as bright as possible, in panoramas of any shape: an answer, and no light lost.
#[test]
fn hostile_panoramas_have_an_answer() {
    for size in [[1, 1], [1, 64], [64, 1], [3, 2], [64, 32], [257, 5]] {
        for peak in [1e-45, 1e-30, 1.0, 1e30, f32::MAX] {
            for sky in [0.0, 1e-45, 1.0] {
                let count = size[0] as usize * size[1] as usize;
                for place in [0, count / 2, count - 1] {
                    let mut texels = vec![[sky; 3]; count];
                    texels[place] = [peak, 0.5 * peak, 0.0];
                    if let Some(split) = find_sun(size, &texels) {
                        remainder(size, &texels, &split);
                        let Sun { direction, irradiance, angular_radius, share } = split.sun;
                        assert!(direction.is_normalized() && irradiance.is_finite() && (0.0..=1.001).contains(&share));
                        assert!(angular_radius <= 1.001 * MOST_RADIUS_DEGREES.to_radians());
                    }
                }
            }
        }
    }
}

/// What the shipped and the computed panoramas have.
#[test]
fn shipped_panoramas_have_the_suns_that_one_sees() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/panoramas");
    for (name, want) in [("courtyard", None), ("sunset", Some([0.026, 0.32])), ("forest", Some([0.060, 0.92]))] {
        let panorama = Panorama::load(&folder.join(format!("{name}.exr")), &Report::silent()).unwrap();
        let size = [panorama.width, panorama.height];
        let split = find_sun(size, &panorama.texels);
        split.iter().for_each(|split| drop(remainder(size, &panorama.texels, split)));
        let found = split.map(|split| [split.sun.share, split.sun.angular_radius.to_degrees()]);
        let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() < 0.001 && (a[1] - b[1]).abs() < 0.01;
        assert!(
            found.is_some() == want.is_some() && found.zip(want).is_none_or(|(a, b)| near(a, b)),
            "{name}: {found:?}"
        );
    }
    let size = [512, 256];
    let split = find_sun(size, &synthetic_panorama(512, true).texels).unwrap();
    assert!((split.sun.angular_radius.to_degrees() - 1.0).abs() < 0.15, "{:?}", split.sun);
    assert!(find_sun(size, &synthetic_panorama(512, false).texels).is_none());
}

#[test]
fn irradiance_radiance_and_light_belong_together() {
    for angular_radius in [0.005, 0.03] {
        let sun = Sun { direction: DVec3::Y, irradiance: DVec3::new(1.0, 2.0, 3.0), angular_radius, share: 0.5 };
        // By rings: light is the integral of radiance, irradiance that of radiance times cosine.
        let steps = 1000;
        let (mut light, mut irradiance) = (0.0, 0.0);
        for i in 0..steps {
            let theta = (f64::from(i) + 0.5) / f64::from(steps) * angular_radius;
            let ring = TAU * theta.sin() * angular_radius / f64::from(steps);
            (light, irradiance) = (light + ring, irradiance + ring * theta.cos());
        }
        assert!((sun.radiance() * light).abs_diff_eq(sun.light(), 1e-5));
        assert!((sun.radiance() * irradiance).abs_diff_eq(sun.irradiance, 1e-5));
    }
}
