//! The sky where the panorama's ends meet.

use std::sync::Arc;

use glam::Vec3;

use super::eye::Eye;
use super::frame::{FRAME_BYTES, FrameInputs};
use super::frame_set::FrameSet;
use super::renderer::Renderer;
use super::settings::{LightModel, RenderSettings};
use super::shared::constant;
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::{
    Attachments, ColourAttachment, Format, FrameRing, Gpu, GraphicsDesc, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, Pipeline, Subresource, read_image,
};
use crate::precompute::harness_tests::with_gpu;
use crate::scene::{Environment, Scene};

const SIZE: [u32; 2] = [64, 64];

/// Stripes along the circles of latitude, each four texels wide.
fn scene() -> Scene {
    let stripe =
        |d: Vec3| Vec3::splat(if (d.y.asin().to_degrees() / 1.40625).floor() as i32 % 2 == 0 { 1.0 } else { 0.0 });
    Scene {
        meshes: Vec::new(),
        instances: Vec::new(),
        sources: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        lights: Vec::new(),
        cameras: Vec::new(),
        environment: Environment { panorama: Panorama::from_fn(1024, 512, stripe), rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

/// The sky through `fragment`, looking at −X: red.
fn sky(gpu: &Arc<Gpu>, renderer: &Renderer, inputs: &FrameInputs<'_>, fragment: &str) -> Vec<f32> {
    let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC;
    let picture = Image::new(gpu, "sky", ImageDesc::flat(Format::R32G32B32A32_SFLOAT, SIZE, usage)).unwrap();
    let desc = GraphicsDesc {
        name: "sky",
        vertex: "sky.vert",
        fragment: Some(fragment),
        constants: &[(constant::LINEAR_OUTPUT, 1)],
        sets: &renderer.layouts.drawing(),
        colours: &[Format::R32G32B32A32_SFLOAT],
        ..GraphicsDesc::default()
    };
    let pipeline = Pipeline::graphics(gpu, &desc).unwrap();
    let mut ring = FrameRing::new(gpu, FRAME_BYTES).unwrap();
    let mut frame = ring.begin().unwrap();
    let block = frame.push(&inputs.block(renderer.scene.constants())).unwrap();
    let set = FrameSet { set: frame.set, block };
    frame.commands.prepare_fresh(&picture, ImageAccess::Colour);
    let colours = &[ColourAttachment::cleared(picture.attachment(), [0.0; 4])];
    frame.commands.render(&Attachments { colours, depth: None, area: SIZE }, |commands| {
        set.bind(commands, &pipeline, 0);
        commands.bind_set(&pipeline, 1, &renderer.scene.set, &[]);
        commands.draw(3, 1);
    });
    frame.submit(None).unwrap();
    ring.finish_all().unwrap();
    let texels: Vec<[f32; 4]> =
        bytemuck::pod_collect_to_vec(&read_image(gpu, &picture, Subresource { mip: 0, layer: 0 }, 16).unwrap());
    texels.iter().map(|t| t[0]).collect()
}

/// How much a column varies: of stripes of 0 and 1, a half; of their mean, nothing.
fn contrast(picture: &[f32], column: u32) -> f32 {
    let values: Vec<f32> = picture.iter().skip(column as usize).step_by(SIZE[0] as usize).copied().collect();
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()
}

/// Least contrast of the columns around the seam, and of those far from it.
fn least(picture: &[f32]) -> [f32; 2] {
    let least = |columns: std::ops::Range<u32>| columns.map(|c| contrast(picture, c)).fold(1.0, f32::min);
    [least(28..36), least(0..24)]
}

#[test]
fn the_seam_of_the_panorama_is_as_sharp_as_the_rest() {
    with_gpu(|gpu| {
        let (scene, settings) =
            (scene(), RenderSettings { cube_size: 16, light: LightModel::Direct, ..RenderSettings::default() });
        let renderer = Renderer::new(&Context::silent(gpu), &scene, settings, [16, 16], 1).unwrap();
        // A pixel of 0.008 off, so that the seam runs through the middle of those 2×2 that derivatives are taken over.
        let eyes = [Eye::looking(Vec3::ZERO, Vec3::new(-1.0, 0.05, 0.009), 30.0, 1.0)];
        let inputs = FrameInputs::of(&scene, &eyes);
        let [ours, naive] =
            ["sky.frag", "test_naive_sky.frag"].map(|fragment| least(&sky(gpu, &renderer, &inputs, fragment)));
        println!("contrast at the seam and elsewhere: {ours:?}, with the sampler's own level {naive:?}");
        assert!(ours[0] > 0.9 * ours[1] && ours[1] > 0.3, "{ours:?}");
        assert!(naive[0] < 0.1 * naive[1], "implicit levels no longer fail at the seam: {naive:?}");
    });
}
