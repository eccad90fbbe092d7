//! Probes for a headset in a child process, so that a runtime which hangs or crashes at its start does not take the program
//! with it.

use std::io::{self, BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use openvr_sys as sys;
use serde::{Deserialize, Serialize};

use super::codes::Refusal;
use super::runtime::{Role, Runtime};
use crate::asset::contained::from_json;
use crate::error::shortened;
use crate::say;

/// The runtime's library in its folder, where OpenVR's loader looks for it.
const LIBRARY: &str = if cfg!(windows) {
    "bin/vrclient_x64.dll"
} else if cfg!(target_os = "macos") {
    "bin/osx32/vrclient.dylib"
} else if cfg!(target_arch = "aarch64") {
    "bin/linuxarm64/vrclient.so"
} else {
    "bin/linux64/vrclient.so"
};
/// Names the runtime's folder instead of the registry.
const OVERRIDE: &str = "VR_OVERRIDE";
/// The hidden subcommand of the child.
pub const SUBCOMMAND: &str = "probe-headset";
/// The time limit for the child.
const LIMIT: Duration = Duration::from_secs(15);
/// How often the child is polled.
const TICK: Duration = Duration::from_millis(10);
/// The time limit for the child's output after it has ended.
const REST: Duration = Duration::from_millis(500);
/// Characters of the runtime's last line that are shown if it crashes.
const LONGEST_REASON: usize = 200;

/// The child's result.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Answer {
    /// There are a runtime and a headset; the headset's name if the runtime was running already.
    Ready(Option<String>),
    NoHeadset,
    Refused(Refusal),
}

/// Looks for a runtime, then probes it in a child process. Returns the headset's name if the runtime was running already.
///
/// # Errors
/// One line that says why there is no headset and what to do.
pub fn probe() -> Result<Option<String>, String> {
    check_registry()?;
    let program = std::env::current_exe().map_err(|e| format!("the probe for a headset cannot be started ({e})"))?;
    let mut command = Command::new(program);
    command.arg(SUBCOMMAND);
    let ended = run(command, LIMIT).map_err(|e| format!("the probe for a headset cannot be started ({e})"))?;
    let Some(ended) = ended else {
        let seconds = LIMIT.as_secs();
        return Err(format!("the headset runtime does not answer within {seconds} s; restart SteamVR"));
    };
    verdict(&ended)
}

/// A child process that has ended.
struct Ended {
    status: ExitStatus,
    out: String,
    err: String,
}

/// Runs a command to its end; `None` if it had to be killed because it took longer than `limit`.
fn run(mut command: Command, limit: Duration) -> io::Result<Option<Ended>> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn()?;
    // Pipes are read while the child runs: one that is full would block it.
    let out = child.stdout.take().map(read_in_background).transpose();
    let err = child.stderr.take().map(read_in_background).transpose();
    let readers = out.and_then(|out| Ok((out, err?))).inspect_err(|_| kill(&mut child))?;
    let status = wait(&mut child, limit).inspect_err(|_| kill(&mut child))?;
    let Some(status) = status else {
        // The readers are not joined: a process that the child started may hold the pipes open.
        kill(&mut child);
        return Ok(None);
    };
    let text = |reader: Option<Receiver<String>>| reader.map(collect).unwrap_or_default();
    Ok(Some(Ended { status, out: text(readers.0), err: text(readers.1) }))
}

fn wait(child: &mut Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let started = Instant::now();
    loop {
        match child.try_wait()? {
            Some(status) => return Ok(Some(status)),
            None if started.elapsed() < limit => std::thread::sleep(TICK),
            None => return Ok(None),
        }
    }
}

fn kill(child: &mut Child) {
    // It may have ended by itself meanwhile.
    let _ = child.kill();
    let _ = child.wait();
}

