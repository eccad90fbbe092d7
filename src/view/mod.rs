//! Where eyes come from and where pictures go: window, picture file; baked maps; camera control.

mod bake;
mod control;
pub mod doctor;
mod frame_clock;
mod picture;
mod window;

use std::path::{Path, PathBuf};

pub use bake::{BakeFacts, BakeRequest, bake};
pub use picture::{RenderFacts, RenderRequest, render};

use crate::asset::{Report, shipped};
use crate::gpu::GpuOptions;
use crate::precompute::Cache;
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
use crate::render::Shading;
use crate::{Error, Result};

/// What to show.
#[derive(Clone, Copy)]
pub struct ViewRequest<'a> {
    /// The demo if `None`.
    pub scene: Option<&'a Path>,
    /// Stop after this many.
    pub frames: Option<u64>,
    pub shading: Shading,
    pub geometry: Geometry,
    pub split_sum: SplitSum,
    /// Where precomputed light is kept.
    pub cache: Option<&'a Cache>,
}

impl ViewRequest<'_> {
    fn scene(&self) -> Result<PathBuf> {
        self.scene.map_or_else(|| Ok(shipped::folder()?.join(shipped::DEMO)), |scene| Ok(scene.to_owned()))
    }
}

/// The picture written where nothing can be shown.
const FALLBACK: &str = "pbr-vr.png";

/// Shows a scene in a headset, else in a window, else as a picture; one line says which and why.
pub fn auto(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    let no_headset = headset_problem();
    let no_window = match no_display() {
        Some(reason) => reason,
        None => {
            println!("pbr-vr: in a window, because {no_headset}");
            match window::run(request, gpu) {
                Err(Error::Window { problem }) => problem,
                done => return done,
            }
        }
    };
    let scene = request.scene()?;
    let output = Path::new(FALLBACK);
    let still = RenderRequest {
        scene: &scene,
        output,
        size: [1280, 720],
        camera: None,
        stereo: false,
        frames: request.frames.unwrap_or(request.shading.default_frames()),
        shading: request.shading,
        geometry: request.geometry,
        split_sum: request.split_sum,
        cache: request.cache,
    };
    render(&still, gpu, &Report::to_terminal())?;
    println!("pbr-vr: wrote {FALLBACK}, because {no_window}; start it in a desktop session to get a window");
    Ok(())
}

/// Shows a scene in a window, or fails.
pub fn window(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    match no_display() {
        Some(problem) => Err(Error::Window { problem }),
        None => window::run(request, gpu),
    }
}

/// Fails with the reason why there is no headset.
pub fn headset() -> Result<()> {
    Err(Error::Headset { problem: headset_problem() })
}

fn headset_problem() -> String {
    match doctor::openvr_registry() {
        None => "no headset runtime is installed (SteamVR gives one)".into(),
        Some(_) => "this version does not drive headsets yet".into(),
    }
}

/// Why no window can be opened here, if that can be known beforehand.
fn no_display() -> Option<String> {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let missing = cfg!(all(unix, not(target_os = "macos"))) && !set("DISPLAY") && !set("WAYLAND_DISPLAY");
    missing.then(|| "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)".into())
}
