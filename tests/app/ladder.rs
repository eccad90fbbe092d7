//! `pbr-vr measure ladder` and what is chosen from it: a whole ladder of a small scene, one that is cut short, and errors.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const SCENE: &str = "floor.toml";

/// The program in `folder`, with a cache of its own.
fn program(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command
        .args(arguments)
        .current_dir(folder)
        .env("PBR_VR_ASSETS", Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"))
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("LOCALAPPDATA", folder.join("cache"));
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    program(folder, arguments).output().expect("the program starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn fails(folder: &Path, arguments: &[&str], code: i32, part: &str) {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", stderr(&output));
    assert!(stderr(&output).contains(part), "{arguments:?}: {}", stderr(&output));
}

/// A folder with a scene: a wide floor of rough metal, without textures, seen at a slant under the shipped panorama.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("floor.mtl", "newmtl grey\nKd 0.6 0.6 0.6\nPr 0.9\nPm 1\n");
    write(
        "floor.obj",
        "mtllib floor.mtl\nusemtl grey\nv -40 0 -40\nv 40 0 -40\nv 40 0 40\nv -40 0 40\nf 4 3 2\nf 4 2 1\n",
    );
    let camera = "[[camera]]\nname = \"a\"\nposition = [0, 3, 3]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 30\n";
    write(SCENE, &format!("exposure_ev = -1.0\n[[model]]\nfile = \"floor.obj\"\n{camera}"));
    folder
}

fn json(path: PathBuf) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(&path).expect("a JSON file")).expect("whole JSON")
}

/// What was measured of the scene's settings.
fn configs(ladder: &serde_json::Value) -> &Vec<serde_json::Value> {
    ladder["ladders"][0]["configs"].as_array().expect("configs")
}

#[test]
fn a_ladder_tells_every_setting_apart_and_its_choices_are_taken() {
    let folder = scene();
    let at = folder.path();
    let limited =
        ["measure", "ladder", SCENE, "-o", "out", "--picture", "48x32", "--json", "all.json", "--tolerance", "1"];
    let said = succeeds(at, &limited);
    assert!(said.contains("floor: ") && said.contains("FLIP at most 1: "), "{said}");

    let ladder = json(at.join("out/ladder.json"));
    assert_eq!(json(at.join("all.json")), ladder);
    let configs = configs(&ladder);
    let number = |flags: &str, key: &str| {
        let config = configs
            .iter()
            .find(|config| config["flags"] == flags)
            .unwrap_or_else(|| panic!("no configuration `{flags}`"));
        config[key].as_f64().unwrap_or_else(|| panic!("no number {key} in {config}"))
    };
    for config in configs {
        for key in ["ms", "flip", "relative_mse"] {
            let value = number(config["flags"].as_str().expect("flags"), key);
            assert!(value.is_finite() && value > 0.0, "{key} of {config}");
        }
    }
    // Karis' masking and one lobe for all, Phong, and light that bounces once are other light: farther from the reference than the default by more than
    // what is left of the reference's own error, which is less than any error.
    let floor = &ladder["ladders"][0]["reference"]["floor"];
    let floor = ["flip", "relative_mse"].map(|key| floor[key].as_f64().expect("a floor"));
    for (key, floor) in ["flip", "relative_mse"].into_iter().zip(floor) {
        assert!(
            configs.iter().all(|config| config[key].as_f64().expect("an error") > floor),
            "{key}: {floor} of {ladder}"
        );
        for worse in ["--geometry karis2013 --split-sum classic", "--shading phong", "--scattering single"] {
            let [worse, default] = [worse, ""].map(|flags| number(flags, key));
            assert!(worse > default + floor, "{key}: {worse} against {default}, {floor}");
        }
    }
    // The same noise is in all of them, so that far less than the floor is told apart.
    for worse in ["--geometry karis2013 --split-sum classic", "--shading phong", "--scattering single"] {
        let [over, noise] = ["flip_over_default", "flip_noise"].map(|key| number(worse, key));
        assert!(over > noise && noise > 0.0, "{worse}: {over} ± {noise}");
        assert!((over - number(worse, "flip") + number("", "flip")).abs() < 1e-9, "{worse}");
    }
    assert_eq!(number("", "flip_noise"), 0.0, "the default beside itself");
    assert!(configs.iter().any(|config| config["dimension"] == "combined"), "nothing was combined");
    // Another one is better in time or in error.
    for config in configs.iter().filter(|config| !config["dominated_by"].is_null()) {
        let by = config["dominated_by"].as_str().map(|by| if by == "default" { "" } else { by }).expect("a name");
        let of = |key: &str| config[key].as_f64().expect("a number");
        assert!(number(by, "ms") < of("ms") || number(by, "flip") < of("flip"), "{config} by {by}");
    }
    assert!(configs.iter().any(|config| config["dominated_by"].is_null()), "there is a front");

    let csv = std::fs::read_to_string(at.join("out/ladder.csv")).expect("a table");
    assert_eq!(csv.lines().count(), configs.len() + 1);
    let table = std::fs::read_to_string(at.join("out/ladder.md")).expect("a table");
    let svg = std::fs::read_to_string(at.join("out/ladder-floor.svg")).expect("a chart");
    assert!(table.contains("67 pixels per degree") && svg.contains("67 pixels per degree"));
    for part in ["samples 1", "cube 64"] {
        assert!(table.contains(&part.replace("cube ", "--cube-size ")) && svg.contains(part), "{part}");
    }
    assert!(svg.len() < 150_000 && !svg.contains("NaN"), "{} bytes", svg.len());

    // What holds the limit is drawn, and the picture is that of the flags.
    let small = ["--size", "48x32"];
    let said = succeeds(at, &["render", SCENE, "-o", "chosen.png", "--tolerance", "1", small[0], small[1]]);
    let chosen: &str =
        said.lines().find_map(|line| line.split_once("at most 1: ")?.1.split_once(" (")).expect("a choice").0;
    let quickest =
        |key: &str| configs.iter().map(|config| config[key].as_f64().expect("a number")).fold(f64::INFINITY, f64::min);
    assert_eq!(
        number(if chosen == "default" { "" } else { chosen }, "ms"),
        quickest("ms"),
        "everything holds it: {said}"
    );
    let flags: Vec<&str> = chosen.split(' ').filter(|flag| *flag != "default").collect();
    succeeds(at, &[&["render", SCENE, "-o", "flags.png", small[0], small[1]], &flags[..]].concat());
    let read = |name: &str| std::fs::read(at.join(name)).expect("a picture");
    assert!(read("chosen.png") == read("flags.png"), "{chosen}");
    succeeds(at, &["render", SCENE, "-o", "budget.png", "--budget-ms", "1e9", small[0], small[1]]);
    fails(at, &["render", SCENE, "-o", "x.png", "--tolerance", "1e-9"], 1, "FLIP");
    fails(at, &["render", SCENE, "-o", "x.png", "--budget-ms", "1e-9"], 1, " ms");
    // Another scene has another ladder.
    std::fs::write(at.join(SCENE), std::fs::read_to_string(at.join(SCENE)).expect("the scene") + "\n# new\n")
        .expect("a file");
    fails(at, &["render", SCENE, "-o", "x.png", "--tolerance", "1"], 1, "measure ladder floor.toml");
    assert!(!at.join("x.png").exists());
}

