//! The app between requests and results. The loader goes on only as far as a test lets it, and every pipeline is counted
//! for the thread that made it.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use super::*;
use crate::asset::Storage;
use crate::gpu::{FrameRing, Gpu, Subresource, pipelines_of_this_thread, read_image, with_gpu};
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
use crate::render::{FRAME_BYTES, Shading, TextureSettings};
use crate::scene::Model;

const SIZE: [u32; 2] = [48, 32];
/// Longer than any request takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// Where the loader waits after each result.
#[derive(Clone, Default)]
struct Gate(Arc<(Mutex<Passing>, Condvar)>);

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
    fn wait_for(&self, count: usize) {
        let (state, changed) = &*self.0;
        let mut passing = state.lock().unwrap();
        passing.allowed = passing.allowed.max(count - 1);
        changed.notify_all();
        let waited = changed.wait_timeout_while(passing, PATIENCE, |passing| passing.arrived < count).unwrap();
        assert!(!waited.1.timed_out(), "no result {count}");
    }

    fn open(&self) {
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
struct Desk {
    gate: Gate,
    app: App,
    ring: FrameRing,
    /// Pipelines that this thread had made before.
    made: usize,
}

/// Small and quick.
fn settings() -> RenderSettings {
    let textures = TextureSettings { storage: Some(Storage::Raw), anisotropy: Some(1), ..Default::default() };
    RenderSettings { samples: 1, cube_size: 16, irradiance_size: 4, textures, ..Default::default() }
}

fn scene() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.toml")
}

impl Desk {
    fn new(gpu: &Arc<Gpu>, settings: RenderSettings) -> Self {
        let gate = Gate::default();
        let wake = gate.clone();
        let target = Target { size: SIZE, eyes: 1, hidden: [Vec::new(), Vec::new()] };
        let app = App::new(Context::silent(gpu), settings, target, move || wake.pass()).unwrap();
        let mut desk = Self { gate, app, ring: FrameRing::new(gpu, FRAME_BYTES).unwrap(), made: 0 };
        desk.app.open_scene(&scene());
        desk.gate.wait_for(1);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Scene { replaced: false })));
        desk.made = pipelines_of_this_thread();
        desk
    }

    /// How the shown scene is drawn.
    fn settings(&self) -> &RenderSettings {
        self.app.scene.as_ref().unwrap().loaded.renderer.settings()
    }

    /// Draws a frame as outputs do.
    fn draw(&mut self) -> Vec<u8> {
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
    fn settle(&mut self) -> [usize; 2] {
        self.gate.open();
        let started = Instant::now();
        let mut changes = [0, 0];
        while self.app.settings != *self.settings() || !self.app.loading.is_empty() {
            assert!(started.elapsed() < PATIENCE, "{:?} are still not {:?}", self.settings(), self.app.settings);
            match self.app.collect().unwrap() {
                Some(Update::Scene { .. }) => changes[0] += 1,
                Some(Update::Light(_)) => changes[1] += 1,
                Some(Update::Failed(error)) => panic!("{error}"),
                _ => {}
            }
            self.draw();
        }
        self.assert_made_none();
        changes
    }

    fn assert_made_none(&self) {
        assert_eq!(pipelines_of_this_thread() - self.made, 0, "pipelines made between frames");
    }
}

fn shaded(shading: Shading) -> RenderSettings {
    RenderSettings { shading, ..settings() }
}

#[test]
fn frames_go_on_with_the_old_shading_until_the_new_ones_pipelines_are_there() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let before = desk.draw();
        desk.app.set_settings(shaded(Shading::Normal)).unwrap();
        for _ in 0..3 {
            assert!(desk.app.collect().unwrap().is_none());
            assert_eq!(desk.settings(), &settings());
            assert!(desk.draw() == before);
        }
        desk.gate.wait_for(2);
        // The pipelines are there, but frames take them only when they are collected.
        assert!(desk.draw() == before);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Settings)));
        assert_eq!(desk.settings(), &shaded(Shading::Normal));
        assert!(desk.draw() != before);
        desk.assert_made_none();
    });
}

