//! The app between requests and results. The loader goes on only as far as a test lets it, and every pipeline is counted
//! for the thread that made it.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use super::*;
use crate::asset::{Cache, Storage};
use crate::gpu::{FrameRing, Gpu, NO_IMAGES, Subresource, pipelines_of_this_thread, read_image, with_gpu};
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
use crate::render::{
    Eye, FRAME_BYTES, FrameInputs, LightDetail, LightModel, MaterialFactors, Renderer, Shading, TextureSettings,
};
use crate::scene::Model;
use crate::scene::staging::Stage;

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
    let light = LightModel::Direct;
    RenderSettings { samples: 1, cube_size: 16, irradiance_size: 4, textures, light, ..Default::default() }
}

fn scene() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.toml")
}

impl Desk {
    fn new(gpu: &Arc<Gpu>, settings: RenderSettings) -> Self {
        Self::open(Context::silent(gpu), settings, &scene())
    }

    fn open(context: Context, settings: RenderSettings, scene: &Path) -> Self {
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

    fn shown(&self) -> &LoadedScene {
        &self.app.scene.as_ref().unwrap().loaded
    }

    /// Draws until all light of the shown scene is computed; returns the last picture.
    fn light_up(&mut self) -> Vec<u8> {
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
fn settings_that_there_is_no_memory_for_change_nothing_and_come_once_there_is() {
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let before = desk.draw();
        desk.gate.open();
        let smaller = RenderSettings { scale: 0.5, ..settings() };
        let smoother = RenderSettings { samples: 4, ..settings() };
        for wanted in [&smaller, &smoother] {
            NO_IMAGES.set(true);
            desk.app.set_settings(wanted.clone()).unwrap();
            let started = Instant::now();
            let told = loop {
                match desk.app.collect().unwrap() {
                    None => assert!(started.elapsed() < PATIENCE, "nothing is told"),
                    told => break told,
                }
            };
            NO_IMAGES.set(false);
            assert!(matches!(told, Some(Update::Failed(error)) if error.is_out_of_memory()));
            assert_eq!((desk.settings(), &desk.app.settings), (&settings(), &settings()));
            assert!(desk.draw() == before);
        }
        desk.app.set_settings(smaller).unwrap();
        desk.settle();
        assert!(desk.draw() != before);
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
        assert!(matches!(desk.app.collect().unwrap(), Some(Update::Scene(Arrival::Next))));
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
fn settings_that_load_the_scene_again_leave_what_a_person_has_changed() {
    let factors = MaterialFactors { base_color: glam::Vec3::new(0.2, 0.4, 0.9), metallic: 0.4, roughness: 0.6 };
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let at_first = desk.draw();
        let everything = RenderSettings { model: Model::Everything, ..settings() };
        for action in [Action::Exposure(-1.0), Action::Material(0), Action::Factors(0, Some(factors))] {
            assert_eq!(desk.app.perform(action).unwrap(), None);
        }
        assert_eq!(desk.settle(), [0, 0]);
        desk.app.set_settings(everything).unwrap();
        assert_eq!(desk.settle(), [1, 0]);
        let shown = desk.app.scene.as_ref().unwrap();
        assert_eq!((shown.exposure_ev, shown.material), (-1.0, Some(0)));
        assert_eq!(shown.loaded.renderer.factors(0), Some(factors));
        let changed = desk.draw();
        assert!(changed != at_first);
        desk.app.set_settings(settings()).unwrap();
        desk.settle();
        assert!(!desk.shown().renderer.lacks_pipelines());

        // Opened by a person, it is as in its file.
        desk.app.open_scene(&scene());
        assert_eq!(desk.settle(), [1, 0]);
        assert!(desk.draw() == at_first && desk.shown().renderer.edits().is_empty());
        // And so it is after a reset.
        desk.app.perform(Action::Factors(0, Some(factors))).unwrap();
        desk.settle();
        assert!(desk.draw() != at_first);
        desk.app.reset().unwrap();
        desk.settle();
        assert!(desk.draw() == at_first);
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

/// A box on a floor.
fn box_scene(folder: &Path) -> PathBuf {
    let corner = |i: u32| format!("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
    let corners: String = (0..8).map(corner).collect();
    let sides = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let floor = "v -3 0 -3\nv -3 0 3\nv 3 0 3\nv 3 0 -3\nf 9 10 11 12\n";
    let path = folder.join("box.obj");
    std::fs::write(&path, corners + sides + floor).unwrap();
    path
}

/// With a small lightmap of few samples.
fn baked() -> RenderSettings {
    let light_detail = LightDetail { lightmap_size: Some(256), lightmap_samples: 16, ..LightDetail::default() };
    RenderSettings { light: LightModel::Baked, light_detail, ..settings() }
}

#[test]
fn light_between_things_comes_to_a_scene_that_is_shown_and_changes_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = box_scene(folder.path());
    with_gpu(|gpu| {
        let mut desk = Desk::open(Context::silent(gpu), baked(), &path);
        assert!(desk.shown().renderer.lightmap().is_none());
        assert_eq!(desk.shown().light_progress(), Some(0.0));
        desk.app.scene.as_mut().unwrap().exposure_ev = -1.0;
        let open = desk.draw();
        // The shading follows while the lightmap is under way.
        desk.app.set_settings(RenderSettings { shading: Shading::Normal, ..baked() }).unwrap();
        desk.app.set_settings(baked()).unwrap();
        let lit = desk.light_up();
        assert!(lit != open && desk.shown().renderer.lightmap().is_some());
        assert_eq!(desk.app.scene.as_ref().unwrap().exposure_ev, -1.0);
        // The same as with a lightmap from the start.
        let context = Context::silent(gpu);
        let loaded =
            crate::view::loader::load_scene(&path, &baked().textures.options(&context), &context.report).unwrap();
        let mut renderer = Renderer::new(&context, &loaded, baked(), SIZE, 1).unwrap();
        let eyes = [Eye::of_camera(&loaded.cameras[0], SIZE[0] as f32 / SIZE[1] as f32)];
        let inputs = FrameInputs { exposure_ev: -1.0, ..FrameInputs::of(&loaded, &eyes) };
        renderer.finish_lightmap(&inputs).unwrap();
        let mut ring = FrameRing::new(gpu, FRAME_BYTES).unwrap();
        let mut frame = ring.begin().unwrap();
        renderer.record(&mut frame, &inputs).unwrap();
        frame.submit(None).unwrap();
        ring.finish_all().unwrap();
        assert!(read_image(gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, 4).unwrap() == lit);
    });
}

#[test]
fn panoramas_stay_with_models_that_name_none_and_the_first_scene_keeps_its_stage() {
    let folder = tempfile::tempdir().unwrap();
    let (path, assets) = (box_scene(folder.path()), Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"));
    let [forest, sunset] = ["forest.exr", "sunset.exr"].map(|name| assets.join("panoramas").join(name));
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, settings());
        let staging = Staging {
            panorama: Some(forest.clone()),
            stage: Stage { exposure: Some(2.0), ..Stage::default() },
            ..Staging::default()
        };
        desk.app.open_first(&path, staging);
        assert_eq!(desk.settle(), [1, 0]);
        assert_eq!((desk.shown().panorama.as_ref(), desk.shown().exposure_ev), (Some(&forest), 2.0));
        // Loaded again for other settings.
        desk.app.set_settings(RenderSettings { model: Model::Everything, ..settings() }).unwrap();
        assert_eq!(desk.settle(), [1, 0]);
        assert_eq!((desk.shown().panorama.as_ref(), desk.shown().exposure_ev), (Some(&forest), 2.0));
        desk.app.open(&sunset).unwrap();
        assert_eq!(desk.settle(), [0, 1]);
        std::fs::copy(&path, folder.path().join("other.obj")).unwrap();
        desk.app.open(&folder.path().join("other.obj")).unwrap();
        assert_eq!(desk.settle(), [1, 0]);
        assert_eq!((desk.shown().panorama.as_ref(), desk.shown().exposure_ev), (Some(&sunset), 0.0));
        // A scene with a panorama of its own is lit by that.
        let described = folder.path().join("own.toml");
        std::fs::write(&described, format!("environment = {{ panorama = '{}' }}\n", forest.display())).unwrap();
        desk.app.open(&described).unwrap();
        assert_eq!(desk.settle(), [1, 0]);
        assert_eq!(desk.shown().panorama.as_ref(), Some(&forest));
    });
}

#[test]
fn a_lightmap_of_a_scene_that_is_no_longer_shown_is_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = box_scene(folder.path());
    with_gpu(|gpu| {
        let mut desk = Desk::open(Context::silent(gpu), baked(), &path);
        desk.app.open_scene(&scene());
        assert_eq!(desk.settle(), [1, 0]);
        // Whether it was made before or not.
        std::thread::sleep(Duration::from_millis(500));
        assert!(desk.app.collect().unwrap().is_none());
        assert!(desk.shown().light_progress().is_none() && desk.shown().renderer.lightmap().is_none());
    });
}

#[test]
fn light_between_things_is_that_of_the_panorama_that_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = box_scene(folder.path());
    let forest = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/panoramas/forest.exr");
    with_gpu(|gpu| {
        // Another panorama, asked for before the lightmap is there, and after.
        let mut early = Desk::open(Context::silent(gpu), baked(), &path);
        early.app.open(&forest).unwrap();
        let lit_early = early.light_up();
        let mut late = Desk::open(Context::silent(gpu), baked(), &path);
        let before = late.light_up();
        late.app.open(&forest).unwrap();
        let lit_late = late.light_up();
        assert!(lit_late != before && lit_early == lit_late);
    });
}

#[test]
fn light_that_was_computed_while_a_scene_was_shown_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = box_scene(folder.path());
    with_gpu(|gpu| {
        let context = Context { cache: Some(Cache::in_folder(folder.path().join("cache"))), ..Context::silent(gpu) };
        let lit = Desk::open(context.clone(), baked(), &path).light_up();
        let mut again = Desk::open(context, baked(), &path);
        again.gate.open();
        while again.shown().lightmap_follows {
            assert!(!matches!(again.app.collect().unwrap(), Some(Update::Failed(_))));
        }
        assert_eq!(again.shown().light_progress(), None, "computed again");
        assert!(again.draw() == lit);
    });
}
