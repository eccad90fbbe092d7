//! Slow work beside the window: loading scenes and panoramas, writing screenshots. One thread, one job after another.

use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::super::headset::floor_under;
use super::super::picture::load_scene;
use crate::asset::picture::Picture;
use crate::asset::{Panorama, Report, folders};
use crate::gpu::Gpu;
use crate::precompute::LightMaps;
use crate::render::{ControllerGizmos, HiddenArea, Renderer, Settings, Shading};
use crate::scene::{Bounds, Camera};
use crate::{Error, Result, say};

/// A scene that is ready to be drawn.
pub struct LoadedScene {
    /// The file's name.
    pub name: String,
    pub renderer: Renderer,
    /// At least one.
    pub cameras: Vec<Camera>,
    pub bounds: Bounds,
    /// Heights of the floor under each camera.
    pub floors: Vec<f32>,
    pub exposure_ev: f32,
    pub rotation_degrees: f32,
}

/// What can be asked for.
pub enum LoadRequest {
    Scene {
        path: PathBuf,
        shading: Shading,
        size: [u32; 2],
        eyes: u32,
        /// What a headset's lenses hide of each eye's picture, as [`HiddenArea::new`] wants it.
        hidden: [Vec<[f32; 2]>; 2],
    },
    Panorama {
        path: PathBuf,
    },
    /// RGBA, 8 bits a channel, to be written into the working folder, or else among the user's pictures.
    Screenshot {
        pixels: Vec<u8>,
        size: [u32; 2],
    },
}

/// What came of it.
pub enum LoadResult {
    Scene(Result<Box<LoadedScene>>),
    Panorama { name: String, light: Result<Box<LightMaps>> },
    Screenshot(Result<PathBuf>),
}

