//! An app for its tests: the loader goes on only as far as a test lets it, and every pipeline is counted for the thread that
//! made it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use super::super::*;
use crate::asset::Storage;
use crate::gpu::{FrameRing, Gpu, Subresource, pipelines_of_this_thread, read_image};
use crate::render::{Eye, FRAME_BYTES, LightModel, TextureSettings};

pub const SIZE: [u32; 2] = [48, 32];
/// Longer than any request takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(180);

/// Where the loader waits after each result.
#[derive(Clone, Default)]
pub struct Gate(Arc<(Mutex<Passing>, Condvar)>);

#[derive(Default)]
struct Passing {
    /// Results so far.
    arrived: usize,
    /// Results after which the loader goes on.
    allowed: usize,
}

impl Gate {
    /// The loader's part.
    fn pass(&self) {
        let (state, changed) = &*self.0;
        let mut passing = state.lock().unwrap();
        passing.arrived += 1;
        changed.notify_all();
        let own = passing.arrived;
        drop(changed.wait_while(passing, |passing| passing.allowed < own).unwrap());
    }

    /// Lets it go on until it has had `count` results in all, and waits for the last of these.
    pub fn wait_for(&self, count: usize) {
        let (state, changed) = &*self.0;
        let mut passing = state.lock().unwrap();
        passing.allowed = passing.allowed.max(count - 1);
        changed.notify_all();
        let waited = changed.wait_timeout_while(passing, PATIENCE, |passing| passing.arrived < count).unwrap();
        assert!(!waited.1.timed_out(), "no result {count}");
    }

    pub fn open(&self) {
        self.0.0.lock().unwrap().allowed = usize::MAX;
        self.0.1.notify_all();
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        // The app waits for its loader's end.
        self.gate.open();
    }
}

/// An app that shows a scene, with its loader held behind that scene's result.
pub struct Desk {
    pub gate: Gate,
    pub app: App,
    ring: FrameRing,
    /// Pipelines that this thread had made before.
    pub made: usize,
}

/// Small and quick.
pub fn settings() -> RenderSettings {
    let textures = TextureSettings { storage: Some(Storage::Raw), anisotropy: Some(1), ..Default::default() };
    let light = LightModel::Direct;
    RenderSettings { samples: 1, cube_size: 16, irradiance_size: 4, textures, light, ..Default::default() }
}

pub fn scene() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.toml")
}

pub fn panorama(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/panoramas").join(name)
}

impl Desk {
    pub fn new(gpu: &Arc<Gpu>, settings: RenderSettings) -> Self {
        Self::open(Context::silent(gpu), settings, &scene())
    }

    pub fn open(context: Context, settings: RenderSettings, scene: &Path) -> Self {
        let gate = Gate::default();
        let wake = gate.clone();
        let target = Target { size: SIZE, eyes: 1, hidden: [Vec::new(), Vec::new()] };
        let ring = FrameRing::new(&context.gpu, FRAME_BYTES).unwrap();
        let app = App::new(context, settings, target, move || wake.pass(), None).unwrap();
        let mut desk = Self { gate, app, ring, made: 0 };
        desk.app.open_scene(scene);
        desk.gate.wait_for(1);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Scene(Arrival::First))));
        desk.made = pipelines_of_this_thread();
        desk
    }

    /// How the shown scene is drawn.
    pub fn settings(&self) -> &RenderSettings {
        self.app.scene.as_ref().unwrap().loaded.renderer.settings()
    }

    /// Draws a frame as outputs do.
    pub fn draw(&mut self) -> Vec<u8> {
        let scene = self.app.scene.as_mut().unwrap();
        let eyes = [Eye::of_camera(&scene.loaded.cameras[0], SIZE[0] as f32 / SIZE[1] as f32)];
        let inputs = scene.inputs(&eyes, 0.0, None);
        let mut frame = self.ring.begin().unwrap();
        scene.loaded.renderer.record(&mut frame, &inputs).unwrap();
        frame.submit(None).unwrap();
        self.ring.finish_all().unwrap();
        let picture = scene.loaded.renderer.picture();
        read_image(&self.app.context.gpu, picture, Subresource { mip: 0, layer: 0 }, 4).unwrap()
    }

    /// Collects until the shown scene is drawn with the wanted settings and nothing is being loaded. Frames go on
    /// meanwhile, and none of them makes a pipeline. Returns how many scenes and lights there were.
    pub fn settle(&mut self) -> [usize; 2] {
        self.gate.open();
        let started = Instant::now();
        let mut changes = [0, 0];
        while self.app.settings != *self.settings()
            || !self.app.loading.is_empty()
            || self.shown().renderer.lacks_pipelines()
        {
            assert!(started.elapsed() < PATIENCE, "{:?} are still not {:?}", self.settings(), self.app.settings);
            match self.app.collect().unwrap() {
                Some(Update::Scene(_)) => changes[0] += 1,
                Some(Update::Light(_)) => changes[1] += 1,
                Some(Update::Failed(error)) => panic!("{error}"),
                _ => {}
            }
            self.draw();
        }
        self.assert_made_none();
        changes
    }

    pub fn shown(&self) -> &LoadedScene {
        &self.app.scene.as_ref().unwrap().loaded
    }

    /// Draws until all light of the shown scene is computed; returns the last picture.
    pub fn light_up(&mut self) -> Vec<u8> {
        self.gate.open();
        let started = Instant::now();
        // Light is computed again once all has rested for some frames.
        let mut rested = 0;
        while rested < 20 {
            assert!(started.elapsed() < PATIENCE, "light at {:?}", self.shown().light_progress());
            assert!(!matches!(self.app.collect().unwrap(), Some(Update::Scene(_) | Update::Failed(_))));
            self.draw();
            let waits = !self.app.loading.is_empty() || self.app.new_light.is_some();
            rested = if waits || self.shown().light_progress().is_some() { 0 } else { rested + 1 };
        }
        self.assert_made_none();
        self.draw()
    }

    pub fn assert_made_none(&self) {
        assert_eq!(pipelines_of_this_thread() - self.made, 0, "pipelines made between frames");
    }
}
