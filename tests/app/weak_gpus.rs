//! GPUs with less than usual: no more than Vulkan 1.3 requires, or little memory. The program starts and says what it does
//! without, or ends with one line; validation, which sees the same weak GPU, has nothing to say.

use std::path::Path;
use std::process::Command;

use image::{Rgba, RgbaImage};
use pbr_vr::asset::picture::{Picture, compare};

use crate::common::fault::FaultLayer;
use crate::common::{Workshop, finish};
use crate::desktop::{Display, ESCAPE, FileManager, Hands, L, Program, command};
use crate::faults::{SMALL, small_world};
use crate::window::assert_clean;

/// The most that pictures of two GPUs may differ, mean FLIP: one tests depth after shading, the other before.
const TOLERANCE: f32 = 2e-3;

/// Light that is soon made.
const COARSE_LIGHT: [&str; 6] = ["--light", "open", "--cube-size", "16", "--irradiance-size", "4"];

/// A run of the program: its exit status, and what it said on stderr.
struct Ran {
    code: Option<i32>,
    lines: Vec<String>,
}

fn run(mut command: Command) -> Ran {
    let output = finish(command.spawn().expect("the program starts"));
    let lines = String::from_utf8_lossy(&output.stderr).lines().map(str::to_owned).collect();
    Ran { code: output.status.code(), lines }
}

/// The program on a weak GPU, under validation; on the machine's own without a name.
fn on(gpu: Option<(&FaultLayer, &str)>, workshop: &Workshop, arguments: &[&str]) -> Command {
    let mut command = command(workshop.0.path());
    command.args(arguments).arg("--validate");
    command.envs(gpu.into_iter().flat_map(|(layer, gpu)| layer.weak(gpu)));
    command
}

fn picture(path: &Path) -> Picture {
    Picture::read(path).expect("a picture")
}

/// A square that fills the picture, with parts of these images beside each other.
fn textured(workshop: &Workshop, images: &[RgbaImage], part: f32) {
    workshop.sky(0.0);
    let mut obj = format!("mtllib wall.mtl\nvn 0 0 1\nvt 0 0\nvt {part} 0\nvt {part} {part}\nvt 0 {part}\n");
    let mut mtl = String::new();
    for (i, image) in images.iter().enumerate() {
        image.save(workshop.path(&format!("{i}.png"))).expect("a picture");
        mtl += &format!("newmtl m{i}\nmap_Kd {i}.png\n");
        let (left, width) = (-2.0 + 4.0 * i as f32 / images.len() as f32, 4.0 / images.len() as f32);
        for (x, y) in [(0.0, -1.5), (width, -1.5), (width, 1.5), (0.0, 1.5)] {
            obj += &format!("v {} {y} 0\n", left + x);
        }
        let corner = |c: usize| format!("{}/{}/1", 4 * i + c, c);
        obj += &format!("usemtl m{i}\nf {} {} {} {}\n", corner(1), corner(2), corner(3), corner(4));
    }
    workshop.write("wall.obj", &obj);
    workshop.write("wall.mtl", &mtl);
    let camera = "[[camera]]\nname = \"front\"\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n";
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"wall.obj\"\n";
    workshop.write("wall.toml", &format!("{text}{camera}"));
}

/// Stripes across.
fn stripes(width: u32, height: u32, green: u8) -> RgbaImage {
    let colour =
        |x: u32| if (x / (width / 16)).is_multiple_of(2) { [220, green, 40, 255] } else { [30, green, 120, 255] };
    RgbaImage::from_fn(width, height, |x, _| Rgba(colour(x)))
}

#[test]
fn what_the_least_gpu_lacks_is_said_in_one_line() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.0.path());
    for arguments in [&["render", "scene.toml", "-o", "a.png"][..], &["bake", "sky.exr", "-o", "baked"]] {
        let ran = run(on(Some((&layer, "minimum")), &workshop, arguments));
        assert_eq!((ran.code, ran.lines.len()), (Some(1), 1), "{:?}", ran.lines);
        for part in ["pbr-vr: ", "scalarBlockLayout", "shaderOutputLayer", "maxPerStageDescriptorStorageBuffers"] {
            assert!(ran.lines[0].contains(part), "{part}: {:?}", ran.lines);
        }
    }
}

