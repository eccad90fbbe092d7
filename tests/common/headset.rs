//! The test runtime, installed for one program: where the loader finds it, its script, and what it wrote.

use std::env;
use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::io::{Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use headset_runtime::script::{SCRIPT_VARIABLE, Script};
use serde_json::{Value, json};

/// Where the loader looks inside an installation, and the library's name as cargo builds it.
pub const INSTALLED: &str = if cfg!(windows) { "bin/vrclient_x64.dll" } else { "bin/linux64/vrclient.so" };
const BUILT: &str = if cfg!(windows) { "headset_runtime.dll" } else { "libheadset_runtime.so" };

/// An installed runtime in a folder.
pub struct Headset {
    folder: PathBuf,
}

impl Headset {
    /// Installs the runtime with a script into `folder`/headset.
    pub fn install(folder: &Path, script: &Script) -> Self {
        let headset = Self { folder: folder.join("headset") };
        let installed = headset.folder.join(INSTALLED);
        fs::create_dir_all(installed.parent().expect("a folder")).expect("a folder");
        // As a dev-dependency it is built before every test and lies beside it.
        let tests = env::current_exe().expect("this test").parent().expect("its folder").to_owned();
        fs::copy(tests.join(BUILT), installed).expect("the built runtime");
        headset.write_registry(&headset.folder);
        headset.rewrite(script);
        headset
    }

    /// Lets the loader look for a runtime in `folder`.
    pub fn write_registry(&self, folder: &Path) {
        let registry = json!({
            "version": 1, "jsonid": "vrpathreg", "runtime": [folder], "config": [folder], "log": [folder],
        });
        fs::write(self.folder.join("openvrpaths.vrpath"), registry.to_string()).expect("the registry");
    }

    /// Another script from the next start on.
    pub fn rewrite(&self, script: &Script) {
        let text = toml::to_string(script).expect("a script");
        fs::write(self.folder.join("script.toml"), text).expect("the script");
    }

    /// What a program needs in its environment to find it.
    pub fn environment(&self) -> [(&'static str, OsString); 2] {
        let file = |name| self.folder.join(name).into_os_string();
        [("VR_PATHREG_OVERRIDE", file("openvrpaths.vrpath")), (SCRIPT_VARIABLE, file("script.toml"))]
    }

    /// Every call so far, oldest first.
    pub fn calls(&self) -> Vec<Value> {
        let text = fs::read_to_string(self.folder.join("calls.jsonl")).unwrap_or_default();
        text.lines().map(|line| serde_json::from_str(line).expect("a call")).collect()
    }

    /// Those of one name.
    pub fn calls_of(&self, name: &str) -> Vec<Value> {
        self.calls().into_iter().filter(|call| call["call"] == name).collect()
    }

    /// The frame that the run under way has come to.
    pub fn frame(&self) -> u64 {
        const TAIL: u64 = 4096;
        let Ok(mut file) = fs::File::open(self.folder.join("calls.jsonl")) else { return 0 };
        let length = file.metadata().expect("a length").len();
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).expect("a place");
        let mut tail = String::new();
        file.read_to_string(&mut tail).expect("the log's end");
        let last = tail.lines().rev().find_map(|line| serde_json::from_str::<Value>(line).ok());
        last.and_then(|call| call["frame"].as_u64()).unwrap_or(0)
    }

    /// The picture that an eye was shown in a frame.
    pub fn picture(&self, frame: u64, eye: &str) -> PathBuf {
        self.folder.join(format!("frame-{frame:06}-{eye}.png"))
    }
}

/// Longer than anything here takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// How a run of the program ended.
pub struct Ran {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
    pub took: Duration,
}

impl Ran {
    /// It ended well and the validation layer had nothing to say.
    pub fn assert_clean(&self) -> &Self {
        assert_eq!(self.code, Some(0), "{self}");
        assert!(!self.err.contains("validation"), "{self}");
        self
    }

    /// It failed with one line that names each part.
    pub fn assert_fails_with(&self, parts: &[&str]) -> &Self {
        assert_eq!(self.code, Some(1), "{self}");
        let line = self.err.lines().last().unwrap_or_default();
        assert!(line.starts_with("pbr-vr: ") && parts.iter().all(|part| line.contains(part)), "{parts:?}: {self}");
        self
    }
}

impl fmt::Display for Ran {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "exit {:?} after {:?}\nstdout: {}\nstderr: {}", self.code, self.took, self.out, self.err)
    }
}

/// The program's arguments in a folder, without a display.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // The light of these small scenes is the same in all runs.
    let cache = concat!(env!("CARGO_TARGET_TMPDIR"), "/headset-cache");
    command.env("XDG_CACHE_HOME", cache).env("LOCALAPPDATA", cache);
    // Neither a desktop nor a headset of the machine that the tests run on.
    command.env("XDG_CONFIG_HOME", folder.join("nothing"));
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "VR_PATHREG_OVERRIDE"] {
        command.env_remove(name);
    }
    command
}

/// Waits for a program's end; one that does not end fails the test.
pub fn finish(mut child: Child) -> Ran {
    let started = Instant::now();
    // Pipes are emptied meanwhile: a full one would stop the program.
    fn drain(mut pipe: impl Read + Send + 'static) -> JoinHandle<String> {
        thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).expect("a pipe");
            String::from_utf8_lossy(&bytes).into_owned()
        })
    }
    let out = drain(child.stdout.take().expect("a pipe"));
    let err = drain(child.stderr.take().expect("a pipe"));
    let mut is_late = false;
    while child.try_wait().expect("a child").is_none() {
        if started.elapsed() > PATIENCE && !is_late {
            is_late = true;
            child.kill().expect("an end");
        }
        thread::sleep(Duration::from_millis(5));
    }
    let took = started.elapsed();
    let code = child.wait().expect("an end").code();
    let ran = Ran { code, out: out.join().expect("stdout"), err: err.join().expect("stderr"), took };
    assert!(!is_late, "it does not end: {ran}");
    ran
}

impl Headset {
    /// Starts the program on this headset, with the validation layer.
    pub fn start(&self, folder: &Path, arguments: &[&str]) -> Child {
        self.start_with(folder, arguments, [])
    }

    /// The same with more in its environment.
    pub fn start_with<const N: usize>(
        &self,
        folder: &Path,
        arguments: &[&str],
        environment: [(&str, OsString); N],
    ) -> Child {
        let mut command = command(folder, &[arguments, &["--validate"]].concat());
        command.envs(self.environment()).envs(environment).spawn().expect("the program starts")
    }

    /// Runs it to its end; a call that no program should make fails the test.
    pub fn run(&self, folder: &Path, arguments: &[&str]) -> Ran {
        let ran = finish(self.start(folder, arguments));
        let faults = self.calls_of("Fault");
        assert!(faults.is_empty(), "{faults:?}: {ran}");
        ran
    }
}
