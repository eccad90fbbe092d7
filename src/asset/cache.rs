//! A cache on disk of what is slow to compute: KTX2 files, each named by a hash of everything that its content depends
//! on.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use super::file::write_unsynced;
use super::folders;
use super::ktx2::Ktx2;
use crate::{Error, Result};

/// Limit of all entries together, in bytes; beyond it the least recently used ones are removed.
const MAX_BYTES: u64 = 2 << 30;
/// Text key of the entry's own name, so that a renamed file is not taken for another.
const KEY: &str = "pbrvrKey";
/// Text key of the hash of the texels, so that a corrupted file is detected.
const TEXELS: &str = "pbrvrTexels";

/// Whether this run has logged that entries cannot be stored.
static FAILURE_LOGGED: AtomicBool = AtomicBool::new(false);

/// A folder of maps and textures. Any number of processes may use it at once; it must hold no other files.
#[derive(Clone, Debug, PartialEq)]
pub struct Cache {
    folder: PathBuf,
    max_bytes: u64,
}

impl Cache {
    /// The user's cache: `pbr-vr/maps` in the folder for caches; `None` where the system names no such folder.
    pub fn of_user() -> Option<Self> {
        folders::caches().map(|caches| Self::in_folder(caches.join("pbr-vr").join("maps")))
    }

    /// A cache in any folder, which is created when the first entry is stored.
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder, max_bytes: MAX_BYTES }
    }

    /// A folder beside the cache's own, for files of another kind that can be recreated.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.folder.with_file_name(name)
    }

    /// The entry `key` of at most `limit` bytes; `None` if there is none, or if it is corrupted or does not pass
    /// `fits`, which is logged.
    pub fn load(&self, key: &str, limit: u64, fits: impl Fn(&Ktx2) -> bool) -> Option<Ktx2> {
        let path = self.path(key);
        if !path.exists() {
            return None;
        }
        match Ktx2::read(&path, limit) {
            Ok(texture) if is_intact(&texture, key) && fits(&texture) => {
                touch(&path);
                Some(texture)
            }
            Ok(_) => {
                tracing::warn!("cache: {}: does not match its name or hash; recreated", path.display());
                None
            }
            Err(error) => {
                // The error's remedy is for the user's own files.
                let (path, problem) = (
                    path.display(),
                    match error {
                        Error::Broken { problem, .. } => problem,
                        error => error.to_string(),
                    },
                );
                tracing::warn!("cache: {path}: {problem}; recreated");
                None
            }
        }
    }

    /// Stores an entry, and removes old ones where they exceed the limit.
    ///
    /// # Errors
    /// The file or its folder cannot be written.
    pub fn store(&self, key: &str, mut texture: Ktx2) -> Result<()> {
        texture.set_text(KEY, key);
        texture.set_text(TEXELS, &hash_texels(&texture));
        fs::create_dir_all(&self.folder).map_err(Error::write(&self.folder))?;
        let path = self.path(key);
        // Not synced: an entry torn by a crash does not match its hash, and is recreated.
        write_unsynced(&path, &texture.to_bytes(&path)?)?;
        self.trim();
        Ok(())
    }

    /// [`Self::store`] whose failure is logged once a run and then ignored: without a cache everything works, only
    /// slower.
    pub fn keep(&self, key: &str, texture: Ktx2) {
        if let Err(error) = self.store(key, texture)
            && !FAILURE_LOGGED.swap(true, Ordering::Relaxed)
        {
            tracing::warn!("cache: {error}; nothing is kept, so the next start takes as long");
        }
    }

    /// Removes the least recently used entries until the rest is within the limit. Another process may do so
    /// concurrently.
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
            if bytes <= self.max_bytes {
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

/// A hash of everything that an entry's content depends on. Each part is preceded by its length, so that no two lists
/// of parts hash the same bytes.
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

fn is_intact(texture: &Ktx2, key: &str) -> bool {
    texture.text(KEY) == Some(key) && texture.text(TEXELS) == Some(&hash_texels(texture))
}

fn hash_texels(texture: &Ktx2) -> String {
    let mut hasher = blake3::Hasher::new();
    for level in &texture.levels {
        hasher.update_rayon(level);
    }
    hasher.finalize().to_hex().to_string()
}

/// Marks an entry as used now. If that fails, the entry is only removed earlier.
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
    fn the_least_recently_used_entry_is_removed_first() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = Cache::in_folder(folder.path().join("not/yet"));
        cache.store("a", texture(1)).unwrap();
        let each = fs::metadata(cache.path("a")).unwrap().len();
        cache.max_bytes = 3 * each;
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
        cache.max_bytes = 0;
        cache.trim();
        assert_eq!(names(&cache.folder), ["folder"], "only files go");
    }

    #[test]
    fn corrupted_texels_and_foreign_names_are_detected() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().into());
        cache.store("a", texture(1)).unwrap();
        let mut back = Ktx2::read(&cache.path("a"), 10_000).unwrap();
        assert!(is_intact(&back, "a") && !is_intact(&back, "b"));
        back.levels[0][63] ^= 1;
        assert!(!is_intact(&back, "a"));
        assert!(!is_intact(&texture(1), "a"));
    }

    #[test]
    fn an_impossible_folder_is_an_error_of_storing_only() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let cache = Cache::in_folder(file.join("cache"));
        assert!(cache.store("a", texture(1)).is_err());
        cache.trim();
    }
}
