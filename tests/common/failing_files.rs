//! The library that has calls on files, and starts of threads, fail (tests/fault_files), and what must be true of the files after that.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use super::entries;
use super::failing::{Ran, small_world};

#[path = "../fault_files/src/names.rs"]
mod names;

/// The library that has calls fail; cargo builds it before every test, beside it.
const BUILT: &str = "libfault_files.so";
/// Files by their paths in a folder.
pub type Files = BTreeMap<PathBuf, Vec<u8>>;

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
pub struct Place {
    /// What is there before a run.
    pub before: Files,
    /// The driver's own cache: not ours to test, and slow to fill.
    pub driver: tempfile::TempDir,
}

impl Place {
    /// With a small scene.
    pub fn new() -> Self {
        let shop = small_world();
        let names = entries(shop.folder.path())
            .into_iter()
            .map(|(path, bytes)| (path.file_name().expect("a name").into(), bytes));
        Self { before: names.collect(), driver: tempfile::tempdir().expect("a temporary folder") }
    }

    /// Runs the program in a folder of its own, below `folder`; `run` starts it and waits for it. Then `follow` runs in the same
    /// folder, and says what is wrong there.
    pub fn ran(
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
            ran.problem = ran
                .problem
                .take()
                .or_else(|| unnamed.map(|_| "a line that does not name the file".into()))
                .or_else(|| follow(&work, &ran));
        }
        ran.calls.iter_mut().for_each(generalise);
        ran
    }

    /// The files of a folder that are new or changed, but for what the validation layer keeps beside our caches.
    pub fn written(&self, work: &Path) -> Files {
        let is_ours = |name: &Path| name.parent() != Some(Path::new("cache"));
        let is_new = |(name, bytes): &(PathBuf, Vec<u8>)| is_ours(name) && self.before.get(name) != Some(bytes);
        tree(work).into_iter().filter(is_new).collect()
    }
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

pub fn is_temporary(file: &Path) -> bool {
    file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".pbr-vr-"))
}
