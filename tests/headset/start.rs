//! Starting without a usable headset: every cause gives one line, and the program neither hangs nor crashes with the runtime.

use std::fs;
use std::path::Path;
use std::time::Duration;

use headset_runtime::script::{Script, Start};

use crate::common::headset::{Headset, INSTALLED, Ran, command, finish};
use crate::common::{Workshop, material, sphere};

/// A ball before a camera.
fn scene() -> Workshop {
    let workshop = Workshop::new();
    workshop.sky(0.0);
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    workshop.write("ball.obj", &sphere("gold.mtl"));
    let camera = "[[camera]]\nname = \"front\"\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n";
    let text = format!("environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"ball.obj\"\n{camera}");
    workshop.write("scene.toml", &text);
    workshop
}

/// On a headset that starts like this.
fn start_with(start: Start, on: &str) -> Ran {
    let workshop = scene();
    let script = Script { size: [32, 32], start, ..Script::default() };
    let headset = Headset::install(workshop.folder.path(), &script);
    headset.run(workshop.folder.path(), &["view", "scene.toml", "--on", on, "--frames", "2"])
}

/// Asked for a headset it fails, and says `parts` in one line; left to choose, it says the same and writes a picture.
fn assert_falls_back(parts: &[&str], run: impl Fn(&str) -> Ran) {
    let ran = run("headset");
    ran.assert_fails_with(parts);
    assert_eq!(ran.err.lines().count(), 1, "{ran}");
    let ran = run("auto");
    ran.assert_clean();
    assert!(ran.out.contains("pbr-vr.png"), "{ran}");
    let line = ran.out.lines().find(|line| parts.iter().all(|part| line.contains(part)));
    assert!(line.is_some(), "{parts:?}: {ran}");
}

#[test]
fn without_a_runtime_it_says_so_at_once() {
    assert_falls_back(&["headset", "SteamVR"], |on| {
        let workshop = scene();
        finish(
            command(workshop.folder.path(), &["view", "scene.toml", "--on", on, "--validate"])
                .spawn()
                .expect("a program"),
        )
    });
}

#[test]
fn a_registry_that_names_nothing_or_half_an_installation_is_told() {
    for is_there in [false, true] {
        assert_falls_back(&["headset"], |on| {
            let workshop = scene();
            let headset = Headset::install(workshop.folder.path(), &Script::default());
            let elsewhere = workshop.path("elsewhere");
            if is_there {
                fs::create_dir(&elsewhere).expect("a folder");
            }
            headset.write_registry(&elsewhere);
            headset.run(workshop.folder.path(), &["view", "scene.toml", "--on", on, "--frames", "2"])
        });
    }
}

#[test]
fn a_runtime_without_its_library_is_named_by_doctor_and_by_view() {
    // None at all, and one that cannot be loaded.
    for (contents, parts) in
        [(None, ["lacks its library", "vrclient"]), (Some("junk"), ["library", "cannot be loaded"])]
    {
        let workshop = scene();
        let headset = Headset::install(workshop.folder.path(), &Script::default());
        let library = workshop.path("headset").join(INSTALLED);
        match contents {
            None => fs::remove_file(&library).expect("the library"),
            Some(junk) => fs::write(&library, junk).expect("junk"),
        }
        headset.run(workshop.folder.path(), &["view", "scene.toml", "--on", "headset"]).assert_fails_with(&parts);
        let doctor = headset.run(workshop.folder.path(), &["doctor"]);
        let line = doctor.out.lines().find(|line| line.starts_with("headset")).expect("a line");
        assert!(parts.iter().all(|part| line.contains(part)) && !line.contains("connect"), "{line}");
    }
}

#[test]
fn a_registry_that_is_not_json_is_told() {
    assert_falls_back(&["headset"], |on| {
        let workshop = scene();
        let headset = Headset::install(workshop.folder.path(), &Script::default());
        workshop.write("headset/openvrpaths.vrpath", "{ \"runtime\": [");
        headset.run(workshop.folder.path(), &["view", "scene.toml", "--on", on, "--frames", "2"])
    });
}

#[test]
fn a_runtime_without_a_headset_is_told() {
    assert_falls_back(&["headset"], |on| start_with(Start { no_headset: true, ..Start::default() }, on));
}

#[test]
fn a_runtime_that_refuses_is_told_with_its_reason() {
    // Another program is starting; the runtime is shutting down; a version that nobody knows yet.
    for error in [117, 119, 9999] {
        assert_falls_back(&["headset"], |on| start_with(Start { error, ..Start::default() }, on));
    }
}

#[test]
fn a_runtime_that_is_too_old_is_told() {
    assert_falls_back(&["headset", "SteamVR"], |on| start_with(Start { too_old: true, ..Start::default() }, on));
}

#[test]
fn a_runtime_that_hangs_or_dies_at_its_start_takes_nobody_along() {
    for start in [Start { hang: true, ..Start::default() }, Start { abort: true, ..Start::default() }] {
        assert_falls_back(&["headset"], |on| {
            let ran = start_with(start.clone(), on);
            assert!(ran.took < Duration::from_secs(60), "{ran}");
            ran
        });
    }
}

#[test]
fn a_runtime_that_dies_at_its_start_is_quoted() {
    let start = Start { abort: true, ..Start::default() };
    assert_falls_back(&["headset", "aborts as its script says"], |on| start_with(start.clone(), on));
}

#[test]
fn a_runtime_that_fills_its_pipes_at_the_start_is_not_blocked() {
    let start = Start { chatter_kib: 256, ..Start::default() };
    let ran = start_with(start, "headset");
    ran.assert_clean();
    assert!(ran.took < Duration::from_secs(15), "the probe was blocked: {:?}", ran.took);
}

#[test]
fn a_slow_runtime_is_waited_for() {
    let start = Start { slow_ms: 1500, ..Start::default() };
    start_with(start, "headset").assert_clean();
}

#[test]
fn a_runtime_whose_server_sleeps_is_woken() {
    let start = Start { is_asleep: true, ..Start::default() };
    start_with(start, "headset").assert_clean();
}

#[test]
fn nothing_of_a_failed_start_is_left_running() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let workshop = scene();
    let script = Script { start: Start { hang: true, ..Start::default() }, ..Script::default() };
    let headset = Headset::install(workshop.folder.path(), &script);
    headset.run(workshop.folder.path(), &["view", "scene.toml", "--on", "headset"]).assert_fails_with(&["headset"]);
    let processes: Vec<u64> = headset.calls().iter().filter_map(|call| call["process"].as_u64()).collect();
    assert!(!processes.is_empty());
    for process in processes {
        assert!(!Path::new(&format!("/proc/{process}")).exists(), "process {process} is left");
    }
}
