//! Ladders in the cache, one for each scene, GPU and version of the program, from which settings are chosen later.

use std::path::{Path, PathBuf};

use super::super::pareto::Limit;
use super::super::report::write_json;
use super::config::{Config, Ladder};
use super::settings;
use crate::asset::cache::Key;
use crate::asset::contained::from_json;
use crate::asset::file;
use crate::context::{Context, Setup};
use crate::gpu::Gpu;
use crate::precompute::Cache;
use crate::render::RenderSettings;
use crate::view::MeasuredSettings;
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
    let path = file_of(cache, scene, &gpu)?;
    if !path.is_file() {
        return Err(Error::NotMeasured { scene: scene.into(), gpu: gpu.info().name.clone() });
    }
    let ladder = read(&path)?;
    let config = ladder.choice(limit).map_err(Error::Unmet)?;
    say!("pbr-vr: {}", ladder.words(limit, config));
    settings::options(&config.flags).map_err(|e| broken(&path, e.to_string()))
}

/// Time and error of each setting in the ladder of this scene on this GPU; none where there is no ladder that can be read.
pub fn measured(scene: &Path, context: &Context) -> Vec<MeasuredSettings> {
    let Some(cache) = &context.cache else { return Vec::new() };
    let ladder = file_of(cache, scene, &context.gpu)
        .and_then(|path| if path.is_file() { read(&path).map(Some) } else { Ok(None) });
    let ladder = ladder.unwrap_or_else(|error| {
        context.report.warn(error.to_string());
        None
    });
    let parsed = |config: &Config| {
        let settings = settings::options(&config.flags).ok()?;
        let time = if config.is_default() { 1.0 } else { config.ratio.median };
        Some(MeasuredSettings { settings, time, flip: config.error.flip })
    };
    ladder.iter().flat_map(|ladder| &ladder.configs).filter_map(parsed).collect()
}

/// Where the ladder of this scene on this GPU is, if there is one.
fn file_of(cache: &Cache, scene: &Path, gpu: &Gpu) -> Result<PathBuf> {
    Ok(cache.beside(FOLDER).join(key(scene, gpu)?).with_extension("json"))
}

/// Reads a ladder's file.
///
/// # Errors
/// It cannot be read, or is none.
pub(crate) fn read(path: &Path) -> Result<Ladder> {
    let bytes = file::read(path, "ladder", MOST_BYTES)?;
    from_json(&bytes).map_err(|problem| broken(path, problem))
}

fn broken(path: &Path, problem: String) -> Error {
    let remedy = "remove it, and run `pbr-vr measure ladder` for the scene again";
    Error::Broken { path: path.into(), what: "ladder", problem, remedy }
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

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::with_gpu;
    use crate::measure::ladder::tests::ladder;

    #[test]
    fn a_stored_ladder_is_what_was_measured_and_a_broken_one_is_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        std::fs::write(&scene, "a scene").unwrap();
        with_gpu(|gpu| {
            let cache = Cache::in_folder(folder.path().join("cache"));
            let context = Context { cache: Some(cache.clone()), ..Context::silent(gpu) };
            assert_eq!(measured(&scene, &context), []);
            store(&cache, &scene, gpu, &ladder(&[("", 10.0, 0.01), ("--samples 1", 4.0, 0.03)])).unwrap();
            let found = measured(&scene, &context);
            let one = RenderSettings { samples: 1, ..RenderSettings::default() };
            assert_eq!(found.len(), 2);
            assert_eq!((&found[0].settings, found[0].time), (&RenderSettings::default(), 1.0));
            assert_eq!((&found[1].settings, found[1].time, found[1].flip), (&one, 0.4, 0.03));
            assert_eq!(context.report.warnings(), [""; 0]);

            std::fs::write(file_of(&cache, &scene, gpu).unwrap(), "{").unwrap();
            assert_eq!(measured(&scene, &context), []);
            assert!(context.report.warnings()[0].contains("ladder"), "{:?}", context.report.warnings());
            // Of another scene nothing is known, although it has the same name.
            std::fs::write(&scene, "another scene").unwrap();
            assert_eq!(measured(&scene, &context), []);
            assert_eq!(context.report.warnings().len(), 1);
        });
    }
}
