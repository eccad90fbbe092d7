//! The loader: a thread that loads scenes and panoramas, builds pipelines, writes screenshots and frees old scenes, in the
//! order of requests, and one that prepares lightmaps, so that no frame waits for any of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Instant;

use glam::Vec3;

use super::measured::{MeasuredSettings, Measurements};
use super::memory_watch::{Advice, LOOK, MemoryWatch, TextureUse};
use super::scene_parts::SceneParts;
use super::screenshot;
use crate::asset::{Panorama, Report, TextureOptions, shipped};
use crate::context::Context;
use crate::render::{
    KeptPipelines, Lighting, LightmapRequest, Lightmapped, PassPipelines, PipelineRequest, RenderSettings, Renderer,
    SceneTextures, TextureRequest, is_lightmapped,
};
use crate::scene::description::Description;
use crate::scene::load::{LoadOptions, load};
use crate::scene::staging::Staging;
use crate::scene::{Bounds, Camera, Scene, floor_under};
use crate::{Error, Result};

/// Loads a scene with the shipped panorama for those that name none.
///
/// # Errors
/// Those of [`load`].
pub fn load_scene(path: &Path, textures: &TextureOptions, report: &Report) -> Result<Scene> {
    load_staged(path, Staging::default(), textures, report)
}

/// The same on the stage that a command line asks for.
///
/// # Errors
/// Those of [`load`].
pub fn load_staged(path: &Path, staging: Staging, textures: &TextureOptions, report: &Report) -> Result<Scene> {
    let default_panorama = shipped::folder().ok().map(|folder| folder.join(shipped::PANORAMA));
    load(path, &LoadOptions { default_panorama, textures: textures.clone(), staging }, report)
}

/// The panorama that a scene names itself.
pub fn own_panorama(scene: &Path) -> Option<PathBuf> {
    Description::load(scene).ok()?.environment.map(|environment| environment.panorama)
}

/// The panorama that [`load_staged`] uses.
fn panorama_file(scene: &Path, staging: &Staging) -> Option<PathBuf> {
    let named = staging.panorama.clone().or_else(|| own_panorama(scene));
    named.or_else(|| Some(shipped::folder().ok()?.join(shipped::PANORAMA)))
}

