//! Runs of the program in which one call fails, on purpose, and how they must end.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::{Workshop, entries, material};

/// The environment variable with which every so many-th call is tried, with 1 each: a run for each, of which there are thousands.
/// Without it, one call of each function, and some more.
const EVERY: &str = "PBR_VR_EVERY_FAULT";
/// Calls that are tried beside those of functions that no situation before has tried.
const SPREAD: usize = 3;
/// A run that takes longer hangs.
pub const PATIENCE: Duration = Duration::from_secs(120);
/// Runs at the same time.
pub const RUNS: usize = 2;

/// How a run with a failing call has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// As without the fault, and without a word.
    Unmoved,
    /// Well, with one line that says what went wrong.
    WentOn,
    /// With exit status 1 and one line.
    Ended,
}

/// A run, as it is seen from outside.
pub struct Ran {
    /// The calls that may fail, in order; the one that did with its error.
    pub calls: Vec<String>,
    pub code: Option<i32>,
    /// What it said on stderr, less what it says only with `-v`.
    pub complaints: Vec<String>,
    /// The files that it has written.
    pub files: BTreeMap<PathBuf, Vec<u8>>,
    /// Whether a scene was shown before anything was said.
    pub showed: bool,
    /// What a test has found wrong beside that.
    pub problem: Option<String>,
}

impl Ran {
    pub fn of(folder: &Path, (code, errors): (Option<i32>, &str)) -> Self {
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
    pub fn fault(&self) -> &str {
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
pub fn complaints(errors: &str) -> impl Iterator<Item = &str> {
    let quiet = ["DEBUG", "INFO", "TRACE"];
    errors.lines().filter(move |line| !quiet.iter().any(|level| line.trim_start().starts_with(level)))
}

pub fn every() -> Option<usize> {
    std::env::var(EVERY).ok().map(|step| step.parse().expect("a number"))
}

/// The calls of a run without a fault, which are not tried for their functions' sake; none where all calls are tried.
pub fn known(run: impl Fn(u64, &Path) -> Ran) -> BTreeSet<String> {
    if every().is_some() {
        return BTreeSet::new();
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("out")).expect("a folder");
    run(0, folder.path()).calls.into_iter().collect()
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
pub fn try_calls(situation: &str, tried: &mut BTreeSet<String>, run: impl Fn(u64, &Path) -> Ran + Sync) {
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
pub fn small_world() -> Workshop {
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
pub fn end(mut command: Command, folder: &Path) -> Ran {
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

pub const SMALL: [&str; 7] = ["--size", "32x24", "--cube-size", "16", "--irradiance-size", "4", "--validate"];