/// Reads a pipe to its end on a thread of its own; sends line by line.
fn read_in_background(pipe: impl io::Read + Send + 'static) -> io::Result<Receiver<String>> {
    let (sender, lines) = channel();
    let read = move || {
        let mut pipe = BufReader::new(pipe);
        let mut line = Vec::new();
        while pipe.read_until(b'\n', &mut line).is_ok_and(|bytes| bytes > 0) {
            if sender.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                return;
            }
            line.clear();
        }
    };
    std::thread::Builder::new().name("probe".into()).spawn(read)?;
    Ok(lines)
}

/// The content of a pipe. Waits a little for the rest: another process may have inherited the pipe and keep it open.
fn collect(lines: Receiver<String>) -> String {
    let until = Instant::now() + REST;
    std::iter::from_fn(|| lines.recv_timeout(until.saturating_duration_since(Instant::now())).ok()).collect()
}

/// The child's part: prints its result as a line of JSON.
pub fn answer() {
    // Serialising plain data cannot fail.
    say!("{}", serde_json::to_string(&ask()).unwrap_or_default());
}

fn ask() -> Answer {
    match Runtime::start(Role::Background) {
        Ok(runtime) if runtime.is_connected(0) => Answer::Ready(Some(runtime.headset_name())),
        Ok(_) => Answer::NoHeadset,
        // The runtime's server is not running; a program that shows pictures will start it.
        Err(Refusal { code: sys::EVRInitError_VRInitError_Init_NoServerForBackgroundApp, .. }) => {
            // SAFETY: the call loads the runtime's library and unloads it again; there is no other connection.
            if unsafe { sys::VR_IsHmdPresent() } { Answer::Ready(None) } else { Answer::NoHeadset }
        }
        Err(Refusal { code: sys::EVRInitError_VRInitError_Init_HmdNotFound, .. }) => Answer::NoHeadset,
        Err(refusal) => Answer::Refused(refusal),
    }
}

/// The file by which OpenVR's loader finds its runtime, where there is one.
pub fn registry() -> Option<PathBuf> {
    let named = std::env::var_os("VR_PATHREG_OVERRIDE").map(PathBuf::from);
    let file = named.or_else(|| Some(config_folder()?.join("openvr").join("openvrpaths.vrpath")))?;
    file.is_file().then_some(file)
}

fn verdict(ended: &Ended) -> Result<Option<String>, String> {
    match ended.out.lines().find_map(|line| serde_json::from_str(line).ok()) {
        Some(Answer::Ready(name)) => Ok(name),
        Some(Answer::NoHeadset) => {
            Err("the runtime finds no headset; connect it, switch it on, and look at SteamVR's window".into())
        }
        Some(Answer::Refused(refusal)) => Err(format!("no headset: {refusal}")),
        None => {
            let last = ended.err.lines().rfind(|line| !line.trim().is_empty());
            let reason = last.map_or_else(String::new, |line| format!(": {}", shortened(line.trim(), LONGEST_REASON)));
            let status = ended.status;
            Err(format!("the headset runtime crashes at its start ({status}{reason}); restart or reinstall SteamVR"))
        }
    }
}

/// The loader itself writes to the terminal where the file is missing or names nothing.
fn check_registry() -> Result<(), String> {
    let Some(file) = registry() else { return Err("no headset runtime is installed (SteamVR provides one)".into()) };
    let text = std::fs::read_to_string(&file).map_err(|e| format!("{} of the headset runtime: {e}", file.display()))?;
    match runtime_folders(&text) {
        None => Err(format!("{} does not name a headset runtime; reinstall SteamVR", file.display())),
        Some(folders) if std::env::var_os(OVERRIDE).is_none() => check_folders(&folders, &file),
        Some(_) => Ok(()),
    }
}

