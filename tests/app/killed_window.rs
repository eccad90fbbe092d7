//! `kill -9` while the window writes: screenshots, what its panel remembers, a camera in a scene's description, a report.

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use pbr_vr::asset::picture::Picture;

use crate::common::{Workshop, signal};
use crate::desktop::{Display, ESCAPE, H, Hands, P, Program, command};
use crate::killed::{
    DRIVER_CACHE, Point, age_temporary_files, assert_no_temporary_files, files, is_temporary, kills, wait_for,
};
use crate::window::small_scene;

const SIZE: [u32; 2] = [1280, 720];
/// Within this time after an action everything is written.
const LONGEST: Duration = Duration::from_secs(2);

type Action = fn(&Program, &Hands);

/// What makes it write.
const ACTIONS: [(&str, Action); 5] = [
    ("a screenshot", |_, hands| hands.press(&[P])),
    ("a section of the panel", |program, hands| program.click(hands, program.place("Light").0)),
    ("hiding the panel", |_, hands| hands.press(&[H])),
    ("a saved view", |program, hands| {
        program.click(hands, program.place("view's name").0);
        hands.press(&[P]);
        program.click(hands, program.place("Save view").0);
    }),
    ("a report at the end", |_, hands| hands.press(&[ESCAPE])),
];

fn start(display: &Display, folder: &Path, more: &[&str]) -> (Program, Hands) {
    let mut command = command(folder);
    command.args(["view", "scene.toml", "--on", "window", "--light", "direct", "--report", "report.json", "-vv"]);
    command.args(more).env("MESA_SHADER_CACHE_DIR", DRIVER_CACHE);
    let mut program = Program::spawn(display, command);
    program.wait_for("window");
    let hands = Hands::on(display);
    (program, hands)
}

fn screenshot(program: &mut Program, hands: &Hands, workshop: &Workshop) -> Picture {
    hands.press(&[P]);
    let line = program.wait_for("pbr-vr: wrote pbr-vr-");
    Picture::read(&workshop.path(line.rsplit(' ').next().expect("a name"))).expect("a whole picture")
}

/// Everything that lies in the folder is whole.
fn check(workshop: &Workshop, before: &str, said: &[String], when: &str) {
    for path in files(workshop.folder.path()).into_keys().filter(|path| !is_temporary(path)) {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let bytes = fs::read(workshop.path(&path.to_string_lossy())).expect("a file");
        if name.starts_with("pbr-vr-") {
            let picture = Picture::read(&workshop.path(&name)).unwrap_or_else(|error| panic!("{when}: {error}"));
            assert_eq!([picture.width, picture.height], SIZE, "{when}");
        } else if name.ends_with(".json") {
            let value = serde_json::from_slice::<serde_json::Value>(&bytes);
            assert!(value.as_ref().is_ok_and(serde_json::Value::is_object), "{when}: {name}: {value:?}");
        }
    }
    let text = fs::read_to_string(workshop.path("scene.toml")).expect("the scene");
    assert!(text.starts_with(before), "{when}: {text}");
    let cameras = text.parse::<toml::Table>().expect("a description")["camera"].as_array().map(Vec::len);
    assert_eq!(cameras, Some(if text == before { 2 } else { 3 }), "{when}: {text}");
    for line in said {
        if let Some(name) = line.strip_prefix("pbr-vr: wrote ") {
            assert!(workshop.path(name).is_file(), "{when}: {line}");
        }
        assert!(!line.contains("camera p is in") || text != before, "{when}: {line}");
    }
}

#[test]
fn the_window_is_killed_while_it_writes_and_starts_again() {
    let Some(display) = Display::start() else { return };
    let mut left = 0;
    let count = kills(1);
    for i in 0..count {
        let (workshop, scene) = small_scene();
        let folder = workshop.folder.path();
        let before = fs::read_to_string(&scene).expect("the scene");
        let (mut program, hands) = start(&display, folder, &[]);
        let first = screenshot(&mut program, &hands, &workshop);
        let (what, act) = ACTIONS[i % ACTIONS.len()];
        // First as soon as a file changes, then later: each action takes some milliseconds.
        let round = i / ACTIONS.len();
        let point = match round % 3 {
            0 => Point::Change(1),
            1 => Point::Change(1 + round / 3 % 2),
            _ => Point::After(Duration::from_millis(5 * (round as u64 % 40))),
        };
        let (acted, id) = (Mutex::new(None), program.id());
        std::thread::scope(|scope| {
            let killer = scope.spawn(|| {
                // An action that changes no file, as a click that comes too early, ends in a kill all the same.
                let is_late = || acted.lock().expect("a time").is_some_and(|at: Instant| at.elapsed() > LONGEST);
                wait_for(point, folder, is_late);
                signal(id, "KILL");
            });
            act(&program, &hands);
            *acted.lock().expect("a time") = Some(Instant::now());
            killer.join().expect("a kill");
        });
        let when = format!("{what}, killed at {point:?}");
        let said = program.said_until_its_end();
        check(&workshop, &before, &said, &when);

        left += age_temporary_files(folder);
        let (mut program, hands) = start(&display, folder, &["--validate"]);
        assert!(screenshot(&mut program, &hands, &workshop).pixels == first.pixels, "{when}: another picture");
        hands.press(&[H]);
        hands.press(&[ESCAPE]);
        let (code, errors) = program.end();
        assert_eq!(code, Some(0), "{when}: {errors}");
        assert!(!errors.contains("validation"), "{when}: {errors}");
        check(&workshop, &before, &[], &format!("{when}, and started again"));
        assert_no_temporary_files(folder, &when);
    }
    println!("{count} kills of the window; {left} temporary files were left, and removed");
}
