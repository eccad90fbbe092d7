//! `render --turntable` and `--path`: numbered pictures, the same each time, kept where they are whole, and made a video of.

use std::fs;
use std::path::Path;

use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;

use crate::common::{Workshop, finish, json, material, program, sphere, succeeds};
#[cfg(unix)]
use crate::common::{signal, wait_until};

/// A ball that looks different from each side, and three cameras.
fn shop() -> Workshop {
    let shop = Workshop::new();
    shop.sky(3.0);
    shop.write("m.mtl", &material([0.9, 0.6, 0.3], 1.0, 0.3));
    shop.write("ball.obj", &sphere("m.mtl"));
    let camera = |name: &str, position: [i32; 3]| {
        format!(
            "[[camera]]\nname = \"{name}\"\nposition = {position:?}\ntarget = [0, 0, 0]\nvertical_fov_degrees = 50\n"
        )
    };
    let cameras = camera("front", [0, 0, 3]) + &camera("side", [3, 1, 0]) + &camera("back", [0, 0, -4]);
    let environment = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"ball.obj\"\n";
    shop.write("scene.toml", &format!("{environment}{cameras}"));
    shop
}

const SMALL: [&str; 4] = ["--size", "48x32", "--light", "direct"];

fn render(shop: &Workshop, arguments: &[&str]) -> String {
    succeeds(program(shop.folder.path(), &[&["render", "scene.toml", "--validate"], &SMALL[..], arguments].concat()))
}

fn fails(shop: &Workshop, arguments: &[&str]) -> (Option<i32>, String) {
    let output = finish(program(shop.folder.path(), &[&["render", "scene.toml"], &SMALL[..], arguments].concat()));
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The files of a sequence with their bytes.
fn pictures(folder: &Path, stem: &str) -> Vec<(String, Vec<u8>)> {
    let names = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").file_name());
    let mut names: Vec<String> = names.filter_map(|name| name.into_string().ok()).collect();
    names.retain(|name| name.starts_with(stem) && !name.ends_with(".json"));
    names.sort();
    names.into_iter().map(|name| (name.clone(), fs::read(folder.join(&name)).expect("a picture"))).collect()
}

fn assert_same(shop: &Workshop, a: &str, b: &str, is_same: bool) {
    let [a, b] = [a, b].map(|name| Picture::read(&shop.path(name)).expect("a picture"));
    let flip = compare(&a, &b).expect("two pictures").flip_mean;
    assert!(if is_same { flip < 0.002 } else { flip > 0.02 }, "{} and {}: {flip}", a.name, b.name);
}

#[test]
fn a_turntable_goes_around_and_gives_the_same_bytes_again() {
    let shop = shop();
    let said = render(&shop, &["-o", "turn.png", "--turntable", "6", "--json", "facts.json"]);
    assert!(said.contains("turn-0001.png to turn-0006.png"), "{said}");
    let first = pictures(shop.folder.path(), "turn-");
    let names: Vec<&str> = first.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, [1, 2, 3, 4, 5, 6].map(|i| format!("turn-000{i}.png")));
    let facts = json(&shop.path("facts.json"));
    assert_eq!((facts["kept"].as_u64(), facts["files"].as_array().map(Vec::len)), (Some(0), Some(6)));
    // The first is the camera's own picture; half-way around it is another.
    render(&shop, &["-o", "front.png"]);
    assert_same(&shop, "turn-0001.png", "front.png", true);
    assert_same(&shop, "turn-0004.png", "front.png", false);
    for (_, bytes) in &first {
        assert_eq!(&bytes[1..4], b"PNG");
    }
    // Elsewhere, from nothing: the same bytes.
    let again = self::shop();
    render(&again, &["-o", "turn.png", "--turntable", "6"]);
    assert!(pictures(again.folder.path(), "turn-") == first, "other bytes");
    // There is nothing left to do; a damaged and a missing picture are drawn again.
    assert!(render(&shop, &["-o", "turn.png", "--turntable", "6"]).contains("6 of 6 pictures are there"));
    fs::write(shop.path("turn-0002.png"), "damaged").expect("a file");
    fs::remove_file(shop.path("turn-0005.png")).expect("a file");
    let said = render(&shop, &["-o", "turn.png", "--turntable", "6"]);
    assert!(said.contains("4 of 6 pictures are there"), "{said}");
    assert!(pictures(shop.folder.path(), "turn-") == first, "other bytes after mending");
}

