//! The test runtime, installed for one program: where the loader finds it, its script, and what it wrote.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use headset_runtime::script::{SCRIPT_VARIABLE, Script};
use serde_json::{Value, json};

/// Where the loader looks inside an installation, and the library's name as cargo builds it.
const INSTALLED: &str = if cfg!(windows) { "bin/vrclient_x64.dll" } else { "bin/linux64/vrclient.so" };
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

    /// The picture that an eye was shown in a frame.
    pub fn picture(&self, frame: u64, eye: &str) -> PathBuf {
        self.folder.join(format!("frame-{frame:06}-{eye}.png"))
    }
}
