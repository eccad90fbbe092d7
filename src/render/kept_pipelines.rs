//! Compiled pipelines on disk, one file per GPU: the driver's cache is read before pipelines are created and written
//! after, so that the next run need not compile them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::asset::file::{self, write_atomically};
use crate::context::Context;
use crate::gpu::Gpu;
use crate::{Error, Result};

/// The folder's name, next to the cache.
const FOLDER: &str = "pipelines";
/// A limit above the size of any real driver cache.
const MOST_BYTES: u64 = 256 << 20;
/// Bytes of the hash that a file begins with.
const HASH: usize = blake3::OUT_LEN;

/// The driver's cache of one GPU and its file. It only saves time, so errors are ignored.
pub struct KeptPipelines {
    gpu: Arc<Gpu>,
    file: Option<PathBuf>,
    /// Bytes of the driver's cache when the file was last read or written.
    size: usize,
}

impl KeptPipelines {
    /// Loads the pipelines of earlier runs into the driver's cache; without a cache on disk, none are kept.
    pub fn load(context: &Context) -> Self {
        let Context { gpu, cache, .. } = context;
        let file = cache.as_ref().map(|cache| cache.beside(FOLDER).join(gpu.pipeline_cache_name()));
        let known = gpu.pipeline_cache_bytes().map_or(0, |bytes| bytes.len());
        if let Some(path) = file.as_deref().filter(|path| path.exists()) {
            match read(path) {
                Ok(bytes) if bytes.len() <= known => {}
                Ok(bytes) if gpu.merge_pipeline_cache(&bytes) => {}
                Ok(_) => tracing::debug!("{}: pipelines of another driver", path.display()),
                Err(error) => tracing::debug!("pipelines: {error}"),
            }
        }
        let size = gpu.pipeline_cache_bytes().map_or(0, |bytes| bytes.len());
        Self { gpu: Arc::clone(gpu), file, size }
    }

    /// Writes the file if pipelines have been added.
    pub fn save(&mut self) {
        let Some(path) = &self.file else { return };
        let written = self.gpu.pipeline_cache_bytes().and_then(|bytes| {
            if bytes.len() != self.size {
                self.size = bytes.len();
                write(path, &bytes)?;
            }
            Ok(())
        });
        if let Err(error) = written {
            tracing::debug!("pipelines: {error}");
        }
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(path);
    std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
    write_atomically(path, &[blake3::hash(bytes).as_bytes(), bytes].concat())
}

/// The driver's bytes, if their hash is right.
fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = file::read(path, "pipelines", MOST_BYTES)?;
    let broken = |problem: &str| Error::Broken {
        path: path.into(),
        what: "file of pipelines",
        problem: problem.into(),
        remedy: "it is written again",
    };
    let hash: [u8; HASH] =
        bytes.get(..HASH).and_then(|hash| hash.try_into().ok()).ok_or_else(|| broken("too short"))?;
    bytes.drain(..HASH);
    if blake3::hash(&bytes) == hash { Ok(bytes) } else { Err(broken("another hash")) }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::asset::Cache;
    use crate::gpu::with_gpu;

    #[test]
    fn files_come_back_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("not/yet/gpu");
        write(&path, b"compiled").unwrap();
        assert_eq!(read(&path).unwrap(), b"compiled");
        let good = std::fs::read(&path).unwrap();
        for bad in [&good[..0], &good[..HASH - 1], &good[..HASH], &good[..good.len() - 1], &[&good[..], b"x"].concat()]
        {
            std::fs::write(&path, bad).unwrap();
            assert!(matches!(read(&path), Err(Error::Broken { .. })), "{} bytes", bad.len());
        }
    }

    #[test]
    fn pipelines_are_kept_for_the_next_run_and_broken_files_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().join("maps"));
        let with_cache = |gpu: &Arc<Gpu>| Context { cache: Some(cache.clone()), ..Context::silent(gpu) };
        let kept = with_gpu(|gpu| {
            let mut kept = KeptPipelines::load(&with_cache(gpu));
            // A driver may cache nothing but a header; this forces a first file in any case.
            kept.size = 0;
            kept.save();
            kept.file.clone().unwrap()
        });
        let first = read(&kept).unwrap();
        std::fs::write(&kept, b"broken").unwrap();
        with_gpu(|gpu| {
            let mut kept = KeptPipelines::load(&with_cache(gpu));
            kept.size = 0;
            kept.save();
            assert_eq!(KeptPipelines::load(&with_cache(gpu)).size, kept.size);
            KeptPipelines::load(&Context::silent(gpu)).save();
        });
        assert!(read(&kept).unwrap().len() >= first.len().min(32));
    }
}
