//! Many frames on a headset, also with other scenes among them: memory, open files, threads and mappings stay flat, and nothing
//! is left at the end.

use std::fs;
use std::path::Path;
use std::time::Duration;

use headset_runtime::script::{Script, Waypoint};

use crate::common::headset::{Headset, command, finish};
use crate::common::held::{Held, ONE_HEAP, assert_flat, length};
use crate::common::{Workshop, material, sphere};
use crate::desktop::{Display, ESCAPE, Hands, L, PAGE_DOWN, Program};

/// Frames of the long run, if not the default.
const FRAMES_VARIABLE: &str = "PBR_VR_LONG_RUN_FRAMES";
const FRAMES: u64 = 10_000;
const FRAMES_OF_CHANGES: u64 = 500;
/// So many changes are enough for medians.
const LEAST_CHANGES: u64 = 90;

#[test]
fn a_long_run_keeps_memory_and_descriptors_flat_and_leaks_nothing() {
    let frames = length(FRAMES_VARIABLE, FRAMES);
    let workshop = Workshop::new();
    workshop.sky(0.0);
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    workshop.write("ball.obj", &sphere("gold.mtl"));
    workshop.write("scene.toml", "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"ball.obj\"\n");
    let turn = |frame, yaw| Waypoint { frame, position: [0.0, 1.6, 0.0], rotation_degrees: [yaw, 0.0, 0.0] };
    let script = Script { size: [16, 16], hz: 0.1, head: vec![turn(1, 0.0), turn(frames, 720.0)], ..Script::default() };
    let headset = Headset::install(workshop.folder.path(), &script);
    let arguments = ["view", "scene.toml", "--on", "headset", "--frames", &frames.to_string()];
    let mut child = headset.start(workshop.folder.path(), &arguments);
    let mut samples = Vec::new();
    while child.try_wait().expect("a child").is_none() {
        samples.extend(Held::by(child.id(), headset.frame()));
        std::thread::sleep(Duration::from_millis(50));
    }
    finish(child).assert_clean();

    let done = headset.calls_of("CleanupDone");
    assert_eq!(done.last().expect("a shutdown")["copied"], 2 * frames);
    assert_flat("frames", &samples, frames, 0.0);
}

#[test]
fn scenes_and_panoramas_that_change_on_the_headset_leave_nothing_behind() {
    let Some(display) = Display::start() else { return };
    let frames = length(FRAMES_VARIABLE, FRAMES_OF_CHANGES);
    let workshop = Workshop::new();
    let folder = workshop.folder.path();
    let assets = workshop.path("assets");
    fill_playlist(&assets);
    let script = Script { size: [16, 16], hz: 0.1, ..Script::default() };
    let headset = Headset::install(folder, &script);
    let first = assets.join("scenes/demo.toml");
    let first = first.to_str().expect("a name");
    let mut command = command(folder, &["view", first, "--on", "headset", "--light", "direct", "--validate"]);
    command.envs(headset.environment()).env("PBR_VR_ASSETS", &assets).envs(ONE_HEAP);
    let mut program = Program::spawn(&display, command);
    program.wait_for("headset");
    let hands = Hands::on(&display);
    hands.resize([64, 64]);
    let (mut samples, mut changes) = (Vec::new(), 0);
    while headset.frame() < frames || changes < LEAST_CHANGES {
        // Of three scenes and three panoramas one each is broken; medians are taken over all of them.
        for (key, answer) in [(PAGE_DOWN, "showing"), (L, "lit by")] {
            let before = program.complaints();
            hands.press(&[key]);
            let goes_on = program.until_from(before, answer, |errors| errors.lines().count());
            assert!(goes_on, "{}", program.errors());
            changes += 1;
        }
        samples.extend(Held::by(program.id(), changes));
    }
    println!("{changes} changes in {} frames", headset.frame());
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
    let told = |name: &str| errors.lines().filter(|line| line.contains(name)).count() as u64;
    assert!(told("broken.obj") >= changes / 12 && told("broken.hdr") >= changes / 12, "{changes} changes: {errors}");
    // Most of what stays is the layer's, some 30 kB of each. A ball is 1.5 MB.
    assert_flat("changes", &samples, changes, 100.0);
}

/// Small files for the keys that step through scenes and panoramas.
fn fill_playlist(assets: &Path) {
    let shop = Workshop::new();
    shop.sky(0.0);
    shop.panorama("night.exr", 64, |_| [0.01, 0.01, 0.02]);
    shop.write("broken.hdr", "#?RADIANCE\n");
    shop.write("broken.obj", "f 1 2 3\n");
    for (name, color) in [("ball", [1.0, 0.8, 0.3]), ("red", [0.9, 0.1, 0.1])] {
        shop.write(&format!("{name}.mtl"), &material(color, 1.0, 0.3));
        shop.write(&format!("{name}.obj"), &sphere(&format!("{name}.mtl")));
    }
    for (folder, names) in [
        ("panoramas", &["sky.exr", "night.exr", "broken.hdr"][..]),
        ("scenes", &["ball.mtl", "ball.obj", "red.mtl", "red.obj", "broken.obj"]),
    ] {
        fs::create_dir_all(assets.join(folder)).expect("a folder");
        for name in names {
            fs::copy(shop.path(name), assets.join(folder).join(name)).expect("a copy");
        }
    }
    for (name, model) in [("broken", "broken"), ("demo", "ball"), ("red", "red")] {
        let text =
            format!("environment = {{ panorama = \"../panoramas/sky.exr\" }}\n[[model]]\nfile = \"{model}.obj\"\n");
        fs::write(assets.join("scenes").join(format!("{name}.toml")), text).expect("a scene");
    }
}