/// Without this, the other tests here would be of a validation layer that sees the strong GPU.
#[test]
fn validation_sees_the_weak_gpu() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.0.path());
    let arguments = [&["render", "scene.toml", "-o", "a.png", "--light", "open"][..], &SMALL[..6]].concat();
    let ran = run(on(Some((&layer, "sets:1")), &workshop, &arguments));
    let told = |line: &String| line.contains("maxBoundDescriptorSets");
    assert!(ran.code == Some(1) && ran.lines.iter().any(told), "{:?}", ran.lines);
}

#[test]
fn a_gpu_without_options_draws_the_same() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.0.path());
    let light = ["--lightmap-size", "256", "--lightmap-samples", "8", "--probe-size", "16"];
    let small = &SMALL[..6];
    let shadows = &["--light", "direct", "--shadow-size", "256"];
    for (name, more) in [
        ("open", &["--light", "open"][..]),
        ("direct", shadows),
        ("baked", &[&["--light", "baked"][..], &light].concat()),
        ("reference", &["--light", "open", "--shading", "reference", "--frames", "2"]),
    ] {
        let [whole, bare] = [None, Some((&layer, "bare"))].map(|gpu| {
            let file = format!("{name}-{}.png", gpu.is_some());
            let ran = run(on(gpu, &workshop, &[&["render", "scene.toml", "-o", &file], small, more].concat()));
            let odd: Vec<_> = ran.lines.iter().filter(|line| !line.contains("standard error")).collect();
            assert_eq!((ran.code, odd.len()), (Some(0), 0), "{name}: {:?}", ran.lines);
            picture(&workshop.path(&file))
        });
        let flip = compare(&whole, &bare).expect("two pictures of one size").flip_mean;
        assert!(flip <= TOLERANCE, "{name}: FLIP {flip}");
    }
    let ran = run(on(Some((&layer, "bare")), &workshop, &["bake", "sky.exr", "-o", "baked", "--size", "16"]));
    assert_eq!((ran.code, ran.lines.len()), (Some(0), 0), "{:?}", ran.lines);
}

#[test]
fn textures_and_shadow_maps_are_no_larger_than_the_gpu_allows() {
    let workshop = Workshop::new();
    // Of Vulkan's limits, 4096 texels is the least.
    textured(&workshop, &[stripes(8192, 2, 120), stripes(64, 64, 60)], 1.0);
    let layer = FaultLayer::install(workshop.0.path());
    let render = [&["render", "wall.toml", "--size", "64x48"], &COARSE_LIGHT[..]].concat();
    let ran = run(on(Some((&layer, "bare")), &workshop, &[&render[..], &["-o", "bare.png"]].concat()));
    assert_eq!((ran.code, ran.lines.len()), (Some(0), 1), "{:?}", ran.lines);
    assert!(["WARN", "4096", "1 of 2"].iter().all(|part| ran.lines[0].contains(part)), "{:?}", ran.lines);
    let ran = run(on(None, &workshop, &[&render[..], &["-o", "whole.png"]].concat()));
    assert_eq!((ran.code, ran.lines.len()), (Some(0), 0), "{:?}", ran.lines);
    let [bare, whole] = ["bare.png", "whole.png"].map(|file| picture(&workshop.path(file)));
    let flip = compare(&whole, &bare).expect("two pictures of one size").flip_mean;
    assert!(flip <= TOLERANCE, "FLIP {flip}");

    let direct =
        ["render", "scene.toml", "--size", "64x48", "--light", "direct", "--shadow-size", "8192", "-o", "a.png"];
    let world = small_world();
    world.write("scene.toml", &(std::fs::read_to_string(world.path("scene.toml")).expect("a scene") + SUN));
    let ran = run(on(Some((&layer, "bare")), &world, &direct));
    assert_eq!((ran.code, ran.lines.len()), (Some(0), 1), "{:?}", ran.lines);
    assert!(["WARN", "4096"].iter().all(|part| ran.lines[0].contains(part)), "{:?}", ran.lines);
}

/// A lamp whose map would be larger than allowed, too.
const SUN: &str = "[[light]]\npoint = { position = [0, 2, 0], intensity = [4, 4, 4] }\n";

