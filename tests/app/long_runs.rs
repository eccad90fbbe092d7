//! Long runs: windows of thousands of sizes and scenes, and many bakes of one process, whose memory, open files, threads and
//! mappings stay flat.

use std::fs;
use std::process::Command;
use std::time::Duration;

use pbr_vr::context::Setup;
use pbr_vr::gpu::GpuOptions;
use pbr_vr::view::{BakeRequest, bake};

use crate::common::held::{Held, ONE_HEAP, assert_flat, length};
use crate::common::{Workshop, material, setup, sphere};
use crate::desktop::{Display, ESCAPE, FileManager, Hands, P, Program, command, random};
use crate::window::{assert_clean, small_scene};

/// Lengths of long runs, if not the ordinary ones.
const RESIZES_VARIABLE: &str = "PBR_VR_LONG_RUN_RESIZES";
const RESIZES: u64 = 150;
const SCENES_VARIABLE: &str = "PBR_VR_LONG_RUN_SCENES";
const SCENES: u64 = 90;
const BAKES_VARIABLE: &str = "PBR_VR_LONG_RUN_BAKES";
const BAKES: u64 = 30;

/// The scene in a window, without baked light.
fn start(display: &Display, workshop: &Workshop) -> Program {
    let mut command = command(workshop.folder.path());
    command.args(["view", "scene.toml", "--on", "window", "--validate", "--light", "direct"]).envs(ONE_HEAP);
    Program::spawn(display, command)
}

/// A file written by the program in this window, and removed again: everything asked for before has been done by then.
fn screenshot(program: &mut Program, hands: &Hands, workshop: &Workshop) {
    hands.press(&[P]);
    program.wait_for("pbr-vr-1.png");
    fs::remove_file(workshop.path("pbr-vr-1.png")).expect("a screenshot");
}

#[test]
fn a_window_of_many_sizes_holds_no_more_than_of_a_few() {
    let Some(display) = Display::start() else { return };
    let resizes = length(RESIZES_VARIABLE, RESIZES);
    let (workshop, _) = small_scene();
    let mut program = start(&display, &workshop);
    program.wait_for("window");
    let hands = Hands::on(&display);
    let mut random = random();
    let (mut samples, mut done) = (Vec::new(), 0);
    while done < resizes {
        for i in 0..9 {
            let [width, height] = [1 + random(320), 1 + random(240)];
            hands.resize(match i {
                3 => [1, height],
                6 => [width, 1],
                _ => [width, height],
            });
            // Sometimes several resizes to a frame, sometimes several frames to a resize.
            std::thread::sleep(Duration::from_millis(u64::from(random(20))));
        }
        // What is held is compared at one size.
        hands.resize([160, 120]);
        screenshot(&mut program, &hands, &workshop);
        done += 10;
        samples.extend(Held::by(program.id(), done));
    }
    hands.press(&[ESCAPE]);
    assert_clean(program.end());
    // 0.4 kB of each stay, 0.3 without validation; a window of a mean size is 75 kB.
    assert_flat("resizes", &samples, done, 2.0);
}

#[test]
fn a_window_of_many_scenes_holds_no_more_than_of_a_few() {
    let Some(display) = Display::start() else { return };
    let scenes = length(SCENES_VARIABLE, SCENES);
    let (workshop, _) = small_scene();
    workshop.write("red.mtl", &material([0.9, 0.05, 0.05], 0.0, 0.6));
    workshop.write("red.obj", &sphere("red.mtl"));
    workshop.write("red.toml", "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"red.obj\"\n");
    workshop.panorama("night.exr", 64, |_| [0.001, 0.001, 0.01]);
    // Broken in its own text, in its model, and in its texels.
    workshop.write("broken.toml", "environment = 3\n");
    workshop.write("none.toml", "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"none.obj\"\n");
    workshop.write("broken.hdr", "#?RADIANCE\n");
    let mut program = start(&display, &workshop);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.resize([160, 120]);
    let files = FileManager::new(&hands);
    let (mut samples, mut done) = (Vec::new(), 0);
    while done < scenes {
        for name in ["red.toml", "broken.toml", "night.exr", "none.toml", "broken.hdr", "scene.toml"] {
            let before = program.complaints();
            files.drop(&workshop.path(name));
            let goes_on = program.until_from(before, name, |errors| errors.lines().count());
            assert!(goes_on, "{name}: {}", program.errors());
            done += 1;
        }
        screenshot(&mut program, &hands, &workshop);
        samples.extend(Held::by(program.id(), done));
    }
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
    for name in ["broken.toml", "none.obj", "broken.hdr"] {
        assert_eq!(errors.lines().filter(|line| line.contains(name)).count() as u64, done / 6, "{name}: {errors}");
    }
    // The layer keeps some 30 kB of each; without it nothing grows. A ball is 1.5 MB.
    assert_flat("scene changes", &samples, done, 100.0);
}

#[test]
fn many_bakes_of_a_process_hold_no_more_than_a_few() {
    // In a process of its own, because the tests beside it take memory, too.
    let output = Command::new(std::env::current_exe().expect("this test"))
        .args(["long_runs::bakes", "--exact", "--ignored", "--nocapture"])
        .envs(ONE_HEAP)
        .output()
        .expect("the bakes");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, errors) = (text(&output.stdout), text(&output.stderr));
    println!("{out}");
    assert!(output.status.success() && out.contains("1 passed"), "{out}{errors}");
}

#[test]
#[ignore = "the test above starts it in a process of its own"]
fn bakes() {
    let bakes = length(BAKES_VARIABLE, BAKES);
    let shop = Workshop::new();
    let input = shop.sky(3.0);
    let request = BakeRequest { input, output: shop.path("baked"), size: 16, json: None };
    let mut samples = Vec::new();
    for done in 1..=bakes {
        // Without validation: Debian's layer, 1.3.239, keeps some 40 kB of each device that was opened and closed.
        let facts = bake(&request, &Setup::silent(GpuOptions::default())).expect("a bake");
        assert_eq!(facts.files.len(), 3);
        samples.extend(Held::by(std::process::id(), done));
    }
    bake(&request, &setup(None)).expect("baking without validation messages");
    // Mesa 22.3's lavapipe keeps 1 kB of each device, among it names of descriptor sets, and the heap gets holes: 5 kB in all. The
    // smallest of a bake's maps is 48 kB.
    assert_flat("bakes", &samples, bakes, 12.0);
}
