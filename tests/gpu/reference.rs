//! `--shading reference` against the integrals in f64, within its own error bars; its standard error against its spread.

use std::path::{Path, PathBuf};

use crate::common::gpus::TestGpu;
use crate::common::{Workshop, material, setup, square};
use glam::DVec3;
use pbr_vr::asset::picture::Picture;
use pbr_vr::asset::{Panorama, Report};
use pbr_vr::precompute::Cache;
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::energy::Scattering;
use pbr_vr::reference::integrals::{PanoramaView, Surface, reflected};
use pbr_vr::render::{LightModel, RenderSettings, Shading, StandardError};
use pbr_vr::view::{RenderRequest, render_on};

const SIDE: u32 = 24;
const BASE_COLOR: [f32; 3] = [0.9, 0.5, 0.2];

/// A square of one material that fills the picture, seen from far away, so that all pixels show one direction.
struct Case {
    metallic: f32,
    roughness: f32,
    nv: f64,
}

impl Case {
    fn v(&self) -> DVec3 {
        DVec3::new((1.0 - self.nv * self.nv).sqrt(), 0.0, self.nv)
    }

    fn truth(&self, panorama: &Panorama, geometry: Geometry) -> DVec3 {
        let view = PanoramaView::new(panorama.width, panorama.height, &panorama.texels).expect("a view").interpolated();
        let [base_color, n] = [DVec3::from(BASE_COLOR.map(f64::from)), DVec3::Z];
        let (v, metallic) = (self.v(), f64::from(self.metallic));
        let roughness = f64::from(self.roughness);
        let light = reflected(view, &Surface { n, v, base_color, metallic, roughness }, geometry, Scattering::Multiple);
        light.diffuse + light.specular
    }
}

fn reference(shop: &Workshop, case: &Case, geometry: Geometry, frames: u64) -> (Picture, StandardError) {
    shop.write("m.mtl", &material(BASE_COLOR, case.metallic, case.roughness));
    shop.write("model.obj", &square("m.mtl"));
    let [x, y, z] = (100.0 * case.v()).to_array();
    let scene = shop.write(
        "scene.toml",
        &format!(
            "environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"model.obj\"\n[[camera]]\nname = \"c\"\n\
             position = [{x}, {y}, {z}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 0.05\n"
        ),
    );
    let (output, cache) = (shop.path("out.exr"), Cache::in_folder(shop.path("cache")));
    let request = RenderRequest {
        size: [SIDE, SIDE],
        frames: Some(frames),
        settings: RenderSettings {
            shading: Shading::Reference,
            geometry,
            light: LightModel::Open,
            ..RenderSettings::default()
        },
        ..RenderRequest::new(&scene, &output)
    };
    let facts = render_on(&request, &setup(Some(&cache)).with(&TestGpu::take())).expect("a render");
    (Picture::read(&output).expect("the picture"), facts.standard_error.expect("a standard error"))
}

/// Mean and standard deviation over the pixels of one channel.
fn spread(picture: &Picture, channel: usize) -> (f64, f64) {
    let values: Vec<f64> = picture.pixels.iter().map(|p| f64::from(p[channel])).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
}

fn agree(shop: &Workshop, sky: &Path, cases: &[Case]) {
    let panorama = Panorama::load(sky, &Report::silent()).expect("the panorama");
    for geometry in [Geometry::Smith, Geometry::Karis2013] {
        for case in cases {
            let (picture, error) = reference(shop, case, geometry, 32);
            let truth = case.truth(&panorama, geometry);
            let name = format!("{geometry:?}, metallic {}, roughness {}", case.metallic, case.roughness);
            let mut said = 0.0;
            for channel in 0..3 {
                let (mean, deviation) = spread(&picture, channel);
                let standard = deviation / f64::from(SIDE);
                let off = mean - truth[channel];
                println!("{name}: {mean:.5} ± {standard:.5} against {:.5}", truth[channel]);
                // Quadrature and f32 are good to 1e-3 of the value.
                assert!(off.abs() <= 4.0 * standard + 1e-3 * truth[channel], "{name}: {mean} against {truth}");
                said += deviation;
            }
            // The pixels are as many independent runs: their spread is what the standard error claims to be.
            let spread = said / truth.element_sum();
            let ratio = error.mean_relative / spread.max(1e-6);
            println!("{name}: says {:.5}, is {spread:.5}", error.mean_relative);
            // A mirror's pixels differ only by where they look.
            let settled = case.roughness == 0.0 && case.metallic == 1.0;
            assert!(
                if settled { error.mean_relative < 1e-4 } else { (0.85..1.15).contains(&ratio) },
                "{name}: says {}, is {spread}",
                error.mean_relative
            );
        }
    }
}

fn cases() -> [Case; 6] {
    [(1.0, 0.0, 0.7), (0.0, 0.0, 0.5), (1.0, 0.15, 0.8), (0.0, 0.3, 0.4), (0.5, 0.6, 0.9), (1.0, 1.0, 0.3)]
        .map(|(metallic, roughness, nv)| Case { metallic, roughness, nv })
}

fn sun_sky(shop: &Workshop) -> PathBuf {
    // Case 5 of tests/gpu/stability.rs: 0.53° wide, 50,000 over a sky of 0.1, a third of the way up.
    let to_sun = DVec3::new(-0.45, 0.25, 0.86).normalize();
    shop.panorama("sky.exr", 1024, |d| {
        if DVec3::from(d).dot(to_sun) > 0.265f64.to_radians().cos() { [5e4; 3] } else { [0.1; 3] }
    })
}

#[test]
fn the_reference_agrees_with_the_integrals_under_even_light() {
    let shop = Workshop::new();
    let sky = shop.panorama("sky.exr", 64, |_| [1.0; 3]);
    agree(&shop, &sky, &cases());
}

#[test]
fn the_reference_agrees_with_the_integrals_under_a_gradient() {
    let shop = Workshop::new();
    let sky = shop.panorama("sky.exr", 64, |d| d.map(|c| (1.0 + 0.8 * c) as f32));
    agree(&shop, &sky, &cases());
}

#[test]
fn the_reference_agrees_with_the_integrals_under_a_tiny_sun() {
    let shop = Workshop::new();
    let sky = sun_sky(&shop);
    agree(&shop, &sky, &cases()[2..]);
}

#[test]
fn the_standard_error_falls_with_the_root_of_the_frames() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| d.map(|c| (1.0 + 0.8 * c) as f32));
    let [few, many] = [8, 128].map(|frames| reference(&shop, &cases()[4], Geometry::Smith, frames).1);
    assert_eq!((few.frames, many.frames), (8, 128));
    let ratio = few.mean_relative / many.mean_relative;
    assert!((3.2..4.8).contains(&ratio), "{ratio}, not 4");
}
