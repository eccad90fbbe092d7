//! Each call on files, and each start of a thread, fails once, on purpose: the program ends with one line that names the file, or
//! goes on; it leaves no file that is not whole, and nothing that would harm the next run.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use super::faults::session;
use crate::common::failing::{RUNS, Ran, SMALL, end, every, try_calls};
use crate::common::failing_files::{Files, Place, is_temporary};
use crate::desktop::{Display, Program, command};

/// The program in a folder, where its caches and settings are, too.
fn program(place: &Place, work: &Path, arguments: &[&str]) -> Command {
    let mut command = command(work);
    command.args(arguments).env("MESA_SHADER_CACHE_DIR", place.driver.path());
    command
}

/// Tries calls of a command.
fn try_command(place: &Place, situation: &str, tried: &mut BTreeSet<String>, arguments: &[&str]) -> Files {
    let start = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
        let mut command = program(place, work, arguments);
        command.envs(faults);
        end(command, folder)
    };
    let first = tempfile::tempdir().expect("a temporary folder");
    let clean = place.ran((0, first.path()), start, |_, _| None).files;
    try_calls(situation, tried, |number, folder| {
        place.ran((number, folder), start, |work, ran| {
            difference(ran, &clean).or_else(|| {
                let next = tempfile::tempdir().expect("a temporary folder");
                let without_materials = lacks_materials(ran);
                let unvalidated: Vec<&str> = arguments.iter().copied().filter(|flag| *flag != "--validate").collect();
                let ran = end(program(place, work, &unvalidated), next.path());
                let mut ran = Ran { files: place.written(work), ..ran };
                if without_materials {
                    // Its light has names of its own in the cache, which nobody reads.
                    ran.files.retain(|name, _| !name.starts_with("cache") || clean.contains_key(name));
                }
                let is_well = (ran.code, &ran.complaints[..]) == (Some(0), &[][..]);
                let problem = if is_well {
                    difference(&ran, &clean)
                } else {
                    Some(format!("{:?}, {:?}", ran.code, ran.complaints))
                };
                problem.map(|problem| format!("the run after it: {problem}"))
            })
        })
    });
    clean
}

/// What differs in the files of a run that has ended well from those of one without a fault. All results must be there; of a
/// cache, only what is there must be right.
fn difference(ran: &Ran, clean: &Files) -> Option<String> {
    if ran.code != Some(0) || lacks_materials(ran) {
        return None;
    }
    let missing = clean.keys().find(|name| !name.starts_with("cache") && !ran.files.contains_key(*name));
    // A temporary file is left where removing it has failed.
    let is_other = |(name, bytes): &(&PathBuf, &Vec<u8>)| !is_temporary(name) && clean.get(*name) != Some(bytes);
    let other = ran.files.iter().find(is_other).map(|(name, _)| name);
    missing.map(|name| format!("without {name:?}")).or_else(|| other.map(|name| format!("another {name:?}")))
}

/// Whether a model's library of materials could not be read: it looks otherwise, and a warning says so.
fn lacks_materials(ran: &Ran) -> bool {
    ran.complaints.iter().any(|line| line.contains("mtllib"))
}

#[test]
fn commands_survive_each_failing_call_on_files_or_end_with_one_line() {
    let mut place = Place::new();
    let mut tried = BTreeSet::new();
    let render = |output: &'static str, more: &[&'static str]| {
        [&["render", "scene.toml", "-o", output], &SMALL[..], more].concat()
    };
    let open = render("out/picture.png", &["--light", "open"]);
    let written = try_command(&place, "render --light open, no cache", &mut tried, &open);
    // All others take the same ways to their files.
    if every().is_none() {
        return;
    }
    let turn = render("out/turn.png", &["--light", "open", "--turntable", "2"]);
    try_command(&place, "render --turntable", &mut tried, &turn);
    try_command(&place, "bake PANORAMA", &mut tried, &["bake", "sky.exr", "-o", "out", "--size", "16", "--validate"]);
    // A cache, and a picture of an earlier run.
    place.before.extend(written);
    place.before.insert("out/picture.png".into(), b"an older picture".to_vec());
    try_command(&place, "render --light open, full cache", &mut tried, &open);
    let light = ["--light", "baked", "--lightmap-size", "64", "--lightmap-samples", "8", "--probe-size", "16"];
    let baked = render("out/picture.png", &light);
    let written = try_command(&place, "render --light baked", &mut tried, &baked);
    place.before.extend(written);
    place.before.insert("out/picture.png".into(), b"an older picture".to_vec());
    try_command(&place, "render --light baked, full cache", &mut tried, &baked);
    let bake = ["bake", "scene.toml", "-o", "out/light", "--validate"];
    let written = try_command(&place, "bake SCENE", &mut tried, &bake);
    place.before.extend(written.into_iter().filter(|(name, _)| name.starts_with("cache")));
    try_command(&place, "bake SCENE, full cache", &mut tried, &bake);
    try_command(&place, "measure panoramas", &mut tried, &["measure", "panoramas", "-o", "out"]);
}

#[test]
fn a_window_survives_each_failing_call_on_files_or_ends_with_one_line() {
    let displays: Option<Vec<Display>> = (0..RUNS).map(|_| Display::start()).collect();
    let Some(displays) = displays.map(Mutex::new) else { return };
    let place = Place::new();
    let mut tried = BTreeSet::new();
    let detail = ["--light", "open", "--cube-size", "16", "--irradiance-size", "4", "--validate"];
    let picture = [&["render", "scene.toml", "-o", "out/picture.png", "--size", "32x24"], &detail[..]].concat();
    let view = [&["view", "scene.toml", "--on", "window"], &detail[..]].concat();
    let draw = |work: &Path| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let ran = end(program(&place, work, &picture), folder.path());
        ((ran.code, ran.complaints), fs::read(work.join("out/picture.png")).unwrap_or_default())
    };
    // What commands call, too, is tried with them.
    let expected = {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let run = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
            let mut command = program(&place, work, &picture);
            command.envs(faults);
            end(command, folder)
        };
        let ran = place.ran((0, folder.path()), run, |_, _| None);
        if every().is_none() {
            tried.extend(ran.calls);
        }
        draw(&folder.path().join("work"))
    };
    try_calls("window, files", &mut tried, |number, folder| {
        let run = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
            let display = displays.lock().expect("the displays").pop().expect("one for each run");
            let mut command = program(&place, work, &view);
            command.envs(faults);
            let (showed, (code, errors)) = session(&display, Program::spawn(&display, command));
            displays.lock().expect("the displays").push(display);
            Ran { showed, ..Ran::of(folder, (code, &errors)) }
        };
        place.ran((number, folder), run, |work, _| {
            let drawn = draw(work);
            (drawn != expected).then(|| format!("the run after it: {:?}", drawn.0))
        })
    });
}
