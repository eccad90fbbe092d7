//! A cache on disk of what is slow to make: KTX2 files, each named by a hash of all that its content depends on.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use super::file::write_unsynced;
use super::folders;
use super::ktx2::Ktx2;
use crate::{Error, Result};

/// Bytes of all entries, beyond which those used longest ago go.
const MOST_BYTES: u64 = 2 << 30;
/// The entry's own name, so that a renamed file is not taken for another.
const KEY: &str = "pbrvrKey";
/// Hash of the texels, so that a file with bent bits is not taken for whole.
const TEXELS: &str = "pbrvrTexels";

/// Whether it has been told in this run that nothing can be kept.
static UNKEPT_TOLD: AtomicBool = AtomicBool::new(false);

/// A folder of maps and textures. Any number of processes may use it at once; every file in it is the cache's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Cache {
    folder: PathBuf,
    most_bytes: u64,
}

impl Cache {
    /// The user's: `pbr-vr/maps` in the folder for caches; `None` where the system names no such folder.
    pub fn of_user() -> Option<Self> {
        folders::caches().map(|caches| Self::in_folder(caches.join("pbr-vr").join("maps")))
    }

    /// A cache in any folder, which is made when it is needed.
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder, most_bytes: MOST_BYTES }
    }

    /// A folder beside the cache's own, for files of another kind that can be made again.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.folder.with_file_name(name)
    }

    /// The entry `key` of at most `limit` bytes; `None` if there is none, or none that is whole and `fits`. What is not
    /// whole is told.
    pub fn load(&self, key: &str, limit: u64, fits: impl Fn(&Ktx2) -> bool) -> Option<Ktx2> {
        let path = self.path(key);
        if !path.exists() {
            return None;
        }
        match Ktx2::read(&path, limit) {
            Ok(texture) if is_whole(&texture, key) && fits(&texture) => {
                touch(&path);
                Some(texture)
            }
            Ok(_) => {
                tracing::warn!("cache: {}: not what its name says; made again", path.display());
                None
            }
            Err(error) => {
                // The remedy is for files of the user's own.
                let (path, problem) = (
                    path.display(),
                    match error {
                        Error::Broken { problem, .. } => problem,
                        error => error.to_string(),
                    },
                );
                tracing::warn!("cache: {path}: {problem}; made again");
                None
            }
        }
    }

    /// Keeps an entry, and removes old ones where there are too many.
    pub fn store(&self, key: &str, mut texture: Ktx2) -> Result<()> {
        texture.set_text(KEY, key);
        texture.set_text(TEXELS, &hash_texels(&texture));
        fs::create_dir_all(&self.folder).map_err(Error::write(&self.folder))?;
        let path = self.path(key);
        // Not synced: a torn entry does not match its hash, and is made again.
        write_unsynced(&path, &texture.to_bytes(&path)?)?;
        self.trim();
        Ok(())
    }

    /// [`Self::store`] for what can be made again: where it fails, the user is told once, and everything works, only later.
    pub fn keep(&self, key: &str, texture: Ktx2) {
        if let Err(error) = self.store(key, texture)
            && !UNKEPT_TOLD.swap(true, Ordering::Relaxed)
        {
            tracing::warn!("cache: {error}; nothing is kept, so that the next start takes as long");
        }
    }

    /// Removes what was used longest ago until the rest is small enough. Another process may be at the same.
    fn trim(&self) {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut files: Vec<(SystemTime, u64, PathBuf)> = entries
            .filter_map(|entry| {
                let data = entry.metadata().ok().filter(fs::Metadata::is_file)?;
                Some((data.modified().ok()?, data.len(), entry.path()))
            })
            .collect();
        files.sort();
        let mut bytes: u64 = files.iter().map(|(_, length, _)| length).sum();
        for (_, length, path) in files {
            if bytes <= self.most_bytes {
                break;
            }
            match fs::remove_file(&path) {
                Ok(()) => tracing::debug!("{}: removed, the cache is full", path.display()),
                Err(error) => tracing::debug!("{}: cannot be removed: {error}", path.display()),
            }
            bytes -= length;
        }
    }

    fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.ktx2"))
    }
}

/// A hash of everything that an entry's content depends on. Each part is preceded by its length, so that no two lists of
/// parts hash the same bytes.
#[derive(Clone, Default)]
pub struct Key(blake3::Hasher);

impl Key {
    /// The key of one kind of entries, whose `version` must be raised whenever the same inputs give other bytes.
    pub fn new(kind: &str, version: u32) -> Self {
        let mut key = Self::default();
        key.add(kind.as_bytes());
        key.add(&version.to_le_bytes());
        key
    }

    /// Adds a part.
    pub fn add(&mut self, part: &[u8]) {
        self.0.update(&(part.len() as u64).to_le_bytes());
        self.0.update_rayon(part);
    }

    /// Hexadecimal, 256 bits.
    pub fn text(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

fn is_whole(texture: &Ktx2, key: &str) -> bool {
    texture.text(KEY) == Some(key) && texture.text(TEXELS) == Some(&hash_texels(texture))
}

fn hash_texels(texture: &Ktx2) -> String {
    let mut hasher = blake3::Hasher::new();
    for level in &texture.levels {
        hasher.update_rayon(level);
    }
    hasher.finalize().to_hex().to_string()
}

/// Notes that an entry was used. Where that cannot be noted, the entry only goes earlier.
fn touch(path: &Path) {
    let touched = File::options().write(true).open(path).and_then(|file| file.set_modified(SystemTime::now()));
    if let Err(error) = touched {
        tracing::debug!("{}: {error}", path.display());
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::asset::ktx2::TexelFormat;

    fn texture(byte: u8) -> Ktx2 {
        let (format, levels) = (TexelFormat::Rg16Float, vec![vec![byte; 64]]);
        Ktx2 { format, size: [4, 4], layers: 0, faces: 1, levels, key_values: [].into() }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = entries.collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_used_longest_ago_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = Cache::in_folder(folder.path().join("not/yet"));
        cache.store("a", texture(1)).unwrap();
        let each = fs::metadata(cache.path("a")).unwrap().len();
        cache.most_bytes = 3 * each;
        let used = |key: &str, seconds: u64| {
            let file = File::options().write(true).open(cache.path(key)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
        };
        used("a", 100);
        cache.store("b", texture(2)).unwrap();
        used("b", 300);
        cache.store("c", texture(3)).unwrap();
        used("c", 200);
        cache.store("d", texture(4)).unwrap();
        assert_eq!(names(&cache.folder), ["a.ktx2", "c.ktx2", "d.ktx2"]);
        touch(&cache.path("c"));
        cache.store("e", texture(5)).unwrap();
        assert_eq!(names(&cache.folder), ["c.ktx2", "d.ktx2", "e.ktx2"]);
        fs::create_dir(cache.folder.join("folder")).unwrap();
        cache.most_bytes = 0;
        cache.trim();
        assert_eq!(names(&cache.folder), ["folder"], "only files go");
    }

    #[test]
    fn bent_texels_and_foreign_names_are_seen() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().into());
        cache.store("a", texture(1)).unwrap();
        let mut back = Ktx2::read(&cache.path("a"), 10_000).unwrap();
        assert!(is_whole(&back, "a") && !is_whole(&back, "b"));
        back.levels[0][63] ^= 1;
        assert!(!is_whole(&back, "a"));
        assert!(!is_whole(&texture(1), "a"));
    }

    #[test]
    fn a_folder_that_cannot_be_is_an_error_of_storing_only() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let cache = Cache::in_folder(file.join("cache"));
        assert!(cache.store("a", texture(1)).is_err());
        cache.trim();
    }
}
