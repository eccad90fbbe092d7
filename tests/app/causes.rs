//! `pbr-vr measure causes`, end to end on a small ball and a small picture: what is worse must be found to be worse.

use std::path::Path;

use crate::common::{Workshop, json, program, square, succeeds};
use pbr_vr::asset::picture::Picture;
use serde_json::Value;

/// A square that leans away, with a noisy base color map, under a sky with structure; beside it a small one and a lamp.
fn scene(shop: &Workshop) {
    shop.panorama("sky.exr", 128, |[x, y, z]| {
        let stripe = if (8.0 * x).sin() * (7.0 * z).cos() > 0.3 { 3.0 } else { 0.2 };
        [(stripe * (1.2 + y)) as f32; 3]
    });
    let noise = |i: u32| (i.wrapping_mul(0x9e37_79b1) >> 24) as u8;
    let pixels: Vec<u8> =
        (0..64 * 64u32).flat_map(|i| [noise(3 * i), noise(3 * i + 1), noise(3 * i + 2), 255]).collect();
    Picture::from_srgb8("noise", 64, 64, &pixels).write(&shop.path("noise.png")).expect("a texture");
    shop.write("m.mtl", "newmtl m\nmap_Kd noise.png\nPm 1\nPr 0.5\n");
    shop.write("model.obj", &square("m.mtl"));
    shop.write(
        "scene.toml",
        "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"model.obj\"\n[[model]]\nfile = \"model.obj\"\n\
         scale = 0.3\ntranslation = [0.1, 0.25, 0.1]\n[[light]]\npoint = { position = [0.2, 0.9, 0.3], intensity = [2, 2, 2] }\n[[camera]]\nname = \"c\"\n\
         position = [0.6, 0.3, 0.6]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 60\n",
    );
}

fn rows<'a>(facts: &'a Value, subject: &str, ablation: &str, cause: &str, replacement: &str) -> Vec<&'a Value> {
    let is = |row: &&Value| {
        row["subject"].as_str().is_some_and(|s| s.starts_with(subject))
            && row["ablation"] == ablation
            && row["cause"] == cause
            && row["replacement"].as_str().is_some_and(|s| s.starts_with(replacement))
    };
    let found: Vec<&Value> = facts["rows"].as_array().expect("rows").iter().filter(is).collect();
    assert!(!found.is_empty(), "{subject}, {ablation}, {cause}, {replacement}");
    found
}

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("{name} of {row}"))
}

#[test]
fn what_is_worse_is_found_to_be_worse() {
    let shop = Workshop::new();
    scene(&shop);
    let folder = shop.folder.path();
    let arguments = ["measure", "causes", "scene.toml", "-o", "out", "--panorama", "sky.exr", "--picture", "48x36"];
    let arguments = [&arguments[..], &["--validate"]].concat();
    let said = succeeds(program(folder, &arguments));
    assert!(said.contains("sky, metal") && said.contains("scene: ") && said.contains("FLIP"), "{said}");

    let facts = json(&folder.join("out/causes.json"));
    for (cause, replacement) in [("n = v", "classic"), ("cube resolution", "16²")] {
        for row in rows(&facts, "sky", "other", cause, replacement) {
            assert!(number(row, "error_replaced") > number(row, "error"), "{replacement} should be worse: {row}");
        }
    }
    let change =
        |ablation, cause, replacement| number(rows(&facts, "scene", ablation, cause, replacement)[0], "change");
    assert!(change("exact", "compression", "raw") > 1e-3, "blocks cannot hold noise");
    assert!(change("other", "cube resolution", "16²") > 4.0 * change("exact", "cube resolution", "512²"));
    // Rough metal scatters more than once.
    assert!(change("other", "scattering", "once") > 1e-3);
    // Errors are those of the whole.
    for subject in ["sky, metal", "sky, dielectric", "scene"] {
        let whole = number(rows(&facts, subject, "whole", "all", "exact")[0], "change");
        let own = facts["rows"].as_array().expect("rows").iter().filter(|row| row["subject"] == subject);
        let own = own.filter(|row| row["kind"] != "light");
        let ablations = own.filter(|row| row["ablation"] == "other");
        assert!(whole > 0.0 && ablations.into_iter().all(|row| number(row, "error") == whole), "{subject}");
    }
    // What blocks light matters more than how its shadow's edge is drawn; what is given back, than how it is stored.
    let exact = |cause| change("exact", cause, "exact");
    let [shadows, indirect] = ["no shadows", "no indirect light"].map(|cause| change("other", cause, "none"));
    assert!(shadows > 2.0 * exact("shadow maps") && shadows > 0.005, "{shadows}, {}", exact("shadow maps"));
    assert!(indirect > 0.005 && exact("probes") > 0.0, "{indirect}");
    assert_eq!(exact("lightmap"), 0.0, "metal gives back nothing diffuse");
    let [whole, floor] = [("whole", "all light"), ("floor", "floor")]
        .map(|(ablation, cause)| number(rows(&facts, "scene", ablation, cause, "")[0], "change"));
    assert!(whole > 0.0 && floor < 0.05, "{whole}, {floor}");
    files_can_be_read(&folder.join("out"), &facts);
}

fn files_can_be_read(folder: &Path, facts: &Value) {
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    let csv = read("causes.csv");
    assert_eq!(csv.lines().count() - 1, facts["rows"].as_array().expect("rows").len());
    let svg = read("causes.svg");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && svg.len() < 150_000);
    for text in [&csv, &svg, &read("causes.md")] {
        assert!(text.contains("level interpolation") && text.contains("MSAA"), "{text}");
        assert!(!text.contains("NaN") && !text.contains("inf,"), "{text}");
    }
}