#[test]
fn little_memory_is_enough_or_one_line_says_that_it_is_not() {
    let workshop = Workshop::new();
    // 5.3 MiB each, of which a picture shows so little that all texels are needed.
    textured(&workshop, &[10, 20, 30, 40].map(|green| stripes(1024, 1024, green)), 1.0 / 64.0);
    let layer = FaultLayer::install(workshop.0.path());
    let render =
        [&["render", "wall.toml", "-o", "a.png", "--size", "64x48", "--textures", "raw"], &COARSE_LIGHT[..]].concat();
    let mut endings = Vec::new();
    for mib in [128, 24, 8, 4] {
        let gpu = format!("memory:{mib}");
        let ran = run(on(Some((&layer, &gpu)), &workshop, &render));
        println!("{gpu}: {:?} {:?}", ran.code, ran.lines);
        let starts = |line: &String, with| line.trim_start().starts_with(with);
        let warnings = ran.lines.iter().take_while(|line| starts(line, "WARN ")).count();
        let last = &ran.lines[warnings..];
        endings.push(match (ran.code, warnings, last.len()) {
            (Some(0), 0, 0) => "whole",
            (Some(0), 1, 0) => "reduced",
            (Some(1), 0..=1, 1) if starts(&last[0], "pbr-vr: ") => "ended",
            _ => panic!("{gpu}: {:?} {:?}", ran.code, ran.lines),
        });
    }
    assert_eq!((endings[0], endings[1], endings[3]), ("whole", "reduced", "ended"), "{endings:?}");
}

#[test]
fn a_window_opens_on_weak_gpus() {
    let Some(display) = Display::start() else { return };
    for gpu in ["bare", "memory:64"] {
        let workshop = small_world();
        let layer = FaultLayer::install(workshop.0.path());
        let arguments = [&["view", "scene.toml", "--on", "window"], &COARSE_LIGHT[..]].concat();
        let mut program = Program::spawn(&display, on(Some((&layer, gpu)), &workshop, &arguments));
        program.wait_for("window");
        let hands = Hands::on(&display);
        hands.resize([64, 48]);
        hands.press(&[L]);
        program.wait_for("lit by");
        FileManager::new(&hands).drop(&workshop.path("second.toml"));
        program.wait_for("second");
        hands.press(&[ESCAPE]);
        let ended = program.end();
        assert_eq!(ended.1, "", "{gpu}");
        assert_clean(ended);
    }
}

/// Other programs take memory: the next scene has smaller textures, and the one after they have given it back has not.
#[test]
fn a_scene_is_as_fine_as_the_memory_that_others_leave() {
    let Some(display) = Display::start() else { return };
    let workshop = Workshop::new();
    textured(&workshop, &[10, 20, 30, 40].map(|green| stripes(1024, 1024, green)), 1.0);
    let text = std::fs::read_to_string(workshop.path("wall.toml")).expect("a scene");
    ["little.toml", "again.toml"].iter().for_each(|name| drop(workshop.write(name, &text)));
    let layer = FaultLayer::install(workshop.0.path());
    layer.set_budget(PLENTY);
    let arguments = [&["view", "wall.toml", "--on", "window", "--textures", "raw"], &COARSE_LIGHT[..]].concat();
    let mut command = on(None, &workshop, &arguments);
    command.envs(layer.with_budget("memory:256"));
    let mut program = Program::spawn(&display, command);
    program.wait_for("window");
    assert_eq!(program.errors(), "");
    let hands = Hands::on(&display);
    hands.resize([64, 48]);
    let files = FileManager::new(&hands);
    layer.set_budget(LITTLE);
    files.drop(&workshop.path("little.toml"));
    program.wait_for("little");
    let said = program.errors();
    assert!(said.lines().count() == 1 && said.contains("WARN") && said.contains("4 of 4"), "{said}");
    layer.set_budget(PLENTY);
    files.drop(&workshop.path("again.toml"));
    program.wait_for("again");
    assert_eq!(program.errors(), said);
    hands.press(&[ESCAPE]);
    assert_clean(program.end());
}

/// Of 256 MiB. Half of what is free may be textures, of which a scene here has 21 MiB.
const PLENTY: u64 = 200;
const LITTLE: u64 = 80;
