//! Temporary files beside results: their names, how a whole one gets its final name, and the removal of those that killed
//! programs have left.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// What names begin with.
const PREFIX: &str = ".pbr-vr-";
/// No program leaves a temporary file alone for so long between two of its writes: who wrote it was killed. Process numbers
/// would not tell, as folders may be shared with other machines and containers.
const AGE: Duration = Duration::from_secs(3600);

/// Folders that this process has cleared.
static CLEARED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Creates an empty file in the folder of `path`, with a new name: a short one, because the path's own may have the
/// maximum length. Before the first one in a folder, those that killed programs have left there are removed.
pub fn create(path: &Path, extension: &str) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    clear_once(&path.with_file_name(""));
    loop {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let beside = path.with_file_name(format!("{PREFIX}{}-{count}.{extension}", std::process::id()));
        match File::create_new(&beside) {
            Ok(file) => return Ok((beside, file)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// Gives a whole temporary file its final name, unless a file has that: then the error is [`ErrorKind::AlreadyExists`], and
/// the temporary file stays.
pub fn publish(beside: &Path, path: &Path) -> io::Result<()> {
    match fs::hard_link(beside, path) {
        Ok(()) => fs::remove_file(beside),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(error),
        // A file system without links, such as FAT: for a moment an empty file keeps the name.
        Err(_) => {
            drop(File::create_new(path)?);
            fs::rename(beside, path).inspect_err(|_| {
                // Only the reserved name; the error says what went wrong.
                let _ = fs::remove_file(path);
            })
        }
    }
}

/// Removes what was left in a folder, once a process: a listing of a large folder takes time.
fn clear_once(folder: &Path) {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if CLEARED.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned()) {
        clear(folder);
    }
}

/// Removes old temporary files. Nothing depends on that: errors are only logged.
fn clear(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if !entry.file_name().to_str().is_some_and(is_temporary) {
            continue;
        }
        let data = entry.metadata().ok().filter(fs::Metadata::is_file);
        let age = data.and_then(|data| SystemTime::now().duration_since(data.modified().ok()?).ok());
        if age.is_some_and(|age| age > AGE) {
            let path = entry.path();
            match fs::remove_file(&path) {
                Ok(()) => tracing::debug!("{}: removed, a killed program has left it", path.display()),
                Err(error) => tracing::debug!("{}: cannot be removed: {error}", path.display()),
            }
        }
    }
}

/// Whether a name is one that [`create`] gives, or that earlier versions gave.
fn is_temporary(name: &str) -> bool {
    let parts = name.strip_prefix(PREFIX).and_then(|rest| rest.split_once('.'));
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    parts.is_some_and(|(numbers, extension)| {
        ["tmp", "png", "mp4"].contains(&extension) && numbers.splitn(2, '-').all(is_number)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_killed_programs_have_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let old = SystemTime::now() - 2 * AGE;
        let others =
            ["pbr-vr-1.png", ".pbr-vr-1-2.tmp.bak", ".pbr-vr-.tmp", ".pbr-vr-1-.tmp", ".pbr-vr-1-2-3.tmp", "a"];
        for name in [".pbr-vr-1-2.tmp", ".pbr-vr-30-4.png", ".pbr-vr-5-6.mp4", ".pbr-vr-5.mp4"].iter().chain(&others) {
            fs::write(at(name), "x").unwrap();
            File::options().write(true).open(at(name)).unwrap().set_modified(old).unwrap();
        }
        fs::create_dir(at(".pbr-vr-7-8.tmp")).unwrap();
        fs::write(at(".pbr-vr-9-9.tmp"), "of a program that runs").unwrap();
        let (own, _) = create(&at("result"), "tmp").unwrap();
        let left = |name: &&str| at(name).exists();
        assert!(others.iter().chain(&[".pbr-vr-7-8.tmp", ".pbr-vr-9-9.tmp"]).all(left));
        assert!(own.exists());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), others.len() + 3);
    }

    #[test]
    fn a_whole_file_is_published_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("whole"), "whole").unwrap();
        fs::write(at("mine"), "mine").unwrap();
        assert_eq!(publish(&at("whole"), &at("mine")).unwrap_err().kind(), ErrorKind::AlreadyExists);
        assert_eq!(fs::read(at("mine")).unwrap(), b"mine");
        publish(&at("whole"), &at("free")).unwrap();
        assert!(!at("whole").exists());
        assert_eq!(fs::read(at("free")).unwrap(), b"whole");
        assert!(publish(&at("whole"), &at("later")).is_err() && !at("later").exists());
    }
}
