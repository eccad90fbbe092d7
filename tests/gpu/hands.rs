//! What hands do in the picture: wands, arc and landing ring where they belong, in both eyes, behind what hides them and in
//! their own colours; models that are moved.

use std::path::Path;
use std::sync::Arc;

use glam::{EulerRot, Mat4, Quat, Vec3};

use crate::common::setup;
use crate::common::stage::draw_frame;
use pbr_vr::asset::{Report, Storage, TextureOptions};
use pbr_vr::gpu::{Gpu, Subresource, read_image};
use pbr_vr::render::{
    ControllerGizmos, Eye, FrameInputs, IPD_METRES, LightModel, Output, RenderSettings, Renderer, Shading,
};
use pbr_vr::scene::{Scene, load};

const SIZE: [u32; 2] = [480, 400];
const ORANGE: Vec3 = Vec3::new(0.9, 0.35, 0.05);
const CYAN: Vec3 = Vec3::new(0.05, 0.7, 0.9);
const LANDING: Vec3 = Vec3::new(-0.9, 0.0, 0.0);

/// The shipped room.
fn room() -> Scene {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let options = load::LoadOptions {
        textures: TextureOptions { storage: Storage::Raw, ..TextureOptions::default() },
        ..load::LoadOptions::default()
    };
    load::load(&assets.join("scenes/tearoom.toml"), &options, &Report::silent()).expect("the shipped room")
}

fn eyes(scene: &Scene) -> [Eye; 2] {
    let camera = scene.cameras.iter().find(|c| c.name == "room").expect("the camera `room`");
    Eye::of_camera(camera, SIZE[0] as f32 / SIZE[1] as f32).stereo(IPD_METRES)
}

/// A renderer of the room for two eyes, and its frames.
struct Drawing {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    scene: Scene,
}

impl Drawing {
    /// Of the room, with a stop and a half of exposure.
    fn inputs<'a>(&self, eyes: &'a [Eye], gizmos: Option<&'a ControllerGizmos>) -> FrameInputs<'a> {
        FrameInputs { exposure_ev: 1.5, gizmos, ..FrameInputs::of(&self.scene, eyes) }
    }

    /// Both eyes' layers after one frame.
    fn layers(&mut self, inputs: &FrameInputs<'_>) -> [Vec<u8>; 2] {
        draw_frame(&self.gpu, &mut self.renderer, inputs);
        let bytes = self.renderer.settings().output.bytes();
        let layer = |layer| read_image(&self.gpu, self.renderer.picture(), Subresource { mip: 0, layer }, bytes);
        [0, 1].map(|i| layer(i).expect("a layer"))
    }
}

/// Has `work` draw the room for two eyes; any validation message fails.
fn with_drawing(settings: RenderSettings, work: impl FnOnce(&mut Drawing, &[Eye; 2])) {
    let context = setup(None).open().expect("a GPU");
    let messages = context.gpu.messages();
    let scene = room();
    let renderer = Renderer::new(&context, &scene, settings, SIZE, 2).expect("a renderer");
    let eyes = eyes(&scene);
    let mut drawing = Drawing { gpu: Arc::clone(&context.gpu), renderer, scene };
    work(&mut drawing, &eyes);
    drop((drawing, context));
    messages.check().expect("no validation messages");
}

/// A hand over the floor that points at it, its arc and the ring where the arc ends.
fn pointing() -> (ControllerGizmos, Mat4, Vec<Vec3>) {
    let mut gizmos = ControllerGizmos::default();
    let turn = Quat::from_euler(EulerRot::YXZ, -0.42, 0.1, 0.0);
    let hand = Mat4::from_rotation_translation(turn, Vec3::new(-1.35, 1.25, 1.0));
    let start = hand.w_axis.truncate();
    let bend = Vec3::Y * 0.6;
    let arc = (0..33u8).map(|i| f32::from(i) / 32.0);
    let arc: Vec<Vec3> = arc.map(|t| start.lerp(LANDING, t) + bend * (4.0 * t * (1.0 - t))).collect();
    gizmos.wand(&hand, ORANGE);
    gizmos.ribbon(&arc, CYAN);
    gizmos.ring(LANDING, CYAN);
    (gizmos, hand, arc)
}

/// Byte offset of the pixel that a point of the world falls on.
fn pixel_of(eye: &Eye, world: Vec3) -> usize {
    let clip = eye.clip_from_world() * world.extend(1.0);
    let ndc = clip.truncate() / clip.w;
    let at = [0, 1].map(|i| ((ndc[i] * 0.5 + 0.5) * SIZE[i] as f32) as usize);
    assert!(at[0] < SIZE[0] as usize && at[1] < SIZE[1] as usize, "{world} is not in the picture");
    at[1] * SIZE[0] as usize + at[0]
}

