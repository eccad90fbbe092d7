//! What the app tells an output of the loader's results.

use std::path::PathBuf;

use crate::{Error, Result};

/// A result of the loader.
pub enum Update {
    /// Another scene is shown, or the same one again.
    Scene(Arrival),
    /// The scene is lit by the panorama of this name.
    Light(String),
    /// The scene is drawn with other settings.
    Settings,
    /// The scene is drawn with better textures; says why. Worse ones are a warning of the report.
    Textures(String),
    /// A screenshot was written.
    Screenshot(Result<PathBuf>),
    /// A file could not be loaded; nothing has changed.
    Failed(Error),
}

/// What a scene that is shown takes the place of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    First,
    /// Another scene, or one that was opened again.
    Next,
    /// The same scene, loaded again for other settings or for another GPU: everything that a person has changed stays.
    Again,
}
