//! The window end to end: the program under its own X server, with the validation layer, driven as by a user.

use std::path::PathBuf;
use std::process::Output;
use std::time::Duration;

use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;

use crate::common::{Workshop, material, sphere};
use crate::desktop::{
    BRACKET_RIGHT, C, Display, ESCAPE, FileManager, H, Hands, M, P, PERIOD, Program, SCREEN, TAB, V, W, command, random,
};

/// A golden sphere under a simple sky, with two cameras.
pub fn small_scene() -> (Workshop, PathBuf) {
    let workshop = Workshop::new();
    workshop.panorama("sky.exr", 64, |[_, y, z]| [0.3 + 0.3 * z as f32, 0.4, 0.5 + 0.5 * y as f32]);
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    workshop.write("ball.obj", &sphere("gold.mtl"));
    let camera = |name, x| {
        format!(
            "[[camera]]\nname = \"{name}\"\nposition = [{x}, 1, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n"
        )
    };
    let model = "[[model]]\nfile = \"ball.obj\"\n";
    let text =
        format!("environment = {{ panorama = \"sky.exr\" }}\n{model}{}{}", camera("front", 0), camera("side", 3));
    let scene = workshop.write("scene.toml", &text);
    (workshop, scene)
}

pub fn assert_clean((code, errors): (Option<i32>, String)) {
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
}

#[test]
fn it_opens_draws_and_ends_after_its_frames() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.folder.path(), "scene.toml", &["--frames", "3"]);
    let line = program.wait_for("window");
    assert!(line.contains("1280x720"), "{line}");
    assert_clean(program.end());
}

#[test]
fn it_survives_resizes_hiding_and_every_key() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.folder.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    let mut random = random();
    for i in 0..200 {
        hands.resize([1 + random(320), 1 + random(240)]);
        // Sometimes several resizes to a frame, sometimes several frames to a resize.
        std::thread::sleep(Duration::from_millis(u64::from(random(12))));
        match i {
            50 => hands.resize([1, 1]),
            90 => hands.resize(SCREEN.map(u32::from)),
            120 => hands.map(false),
            140 => hands.map(true),
            _ => {}
        }
        if i % 20 == 0 {
            hands.press(&[[V, M, C, H, TAB, W, BRACKET_RIGHT, PERIOD][i / 20 % 8]]);
        }
    }
    for (n, [width, height]) in (1..).zip([[200, 100], [1, 1], SCREEN.map(u32::from), [7, 300]]) {
        hands.resize([width, height]);
        hands.press(&[P]);
        program.wait_for(&format!("pbr-vr-{n}.png"));
        let picture = Picture::read(&workshop.path(&format!("pbr-vr-{n}.png"))).expect("a picture");
        assert_eq!([picture.width, picture.height], [width, height]);
    }
    hands.press(&[ESCAPE]);
    assert_clean(program.end());
}

#[test]
fn it_rests_while_minimised_and_goes_on_afterwards() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.folder.path(), "scene.toml", &["--frames", "1000000"]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.resize([64, 64]);
    let working = program.cpu_ticks_in(Duration::from_secs(2));
    hands.minimise(true);
    std::thread::sleep(Duration::from_secs(1));
    let resting = program.cpu_ticks_in(Duration::from_secs(2));
    assert!(working >= 20 && resting <= 10, "{working} ticks of CPU time at work, {resting} at rest");
    hands.minimise(false);
    hands.press(&[P]);
    program.wait_for("pbr-vr-1.png");
    hands.press(&[ESCAPE]);
    assert_clean(program.end());
}

#[test]
fn a_screenshot_is_what_render_writes_and_keys_change_it() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.folder.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.press(&[P]);
    program.wait_for("pbr-vr-1.png");
    hands.press(&[C]);
    hands.press(&[P]);
    program.wait_for("pbr-vr-2.png");
    hands.press(&[BRACKET_RIGHT]);
    hands.press(&[P]);
    program.wait_for("pbr-vr-3.png");
    // What is on the screen carries the panel, whose ground no pixel of the scene is.
    let ground = hands.look([1280, 720]).iter().filter(|p| **p == 0x18_1818).count();
    assert!(ground > 40_000, "{ground} pixels of the panel's ground");
    hands.press(&[ESCAPE]);
    assert_clean(program.end());

    let shot = |n: u32| Picture::read(&workshop.path(&format!("pbr-vr-{n}.png"))).expect("a picture");
    let rendered = |camera: &str| {
        let file = format!("{camera}.png");
        let output = command(workshop.folder.path())
            .args(["render", "scene.toml", "-o", &file, "--size", "1280x720", "--camera", camera])
            .output()
            .expect("the program");
        assert!(output.status.success(), "{}", text(&output.stderr));
        Picture::read(&workshop.path(&file)).expect("a picture")
    };
    for (n, camera) in [(1, "front"), (2, "side")] {
        let difference = compare(&shot(n), &rendered(camera)).expect("two pictures of one size");
        assert!(difference.flip_mean < 1e-4, "{camera}: {difference:?}");
    }
    let apart = compare(&shot(1), &shot(2)).expect("two pictures of one size").flip_mean;
    assert!(apart > 1e-3, "the cameras look alike: {apart}");
    let mean = |picture: &Picture| picture.pixels.iter().flatten().map(|c| f64::from(*c)).sum::<f64>();
    assert!(mean(&shot(3)) > 1.02 * mean(&shot(2)), "a third of a stop brightens nothing");
}

