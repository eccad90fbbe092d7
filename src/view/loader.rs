//! The loader: one thread that loads scenes and panoramas, builds pipelines, writes screenshots and frees old scenes, in
//! the order of requests, so that no frame waits for any of it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use super::screenshot;
use crate::asset::{Panorama, Report, TextureOptions, shipped};
use crate::context::Context;
use crate::render::{KeptPipelines, Lighting, PassPipelines, PipelineRequest, RenderSettings, Renderer};
use crate::scene::description::Description;
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Bounds, Camera, Scene, floor_under};
use crate::{Error, Result};

/// Loads a scene with the shipped panorama for those that name none.
///
/// # Errors
/// Those of [`load`].
pub fn load_scene(path: &Path, textures: &TextureOptions, report: &Report) -> Result<Scene> {
    let default_panorama = shipped::folder().ok().map(|folder| folder.join(shipped::PANORAMA));
    load(path, &LoadOptions { default_panorama, textures: textures.clone() }, report)
}

/// The panorama that [`load_scene`] uses.
fn panorama_file(scene: &Path) -> Option<PathBuf> {
    let own = Description::load(scene).ok().and_then(|description| description.environment);
    own.map(|environment| environment.panorama).or_else(|| Some(shipped::folder().ok()?.join(shipped::PANORAMA)))
}

/// A scene that is ready to be drawn.
pub struct LoadedScene {
    /// The file's name.
    pub name: String,
    pub path: PathBuf,
    /// The file of the panorama that lights it; `None` for uniform light.
    pub panorama: Option<PathBuf>,
    pub renderer: Renderer,
    /// At least one.
    pub cameras: Vec<Camera>,
    pub bounds: Bounds,
    /// World heights of the floor under each camera.
    pub floors: Vec<f32>,
    /// The scene file's exposure, stops.
    pub exposure_ev: f32,
    /// The scene file's rotation of the panorama about +Y, radians.
    pub environment_rotation: f32,
}

impl LoadedScene {
    /// Builds all pipelines again from the current shaders; on an error the old ones stay.
    ///
    /// # Errors
    /// A shader that does not compile.
    #[cfg(feature = "hot-reload")]
    pub fn reload_shaders(&mut self) -> Result<()> {
        let (settings, eyes) = (self.renderer.settings().clone(), self.renderer.eyes());
        self.renderer.rebuild(settings, eyes)
    }
}

/// The target that a scene is drawn for.
#[derive(Clone)]
pub struct Target {
    /// Pixels of one eye's picture.
    pub size: [u32; 2],
    pub eyes: u32,
    /// The hidden area of each eye's picture: triangles, three corners each, 0 to 1, v downwards.
    pub hidden: [Vec<[f32; 2]>; 2],
}

/// Requests to the loader.
pub enum LoadRequest {
    Scene {
        path: PathBuf,
        settings: RenderSettings,
        target: Target,
    },
    Panorama {
        path: PathBuf,
        settings: RenderSettings,
    },
    /// Pipelines; the number identifies the request in its result.
    Pipelines(u64, PipelineRequest),
    /// RGBA, 8 bits a channel.
    Screenshot {
        pixels: Vec<u8>,
        size: [u32; 2],
    },
    /// Free a scene that is no longer drawn: it has thousands of objects.
    Discard(Box<LoadedScene>),
}

/// Results in the order of requests; [`LoadRequest::Discard`] has none.
pub enum LoadResult {
    Scene(Result<Box<LoadedScene>>),
    Panorama { path: PathBuf, settings: RenderSettings, lighting: Result<Box<Lighting>> },
    Pipelines(u64, Result<Box<PassPipelines>>),
    Screenshot(Result<PathBuf>),
}

