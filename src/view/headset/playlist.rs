//! What a press of a controller's button goes to next: the shipped scenes and panoramas, in turn.

use std::path::{Path, PathBuf};

use crate::asset::shipped;
use crate::scene::description::Description;

/// Two lists of files, each with a place in it.
#[derive(Default)]
pub struct Playlist {
    scenes: Turn,
    panoramas: Turn,
}

#[derive(Default)]
struct Turn {
    files: Vec<PathBuf>,
    at: Option<usize>,
}

impl Playlist {
    /// Of all that is shipped and whose files are there; begins after `scene`, if that is among it.
    pub fn new(scene: &Path) -> Self {
        shipped::folder().map_or_else(|_| Self::default(), |folder| Self::of(&folder, scene))
    }

    fn of(folder: &Path, scene: &Path) -> Self {
        let mut scenes = Turn::new(&folder.join("scenes"), &["toml"]);
        // Some descriptions are of models that do not come with the program.
        scenes.files.retain(|file| Description::load(file).is_ok());
        scenes.at = scenes.files.iter().position(|file| file.file_name() == scene.file_name());
        Self { scenes, panoramas: Turn::new(&folder.join("panoramas"), &["hdr", "exr"]) }
    }

    /// The next scene; `None` if there is no other.
    pub fn next_scene(&mut self) -> Option<PathBuf> {
        self.scenes.next()
    }

    /// The next panorama.
    pub fn next_panorama(&mut self) -> Option<PathBuf> {
        self.panoramas.next()
    }
}

impl Turn {
    fn new(folder: &Path, extensions: &[&str]) -> Self {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let wanted = |file: &PathBuf| extensions.iter().any(|e| file.extension().is_some_and(|is| is == *e));
        let mut files: Vec<PathBuf> = entries.filter(wanted).collect();
        files.sort();
        Self { files, at: None }
    }

    fn next(&mut self) -> Option<PathBuf> {
        let next = self.at.map_or(0, |at| at + 1) % self.files.len().max(1);
        if self.at == Some(next) {
            return None;
        }
        self.at = Some(next);
        self.files.get(next).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_in_turn_and_a_single_one_only_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let add = |name: &str| std::fs::write(folder.path().join(name), "").expect("a test file");
        assert_eq!(Turn::new(folder.path(), &["toml"]).next(), None);
        add("b.toml");
        let names = |turn: &mut Turn, count| -> Vec<Option<String>> {
            let name = |file: PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (0..count).map(|_| turn.next().map(name)).collect()
        };
        assert_eq!(names(&mut Turn::new(folder.path(), &["toml"]), 2), [Some("b.toml".into()), None]);
        ["a.toml", "c.obj"].into_iter().for_each(add);
        let names = names(&mut Turn::new(folder.path(), &["toml", "hdr"]), 3);
        assert_eq!(names, [Some("a.toml".into()), Some("b.toml".into()), Some("a.toml".into())]);
    }

    #[test]
    fn the_shown_scene_is_not_shown_again_at_once() {
        let next = Playlist::new(Path::new("elsewhere/demo.toml")).next_scene().expect("shipped scenes");
        assert!(!next.ends_with("demo.toml"), "{}", next.display());
    }

    #[test]
    fn scenes_without_their_models_are_passed_over() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let scenes = folder.path().join("scenes");
        std::fs::create_dir(&scenes).expect("a folder");
        for (name, model) in [("a", "a.obj"), ("b", "b.obj"), ("c", "${PBR_VR_SCENES}/not/there.obj"), ("d", "a.obj")] {
            let text = format!("[[model]]\nfile = \"{model}\"\n");
            std::fs::write(scenes.join(name).with_extension("toml"), text).expect("a scene");
        }
        std::fs::write(scenes.join("a.obj"), "").expect("a model");
        let mut playlist = Playlist::of(folder.path(), Path::new("a.toml"));
        let mut next = || playlist.next_scene().expect("a scene").file_stem().unwrap_or_default().to_owned();
        assert_eq!([next(), next(), next()], ["d", "a", "d"]);
    }
}
