//! Screenshots: numbered PNG files that never overwrite anything.

use std::path::{Path, PathBuf};

use crate::asset::file::write_new;
use crate::asset::folders;
use crate::asset::picture::Picture;
use crate::{Result, say};

/// Writes a screenshot of RGBA bytes, `size` pixels, into the working folder, or else into the user's pictures folder: a
/// program that was started from a menu may have a working folder that it cannot write to.
///
/// # Errors
/// [`crate::Error::Write`] of the working folder where neither can be written.
pub fn write(pixels: &[u8], size: [u32; 2]) -> Result<PathBuf> {
    write_into(pixels, size, Path::new(""), folders::pictures())
}

/// Prints where a screenshot is, or why there is none.
pub fn report(written: &Result<PathBuf>) {
    match written {
        Ok(path) => say!("pbr-vr: wrote {}", path.display()),
        Err(error) => crate::complain!("pbr-vr: {error}"),
    }
}

fn write_into(pixels: &[u8], size: [u32; 2], folder: &Path, pictures: Option<PathBuf>) -> Result<PathBuf> {
    match (write_numbered(pixels, size, folder), pictures) {
        (Err(error), Some(pictures)) => write_numbered(pixels, size, &pictures).map_err(|_| error),
        (written, _) => written,
    }
}

/// Writes `pbr-vr-N.png` with the first N that no file has.
fn write_numbered(pixels: &[u8], [width, height]: [u32; 2], folder: &Path) -> Result<PathBuf> {
    let picture = Picture::from_srgb8("screenshot", width, height, pixels);
    let bytes = picture.to_bytes(&numbered(folder, 1))?;
    first_free(|number| numbered(folder, number), |path| write_new(path, &bytes))
}

/// The name of a screenshot.
pub fn numbered(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("pbr-vr-{number}.png"))
}

/// The first of some names, counted from 1, under which `write` could write because no file had it.
///
/// # Errors
/// Those of `write`.
pub fn first_free(name: impl Fn(u32) -> PathBuf, write: impl Fn(&Path) -> Result<bool>) -> Result<PathBuf> {
    let mut number = 1;
    loop {
        let path = name(number);
        if write(&path)? {
            return Ok(path);
        }
        number += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screenshots_never_overwrite() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("pbr-vr-2.png"), "mine").expect("a test file");
        let write = || write_numbered(&[255, 0, 0, 255], [1, 1], folder.path()).expect("a screenshot");
        let name = |path: PathBuf| path.file_name().expect("a name").to_string_lossy().into_owned();
        assert_eq!((name(write()), name(write())), ("pbr-vr-1.png".into(), "pbr-vr-3.png".into()));
        assert_eq!(std::fs::read(folder.path().join("pbr-vr-2.png")).expect("as before"), b"mine");
        let read = Picture::read(&folder.path().join("pbr-vr-3.png")).expect("a picture");
        assert_eq!(read.pixels, [[1.0, 0.0, 0.0]]);
    }

    #[test]
    fn a_folder_that_is_not_there_is_one_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = write_numbered(&[0; 4], [1, 1], &folder.path().join("none")).expect_err("nowhere to write");
        assert!(error.to_string().contains("pbr-vr-1.png"), "{error}");
    }

    #[test]
    fn where_nothing_can_be_written_a_screenshot_goes_among_the_pictures() {
        let pictures = tempfile::tempdir().expect("a temporary folder");
        let keep = |folder: &str, into: PathBuf| write_into(&[0; 4], [1, 1], &pictures.path().join(folder), Some(into));
        let kept = keep("none", pictures.path().into()).expect("a screenshot");
        assert_eq!(kept, pictures.path().join("pbr-vr-1.png"));
        assert!(kept.is_file());
        let error = keep("none", pictures.path().join("neither")).expect_err("nowhere to write").to_string();
        assert!(error.contains("none") && !error.contains("neither"), "the folder that was meant: {error}");
    }
}
