//! Which output shows a scene: a headset, a window, or else a picture file.

use std::path::{Path, PathBuf};

use super::headset::{self, RunReport};
use super::render::{RenderFacts, RenderRequest, render};
use super::request::{On, ViewRequest, Wanted};
use super::{console, interrupt, screenshot, window};
use crate::asset::temporary;
use crate::context::Setup;
use crate::{Error, Result, say};

/// The picture written if neither headset nor window can be opened.
const FALLBACK: &str = "pbr-vr.png";

/// Shows a scene on the requested output. [`ViewRequest::check`] has checked the report's file.
///
/// # Errors
/// Whatever stops loading or drawing; [`Error::Window`] or [`Error::Headset`] if the requested output is not available.
pub fn show(request: &ViewRequest, setup: &Setup<'_>) -> Result<()> {
    console::step_aside();
    match request.on {
        On::Auto => show_anywhere(request, setup),
        On::Window => show_in_window(request, setup),
        On::Headset => show_in_headset(request, setup),
    }
}

/// In a headset, else in a window, else as a picture; prints a line that says which and why.
fn show_anywhere(request: &ViewRequest, setup: &Setup<'_>) -> Result<()> {
    let probed = headset::probe();
    let no_window = match no_display() {
        Some(reason) => reason,
        None => {
            let wanted = if probed.is_ok() { Wanted::Headset } else { Wanted::Window };
            let no_headset = probed.as_ref().err().map(String::as_str);
            match window::run(request, setup, wanted, no_headset)? {
                None => return Ok(()),
                Some(reason) => reason,
            }
        }
    };
    let no_headset = match probed {
        Err(reason) => reason,
        Ok(_) => match headset::connect(setup.gpu) {
            Ok(connected) => return headset::run_alone(request, connected, setup),
            Err(Error::Headset { problem }) => problem,
            Err(error) => return Err(error),
        },
    };
    write_picture(request, setup, &no_headset, &no_window)
}

fn show_in_window(request: &ViewRequest, setup: &Setup<'_>) -> Result<()> {
    let problem = match no_display() {
        Some(problem) => Some(problem),
        None => window::run(request, setup, Wanted::Window, None)?,
    };
    problem.map_or(Ok(()), |problem| Err(Error::Window { problem }))
}

/// In the headset, with a mirror window if there is a display.
fn show_in_headset(request: &ViewRequest, setup: &Setup<'_>) -> Result<()> {
    headset::probe().map_err(|problem| Error::Headset { problem })?;
    let mirrored = no_display().is_none() && window::run(request, setup, Wanted::HeadsetOnly, None)?.is_none();
    if mirrored { Ok(()) } else { headset::run_alone(request, headset::connect(setup.gpu)?, setup) }
}

fn write_picture(view: &ViewRequest, setup: &Setup<'_>, no_headset: &str, no_window: &str) -> Result<()> {
    interrupt::stop_listening();
    let (frames, settings, staging) = (view.frames, view.settings.clone(), view.staging.clone());
    let scene = view.scene()?;
    // It has its final name when it is whole.
    let (beside, _) = temporary::create(Path::new(FALLBACK), "png").map_err(Error::write(FALLBACK))?;
    let request = RenderRequest { frames, settings, staging, ..RenderRequest::new(scene, &beside) };
    let done = render(&request, setup).and_then(|facts| Ok((facts, publish(&beside)?)));
    let (facts, output) = done.map_err(|error| {
        // The error says what went wrong.
        let _ = std::fs::remove_file(&beside);
        match error {
            Error::Write { path, source } if path == beside => Error::write(FALLBACK)(source),
            error => error,
        }
    })?;
    let name = output.display();
    say!("pbr-vr: wrote {name}, because {no_headset}, and {no_window}; start it in a desktop session to get a window");
    let RenderFacts { gpu, driver, frames, .. } = facts;
    view.write_report(|| RunReport {
        on: "picture",
        gpu,
        driver,
        frames,
        rate: None,
        present_mode: None,
        headset: None,
    })
}

/// Gives a picture the fallback's name, or a numbered one if that is taken: no other program's file is written over.
fn publish(beside: &Path) -> Result<PathBuf> {
    let name = |number| match number {
        1 => FALLBACK.into(),
        _ => screenshot::numbered(Path::new(""), number - 1),
    };
    screenshot::first_free(name, |path| match temporary::publish(beside, path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(Error::write(path)(error)),
    })
}

/// The reason why no window can be opened, if it is known beforehand.
pub fn no_display() -> Option<String> {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let missing = cfg!(all(unix, not(target_os = "macos"))) && !set("DISPLAY") && !set("WAYLAND_DISPLAY");
    missing.then(|| "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)".into())
}