/// A scene that is ready to be drawn.
pub struct LoadedScene {
    /// Of the request that it was loaded for.
    pub number: u64,
    /// Whether a lightmap is being prepared for it.
    pub lightmap_follows: bool,
    /// The file's name.
    pub name: String,
    pub path: PathBuf,
    /// How it was staged.
    pub staging: Staging,
    /// The file of the panorama that lights it; `None` for uniform light.
    pub panorama: Option<PathBuf>,
    pub renderer: Renderer,
    pub parts: SceneParts,
    /// What has been measured for it.
    pub measured: Vec<MeasuredSettings>,
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

impl Drop for LoadedScene {
    fn drop(&mut self) {
        // The cache saves time only.
        if let Err(error) = self.renderer.keep_light() {
            tracing::debug!("light is not kept: {error}");
        }
    }
}

impl LoadedScene {
    /// The part of its soft light that is computed, while it is; 0 to 1.
    pub fn light_progress(&self) -> Option<f32> {
        if self.lightmap_follows { Some(0.0) } else { self.renderer.light_progress() }
    }

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
    /// The number identifies the request in its results.
    Scene {
        number: u64,
        path: PathBuf,
        staging: Staging,
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
    /// Textures of the shown scene again, with other levels.
    Textures {
        advice: Advice,
        path: PathBuf,
        staging: Staging,
        request: TextureRequest,
    },
    /// These are shown from now on: look after the memory that they have.
    Watch(TextureUse),
    /// Free what is no longer drawn: a scene has thousands of objects.
    Discard(Box<dyn Send>),
}

/// Results in the order of requests, lightmaps and advice excepted; [`LoadRequest::Discard`] and [`LoadRequest::Watch`] have none.
pub enum LoadResult {
    /// A scene as it is drawn until its lightmap is there.
    Scene(Result<Box<LoadedScene>>),
    /// The lightmap of the scene of this request, where one can be made.
    Lightmap(u64, Result<Option<Box<Lightmapped>>>),
    Panorama {
        path: PathBuf,
        settings: RenderSettings,
        lighting: Result<Box<Lighting>>,
    },
    Pipelines(u64, Result<Box<PassPipelines>>),
    /// The GPU's memory has become too full for the shown textures, or has room for better ones.
    Memory(Advice),
    Textures(Advice, Result<Box<SceneTextures>>),
    Screenshot(Result<PathBuf>),
}

/// A lightmap to prepare for a scene that is shown without.
struct LightmapJob {
    number: u64,
    request: LightmapRequest,
    scene: Scene,
    stop: Arc<AtomicBool>,
}

/// The loader's threads. On drop they finish the current request, write the remaining screenshots, and end.
pub struct Loader {
    requests: Option<Sender<(LoadRequest, Arc<AtomicBool>)>>,
    results: Receiver<LoadResult>,
    closing: Arc<AtomicBool>,
    /// Stops the preparation of the lightmap of the last scene.
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    report: Arc<Report>,
}

impl Loader {
    /// Starts the threads, which call `wake` whenever there is a result to take.
    ///
    /// # Errors
    /// [`Error::Window`] where no thread can be started.
    pub fn new(
        context: &Context,
        measurements: Option<Measurements>,
        wake: impl Fn() + Clone + Send + 'static,
    ) -> Result<Self> {
        // Of everything that is loaded from now on.
        let report = Arc::new(Report::to_terminal());
        let context = Context { report: Arc::clone(&report), ..context.clone() };
        let (requests, to_do) = channel();
        let (jobs, jobs_to_do) = channel();
        let (sender, results) = channel();
        let closing = Arc::new(AtomicBool::new(false));
        let outbox = |sender| Outbox { sender, wake: WakeAtEnd(wake.clone()) };
        let (first, second) = (outbox(sender.clone()), outbox(sender));
        let work = Work { context: context.clone(), measurements, closing: Arc::clone(&closing) };
        let threads = vec![
            thread("loading", move || load_all(&work, to_do, &jobs, &first))?,
            thread("lightmaps", move || prepare_all(&context, jobs_to_do, &second))?,
        ];
        Ok(Self { requests: Some(requests), results, closing, stop: Arc::default(), threads, report })
    }