#[test]
fn limits_and_settings_at_once_are_bad_usage() {
    let folder = scene();
    let at = folder.path();
    for (arguments, part) in [
        (&["render", SCENE, "-o", "x.png", "--tolerance", "0.1", "--samples", "1"][..], "--samples"),
        (&["render", SCENE, "-o", "x.png", "--tolerance", "0.1", "--shading", "pbr"][..], "--shading"),
        (&["view", SCENE, "--budget-ms", "5", "--textures", "raw"][..], "--textures"),
        (&["view", SCENE, "--budget-ms", "5", "--tolerance", "0.1"][..], "--tolerance"),
        (&["render", SCENE, "-o", "x.png", "--tolerance", "0"][..], "--tolerance"),
        (&["render", SCENE, "-o", "x.png", "--tolerance", "0.1", "--no-cache"][..], "--no-cache"),
        (&["render", SCENE, "-o", "x.png", "--samples", "2"][..], "--samples"),
        (&["render", SCENE, "-o", "x.png", "--scale", "2"][..], "--scale"),
        (&["render", SCENE, "-o", "x.png", "--cube-size", "100"][..], "--cube-size"),
        (&["render", SCENE, "-o", "x.png", "--irradiance-size", "2"][..], "--irradiance-size"),
        (&["render", SCENE, "-o", "x.png", "--shadow-size", "100"][..], "--shadow-size"),
        (&["render", SCENE, "-o", "x.png", "--lightmap-size", "4096"][..], "--lightmap-size"),
        (&["render", SCENE, "-o", "x.png", "--lightmap-samples", "7"][..], "--lightmap-samples"),
        (&["render", SCENE, "-o", "x.png", "--probe-size", "8"][..], "--probe-size"),
        (&["measure", "causes", "-o", "out", "--setting", "light"][..], "measure ladder"),
        (&["measure", "ladder", "-o", "out", "--setting", "lights"][..], "light"),
        (&["measure", "furnace", SCENE, "-o", "out"][..], "measure ladder"),
    ] {
        fails(at, arguments, 2, part);
    }
    fails(at, &["render", SCENE, "-o", "x.png", "--tolerance", "0.1"], 1, "measure ladder");
    fails(at, &["measure", "ladder", "none.toml", "-o", "out"], 1, "none.toml");
}

