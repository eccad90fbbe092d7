//! The command-line contract: what is written where, and every exit status.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs the program in `folder`, without a display or a headset.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pbr-vr"))
        .args(arguments)
        .current_dir(folder)
        .env("PBR_VR_ASSETS", Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"))
        .env("XDG_CONFIG_HOME", folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("LOCALAPPDATA", folder.join("cache"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Fails with status `code` and one line on stderr that holds all of `parts`.
fn fails(folder: &Path, arguments: &[&str], code: i32, parts: &[&str]) {
    let output = run(folder, arguments);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
    let line =
        error.lines().find(|line| line.starts_with("pbr-vr: ")).unwrap_or_else(|| panic!("{arguments:?}: {error}"));
    for part in parts {
        assert!(line.contains(part), "{arguments:?}: `{line}` does not say `{part}`");
    }
    assert_eq!(error.lines().filter(|line| line.starts_with("pbr-vr: ")).count(), 1, "{error}");
}

fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn teapot() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/teapot.toml").display().to_string()
}

/// tools/test runs the demo itself, as README.md shows it.
#[test]
fn without_a_display_a_scene_becomes_a_picture_and_one_line_says_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = succeeds(folder.path(), &["view", &teapot(), "--light", "direct"]);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("pbr-vr.png") && said.contains("display"), "{said}");
    let picture = image::open(folder.path().join("pbr-vr.png")).expect("a picture").to_rgb8();
    let distinct: std::collections::HashSet<_> = picture.pixels().collect();
    assert!(distinct.len() > 10_000, "only {} colours", distinct.len());
}

#[test]
fn view_without_display_or_headset_fails_where_one_is_demanded() {
    let folder = tempfile::tempdir().expect("a folder");
    fails(folder.path(), &["view", "--on", "window"], 1, &["display", "render"]);
    fails(folder.path(), &["view", "--on", "headset"], 1, &["headset", "--on window"]);
}

#[test]
fn render_writes_png_exr_stereo_and_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    let scene = teapot();
    let size = ["--size", "96x64"];
    let json = ["render", &scene, "-o", "a.png", "--json", "a.json", "--frames", "3", size[0], size[1]];
    succeeds(folder.path(), &json);
    let facts: serde_json::Value =
        serde_json::from_slice(&std::fs::read(path("a.json")).expect("the facts")).expect("JSON");
    assert_eq!(facts["frames"], 3);
    assert_eq!(facts["gpu_frames"].as_array().map(Vec::len), Some(3));
    assert!(facts["gpu_frames"][0][0]["ms"].as_f64().is_some_and(|ms| ms > 0.0), "{facts}");
    assert!(facts["load_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{facts}");
    succeeds(folder.path(), &["render", &scene, "-o", "b.exr", "--stereo", size[0], size[1], "--validate"]);
    assert!(path("b-left.exr").is_file() && path("b-right.exr").is_file() && !path("b.exr").exists());
    let compared = |arguments: &[&str]| {
        let said = succeeds(folder.path(), &[&["compare", "--json", "c.json"], arguments].concat());
        let numbers = std::fs::read(path("c.json")).expect("the numbers");
        (said, serde_json::from_slice::<serde_json::Value>(&numbers).expect("JSON"))
    };
    let (said, same) = compared(&["a.png", "a.png"]);
    assert!(said.contains("FLIP") && said.contains("at 67 pixels per degree"), "{said}");
    assert_eq!((same["flip_mean"].as_f64(), same["max_error"].as_f64()), (Some(0.0), Some(0.0)));
    // Edges of one sample and of four look different on larger pixels.
    succeeds(folder.path(), &["render", &scene, "-o", "d.png", "--samples", "1", size[0], size[1]]);
    let [near, far] = ["11", "67"].map(|n| {
        let (said, numbers) = compared(&["a.png", "d.png", "--pixels-per-degree", n]);
        assert!(said.contains(&format!("at {n} pixels per degree")), "{said}");
        assert_eq!(numbers["flip_pixels_per_degree"].as_f64(), n.parse().ok());
        numbers["flip_mean"].as_f64().expect("FLIP")
    });
    assert!((near / far - 1.0).abs() > 0.02, "{near} and {far}");
}

#[test]
fn a_bare_model_is_framed_and_lit() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.obj").display().to_string();
    succeeds(folder.path(), &["render", &model, "-o", "m.png", "--size", "64x64", "--camera", "auto"]);
    assert!(folder.path().join("m.png").is_file());
}

