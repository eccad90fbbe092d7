//! The headset beside a desktop: its mirror window, keys in it, and the window as the way out when the headset vanishes.

use headset_runtime::script::{Presence, Script, Waypoint};

use crate::common::fault::FaultLayer;
use crate::common::headset::{Headset, command};
use crate::common::room::{Room, SIZE, head, patient};
use crate::desktop::{Display, ESCAPE, Hands, M, Program};

/// With the panel hidden, as it covers a part of the picture: then a line of numbers is over it.
fn start(display: &Display, room: &Room, arguments: &[&str]) -> Program {
    // Where `common::headset::command` has the user's settings.
    std::fs::create_dir_all(room.workshop.path("nothing/pbr-vr")).expect("a folder");
    room.workshop.write("nothing/pbr-vr/panel.json", "{ \"shown\": false }");
    let mut command = command(
        room.workshop.folder.path(),
        &[&["view", "scene.toml", "--light", "direct", "--validate"], arguments].concat(),
    );
    command.envs(room.headset.environment());
    Program::spawn(display, command)
}

#[test]
fn headset_and_mirror_go_on_after_a_lost_gpu() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let folder = room.workshop.folder.path();
    let layer = FaultLayer::install(folder);
    let flags = ["view", "scene.toml", "--light", "direct", "--validate", "--frames", "60", "--report", "report.json"];
    let mut command = command(folder, &flags);
    command.envs(room.headset.environment()).envs(layer.environment());
    let program = Program::spawn(&display, command);
    wait_for_frame(&room.headset, 10);
    layer.lose_in("vkQueueSubmit2");
    layer.wait();
    let (code, errors) = program.end();
    assert_eq!((code, errors.lines().count()), (Some(0), 1), "{errors}");
    // Frames are counted over both GPUs, the headset's own since the second start.
    let (all, since) = (room.run_report()["frames"].as_u64(), room.report()["frames"].as_u64());
    assert!(all == Some(60) && since < Some(52) && since > Some(30), "{all:?} frames, {since:?} since then");
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

/// Light grey pixels at the window's upper border: of text. The room has no grey there.
fn text(pixels: &[u32]) -> usize {
    let is_text = |pixel: &&u32| {
        let [_, rgb @ ..] = pixel.to_be_bytes();
        rgb.iter().all(|c| c.abs_diff(rgb[0]) <= 6 && (200..=245).contains(c))
    };
    pixels[..60 * 1280].iter().filter(is_text).count()
}

/// The row, in the window's lower two thirds, in which the floor's far edge crosses a column: where the picture changes most
/// from row to row.
fn edge(pixels: &[u32], x: usize) -> usize {
    let grey = |y: usize| {
        let [_, r, g, b] = pixels[y * 1280 + x].to_be_bytes().map(i32::from);
        r + g + b
    };
    (240..716).max_by_key(|y| (grey(y + 3) - grey(*y)).abs()).expect("rows")
}

/// A picture of the window for whoever looks at it, where `PBR_VR_TEST_PICTURES` names a folder.
fn keep(name: &str, pixels: &[u32]) {
    let Some(folder) = std::env::var_os("PBR_VR_TEST_PICTURES") else { return };
    let picture = image::RgbImage::from_fn(1280, 720, |x, y| {
        let [_, r, g, b] = pixels[(y * 1280 + x) as usize].to_be_bytes();
        image::Rgb([r, g, b])
    });
    picture.save(std::path::Path::new(&folder).join(name)).expect("a picture");
}

#[test]
fn those_who_watch_see_a_level_horizon_and_those_who_want_the_eye_its_own() {
    let Some(display) = Display::start() else { return };
    // Rolled to the left, after a moment in which it turns there.
    let way = [head(1, [0.0; 3], [0.0; 3]), head(5, [0.0, 0.4, 0.0], [0.0, -12.0, 15.0])];
    for (mirror, level) in [("steady", true), ("left", false)] {
        let room = Room::with(Script { head: way.to_vec(), ..patient() });
        let arguments = ["--on", "headset", "--mirror", mirror, "--report", "report.json"];
        let mut program = start(&display, &room, &arguments);
        program.wait_for("headset");
        wait_for_frame(&room.headset, 60);
        let hands = Hands::on(&display);
        let pixels = hands.look([1280, 720]);
        keep(&format!("mirror-{mirror}.png"), &pixels);
        assert!(text(&pixels) > 100, "{mirror}: no text");
        // Beside the text and the balls, and inside the picture of the eye alone.
        let [left, right] = [if level { 60 } else { 300 }, if level { 1220 } else { 980 }].map(|x| edge(&pixels, x));
        let slope = right.abs_diff(left);
        assert!(if level { slope <= 4 } else { slope > 60 }, "{mirror}: the floor ends at {left} and at {right}");
        if level {
            let black = pixels[120 * 1280..].iter().filter(|pixel| **pixel & 0xff_ff_ff == 0).count();
            assert!(black < 200, "{black} black pixels: something beyond the eye's picture");
        }
        hands.press(&[ESCAPE]);
        let (code, errors) = program.end();
        assert_eq!(code, Some(0), "{errors}");
        assert!(!errors.contains("validation"), "{errors}");
    }
}

#[test]
fn numbers_are_over_every_mirror_and_name_the_cpus_time() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let mut program = start(&display, &room, &["--on", "headset", "--mirror", "right", "--report", "report.json"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 60);
    let pixels = Hands::on(&display).look([1280, 720]);
    assert!(text(&pixels) > 100, "no text");
    // A signal ends it like Escape.
    program.signal("INT");
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert_shut_down(&room.headset);
    let report = room.run_report();
    assert!(report["rate"]["record_ms"].as_f64().is_some_and(|ms| ms > 0.01), "{}", report["rate"]);
    assert!(report["frames"].as_u64().is_some_and(|frames| frames >= 60));
}

fn assert_shut_down(headset: &Headset) {
    assert_eq!(headset.calls().last().expect("a call")["call"], "CleanupDone");
}

#[test]
fn a_window_mirrors_the_headset_and_its_keys_work() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(Script { show: vec![20], ..patient() });
    let mut program = start(&display, &room, &["--on", "headset", "--mirror", "both"]);
    program.wait_for("headset");
    wait_for_frame(&room.headset, 30);
    let hands = Hands::on(&display);
    // Both eyes side by side across the window, in their own shape.
    let pixels = hands.look([1280, 720]);
    let (width, height) = (1280, 1280 / 2 * SIZE[1] as usize / SIZE[0] as usize);
    let at = |x: usize, y: usize| pixels[((720 - height) / 2 + y) * width + x].to_be_bytes();
    // Text is above.
    let shown = room.shown(20, 1);
    let mut error = 0.0;
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let [right, down] = [x, y].map(|at| ((at as f32 + 0.5) * 640.0 / SIZE[0] as f32) as usize);
        let (mirrored, wanted) = (at(640 + right, down), shown.pixels[(y * SIZE[0] + x) as usize]);
        error += (0..3).map(|c| (f32::from(mirrored[c + 1]) / 255.0 - wanted[c]).abs()).sum::<f32>();
    }
    let mean = error / (3 * SIZE[0] * SIZE[1]) as f32;
    assert!(mean < 0.02, "the mirror is off by {mean}");
    assert!(text(&pixels) > 100, "no text");
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
