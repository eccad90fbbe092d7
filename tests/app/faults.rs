//! Each call of Vulkan that may fail does so once, on purpose: the program ends with one line, or goes on as if nothing had
//! been, or goes on and says in one line what it does without. `file_faults.rs` does so with files and threads.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::common::fault::FaultLayer;
use crate::common::{Workshop, entries, material};
use crate::desktop::{Display, ESCAPE, Hands, L, M, P, PAGE_DOWN, Program, command};

/// The environment variable with which every so many-th call is tried, with 1 each: a run for each, of which there are thousands.
/// Without it, one call of each function, and some more.
const EVERY: &str = "PBR_VR_EVERY_FAULT";
/// Calls that are tried beside those of functions that no situation before has tried.
const SPREAD: usize = 3;
/// A run that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);
/// Runs at the same time.
pub(super) const RUNS: usize = 2;

/// How a run with a failing call has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Ending {
    /// As without the fault, and without a word.
    Unmoved,
    /// Well, with one line that says what went wrong.
    WentOn,
    /// With exit status 1 and one line.
    Ended,
}

/// A run, as it is seen from outside.
pub(super) struct Ran {
    /// The calls that may fail, in order; the one that did with its error.
    pub(super) calls: Vec<String>,
    pub(super) code: Option<i32>,
    /// What it said on stderr, less what it says only with `-v`.
    pub(super) complaints: Vec<String>,
    /// The files that it has written.
    pub(super) files: BTreeMap<PathBuf, Vec<u8>>,
    /// Whether a scene was shown before anything was said.
    pub(super) showed: bool,
    /// What a test has found wrong beside that.
    pub(super) problem: Option<String>,
}

impl Ran {
    pub(super) fn of(folder: &Path, (code, errors): (Option<i32>, &str)) -> Self {
        let calls = fs::read_to_string(folder.join("calls")).unwrap_or_default();
        let files = entries(&folder.join("out"));
        let named = files.into_iter().map(|(path, bytes)| (path.file_name().expect("a name").into(), bytes));
        Self {
            calls: calls.lines().map(str::to_owned).collect(),
            code,
            complaints: complaints(errors).map(str::to_owned).collect(),
            files: named.collect(),
            showed: false,
            problem: None,
        }
    }

    /// The call that failed, and its error.
    pub(super) fn fault(&self) -> &str {
        self.calls.iter().find(|call| call.contains(' ')).map_or("none", String::as_str)
    }

    /// How it ended, against a run without a fault.
    fn ending(&self, clean: &Self) -> Result<Ending, String> {
        if let Some(problem) = &self.problem {
            return Err(problem.clone());
        }
        let ending = match (self.code, self.complaints.len()) {
            (Some(0), 0) => Ending::Unmoved,
            (Some(0), 1) => Ending::WentOn,
            (Some(1), 1) => Ending::Ended,
            (code, _) => return Err(format!("exit status {code:?}")),
        };
        let of_a_kind = |line: &&String| line.starts_with("pbr-vr: ") || ending == Ending::WentOn && is_warning(line);
        let is_ours = self.complaints.iter().all(|line| of_a_kind(&line) && !line.contains("defect"));
        // Files that were written are whole: those of a run without a fault.
        let whole = self.files.iter().all(|(name, bytes)| clean.files.get(name) == Some(bytes));
        let all = self.files.len() == clean.files.len();
        match ending {
            _ if !is_ours => Err("a complaint of another kind".into()),
            Ending::Unmoved if !(whole && all) => Err("other files".into()),
            Ending::Ended if !whole => Err("a file that is not whole".into()),
            Ending::Ended if self.showed => Err("a window that showed a scene has gone".into()),
            _ => Ok(ending),
        }
    }
}

/// What is said of a run that goes on with less than was asked for.
fn is_warning(line: &str) -> bool {
    line.trim_start().starts_with("WARN ")
}