/// The loader's thread. On drop it finishes the current request, writes the remaining screenshots, and ends.
pub struct Loader {
    requests: Option<Sender<LoadRequest>>,
    results: Receiver<LoadResult>,
    closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loader {
    /// Starts the thread, which calls `wake` whenever there is a result to take.
    ///
    /// # Errors
    /// [`Error::Window`] where no thread can be started.
    pub fn new(context: &Context, wake: impl Fn() + Clone + Send + 'static) -> Result<Self> {
        let (requests, to_do) = channel();
        let (sender, results) = channel();
        let closing = Arc::new(AtomicBool::new(false));
        let (context, stop) = (context.clone(), Arc::clone(&closing));
        let work = move || {
            let _wake = WakeAtEnd(wake.clone());
            for request in to_do {
                if stop.load(Ordering::Relaxed) && !matches!(request, LoadRequest::Screenshot { .. }) {
                    continue;
                }
                if let Some(result) = perform(&context, request) {
                    // The receiver outlives this thread, because its owner joins the thread.
                    let _ = sender.send(result);
                    wake();
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("loading".into())
            .spawn(work)
            .map_err(|e| Error::Window { problem: format!("no thread for loading can be started ({e})") })?;
        Ok(Self { requests: Some(requests), results, closing, thread: Some(thread) })
    }

    /// Puts a request at the end of the queue.
    pub fn start(&self, request: LoadRequest) {
        // This fails only if the thread has panicked, which `take` reports.
        if let Some(requests) = &self.requests {
            let _ = requests.send(request);
        }
    }

    /// The oldest result not yet taken.
    ///
    /// # Errors
    /// [`Error::Window`] if the thread has panicked.
    pub fn take(&self) -> Result<Option<LoadResult>> {
        match self.results.try_recv() {
            Ok(result) => Ok(Some(result)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Error::Window {
                problem: "the thread that loads scenes has panicked; this is a defect, please report it".into(),
            }),
        }
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        self.requests = None;
        // If it panicked, that has been printed, and `take` has made an error of it.
        let _ = self.thread.take().map(JoinHandle::join);
        for result in self.results.try_iter() {
            if let LoadResult::Screenshot(written) = result {
                screenshot::report(&written);
            }
        }
    }
}

/// Wakes the output even if the thread panics.
struct WakeAtEnd<F: Fn()>(F);

impl<F: Fn()> Drop for WakeAtEnd<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

fn perform(context: &Context, request: LoadRequest) -> Option<LoadResult> {
    // Warnings have been printed; keeping them would only use memory.
    let context = &Context { report: Arc::new(Report::to_terminal()), ..context.clone() };
    match request {
        LoadRequest::Scene { path, settings, target } => {
            Some(LoadResult::Scene(load_for(context, path, settings, &target)))
        }
        LoadRequest::Panorama { path, settings } => {
            let lighting = Panorama::load(&path, &context.report)
                .and_then(|panorama| Lighting::new(context, &panorama, &settings))
                .map(Box::new);
            Some(LoadResult::Panorama { path, settings, lighting })
        }
        LoadRequest::Pipelines(number, request) => {
            let mut kept = KeptPipelines::load(context);
            let pipelines = PassPipelines::build(&request).map(Box::new);
            kept.save();
            Some(LoadResult::Pipelines(number, pipelines))
        }
        LoadRequest::Screenshot { pixels, size } => Some(LoadResult::Screenshot(screenshot::write(&pixels, size))),
        LoadRequest::Discard(scene) => {
            drop(scene);
            None
        }
    }
}

fn load_for(context: &Context, path: PathBuf, settings: RenderSettings, target: &Target) -> Result<Box<LoadedScene>> {
    let scene = load_scene(&path, &settings.textures.options(context), &context.report)?;
    let Target { size, eyes, hidden } = target;
    let mut renderer = Renderer::new(context, &scene, settings, *size, *eyes)?;
    renderer.set_hidden_area(hidden)?;
    let bounds = scene.bounds();
    let floors = scene.cameras.iter().map(|camera| floor_under(&scene, camera.position)).collect();
    Ok(Box::new(LoadedScene {
        name: file_name(&path),
        panorama: panorama_file(&path),
        path,
        renderer,
        cameras: scene.cameras,
        bounds,
        floors,
        exposure_ev: scene.exposure_ev,
        environment_rotation: scene.environment.rotation_degrees.to_radians(),
    }))
}

/// A path's last part, for display.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
