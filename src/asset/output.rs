//! Checks of output paths before the work begins: writable, not written twice, not an input of the same command.

use std::io::{Error as IoError, ErrorKind};
use std::path::{Path, PathBuf};

use super::temporary;
use crate::{Error, Result};

/// The files that a command reads, and those that it will write.
pub struct Outputs {
    inputs: Vec<PathBuf>,
    files: Vec<PathBuf>,
    /// Folders that will be created if they do not exist.
    folders: Vec<PathBuf>,
}

impl Outputs {
    /// For a command that reads these files.
    pub fn of<P: AsRef<Path>>(inputs: impl IntoIterator<Item = P>) -> Self {
        Self {
            inputs: inputs.into_iter().map(|path| real(path.as_ref())).collect(),
            files: Vec::new(),
            folders: Vec::new(),
        }
    }

    /// Adds a file that will be written.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is an input or another output, [`Error::Write`] if it cannot be written.
    pub fn file(&mut self, path: &Path) -> Result<()> {
        let failed = |error| Err(Error::write(path)(error));
        match path.metadata() {
            Ok(data) if data.is_dir() => return failed(ErrorKind::IsADirectory.into()),
            // Devices and pipes may be written several times.
            Ok(data) if !data.is_file() => return Ok(()),
            Err(error) if error.kind() != ErrorKind::NotFound => return failed(error),
            _ => {}
        }
        let place = real(path);
        if let Some(folder) =
            place.parent().filter(|folder| !folder.is_dir() && !self.folders.iter().any(|f| f == folder))
        {
            let problem = format!("the folder {} does not exist", folder.display());
            return failed(IoError::new(ErrorKind::NotFound, problem));
        }
        check_folder(&place).map_err(Error::write(path))?;
        self.add(path, place)
    }

    /// [`Self::file`] where there is a path.
    pub fn file_if(&mut self, path: Option<&Path>) -> Result<()> {
        path.map_or(Ok(()), |path| self.file(path))
    }

    /// Adds files in a folder, which may not exist yet.
    pub fn folder(&mut self, folder: &Path, names: &[&str]) -> Result<()> {
        let place = real(folder);
        check_folder(&place.join("file")).map_err(Error::write(folder))?;
        names.iter().try_for_each(|name| self.add(&folder.join(name), real(&place.join(name))))?;
        self.folders.push(place);
        Ok(())
    }

    fn add(&mut self, path: &Path, place: PathBuf) -> Result<()> {
        let what = if self.inputs.contains(&place) {
            "is read by this command, and would be overwritten"
        } else if self.files.contains(&place) {
            "would be written twice by this command"
        } else {
            self.files.push(place);
            return Ok(());
        };
        Err(Error::Usage(format!("{} {what}; choose another name", path.display())))
    }
}

/// The absolute path with links resolved, as far as it exists.
fn real(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let found = path.ancestors().find_map(|there| Some((there, there.canonicalize().ok()?)));
    // Joining nothing would add a separator.
    match found.and_then(|(there, real)| Some((path.strip_prefix(there).ok()?, real))) {
        Some((rest, real)) if rest.as_os_str().is_empty() => real,
        Some((rest, real)) => real.join(rest),
        None => path,
    }
}

/// Whether a file can be created in the folder of `place`, or in its nearest ancestor that exists.
fn check_folder(place: &Path) -> std::io::Result<()> {
    let there = |folder: &&Path| folder.symlink_metadata().is_ok();
    let Some(folder) = place.ancestors().skip(1).find(there) else { return Ok(()) };
    if !folder.is_dir() {
        return Err(IoError::from(ErrorKind::NotADirectory));
    }
    let (probe, file) = temporary::create(&folder.join("file"), "tmp")?;
    drop(file);
    std::fs::remove_file(probe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_and_repeated_outputs_are_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        std::fs::write(at("in"), "").unwrap();
        let mut outputs = Outputs::of([at("in"), at("not there")]);
        let refused = |result: Result<()>| matches!(result, Err(Error::Usage(_)));
        assert!(refused(outputs.file(&at("sub/../in"))));
        assert!(refused(outputs.file(&at("sub/../not there"))));
        assert!(refused(outputs.folder(folder.path(), &["a", "in"])));
        outputs.file(&at("out")).unwrap();
        assert!(refused(outputs.file(&at("sub/../out"))));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("in"), at("link")).unwrap();
            assert!(refused(outputs.file(&at("link"))));
            outputs.file(Path::new("/dev/null")).unwrap();
            outputs.file(Path::new("/dev/null")).unwrap();
        }
        outputs.folder(&at("new/folder"), &["x"]).unwrap();
        assert!(!at("new").exists(), "checked, not created");
        assert!(refused(outputs.folder(&at("new/folder"), &["x"])));
        outputs.file(&at("new/folder/y")).unwrap();
    }

    #[test]
    fn unwritable_outputs_are_errors_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("file"), "").unwrap();
        let mut outputs = Outputs::of([] as [&Path; 0]);
        for name in ["none/a", "file/a", ""] {
            assert!(matches!(outputs.file(&at(name)), Err(Error::Write { .. })), "{name}");
        }
        assert!(outputs.file(&at("none/a")).unwrap_err().to_string().contains("none does not exist"));
        assert!(matches!(outputs.folder(&at("file/new"), &["a"]), Err(Error::Write { .. })));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a probe was left behind");
    }
}
