//! The headset beside a desktop: its mirror window, keys in it, and the window as the way out when the headset vanishes.
#![cfg(target_os = "linux")]

mod common;
mod desktop;

use headset_runtime::script::{Presence, Script, Waypoint};

use common::headset::{Headset, command};
use common::room::{Room, patient};
use desktop::{Display, ESCAPE, Hands, M, Program};

fn start(display: &Display, room: &Room, arguments: &[&str]) -> Program {
    let mut command = command(room.workshop.0.path(), &[&["view", "scene.toml", "--validate"], arguments].concat());
    command.envs(room.headset.environment());
    Program::spawn(display, command)
}

/// Waits until the headset has come to a frame.
fn wait_for_frame(headset: &Headset, frame: u64) {
    for _ in 0..1800 {
        if headset.frame() >= frame {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    panic!("the headset stays in frame {}", headset.frame());
}

fn assert_shut_down(headset: &Headset) {
    assert_eq!(headset.calls().last().expect("a call")["call"], "CleanupDone");
}

#[test]
fn a_window_mirrors_the_headset_and_its_keys_work() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(Script { show: vec![20], ..patient() });
    let mut program = start(&display, &room, &["--on", "headset"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 30);
    let hands = Hands::on(&display);
    let colors = |pixels: Vec<u32>| pixels.into_iter().collect::<std::collections::HashSet<u32>>().len();
    let many = colors(hands.look([200, 120]));
    assert!(many > 100, "only {many} colours in the mirror");
    // Another shading, and the end.
    let before = room.headset.frame();
    hands.press(&[M]);
    wait_for_frame(&room.headset, before + 30);
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
    assert_shut_down(&room.headset);
}

#[test]
fn a_desktop_that_dies_does_not_stop_the_headset() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let mut program = start(&display, &room, &["--on", "headset", "--frames", "600"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 30);
    drop(display);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert_shut_down(&room.headset);
    assert_eq!(room.headset.frame(), 600);
}

#[test]
fn a_headset_that_vanishes_hands_over_to_the_window() {
    let Some(display) = Display::start() else { return };
    let lost = Presence { frame: 40, connected: false };
    let room = Room::with(Script { headset: vec![lost], ..patient() });
    let mut program = start(&display, &room, &["--on", "auto"]);
    program.wait_for("headset");
    program.wait_for("window");
    let calls = room.headset.calls();
    let ms = |call: &serde_json::Value| call["ms"].as_f64().expect("a time");
    let told = calls.iter().find(|c| c["call"] == "PollNextEvent" && c["event"] == 101).expect("the event");
    let done = calls.iter().rfind(|c| c["call"] == "CleanupDone").expect("a shutdown");
    assert!(ms(done) - ms(told) < 1000.0, "{} ms until the headset is let go", ms(done) - ms(told));
    let hands = Hands::on(&display);
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
}

#[test]
fn a_headset_that_vanishes_for_a_moment_is_not_given_up_without_a_desktop() {
    let room = Room::with(Script {
        headset: vec![Presence { frame: 5, connected: false }],
        head: vec![Waypoint { frame: 1, position: [0.0, 1.6, 0.0], rotation_degrees: [0.0; 3] }],
        ..patient()
    });
    // Without a display there is nothing to fall back to: it says so and ends.
    let ran = room.view_with(&[]);
    ran.assert_fails_with(&["headset"]);
    assert_shut_down(&room.headset);
}
