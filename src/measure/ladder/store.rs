//! Ladders in the cache, one for each scene, GPU and version of the program, from which settings are chosen later.

use std::path::Path;

use super::super::pareto::Limit;
use super::super::report::write_json;
use super::config::Ladder;
use super::settings;
use crate::asset::cache::Key;
use crate::asset::file;
use crate::context::Setup;
use crate::gpu::Gpu;
use crate::precompute::Cache;
use crate::render::RenderSettings;
use crate::{Error, Result, say};

/// Bytes of a ladder, or of a scene's own file, that are read at most: a gigabyte, as of models.
const MOST_BYTES: u64 = 1 << 30;

/// Stores a scene's ladder for [`choose`].
pub fn store(cache: &Cache, scene: &Path, gpu: &Gpu, ladder: &Ladder) -> Result<()> {
    let folder = cache.beside(FOLDER);
    std::fs::create_dir_all(&folder).map_err(Error::write(&folder))?;
    write_json(&folder, &key(scene, gpu)?, ladder)
}

/// The settings that a limit chooses from the ladder of this scene (a description or model) on this GPU; prints which.
///
/// # Errors
/// No ladder has been measured; nothing in it holds the limit; a file that cannot be read.
pub fn choose(scene: &Path, limit: Limit, setup: &Setup<'_>) -> Result<RenderSettings> {
    let Some(cache) = &setup.cache else {
        let problem = "--tolerance and --budget-ms choose from what `measure ladder` left in the cache";
        return Err(Error::Usage(format!("{problem}; leave out --no-cache")));
    };
    let gpu = Gpu::open(setup.gpu)?;
    let path = cache.beside(FOLDER).join(key(scene, &gpu)?).with_extension("json");
    if !path.is_file() {
        return Err(Error::NotMeasured { scene: scene.into(), gpu: gpu.info().name.clone() });
    }
    let bytes = file::read(&path, "ladder", MOST_BYTES)?;
    let remedy = "remove it, and run `pbr-vr measure ladder` for the scene again";
    let broken = |problem: String| Error::Broken { path: path.clone(), what: "ladder", problem, remedy };
    let ladder: Ladder = serde_json::from_slice(&bytes).map_err(|e| broken(e.to_string()))?;
    let config = ladder.choice(limit).map_err(Error::Unmet)?;
    say!("pbr-vr: {}", ladder.words(limit, config));
    settings::options(&config.flags).map_err(|e| broken(e.to_string()))
}

const FOLDER: &str = "ladders";
/// Increased with every change of the format: ladders of other formats are not found.
const FORMAT: &str = "4";

/// The file name: a hash of everything that a ladder depends on, except for files that the scene's file names.
fn key(scene: &Path, gpu: &Gpu) -> Result<String> {
    let place = scene.canonicalize().map_err(Error::read(scene))?;
    let mut key = Key::default();
    let info = gpu.info();
    for text in [FORMAT, env!("CARGO_PKG_VERSION"), &info.name, &info.driver] {
        key.add(text.as_bytes());
    }
    key.add(place.as_os_str().as_encoded_bytes());
    key.add(&file::read(scene, "scene", MOST_BYTES)?);
    Ok(key.text())
}