/// The command line says of a bare model what a description would.
#[test]
fn a_bare_model_is_staged_by_flags() {
    let folder = tempfile::tempdir().expect("a folder");
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let model = assets.join("scenes/sphere.obj").display().to_string();
    let panorama = assets.join("panoramas/forest.exr").display().to_string();
    let scene = format!(
        "exposure_ev = -1.5\nenvironment = {{ panorama = '{panorama}', rotation_degrees = -40 }}\n[[model]]\nfile = '{model}'\n\
        [[camera]]\nname = 'side'\nposition = [3, 0, 0]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 45\n"
    );
    std::fs::write(folder.path().join("s.toml"), scene).expect("a description");
    let common = ["--size", "64x64", "--light", "open", "-o"];
    let light = ["--panorama", &panorama, "--rotation", "-40", "--exposure", "-1.5"];
    let by = |file: &str, scene: &str, flags: &[&str]| {
        succeeds(folder.path(), &[&["render", scene], &common[..], &[file], flags].concat());
        std::fs::read(folder.path().join(file)).expect("the picture")
    };
    let described = by("a.png", "s.toml", &[]);
    let orbit = [&light[..], &["--camera", "90,0,3"]].concat();
    assert!(by("b.png", &model, &orbit) == described, "the same by flags");
    assert!(by("c.png", "s.toml", &["--exposure", "0"]) != described);
    assert!(by("d.png", &model, &[&orbit[..], &["--floor"]].concat()) != described);
    fails(folder.path(), &["render", &model, "-o", "e.png", "--camera", "left"], 2, &["auto, YAW,PITCH[,DISTANCE]"]);
    fails(folder.path(), &["render", &model, "-o", "e.png", "--panorama", "no.hdr"], 1, &["no.hdr"]);
}

#[test]
fn bad_usage_is_status_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = teapot();
    for arguments in [
        vec!["frobnicate"],
        vec!["render", &scene],
        vec!["render", &scene, "-o", "x.png", "--size", "0x5"],
        vec!["render", &scene, "-o", "x.png", "--size", "5"],
        vec!["render", &scene, "-o", "x.png", "--shading", "cartoon"],
        vec!["render", &scene, "-o", "x.png", "--frames", "0"],
        vec!["view", "--on", "toaster"],
        vec!["compare", "a.png", "a.png", "--pixels-per-degree", "0"],
        vec!["compare", "a.png", "a.png", "--pixels-per-degree", "NaN"],
        vec!["compare", "a.png", "a.png", "--pixels-per-degree", "inf"],
        vec!["measure", "ladder", "-o", "out", "--pixels-per-degree", "1e9"],
    ] {
        assert_eq!(run(folder.path(), &arguments).status.code(), Some(2), "{arguments:?}");
    }
    fails(folder.path(), &["some.toml"], 2, &["view some.toml"]);
    for (name, flag, value) in [
        ("furnace", "--panorama", "nope.hdr"),
        ("panoramas", "--tolerance", "0.1"),
        ("furnace", "--picture", "8x8"),
        ("causes", "--method", "ours"),
    ] {
        fails(folder.path(), &["measure", name, "-o", "m", flag, value], 2, &[flag]);
    }
    fails(folder.path(), &["measure", "furnace", "-o", "m", "--exposure", "1"], 2, &["a flag of the scene"]);
    fails(folder.path(), &["render", &scene, "-o", "x.bmp"], 2, &["x.bmp", ".png", ".exr"]);
    fails(folder.path(), &["render", "scene.fbx", "-o", "x.png"], 2, &["scene.fbx", ".toml", ".obj"]);
    fails(folder.path(), &["render", &scene, "-o", "x.png", "--camera", "nadir"], 2, &["nadir", "front"]);
    fails(folder.path(), &["render", &scene, "-o", "x.png", "--gpu", "voodoo"], 2, &["voodoo"]);
    fails(folder.path(), &["render", &scene, "-o", "x.png", "--size", "100000x100000"], 2, &["100000x100000"]);
}

#[test]
fn what_fails_is_status_1_with_file_and_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = teapot();
    fails(folder.path(), &["render", "none.toml", "-o", "x.png"], 1, &["none.toml"]);
    fails(folder.path(), &["render", &scene, "-o", "no/such/folder/x.png", "--size", "8x8"], 1, &["x.png"]);
    fails(folder.path(), &["compare", "none.png", "none.png"], 1, &["none.png"]);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("typo.toml", "exposure_ev = 0.0\n\n[[model]]\nfile = \"a.obj\"\nscalle = 2\n");
    fails(folder.path(), &["render", "typo.toml", "-o", "x.png"], 1, &["typo.toml:5", "scalle"]);
    write("broken.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n");
    fails(folder.path(), &["render", "broken.obj", "-o", "x.png"], 1, &["broken.obj"]);
    write("dark.toml", "environment = { panorama = \"dark.hdr\" }\n[[model]]\nfile = \"broken.obj\"\n");
    fails(folder.path(), &["render", "dark.toml", "-o", "x.png"], 1, &["dark.hdr"]);
    fails(folder.path(), &["render", &scene, "-o", "x.png", "--size", "16000x16000"], 1, &["16000x16000"]);
    assert!(!folder.path().join("x.png").exists());
}

