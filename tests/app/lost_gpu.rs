//! A GPU that is lost while its window is open.

use std::time::Duration;

use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;

use crate::common::fault::FaultLayer;
use crate::common::json;
use crate::desktop::{BRACKET_RIGHT, Display, ESCAPE, H, Hands, L, P, PERIOD, Program, command};
use crate::window::{assert_clean, small_scene};

#[test]
fn a_lost_gpu_is_opened_again_with_all_that_was_changed_and_once_a_minute_only() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.panorama("night.exr", 64, |[x, _, _]| [0.1 + 0.1 * x as f32, 0.1, 0.2]);
    let layer = FaultLayer::install(workshop.folder.path());
    let mut command = command(workshop.folder.path());
    let flags = ["--on", "window", "--light", "open", "--validate", "--report", "report.json"];
    command.args(["view", "scene.toml"]).args(flags).envs(layer.environment());
    let mut program = Program::spawn(&display, command);
    program.wait_for("window");
    let hands = Hands::on(&display);
    let shot = |program: &mut Program, number: u32| {
        let file = format!("pbr-vr-{number}.png");
        hands.press(&[P]);
        program.wait_for(&file);
        Picture::read(&workshop.path(&file)).expect("a picture")
    };
    let first = shot(&mut program, 1);
    // The next panorama is that of the scene's folder; the dot turns it, the right bracket makes it brighter.
    hands.press(&[L]);
    program.wait_for("lit by ");
    [PERIOD, PERIOD, BRACKET_RIGHT, BRACKET_RIGHT].iter().for_each(|key| hands.press(&[*key]));
    hands.point([400.0, 300.0]);
    hands.button(true);
    std::thread::sleep(Duration::from_millis(300));
    hands.point([500.0, 330.0]);
    std::thread::sleep(Duration::from_millis(300));
    hands.button(false);
    let changed = shot(&mut program, 2);
    let flip = |a: &Picture, b: &Picture| compare(a, b).expect("two pictures of one size").flip_mean;
    assert!(flip(&first, &changed) > 0.01);

    // To hide the panel, a frame is drawn and shown.
    layer.lose_in("vkQueuePresentKHR");
    hands.press(&[H]);
    layer.wait();
    let again = shot(&mut program, 3);
    assert!(flip(&changed, &again) < 1e-6, "FLIP {}", flip(&changed, &again));
    assert_eq!(program.errors().lines().count(), 1, "{}", program.errors());

    layer.lose_in("vkQueueSubmit2");
    hands.press(&[H]);
    layer.wait();
    let (code, errors) = program.end();
    assert_eq!((code, errors.lines().count()), (Some(1), 2), "{errors}");
    assert!(json(&workshop.path("report.json"))["frames"].as_u64() > Some(3));
}

#[test]
fn a_gpu_that_is_lost_while_the_first_scene_is_loaded_is_opened_again() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let layer = FaultLayer::install(workshop.folder.path());
    let mut command = command(workshop.folder.path());
    let flags = ["--on", "window", "--light", "open", "--validate"];
    command.args(["view", "scene.toml"]).args(flags).envs(layer.environment());
    layer.lose_in("vkQueuePresentKHR");
    let mut program = Program::spawn(&display, command);
    layer.wait();
    program.wait_for("window");
    Hands::on(&display).press(&[ESCAPE]);
    let ended = program.end();
    assert_eq!(ended.1.lines().count(), 1, "{}", ended.1);
    assert_clean(ended);
}
