//! The arguments of `view`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::args::Choice;
use super::headset::{HeadsetReport, HiddenAreaV, RunReport};
use super::measured::Measurements;
use crate::asset::file::write_atomically;
use crate::asset::{Outputs, shipped};
use crate::gpu::Gpu;
use crate::render::RenderSettings;
use crate::scene::load::files as scene_files;
use crate::scene::staging::Staging;
use crate::{Error, Result};

/// A scene and how to show it.
#[derive(Args, Clone, Debug, Default)]
pub struct ViewRequest {
    /// A scene description (.toml) or a model (.gltf, .glb, .obj); the demo if left out.
    pub scene: Option<PathBuf>,
    /// The output.
    #[arg(long, value_enum, default_value_t)]
    pub on: On,
    /// Stop after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: Option<u64>,
    /// Which way v points in the headset's hidden area; `off` draws that, too.
    #[arg(long, value_enum, default_value_t)]
    pub hidden_area: HiddenAreaV,
    /// What the mirror window of a headset shows.
    #[arg(long, value_enum, default_value_t)]
    pub mirror: Mirror,
    /// Write times and facts of the run, as JSON.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub staging: Staging,
    #[command(flatten)]
    pub settings: RenderSettings,
    #[command(flatten)]
    pub choice: Choice,
    /// Finds what the panel shows beside settings.
    #[arg(skip)]
    pub measurements: Option<Measurements>,
}

/// Which output `view` uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum On {
    #[default]
    Auto,
    Headset,
    Window,
}

/// The content of a headset's mirror window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Mirror {
    /// A calm camera for those who watch: without the head's roll and tremor, with the field of view of a window.
    #[default]
    Steady,
    /// Both eyes, side by side.
    Both,
    Left,
    Right,
}

/// The outputs that the window's event loop opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    Window,
    /// The headset, mirrored in the window; if that fails, the window alone.
    Headset,
    /// The headset, or an error.
    HeadsetOnly,
}

impl ViewRequest {
    /// The scene's file: as given, or the demo.
    ///
    /// # Errors
    /// The demo is not found.
    pub fn scene(&self) -> Result<PathBuf> {
        self.scene.clone().map_or_else(|| Ok(shipped::folder()?.join(shipped::DEMO)), Ok)
    }

    /// Checks that the report can be written and is not an input.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Write`]; the demo is not found.
    pub fn check(&self) -> Result<()> {
        let files = scene_files(&self.scene()?).into_iter().chain(self.staging.panorama.clone());
        let mut outputs = Outputs::of(files);
        outputs.file_if(self.staging.write_scene.as_deref())?;
        outputs.file_if(self.report.as_deref())
    }

    /// What writes the report of a session in a headset whose runtime never comes back.
    pub(super) fn last_report(&self, gpu: &Gpu) -> impl Fn(HeadsetReport) + Send + 'static {
        let (report, gpu) = (Self { report: self.report.clone(), ..Self::default() }, gpu.info().clone());
        move |headset| {
            let (frames, headset) = (headset.frames, Some(headset));
            let (name, driver) = (gpu.name.clone(), gpu.driver.clone());
            let run = RunReport { on: "headset", gpu: name, driver, frames, rate: None, present_mode: None, headset };
            if let Err(error) = report.write_report(|| run) {
                crate::complain!("pbr-vr: {error}");
            }
        }
    }

    pub(super) fn write_report(&self, report: impl FnOnce() -> RunReport) -> Result<()> {
        let Some(path) = &self.report else { return Ok(()) };
        let text = serde_json::to_string(&report()).map_err(|e| Error::write(path)(e.into()))?;
        write_atomically(path, (text + "\n").as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::args::parsed;

    #[test]
    fn without_arguments_a_request_is_the_default_one() {
        let (parsed_none, default) = (parsed::<ViewRequest>(&[]).expect("arguments"), ViewRequest::default());
        assert_eq!(format!("{parsed_none:?}"), format!("{default:?}"));
        for arguments in [["--on", "toaster"], ["--frames", "0"], ["--mirror", "none"]] {
            assert!(parsed::<ViewRequest>(&arguments).is_err(), "{arguments:?}");
        }
    }
}
