//! What the panel remembers between starts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::asset::contained::from_json;
use crate::asset::file::write_atomically;
use crate::asset::folders;

/// The file, in the user's folder for settings.
const FILE: &str = "panel.json";
/// Bytes of the file at most; a longer one was not written here.
const MAX_BYTES: u64 = 1 << 16;

/// The panel's state. Fields that a file lacks, or that another version has written, are as at the first start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Saved {
    /// Whether the panel is shown.
    pub shown: bool,
    /// Whether each section is open, by its title.
    pub sections: BTreeMap<String, bool>,
    #[serde(skip)]
    file: Option<PathBuf>,
}

impl Default for Saved {
    fn default() -> Self {
        Self { shown: true, sections: BTreeMap::new(), file: None }
    }
}

impl Saved {
    /// The state of the last start; that of the first start where there is none, or none that can be read.
    pub fn load() -> Self {
        folders::settings().map_or_else(Self::default, |folder| Self::read(&folder.join("pbr-vr").join(FILE)))
    }

    /// The same of any file.
    pub(crate) fn read(file: &Path) -> Self {
        let saved = std::fs::metadata(file)
            .ok()
            .filter(|data| data.is_file() && data.len() <= MAX_BYTES)
            .and_then(|_| std::fs::read(file).ok())
            .and_then(|bytes| match from_json::<Self>(&bytes) {
                Ok(saved) => Some(saved),
                Err(error) => {
                    tracing::debug!("{}: {error}; the panel starts anew", file.display());
                    None
                }
            });
        Self { file: Some(file.to_owned()), ..saved.unwrap_or_default() }
    }

    /// Writes the state; a failure only means that the next start does not know it.
    pub fn store(&self) {
        let Some(file) = &self.file else { return };
        let stored = serde_json::to_vec(self).map_err(std::io::Error::from).and_then(|bytes| {
            file.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            write_atomically(file, &bytes).map_err(std::io::Error::other)
        });
        if let Err(error) = stored {
            tracing::debug!("{}: not written: {error}", file.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stored_is_read_again() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("new").join(FILE);
        let mut saved = Saved::read(&file);
        assert!(saved.shown && saved.sections.is_empty());
        saved.shown = false;
        saved.sections.insert("light".into(), true);
        saved.store();
        assert_eq!(Saved::read(&file), saved);
    }

    #[test]
    fn broken_files_and_those_of_other_versions_do_no_harm() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join(FILE);
        for text in ["", "{", "[]", "{\"shown\": 7}", "{\"sections\": {\"light\": []}}", "\u{0}\u{0}"] {
            std::fs::write(&file, text).expect("a test file");
            assert_eq!(Saved { file: None, ..Saved::read(&file) }, Saved::default(), "{text}");
        }
        std::fs::write(&file, "{\"shown\": false, \"from\": \"the future\"}").expect("a test file");
        assert!(!Saved::read(&file).shown);
        std::fs::write(&file, vec![b' '; 1 << 17]).expect("a test file");
        assert!(Saved::read(&file).shown);
    }
}
