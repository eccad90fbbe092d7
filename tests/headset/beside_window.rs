//! The headset beside a desktop: its mirror window, keys in it, and the window as the way out when the headset vanishes.

use headset_runtime::script::{Presence, Script, Waypoint};

use crate::common::headset::{Headset, command};
use crate::common::room::{Room, SIZE, patient};
use crate::desktop::{Display, ESCAPE, Hands, M, Program};

fn start(display: &Display, room: &Room, arguments: &[&str]) -> Program {
    let mut command = command(
        room.workshop.0.path(),
        &[&["view", "scene.toml", "--light", "direct", "--validate"], arguments].concat(),
    );
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
    // Both eyes side by side across the window, in their own shape.
    let pixels = hands.look([1280, 720]);
    let (width, height) = (1280, 1280 / 2 * SIZE[1] as usize / SIZE[0] as usize);
    let at = |x: usize, y: usize| pixels[((720 - height) / 2 + y) * width + x].to_be_bytes();
    // The left one has text over it.
    let shown = room.shown(20, 1);
    let mut error = 0.0;
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let [right, down] = [x, y].map(|at| ((at as f32 + 0.5) * 640.0 / SIZE[0] as f32) as usize);
        let (mirrored, wanted) = (at(640 + right, down), shown.pixels[(y * SIZE[0] + x) as usize]);
        error += (0..3).map(|c| (f32::from(mirrored[c + 1]) / 255.0 - wanted[c]).abs()).sum::<f32>();
    }
    let mean = error / (3 * SIZE[0] * SIZE[1]) as f32;
    assert!(mean < 0.02, "the mirror is off by {mean}");
    let white = (0..640).flat_map(|x| (0..height).map(move |y| (x, y))).filter(|(x, y)| at(*x, *y)[1..] == [255; 3]);
    assert!(white.count() > 200, "no text beside the eye");
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
fn a_desktop_that_dies_takes_the_program_along_at_once() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let mut program = start(&display, &room, &["--on", "headset"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 30);
    let dies = std::time::Instant::now();
    drop(display);
    // Xlib ends every program whose server is gone, unless winit notices first; the headset's runtime sees the process go.
    let (code, errors) = program.end();
    assert_eq!(code, Some(1), "{errors}");
    assert!(!errors.contains("panicked"), "{errors}");
    assert!(dies.elapsed().as_secs() < 30, "after {:?}", dies.elapsed());
}

#[test]
fn a_mirror_that_is_closed_ends_the_session() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let mut program = start(&display, &room, &["--on", "headset", "--report", "report.json"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 30);
    Hands::on(&display).close();
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
    assert_shut_down(&room.headset);
    let mode = room.run_report()["present_mode"].clone();
    assert!(mode == "mailbox" || mode == "immediate", "the mirror waits for the display: {mode}");
}

#[test]
fn a_headset_that_vanishes_hands_over_to_the_window() {
    let Some(display) = Display::start() else { return };
    let lost = Presence { frame: 40, connected: false };
    let room = Room::with(Script { headset: vec![lost], ..patient() });
    let mut program = start(&display, &room, &["--on", "auto", "--report", "report.json"]);
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
    // The headset no longer sets the pace: the display does.
    assert_eq!(room.run_report()["present_mode"], "vsync");
}

#[test]
fn a_headset_that_vanishes_without_a_desktop_ends_the_program_in_words() {
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
