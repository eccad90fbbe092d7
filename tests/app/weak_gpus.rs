//! GPUs with less than usual: no more than Vulkan 1.3 requires, or little memory. The program starts and says what it does
//! without, or ends with one line; validation, which sees the same weak GPU, has nothing to say.

use std::path::Path;
use std::process::Command;

use glam::DVec3;
use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::tone::srgb_decode;

use crate::common::failing::{SMALL, small_world};
use crate::common::fault::FaultLayer;
use crate::common::wall::{four_large, stripes, textured, told_mib};
use crate::common::{Workshop, finish};
use crate::desktop::{Display, ESCAPE, FileManager, Hands, L, P, Program, command};
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
    let mut command = command(workshop.folder.path());
    command.args(arguments).arg("--validate");
    command.envs(gpu.into_iter().flat_map(|(layer, gpu)| layer.weak(gpu)));
    command
}

fn picture(path: &Path) -> Picture {
    Picture::read(path).expect("a picture")
}

#[test]
fn what_the_least_gpu_lacks_is_said_in_one_line() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
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
    let layer = FaultLayer::install(workshop.folder.path());
    let arguments = [&["render", "scene.toml", "-o", "a.png", "--light", "open"][..], &SMALL[..6]].concat();
    let ran = run(on(Some((&layer, "sets:1")), &workshop, &arguments));
    let told = |line: &String| line.contains("maxBoundDescriptorSets");
    assert!(ran.code == Some(1) && ran.lines.iter().any(told), "{:?}", ran.lines);
}

#[test]
fn a_gpu_without_options_draws_the_same() {
    let workshop = small_world();
    let layer = FaultLayer::install(workshop.folder.path());
    let light = ["--lightmap-size", "64", "--lightmap-samples", "8", "--probe-size", "16"];
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
fn coloured_glass_is_grey_where_two_sources_cannot_be_blended() {
    let world = small_world();
    world.write("pane.mtl", "newmtl glass\nKd 0 0 0\nillum 4\nTf 1 0.3 0.1\n");
    let corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 1\n";
    world.write("pane.obj", &format!("mtllib pane.mtl\nusemtl glass\n{corners}f 1//1 2//1 3//1 4//1\n"));
    let layer = FaultLayer::install(world.folder.path());
    let [whole, bare] = [(None, 0), (Some((&layer, "bare")), 1)].map(|(gpu, lines)| {
        let file = format!("pane-{lines}.png");
        let render = ["render", "pane.obj", "--panorama", "sky.exr", "--light", "open", "-o", &file];
        let ran = run(on(gpu, &world, &[&render[..], &SMALL[..6]].concat()));
        assert_eq!((ran.code, ran.lines.len()), (Some(0), lines), "{:?}", ran.lines);
        assert!(ran.lines.iter().all(|line| line.contains("coloured glass keeps its colour")), "{:?}", ran.lines);
        let picture = picture(&world.path(&file));
        let middle = picture.pixels[(picture.height / 2 * picture.width + picture.width / 2) as usize];
        srgb_decode(DVec3::from(middle.map(f64::from)))
    });
    println!("{whole:?}, without {bare:?}");
    // Of the sky's light red goes through whole, and blue hardly does; without colours each as its mean.
    assert!(whole.x > bare.x && whole.z < 0.5 * bare.z, "{whole:?}, {bare:?}");
}

#[test]
fn textures_and_shadow_maps_are_no_larger_than_the_gpu_allows() {
    let workshop = Workshop::new();
    // Of Vulkan's limits, 4096 texels is the least.
    textured(&workshop, &[stripes(8192, 2, 120), stripes(64, 64, 60)], 1.0);
    let layer = FaultLayer::install(workshop.folder.path());
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
    let layer = FaultLayer::install(workshop.folder.path());
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
        let layer = FaultLayer::install(workshop.folder.path());
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
    let layer = FaultLayer::install(workshop.folder.path());
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
const LITTLE: u64 = 100;

/// Other programs take memory while a scene is shown: its textures lose levels; and get them back when memory is.
#[test]
fn a_shown_scene_gives_memory_back_while_others_need_it() {
    let Some(display) = Display::start() else { return };
    let workshop = Workshop::new();
    four_large(&workshop);
    let layer = FaultLayer::install(workshop.folder.path());
    layer.set_budget(PLENTY);
    let arguments = [&["view", "wall.toml", "--on", "window", "--textures", "raw"], &COARSE_LIGHT[..]].concat();
    let mut command = on(None, &workshop, &arguments);
    command.envs(layer.with_budget("memory:256"));
    let mut program = Program::spawn(&display, command);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.resize([64, 48]);
    let screenshot = |program: &mut Program| {
        hands.press(&[P]);
        program.wait_for("pbr-vr-1.png");
        let path = workshop.path("pbr-vr-1.png");
        let shown = picture(&path);
        std::fs::remove_file(path).expect("a screenshot");
        shown
    };
    let whole = screenshot(&mut program);
    layer.set_budget(TOO_LITTLE);
    let goes_on = program.until_from(0, "never said", |errors| errors.lines().count());
    assert!(goes_on, "{}", program.errors());
    let said = program.errors();
    let [after, before] = told_mib(&said);
    assert!(said.lines().count() == 1 && said.contains("WARN") && after < 0.3 * before && before > 21.0, "{said}");
    let reduced = screenshot(&mut program);
    let flip = compare(&whole, &reduced).expect("two pictures of one size").flip_mean;
    assert!(flip > 10.0 * TOLERANCE, "they look alike: FLIP {flip}");
    layer.set_budget(PLENTY);
    let told = program.wait_for("GPU memory");
    assert_eq!(told_mib(&told), [before, after], "{told}");
    let again = screenshot(&mut program);
    let flip = compare(&whole, &again).expect("two pictures of one size").flip_mean;
    assert!(flip == 0.0, "FLIP {flip}");
    hands.press(&[ESCAPE]);
    let ended = program.end();
    assert_eq!(ended.1, said);
    assert_clean(ended);
}

/// Less than the program has without any textures.
const TOO_LITTLE: u64 = 20;