/// Whether one of the folders that a registry names holds a runtime's library.
fn check_folders(folders: &[String], registry: &Path) -> Result<(), String> {
    let Some(folder) = folders.iter().map(Path::new).find(|folder| folder.is_dir()) else {
        return Err(format!("the headset runtime that {} names is not there; reinstall SteamVR", registry.display()));
    };
    if folders.iter().any(|folder| Path::new(folder).join(LIBRARY).is_file()) {
        return Ok(());
    }
    let library = folder.join(LIBRARY);
    Err(format!("the headset runtime lacks its library {}; reinstall it (SteamVR)", library.display()))
}

/// The folders that a registry names, if it is one.
pub(crate) fn runtime_folders(registry: &str) -> Option<Vec<String>> {
    #[derive(Deserialize)]
    struct Registry {
        runtime: Vec<String>,
    }
    let registry: Registry = from_json(registry.trim_start_matches('\u{feff}').as_bytes()).ok()?;
    Some(registry.runtime)
}

#[cfg(windows)]
fn config_folder() -> Option<PathBuf> {
    std::env::var_os("LOCALAPPDATA").map(PathBuf::from)
}

#[cfg(not(windows))]
fn config_folder() -> Option<PathBuf> {
    let set = std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from);
    set.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".config")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registries_are_read_with_and_without_a_byte_order_mark() {
        let text = r#"{"version":1,"jsonid":"vrpathreg","runtime":["/a","/b"],"config":["/c"]}"#;
        assert_eq!(runtime_folders(text), Some(vec!["/a".into(), "/b".into()]));
        assert_eq!(runtime_folders(&format!("\u{feff}{text}")).map(|folders| folders.len()), Some(2));
        assert_eq!((runtime_folders("{}"), runtime_folders("{ \"runtime\": [")), (None, None));
    }

    fn ended(out: &str, err: &str) -> Ended {
        Ended { status: ExitStatus::default(), out: out.into(), err: err.into() }
    }

    #[test]
    fn answers_are_found_among_what_libraries_print() {
        let refusal = Refusal { code: 105, words: "old".into() };
        let verdict = |answer: &Answer| {
            let line = serde_json::to_string(answer).expect("a text");
            super::verdict(&ended(&format!("library output\n{line}\n"), "a warning\n"))
        };
        let ready = Answer::Ready(Some("HTC Vive".into()));
        assert_eq!(verdict(&ready), Ok(Some("HTC Vive".into())));
        assert_eq!(verdict(&Answer::Ready(None)), Ok(None));
        assert!(verdict(&Answer::Refused(refusal)).is_err_and(|e| e.contains("update SteamVR")));
    }

    #[test]
    fn a_crash_is_reported_with_the_runtimes_last_line() {
        let error = verdict(&ended("no answer\n", "loading\nout of ink\n\n")).expect_err("a crash");
        assert!(error.contains("crashes at its start") && error.contains(": out of ink)"), "{error}");
        assert!(verdict(&ended("", "")).is_err_and(|e| e.contains("crashes at its start")));
    }

    #[cfg(unix)]
    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    /// More than any pipe holds.
    #[cfg(unix)]
    #[test]
    fn a_child_that_writes_megabytes_is_not_blocked() {
        let flood =
            "head -c 4000000 /dev/zero | tr '\\0' '\\n'; head -c 4000000 /dev/zero | tr '\\0' '\\n' >&2; echo end";
        let ended = run(shell(flood), Duration::from_secs(60)).expect("a shell").expect("its end");
        assert!(ended.status.success() && ended.out.ends_with("end\n") && ended.err.len() == 4_000_000);
    }

    #[cfg(unix)]
    #[test]
    fn a_child_that_hangs_is_killed_and_one_that_leaves_a_process_behind_is_not_waited_for() {
        let started = Instant::now();
        assert!(run(shell("sleep 20"), Duration::from_millis(50)).expect("a shell").is_none());
        let ended = run(shell("echo done; sleep 5 &"), Duration::from_secs(20)).expect("a shell").expect("its end");
        assert_eq!(ended.out, "done\n");
        assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
    }
}
