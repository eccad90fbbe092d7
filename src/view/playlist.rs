//! The playlist: scenes and panoramas that buttons, keys and the panel step through.

use std::fs::ReadDir;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::asset::shipped;
use crate::scene::description::Description;

const PANORAMA_EXTENSIONS: [&str; 2] = ["hdr", "exr"];

/// The shipped scenes and panoramas, those that the user has shown, and which of them are shown.
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
        Self { scenes, panoramas: Cycle::new(&folder.join("panoramas"), &PANORAMA_EXTENSIONS) }
    }

    /// Notes that a scene (description or model) is shown, under its own panorama.
    pub fn set_scene(&mut self, scene: &Path) {
        self.scenes.set(scene);
        let environment = Description::load(scene).ok().and_then(|description| description.environment);
        let panorama = environment.map(|environment| environment.panorama);
        self.set_panorama(panorama.as_deref().unwrap_or(Path::new(shipped::PANORAMA)));
    }

    /// Notes that a panorama is shown. The others of its folder are in the list from now on.
    pub fn set_panorama(&mut self, panorama: &Path) {
        let folder = panorama.parent().filter(|_| panorama.is_file());
        let folder = folder.map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        for file in folder.map_or_else(Vec::new, |folder| files_in(folder, &PANORAMA_EXTENSIONS)) {
            if !self.panoramas.files.iter().any(|known| known.file_name() == file.file_name()) {
                self.panoramas.files.push(file);
            }
        }
        self.panoramas.set(panorama);
    }

    /// The scenes in order.
    pub fn scenes(&self) -> &[PathBuf] {
        &self.scenes.files
    }

    /// The panoramas in order.
    pub fn panoramas(&self) -> &[PathBuf] {
        &self.panoramas.files
    }

    /// The scene after the one that is shown or was requested last; `None` if there is no other.
    pub fn next_scene(&mut self) -> Option<PathBuf> {
        self.scenes.step(1)
    }

    /// The one before.
    pub fn previous_scene(&mut self) -> Option<PathBuf> {
        self.scenes.step(-1)
    }

    /// The same for panoramas.
    pub fn next_panorama(&mut self) -> Option<PathBuf> {
        self.panoramas.step(1)
    }

    /// The one before.
    pub fn previous_panorama(&mut self) -> Option<PathBuf> {
        self.panoramas.step(-1)
    }
}

impl Cycle {
    fn new(folder: &Path, extensions: &[&str]) -> Self {
        Self { files: files_in(folder, extensions), at: None }
    }

    /// Makes a file the current one, by name; adds it if it is not among them.
    fn set(&mut self, file: &Path) {
        let known = self.files.iter().position(|known| known.file_name() == file.file_name());
        self.at = known.or_else(|| {
            self.files.push(file.to_owned());
            Some(self.files.len() - 1)
        });
    }

    fn step(&mut self, by: isize) -> Option<PathBuf> {
        let count = self.files.len().max(1);
        let next = match self.at {
            // A list has fewer than isize::MAX entries.
            Some(at) => (at as isize + by).rem_euclid(count as isize) as usize,
            None if by > 0 => 0,
            None => count - 1,
        };
        if self.at == Some(next) {
            return None;
        }
        self.at = Some(next);
        self.files.get(next).cloned()
    }
}

/// The files of a folder that have one of these extensions, by name; none where it cannot be read.
fn files_in(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let paths = |entries: ReadDir| entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>();
    let entries = std::fs::read_dir(folder).and_then(paths).unwrap_or_else(|error| {
        tracing::warn!("{}; its files cannot be stepped through", Error::read(folder)(error));
        Vec::new()
    });
    let extension = |file: &Path| file.extension().map(|e| e.to_string_lossy().to_lowercase());
    let wanted = |file: &PathBuf| extension(file).is_some_and(|e| extensions.contains(&e.as_str()));
    let mut files: Vec<PathBuf> = entries.into_iter().filter(wanted).collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_repeat_in_order_and_a_single_one_comes_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let add = |name: &str| std::fs::write(folder.path().join(name), "").expect("a test file");
        assert_eq!(Cycle::new(folder.path(), &["toml"]).step(1), None);
        add("b.toml");
        let names = |cycle: &mut Cycle, count| -> Vec<Option<String>> {
            let name = |file: PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (0..count).map(|_| cycle.step(1).map(name)).collect()
        };
        assert_eq!(names(&mut Cycle::new(folder.path(), &["toml"]), 2), [Some("b.toml".into()), None]);
        ["a.toml", "c.obj"].into_iter().for_each(add);
        let names = names(&mut Cycle::new(folder.path(), &["toml", "hdr"]), 3);
        assert_eq!(names, [Some("a.toml".into()), Some("b.toml".into()), Some("a.toml".into())]);
        let mut cycle = Cycle::new(folder.path(), &["toml"]);
        assert!(cycle.step(-1).is_some_and(|file| file.ends_with("b.toml")));
        assert!(cycle.step(-1).is_some_and(|file| file.ends_with("a.toml")));
        cycle.set(Path::new("elsewhere/z.toml"));
        assert_eq!((cycle.files.len(), cycle.at), (3, Some(2)));
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