/// Lines that a user sees.
fn complaints(errors: &str) -> impl Iterator<Item = &str> {
    let quiet = ["DEBUG", "INFO", "TRACE"];
    errors.lines().filter(move |line| !quiet.iter().any(|level| line.trim_start().starts_with(level)))
}

pub(super) fn every() -> Option<usize> {
    std::env::var(EVERY).ok().map(|step| step.parse().expect("a number"))
}

/// The numbers of the calls that are to fail: all, or one of each function that has not been tried, and some more.
fn chosen(calls: &[String], tried: &mut BTreeSet<String>) -> Vec<u64> {
    let count = calls.len() as u64;
    if let Some(step) = every() {
        // Runs differ a little; with the last of these, nothing fails.
        return (1..=count + count / 20 + step as u64).step_by(step).collect();
    }
    let mut places: BTreeMap<&String, Vec<u64>> = BTreeMap::new();
    (1..).zip(calls).for_each(|(number, call)| places.entry(call).or_default().push(number));
    let new = places.iter().filter(|(call, _)| tried.insert((**call).clone())).map(|(_, all)| all[all.len() / 2]);
    let mut numbers: BTreeSet<u64> = new.collect();
    numbers.extend((1..=SPREAD as u64).map(|i| i * count / (SPREAD as u64 + 1)));
    numbers.into_iter().collect()
}

/// Tries calls of one situation, and prints what came of it. `run` has the call of a number fail, in a folder of its own.
pub(super) fn try_calls(situation: &str, tried: &mut BTreeSet<String>, run: impl Fn(u64, &Path) -> Ran + Sync) {
    let again = |number: u64| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("out")).expect("a folder");
        run(number, folder.path())
    };
    let clean = again(0);
    assert_eq!((clean.code, &clean.complaints[..]), (Some(0), &[][..]), "{situation} without a fault");
    let numbers = Mutex::new(chosen(&clean.calls, tried).into_iter());
    let endings = Mutex::new(BTreeMap::<Ending, usize>::new());
    let wrong = Mutex::new(Vec::new());
    let work = || {
        while let Some(number) = { numbers.lock().expect("the numbers").next() } {
            let ran = again(number);
            match ran.ending(&clean) {
                Ok(ending) => {
                    println!("{situation}, call {number}, {}: {ending:?} {:?}", ran.fault(), ran.complaints);
                    *endings.lock().expect("the endings").entry(ending).or_default() += 1;
                }
                Err(problem) => {
                    let files: Vec<_> = ran.files.keys().collect();
                    let fault = ran.fault();
                    let text =
                        format!("{situation}, call {number}, {fault}: {problem}; {files:?}\n{:#?}", ran.complaints);
                    println!("{text}");
                    wrong.lock().expect("the list").push(text);
                }
            }
        }
    };
    std::thread::scope(|scope| (0..RUNS).for_each(|_| drop(scope.spawn(work))));
    println!("{situation}: {} calls that may fail; tried: {:?}", clean.calls.len(), endings.into_inner().expect("all"));
    let wrong = wrong.into_inner().expect("all");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Two floors, one above the other, under a sky; a second scene, and a second sky.
pub(super) fn small_world() -> Workshop {
    let workshop = Workshop::new();
    workshop.panorama("sky.exr", 16, |[_, y, z]| [0.3 + 0.3 * z as f32, 0.4, 0.5 + 0.5 * y as f32]);
    workshop.panorama("tiny.exr", 16, |[x, ..]| [0.3 + 0.2 * x as f32, 0.4, 0.5]);
    workshop.write("grey.mtl", &material([0.6, 0.5, 0.3], 0.0, 0.5));
    // Narrow: their lightmap has few texels that are lit.
    let floor = |y: f32| format!("v -1 {y} -0.02\nv -1 {y} 0.02\nv 1 {y} 0.02\nv 1 {y} -0.02\n");
    let faces = "usemtl m\nf 1 2 3 4\nf 5 6 7 8\n";
    workshop.write("floors.obj", &format!("mtllib grey.mtl\n{}{}{faces}", floor(0.0), floor(0.5)));
    let camera = "[[camera]]\nname = \"front\"\nposition = [0, 1, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n";
    let text = format!("environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"floors.obj\"\n{camera}");
    workshop.write("scene.toml", &text);
    workshop.write("second.toml", &text);
    workshop
}