#[test]
fn pictures_of_other_settings_or_another_scene_are_not_kept() {
    let shop = shop();
    let turn = |more: &[&str]| render(&shop, &[&["-o", "t.png", "--turntable", "3"], more].concat());
    turn(&[]);
    let before = pictures(shop.folder.path(), "t-");
    let said = turn(&["--exposure", "1"]);
    assert!(said.contains("all pictures are drawn again") && !said.contains("are there already"), "{said}");
    let brighter = pictures(shop.folder.path(), "t-");
    assert!(before.iter().zip(&brighter).all(|(a, b)| a.1 != b.1), "old pictures were kept");
    // A material's colour, in a file that the description does not name.
    shop.write("m.mtl", &material([0.1, 0.6, 0.3], 1.0, 0.3));
    assert!(turn(&["--exposure", "1"]).contains("all pictures are drawn again"));
    let green = pictures(shop.folder.path(), "t-");
    assert!(green.iter().zip(&brighter).all(|(a, b)| a.1 != b.1), "old pictures were kept");
    // Somebody else's pictures of these names are not taken for its own.
    fs::remove_file(shop.path("t-sequence.json")).expect("the record");
    fs::write(shop.path("t-0002.png"), "mine").expect("a file");
    assert!(!turn(&["--exposure", "1"]).contains("are there already"));
    assert!(pictures(shop.folder.path(), "t-") == green, "other bytes");
}

#[test]
fn a_path_leads_from_camera_to_camera() {
    let shop = shop();
    render(&shop, &["-o", "way.png", "--path", "front,side,back", "--frames", "7"]);
    assert_eq!(pictures(shop.folder.path(), "way-").len(), 7);
    for (camera, file) in [("front", "way-0001.png"), ("back", "way-0007.png")] {
        render(&shop, &["-o", "still.png", "--camera", camera]);
        assert_same(&shop, "still.png", file, true);
        assert_same(&shop, "still.png", "way-0004.png", false);
    }
    // Linear radiance, and averages of the reference.
    let reference =
        ["-o", "ref.exr", "--path", "front,front", "--frames", "2", "--shading", "reference", "--average", "3"];
    render(&shop, &reference);
    let both = pictures(shop.folder.path(), "ref-");
    assert!(both.len() == 2 && both[0].1 == both[1].1, "each picture is an average of its own");
    let (code, error) = fails(&shop, &["-o", "way.png", "--path", "front,nowhere", "--frames", "3"]);
    assert!(code == Some(2) && error.contains("nowhere") && error.contains("front, side, back"), "{error}");
    assert_eq!(fails(&shop, &["-o", "way.png", "--path", "front", "--frames", "3"]).0, Some(2));
}

#[cfg(unix)]
#[test]
fn an_interrupted_sequence_goes_on_where_it_ended() {
    let shop = shop();
    let arguments = ["-o", "t.png", "--turntable", "40", "--shading", "reference", "--average", "40"];
    let child = program(shop.folder.path(), &[&["render", "scene.toml"], &SMALL[..], &arguments].concat());
    wait_until("pictures", || shop.path("t-0003.png").exists());
    signal(child.id(), "INT");
    let output = finish(child);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("interrupted after") && error.contains("of 40 pictures"), "{error}");
    let done = pictures(shop.folder.path(), "t-");
    assert!((3..40).contains(&done.len()), "{} pictures", done.len());
    let said = render(&shop, &arguments);
    assert!(said.contains(&format!("{} of 40 pictures are there", done.len())), "{said}");
    let all = pictures(shop.folder.path(), "t-");
    assert!(all.len() == 40 && all[..done.len()] == done, "what was there was drawn again");
    let straight = self::shop();
    render(&straight, &arguments);
    assert!(pictures(straight.folder.path(), "t-") == all, "other bytes than without an interruption");
}

