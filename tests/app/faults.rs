//! Each call of Vulkan that may fail does so once, on purpose: the program ends with one line, or goes on as if nothing had
//! been, or goes on and says in one line what it does without. `file_faults.rs` does so with files and threads.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::common::failing::{PATIENCE, RUNS, Ran, SMALL, complaints, end, known, small_world, try_calls};
use crate::common::fault::FaultLayer;
use crate::common::{Workshop, entries};
use crate::desktop::{Display, ESCAPE, Hands, L, M, P, PAGE_DOWN, Program, command};

const SMALL_PICTURE: [&str; 13] = {
    let [a, b, c, d, e, f, g] = SMALL;
    ["render", "scene.toml", "-o", "OUT/picture.png", "--light", "open", a, b, c, d, e, f, g]
};

/// Runs a command whose call of a number fails, in a folder of its own, to whose `out` OUT leads.
fn picture(workshop: &Workshop, layer: &FaultLayer, arguments: &[&str], (number, folder): (u64, &Path)) -> Ran {
    let out = folder.join("out");
    let out = out.to_str().expect("a path in UTF-8");
    let mut command = command(workshop.folder.path());
    command.args(arguments.iter().map(|argument| argument.replace("OUT", out)));
    command.env("XDG_CACHE_HOME", folder.join("cache")).envs(layer.failing(number, &folder.join("calls")));
    end(command, folder)
}

#[test]
fn commands_survive_each_failing_call_or_end_with_one_line() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
    let render = ["render", "scene.toml", "-o", "OUT/picture.png"];
    let situations = [
        ("render --light open", SMALL_PICTURE.to_vec()),
        ("render --shading reference", [&render[..], &SMALL, &["--shading", "reference", "--frames", "3"]].concat()),
        ("bake PANORAMA", vec!["bake", "sky.exr", "-o", "OUT", "--size", "16", "--validate"]),
    ];
    let mut tried = BTreeSet::new();
    for (situation, arguments) in situations {
        try_calls(situation, &mut tried, |number, folder| picture(&workshop, &layer, &arguments, (number, folder)));
    }
}

#[test]
fn light_is_baked_whatever_call_fails_or_one_line_says_that_it_is_not() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
    let light = ["--lightmap-size", "64", "--lightmap-samples", "8", "--probe-size", "16", "--shadow-size", "256"];
    let render = ["render", "scene.toml", "-o", "OUT/picture.png", "--light", "baked"];
    for (situation, arguments) in [
        ("render --light baked", [&render[..], &SMALL, &light].concat()),
        ("bake SCENE", vec!["bake", "scene.toml", "-o", "OUT", "--validate"]),
    ] {
        let run = |number: u64, folder: &Path| picture(&workshop, &layer, &arguments, (number, folder));
        // Each run takes several times as long as the others: functions are tried there, or on demand.
        try_calls(situation, &mut known(run), run);
    }
}

#[test]
fn a_window_survives_each_failing_call_or_ends_with_one_line() {
    let displays: Option<Vec<Display>> = (0..RUNS).map(|_| Display::start()).collect();
    let Some(displays) = displays.map(Mutex::new) else { return };
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
    let files = entries(workshop.folder.path());
    // What commands call, too, is tried with them.
    let mut tried = known(|number, folder| picture(&workshop, &layer, &SMALL_PICTURE, (number, folder)));
    try_calls("window", &mut tried, |number, folder| {
        let place = folder.join("out");
        for (path, bytes) in files.iter().filter(|(path, _)| path.is_file()) {
            fs::write(place.join(path.file_name().expect("a name")), bytes).expect("a copy");
        }
        let display = displays.lock().expect("the displays").pop().expect("one for each run");
        let mut command = command(&place);
        let detail = ["--light", "open", "--cube-size", "16", "--irradiance-size", "4", "--validate"];
        command.args(["view", "scene.toml", "--on", "window"]).args(detail);
        command.env("XDG_CACHE_HOME", folder.join("cache")).envs(layer.failing(number, &folder.join("calls")));
        let program = Program::spawn(&display, command);
        let (showed, (code, errors)) = session(&display, program);
        displays.lock().expect("the displays").push(display);
        for path in files.keys().filter(|path| path.is_file()) {
            fs::remove_file(place.join(path.file_name().expect("a name"))).expect("a copy");
        }
        Ran { showed, ..Ran::of(folder, (code, &errors)) }
    });
}

/// A short session: another panorama, scene, size and shading; a screenshot; the end. Returns whether a scene was shown before
/// anything was said on stderr, then exit status and stderr.
pub(super) fn session(display: &Display, mut program: Program) -> (bool, (Option<i32>, String)) {
    let count = |errors: &str| complaints(errors).count();
    let started = Instant::now();
    let hands = loop {
        match Hands::find(display) {
            Some(hands) => break hands,
            None if program.has_ended() => return (false, program.end()),
            None => assert!(started.elapsed() < PATIENCE, "no window: {}", program.errors()),
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    // Small pictures are drawn soon.
    hands.resize([64, 48]);
    let mut goes_on = program.until("window ", count);
    let showed = goes_on && count(&program.errors()) == 0;
    for (key, answer) in [(L, "lit by"), (PAGE_DOWN, "showing"), (M, ""), (P, "pbr-vr-1.png")] {
        if !goes_on {
            break;
        }
        if key == M {
            hands.resize([72, 40]);
        }
        hands.press(&[key]);
        goes_on = answer.is_empty() || program.until(answer, count);
    }
    if goes_on {
        hands.press(&[ESCAPE]);
    }
    (showed, program.end())
}
