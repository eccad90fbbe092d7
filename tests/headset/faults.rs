//! Each call of Vulkan or on files that may fail does so once in a session on the headset, on purpose, as in the app's tests of
//! that name: the session goes on, or ends with one line.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use crate::common::entries;
use crate::common::failing::{PATIENCE, RUNS, Ran, complaints, known, small_world, try_calls};
use crate::common::failing_files::Place;
use crate::common::fault::FaultLayer;
use crate::common::headset::{Headset, command};
use crate::desktop::{Display, ESCAPE, Hands, L, PAGE_DOWN, Program};
use headset_runtime::script::Script;

const VIEW: [&str; 9] = ["view", "scene.toml", "--on", "headset", "--light", "open", "--cube-size", "16", "--validate"];

/// A headset whose runtime leaves Vulkan alone: the calls that fail are the program's. Its display is slow, so that few of them are of
/// frames that are all alike.
fn headset(folder: &Path) -> Headset {
    Headset::install(folder, &Script { size: [32, 24], hz: 10.0, is_paced: true, copies: false, ..Script::default() })
}

/// Start, some frames, another panorama, another scene, the end. Returns whether frames were shown before anything was said on
/// stderr, then exit status and stderr.
fn session(display: &Display, headset: &Headset, mut program: Program) -> (bool, (Option<i32>, String)) {
    let count = |errors: &str| complaints(errors).count();
    let started = Instant::now();
    let hands = loop {
        match Hands::find(display) {
            Some(hands) => break hands,
            None if program.has_ended() => return (false, program.end()),
            None => assert!(started.elapsed() < PATIENCE, "no window: {}", program.errors()),
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    hands.resize([64, 48]);
    let mut goes_on = program.until("in the headset", count);
    let showed = goes_on && count(&program.errors()) == 0;
    for (key, answer) in [(L, "lit by"), (PAGE_DOWN, "showing")] {
        if goes_on {
            let more = headset.frame() + 3;
            let pressed = Instant::now();
            while headset.frame() < more && !program.has_ended() && pressed.elapsed() < PATIENCE / 4 {
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            hands.press(&[key]);
            goes_on = program.until(answer, count);
        }
    }
    if goes_on {
        hands.press(&[ESCAPE]);
    }
    (showed, program.end())
}

/// What the runtime has seen that no program should do.
fn fault(headset: &Headset) -> Option<String> {
    headset.calls_of("Fault").first().map(ToString::to_string)
}

#[test]
fn a_session_survives_each_failing_call_or_ends_with_one_line() {
    let displays: Option<Vec<Display>> = (0..RUNS).map(|_| Display::start()).collect();
    let Some(displays) = displays.map(Mutex::new) else { return };
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
    let files = entries(workshop.folder.path());
    let run = |number: u64, folder: &Path| {
        let place = folder.join("out");
        for (path, bytes) in files.iter().filter(|(path, _)| path.is_file()) {
            fs::write(place.join(path.file_name().expect("a name")), bytes).expect("a copy");
        }
        let headset = headset(folder);
        let display = displays.lock().expect("the displays").pop().expect("one for each run");
        let mut command = command(&place, &VIEW);
        command.envs(headset.environment()).env("XDG_CACHE_HOME", folder.join("cache"));
        command.envs(layer.failing(number, &folder.join("calls")));
        let (showed, (code, errors)) = session(&display, &headset, Program::spawn(&display, command));
        displays.lock().expect("the displays").push(display);
        for path in files.keys().filter(|path| path.is_file()) {
            fs::remove_file(place.join(path.file_name().expect("a name"))).expect("a copy");
        }
        Ran { showed, problem: fault(&headset), ..Ran::of(folder, (code, &errors)) }
    };
    // The app's tests try one call of each function.
    try_calls("headset", &mut known(run), run);
}

#[test]
fn a_session_survives_each_failing_call_on_files_or_ends_with_one_line() {
    let displays: Option<Vec<Display>> = (0..RUNS).map(|_| Display::start()).collect();
    let Some(displays) = displays.map(Mutex::new) else { return };
    let place = Place::new();
    let run = |number: u64, folder: &Path| {
        let start = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
            let headset = headset(folder);
            let display = displays.lock().expect("the displays").pop().expect("one for each run");
            let mut command = command(work, &VIEW);
            command.envs(headset.environment()).env("MESA_SHADER_CACHE_DIR", place.driver.path());
            command.env("XDG_CACHE_HOME", work.join("cache")).env("XDG_CONFIG_HOME", work.join("config"));
            command.envs(faults);
            let (showed, (code, errors)) = session(&display, &headset, Program::spawn(&display, command));
            displays.lock().expect("the displays").push(display);
            Ran { showed, problem: fault(&headset), ..Ran::of(folder, (code, &errors)) }
        };
        let mut ran = place.ran((number, folder), start, |_, _| None);
        // The panel's small pictures have other names in every folder, and as many are there as it has had time for.
        ran.files.retain(|name, _| !name.starts_with("cache/pbr-vr/thumbnails"));
        ran
    };
    try_calls("headset, files", &mut known(run), run);
}
