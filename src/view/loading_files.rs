//! The files that are being loaded, oldest first, and what they are loaded for.

use std::collections::VecDeque;
use std::path::Path;

use super::loader::file_name;
use crate::render::{Change, RenderSettings};

/// A file that is being loaded: a panorama, which brings light, or a scene.
struct LoadingFile {
    name: String,
    brings: Change,
    settings: RenderSettings,
}

/// The files that are being loaded, in the order in which they will be done.
#[derive(Default)]
pub struct LoadingFiles {
    files: VecDeque<LoadingFile>,
}

impl LoadingFiles {
    /// Adds a file that is loaded with these settings.
    pub fn begin(&mut self, path: &Path, brings: Change, settings: &RenderSettings) {
        self.files.push_back(LoadingFile { name: file_name(path), brings, settings: settings.clone() });
    }

    /// Removes the oldest file: it is loaded, or cannot be.
    pub fn end(&mut self) {
        self.files.pop_front();
    }

    /// Names without folders, oldest first.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|file| file.name.as_str())
    }

    /// The number of files.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether nothing is being loaded.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Whether one of them leaves less than `change` to be made for the wanted settings.
    pub fn leave_less(&self, change: Change, wanted: &RenderSettings) -> bool {
        let leaves_less = |file: &LoadingFile| file.brings >= change && file.settings.difference(wanted) < change;
        self.files.iter().any(leaves_less)
    }
}
