//! Tests of scene descriptions: defaults, and errors that name line and key.

use super::*;

fn parsed(text: &str) -> Result<Description> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("sub/a.obj"), "").unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    Description::load(&path)
}

#[test]
fn defaults() {
    let empty = parsed("").unwrap();
    assert_eq!((empty.environment, empty.exposure_ev, empty.models.len()), (None, 0.0, 0));
    let one =
        parsed("[[model]]\nfile = 'sub\\a.obj'\n[[camera]]\nname = \"c\"\nposition = [0, 0, 1]\ntarget = [0, 0, 0.5]")
            .unwrap();
    assert_eq!(one.models[0].world_from_local, Mat4::IDENTITY);
    assert!(
        one.models[0].file.ends_with("sub/a.obj"),
        "paths are relative to the scene's folder, with either separator"
    );
    assert_eq!(one.cameras[0].vertical_fov_degrees, 45.0);
}

#[test]
fn angles_are_applied_in_the_order_x_y_z() {
    let turned =
        parsed("[[model]]\nfile = 'sub/a.obj'\nrotation_degrees = [90, 90, 0]").unwrap().models[0].world_from_local;
    let expected = Mat4::from_rotation_x(90f32.to_radians()) * Mat4::from_rotation_y(90f32.to_radians());
    assert!(turned.abs_diff_eq(expected, 1e-6), "{turned}");
}

#[test]
fn a_lamp_is_a_point_unless_it_has_a_radius() {
    let radius = |more: &str| {
        let text = format!("[[light]]\npoint = {{ position = [0, 1, 0], intensity = [1, 1, 1]{more} }}");
        parsed(&text).unwrap().lights[0].radius
    };
    assert_eq!((radius(""), radius(", radius = 0.05"), radius(", radius = 0")), (0.0, 0.05, 0.0));
}

#[test]
fn errors_name_line_and_key() {
    let camera = "[[camera]]\nname = 'c'\nposition = [0, 0, 1]\n";
    for (text, line, key) in [
        ("exposure = 1", 1, "exposure"),
        ("\n[[models]]\nfile = 'a'", 2, "models"),
        ("[[model]]\nfile = 'sub/a.obj'\nscal = 2", 3, "scal"),
        ("environment = { panorma = 'x' }", 1, "panorma"),
        ("environment = { panorama = 'no.hdr' }", 1, "panorama"),
        ("# c\nexposure_ev = 'bright'", 2, "exposure_ev"),
        ("exposure_ev = nan", 1, "exposure_ev"),
        ("[[model]]\nscale = 1", 1, "model"),
        ("[[model]]\nfile = 'b.obj'", 2, "file"),
        ("[[model]]\nfile = ''", 2, "file"),
        ("[[model]]\nfile = 'sub/a.obj'\nscale = 0", 3, "scale"),
        ("[[model]]\nfile = 'sub/a.obj'\nscale = inf", 3, "scale"),
        ("[[model]]\nfile = 'sub/a.obj'\nscale = 1e12", 3, "scale"),
        ("[[model]]\nfile = 'sub/a.obj'\nscale = 1e-12", 3, "scale"),
        ("[[model]]\nfile = 'sub/a.obj'\ntranslation = [0, -2e9, 0]", 3, "translation"),
        ("[[light]]\npoint = { position = [0, 0, 1e30], intensity = [1, 1, 1] }", 2, "position"),
        (&format!("{camera}target = [1e10, 0, 1]"), 4, "target"),
        ("exposure_ev = 1e30", 1, "exposure_ev"),
        ("[[model]]\nfile = 'sub/a.obj'\ntranslation = [1, 2]", 3, "translation"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = [1, -1, 1] }", 2, "intensity"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = [1, 1, 1], radius = -0.1 }", 2, "radius"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = [1, 1, 1], radius = nan }", 2, "radius"),
        ("[[light]]\npoint = { position = [0, 0, 0], intensity = [1, 1, 1], radius = 1e9 }", 2, "radius"),
        ("[[light]]\nspot = 1", 2, "spot"),
        ("[[probe]]\nposition = [0, 0, 0]", 1, "probe"),
        ("[[probe]]\nposition = [0, 0, 0]\nbox = [[-1, -1, -1]]", 3, "box"),
        ("[[probe]]\nposition = [0, 0, 0]\nbox = [[-1, -1, -1], [1, inf, 1]]", 3, "box"),
        ("[[probe]]\nposition = [0, 0, 0]\nbox = [[-1, -1, -1], [1, 1, 1e12]]", 3, "box"),
        ("[[probe]]\nposition = [0, 0, 0]\nbox = [[-1, 1, -1], [1, -1, 1]]", 3, "box"),
        ("[[probe]]\nposition = [0, 2, 0]\nbox = [[-1, -1, -1], [1, 1, 1]]", 2, "position"),
        (&"[[probe]]\nposition = [0, 0, 0]\nbox = [[-1, -1, -1], [1, 1, 1]]\n".repeat(17), 50, "position"),
        ("probe = { position = [0, 0, 0], box = [[-1, -1, -1], [1, 1, 1]] }", 1, "probe"),
        (&format!("{camera}target = [0, 0, 1]"), 4, "target"),
        (&format!("{camera}target = [0, 0, 0]\nvertical_fov_degrees = 180"), 5, "vertical_fov_degrees"),
        (&format!("{camera}target = [0, 0, 0]\n{camera}target = [0, 0, 0]"), 6, "name"),
        ("exposure_ev = ", 1, "exposure_ev"),
    ] {
        match parsed(text) {
            Err(Error::SceneKey { line: l, key: k, problem, .. }) => {
                assert_eq!((l, k.as_str()), (line, key), "{text:?}: {problem}");
            }
            other => panic!("{text:?}: {other:?}"),
        }
    }
}

