//! Reading files with a size limit, writing them atomically, and finding the files that other files name.

use std::borrow::Cow;
use std::fs::{File, Permissions};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use super::temporary;
use crate::{Error, Result};

/// The whole file, if it has at most `limit` bytes; `what` names it in the error.
pub fn read(path: &Path, what: &'static str, limit: u64) -> Result<Vec<u8>> {
    check_no_pipe(path).map_err(Error::read(path))?;
    let file = File::open(path).map_err(Error::read(path))?;
    let size = file.metadata().map_err(Error::read(path))?.len();
    let too_large = |size: String| Error::TooLarge { path: path.into(), what, size, limit: format!("{limit} bytes") };
    if size > limit {
        return Err(too_large(format!("{size} bytes")));
    }
    let mut bytes = Vec::new();
    // Devices and pipes report no size: the limit holds for them too.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(Error::read(path))?;
    if bytes.len() as u64 > limit { Err(too_large(format!("over {limit} bytes"))) } else { Ok(bytes) }
}

/// An error for a named pipe, which nobody may ever write to: opening it would wait for ever. Open streams of this process
/// (`/dev/stdin`, a shell's `<(…)`) have a writer.
#[cfg(unix)]
fn check_no_pipe(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::FileTypeExt as _;
    let is_pipe = std::fs::metadata(path).is_ok_and(|data| data.file_type().is_fifo());
    if is_pipe && !is_stream(path) && !path.starts_with("/dev/stdin") {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is a pipe, not a file"));
    }
    Ok(())
}

#[cfg(not(unix))]
fn check_no_pipe(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Writes a result of the user's: readers, a crash of the program and a crash of the machine leave the old file or the
/// new one, never a part of it. The bytes go into a temporary file in the same folder, which is synced to disk and
/// renamed. (On Windows the rename itself is not synced: after a crash of the machine the old file may be back.)
///
/// An existing file keeps its mode, and a symbolic link its target. Devices and pipes are written into, not replaced.
///
/// # Errors
/// The path has no file name, or the file cannot be written.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    write_file(path, bytes, true)
}

/// The same without syncing, for caches: after a crash of the machine the file may be empty or hold garbage. So only
/// for files that carry a hash of their content and can be made again; syncing them would cost more than it saves.
///
/// # Errors
/// As for [`write_atomically`].
pub fn write_unsynced(path: &Path, bytes: &[u8]) -> Result<()> {
    write_file(path, bytes, false)
}

/// Writes a result as [`write_atomically`] does, but only under a name that no file has; returns whether it was free. The
/// name is never that of an empty file, where the file system has links.
///
/// # Errors
/// As for [`write_atomically`].
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<bool> {
    let is_taken = |error: &io::Error| error.kind() == io::ErrorKind::AlreadyExists;
    // Also of a link that leads nowhere. Only publishing decides; this saves writing.
    if path.symlink_metadata().is_ok() {
        return Ok(false);
    }
    match write_beside(path, bytes, None, true, |beside| temporary::publish(beside, path)) {
        Ok(()) => Ok(true),
        Err(error) if is_taken(&error) => Ok(false),
        Err(error) => Err(Error::write(path)(error)),
    }
}

fn write_file(path: &Path, bytes: &[u8], sync: bool) -> Result<()> {
    if path.file_name().is_none() {
        return Err(Error::Usage(format!("{}: not the name of a file", path.display())));
    }
    let written = match std::fs::metadata(path) {
        Ok(data) if data.is_file() && !is_stream(path) => {
            // Only for links: on some Windows drives canonicalising fails.
            let place = if path.is_symlink() { path.canonicalize() } else { Ok(path.to_owned()) };
            place.and_then(|place| replace(&place, bytes, Some(data.permissions()), sync))
        }
        Err(_) if !path.is_symlink() => replace(path, bytes, None, sync),
        // A device, a pipe or a dangling link.
        _ => File::options().append(true).create(true).open(path).and_then(|mut file| file.write_all(bytes)),
    };
    written.map_err(Error::write(path))
}

/// Whether the path names an open file of this process, to which others may write, too.
fn is_stream(path: &Path) -> bool {
    ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"].iter().any(|start| path.starts_with(start))
}

fn replace(path: &Path, bytes: &[u8], mode: Option<Permissions>, sync: bool) -> io::Result<()> {
    write_beside(path, bytes, mode, sync, |beside| std::fs::rename(beside, path))
}

/// Writes a temporary file, which `name` gives its final name.
fn write_beside(
    path: &Path,
    bytes: &[u8],
    mode: Option<Permissions>,
    sync: bool,
    name: impl FnOnce(&Path) -> io::Result<()>,
) -> io::Result<()> {
    let (beside, mut file) = temporary::create(path, "tmp")?;
    let mut done = file.write_all(bytes);
    if let Some(mode) = mode {
        done = done.and_then(|()| file.set_permissions(mode));
    }
    if sync {
        done = done.and_then(|()| file.sync_all());
    }
    drop(file);
    let done = done.and_then(|()| name(&beside));
    if done.is_err() {
        // The first error is the one to report; a temporary file that cannot be removed stays.
        let _ = std::fs::remove_file(&beside);
    } else if sync {
        sync_folder(path);
    }
    done
}