fn srgb(linear: Vec3) -> [u8; 3] {
    let encode = |c: f32| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    linear.to_array().map(|c| (255.0 * encode(c)).round() as u8)
}

/// Without a lightmap, which controllers are not lit by.
fn settings() -> RenderSettings {
    RenderSettings { light: LightModel::Direct, ..RenderSettings::default() }
}

/// Middles of the ring's band: near, far, left and right.
fn on_the_ring() -> [Vec3; 4] {
    [Vec3::X, Vec3::Z, -Vec3::X, -Vec3::Z].map(|way| LANDING + 0.225 * way + 0.004 * Vec3::Y)
}

#[test]
fn both_eyes_see_arc_and_ring_where_they_are_and_in_their_colours() {
    with_drawing(settings(), |drawing, eyes| {
        let (gizmos, _, arc) = pointing();
        let pictures = drawing.layers(&drawing.inputs(eyes, Some(&gizmos)));
        for (eye, bytes) in eyes.iter().zip(&pictures) {
            for point in on_the_ring().into_iter().chain([arc[12], arc[16], arc[20]]) {
                let at = 4 * pixel_of(eye, point);
                let (got, want) = (&bytes[at..at + 3], srgb(CYAN));
                assert!((0..3).all(|c| got[c].abs_diff(want[c]) <= 2), "{point}: {got:?}, not {want:?}");
            }
        }
        let apart = pixel_of(&eyes[0], arc[16]).abs_diff(pixel_of(&eyes[1], arc[16]));
        assert!(apart > 5, "the eyes see the arc {apart} pixels apart");
    });
}

#[test]
fn linear_pictures_hold_what_the_exposure_turns_into_the_colour() {
    with_drawing(RenderSettings { output: Output::Linear, ..settings() }, |drawing, eyes| {
        let (gizmos, ..) = pointing();
        let pictures = drawing.layers(&drawing.inputs(eyes, Some(&gizmos)));
        for (eye, bytes) in eyes.iter().zip(pictures) {
            let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
            for point in on_the_ring() {
                let [r, g, b, _] = texels[pixel_of(eye, point)];
                let got = Vec3::new(r, g, b) * 1.5f32.exp2();
                assert!((got - CYAN).length() < 1e-4, "{point}: {got}");
            }
        }
    });
}

#[test]
fn what_stands_in_front_hides_them_and_each_frame_shows_its_own() {
    with_drawing(settings(), |drawing, eyes| {
        let plain = drawing.layers(&drawing.inputs(eyes, None));
        let (seen, ..) = pointing();
        // Under the floor.
        let mut hidden = ControllerGizmos::default();
        hidden.ring(LANDING - 0.2 * Vec3::Y, CYAN);
        hidden.wand(&Mat4::from_translation(LANDING - 0.3 * Vec3::Y), ORANGE);
        let shown = drawing.layers(&drawing.inputs(eyes, Some(&seen)));
        assert!(shown[0] != plain[0] && shown[1] != plain[1]);
        let under = drawing.layers(&drawing.inputs(eyes, Some(&hidden)));
        assert!(under == plain, "the floor does not hide what is under it");
        let none = drawing.layers(&drawing.inputs(eyes, Some(&ControllerGizmos::default())));
        assert!(none == plain, "an empty list shows something");
        drawing.renderer.rebuild(settings(), 2).expect("pipelines");
        let again = drawing.layers(&drawing.inputs(eyes, Some(&seen)));
        assert!(again == shown, "new pipelines draw something else");
    });
}

#[test]
fn models_that_move_look_as_from_eyes_that_move_the_other_way() {
    with_drawing(RenderSettings { shading: Shading::BaseColor, ..settings() }, |drawing, eyes| {
        let by = Mat4::from_translation(Vec3::new(0.25, -0.125, 0.5));
        let before = drawing.layers(&drawing.inputs(eyes, None));
        let moved = drawing.layers(&FrameInputs { world_from_models: by, ..drawing.inputs(eyes, None) });
        let followed = eyes.map(|eye| Eye { world_from_view: by * eye.world_from_view, ..eye });
        let with_them = drawing.layers(&FrameInputs { world_from_models: by, ..drawing.inputs(&followed, None) });
        let differing = |a: &[u8], b: &[u8]| {
            let far = |(a, b): (&[u8], &[u8])| (0..3).any(|c| a[c].abs_diff(b[c]) > 8);
            let pixels = a.chunks_exact(4).zip(b.chunks_exact(4));
            pixels.filter(|pair| far(*pair)).count() as f32 / (SIZE[0] * SIZE[1]) as f32
        };
        for eye in [0, 1] {
            let (apart, together) = (differing(&moved[eye], &before[eye]), differing(&with_them[eye], &before[eye]));
            assert!(apart > 0.2 && together < 0.005, "{apart} of the pixels move, {together} with the eyes");
        }
    });
}
