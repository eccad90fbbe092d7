//! Tests of whole scenes made of tiny files.

use super::*;
use crate::scene::staging::Stage;

const OBJ: &str = "mtllib m.mtl\nv -1 0 -1\nv 1 0 -1\nv 0 2 1\no a\nusemtl red\nf 1 2 3\no b\nusemtl gone\nf 3 2 1\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).unwrap();
    write("a.obj", OBJ.as_bytes());
    write("m.mtl", b"newmtl unused\nmap_Kd missing.png\nnewmtl red\nKd 1 0 0\nPr 0.25\n");
    write("sky.hdr", b"#?RADIANCE\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81");
    folder
}

fn loaded(folder: &tempfile::TempDir, toml: &str, options: &LoadOptions) -> (Result<Scene>, Vec<String>) {
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, toml).unwrap();
    let report = Report::silent();
    (load(&path, options, &report), report.warnings())
}

#[test]
fn a_description_with_everything() {
    let folder = folder();
    let toml = "environment = { panorama = \"sky.hdr\", rotation_degrees = 90 }\nexposure_ev = -1\n\
        [[model]]\nfile = \"a.obj\"\ntranslation = [1, 2, 3]\nrotation_degrees = [0, 90, 0]\nscale = 2\n[[model]]\nfile = \"a.obj\"\n\
        [[light]]\npoint = { position = [1, 2, 1], intensity = [40, 40, 40] }\n\
        [[camera]]\nname = \"front\"\nposition = [0, 1, 3]\ntarget = [0, 1, 0]\nvertical_fov_degrees = 60\n";
    let (scene, warnings) = loaded(&folder, toml, &LoadOptions::default());
    let scene = scene.unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 4), "one file, two places, two parts");
    assert_eq!(
        (scene.environment.panorama.width, scene.environment.rotation_degrees, scene.exposure_ev),
        (2, 90.0, -1.0)
    );
    assert_eq!((scene.lights.len(), scene.cameras.len()), (1, 1));
    let moved = scene.instances[0].world_from_local.transform_point3(Vec3::X);
    assert!((moved - Vec3::new(1.0, 2.0, 1.0)).length() < 1e-6, "scale, then turn +x to −z, then move: {moved}");
    let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["red", "default"]);
    assert_eq!(scene.meshes.iter().map(|mesh| mesh.material).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(warnings.len(), 1, "only the material that is gone, not the unused one's texture: {warnings:?}");
    assert_eq!(scene.materials[0].base_color_factor, Vec3::X);
}

#[test]
fn a_folders_scene_is_its_description_before_its_models() {
    let folder = folder();
    let found = || scene_in(folder.path()).map(|path| path.file_name().unwrap().to_owned());
    assert_eq!(found().unwrap(), "a.obj");
    for name in ["z.GLB", "b.toml", "c.toml"] {
        std::fs::write(folder.path().join(name), "").unwrap();
        assert_eq!(found().unwrap(), if name == "z.GLB" { "z.GLB" } else { "b.toml" });
    }
    assert_eq!(scene_in(&folder.path().join("gone")), None);
}

#[test]
fn models_are_staged_as_asked_and_written_down() {
    let folder = folder();
    let written = folder.path().join("written.toml");
    let staging = Staging {
        panorama: Some(folder.path().join("sky.hdr")),
        stage: Stage { exposure: Some(1.5), rotation: Some(30.0), camera: Some("40,20,5".into()), floor: true },
        write_scene: Some(written.clone()),
    };
    let options = LoadOptions { staging, ..LoadOptions::default() };
    let staged = load(&folder.path().join("a.obj"), &options, &Report::silent()).unwrap();
    let again = load(&written, &LoadOptions::default(), &Report::silent()).unwrap();
    assert_eq!((again.cameras[0].clone(), again.exposure_ev), (staged.cameras[0].clone(), 1.5));
    assert_eq!(again.environment.rotation_degrees, 30.0);
    assert_eq!(again.environment.panorama, staged.environment.panorama);
    assert_eq!((again.instances.len(), again.bounds()), (3, staged.bounds()), "with the floor");
}

#[test]
fn a_single_model_gets_light_and_a_camera_that_sees_it() {
    let folder = folder();
    let (report, path) = (Report::silent(), folder.path().join("a.obj"));
    let options = LoadOptions { default_panorama: Some(folder.path().join("sky.hdr")), ..LoadOptions::default() };
    let scene = load(&path, &options, &report).unwrap();
    assert_eq!(scene.environment.panorama.name, "sky.hdr");
    let camera = &scene.cameras[0];
    let bounds = scene.bounds();
    assert_eq!(
        (camera.name.as_str(), camera.target, camera.vertical_fov_degrees),
        ("auto", Vec3::new(0.0, 1.0, 0.0), 45.0)
    );
    assert_eq!(bounds, Bounds { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::new(1.0, 2.0, 1.0) });
    let towards = (camera.target - camera.position).normalize();
    assert!(camera.position.z > bounds.max.z && camera.position.y > camera.target.y && towards.x != 0.0);
    for corner in [bounds.min, bounds.max] {
        assert!(towards.angle_between(corner - camera.position).to_degrees() <= 22.5);
    }
    assert!(!report.warnings().iter().any(|w| w.contains("no environment")));
    let dark = load(&path, &LoadOptions::default(), &report).unwrap();
    assert_eq!(dark.environment.panorama.texels[0], [1.0; 3]);
    assert!(report.warnings().iter().any(|w| w.contains("no environment")));
}

#[test]
fn a_scene_without_models_still_has_a_camera() {
    let (scene, _) = loaded(&folder(), "environment = { panorama = \"sky.hdr\" }", &LoadOptions::default());
    let scene = scene.unwrap();
    assert!(scene.meshes.is_empty() && scene.cameras[0].position.is_finite());
}

#[test]
fn what_is_missing_or_broken_is_one_error() {
    let folder = folder();
    let fails = |toml: &str| loaded(&folder, toml, &LoadOptions::default()).0.unwrap_err();
    assert!(matches!(fails("[[model]]\nfile = \"b.obj\""), Error::SceneKey { line: 2, .. }));
    assert!(matches!(fails("[[model]]\nfile = \"m.mtl\""), Error::Broken { .. }));
    assert!(matches!(fails("environment = { panorama = \"a.obj\" }"), Error::Broken { .. }));
    let load = |name: &str| load(&folder.path().join(name), &LoadOptions::default(), &Report::silent()).unwrap_err();
    assert!(matches!(load("none.toml"), Error::Read { .. }));
    assert!(matches!(load("none.obj"), Error::Read { .. }));
    assert!(matches!(load("sky.hdr"), Error::Usage(_)));
}

#[test]
fn models_beyond_the_largest_coordinate_are_rejected() {
    let folder = folder();
    let toml = |scale: &str| format!("[[model]]\nfile = \"a.obj\"\nscale = {scale}\n");
    let error = loaded(&folder, &toml("9e8"), &LoadOptions::default()).0.unwrap_err().to_string();
    assert!(error.contains("scene.toml") && error.contains("smaller values for scale"), "{error}");
    assert!(loaded(&folder, &toml("4e8"), &LoadOptions::default()).0.is_ok());
}

#[test]
fn a_scene_lists_its_files() {
    let folder = folder();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, "environment = { panorama = \"sky.hdr\" }\n[[model]]\nfile = \"a.obj\"\n").unwrap();
    assert_eq!(files(&path), [path.clone(), folder.path().join("sky.hdr"), folder.path().join("a.obj")]);
    std::fs::write(&path, "nonsense").unwrap();
    assert_eq!(files(&path), [path]);
}
