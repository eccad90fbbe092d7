//! The Vulkan layer that lets calls fail (tests/fault_layer), between a program and its driver.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use fault_layer::{BELOW_VALIDATION, BUDGET, CALL, FILE, GPU, LAYER, LOG};

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
        [("VK_ADD_LAYER_PATH", folder), ("VK_INSTANCE_LAYERS", LAYER.into()), (FILE, self.file().into())]
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

    /// What a program that runs with `--validate` needs to find a weak GPU, of the words in `tests/fault_layer/src/weak.rs`. The layer
    /// lies below that of validation, which so takes the weak GPU for the driver's.
    pub fn weak(&self, gpu: &str) -> [(&'static str, OsString); 3] {
        let folder = self.folder.clone().into_os_string();
        [("VK_ADD_LAYER_PATH", folder), ("VK_INSTANCE_LAYERS", BELOW_VALIDATION.into()), (GPU, gpu.into())]
    }

    /// The same with a budget of memory, which [`FaultLayer::set_budget`] has set before.
    pub fn with_budget(&self, gpu: &str) -> [(&'static str, OsString); 4] {
        let [folder, layers, gpu] = self.weak(gpu);
        [folder, layers, gpu, (BUDGET, self.folder.join("budget").into())]
    }

    /// Leaves the program so many MiB of the GPU's memory from now on.
    pub fn set_budget(&self, mib: u64) {
        let whole = self.folder.join("budget-to-be");
        std::fs::write(&whole, mib.to_string()).expect("a test file");
        std::fs::rename(whole, self.folder.join("budget")).expect("a test file");
    }

    /// What a program that runs with `--validate` needs for its call of this number to fail; 0: none. The calls are listed in a
    /// file. The layer lies above that of validation, which never sees a call that fails: of a device that is lost it would take all
    /// objects to be in use for ever (1.3.239).
    pub fn failing(&self, number: u64, list: &Path) -> [(&'static str, OsString); 4] {
        [
            ("VK_ADD_LAYER_PATH", self.folder.clone().into_os_string()),
            ("VK_INSTANCE_LAYERS", LAYER.into()),
            (CALL, number.to_string().into()),
            (LOG, list.into()),
        ]
    }
}
