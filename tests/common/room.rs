//! A room seen through the simulated headset: a small scene, the program run in it, and what a renderer draws for the same eyes.

use std::path::{Path, PathBuf};

use glam::{Affine3A, EulerRot, Mat4, Quat, Vec3};
use headset_runtime::script::{EyeOptics, Script, Waypoint};
use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;
use pbr_vr::gpu::{Subresource, read_image};
use pbr_vr::render::{Eye, FrameInputs, LightModel, NEAR_METRES, RenderSettings, Renderer};
use pbr_vr::scene::load::{LoadOptions, load};
use serde_json::Value;

use super::headset::{Headset, Ran};
use super::stage::draw_frame;
use super::{Workshop, json, material, setup, sphere, square};

/// Pixels of an eye's image.
pub const SIZE: [u32; 2] = [128, 96];
/// The scene's camera: where the head is when it stands at the standing space's origin, this high.
pub const HEAD_HEIGHT: f32 = 1.6;
const CAMERA_Z: f32 = 2.5;
/// Two pictures of the same: FLIP's mean.
const SAME: f32 = 0.001;

/// A scene and a headset in a folder.
pub struct Room {
    pub workshop: Workshop,
    pub headset: Headset,
    script: Script,
}

/// A script whose display leaves all the time that is needed, so that quality never changes.
pub fn patient() -> Script {
    Script { size: SIZE, hz: 0.1, ..Script::default() }
}

/// A head at rest or on its way.
pub fn head(frame: u64, offset: [f32; 3], rotation_degrees: [f32; 3]) -> Waypoint {
    let [x, y, z] = offset;
    Waypoint { frame, position: [x, HEAD_HEIGHT + y, z], rotation_degrees }
}

impl Room {
    /// Balls of two colours above a floor at height 0 in a sky that looks different everywhere.
    pub fn with(script: Script) -> Self {
        let workshop = Workshop::new();
        workshop.sky(0.0);
        for (name, color, metallic, place) in
            [("gold", [1.0, 0.8, 0.3], 1.0, [0.6, 1.3, 0.0]), ("red", [0.9, 0.05, 0.05], 0.0, [-0.9, 2.1, -1.0])]
        {
            workshop.write(&format!("{name}.mtl"), &material(color, metallic, 0.3));
            workshop.write(&format!("{name}.obj"), &sphere(&format!("{name}.mtl")));
            workshop.write(
                &format!("{name}.part"),
                &format!("[[model]]\nfile = \"{name}.obj\"\ntranslation = {place:?}\nscale = 0.5\n"),
            );
        }
        workshop.write("grey.mtl", &material([0.4, 0.4, 0.45], 0.0, 0.8));
        workshop.write("floor.obj", &square("grey.mtl"));
        let floor = "[[model]]\nfile = \"floor.obj\"\nrotation_degrees = [-90, 0, 0]\nscale = 14.0\n";
        let part = |name: &str| std::fs::read_to_string(workshop.path(name)).expect("a part");
        let camera = format!(
            "[[camera]]\nname = \"front\"\nposition = [0, {HEAD_HEIGHT}, {CAMERA_Z}]\ntarget = [0, {HEAD_HEIGHT}, 0]\n\
             vertical_fov_degrees = 60\n"
        );
        let environment = "environment = { panorama = \"sky.exr\" }\n";
        workshop.write("scene.toml", &format!("{environment}{}{}{floor}{camera}", part("gold.part"), part("red.part")));
        let headset = Headset::install(workshop.folder.path(), &script);
        Self { workshop, headset, script }
    }

    /// The scene on the headset for so many frames.
    pub fn view(&self, frames: u64) -> Ran {
        self.view_with(&["--frames", &frames.to_string()])
    }

    pub fn view_with(&self, more: &[&str]) -> Ran {
        let arguments = ["view", "scene.toml", "--on", "headset", "--report", "report.json", "--light", "direct"];
        self.headset.run(self.workshop.folder.path(), &[&arguments, more].concat())
    }

    /// What the program itself says of its time in the headset.
    pub fn report(&self) -> Value {
        self.run_report()["headset"].clone()
    }

