//! The playlist: shipped scenes and panoramas that controller buttons step through.

use std::path::{Path, PathBuf};

use crate::asset::shipped;
use crate::scene::description::Description;

/// The shipped scenes and panoramas, and which of them are shown.
#[derive(Default)]
pub struct Playlist {
    scenes: Cycle,
    panoramas: Cycle,
}

/// Files in order, and the index of the current one, if it is among them.
#[derive(Default)]
struct Cycle {
    files: Vec<PathBuf>,
    at: Option<usize>,
}

impl Playlist {
    /// Of all shipped files. Scenes whose models are missing are left out.
    pub fn new() -> Self {
        shipped::folder().map_or_else(|_| Self::default(), |folder| Self::of(&folder))
    }

    fn of(folder: &Path) -> Self {
        let mut scenes = Cycle::new(&folder.join("scenes"), &["toml"]);
        scenes.files.retain(|file| Description::load(file).is_ok());
        Self { scenes, panoramas: Cycle::new(&folder.join("panoramas"), &["hdr", "exr"]) }
    }

    /// Notes that a scene (description or model) is shown, under its own panorama.
    pub fn set_scene(&mut self, scene: &Path) {
        self.scenes.set(scene);
        let environment = Description::load(scene).ok().and_then(|description| description.environment);
        let panorama = environment.map(|environment| environment.panorama);
        self.panoramas.set(panorama.as_deref().unwrap_or(Path::new(shipped::PANORAMA)));
    }

    /// Notes that a panorama is shown.
    pub fn set_panorama(&mut self, panorama: &Path) {
        self.panoramas.set(panorama);
    }

    /// The scene after the one that is shown or was requested last; `None` if there is no other.
    pub fn next_scene(&mut self) -> Option<PathBuf> {
        self.scenes.next()
    }

    /// The same for panoramas.
    pub fn next_panorama(&mut self) -> Option<PathBuf> {
        self.panoramas.next()
    }
}

impl Cycle {
    fn new(folder: &Path, extensions: &[&str]) -> Self {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let wanted = |file: &PathBuf| extensions.iter().any(|e| file.extension().is_some_and(|is| is == *e));
        let mut files: Vec<PathBuf> = entries.filter(wanted).collect();
        files.sort();
        Self { files, at: None }
    }

    /// Makes a file the current one, by name; if it is not among them, the next is the first.
    fn set(&mut self, file: &Path) {
        self.at = self.files.iter().position(|known| known.file_name() == file.file_name());
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
    fn files_repeat_in_order_and_a_single_one_comes_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let add = |name: &str| std::fs::write(folder.path().join(name), "").expect("a test file");
        assert_eq!(Cycle::new(folder.path(), &["toml"]).next(), None);
        add("b.toml");
        let names = |cycle: &mut Cycle, count| -> Vec<Option<String>> {
            let name = |file: PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (0..count).map(|_| cycle.next().map(name)).collect()
        };
        assert_eq!(names(&mut Cycle::new(folder.path(), &["toml"]), 2), [Some("b.toml".into()), None]);
        ["a.toml", "c.obj"].into_iter().for_each(add);
        let names = names(&mut Cycle::new(folder.path(), &["toml", "hdr"]), 3);
        assert_eq!(names, [Some("a.toml".into()), Some("b.toml".into()), Some("a.toml".into())]);
    }

    #[test]
    fn what_is_shown_is_not_the_next() {
        let mut playlist = Playlist::new();
        let scene = shipped::folder().expect("assets").join(shipped::DEMO);
        playlist.set_scene(&scene);
        assert_ne!(playlist.next_scene().expect("shipped scenes"), scene);
        let own = Description::load(&scene).expect("the demo").environment.expect("its panorama").panorama;
        let next = playlist.next_panorama().expect("shipped panoramas");
        assert_ne!(next.file_name(), own.file_name());
        playlist.set_scene(Path::new("model.obj"));
        let shown: Vec<PathBuf> = (1..shipped::PANORAMAS.len()).filter_map(|_| playlist.next_panorama()).collect();
        assert!(shown.len() > 1 && !shown.iter().any(|file| file.ends_with(shipped::PANORAMA)), "{shown:?}");
        playlist.set_panorama(Path::new("elsewhere/forest.exr"));
        assert!(!playlist.next_panorama().expect("another").ends_with("forest.exr"));
    }

    #[test]
    fn scenes_without_their_models_are_left_out() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let scenes = folder.path().join("scenes");
        std::fs::create_dir(&scenes).expect("a folder");
        for (name, model) in [("a", "a.obj"), ("b", "b.obj"), ("c", "${PBR_VR_SCENES}/not/there.obj"), ("d", "a.obj")] {
            let text = format!("[[model]]\nfile = \"{model}\"\n");
            std::fs::write(scenes.join(name).with_extension("toml"), text).expect("a scene");
        }
        std::fs::write(scenes.join("a.obj"), "").expect("a model");
        let mut playlist = Playlist::of(folder.path());
        playlist.set_scene(&scenes.join("a.toml"));
        let mut next = || playlist.next_scene().expect("a scene").file_stem().unwrap_or_default().to_owned();
        assert_eq!([next(), next(), next()], ["d", "a", "d"]);
    }
}
