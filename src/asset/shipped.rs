//! Paths of the assets that come with the program, and of the large scenes that do not.

use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The default scene.
pub const DEMO: &str = "scenes/demo.toml";

/// The panorama of models and scenes without one.
pub const PANORAMA: &str = "panoramas/courtyard.exr";

/// All panoramas that come with the program.
pub const PANORAMAS: [&str; 3] = [PANORAMA, "panoramas/forest.exr", "panoramas/sunset.exr"];

/// The folder of shipped assets: PBR_VR_ASSETS if set, else `assets` beside or above the program, in the working
/// folder, or where the program was built.
///
/// # Errors
/// None of them holds the demo scene.
pub fn folder() -> Result<PathBuf> {
    let tried = candidates();
    tried.iter().find(|folder| folder.join(DEMO).is_file()).cloned().ok_or_else(|| Error::Read {
        path: tried.into_iter().next().unwrap_or_default().join(DEMO),
        source: std::io::Error::new(
            std::io::ErrorKind::NotFound,
            "the program's assets were not found; set PBR_VR_ASSETS to the folder that holds them",
        ),
    })
}

/// The folder of scenes that do not come with the program: PBR_VR_SCENES if set, else `downloaded` among the assets.
///
/// # Errors
/// PBR_VR_SCENES is not set, and the assets are not found.
pub fn large_scenes() -> Result<PathBuf> {
    match std::env::var_os("PBR_VR_SCENES").filter(|folder| !folder.is_empty()) {
        Some(folder) => Ok(folder.into()),
        None => Ok(folder()?.join("downloaded")),
    }
}

fn candidates() -> Vec<PathBuf> {
    if let Some(folder) = std::env::var_os("PBR_VR_ASSETS") {
        return vec![folder.into()];
    }
    let program = std::env::current_exe().unwrap_or_default();
    let mut folders: Vec<PathBuf> = program.ancestors().skip(1).take(4).map(|folder| folder.join("assets")).collect();
    folders.push(PathBuf::from("assets"));
    folders.push(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"));
    folders
}