    /// The same with what is not the headset's.
    pub fn run_report(&self) -> Value {
        json(&self.workshop.path("report.json"))
    }

    pub fn scene(&self) -> PathBuf {
        self.workshop.path("scene.toml")
    }

    /// What an eye was shown.
    pub fn shown(&self, frame: u64, eye: usize) -> Picture {
        Picture::read(&self.headset.picture(frame, ["left", "right"][eye])).expect("what an eye was shown")
    }

    /// Both eyes with the script's head at a place.
    pub fn eyes(&self, place: &Waypoint) -> [Eye; 2] {
        self.eyes_with(place, [&self.script.left, &self.script.right])
    }

    /// Both eyes with optics of their own.
    pub fn eyes_with(&self, place: &Waypoint, optics: [&EyeOptics; 2]) -> [Eye; 2] {
        let world_from_standing = Affine3A::from_translation(Vec3::new(0.0, 0.0, CAMERA_Z));
        let world_from_head = world_from_standing * rigid(place.position, place.rotation_degrees);
        optics.map(|eye| {
            let [left, right, down, up] = eye.tangents;
            let world_from_view = Mat4::from(world_from_head * rigid(eye.position, eye.rotation_degrees));
            Eye { world_from_view, left, right, down, up, near_metres: NEAR_METRES }
        })
    }

    /// What a renderer draws for these eyes.
    pub fn drawn(&self, eyes: &[Eye; 2]) -> [Picture; 2] {
        self.drawn_at(eyes, self.script.size)
    }

    pub fn drawn_at(&self, eyes: &[Eye; 2], size: [u32; 2]) -> [Picture; 2] {
        draw(&self.scene(), eyes, size)
    }

    /// The eyes were shown in a frame what is drawn with the head at a place.
    pub fn assert_shows(&self, frame: u64, place: &Waypoint) {
        self.assert_shows_eyes(frame, &self.eyes(place));
    }

    pub fn assert_shows_eyes(&self, frame: u64, eyes: &[Eye; 2]) {
        let drawn = self.drawn(eyes);
        for (eye, drawn) in drawn.iter().enumerate() {
            assert_same(&self.shown(frame, eye), drawn, &format!("frame {frame}, eye {eye}"));
        }
        assert_different(&drawn[0], &drawn[1], "the two eyes");
    }
}

/// A rigid transform from a place and yaw, pitch and roll.
fn rigid(position: [f32; 3], rotation_degrees: [f32; 3]) -> Affine3A {
    let [yaw, pitch, roll] = rotation_degrees.map(f32::to_radians);
    Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll), position.into())
}

fn draw(scene: &Path, eyes: &[Eye; 2], size: [u32; 2]) -> [Picture; 2] {
    let context = setup(None).open().expect("a GPU");
    let messages = context.gpu.messages();
    let settings = RenderSettings { light: LightModel::Direct, ..RenderSettings::default() };
    let options = LoadOptions { textures: settings.textures.options(&context), ..LoadOptions::default() };
    let scene = load(scene, &options, &context.report).expect("a scene");
    let mut renderer = Renderer::new(&context, &scene, settings, size, 2).expect("a renderer");
    draw_frame(&context.gpu, &mut renderer, &FrameInputs::of(&scene, eyes));
    let pictures = [0, 1].map(|layer| {
        let bytes = read_image(&context.gpu, renderer.picture(), Subresource { mip: 0, layer }, 4).expect("a picture");
        Picture::from_srgb8("drawn", size[0], size[1], &bytes)
    });
    drop((renderer, context));
    messages.check().expect("no validation message");
    pictures
}

pub fn assert_same(a: &Picture, b: &Picture, what: &str) {
    let difference = compare(a, b).expect("two pictures of one size");
    println!("{what}: FLIP {}", difference.flip_mean);
    assert!(difference.flip_mean <= SAME, "{what}: {difference:?}");
}

pub fn assert_different(a: &Picture, b: &Picture, what: &str) {
    let difference = compare(a, b).expect("two pictures of one size");
    assert!(difference.flip_mean > 5.0 * SAME, "{what} look alike: {difference:?}");
}