    /// Warnings and progress of what is loaded.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Puts a request at the end of the queue. A scene stops the preparation of the lightmap of the one before.
    pub fn start(&mut self, request: LoadRequest) {
        if matches!(request, LoadRequest::Scene { .. }) {
            self.stop.store(true, Ordering::Relaxed);
            self.stop = Arc::default();
        }
        // This fails only if the thread has panicked, which `take` reports.
        if let Some(requests) = &self.requests {
            let _ = requests.send((request, Arc::clone(&self.stop)));
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
        self.stop.store(true, Ordering::Relaxed);
        self.requests = None;
        // A panic has been printed.
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
        for result in self.results.try_iter() {
            if let LoadResult::Screenshot(written) = result {
                screenshot::report(&written);
            }
        }
    }
}

/// A thread's results. Wakes the output with each, and once it is closed, even by a panic.
struct Outbox<F: Fn()> {
    // Closed before the last wake: fields drop in order.
    sender: Sender<LoadResult>,
    wake: WakeAtEnd<F>,
}

struct WakeAtEnd<F: Fn()>(F);

impl<F: Fn()> Outbox<F> {
    fn put(&self, result: LoadResult) {
        // The receiver outlives the threads, because its owner joins them.
        let _ = self.sender.send(result);
        (self.wake.0)();
    }
}

impl<F: Fn()> Drop for WakeAtEnd<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

fn thread(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>> {
    let started = std::thread::Builder::new().name(name.into()).spawn(work);
    started.map_err(|e| Error::Window { problem: format!("no thread for {name} can be started ({e})") })
}

/// What the first thread works with.
struct Work {
    context: Context,
    measurements: Option<Measurements>,
    closing: Arc<AtomicBool>,
}

/// The work of the first thread.
fn load_all(
    work: &Work,
    requests: Receiver<(LoadRequest, Arc<AtomicBool>)>,
    jobs: &Sender<LightmapJob>,
    outbox: &Outbox<impl Fn()>,
) {
    let mut watch = MemoryWatch::default();
    let is_watched = work.context.gpu.memory_use().is_some();
    loop {
        let next = if is_watched { requests.recv_timeout(LOOK) } else { requests.recv().map_err(Into::into) };
        let (request, stop) = match next {
            Ok(next) => next,
            Err(RecvTimeoutError::Timeout) => {
                let advice = work.context.gpu.memory_use().and_then(|memory| watch.look(memory, Instant::now()));
                advice.into_iter().for_each(|advice| outbox.put(LoadResult::Memory(advice)));
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if let LoadRequest::Watch(textures) = request {
            watch.show(textures);
            continue;
        }
        if work.closing.load(Ordering::Relaxed) && !matches!(request, LoadRequest::Screenshot { .. }) {
            continue;
        }
        let (result, job) = perform(work, request, stop);
        result.into_iter().for_each(|result| outbox.put(result));
        // This fails only if the other thread has panicked, which has been printed.
        job.into_iter().for_each(|job| drop(jobs.send(job)));
    }
}

/// The work of the second thread.
fn prepare_all(context: &Context, jobs: Receiver<LightmapJob>, outbox: &Outbox<impl Fn()>) {
    for LightmapJob { number, request, scene, stop } in jobs {
        if !stop.load(Ordering::Relaxed) {
            // A panic has been printed; the scene is shown without.
            let prepare = AssertUnwindSafe(|| request.prepare(context, &scene, &stop));
            let lightmap = catch_unwind(prepare).unwrap_or_else(|_| Err(Error::light_panicked()));
            outbox.put(LoadResult::Lightmap(number, lightmap.map(|lightmap| lightmap.map(Box::new))));
        }
    }
}

/// Returns the request's result and what it leaves to be done.
fn perform(work: &Work, request: LoadRequest, stop: Arc<AtomicBool>) -> (Option<LoadResult>, Option<LightmapJob>) {
    let context = &work.context;
    match request {
        LoadRequest::Scene { number, path, staging, settings, target } => {
            let (loaded, scene) = match load_for(work, (number, path, staging), settings, &target) {
                Ok((loaded, scene)) => (Ok(loaded), scene),
                Err(error) => (Err(error), None),
            };
            let request = loaded.as_ref().ok().map(|loaded| loaded.renderer.lightmap_request());
            let job = request.zip(scene).map(|(request, scene)| LightmapJob { number, request, scene, stop });
            (Some(LoadResult::Scene(loaded)), job)
        }
        LoadRequest::Panorama { path, settings } => {
            let lighting = Panorama::load(&path, &context.report)
                .and_then(|panorama| Lighting::new(context, &panorama, &settings))
                .map(Box::new);
            (Some(LoadResult::Panorama { path, settings, lighting }), None)
        }
        LoadRequest::Pipelines(number, request) => {
            let mut kept = KeptPipelines::load(context);
            let pipelines = PassPipelines::build(&request).map(Box::new);
            kept.save();
            (Some(LoadResult::Pipelines(number, pipelines)), None)
        }
        LoadRequest::Screenshot { pixels, size } => {
            (Some(LoadResult::Screenshot(screenshot::write(&pixels, size))), None)
        }
        LoadRequest::Textures { advice, path, staging, request } => {
            let textures = load_textures(context, (&path, staging), &request, advice.limit).map(Box::new);
            (Some(LoadResult::Textures(advice, textures)), None)
        }
        LoadRequest::Discard(garbage) => {
            drop(garbage);
            (None, None)
        }
        LoadRequest::Watch(_) => (None, None),
    }
}

/// Loads a scene's textures again, of so many bytes at most. Whatever is to be said of its files has been said.
fn load_textures(
    context: &Context,
    (path, staging): (&Path, Staging),
    request: &TextureRequest,
    limit: u64,
) -> Result<SceneTextures> {
    let context = Context { report: Arc::new(Report::repeated()), ..context.clone() };
    let scene = load_staged(path, staging, &request.options(&context), &context.report)?;
    request.upload(&context, &scene, limit)
}

/// Loads a scene without its lightmap; returns what that is prepared from, where there is to be one.
fn load_for(
    Work { context, measurements, .. }: &Work,
    (number, path, staging): (u64, PathBuf, Staging),
    settings: RenderSettings,
    target: &Target,
) -> Result<(Box<LoadedScene>, Option<Scene>)> {
    let panorama = panorama_file(&path, &staging);
    let mut scene = load_staged(&path, staging.clone(), &settings.textures.options(context), &context.report)?;
    let Target { size, eyes, hidden } = target;
    let lightmap_follows = is_lightmapped(&scene, &settings);
    let mut renderer = Renderer::without_lightmap(context, &scene, settings, *size, *eyes)?;
    renderer.set_hidden_area(hidden)?;
    let bounds = scene.bounds();
    let floors = scene.cameras.iter().map(|camera| floor_under(&scene, camera.position)).collect();
    let loaded = Box::new(LoadedScene {
        number,
        lightmap_follows,
        name: file_name(&path),
        panorama,
        renderer,
        parts: SceneParts::of(&scene),
        measured: measurements.map_or_else(Vec::new, |measurements| measurements(&path, context)),
        path,
        staging: Staging { write_scene: None, ..staging },
        cameras: scene.cameras.clone(),
        bounds,
        floors,
        exposure_ev: scene.exposure_ev,
        environment_rotation: scene.environment.rotation_degrees.to_radians(),
    });
    // The atlas does not need it.
    scene.environment.panorama = Panorama::uniform(Vec3::ZERO);
    Ok((loaded, lightmap_follows.then_some(scene)))
}

/// A path's last part, for display.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::with_gpu;
    use crate::render::LightModel;

    #[test]
    fn a_lightmap_whose_preparation_panics_is_an_error_and_the_next_is_prepared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("floors.obj");
        // Two floors, one above the other.
        let floor = |y: f32| format!("v -1 {y} -1\nv -1 {y} 1\nv 1 {y} 1\nv 1 {y} -1\n");
        std::fs::write(&path, format!("{}{}f 1 2 3 4\nf 5 6 7 8\n", floor(0.0), floor(1.0))).unwrap();
        with_gpu(|gpu| {
            let context = Context::silent(gpu);
            let settings = RenderSettings { light: LightModel::Baked, cube_size: 16, ..RenderSettings::default() };
            let scene = load_scene(&path, &settings.textures.options(&context), &context.report).unwrap();
            let renderer = Renderer::without_lightmap(&context, &scene, settings, [16, 16], 1).unwrap();
            let mut broken = scene.clone();
            broken.instances[0].mesh = 99;
            let (jobs, to_do) = channel();
            for (number, scene) in [(1, broken), (2, scene)] {
                let request = renderer.lightmap_request();
                jobs.send(LightmapJob { number, request, scene, stop: Arc::default() }).unwrap();
            }
            drop(jobs);
            let (sender, results) = channel();
            prepare_all(&context, to_do, &Outbox { sender, wake: WakeAtEnd(|| ()) });
            let results: Vec<LoadResult> = results.iter().collect();
            let [LoadResult::Lightmap(1, Err(error)), LoadResult::Lightmap(2, Ok(Some(_)))] = &results[..] else {
                panic!("other results");
            };
            assert!(error.to_string().contains("light") && !error.to_string().contains('\n'), "{error}");
        });
    }
}