#[test]
fn nothing_is_written_over_what_is_read_or_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    let picture = |name: &str| image::RgbImage::new(8, 8).save(folder.path().join(name)).expect("a picture");
    write("s.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("sky.exr", "");
    write("s.toml", "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"s.obj\"\n");
    picture("a.png");
    picture("other.png");
    fails(folder.path(), &["compare", "other.png", "a.png", "--maps", "."], 2, &["a.png"]);
    fails(folder.path(), &["compare", "other.png", "a.png", "--json", "./other.png"], 2, &["other.png"]);
    fails(folder.path(), &["needs", "s.toml", "--json", "s.toml"], 2, &["s.toml"]);
    fails(folder.path(), &["needs", "s.toml", "--json", "s.obj"], 2, &["s.obj"]);
    fails(folder.path(), &["render", "s.toml", "-o", "sky.exr"], 2, &["sky.exr"]);
    fails(folder.path(), &["view", "s.obj", "--report", "s.obj"], 2, &["s.obj"]);
    fails(folder.path(), &["bake", "sky.exr", "-o", "d", "--json", "sky.exr"], 2, &["sky.exr"]);
    fails(folder.path(), &["render", "s.toml", "-o", "j.png", "--json", "j.png"], 2, &["j.png"]);
    let eyes = ["render", "s.toml", "-o", "j.png", "--stereo", "--json", "j-left.png"];
    fails(folder.path(), &eyes, 2, &["j-left.png"]);
    // Before the work: what is read here could not be drawn.
    for arguments in [
        vec!["render", "s.toml", "-o", "x.png", "--json", "no/x.json"],
        vec!["view", "s.toml", "--report", "no/x.json"],
        vec!["bake", "sky.exr", "-o", "s.obj/x"],
        vec!["measure", "ladder", "s.toml", "-o", "s.obj/x"],
    ] {
        fails(folder.path(), &arguments, 1, &["/x"]);
    }
    fails(folder.path(), &["measure", "ladder", "s.toml", "none.toml", "-o", "m"], 1, &["none.toml"]);
    fails(folder.path(), &["render", "s.toml", "-o", "x.png", "--size", "99999x9"], 2, &["99999x9"]);
}

#[test]
fn what_view_writes_without_a_display_takes_a_free_name_and_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("pbr-vr.png"), "mine").expect("a file");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.obj").display().to_string();
    let said = succeeds(folder.path(), &["view", &model, "--frames", "2", "--report", "r.json"]);
    assert!(said.contains("pbr-vr-1.png") && said.lines().count() == 1, "{said}");
    assert_eq!(std::fs::read(folder.path().join("pbr-vr.png")).expect("as before"), b"mine");
    assert!(image::open(folder.path().join("pbr-vr-1.png")).is_ok());
    let report = std::fs::read(folder.path().join("r.json")).expect("the report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    assert_eq!((report["on"].as_str(), report["frames"].as_u64()), (Some("picture"), Some(2)));
    fails(folder.path(), &["view", "none.obj"], 1, &["none.obj"]);
    assert!(!folder.path().join("pbr-vr-2.png").exists(), "an empty picture was left behind");
}

#[test]
fn what_a_picture_lacks_and_what_cannot_be_kept_is_told_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("s.obj", "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n");
    write(
        "s.toml",
        "[[model]]\nfile = \"s.obj\"\n[[light]]\npoint = { position = [0, 0, 0.1], intensity = [3e38, 3e38, 3e38] }\n",
    );
    // Where the cache's folder should be.
    write("cache", "");
    let output = run(folder.path(), &["render", "s.toml", "-o", "a.exr", "--size", "32x32"]);
    let error = text(&output.stderr);
    assert!(output.status.success(), "{error}");
    let warnings: Vec<&str> = error.lines().filter(|line| line.contains("WARN")).collect();
    for file in ["a.exr", "cache"] {
        assert_eq!(warnings.iter().filter(|line| line.contains(file)).count(), 1, "{file}: {error}");
    }
}

