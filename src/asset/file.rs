//! Reading files with a limit on their size, writing them whole, and finding the files that other files name.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::{Error, Result};

/// The whole file, if it has at most `limit` bytes; `what` names it in the error.
pub fn read(path: &Path, what: &'static str, limit: u64) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(Error::read(path))?;
    let size = file.metadata().map_err(Error::read(path))?.len();
    let too_large = |size: String| Error::TooLarge { path: path.into(), what, size, limit: format!("{limit} bytes") };
    if size > limit {
        return Err(too_large(format!("{size} bytes")));
    }
    let mut bytes = Vec::new();
    // Not every file tells its size (devices, pipes): the limit holds for them too.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(Error::read(path))?;
    if bytes.len() as u64 > limit { Err(too_large(format!("over {limit} bytes"))) } else { Ok(bytes) }
}

/// Writes a file so that a reader, or a crash, meets it whole or not at all: beside its place first, then renamed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let Some(name) = path.file_name() else {
        return Err(Error::Usage(format!("{}: not the name of a file", path.display())));
    };
    let unique = format!(".{}-{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let mut beside = name.to_owned();
    beside.push(unique);
    let beside = path.with_file_name(beside);
    let done = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    if done.is_err() {
        // Nothing more can be done about a file that neither moves nor goes; the first error is the one to tell.
        let _ = std::fs::remove_file(&beside);
    }
    done.map_err(Error::write(path))
}

/// A file found for a name, and how it is really called where that differs from the name.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    pub path: PathBuf,
    pub real_name: Option<String>,
}

/// Looks for the file that a model or material in `folder` calls `name`: `\` is a separator too; where nothing has
/// exactly that name, letter case is ignored, and of a path that leads nowhere (another computer's) the last part counts.
pub fn find(folder: &Path, name: &str) -> Option<Found> {
    let name = name.replace('\\', "/");
    let exact = folder.join(&name);
    if exact.is_file() {
        return Some(Found { path: exact, real_name: None });
    }
    let last = name.rsplit('/').next().unwrap_or(&name);
    find_any_case(folder, &name).or_else(|| find_any_case(folder, last)).map(|path| {
        let real = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned();
        Found { real_name: Some(real), path }
    })
}

fn find_any_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let mut path = folder.to_owned();
    for part in name.split('/').filter(|part| !part.is_empty()) {
        let next = path.join(part);
        path = if part == "." || part == ".." || next.exists() { next } else { entry_any_case(&path, part)? };
    }
    path.is_file().then_some(path)
}

fn entry_any_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let wanted = name.to_lowercase();
    let entries = std::fs::read_dir(folder).ok()?;
    let mut paths: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_name().is_some_and(|n| n.to_string_lossy().to_lowercase() == wanted))
        .collect();
    // The folder's order is the file system's whim; the choice should not be.
    paths.sort();
    paths.into_iter().next()
}

/// A path's last part, for messages.
pub fn short_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limit_is_checked_before_reading() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, [0; 10]).unwrap();
        assert_eq!(read(&path, "file", 10).unwrap().len(), 10);
        assert!(matches!(read(&path, "file", 9), Err(Error::TooLarge { .. })));
        assert!(matches!(read(&folder.path().join("b"), "file", 9), Err(Error::Read { .. })));
        assert!(read(folder.path(), "file", 1 << 20).is_err(), "a folder is no file");
    }

    #[test]
    fn names_are_found_in_any_case_and_with_any_separator() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("Textures")).unwrap();
        std::fs::write(folder.path().join("Textures/My Stone.JPG"), b"x").unwrap();
        let found = |name: &str| find(folder.path(), name);
        let exact = found("Textures\\My Stone.JPG").unwrap();
        assert!(exact.real_name.is_none() && exact.path.is_file());
        assert!(found("textures/my stone.jpg").is_some_and(|f| f.path.is_file()));
        assert!(found("./TEXTURES/MY STONE.jpg").is_some());
        assert_eq!(found("nothing.jpg"), None);
        assert_eq!(found(""), None, "the folder itself is no file");
        let elsewhere = find(&folder.path().join("Textures"), "C:\\old\\pc\\my stone.jpg").unwrap();
        // Windows opens it by any case, and the name stays as it was asked for.
        assert!(elsewhere.real_name.is_some_and(|name| name.eq_ignore_ascii_case("My Stone.JPG")));
    }
}
