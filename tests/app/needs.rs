//! Modelling what a scene needs gives the picture of modelling everything, and the command says what was decided.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{PictureOptions, Workshop};
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::energy::Scattering;
use pbr_vr::render::{LightModel, Shading};
use pbr_vr::scene::Model;

/// The compiler folds constants in another order than the GPU multiplies: a fragment at an edge may round to its neighbour.
/// Share of channels that may differ at all where both pictures model the same light.
const AT_EDGES: f32 = 2e-4;
/// Of a lone ball's channels, where its facets turn away from a lamp.
const AT_TERMINATORS: f32 = 0.002;
/// What is scattered more than once is left out where it changes light by less than half a step of 255
/// (`reference::energy::VISIBLE`). After rounding no channel is off by more than one, but for a few at edges.
const MEAN_STEPS: f32 = 0.25;

const ALL_KINDS: [&str; 3] = ["plain", "metal", "half"];

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(name)
}

/// A square each of some of dielectric (`plain`), metal and half of both, under two point lights.
fn kinds(shop: &Workshop, names: &[&str]) -> PathBuf {
    shop.sky(5.0);
    let mut obj = "mtllib kinds.mtl\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n".to_owned();
    for (i, name) in names.iter().enumerate() {
        let (x, first) = (i as f32 * 1.1 - 1.6, 4 * i + 1);
        for (dx, dy) in [(0.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 0.5)] {
            obj += &format!("v {} {dy} 0\n", x + dx);
        }
        let corner = |c: usize| format!("{}/{}/1", first + c, c + 1);
        obj += &format!("usemtl {name}\nf {} {} {} {}\n", corner(0), corner(1), corner(2), corner(3));
    }
    let mtl = "newmtl plain\nKd 0.8 0.4 0.2\nPr 0.4\nnewmtl metal\nKd 0.9 0.7 0.4\nPm 1\nPr 0.3\nnewmtl half\nPm 0.5\nPr 0.2\n";
    std::fs::write(shop.path("kinds.mtl"), mtl).expect("a material library");
    std::fs::write(shop.path("kinds.obj"), obj).expect("a model");
    let scene = shop.path("kinds.toml");
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"kinds.obj\"\n[[light]]\n\
        point = { position = [0, 1, 2], intensity = [4, 4, 4] }\n[[light]]\npoint = { position = [1, 0, 1], intensity = [1, 2, 3] }\n\
        [[camera]]\nname = \"front\"\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n";
    std::fs::write(&scene, text).expect("a scene");
    scene
}

/// How far two pictures are apart: in steps of 255 in the mean, and shares of the channels that differ at all and by more than one.
fn apart(needed: &Picture, everything: &Picture) -> [f32; 3] {
    let pairs = needed.pixels.as_flattened().iter().zip(everything.pixels.as_flattened());
    let steps: Vec<f32> = pairs.map(|(a, b)| 255.0 * (a - b).abs()).collect();
    let share = |least: f32| steps.iter().filter(|step| **step > least).count() as f32 / steps.len() as f32;
    [steps.iter().sum::<f32>() / steps.len() as f32, share(0.5), share(1.5)]
}

/// The pictures with what is needed and with everything.
fn both(shop: &Workshop, scene: &Path, options: &PictureOptions<'_>) -> [f32; 3] {
    let picture = |model| shop.render(scene, &PictureOptions { model, ..*options }).remove(0);
    let [mean, differ, beyond] = apart(&picture(Model::Needed), &picture(Model::Everything));
    let PictureOptions { shading, scattering, .. } = options;
    println!("{} {shading:?} {scattering:?}: {mean} steps, {differ} differ, {beyond} beyond one", scene.display());
    [mean, differ, beyond]
}

fn small(shading: Shading, scattering: Scattering) -> PictureOptions<'static> {
    PictureOptions { file: "a.png", size: [160, 90], shading, scattering, ..PictureOptions::default() }
}

#[test]
fn what_is_needed_and_everything_give_one_picture() {
    let shop = Workshop::new();
    let metals = kinds(&shop, &["metal", "half"]);
    // Where nothing is dropped, nothing differs.
    let [_, differ, _] = both(&shop, &metals, &small(Shading::Pbr, Scattering::Multiple));
    assert!(differ <= AT_EDGES, "metals: {differ}");
    let direct = |name| (shipped(name), LightModel::Direct);
    // A lone ball under lamps: the next test has its shadows.
    let ball = (shipped("sphere.toml"), LightModel::Open);
    for (scene, light) in
        [(kinds(&shop, &ALL_KINDS), LightModel::Direct), ball, direct("teapot.toml"), direct("tearoom.toml")]
    {
        let small = |shading, scattering| PictureOptions { light, ..small(shading, scattering) };
        for shading in [Shading::Phong, Shading::Pbr] {
            let [_, differ, _] = both(&shop, &scene, &small(shading, Scattering::Single));
            assert!(differ <= AT_EDGES, "{} {shading:?}: {differ}", scene.display());
        }
        let [mean, _, beyond] = both(&shop, &scene, &small(Shading::Pbr, Scattering::Multiple));
        assert!(mean <= MEAN_STEPS && beyond <= AT_EDGES, "{}: {mean}, {beyond}", scene.display());
    }
}

/// What casts no shadow on anything else still is its own: facets that turn away from a lamp are lit by their smooth normals
/// without a map, and dark with one.
#[test]
fn a_lone_ball_has_no_shadow_but_at_its_terminators() {
    let shop = Workshop::new();
    for shading in [Shading::Phong, Shading::Pbr] {
        let [_, differ, _] = both(&shop, &shipped("sphere.toml"), &small(shading, Scattering::Single));
        assert!(differ <= AT_EDGES + AT_TERMINATORS, "{shading:?}: {differ}");
    }
}

#[test]
fn the_command_says_what_is_modelled_and_why() {
    let shop = Workshop::new();
    let scene = kinds(&shop, &ALL_KINDS);
    let json = shop.path("needs.json");
    let output = Command::new(env!("CARGO_BIN_EXE_pbr-vr"))
        .args(["needs".as_ref(), scene.as_os_str(), "--json".as_ref(), json.as_os_str()])
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}");
    let said_of = |subject: &str| {
        said.lines()
            .map(str::trim)
            .find(|line| line[1..].trim_start().starts_with(subject))
            .unwrap_or_default()
            .to_owned()
    };
    assert!(said.contains("6 triangles") && said.contains("3 pipeline(s)"), "{said}");
    assert!(said_of("metalness").starts_with('+'), "{said}");
    assert!(said_of("point lights").starts_with('+') && said_of("point lights").contains('2'), "{said}");
    assert!(said_of("base color maps").starts_with('-') && said_of("cutouts").starts_with('-'), "{said}");
    assert!(said_of("multiple scattering").starts_with('+'), "{said}");
    assert!(said_of("multiple scattering").contains("2 of 3"), "{said}");
    assert!(["0.20", "0.40"].iter().all(|part| said_of("specular levels").contains(part)), "{said}");
    let read: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&json).expect("the JSON")).expect("a whole JSON file");
    assert_eq!(read["features"]["lights"], 2);
    let metalness: Vec<_> =
        read["materials"].as_array().unwrap().iter().map(|m| m["features"]["metalness"].clone()).collect();
    assert_eq!(metalness, ["dielectric", "metal", "mixed"]);
}