/// Waits for a run's end.
pub(super) fn end(mut command: Command, folder: &Path) -> Ran {
    let errors = folder.join("errors");
    command.stdout(fs::File::create(folder.join("said")).expect("a file"));
    command.stderr(fs::File::create(&errors).expect("a file"));
    let (mut child, started) = (command.spawn().expect("the program"), Instant::now());
    let code = loop {
        if let Some(status) = child.try_wait().expect("a child") {
            break status.code();
        }
        if started.elapsed() > PATIENCE {
            child.kill().expect("a child");
            child.wait().expect("a child");
            break None;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let mut text = fs::read_to_string(&errors).expect("its errors");
    if code.is_none() {
        text += &format!("it hung, or was killed, after {:.0} s\n", started.elapsed().as_secs_f64());
    }
    Ran::of(folder, (code, &text))
}

pub(super) const SMALL: [&str; 7] = ["--size", "32x24", "--cube-size", "16", "--irradiance-size", "4", "--validate"];
const SMALL_PICTURE: [&str; 13] = {
    let [a, b, c, d, e, f, g] = SMALL;
    ["render", "scene.toml", "-o", "OUT/picture.png", "--light", "open", a, b, c, d, e, f, g]
};

/// Runs a command whose call of a number fails, in a folder of its own, to whose `out` OUT leads.
fn picture(workshop: &Workshop, layer: &FaultLayer, arguments: &[&str], (number, folder): (u64, &Path)) -> Ran {
    let out = folder.join("out");
    let out = out.to_str().expect("a path in UTF-8");
    let mut command = command(workshop.0.path());
    command.args(arguments.iter().map(|argument| argument.replace("OUT", out)));
    command.env("XDG_CACHE_HOME", folder.join("cache")).envs(layer.failing(number, &folder.join("calls")));
    end(command, folder)
}

#[test]
fn commands_survive_each_failing_call_or_end_with_one_line() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.0.path());
    let light = ["--lightmap-size", "256", "--lightmap-samples", "8", "--probe-size", "16", "--shadow-size", "256"];
    let render = ["render", "scene.toml", "-o", "OUT/picture.png"];
    let situations = [
        ("render --light open", SMALL_PICTURE.to_vec()),
        ("render --light baked", [&render[..], &SMALL, &["--light", "baked"], &light].concat()),
        ("render --shading reference", [&render[..], &SMALL, &["--shading", "reference", "--frames", "3"]].concat()),
        ("bake PANORAMA", vec!["bake", "sky.exr", "-o", "OUT", "--size", "16", "--validate"]),
    ];
    let mut tried = BTreeSet::new();
    for (situation, arguments) in situations {
        // It takes several times as long as the others; what it alone does is tried only on demand.
        if situation.ends_with("baked") && every().is_none() {
            continue;
        }
        try_calls(situation, &mut tried, |number, folder| picture(&workshop, &layer, &arguments, (number, folder)));
    }
}

#[test]
fn a_window_survives_each_failing_call_or_ends_with_one_line() {
    let displays: Option<Vec<Display>> = (0..RUNS).map(|_| Display::start()).collect();
    let Some(displays) = displays.map(Mutex::new) else { return };
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.0.path());
    let files = entries(workshop.0.path());
    // What commands call, too, is tried with them.
    let mut tried = BTreeSet::new();
    if every().is_none() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("out")).expect("a folder");
        tried.extend(picture(&workshop, &layer, &SMALL_PICTURE, (0, folder.path())).calls);
    }
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