/// Makes a rename in the folder of `path` durable. The file is complete by now, and some file systems cannot sync a
/// folder: a failure is only logged.
#[cfg(unix)]
fn sync_folder(path: &Path) {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Err(error) = File::open(folder).and_then(|folder| folder.sync_all()) {
        tracing::debug!("{}: cannot be synced: {error}", folder.display());
    }
}

/// Windows offers no such call for folders.
#[cfg(not(unix))]
fn sync_folder(_: &Path) {}

/// The lines of a text file, ended by `\n`, `\r\n` or, where there is neither, `\r`; without a UTF-8 byte order mark.
pub fn lines(bytes: &[u8]) -> impl Iterator<Item = Cow<'_, str>> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    bytes.split(move |byte| *byte == end).map(String::from_utf8_lossy)
}

/// Whether text is UTF-16, which is not supported: by its byte order mark, or because every other byte of its beginning is 0.
pub fn is_utf16(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(64)];
    let all_zero = |first: usize| start.len() >= 4 && start.iter().skip(first).step_by(2).all(|byte| *byte == 0);
    bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") || all_zero(0) != all_zero(1)
}

/// A file found for a name, and its real name where that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    pub path: PathBuf,
    pub real_name: Option<String>,
}

/// Looks for the file that a model or material in `folder` names. `\` is a separator too; where no file has exactly
/// that name, letter case is ignored; of a path that does not exist (another computer's) only the last part counts.
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
    // A name without a folder is in the working directory.
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(listed).ok()?;
    let mut paths: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_name().is_some_and(|n| n.to_string_lossy().to_lowercase() == wanted))
        .collect();
    // The order of directory entries is arbitrary; the choice should not be.
    paths.sort();
    paths.into_iter().next().and_then(|path| Some(folder.join(path.file_name()?)))
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
    fn text_of_two_bytes_a_character_is_known_with_and_without_a_mark() {
        let wide =
            |bytes: [usize; 2]| b"v 0 0 0\n".iter().flat_map(|b| bytes.map(|on| [0, *b][on])).collect::<Vec<u8>>();
        assert!(is_utf16(&wide([0, 1])) && is_utf16(&wide([1, 0])) && is_utf16(b"\xff\xfev\0"));
        assert!(!is_utf16(b"v 0 0 0\n") && !is_utf16(&[0; 64]) && !is_utf16(b"") && !is_utf16(b"v\0"));
    }

    #[test]
    fn a_name_of_maximum_length_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n".repeat(250));
        for (write, bytes) in [(write_atomically as fn(&Path, &[u8]) -> Result<()>, "1"), (write_unsynced, "22")] {
            write(&path, bytes.as_bytes()).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), bytes.as_bytes());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a temporary file was left behind");
    }

    /// Bytes written by this thread and deleted before they came to disk, where the system counts them.
    #[cfg(target_os = "linux")]
    fn bytes_lost_before_the_disk() -> Option<u64> {
        let counts = std::fs::read_to_string("/proc/thread-self/io").ok()?;
        counts.lines().find_map(|line| line.strip_prefix("cancelled_write_bytes: ")?.parse().ok())
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn results_are_on_disk_when_they_are_written_and_caches_need_not_be() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result");
        let lost = |write: fn(&Path, &[u8]) -> Result<()>| {
            write(&path, &[1; 1 << 20]).unwrap();
            let before = bytes_lost_before_the_disk();
            std::fs::remove_file(&path).unwrap();
            Some(bytes_lost_before_the_disk()? - before?)
        };
        if lost(write_unsynced).is_none_or(|lost| lost == 0) {
            println!("skipped: this system does not count what never comes to disk");
            return;
        }
        assert_eq!(lost(write_atomically), Some(0));
    }

    #[cfg(unix)]
    #[test]
    fn links_modes_and_pipes_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("real"), "old").unwrap();
        std::fs::set_permissions(at("real"), Permissions::from_mode(0o640)).unwrap();
        symlink("real", at("link")).unwrap();
        symlink("later", at("nowhere yet")).unwrap();
        write_atomically(&at("link"), b"new").unwrap();
        write_atomically(&at("nowhere yet"), b"first").unwrap();
        assert!(at("link").is_symlink() && at("nowhere yet").is_symlink());
        assert_eq!(std::fs::read(at("real")).unwrap(), b"new");
        assert_eq!(std::fs::read(at("later")).unwrap(), b"first");
        assert_eq!(at("real").metadata().unwrap().permissions().mode() & 0o777, 0o640);
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = at("pipe");
            move || std::fs::read(pipe).unwrap()
        });
        write_atomically(&at("pipe"), b"through").unwrap();
        assert_eq!(reader.join().unwrap(), b"through");
        assert!(at("pipe").metadata().unwrap().file_type().is_fifo());
    }

    #[test]
    fn names_in_no_folder_are_found_in_any_case() {
        // Tests run in the package's folder.
        assert!(entry_any_case(Path::new(""), "cARGO.TOML").is_some_and(|path| path.is_file()));
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