#[test]
fn what_a_ladder_had_when_it_was_stopped_stays() {
    let folder = scene();
    let at = folder.path();
    let arguments = ["measure", "ladder", SCENE, "-o", "out", "--picture", "32x16", "--pixels-per-degree", "11"];
    let mut child =
        program(at, &arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
    let csv = at.join("out/ladder.csv");
    let started = Instant::now();
    let rows = || std::fs::read_to_string(&csv).map_or(0, |text| text.lines().count().saturating_sub(1));
    while rows() < 2 {
        assert!(started.elapsed() < Duration::from_secs(120), "no rows came");
        assert!(child.try_wait().expect("a child").is_none(), "it ended before it was stopped");
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().expect("a child");
    child.wait().expect("a child");
    let finished = rows();
    assert!(finished >= 2);
    let ladder = json(at.join("out/ladder.json"));
    assert_eq!(ladder["ladders"][0]["reference"]["pixels_per_degree"], 11.0);
    assert!(std::fs::read_to_string(at.join("out/ladder.md")).expect("a table").contains("11 pixels per degree"));
    assert!(configs(&ladder).len() >= finished - 1, "JSON follows the table by a row at most");
    assert!(configs(&ladder).iter().all(|config| config["flip"].as_f64().is_some_and(|flip| flip > 0.0)), "{ladder}");
    assert!(!at.join("out/ladder-floor.svg").exists(), "the chart comes last");
    fails(at, &["render", SCENE, "-o", "x.png", "--tolerance", "1"], 1, "measure ladder");
}

#[test]
fn each_setting_changes_the_picture_and_keeps_its_size() {
    let folder = scene();
    let at = folder.path();
    // A scene with textures.
    let teapot = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/teapot.toml").display().to_string();
    let draw = |name: &str, flags: &[&str]| {
        succeeds(at, &[&["render", &teapot, "-o", name, "--size", "97x65", "--validate"], flags].concat());
        image::open(at.join(name)).expect("a picture").to_rgb8()
    };
    let plain = draw("plain.png", &[]);
    let same = draw("same.png", &["--samples", "4", "--scale", "1", "--cube-size", "256", "--irradiance-size", "32"]);
    assert!(same == plain, "these are the defaults");
    for flags in [["--samples", "1"], ["--scale", "0.5"], ["--cube-size", "16"], ["--drop-levels", "16"]] {
        let picture = draw("other.png", &flags);
        assert_eq!(picture.dimensions(), (97, 65), "{flags:?}");
        assert!(picture != plain, "{flags:?} did nothing");
    }
    // Where there is a lightmap, nothing else is diffuse.
    let direct = ["--light", "direct"];
    let small = [&direct[..], &["--irradiance-size", "4"]].concat();
    assert!(draw("direct.png", &direct) != draw("small.png", &small), "the irradiance map did nothing");
    let reference = ["--shading", "reference", "--frames", "2"];
    assert!(
        draw("a.png", &reference) == draw("b.png", &[&reference[..], &["--scale", "0.5"]].concat()),
        "the reference is drawn whole"
    );
}

#[test]
fn each_size_of_baked_light_changes_the_picture() {
    let folder = scene();
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).expect("a file");
    // A shiny strip of metal that lies, and a matt one that stands on it.
    write("strips.mtl", "newmtl metal\nKd 0.9 0.8 0.7\nPr 0.2\nPm 1\nnewmtl matt\nKd 0.7 0.3 0.3\nPr 1\nPm 0\n");
    write(
        "strips.obj",
        "mtllib strips.mtl\nusemtl metal\nv -2 0 -0.3\nv 2 0 -0.3\nv 2 0 0.3\nv -2 0 0.3\nf 4 3 2\nf 4 2 1\n\
         usemtl matt\nv -1 0 -0.1\nv 1 0 -0.1\nv 1 0.6 -0.1\nv -1 0.6 -0.1\nf 5 6 7\nf 5 7 8\n",
    );
    write(
        "strips.toml",
        "[[model]]\nfile = \"strips.obj\"\n[[light]]\npoint = { position = [0.5, 1.2, -0.8], intensity = [3, 3, 3] }\n\
         [[probe]]\nposition = [0, 0.4, 0.5]\nbox = [[-2, 0, -1], [2, 1.5, 1.5]]\n[[camera]]\nname = \"a\"\nposition = [0, 0.8, 2.5]\n\
         target = [0, 0.2, 0]\nvertical_fov_degrees = 40\n",
    );
    let draw = |flags: &[&str]| {
        succeeds(at, &[&["render", "strips.toml", "-o", "x.png", "--size", "97x65", "--validate"], flags].concat());
        image::open(at.join("x.png")).expect("a picture").to_rgb8()
    };
    let baked = ["--light", "baked", "--lightmap-size", "64", "--lightmap-samples"];
    let base = draw(&[&baked[..], &["8"]].concat());
    assert!(draw(&[&baked[..], &["8"]].concat()) == base, "from the cache");
    for flags in [["8", "--probe-size", "0"], ["8", "--shadow-size", "0"], ["16", "--probe-size", "128"]] {
        assert!(draw(&[&baked[..], &flags].concat()) != base, "{flags:?} did nothing");
    }
    let direct = draw(&["--light", "direct"]);
    for size in ["0", "256"] {
        assert!(draw(&["--light", "direct", "--shadow-size", size]) != direct, "--shadow-size {size} did nothing");
    }
}
