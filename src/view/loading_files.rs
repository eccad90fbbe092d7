//! The files that are being loaded, oldest first.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use super::loader::file_name;

/// A file that is being loaded.
struct LoadingFile {
    path: PathBuf,
    is_panorama: bool,
}

/// The files that are being loaded, in the order in which they will be done.
#[derive(Default)]
pub struct LoadingFiles {
    files: VecDeque<LoadingFile>,
}

impl LoadingFiles {
    /// Adds a scene.
    pub fn begin_scene(&mut self, path: &Path) {
        self.files.push_back(LoadingFile { path: path.to_owned(), is_panorama: false });
    }

    /// Adds a panorama.
    pub fn begin_panorama(&mut self, path: &Path) {
        self.files.push_back(LoadingFile { path: path.to_owned(), is_panorama: true });
    }

    /// Removes the oldest file and returns its path: it is loaded, or cannot be.
    pub fn end(&mut self) -> Option<PathBuf> {
        self.files.pop_front().map(|file| file.path)
    }

    /// Names without folders, oldest first.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.files.iter().map(|file| file_name(&file.path))
    }

    /// The number of files.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether nothing is being loaded.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The panorama that was asked for last.
    pub fn last_panorama(&self) -> Option<&Path> {
        self.files.iter().rev().find(|file| file.is_panorama).map(|file| file.path.as_path())
    }
}
