//! The cache of precomputed maps on disk: KTX2 files, each named by a hash of all that its content depends on.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use super::texture::{fits, read_texture};
use crate::Result;
use crate::asset::folders;
use crate::asset::ktx2::Ktx2;
use crate::gpu::{Gpu, Image, PassTime, compute_shaders, write_mips};

/// Bytes of all entries, beyond which those used longest ago go.
const MOST_BYTES: u64 = 1 << 30;
/// What an entry's header, key and values may take beside its texels.
const HEAD_BYTES: u64 = 1 << 16;
/// The entry's own name, so that a renamed file is not taken for another.
const KEY: &str = "pbrvrKey";
/// Hash of the texels, so that a file with bent bits is not taken for whole.
const TEXELS: &str = "pbrvrTexels";

/// A folder of precomputed maps. Any number of processes may use it at once; every file in it is the cache's own.
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

    /// The entry for an image; `None` if there is none, or none that is whole.
    fn load(&self, key: &str, image: &Image) -> Option<Ktx2> {
        let path = self.path(key);
        if !path.exists() {
            return None;
        }
        let [width, height] = image.desc().size.map(u64::from);
        // A chain of mips is shorter than twice its first; no texel has more than 16 bytes.
        let limit = HEAD_BYTES + width * height * u64::from(image.desc().shape.layers()) * 2 * 16;
        match Ktx2::read(&path, limit) {
            Ok(texture) if is_whole(&texture, key) && fits(&texture, image) => {
                touch(&path);
                Some(texture)
            }
            Ok(_) => {
                tracing::debug!("{}: not what its name says; made again", path.display());
                None
            }
            Err(error) => {
                tracing::debug!("cache: {error}; made again");
                None
            }
        }
    }

    fn store(&self, key: &str, mut texture: Ktx2) -> Result<()> {
        texture.set_text(KEY, key);
        texture.set_text(TEXELS, &hash_texels(&texture));
        fs::create_dir_all(&self.folder).map_err(crate::Error::write(&self.folder))?;
        texture.write(&self.path(key))?;
        self.trim();
        Ok(())
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

/// Fills `images` from the cache, or else by `compute`, and then keeps them. `source` is all that they depend on beside
/// their names, formats and sizes, the program and the GPU. Returns the GPU times of `compute`, or that of copying,
/// named `copying`.
pub(super) fn cached(
    gpu: &Arc<Gpu>,
    cache: Option<&Cache>,
    copying: &'static str,
    source: &[&[u8]],
    images: &[(&str, &Image)],
    compute: impl FnOnce() -> Result<Vec<PassTime>>,
) -> Result<Vec<PassTime>> {
    let Some(cache) = cache else { return compute() };
    let keys = keys(gpu, source, images)?;
    let found: Option<Vec<Ktx2>> = keys.iter().zip(images).map(|(key, (_, image))| cache.load(key, image)).collect();
    if let Some(textures) = found {
        let copies: Vec<_> = images.iter().zip(&textures).map(|((_, image), t)| (*image, &t.levels[..])).collect();
        return write_mips(gpu, copying, &copies);
    }
    let times = compute()?;
    for (key, (_, image)) in keys.iter().zip(images) {
        // Without a cache everything works, only later.
        if let Err(error) = read_texture(gpu, &[image]).and_then(|texture| cache.store(key, texture)) {
            tracing::debug!("cache: {error}");
            break;
        }
    }
    Ok(times)
}

/// Each image's key: hexadecimal, 256 bits.
fn keys(gpu: &Arc<Gpu>, source: &[&[u8]], images: &[(&str, &Image)]) -> Result<Vec<String>> {
    let mut common = blake3::Hasher::new();
    // Every part with its length, so that no two lists of parts are the same bytes.
    let part = |hasher: &mut blake3::Hasher, bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update_rayon(bytes);
    };
    let program = [env!("CARGO_PKG_VERSION"), env!("PBR_VR_PRECOMPUTE_CODE")];
    // Two GPUs, or two drivers, need not round alike.
    let machine = [gpu.info().name.as_str(), gpu.info().driver.as_str()];
    program.iter().chain(&machine).for_each(|text| part(&mut common, text.as_bytes()));
    for (name, words) in compute_shaders()? {
        part(&mut common, name.as_bytes());
        part(&mut common, bytemuck::cast_slice(&words));
    }
    source.iter().for_each(|bytes| part(&mut common, bytes));
    let key = |(name, image): &(&str, &Image)| {
        let mut hasher = common.clone();
        let desc = image.desc();
        part(&mut hasher, name.as_bytes());
        part(&mut hasher, format!("{:?} {:?} {:?} {}", desc.format, desc.size, desc.shape, desc.mips).as_bytes());
        hasher.finalize().to_hex().to_string()
    };
    Ok(images.iter().map(key).collect())
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