#[test]
fn common_mistakes_get_a_remedy_and_long_keys_are_shortened() {
    let long = "k".repeat(5000);
    for (text, part) in [
        ("[model]\nfile = 'sub/a.obj'", "`[[model]]`"),
        ("[light]\npoint = 1", "`[[light]]`"),
        ("[[model]]\nfile = \"sub\\a.obj\"", "write / instead"),
        ("[[model]]\nfile = \"C:\\users\\a.obj\"", "write / instead"),
        ("[[model]]\nfile = \"sub\\new.obj\"", "write / instead"),
        (&format!("{long} = 1"), "…"),
        (&format!("exposure_ev = '{long}'"), "…"),
    ] {
        let error = parsed(text).unwrap_err().to_string();
        assert!(error.contains(part) && error.chars().count() < 600, "{text}: {error}");
    }
}

#[test]
fn a_byte_order_mark_does_not_hide_the_first_line() {
    let error = parsed("\u{feff}exposure = 1").unwrap_err();
    assert!(matches!(&error, Error::SceneKey { line: 1, key, .. } if key == "exposure"), "{error}");
    assert_eq!(parsed("\u{feff}exposure_ev = 1").unwrap().exposure_ev, 1.0);
}

#[test]
fn invalid_utf8_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    std::fs::write(&path, b"# \xff").unwrap();
    assert!(matches!(Description::load(&path), Err(Error::Broken { .. })));
}

#[test]
fn only_the_folder_of_large_scenes_is_expanded_and_a_missing_file_gets_a_remedy() {
    for (file, part) in [
        ("${PBR_VR_SCENES}/not/there.obj", "set PBR_VR_SCENES to the folder that holds it"),
        ("${HOME}/a.obj", "only `${PBR_VR_SCENES}/` can begin with `$`"),
        ("$PBR_VR_SCENES/a.obj", "only `${PBR_VR_SCENES}/` can begin with `$`"),
    ] {
        let error = parsed(&format!("[[model]]\nfile = '{file}'")).unwrap_err();
        let Error::SceneKey { line: 2, key, problem, .. } = &error else { panic!("{error}") };
        assert!(key == "file" && problem.contains(part), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn a_file_that_cannot_be_looked_at_is_not_called_missing() {
    let name = "a".repeat(5000);
    let error = parsed(&format!("environment = {{ panorama = \"{name}\" }}")).unwrap_err().to_string();
    let reason = Path::new(&name).metadata().unwrap_err().to_string();
    assert!(error.contains(&reason), "{error}");
}
