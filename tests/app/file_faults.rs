//! Each call on files, and each start of a thread, fails once, on purpose: the program ends with one line that names the file, or
//! goes on; it leaves no file that is not whole, and nothing that would harm the next run.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use super::faults::{RUNS, Ran, SMALL, end, every, session, small_world, try_calls};
use crate::common::entries;
use crate::desktop::{Display, Program, command};

#[path = "../fault_files/src/names.rs"]
mod names;

/// The library that has calls fail; cargo builds it before every test, beside it.
const BUILT: &str = "libfault_files.so";
/// Files by their paths in a folder.
type Files = BTreeMap<PathBuf, Vec<u8>>;

/// All files in a folder and below.
fn tree(folder: &Path) -> Files {
    let mut files = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).into_iter().flatten() {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("a path in the folder").to_owned();
                files.insert(name, fs::read(&path).expect("a file"));
            }
        }
    }
    files
}

fn lay(files: &Files, folder: &Path) {
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, bytes).expect("a test file");
    }
}

/// What a program needs in its environment for its call of this number to fail; 0: none. The calls are listed in `list`.
fn failing(number: u64, folder: &Path, list: &Path) -> [(&'static str, OsString); 4] {
    let tests = std::env::current_exe().expect("this test").parent().expect("its folder").to_owned();
    [
        ("LD_PRELOAD", tests.join(BUILT).into()),
        (names::FOLDER, folder.into()),
        (names::CALL, number.to_string().into()),
        (names::LOG, list.into()),
    ]
}

/// The folders of runs.
struct Place {
    /// What is there before a run.
    before: Files,
    /// The driver's own cache: not ours to test, and slow to fill.
    driver: tempfile::TempDir,
}

impl Place {
    /// With a small scene.
    fn new() -> Self {
        let shop = small_world();
        let names =
            entries(shop.0.path()).into_iter().map(|(path, bytes)| (path.file_name().expect("a name").into(), bytes));
        Self { before: names.collect(), driver: tempfile::tempdir().expect("a temporary folder") }
    }

    /// The program in a folder, where its caches and settings are, too.
    fn command(&self, work: &Path, arguments: &[&str]) -> Command {
        let mut command = command(work);
        command.args(arguments).env("MESA_SHADER_CACHE_DIR", self.driver.path());
        command
    }

    /// Runs the program in a folder of its own, below `folder`; `run` starts it and waits for it. Then `follow` runs in the same
    /// folder, and says what is wrong there.
    fn ran(
        &self,
        (number, folder): (u64, &Path),
        run: impl Fn(&Path, [(&'static str, OsString); 4], &Path) -> Ran,
        follow: impl Fn(&Path, &Ran) -> Option<String>,
    ) -> Ran {
        let folder = folder.canonicalize().expect("a folder");
        let work = folder.join("work");
        lay(&self.before, &work);
        fs::create_dir_all(work.join("out")).expect("a folder");
        let mut ran = run(&work, failing(number, &work, &folder.join("calls")), &folder);
        let failed = ran.fault().split_once(' ').map(|(call, path)| (call.to_owned(), PathBuf::from(path)));
        ran.files = self.written(&work);
        if let Some((call, path)) = failed {
            let name = path.strip_prefix(&work).unwrap_or(&path);
            if call.starts_with("unlink") {
                // It could not be removed.
                ran.files.remove(name);
            }
            // After its first pictures it was interrupted; the next run shows whether it is whole.
            ran.files.retain(|name, _| !(ran.code == Some(1) && name.ends_with("turn-sequence.json")));
            let unnamed = ran.complaints.iter().find(|line| !call.starts_with("pthread") && !names_file(line, name));
            ran.problem = unnamed.map(|_| "a line that does not name the file".into()).or_else(|| follow(&work, &ran));
        }
        ran.calls.iter_mut().for_each(generalise);
        ran
    }

    /// The files of a folder that are new or changed, but for what the validation layer keeps beside our caches.
    fn written(&self, work: &Path) -> Files {
        let is_ours = |name: &Path| name.parent() != Some(Path::new("cache"));
        let is_new = |(name, bytes): &(PathBuf, Vec<u8>)| is_ours(name) && self.before.get(name) != Some(bytes);
        tree(work).into_iter().filter(is_new).collect()
    }

    /// Tries calls of a command.
    fn try_command(&self, situation: &str, tried: &mut BTreeSet<String>, arguments: &[&str]) -> Files {
        let start = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
            let mut command = self.command(work, arguments);
            command.envs(faults);
            end(command, folder)
        };
        let first = tempfile::tempdir().expect("a temporary folder");
        let clean = self.ran((0, first.path()), start, |_, _| None).files;
        try_calls(situation, tried, |number, folder| {
            self.ran((number, folder), start, |work, ran| {
                difference(ran, &clean).or_else(|| {
                    let next = tempfile::tempdir().expect("a temporary folder");
                    let unvalidated: Vec<&str> =
                        arguments.iter().copied().filter(|flag| *flag != "--validate").collect();
                    let ran = end(self.command(work, &unvalidated), next.path());
                    let ran = Ran { files: self.written(work), ..ran };
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
}

/// What differs in the files of a run that has ended well from those of one without a fault. All results must be there; of a
/// cache, only what is there must be right.
fn difference(ran: &Ran, clean: &Files) -> Option<String> {
    // Without a library of materials a model looks otherwise, and a warning says so.
    if ran.code != Some(0) || ran.complaints.iter().any(|line| line.contains("mtllib")) {
        return None;
    }
    let missing = clean.keys().find(|name| !name.starts_with("cache") && !ran.files.contains_key(*name));
    // A temporary file is left where removing it has failed.
    let is_other = |(name, bytes): &(&PathBuf, &Vec<u8>)| !is_temporary(name) && clean.get(*name) != Some(bytes);
    let other = ran.files.iter().find(is_other).map(|(name, _)| name);
    missing.map(|name| format!("without {name:?}")).or_else(|| other.map(|name| format!("another {name:?}")))
}

/// A call that did not fail, as one of those that are alike: programs treat all errors but EINTR in the same way.
fn generalise(call: &mut String) {
    if !call.contains(' ') && !call.ends_with(":EINTR") && !call.ends_with(":short") {
        call.truncate(call.find(':').unwrap_or(call.len()));
    }
}

/// Whether a line says which file it is about. A temporary file is beside the one that is meant.
fn names_file(line: &str, file: &Path) -> bool {
    let named = if is_temporary(file) { file.parent().expect("a folder") } else { file };
    line.contains(&*named.file_name().unwrap_or_default().to_string_lossy())
}

fn is_temporary(file: &Path) -> bool {
    file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".pbr-vr-"))
}

#[test]
fn commands_survive_each_failing_call_on_files_or_end_with_one_line() {
    let mut place = Place::new();
    let mut tried = BTreeSet::new();
    let render = |output: &'static str, more: &[&'static str]| {
        [&["render", "scene.toml", "-o", output], &SMALL[..], more].concat()
    };
    let open = render("out/picture.png", &["--light", "open"]);
    let written = place.try_command("render --light open, no cache", &mut tried, &open);
    // All others take the same ways to their files.
    if every().is_none() {
        return;
    }
    let turn = render("out/turn.png", &["--light", "open", "--turntable", "2"]);
    place.try_command("render --turntable", &mut tried, &turn);
    place.try_command("bake PANORAMA", &mut tried, &["bake", "sky.exr", "-o", "out", "--size", "16", "--validate"]);
    // A cache, and a picture of an earlier run.
    place.before.extend(written);
    place.before.insert("out/picture.png".into(), b"an older picture".to_vec());
    place.try_command("render --light open, full cache", &mut tried, &open);
    let light = ["--light", "baked", "--lightmap-size", "256", "--lightmap-samples", "8", "--probe-size", "16"];
    let baked = render("out/picture.png", &light);
    let written = place.try_command("render --light baked", &mut tried, &baked);
    place.before.extend(written);
    place.before.insert("out/picture.png".into(), b"an older picture".to_vec());
    place.try_command("render --light baked, full cache", &mut tried, &baked);
    let bake = ["bake", "scene.toml", "-o", "out/light", "--validate"];
    let written = place.try_command("bake SCENE", &mut tried, &bake);
    place.before.extend(written.into_iter().filter(|(name, _)| name.starts_with("cache")));
    place.try_command("bake SCENE, full cache", &mut tried, &bake);
    place.try_command("measure panoramas", &mut tried, &["measure", "panoramas", "-o", "out"]);
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
        let ran = end(place.command(work, &picture), folder.path());
        ((ran.code, ran.complaints), fs::read(work.join("out/picture.png")).unwrap_or_default())
    };
    // What commands call, too, is tried with them.
    let expected = {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let run = |work: &Path, faults: [(&'static str, OsString); 4], folder: &Path| {
            let mut command = place.command(work, &picture);
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
            let mut command = place.command(work, &view);
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