#[test]
fn pipelines_of_an_earlier_request_are_dropped() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let before = desk.draw();
        // Back to what is shown: nothing has to be made for that.
        desk.app.set_settings(shaded(Shading::Normal)).unwrap();
        desk.app.set_settings(settings()).unwrap();
        desk.gate.wait_for(2);
        assert!(desk.app.collect().unwrap().is_none());
        assert_eq!(desk.settings(), &settings());
        assert!(desk.draw() == before);
        // Only the last of two.
        desk.app.set_settings(shaded(Shading::Normal)).unwrap();
        desk.app.set_settings(shaded(Shading::Uv)).unwrap();
        desk.gate.wait_for(3);
        assert!(desk.app.collect().unwrap().is_none());
        assert_eq!(desk.settings(), &settings());
        assert!(desk.draw() == before);
        desk.gate.wait_for(4);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Settings)));
        assert_eq!(desk.settings(), &shaded(Shading::Uv));
        desk.assert_made_none();
    });
}

#[test]
fn another_scene_drops_the_pipelines_of_the_one_before_which_the_loader_frees() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let old = Arc::downgrade(desk.app.scene.as_ref().unwrap().loaded.renderer.picture());
        desk.app.open_scene(&scene());
        desk.app.set_settings(shaded(Shading::Normal)).unwrap();
        desk.gate.wait_for(2);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Scene { replaced: true })));
        // The loader is held: so nobody else has freed it.
        assert!(old.upgrade().is_some());
        desk.gate.wait_for(3);
        assert!(desk.app.collect().unwrap().is_none(), "pipelines of the scene before");
        assert_eq!(desk.settings(), &settings());
        assert_eq!(desk.settle(), [0, 0]);
        let started = Instant::now();
        while old.upgrade().is_some() {
            assert!(started.elapsed() < PATIENCE, "it is never freed");
            std::thread::sleep(Duration::from_millis(5));
        }
    });
}

/// Changes of light and scene end with what a new app draws with these settings.
#[test]
fn light_and_scene_are_made_again_for_other_settings() {
    let karis = RenderSettings { geometry: Geometry::Karis2013, shading: Shading::Specular, ..settings() };
    let cases = [
        (RenderSettings { cube_size: 32, ..settings() }, [0, 1]),
        (karis, [0, 1]),
        (RenderSettings { model: Model::Everything, cube_size: 64, shading: Shading::Diffuse, ..settings() }, [1, 0]),
    ];
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        for (wanted, changes) in cases {
            desk.app.set_settings(wanted.clone()).unwrap();
            assert_eq!(desk.settle(), changes, "{wanted:?}");
            assert_eq!(desk.settings(), &wanted);
            assert!(desk.draw() == Desk::new(gpu, wanted.clone()).draw(), "another picture with {wanted:?}");
            desk.made = pipelines_of_this_thread();
        }
    });
}

#[test]
fn what_is_under_way_is_not_loaded_again_and_light_waits_for_its_pipelines() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let before = desk.draw();
        let slices = RenderSettings { split_sum: SplitSum::Slices, ..settings() };
        desk.app.set_settings(slices.clone()).unwrap();
        desk.app.set_settings(RenderSettings { shading: Shading::Specular, ..slices.clone() }).unwrap();
        assert_eq!(desk.app.loading.len(), 1);
        desk.gate.wait_for(2);
        assert!(desk.app.collect().unwrap().is_none(), "light without pipelines");
        assert_eq!(desk.settings(), &settings());
        assert!(desk.draw() == before);
        // The light still comes.
        let wanted = RenderSettings { shading: Shading::Diffuse, ..slices };
        desk.app.set_settings(wanted.clone()).unwrap();
        assert_eq!(desk.settle(), [0, 1]);
        assert_eq!(desk.settings(), &wanted);
    });
}

#[test]
fn a_panorama_that_does_not_load_is_not_asked_for_again() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        desk.app.open(Path::new("not/there.exr")).unwrap();
        desk.gate.wait_for(2);
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Failed(_))));
        desk.app.set_settings(RenderSettings { cube_size: 32, ..settings() }).unwrap();
        assert_eq!(desk.settle(), [0, 1]);
    });
}
