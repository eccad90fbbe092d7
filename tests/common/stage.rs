//! A scene on a GPU under validation, drawn frame after frame for eyes of any kind, as numbers.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Mat4;
use pbr_vr::asset::picture::Picture;
use pbr_vr::asset::{MipChain, Report, Storage, TextureOptions};
use pbr_vr::context::Context;
use pbr_vr::gpu::{FrameRing, Gpu, Subresource, read_image};
use pbr_vr::render::{
    Eye, FRAME_BYTES, FrameInputs, LightModel, Output, RenderSettings, Renderer, Shading, TextureSettings,
};
use pbr_vr::scene::{LoadOptions, Scene, load};

use super::gpus::TestGpu;

/// Takes a GPU for `work`; any validation message fails.
pub fn with_gpu<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    work(&TestGpu::take())
}

/// For what a processor draws fastest: plain texels, one sample along a footprint. Of shaders that read compressed ones, Mesa's
/// software renderer keeps no machine code.
pub fn load_options() -> LoadOptions {
    let textures = TextureOptions { storage: Storage::Raw, anisotropy: 1, ..TextureOptions::default() };
    LoadOptions { textures, ..LoadOptions::default() }
}

/// One of assets/scenes.
pub fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(name)
}

/// Loads a scene.
pub fn scene(path: &Path) -> Scene {
    load(path, &load_options(), &Report::silent()).expect("a scene")
}

/// The naive form of a scene's textures: the finest level only, so that what is far away is picked from it at random.
pub fn without_mips(mut scene: Scene) -> Scene {
    scene.textures.iter_mut().for_each(|texture: &mut MipChain| texture.levels.truncate(1));
    scene
}

/// Draws one frame to its end; its slot is 0.
pub fn draw_frame(gpu: &Arc<Gpu>, renderer: &mut Renderer, inputs: &FrameInputs<'_>) {
    let mut ring = FrameRing::new(gpu, FRAME_BYTES).expect("a ring");
    let mut frame = ring.begin().expect("a frame");
    renderer.record(&mut frame, inputs).expect("a recorded frame");
    frame.submit(None).expect("a submission");
    ring.finish_all().expect("its end");
}

/// A scene, ready to be drawn for one eye.
pub struct Stage {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    /// But for the eyes.
    inputs: FrameInputs<'static>,
    size: [u32; 2],
}

impl Stage {
    /// 4 samples per pixel are what the program takes; with 1, nothing is smoothed.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, size: [u32; 2], samples: u32, output: Output) -> Self {
        Self::showing(gpu, scene, size, samples, output, Shading::Pbr)
    }

    pub fn showing(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        size: [u32; 2],
        samples: u32,
        output: Output,
        shading: Shading,
    ) -> Self {
        // Small light maps, as dozens of scenes are lit.
        let textures = TextureSettings { storage: Some(Storage::Raw), anisotropy: Some(1), ..Default::default() };
        let light = LightModel::Direct;
        let settings =
            RenderSettings { shading, samples, output, cube_size: 64, textures, light, ..Default::default() };
        let renderer = Renderer::new(&Context::silent(gpu), scene, settings, size, 1).expect("a renderer");
        Self { gpu: Arc::clone(gpu), renderer, inputs: FrameInputs::of(scene, &[]), size }
    }

    /// Bytes of one frame.
    fn draw(&mut self, eye: &Eye, output: Output) -> Vec<u8> {
        draw_frame(&self.gpu, &mut self.renderer, &FrameInputs { eyes: &[*eye], ..self.inputs });
        read_image(&self.gpu, self.renderer.picture(), Subresource { mip: 0, layer: 0 }, output.bytes())
            .expect("a picture")
    }

    /// Radiance, RGBA, rows from the top; for [`Output::Linear`].
    pub fn radiance(&mut self, eye: &Eye) -> Vec<[f32; 4]> {
        bytemuck::pod_collect_to_vec(&self.draw(eye, Output::Linear))
    }

    /// What a viewer sees, RGBA, rows from the top; for [`Output::Display`].
    pub fn shown(&mut self, eye: &Eye) -> Vec<[u8; 4]> {
        bytemuck::pod_collect_to_vec(&self.draw(eye, Output::Display))
    }

    /// The same as a picture.
    pub fn picture(&mut self, eye: &Eye) -> Picture {
        let bytes = self.draw(eye, Output::Display);
        Picture::from_srgb8("shown", self.size[0], self.size[1], &bytes)
    }
}

/// The whole world `scale` times as large, with point lights that light it as before.
pub fn scaled(mut scene: Scene, scale: f32) -> Scene {
    for instance in &mut scene.instances {
        instance.world_from_local = Mat4::from_scale(glam::Vec3::splat(scale)) * instance.world_from_local;
    }
    for light in &mut scene.lights {
        light.position *= scale;
        light.intensity *= scale * scale;
        light.radius *= scale;
    }
    for camera in &mut scene.cameras {
        camera.position *= scale;
        camera.target *= scale;
    }
    scene
}

/// Every number is one that can be shown: finite, not negative, and at most `most`.
pub fn assert_sane(radiance: &[[f32; 4]], most: f32, case: &str) {
    for (i, texel) in radiance.iter().enumerate() {
        assert!(texel.iter().all(|v| (0.0..=most).contains(v)), "{case}: pixel {i} is {texel:?}, of at most {most}");
    }
}