#[test]
fn dropped_files_are_shown_or_refused_and_refusals_change_nothing() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.write("broken.toml", "environment = 3\n");
    workshop.write("notes.txt", "not a scene");
    workshop.write("red.mtl", &material([0.9, 0.05, 0.05], 0.0, 0.6));
    workshop.write("red.obj", &sphere("red.mtl"));
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"red.obj\"\n";
    workshop.write("red.toml", text);
    workshop.panorama("night.exr", 64, |_| [0.001, 0.001, 0.01]);
    let mut program = Program::start(&display, workshop.folder.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.resize([320, 200]);
    let files = FileManager::new(&hands);
    let shot = |n: u32, program: &mut Program| {
        hands.press(&[P]);
        program.wait_for(&format!("pbr-vr-{n}.png"));
        Picture::read(&workshop.path(&format!("pbr-vr-{n}.png"))).expect("a picture")
    };
    let before = shot(1, &mut program);
    files.drop(&workshop.path("notes.txt"));
    files.drop(&workshop.path("broken.toml"));
    // One thread does one thing after another: this screenshot is written when the broken scene has been read.
    let after = shot(2, &mut program);
    assert_eq!(before.pixels, after.pixels, "a refused file changed the picture");
    files.drop(&workshop.path("red.toml"));
    program.wait_for("red.toml");
    let red = shot(3, &mut program);
    files.drop(&workshop.path("night.exr"));
    program.wait_for("night.exr");
    let dark = shot(4, &mut program);
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(errors.contains("notes.txt") && errors.contains("broken.toml:1"), "{errors}");

    let middle = |picture: &Picture| picture.pixels[100 * 320 + 160];
    let (red, dark) = (middle(&red), middle(&dark));
    assert!(red[0] > 2.0 * red[1] && red[0] > 0.2, "not the red ball: {red:?}");
    assert!(dark.iter().sum::<f32>() < 0.5 * red.iter().sum::<f32>(), "not night: {dark:?} after {red:?}");
}

#[test]
fn without_a_display_window_fails_and_auto_writes_a_picture() {
    let (workshop, _) = small_scene();
    let run = |display: Option<&str>, on: &str| -> Output {
        let mut command = command(workshop.folder.path());
        if let Some(display) = display {
            command.env("DISPLAY", display);
        }
        command.args(["view", "scene.toml", "--on", on, "--validate"]).output().expect("the program")
    };
    // Neither no display nor one that does not answer.
    for display in [None, Some(":59999")] {
        let output = run(display, "window");
        let errors = text(&output.stderr);
        assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
        assert!(errors.starts_with("pbr-vr: ") && !errors.contains(".rs:"), "{errors}");

        let output = run(display, "auto");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains("pbr-vr.png"), "{}", text(&output.stdout));
        assert_eq!(text(&output.stdout).lines().count(), 1, "one line, and a true one: {}", text(&output.stdout));
        let picture = Picture::read(&workshop.path("pbr-vr.png")).expect("a picture");
        assert_eq!((picture.width, picture.height), (1280, 720));
        std::fs::remove_file(workshop.path("pbr-vr.png")).expect("the picture");
    }
}

#[test]
fn a_scene_that_does_not_load_is_one_line_and_no_window_is_left() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.write("broken.toml", "environment = 3\n");
    let program = Program::start(&display, workshop.folder.path(), "broken.toml", &[]);
    let (code, errors) = program.end();
    assert_eq!((code, errors.lines().count()), (Some(1), 1), "{errors}");
    assert!(errors.contains("broken.toml:1"), "{errors}");
}

fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}
