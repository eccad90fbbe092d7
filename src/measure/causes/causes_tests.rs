//! Causes of a ball's error where the answer is known. All numbers are in percent.

use glam::{Mat4, Vec3};

use super::ball::Grid;
use super::rows::Ablation;
use super::*;
use crate::context::Context;
use crate::gpu::with_gpu;
use crate::measure::bench::Bench;
use crate::render::{Eye, LightModel, LightPart, Output, RenderSettings, Shading};
use crate::scene::{Camera, Environment, Instance, Material, Mesh, PointLight, Scene};

const SMALL: Grid = Grid { roughness: &[0.2, 0.5, 0.9], nv: &[0.8, 0.3], log2_normals: 1, cubes: &[16], width: 64 };

/// Rows of a small ball.
fn measured(panorama: &Panorama, size: u32) -> Vec<Row> {
    with_gpu(|gpu| Ball::new(&Context::silent(gpu), panorama, size, &SMALL).unwrap().rows(&SMALL).unwrap())
}

/// By material: metal, dielectric, black dielectric.
fn find<'a>(rows: &'a [Row], ablation: Ablation, cause: &str) -> Vec<(&'a str, &'a Row)> {
    let wanted = |row: &&Row| row.ablation == ablation && row.cause == cause;
    rows.iter().filter(wanted).map(|row| (row.subject.as_str(), row)).collect()
}

#[test]
fn under_even_light_only_the_table_and_rounding_cause_errors() {
    let rows = measured(&Panorama::from_fn(64, 32, |_| Vec3::splat(1.1)), 64);
    for row in rows.iter().filter(|row| row.ablation == Ablation::Exact) {
        // A half float has ten digits, the table is good to 1e-3, and integrals to the floor.
        let most = match row.cause.as_str() {
            "texels" => 100.0 * 0.5f64.powi(9),
            "table" => 0.1,
            "n = v (matched)" | "diffuse, multi-scatter" => 0.3,
            _ => 1e-4,
        };
        let change = row.change;
        assert!(change <= most, "{}, {}: {change}", row.subject, row.cause);
    }
    for (subject, change) in find(&rows, Ablation::Other, "n = v") {
        assert!(change.change < 0.1, "{subject}: {change:?}");
    }
    // Applied twice, Fresnel's term adds light, the more the less else there is.
    let twice: Vec<f64> = find(&rows, Ablation::Other, "Fresnel").iter().map(|(_, change)| change.change).collect();
    assert!(twice[2] > 5.0 && twice[2] > twice[1], "{twice:?}");
    // Gold that scatters light once loses some of it; the mean over the grid.
    let single = find(&rows, Ablation::Other, "scattering");
    assert!(single[0].0.ends_with("metal") && single[0].1.change > 3.0, "{single:?}");
}

#[test]
fn under_linear_light_matching_the_mean_is_right_and_the_classic_way_is_not() {
    let to_light = Vec3::new(0.5, 0.7, -0.2);
    let rows = measured(&Panorama::from_fn(128, 64, |d| Vec3::splat(1.0 + 0.9 * to_light.dot(d))), 64);
    for (subject, matched) in find(&rows, Ablation::Exact, "n = v (matched)") {
        // Gold's channels have lobes of their own.
        assert!(matched.change < 0.6, "{subject}: {matched:?}");
    }
    for (subject, mixing) in find(&rows, Ablation::Exact, "level interpolation") {
        assert!(mixing.change < 0.3, "{subject}: {mixing:?}");
    }
    for (subject, classic) in find(&rows, Ablation::Other, "n = v") {
        assert!(classic.gain < -0.2 && classic.error_replaced > 1.5 * classic.error, "{subject}: {classic:?}");
    }
}

#[test]
fn coarse_cubes_are_worse_and_every_cause_is_measured_where_light_varies() {
    let rows = measured(&synthetic_panorama(64, true), 128);
    for (subject, coarse) in find(&rows, Ablation::Other, "cube resolution") {
        assert!(coarse.error_replaced > coarse.error && coarse.change > 0.0, "{subject}: {coarse:?}");
    }
    let whole = find(&rows, Ablation::Whole, "all");
    for cause in chain::Cause::ALL {
        let found = find(&rows, Ablation::Exact, cause.words()[0]);
        assert!(found.len() == 3 && found.iter().zip(&whole).all(|((_, row), (_, whole))| row.error == whole.error));
        assert!(found.iter().all(|(_, row)| row.gain.abs() <= row.change + 1e-10), "{found:?}");
    }
}

#[test]
fn panoramas_are_averaged_until_they_fit_and_keep_their_mean() {
    let panorama = Panorama::from_fn(64, 32, |d| Vec3::ONE + 0.5 * d);
    let small = smaller(panorama.clone(), 20);
    assert_eq!((small.width, small.height, small.texels.len()), (20, 10, 200));
    let mean = |p: &Panorama| p.texels.iter().map(|t| f64::from(t[1])).sum::<f64>() / p.texels.len() as f64;
    assert!((mean(&small) - mean(&panorama)).abs() < 1e-5);
    assert_eq!(smaller(panorama.clone(), 64), panorama);
}

/// The mean over a picture of one ball, on which light falls from a lamp, a sun, a sky and another ball.
fn mean_of(context: &Context, light: LightModel, part: LightPart) -> Vec3 {
    let placed = |x: f32| Instance { mesh: 0, world_from_local: Mat4::from_translation(x * Vec3::X) };
    let position = Vec3::new(0.3, 0.4, 2.0);
    let scene = Scene {
        meshes: vec![Mesh::ball(16, 0.5)],
        instances: vec![placed(0.0), placed(1.1)],
        sources: Vec::new(),
        materials: vec![Material::plain("half metal", Vec3::new(0.8, 0.6, 0.5), 0.5, 0.4)],
        textures: vec![],
        lights: vec![PointLight {
            position: Vec3::new(-1.0, 2.0, 1.5),
            intensity: Vec3::splat(8.0),
            radius: 0.0,
            cone: None,
        }],
        cameras: vec![Camera { name: "c".into(), position, target: Vec3::ZERO, vertical_fov_degrees: 15.0 }],
        environment: Environment { panorama: synthetic_panorama(64, true), rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    };
    let (shading, output) = (Shading::Reference, Output::Linear);
    let settings = RenderSettings { shading, output, light, part, cube_size: 16, ..RenderSettings::default() };
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    let mut bench = Bench::new(context, &scene, settings, [16; 2], vec![eye]).unwrap();
    for _ in 0..200 {
        bench.draw().unwrap();
    }
    let pixels = bench.radiance().unwrap();
    pixels.iter().sum::<Vec3>() / pixels.len() as f32
}

#[test]
fn the_exact_picture_is_the_sum_of_its_parts() {
    with_gpu(|gpu| {
        for light in [LightModel::Direct, LightModel::Baked] {
            let [whole, parts @ ..] =
                [LightPart::All, LightPart::Direct, LightPart::SoftDiffuse, LightPart::SoftSpecular]
                    .map(|part| mean_of(&Context::silent(gpu), light, part));
            let off = (parts.iter().sum::<Vec3>() / whole - 1.0).abs().max_element();
            assert!(off < 0.02, "{light:?}: {parts:?} are off by {off} from {whole}");
            assert!(parts.iter().all(|part| part.min_element() > 0.03 * whole.max_element()), "{light:?}: {parts:?}");
        }
    });
}
