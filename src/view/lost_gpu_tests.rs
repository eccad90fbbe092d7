//! A GPU that is reset in the middle of a bake.

use std::path::{Path, PathBuf};

use super::bake_scene::bake_scene;
use super::render::{RenderFacts, RenderRequest, render};
use crate::asset::Cache;
use crate::context::Setup;
use crate::gpu::{GpuOptions, LOSE_IN};
use crate::render::{LightDetail, LightModel, RenderSettings};

/// A box on a floor under a lamp.
fn scene(folder: &Path) -> PathBuf {
    let corner = |i: u32| format!("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
    let corners: String = (0..8).map(corner).collect();
    let sides = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let floor = "v -3 0 -3\nv -3 0 3\nv 3 0 3\nv 3 0 -3\nf 9 10 11 12\n";
    std::fs::write(folder.join("box.obj"), corners + sides + floor).unwrap();
    let path = folder.join("box.toml");
    let lamp = "[[light]]\npoint = { position = [1.5, 2, 1.5], intensity = [3, 3, 3] }\n";
    std::fs::write(&path, format!("[[model]]\nfile = \"box.obj\"\n{lamp}")).unwrap();
    path
}

fn request(scene: &Path, light: LightModel, name: &str) -> RenderRequest {
    let light_detail = LightDetail { lightmap_size: Some(64), lightmap_samples: 8, ..LightDetail::default() };
    RenderRequest {
        size: [64, 48],
        settings: RenderSettings { light, light_detail, cube_size: 16, ..RenderSettings::default() },
        ..RenderRequest::new(scene, scene.with_file_name(name))
    }
}

/// Does something on a GPU that is lost as soon as it gathers light.
fn losing<T>(work: impl FnOnce() -> T) -> T {
    LOSE_IN.set(Some("lightmap"));
    let done = work();
    LOSE_IN.set(None);
    done
}

#[test]
fn a_reset_in_a_bake_is_one_line_and_a_picture_without_and_nothing_wrong_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let setup = |cache: bool| Setup {
        cache: cache.then(|| Cache::in_folder(folder.path().join("cache"))),
        ..Setup::silent(GpuOptions { validate: true, ..GpuOptions::default() })
    };
    let draw = |light, cache| -> (Vec<u8>, RenderFacts) {
        let request = request(&scene, light, "picture.png");
        let facts = render(&request, &setup(cache)).unwrap();
        (std::fs::read(&request.output).unwrap(), facts)
    };
    let (without, _) = draw(LightModel::Direct, false);
    let (lost, facts) = losing(|| draw(LightModel::Baked, true));
    assert!(lost == without, "another picture than with direct light");
    // That the file has no material is told once, though it is read twice.
    let [material, said] = &facts.warnings[..] else { panic!("{:?}", facts.warnings) };
    assert!(material.contains("box.obj"), "{material}");
    assert!(said.contains("light") && said.contains("reset") && !said.contains('\n'), "{said}");
    let (whole, facts) = draw(LightModel::Baked, true);
    assert!(whole != without && facts.warnings[..] == [material.clone()], "{:?}", facts.warnings);
    assert!(draw(LightModel::Baked, false).0 == whole, "something wrong was kept");

    let baked = folder.path().join("baked");
    let error = losing(|| bake_scene(&scene, &baked, &setup(false))).map(drop).unwrap_err();
    assert!(error.is_device_lost() && error.to_string().contains("reset"), "{error}");
    assert_eq!(std::fs::read_dir(&baked).unwrap().count(), 0, "files of half a bake");
}
