//! Loaded scenes as colours: radiance of each pixel, for several eyes at once, from pictures and from the reference.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use pbr_vr::asset::{Panorama, Report, Storage, TextureOptions};
use pbr_vr::context::Context;
use pbr_vr::gpu::{FrameRing, Gpu, Subresource, read_image};
use pbr_vr::render::{
    Eye, FRAME_BYTES, FRAMES_IN_FLIGHT, FrameInputs, LightDetail, LightModel, Output, RenderSettings, Renderer,
    Shading, StandardError, TextureSettings,
};
use pbr_vr::scene::{LoadOptions, Scene, load};

/// Where the eye of [`front`] is, on the axis +Z.
pub const EYE_Z: f64 = 5.0;

/// What is drawn.
#[derive(Clone, Copy)]
pub struct Look {
    pub light: LightModel,
    pub shading: Shading,
    pub size: [u32; 2],
    pub samples: u32,
    pub frames: u64,
    pub detail: LightDetail,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            light: LightModel::Open,
            shading: Shading::Pbr,
            size: [64; 2],
            samples: 1,
            frames: 1,
            detail: LightDetail::default(),
        }
    }
}

/// One eye's picture: radiance, rows from the top.
pub struct Seen {
    pub size: [u32; 2],
    pub pixels: Vec<DVec3>,
    pub error: Option<StandardError>,
}

impl Seen {
    pub fn at(&self, x: u32, y: u32) -> DVec3 {
        self.pixels[(y * self.size[0] + x) as usize]
    }

    /// The mean over a square about where [`front`] sees a point of the plane z = 0.
    pub fn about(&self, point: [f64; 2], reach: u32) -> DVec3 {
        let pixel = |v: f64, side: u32| ((0.5 * v + 0.5) * f64::from(side)).floor() as u32;
        let (x, y) = (pixel(point[0], self.size[0]), pixel(-point[1], self.size[1]));
        let mut sum = DVec3::ZERO;
        for row in y - reach..=y + reach {
            for column in x - reach..=x + reach {
                sum += self.at(column, row);
            }
        }
        sum / f64::from((2 * reach + 1).pow(2))
    }

    pub fn mean(&self) -> DVec3 {
        self.pixels.iter().sum::<DVec3>() / self.pixels.len() as f64
    }
}

/// An eye on +Z that sees −1 to 1 of the plane z = 0.
pub fn front() -> Eye {
    let fov_degrees = 2.0 * (1.0 / EYE_Z).atan().to_degrees();
    Eye::looking(Vec3::new(0.0, 0.0, EYE_Z as f32), Vec3::ZERO, fov_degrees as f32, 1.0)
}

/// Where [`front`] sees the plane at a height of z through the middle of a pixel of a picture of so many.
pub fn on_plane(x: u32, y: u32, size: u32, z: f64) -> DVec2 {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0;
    DVec2::new(at(x), -at(y)) * (EYE_Z - z) / EYE_Z
}

/// A model under a sky of even radiance, with the warnings of loading.
pub fn loaded_with_warnings(path: &Path, sky: f32) -> (Scene, Vec<String>) {
    let textures = TextureOptions { storage: Storage::Raw, anisotropy: 1, ..TextureOptions::default() };
    let report = Report::silent();
    let mut scene = load(path, &LoadOptions { textures, ..LoadOptions::default() }, &report).expect("a scene");
    // Directional lights are texels far brighter than the even radiance of 1 around them.
    for texel in &mut scene.environment.panorama.texels {
        *texel = texel.map(|v| v - 1.0 + sky);
    }
    if scene.environment.panorama.texels.len() < 512 * 512 {
        scene.environment.panorama = Panorama::uniform(Vec3::splat(sky));
    }
    let warnings = report.warnings().into_iter().filter(|w| !w.contains("no environment")).collect();
    (scene, warnings)
}

/// The same; any warning fails the test.
pub fn loaded(path: &Path, sky: f32) -> Scene {
    let (scene, warnings) = loaded_with_warnings(path, sky);
    assert_eq!(warnings, [""; 0]);
    scene
}

/// Draws a scene for all eyes at once.
pub fn look(gpu: &Arc<Gpu>, scene: &Scene, eyes: &[Eye], look: Look) -> Vec<Seen> {
    let Look { light, shading, size, samples, frames, detail } = look;
    let textures = TextureSettings { storage: Some(Storage::Raw), anisotropy: Some(1), ..Default::default() };
    let settings = RenderSettings {
        light,
        light_detail: detail,
        shading,
        samples,
        output: Output::Linear,
        cube_size: 64,
        textures,
        ..Default::default()
    };
    let context = Context::silent(gpu);
    let mut renderer = Renderer::new(&context, scene, settings, size, eyes.len() as u32).expect("a renderer");
    let inputs = FrameInputs::of(scene, eyes);
    if light == LightModel::Baked && shading != Shading::Reference {
        renderer.finish_lightmap(&inputs).expect("a lightmap");
    }
    let mut ring = FrameRing::new(gpu, FRAME_BYTES).expect("a ring");
    for _ in 0..frames {
        let mut frame = ring.begin().expect("a frame");
        renderer.record(&mut frame, &inputs).expect("a recorded frame");
        frame.submit(None).expect("a submission");
    }
    ring.finish_all().expect("its end");
    let slot = ((frames - 1) % FRAMES_IN_FLIGHT as u64) as usize;
    let seen = |layer| {
        let bytes = read_image(gpu, renderer.picture(), Subresource { mip: 0, layer }, Output::Linear.bytes());
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes.expect("a picture"));
        assert!(texels.iter().all(|t| t.iter().all(|v| v.is_finite() && *v >= 0.0)), "in the picture");
        let pixels = texels.iter().map(|t| Vec3::new(t[0], t[1], t[2]).as_dvec3()).collect();
        Seen { size, pixels, error: renderer.standard_error(slot) }
    };
    (0..eyes.len() as u32).map(seen).collect()
}

/// The same by [`front`].
pub fn see(gpu: &Arc<Gpu>, scene: &Scene, what: Look) -> Seen {
    look(gpu, scene, &[front()], what).remove(0)
}

/// Each channel is within a bound, and a part of what is wanted.
pub fn assert_near(name: &str, got: DVec3, want: DVec3, absolute: f64, relative: f64) {
    let limit = DVec3::splat(absolute) + relative * want.abs();
    assert!((got - want).abs().cmple(limit).all(), "{name}: {got}, not {want} ± {limit}");
}