/// The thread. When dropped, it finishes what it is at, writes what is still to be written, and ends.
pub struct Loader {
    jobs: Option<Sender<LoadRequest>>,
    done: Receiver<LoadResult>,
    closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loader {
    /// Starts it; `wake` is called from its thread whenever there is something to take.
    pub fn new(gpu: &Arc<Gpu>, settings: Settings, wake: impl Fn() + Clone + Send + 'static) -> Result<Self> {
        let (jobs, to_do) = channel();
        let (sender, done) = channel();
        let closing = Arc::new(AtomicBool::new(false));
        let (gpu, stop) = (Arc::clone(gpu), Arc::clone(&closing));
        let work = move || {
            let _wake = WakeAtEnd(wake.clone());
            for job in to_do {
                if stop.load(Ordering::Relaxed) && !matches!(job, LoadRequest::Screenshot { .. }) {
                    continue;
                }
                // Its owner is there until this thread has ended.
                let _ = sender.send(perform(&gpu, &settings, job));
                wake();
            }
        };
        let thread = std::thread::Builder::new()
            .name("loading".into())
            .spawn(work)
            .map_err(|e| Error::Window { problem: format!("no thread for loading can be started ({e})") })?;
        Ok(Self { jobs: Some(jobs), done, closing, thread: Some(thread) })
    }

    /// Puts a job at the queue's end.
    pub fn start(&self, job: LoadRequest) {
        // It fails only if the thread has died, which `take` reports.
        let _ = self.jobs.as_ref().map(|jobs| jobs.send(job));
    }

    /// The oldest result not yet taken.
    pub fn take(&self) -> Result<Option<LoadResult>> {
        match self.done.try_recv() {
            Ok(done) => Ok(Some(done)),
            Err(std::sync::mpsc::TryRecvError::Empty) => Ok(None),
            Err(std::sync::mpsc::TryRecvError::Disconnected) => Err(Error::Window {
                problem: "the thread that loads scenes has died; this is a defect, please report it".into(),
            }),
        }
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        self.jobs = None;
        // A panic of its has been printed, and `take` has made an error of it.
        let _ = self.thread.take().map(JoinHandle::join);
        for done in self.done.try_iter() {
            if let LoadResult::Screenshot(written) = done {
                report_screenshot(&written);
            }
        }
    }
}

/// Wakes the window even if the thread dies.
struct WakeAtEnd<F: Fn()>(F);

impl<F: Fn()> Drop for WakeAtEnd<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Says on the terminal where a screenshot is, or why there is none.
pub fn report_screenshot(written: &Result<PathBuf>) {
    match written {
        Ok(path) => say!("pbr-vr: wrote {}", path.display()),
        Err(error) => crate::complain!("pbr-vr: {error}"),
    }
}

fn perform(gpu: &Arc<Gpu>, settings: &Settings, job: LoadRequest) -> LoadResult {
    let report = Report::to_terminal();
    match job {
        LoadRequest::Scene { path, shading, size, eyes, hidden } => {
            let pictures = (shading, size, eyes);
            let stage = load_stage(gpu, settings, &path, pictures, &report);
            LoadResult::Scene(stage.and_then(|mut stage| {
                if eyes > 1 {
                    make_ready_for_headset(gpu, settings, &mut stage.renderer, &hidden)?;
                }
                Ok(stage)
            }))
        }
        LoadRequest::Panorama { path } => {
            let light = Panorama::load(&path, &report)
                .and_then(|panorama| LightMaps::new(gpu, &panorama, &settings.precompute))
                .map(Box::new);
            LoadResult::Panorama { name: file_name(&path), light }
        }
        LoadRequest::Screenshot { pixels, size } => {
            LoadResult::Screenshot(keep_screenshot(&pixels, size, Path::new(""), folders::pictures()))
        }
    }
}

fn load_stage(
    gpu: &Arc<Gpu>,
    settings: &Settings,
    path: &Path,
    (shading, size, eyes): (Shading, [u32; 2], u32),
    report: &Report,
) -> Result<Box<LoadedScene>> {
    let scene = load_scene(path, &settings.textures, report)?;
    let renderer = Renderer::new(gpu, &scene, settings.clone(), shading, size, eyes, report)?;
    let bounds = scene.bounds();
    let floors = scene.cameras.iter().map(|camera| floor_under(&scene, camera.position)).collect();
    Ok(Box::new(LoadedScene {
        name: file_name(path),
        renderer,
        cameras: scene.cameras,
        bounds,
        floors,
        exposure_ev: scene.exposure_ev,
        rotation_degrees: scene.environment.rotation_degrees,
    }))
}

/// Makes the pipelines that only a headset needs: in its first frame they would cost it some.
fn make_ready_for_headset(
    gpu: &Arc<Gpu>,
    settings: &Settings,
    renderer: &mut Renderer,
    hidden: &[Vec<[f32; 2]>; 2],
) -> Result<()> {
    // None yet, but now there is what draws them.
    renderer.set_gizmos(0, &ControllerGizmos::default())?;
    renderer.set_hidden_area(HiddenArea::new(gpu, settings, hidden)?);
    Ok(())
}

/// A path's last part, for people.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Writes it into `folder`. Started from a menu, a program may stand where it cannot write: then the user's pictures are
/// the place, and the path that comes back says so.
fn keep_screenshot(pixels: &[u8], size: [u32; 2], folder: &Path, pictures: Option<PathBuf>) -> Result<PathBuf> {
    match (write_screenshot(pixels, size, folder), pictures) {
        (Err(error), Some(pictures)) => write_screenshot(pixels, size, &pictures).map_err(|_| error),
        (written, _) => written,
    }
}

/// Writes `pbr-vr-N.png` with the first N that no file has.
fn write_screenshot(pixels: &[u8], [width, height]: [u32; 2], folder: &Path) -> Result<PathBuf> {
    let path = reserve_name(folder)?;
    let written = Picture::from_srgb8("screenshot", width, height, pixels).write(&path);
    if written.is_err() {
        // The name only; what went wrong is told by the error.
        let _ = std::fs::remove_file(&path);
    }
    written.map(|()| path)
}

/// Makes an empty file, so that no two programs take the same name.
pub fn reserve_name(folder: &Path) -> Result<PathBuf> {
    let mut number = 1u32;
    loop {
        let path = folder.join(format!("pbr-vr-{number}.png"));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(_) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(Error::write(&path)(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screenshots_never_overwrite() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("pbr-vr-2.png"), "mine").expect("a test file");
        let write = || write_screenshot(&[255, 0, 0, 255], [1, 1], folder.path()).expect("a screenshot");
        assert_eq!((file_name(&write()), file_name(&write())), ("pbr-vr-1.png".into(), "pbr-vr-3.png".into()));
        assert_eq!(std::fs::read(folder.path().join("pbr-vr-2.png")).expect("as before"), b"mine");
        let read = Picture::read(&folder.path().join("pbr-vr-3.png")).expect("a picture");
        assert_eq!(read.pixels, [[1.0, 0.0, 0.0]]);
    }

    #[test]
    fn a_folder_that_is_not_there_is_one_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = write_screenshot(&[0; 4], [1, 1], &folder.path().join("none")).expect_err("nowhere to write");
        assert!(error.to_string().contains("pbr-vr-1.png"), "{error}");
    }

    #[test]
    fn where_nothing_can_be_written_a_screenshot_goes_among_the_pictures() {
        let pictures = tempfile::tempdir().expect("a temporary folder");
        let keep =
            |folder: &str, into: PathBuf| keep_screenshot(&[0; 4], [1, 1], &pictures.path().join(folder), Some(into));
        let kept = keep("none", pictures.path().into()).expect("a screenshot");
        assert_eq!(kept, pictures.path().join("pbr-vr-1.png"));
        assert!(kept.is_file());
        let error = keep("none", pictures.path().join("neither")).expect_err("nowhere to write").to_string();
        assert!(error.contains("none") && !error.contains("neither"), "the folder that was meant: {error}");
    }
}
