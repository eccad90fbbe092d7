//! Asks whether a headset answers, in a process of its own: a runtime that hangs or dies at its start takes only that along.

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use openvr_sys as sys;
use serde::{Deserialize, Serialize};

use super::codes::Refusal;
use super::runtime::{Role, Runtime};
use crate::say;

/// The hidden subcommand that the child is started with.
pub const SUBCOMMAND: &str = "probe-headset";
/// The answer is waited for so long.
const LIMIT: Duration = Duration::from_secs(15);
/// How often the child is looked at.
const TICK: Duration = Duration::from_millis(10);

/// What the child found.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Answer {
    /// Runtime and headset are there; the headset's name if the runtime was running already.
    Ready(Option<String>),
    NoHeadset,
    Refused(Refusal),
}

/// Looks for a runtime, then asks it. What it knows of the headset's name; or why there is none, and what to do.
pub fn probe() -> Result<Option<String>, String> {
    check_registry()?;
    let program = std::env::current_exe().map_err(|e| format!("the headset cannot be asked for ({e})"))?;
    let started = Instant::now();
    // The loader's and the runtime's own chatter is of no use to anybody here.
    let mut command = Command::new(program);
    command.arg(SUBCOMMAND).stdin(Stdio::null()).stderr(Stdio::null()).stdout(Stdio::piped());
    let mut child = command.spawn().map_err(|e| format!("the headset cannot be asked for ({e})"))?;
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if started.elapsed() < LIMIT => std::thread::sleep(TICK),
            Ok(None) => {
                end(&mut child);
                let seconds = LIMIT.as_secs();
                return Err(format!("the headset runtime does not answer within {seconds} s; restart SteamVR"));
            }
            Err(e) => {
                end(&mut child);
                return Err(format!("the headset cannot be asked for ({e})"));
            }
        }
    };
    let mut text = String::new();
    // What cannot be read is no answer.
    let _ = child.stdout.take().map(|mut out| out.read_to_string(&mut text));
    verdict(status, &text)
}

/// What the child does: prints what it finds as one line.
pub fn answer() {
    // SAFETY: the call loads the runtime's library and unloads it again, which is what this process is for.
    let answer = if !unsafe { sys::VR_IsHmdPresent() } {
        Answer::NoHeadset
    } else {
        match Runtime::start(Role::Background) {
            Ok(runtime) if runtime.is_connected(0) => Answer::Ready(Some(runtime.headset_name())),
            Ok(_) => Answer::NoHeadset,
            // It is not running: a program that shows pictures will start it.
            Err(Refusal { code: sys::EVRInitError_VRInitError_Init_NoServerForBackgroundApp, .. }) => {
                Answer::Ready(None)
            }
            Err(refusal) => Answer::Refused(refusal),
        }
    };
    // Plain data always has a text.
    say!("{}", serde_json::to_string(&answer).unwrap_or_default());
}

/// The file by which OpenVR's loader finds its runtime, where there is one.
pub fn registry() -> Option<PathBuf> {
    let named = std::env::var_os("VR_PATHREG_OVERRIDE").map(PathBuf::from);
    let file = named.or_else(|| Some(config_folder()?.join("openvr").join("openvrpaths.vrpath")))?;
    file.is_file().then_some(file)
}

fn end(child: &mut Child) {
    // It may have ended by itself meanwhile.
    let _ = child.kill();
    let _ = child.wait();
}

fn verdict(status: ExitStatus, text: &str) -> Result<Option<String>, String> {
    match text.lines().find_map(|line| serde_json::from_str(line).ok()) {
        Some(Answer::Ready(name)) => Ok(name),
        Some(Answer::NoHeadset) => {
            Err("the runtime finds no headset; connect it, switch it on, and look at SteamVR's window".into())
        }
        Some(Answer::Refused(refusal)) => Err(format!("no headset: {refusal}")),
        None => Err(format!("the headset runtime dies at its start ({status}); restart or reinstall SteamVR")),
    }
}

/// The loader itself writes to the terminal where the file is missing or names nothing.
fn check_registry() -> Result<(), String> {
    let Some(file) = registry() else { return Err("no headset runtime is installed (SteamVR gives one)".into()) };
    let text = std::fs::read_to_string(&file).map_err(|e| format!("{} of the headset runtime: {e}", file.display()))?;
    match runtime_folders(&text) {
        None => Err(format!("{} does not name a headset runtime; install SteamVR anew", file.display())),
        Some(folders) if !folders.iter().any(|folder| Path::new(folder).is_dir()) => {
            Err(format!("the headset runtime that {} names is not there; install SteamVR anew", file.display()))
        }
        Some(_) => Ok(()),
    }
}

fn runtime_folders(registry: &str) -> Option<Vec<String>> {
    #[derive(Deserialize)]
    struct Registry {
        runtime: Vec<String>,
    }
    let registry: Registry = serde_json::from_str(registry.trim_start_matches('\u{feff}')).ok()?;
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

    #[test]
    fn answers_survive_the_pipe_and_what_libraries_print_before_them() {
        let refusal = Refusal { code: 105, words: "old".into() };
        let status = ExitStatus::default();
        let say = |answer: &Answer| format!("chatter\n{}\n", serde_json::to_string(answer).expect("a text"));
        let ready = Answer::Ready(Some("HTC Vive".into()));
        assert_eq!(verdict(status, &say(&ready)), Ok(Some("HTC Vive".into())));
        assert_eq!(verdict(status, &say(&Answer::Ready(None))), Ok(None));
        assert!(verdict(status, &say(&Answer::Refused(refusal))).is_err_and(|e| e.contains("update SteamVR")));
        assert!(verdict(status, "Segmentation fault").is_err_and(|e| e.contains("dies at its start")));
    }
}
