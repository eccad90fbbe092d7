//! Textures end to end: compressed ones look like plain ones, start from the cache, and keep to a budget.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::common::{Workshop, json, program, setup, succeeds};
use pbr_vr::asset::Storage;
use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;
use pbr_vr::precompute::Cache;
use pbr_vr::render::{LightModel, RenderSettings, TextureSettings};
use pbr_vr::scene::Model;
use pbr_vr::scene::staging::{Stage, Staging};
use pbr_vr::view::{RenderFacts, RenderRequest, render};

/// A floor that recedes, with a base color, a normal and a roughness map of `side` by `side - 3` texels: no multiple of 4.
struct Floor {
    shop: Workshop,
    scene: PathBuf,
}

impl Floor {
    fn new(side: u32) -> Self {
        let shop = Workshop::new();
        shop.sky(3.0);
        let picture = |name: &str, texel: &dyn Fn(f32, f32) -> [f32; 3]| {
            let save = image::RgbImage::from_fn(side, side - 3, |x, y| {
                let at = |v: u32| v as f32 * std::f32::consts::TAU / 64.0;
                image::Rgb(texel(at(x), at(y)).map(|v| (v * 127.0 + 128.0) as u8))
            });
            save.save(shop.path(name)).expect("a texture");
        };
        picture("albedo.png", &|x, y| [x.sin(), y.cos() * 0.5, (x + y).sin() * 0.7]);
        picture("normal.png", &|x, y| [x.sin() * 0.4, y.cos() * 0.4, 0.8]);
        picture("rough.png", &|x, y| [(x * 0.5).cos() * (y * 0.25).cos() * 0.5; 3]);
        shop.write("m.mtl", "newmtl m\nmap_Kd albedo.png\nnorm normal.png\nmap_Pr rough.png\n");
        let mut obj = String::from("mtllib m.mtl\nvn 0 1 0\nusemtl m\n");
        for (x, z, u, v) in [(-4, 1, 0, 0), (4, 1, 8, 0), (4, -12, 8, 13), (-4, -12, 0, 13)] {
            writeln!(obj, "v {x} 0 {z}\nvt {u} {v}").expect("a string");
        }
        obj.push_str("f 1/1/1 2/2/1 3/3/1 4/4/1\n");
        shop.write("model.obj", &obj);
        let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"model.obj\"\n[[camera]]\nname = \"low\"\n\
            position = [0, 0.7, 1]\ntarget = [0, 0, -2]\nvertical_fov_degrees = 50\n[[camera]]\nname = \"close\"\n\
            position = [0, 0.3, 0.1]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 30\n";
        let scene = shop.write("scene.toml", text);
        Self { shop, scene }
    }

    fn render(&self, textures: TextureSettings, cache: Option<&Cache>) -> (Picture, RenderFacts) {
        self.render_from("low", textures, cache)
    }

    fn render_from(&self, camera: &str, textures: TextureSettings, cache: Option<&Cache>) -> (Picture, RenderFacts) {
        let output = self.shop.path("out.png");
        let request = RenderRequest {
            size: [96, 64],
            staging: Staging { stage: Stage { camera: Some(camera.into()), ..Stage::default() }, ..Staging::default() },
            // All levels, whatever this camera could do without.
            settings: RenderSettings {
                model: Model::Everything,
                light: LightModel::Direct,
                textures,
                ..RenderSettings::default()
            },
            ..RenderRequest::new(&self.scene, &output)
        };
        let facts = render(&request, &setup(cache)).expect("a render without validation messages");
        (Picture::read(&output).expect("the picture"), facts)
    }
}

fn choice(storage: Storage, budget_mib: Option<u32>) -> TextureSettings {
    TextureSettings { storage: Some(storage), budget_mib, ..TextureSettings::default() }
}

#[test]
fn compressed_textures_take_a_quarter_and_look_the_same() {
    let floor = Floor::new(259);
    // Lavapipe filters plain bytes in fixed point and blocks in floats, which shows where levels blend; not close by.
    let (plain, raw) = floor.render_from("close", choice(Storage::Raw, None), None);
    let (picture, compressed) = floor.render_from("close", choice(Storage::Bc, None), None);
    assert_eq!((raw.textures.count, raw.textures.bytes), (3, raw.textures.raw_bytes));
    let ratio = raw.textures.bytes as f64 / compressed.textures.bytes as f64;
    assert!(ratio > 3.8, "{ratio}");
    let comparison = compare(&picture, &plain).expect("equal sizes");
    assert!(comparison.max_error < 8.0 / 255.0 && comparison.mean_error < 1.5 / 255.0, "{}", comparison.max_error);
    assert!(comparison.max_error > 0.0, "two ways to store them");
    assert!(raw.stages_ms.contains_key("upload") && !raw.stages_ms.contains_key("compress"));
    for stage in ["parse", "decode", "mips", "compress", "upload", "precompute"] {
        assert!(compressed.stages_ms.get(stage).is_some_and(|ms| *ms > 0.0), "{stage}: {:?}", compressed.stages_ms);
    }
}

#[test]
fn a_start_from_the_cache_gives_the_same_picture_without_decoding() {
    let floor = Floor::new(67);
    let cache = Cache::in_folder(floor.shop.path("cache"));
    let (cold, _) = floor.render(choice(Storage::Bc, None), Some(&cache));
    let (warm, facts) = floor.render(choice(Storage::Bc, None), Some(&cache));
    assert!(cold.pixels == warm.pixels);
    for stage in ["decode", "mips", "compress"] {
        assert!(!facts.stages_ms.contains_key(stage), "{stage}: {:?}", facts.stages_ms);
    }
}

#[test]
fn a_budget_is_kept_told_and_seen() {
    let floor = Floor::new(1027);
    let (whole, facts) = floor.render(choice(Storage::Raw, None), None);
    assert!(facts.textures.dropped_levels == 0 && facts.warnings.is_empty(), "{:?}", facts.warnings);
    let (less, facts) = floor.render(choice(Storage::Raw, Some(2)), None);
    assert!(facts.textures.bytes <= 2 << 20 && facts.textures.budget_bytes == 2 << 20, "{:?}", facts.textures);
    // 3 · 5.6 MiB, then 4.2, then 1.05.
    assert_eq!(facts.textures.dropped_levels, 2);
    assert!(facts.warnings.len() == 1 && facts.warnings[0].contains("--texture-budget"), "{:?}", facts.warnings);
    let flip = compare(&less, &whole).expect("equal sizes").flip_mean;
    assert!(flip < 0.05, "the picture is the same but for what is near: {flip}");
}

#[test]
fn the_command_line_takes_storage_and_budget() {
    let floor = Floor::new(67);
    let folder = floor.shop.folder.path();
    let common = ["render", "scene.toml", "-o", "a.png", "--size", "32x32", "--json", "a.json", "--no-cache"];
    let facts = |more: &[&str]| {
        succeeds(program(folder, &[&common, more].concat()));
        json(&folder.join("a.json"))["textures"].clone()
    };
    let (bc, raw) = (facts(&["--textures", "bc"]), facts(&["--textures", "raw", "--texture-budget", "7"]));
    assert!(bc["bytes"].as_u64() < raw["bytes"].as_u64() && raw["bytes"] == bc["raw_bytes"], "{bc} {raw}");
    assert_eq!(raw["budget_bytes"].as_u64(), Some(7 << 20));
    // The tests' GPU is a processor.
    assert_eq!(facts(&[])["bytes"], raw["bytes"]);
}
