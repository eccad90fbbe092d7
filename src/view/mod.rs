//! Where eyes come from and where pictures go: headset, window, picture file; baked maps; camera control.

mod bake;
mod control;
pub mod doctor;
mod frame_clock;
#[expect(unsafe_code, reason = "calls OpenVR")]
pub mod headset;
mod look;
mod picture;
#[expect(unsafe_code, reason = "calls Vulkan and the window system")]
mod window;

use std::path::{Path, PathBuf};

pub use bake::{BAKED, BakeFacts, BakeRequest, bake};
pub use headset::{HiddenAreaV, PROBE_SUBCOMMAND, answer_probe};
pub use look::{QualityOptions, TextureChoice};
pub use picture::{RenderFacts, RenderRequest, load_scene, picture_files, render};
pub use window::console;

use clap::ValueEnum;

use crate::asset::file::write_atomically;
use crate::asset::{Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::precompute::Cache;
use crate::render::Settings;
use crate::{Error, Result, say};
use headset::RunReport;

/// What to show.
#[derive(Clone, Copy)]
pub struct ViewRequest<'a> {
    /// The demo if `None`.
    pub scene: Option<&'a Path>,
    /// Stop after this many.
    pub frames: Option<u64>,
    pub look: QualityOptions,
    /// Where precomputed light and compressed textures are kept.
    pub cache: Option<&'a Cache>,
    /// Which way up the headset's runtime gives the hidden area.
    pub hidden_area: HiddenAreaV,
    /// What the window shows of the headset.
    pub mirror: Mirror,
    /// Where times and facts are written at the end.
    pub report: Option<&'a Path>,
    /// Why it is not in a headset; told when there is a window instead.
    pub no_headset: Option<&'a str>,
}

/// What a window beside the headset shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Mirror {
    /// Both eyes, side by side.
    #[default]
    Both,
    Left,
    Right,
}

/// Where frames are to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Window,
    /// The headset, mirrored in the window; the window alone if that fails.
    Headset,
    /// The headset, or an error.
    HeadsetOnly,
}

impl ViewRequest<'_> {
    fn settings(&self, gpu: &Gpu) -> Settings {
        self.look.settings(gpu, self.cache, &Report::to_terminal())
    }

    fn write_report(&self, report: impl FnOnce() -> RunReport) -> Result<()> {
        let Some(path) = self.report else { return Ok(()) };
        let text = serde_json::to_string(&report()).map_err(|e| Error::write(path)(e.into()))?;
        write_atomically(path, (text + "\n").as_bytes())
    }

    fn scene(&self) -> Result<PathBuf> {
        self.scene.map_or_else(|| Ok(shipped::folder()?.join(shipped::DEMO)), |scene| Ok(scene.to_owned()))
    }
}

/// The picture written where nothing can be shown.
const FALLBACK: &str = "pbr-vr.png";

/// Shows a scene in a headset, else in a window, else as a picture; one line says which and why.
///
/// # Errors
/// Whatever stops loading or drawing; a headset that is lost where there is no window to go on in.
pub fn auto(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    let probed = headset::probe();
    let no_window = match no_display() {
        Some(reason) => reason,
        None => {
            let wanted = if probed.is_ok() { Wanted::Headset } else { Wanted::Window };
            let no_headset = probed.as_ref().err().map(String::as_str);
            match window::run(&ViewRequest { no_headset, ..*request }, gpu, wanted)? {
                None => return Ok(()),
                Some(reason) => reason,
            }
        }
    };
    let no_headset = match probed {
        Err(reason) => reason,
        Ok(_) => match headset::connect(gpu) {
            Ok(connected) => return headset::run_alone(request, connected),
            Err(Error::Headset { problem }) => problem,
            Err(error) => return Err(error),
        },
    };
    let scene = request.scene()?;
    let output = &reserve_fallback()?;
    let still = RenderRequest {
        scene: &scene,
        output,
        size: [1280, 720],
        camera: None,
        stereo: false,
        frames: request.frames.unwrap_or(request.look.shading.default_frames()),
        look: request.look,
        cache: request.cache,
    };
    let facts = render(&still, gpu, &Report::to_terminal()).inspect_err(|_| {
        // The name only; what went wrong is told by the error.
        let _ = std::fs::remove_file(output);
    })?;
    let name = output.display();
    say!("pbr-vr: wrote {name}, because {no_headset}, and {no_window}; start it in a desktop session to get a window");
    let RenderFacts { gpu, driver, frames, .. } = facts;
    request.write_report(|| RunReport { on: "picture", gpu, driver, frames, present_mode: None, headset: None })
}

/// Makes an empty file, so that no two programs take the same name: as the fallback is called, or with a number if that is
/// taken, as screenshots have one.
fn reserve_fallback() -> Result<PathBuf> {
    match std::fs::File::create_new(FALLBACK) {
        Ok(_) => Ok(FALLBACK.into()),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => window::loader::reserve_name(Path::new("")),
        Err(error) => Err(Error::write(FALLBACK)(error)),
    }
}

/// Shows a scene in a window, or fails.
///
/// # Errors
/// [`Error::Window`] where none can be opened; whatever stops loading or drawing.
pub fn window(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    let problem = match no_display() {
        Some(problem) => Some(problem),
        None => window::run(request, gpu, Wanted::Window)?,
    };
    problem.map_or(Ok(()), |problem| Err(Error::Window { problem }))
}

/// Shows a scene in a headset, with a mirror where there is a display, or fails.
///
/// # Errors
/// [`Error::Headset`] with the reason why there is none; whatever stops loading or drawing.
pub fn headset(request: &ViewRequest<'_>, gpu: GpuOptions<'_>) -> Result<()> {
    headset::probe().map_err(|problem| Error::Headset { problem })?;
    let mirrored = no_display().is_none() && window::run(request, gpu, Wanted::HeadsetOnly)?.is_none();
    if mirrored { Ok(()) } else { headset::run_alone(request, headset::connect(gpu)?) }
}

/// Why no window can be opened here, if that can be known beforehand.
fn no_display() -> Option<String> {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let missing = cfg!(all(unix, not(target_os = "macos"))) && !set("DISPLAY") && !set("WAYLAND_DISPLAY");
    missing.then(|| "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)".into())
}
