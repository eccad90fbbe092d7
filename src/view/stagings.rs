//! What a scene is loaded with besides its file: what the command line says of the first one, and the panorama that a person
//! has chosen.

use std::path::{Path, PathBuf};

use super::loader::own_panorama;
use super::shown_scene::ShownScene;
use crate::scene::staging::Staging;

/// How scenes are staged.
#[derive(Default)]
pub struct Stagings {
    /// The scene of the command line, and what that says of it.
    first: Option<(PathBuf, Staging)>,
    /// The panorama that was chosen for the scene that is shown, and stays with the next ones that name none.
    chosen: Option<PathBuf>,
}

impl Stagings {
    /// Sets the scene of the command line, which keeps its stage whenever it is loaded again.
    pub fn set_first(&mut self, path: &Path, staging: Staging) {
        self.first = Some((path.to_owned(), staging));
    }

    /// The scene of the command line.
    pub fn first(&self) -> Option<&Path> {
        self.first.as_ref().map(|(path, _)| path.as_path())
    }

    /// How a scene is staged after the one that is shown. One that names no panorama keeps that which was chosen before.
    pub fn of(&mut self, path: &Path, shown: Option<&ShownScene>) -> Staging {
        if let Some(scene) = shown {
            let (asked, loaded) = (&scene.last_panorama, &scene.loaded.panorama);
            self.chosen =
                if asked == loaded { self.chosen.take().filter(|c| Some(c) == loaded.as_ref()) } else { asked.clone() };
        }
        let mut staging = Staging::default();
        if let Some((_, first)) = self.first.as_mut().filter(|(first, _)| first == path) {
            staging = first.clone();
            // Once: the file may be edited while the window is open.
            first.write_scene = None;
        }
        if self.chosen.is_some() && own_panorama(path).is_none() {
            staging.panorama.clone_from(&self.chosen);
        }
        staging
    }
}
