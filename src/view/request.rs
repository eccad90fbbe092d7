//! `view`: its arguments, and which output shows the scene: a headset, a window, or else a picture file.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::args::Choice;
use super::headset::{self, HiddenAreaV, RunReport};
use super::render::{RenderFacts, RenderRequest, render};
use super::{console, interrupt, screenshot, window};
use crate::asset::file::write_atomically;
use crate::asset::{Outputs, shipped};
use crate::context::Setup;
use crate::render::RenderSettings;
use crate::scene::load::files as scene_files;
use crate::{Error, Result, say};

/// A scene, and where and how it is shown.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct ViewRequest {
    /// A scene description (.toml) or a model (.obj); the demo if left out.
    pub scene: Option<PathBuf>,
    /// Where to show it.
    #[arg(long, value_enum, default_value_t)]
    pub on: On,
    /// Stop after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: Option<u64>,
    /// Which way v points in the headset's hidden area; `off` draws that, too.
    #[arg(long, value_enum, default_value_t)]
    pub hidden_area: HiddenAreaV,
    /// What the window beside a headset shows.
    #[arg(long, value_enum, default_value_t)]
    pub mirror: Mirror,
    /// Write times and facts of the run, as JSON.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub settings: RenderSettings,
    #[command(flatten)]
    pub choice: Choice,
}

/// Which output `view` uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum On {
    #[default]
    Auto,
    Headset,
    Window,
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

/// Which outputs the window's event loop is to open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    Window,
    /// The headset, mirrored in the window; the window alone if that fails.
    Headset,
    /// The headset, or an error.
    HeadsetOnly,
}

/// The picture written where nothing can be shown.
const FALLBACK: &str = "pbr-vr.png";

impl ViewRequest {
    /// The scene's file: the one that is named, or the demo.
    ///
    /// # Errors
    /// The demo is not found.
    pub fn scene(&self) -> Result<PathBuf> {
        self.scene.clone().map_or_else(|| Ok(shipped::folder()?.join(shipped::DEMO)), Ok)
    }

    /// Checks that the report can be written and is no input.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Write`]; the demo is not found.
    pub fn check(&self) -> Result<()> {
        Outputs::of(scene_files(&self.scene()?)).file_if(self.report.as_deref())
    }

    /// The command. [`ViewRequest::check`] has checked the report's file.
    ///
    /// # Errors
    /// Whatever stops loading or drawing; [`Error::Window`] or [`Error::Headset`] where the wanted output cannot be had.
    pub fn run(&self, setup: &Setup<'_>) -> Result<()> {
        console::step_aside();
        match self.on {
            On::Auto => self.run_auto(setup),
            On::Window => self.run_window(setup),
            On::Headset => self.run_headset(setup),
        }
    }

    pub(super) fn write_report(&self, report: impl FnOnce() -> RunReport) -> Result<()> {
        let Some(path) = &self.report else { return Ok(()) };
        let text = serde_json::to_string(&report()).map_err(|e| Error::write(path)(e.into()))?;
        write_atomically(path, (text + "\n").as_bytes())
    }

    /// In a headset, else in a window, else as a picture; one line says which and why.
    fn run_auto(&self, setup: &Setup<'_>) -> Result<()> {
        let probed = headset::probe();
        let no_window = match no_display() {
            Some(reason) => reason,
            None => {
                let wanted = if probed.is_ok() { Wanted::Headset } else { Wanted::Window };
                let no_headset = probed.as_ref().err().map(String::as_str);
                match window::run(self, setup, wanted, no_headset)? {
                    None => return Ok(()),
                    Some(reason) => reason,
                }
            }
        };
        let no_headset = match probed {
            Err(reason) => reason,
            Ok(_) => match headset::connect(setup.gpu) {
                Ok(connected) => return headset::run_alone(self, connected, setup),
                Err(Error::Headset { problem }) => problem,
                Err(error) => return Err(error),
            },
        };
        self.write_picture(setup, &no_headset, &no_window)
    }

    fn run_window(&self, setup: &Setup<'_>) -> Result<()> {
        let problem = match no_display() {
            Some(problem) => Some(problem),
            None => window::run(self, setup, Wanted::Window, None)?,
        };
        problem.map_or(Ok(()), |problem| Err(Error::Window { problem }))
    }

    /// With a mirror where there is a display.
    fn run_headset(&self, setup: &Setup<'_>) -> Result<()> {
        headset::probe().map_err(|problem| Error::Headset { problem })?;
        let mirrored = no_display().is_none() && window::run(self, setup, Wanted::HeadsetOnly, None)?.is_none();
        if mirrored { Ok(()) } else { headset::run_alone(self, headset::connect(setup.gpu)?, setup) }
    }

    fn write_picture(&self, setup: &Setup<'_>, no_headset: &str, no_window: &str) -> Result<()> {
        interrupt::stop_listening();
        let output = reserve_fallback()?;
        let (frames, settings) = (self.frames, self.settings.clone());
        let request = RenderRequest { frames, settings, ..RenderRequest::new(self.scene()?, &output) };
        let facts = render(&request, setup).inspect_err(|_| {
            // Removes only the reserved name; the error says what went wrong.
            let _ = std::fs::remove_file(&output);
        })?;
        let name = output.display();
        say!(
            "pbr-vr: wrote {name}, because {no_headset}, and {no_window}; start it in a desktop session to get a window"
        );
        let RenderFacts { gpu, driver, frames, .. } = facts;
        self.write_report(|| RunReport { on: "picture", gpu, driver, frames, present_mode: None, headset: None })
    }
}

/// Reserves the fallback's name, or a numbered one if it is taken, so that no two programs write the same file.
fn reserve_fallback() -> Result<PathBuf> {
    match std::fs::File::create_new(FALLBACK) {
        Ok(_) => Ok(FALLBACK.into()),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => screenshot::reserve_name(Path::new("")),
        Err(error) => Err(Error::write(FALLBACK)(error)),
    }
}

/// Why no window can be opened here, if that can be known beforehand.
pub fn no_display() -> Option<String> {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let missing = cfg!(all(unix, not(target_os = "macos"))) && !set("DISPLAY") && !set("WAYLAND_DISPLAY");
    missing.then(|| "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::args::parsed;

    #[test]
    fn without_arguments_a_request_is_the_default_one() {
        assert_eq!(parsed::<ViewRequest>(&[]).expect("arguments"), ViewRequest::default());
        for arguments in [["--on", "toaster"], ["--frames", "0"], ["--mirror", "none"]] {
            assert!(parsed::<ViewRequest>(&arguments).is_err(), "{arguments:?}");
        }
    }
}
