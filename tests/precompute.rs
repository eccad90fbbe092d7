//! What the GPU precomputes from a panorama, against sums in f64 over all of its texels.

mod common;


use common::light::{level_errors, open_gpu, panorama, read_cube, texel_directions};
use glam::{DVec3, Vec3};
use pbr_vr::asset::Panorama;
use pbr_vr::precompute::LightMaps;
use pbr_vr::reference::levels::{LEVELS, alpha_from_level};

/// Width of the panoramas of the quick tests; `measured_against_every_texel` has the size that counts.
const WIDTH: u32 = 1024;

#[test]
fn levels_and_irradiance_hold_what_sums_over_the_panorama_give() {
    let (gpu, messages) = open_gpu();
    let mut good = true;
    for sun in [false, true] {
        let panorama = panorama(WIDTH, sun);
        let maps = LightMaps::new(&gpu, &panorama).expect("light maps");
        for level in 1..LEVELS {
            let cube = read_cube(&gpu, &maps.specular[level % 2], (level / 2) as u32);
            let errors = level_errors(&cube, alpha_from_level(level), &panorama, 40);
            println!("sun {sun}, level {level}: {errors}");
            good &= errors.mean <= 0.003 && errors.p95 <= 0.01 && errors.max <= 0.03;
        }
        let errors = level_errors(&read_cube(&gpu, &maps.irradiance_over_pi, 0), 1.0, &panorama, 40);
        println!("sun {sun}, irradiance: {errors}");
        good &= errors.mean <= 0.002 && errors.max <= 0.015;
    }
    assert!(good, "see above");
    drop(gpu);
    messages.check().expect("no validation messages");
}

/// The numbers to publish: `cargo test --release --test precompute -- --ignored --nocapture`.
#[test]
#[ignore = "minutes; for the table of errors"]
fn measured_against_every_texel() {
    let (gpu, _messages) = open_gpu();
    for sun in [false, true] {
        let panorama = panorama(2048, sun);
        let maps = LightMaps::new(&gpu, &panorama).expect("light maps");
        println!("{:?}", maps.times);
        for level in 1..LEVELS {
            let cube = read_cube(&gpu, &maps.specular[level % 2], (level / 2) as u32);
            println!("sun {sun}, level {level}: {}", level_errors(&cube, alpha_from_level(level), &panorama, 64));
        }
        let irradiance = read_cube(&gpu, &maps.irradiance_over_pi, 0);
        println!("sun {sun}, irradiance: {}", level_errors(&irradiance, 1.0, &panorama, 64));
    }
}

#[test]
fn even_light_stays_even() {
    let (gpu, _messages) = open_gpu();
    let maps = LightMaps::new(&gpu, &Panorama::uniform(Vec3::new(1.0, 0.5, 3.0))).expect("light maps");
    let check = |image, mip, what: &str| {
        let cube = read_cube(&gpu, image, mip);
        let off = |t: &DVec3| (*t / DVec3::new(1.0, 0.5, 3.0) - DVec3::ONE).abs().max_element();
        let worst = cube.iter().map(off).fold(0.0, f64::max);
        println!("{what}: {worst:.2e}");
        worst <= 1e-3
    };
    let mut good = true;
    for level in 0..LEVELS {
        good &= check(&maps.specular[level % 2], (level / 2) as u32, &format!("level {level}"));
    }
    good &= check(&maps.irradiance_over_pi, 0, "irradiance");
    assert!(good, "see above");
}

#[test]
fn the_same_light_gives_the_same_bits() {
    let (gpu, _messages) = open_gpu();
    let panorama = panorama(256, true);
    let bits = || {
        let maps = LightMaps::new(&gpu, &panorama).expect("light maps");
        let level = |level: usize| read_cube(&gpu, &maps.specular[level % 2], (level / 2) as u32);
        ((0..LEVELS).map(level).collect::<Vec<_>>(), read_cube(&gpu, &maps.irradiance_over_pi, 0))
    };
    assert!(bits() == bits());
}

/// L = 1 + a·d: a lobe of spread s shows 1 + (1 − s) a·r.
#[test]
fn linear_light_is_exact_poles_included() {
    let (gpu, _messages) = open_gpu();
    for a in [Vec3::X, Vec3::Y, Vec3::new(-0.3, -0.8, 0.5)] {
        let panorama = Panorama::from_fn(512, 256, |d| Vec3::splat(1.0 + 0.9 * a.dot(d)));
        let maps = LightMaps::new(&gpu, &panorama).expect("light maps");
        for level in 1..LEVELS {
            let cube = read_cube(&gpu, &maps.specular[level % 2], (level / 2) as u32);
            let length = 1.0 - pbr_vr::reference::levels::spread_from_level(level);
            for (r, got) in texel_directions(&cube).zip(&cube) {
                let want = 1.0 + 0.9 * length * a.as_dvec3().dot(r);
                assert!((got.x / want - 1.0).abs() < 0.005, "level {level} to {r}: {} against {want}", got.x);
            }
        }
    }
}
