//! The Vulkan layer that loses the GPU (tests/fault_layer), between a program and its driver.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use fault_layer::{LAYER, VARIABLE};

const BUILT: &str = if cfg!(windows) { "fault_layer.dll" } else { "libfault_layer.so" };
const PATIENCE: Duration = Duration::from_secs(60);

/// The layer, installed in a folder.
pub struct FaultLayer {
    folder: PathBuf,
}

impl FaultLayer {
    pub fn install(folder: &Path) -> Self {
        // As a dev-dependency it is built before every test and lies beside it.
        let tests = std::env::current_exe().expect("this test").parent().expect("its folder").to_owned();
        fault_layer::install(folder, &tests.join(BUILT)).expect("a manifest");
        Self { folder: folder.to_owned() }
    }

    fn file(&self) -> PathBuf {
        self.folder.join("fault")
    }

    /// What a program needs in its environment to have it.
    pub fn environment(&self) -> [(&'static str, OsString); 3] {
        let folder = self.folder.clone().into_os_string();
        [("VK_ADD_LAYER_PATH", folder), ("VK_INSTANCE_LAYERS", LAYER.into()), (VARIABLE, self.file().into())]
    }

    /// The next call of this function finds the GPU lost.
    pub fn lose_in(&self, function: &str) {
        let whole = self.folder.join("fault-to-be");
        std::fs::write(&whole, function).expect("a test file");
        std::fs::rename(whole, self.file()).expect("a test file");
    }

    /// Waits until it was.
    pub fn wait(&self) {
        let started = Instant::now();
        while self.file().exists() {
            assert!(started.elapsed() < PATIENCE, "the function is never called");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}