/// Whether a process has a handler of its own for SIGINT, which ends it at once before.
#[cfg(target_os = "linux")]
fn handles_interrupts(process: u32) -> bool {
    const SIGINT: u32 = 2;
    let status = fs::read_to_string(format!("/proc/{process}/status")).expect("a process");
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("signals");
    u64::from_str_radix(caught.trim(), 16).expect("a mask") & 1 << (SIGINT - 1) != 0
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_reference_keeps_the_picture_so_far() {
    let shop = shop();
    let arguments =
        ["render", "scene.toml", "-o", "r.png", "--shading", "reference", "--frames", "1000000", "--json", "f.json"];
    let child = program(shop.folder.path(), &[&arguments, &SMALL[..]].concat());
    wait_until("handler", || handles_interrupts(child.id()));
    // The handler is there just before the first frame.
    std::thread::sleep(std::time::Duration::from_secs(1));
    signal(child.id(), "INT");
    let output = finish(child);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && error.contains("interrupted after"), "{error}");
    assert!(Picture::read(&shop.path("r.png")).is_ok() && json(&shop.path("f.json"))["frames"].as_u64() > Some(1));
}

/// A program by ffmpeg's name that writes down what it is given.
#[cfg(unix)]
fn fake_ffmpeg(shop: &Workshop, script: &str) -> String {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = shop.path("bin");
    fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("ffmpeg");
    fs::write(&file, format!("#!/bin/sh\n{script}\n")).expect("a script");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).expect("its mode");
    format!("{}:/usr/bin:/bin", folder.display())
}

#[cfg(unix)]
fn with_path(shop: &Workshop, path: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command
        .args(["render", "scene.toml"])
        .args(SMALL)
        .args(arguments)
        .current_dir(shop.folder.path())
        .env("PATH", path);
    command.env("XDG_CACHE_HOME", shop.path("cache")).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let output = command.output().expect("the program");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[cfg(unix)]
#[test]
fn a_video_is_made_where_ffmpeg_is_there_and_told_of_where_it_is_not() {
    let shop = shop();
    let turn = ["-o", "100%.mp4", "--turntable", "3", "--fps", "24"];
    let (code, _, error) = with_path(&shop, "/nonexistent", &turn);
    assert!(code == Some(2) && error.contains("ffmpeg") && error.contains("install"), "{error}");
    assert!(!shop.path("100%-0001.png").exists(), "found out too late");
    let path = fake_ffmpeg(&shop, "for last; do :; done; printf '%s\\n' \"$@\" > \"${last#file:}\"");
    let (code, said, error) = with_path(&shop, &path, &turn);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("wrote 100%.mp4"), "{said}");
    let given = fs::read_to_string(shop.path("100%.mp4")).expect("what ffmpeg was given");
    let words: Vec<&str> = given.lines().collect();
    let after = |flag: &str| words[words.iter().position(|word| *word == flag).expect("a flag") + 1];
    assert_eq!((after("-framerate"), after("-frames:v"), after("-start_number")), ("24", "3", "1"));
    assert!(after("-i").ends_with("100%%-%04d.png"), "{given}");
    assert_eq!(pictures(shop.folder.path(), "100%-").len(), 3);
    let path = fake_ffmpeg(&shop, "echo 'no such encoder' >&2; exit 1");
    let (code, _, error) = with_path(&shop, &path, &turn);
    assert!(code == Some(1) && error.contains("no such encoder"), "{error}");
    assert!(pictures(shop.folder.path(), ".pbr-vr").is_empty(), "a part of a video is left");
}