/// A closed room without a lamp: black, which must not look like a fault.
#[test]
fn a_room_that_no_light_enters_is_told_of_with_new_and_kept_light_and_by_the_reference() {
    let folder = tempfile::tempdir().expect("a folder");
    let cube = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
                f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    std::fs::write(folder.path().join("room.obj"), cube).expect("a file");
    let camera =
        "[[model]]\nfile = \"room.obj\"\n[[camera]]\nname = \"a\"\nposition = [0, 0, 0.5]\ntarget = [0, 0, 0]\n";
    std::fs::write(folder.path().join("dark.toml"), camera).expect("a file");
    let lamp = "[[light]]\npoint = { position = [0, 0.5, 0], intensity = [1, 1, 1] }\n";
    std::fs::write(folder.path().join("lit.toml"), format!("{camera}{lamp}")).expect("a file");
    let told = |scene: &str, more: &[&str]| {
        let output = run(
            folder.path(),
            &[&["render", scene, "-o", "a.png", "--size", "16x16", "--lightmap-size", "64"], more].concat(),
        );
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr).matches("less than a sixtieth of the panorama's light").count()
    };
    let reference = ["--shading", "reference", "--frames", "2"];
    assert_eq!([&[][..], &[], &reference, &["--light", "open"]].map(|more| told("dark.toml", more)), [1, 1, 1, 0]);
    assert_eq!([&[][..], &reference].map(|more| told("lit.toml", more)), [0, 0]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_a_closed_pipe_is_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.obj").display().to_string();
    let shell = |line: &str| {
        let program = env!("CARGO_BIN_EXE_pbr-vr");
        let line = line.replace("PROGRAM", &format!("'{program}'")).replace("MODEL", &format!("'{model}'"));
        Command::new("bash").args(["-c", &line]).current_dir(folder.path()).output().expect("a shell")
    };
    let full = shell("PROGRAM needs MODEL > /dev/full");
    assert_eq!(full.status.code(), Some(1), "{}", text(&full.stderr));
    assert_eq!(text(&full.stderr).lines().count(), 1, "{}", text(&full.stderr));
    assert_eq!(shell("PROGRAM needs none.obj 2> /dev/full").status.code(), Some(1));
    assert_eq!(shell("PROGRAM needs none.obj 2>&-").status.code(), Some(1));
    let closed = shell("PROGRAM needs MODEL >&-");
    assert_eq!(closed.status.code(), Some(1), "what was to be printed is lost");
    assert!(text(&closed.stderr).contains("closed"), "{}", text(&closed.stderr));
    assert_eq!(shell("PROGRAM needs MODEL --json n.json > /dev/null").status.code(), Some(0));
    assert_eq!(shell("PROGRAM needs MODEL | true; exit ${PIPESTATUS[0]}").status.code(), Some(0));
    assert_eq!(shell("PROGRAM needs MODEL --json /dev/stdout | grep -q '{'").status.code(), Some(0));
}

#[cfg(target_os = "linux")]
#[test]
fn a_pipe_is_no_scene_and_absurd_numbers_of_threads_are_limited() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["pipe.toml", "pipe.obj", "pipe.glb"] {
        let made = Command::new("mkfifo").arg(folder.path().join(name)).status().expect("mkfifo");
        assert!(made.success());
        fails(folder.path(), &["needs", name], 1, &[name, "pipe"]);
    }
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.obj");
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command.arg("needs").arg(model).current_dir(folder.path()).env("RAYON_NUM_THREADS", "100000");
    let started = std::time::Instant::now();
    let output = command.output().expect("the program");
    assert!(output.status.success() && started.elapsed().as_secs() < 60, "{:?}", started.elapsed());
    assert!(text(&output.stderr).contains("RAYON_NUM_THREADS=100000"), "{}", text(&output.stderr));
}

#[test]
fn doctor_lists_what_is_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = succeeds(folder.path(), &["doctor"]);
    for part in ["GPU", "Vulkan 1.", "validation", "display", "OpenVR", "assets"] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn help_and_version_are_status_0() {
    let folder = tempfile::tempdir().expect("a folder");
    assert!(succeeds(folder.path(), &["--help"]).contains("render"));
    assert!(succeeds(folder.path(), &["--version"]).contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn the_readme_names_every_flag_and_every_value() {
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).expect("the README");
    let is_part_of_word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let named: std::collections::HashSet<&str> = readme.split(|c| !is_part_of_word(c)).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let mut seen = 0;
    for command in ["view", "render", "bake", "needs", "measure", "compare", "doctor"] {
        let help = succeeds(folder.path(), &[command, "-h"]);
        for line in help.lines().map(str::trim).filter(|line| line.starts_with('-') && !line.starts_with("-h")) {
            // Either name will do for a flag that has two.
            let mut names =
                line.split([' ', ',']).filter(|name| !name.is_empty()).take_while(|name| name.starts_with('-'));
            assert!(names.any(|name| named.contains(name)), "{command}: `{line}` is not in README.md");
            seen += 1;
        }
        // The help wraps its lines.
        let joined = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for list in joined.split("[possible values: ").skip(1).filter_map(|rest| rest.split(']').next()) {
            for value in list.split(", ") {
                assert!(named.contains(value), "{command}: {value} is not in README.md");
                seen += 1;
            }
        }
    }
    assert!(seen > 100, "only {seen} flags and values");
}
