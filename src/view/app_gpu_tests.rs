//! The app between requests and results.

#[path = "app_desk_tests.rs"]
pub(in crate::view) mod desk;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::*;
use crate::asset::Cache;
use crate::gpu::{
    FrameRing, NO_IMAGES, Subresource, pipelines_of_this_thread, read_image, with_gpu, with_gpu_of_little_memory,
};
use crate::reference::brdf::Geometry;
use crate::reference::split_sum::SplitSum;
use crate::render::{Eye, FRAME_BYTES, FrameInputs, LightDetail, LightModel, MaterialFactors, Renderer, Shading};
use crate::scene::Model;
use crate::scene::staging::Stage;
use desk::{Desk, PATIENCE, SIZE, panorama, scene, settings};

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
    with_gpu_of_little_memory(|gpu| {
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
        let classic = RenderSettings { split_sum: SplitSum::Classic, ..settings() };
        desk.app.set_settings(classic.clone()).unwrap();
        desk.app.set_settings(RenderSettings { shading: Shading::Specular, ..classic.clone() }).unwrap();
        assert_eq!(desk.app.loading.len(), 1);
        desk.gate.wait_for(2);
        assert!(desk.app.collect().unwrap().is_none(), "light without pipelines");
        assert_eq!(desk.settings(), &settings());
        assert!(desk.draw() == before);
        // The light still comes.
        let wanted = RenderSettings { shading: Shading::Diffuse, ..classic };
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

#[test]
fn settings_that_change_while_files_are_loaded_bring_back_nothing_that_was_before() {
    let folder = tempfile::tempdir().unwrap();
    let (other, forest) = (box_scene(folder.path()), panorama("forest.exr"));
    let broken = folder.path().join("broken.obj");
    std::fs::write(&broken, "f 1 2 3\n").unwrap();
    let everything = RenderSettings { model: Model::Everything, ..settings() };
    let finer = RenderSettings { cube_size: 32, ..settings() };
    with_gpu(|gpu| {
        let after = |open: &dyn Fn(&mut App), wanted: &RenderSettings| {
            let mut desk = Desk::new(gpu, settings());
            open(&mut desk.app);
            desk.app.set_settings(wanted.clone()).unwrap();
            desk.gate.open();
            let started = Instant::now();
            let mut failed = 0;
            while desk.settings() != wanted || !desk.app.loading.is_empty() {
                assert!(started.elapsed() < PATIENCE, "{:?} are still not {wanted:?}", desk.settings());
                failed += usize::from(matches!(desk.app.collect().unwrap(), Some(Update::Failed(_))));
            }
            (desk.shown().path.clone(), desk.app.scene.as_ref().unwrap().panorama.clone(), failed)
        };
        let own = Desk::new(gpu, settings()).shown().panorama.clone();
        for wanted in [&everything, &finer] {
            let (path, _, failed) = after(&|app| app.open_scene(&other), wanted);
            assert_eq!((path, failed), (other.clone(), 0));
            let both = |app: &mut App| {
                app.open_scene(&other);
                app.open(&forest).unwrap();
            };
            assert_eq!(after(&both, wanted), (other.clone(), Some(forest.clone()), 0));
            // What waited for a file that cannot be loaded goes on.
            let shown = (scene(), own.clone(), 1);
            assert_eq!(after(&|app| app.open_scene(&broken), wanted), shown);
            assert_eq!(after(&|app| app.open(Path::new("not/there.exr")).unwrap(), wanted), shown);
        }
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
    let light_detail = LightDetail { lightmap_size: Some(64), lightmap_samples: 16, ..LightDetail::default() };
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
    let (path, [forest, sunset]) = (box_scene(folder.path()), ["forest.exr", "sunset.exr"].map(panorama));
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
    let forest = panorama("forest.exr");
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
