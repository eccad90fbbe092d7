//! Light maps precomputed on the GPU, against sums in f64 over all texels of the panorama.

use crate::common::gpus::TestGpu;
use crate::common::light::{Errors, level_errors, look_up, panorama, read_cube, relative};
use glam::DVec3;
use pbr_vr::context::Context;
use pbr_vr::precompute::{LightMaps, Options};
use pbr_vr::reference::levels::{LEVELS, alpha_from_level, level_from_spread};
use pbr_vr::reference::lobe::kernel_spread;
use pbr_vr::reference::panorama_sums::prefiltered_around;
use pbr_vr::reference::sampling::hammersley;

/// Width of the panoramas; `pbr-vr measure precompute` takes 2048 and more texels.
const WIDTH: u32 = 1024;

#[test]
fn levels_and_irradiance_hold_what_sums_over_the_panorama_give() {
    let gpu = TestGpu::take();
    let mut good = true;
    for sun in [false, true] {
        let panorama = panorama(WIDTH, sun);
        let maps = LightMaps::new(&Context::silent(&gpu), &panorama, Options::default()).expect("light maps");
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
}

/// Directions that are no texel's centre, and roughnesses between the levels'.
#[test]
fn roughness_between_levels_is_close_to_its_own_lobe() {
    let gpu = TestGpu::take();
    for sun in [false, true] {
        let panorama = panorama(WIDTH, sun);
        let maps = LightMaps::new(&Context::silent(&gpu), &panorama, Options::default()).expect("light maps");
        let level = |level: usize| read_cube(&gpu, &maps.specular[level % 2], (level / 2) as u32);
        let cubes: Vec<Vec<DVec3>> = (0..LEVELS).map(level).collect();
        let directions: Vec<DVec3> = (0..32)
            .map(|i| {
                let u = hammersley(i, 5);
                let (z, (sin, cos)) = (1.0 - 2.0 * (u.x + 0.01), (std::f64::consts::TAU * u.y).sin_cos());
                DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin)
            })
            .collect();
        let mut means = Vec::new();
        for i in 0..50 {
            let roughness = 0.02 * f64::from(i + 1);
            let alpha = roughness * roughness;
            let wanted = prefiltered_around(&directions, alpha, [panorama.width, panorama.height], &panorama.texels);
            let at = level_from_spread(kernel_spread(alpha));
            let (low, share) = ((at as usize).min(LEVELS - 2), at - at.floor().min((LEVELS - 2) as f64));
            let errors = directions
                .iter()
                .zip(wanted)
                .map(|(d, want)| relative(look_up(&cubes[low], *d).lerp(look_up(&cubes[low + 1], *d), share), want));
            let errors = Errors::new(errors.collect());
            println!("sun {sun}, roughness {roughness:.2}, level {at:.2}: {errors}");
            means.push((alpha, errors.mean));
        }
        // Below the first lobe a texel of 256 is wider than what the eye would see: it shows its mean.
        let stored: Vec<f64> = means.iter().filter(|(a, _)| *a >= alpha_from_level(1)).map(|(_, e)| *e).collect();
        let mean = stored.iter().sum::<f64>() / stored.len() as f64;
        let all = means.iter().map(|(_, e)| e).sum::<f64>() / means.len() as f64;
        println!("sun {sun}: mean {mean:.4} over {} roughnesses, {all:.4} over all", stored.len());
        assert!(mean <= 0.01 && all <= 0.025);
    }
}
