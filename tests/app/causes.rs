//! `pbr-vr measure causes`, end to end on a small ball and a small picture: what is worse must be found to be worse.

use std::path::Path;

use crate::common::{Workshop, json, program, square, succeeds};
use pbr_vr::asset::picture::Picture;
use serde_json::Value;

/// A square that leans away, with a noisy albedo map, under a sky with structure.
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
        "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"model.obj\"\n[[camera]]\nname = \"c\"\n\
         position = [0.6, 0.3, 0.6]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 60\n",
    );
}

fn rows<'a>(facts: &'a Value, subject: &str, swap: &str, cause: &str, swapped: &str) -> Vec<&'a Value> {
    let is = |row: &&Value| {
        row["subject"].as_str().is_some_and(|s| s.starts_with(subject))
            && row["swap"] == swap
            && row["cause"] == cause
            && row["swapped"].as_str().is_some_and(|s| s.starts_with(swapped))
    };
    let found: Vec<&Value> = facts["rows"].as_array().expect("rows").iter().filter(is).collect();
    assert!(!found.is_empty(), "{subject}, {swap}, {cause}, {swapped}");
    found
}

fn number(row: &Value, measure: &str, name: &str) -> f64 {
    row[measure][name].as_f64().unwrap_or_else(|| panic!("{measure}.{name} of {row}"))
}

#[test]
fn what_is_worse_is_found_to_be_worse_and_the_chain_adds_up() {
    let shop = Workshop::new();
    scene(&shop);
    let folder = shop.0.path();
    let arguments = ["measure", "causes", "scene.toml", "-o", "out", "--panorama", "sky.exr", "--picture", "48x36"];
    let arguments = [&arguments[..], &["--validate"]].concat();
    let said = succeeds(program(folder, &arguments));
    assert!(said.contains("sky, metal") && said.contains("scene: ") && said.contains("FLIP"), "{said}");

    let facts = json(&folder.join("out/causes.json"));
    for (cause, swapped) in [("n = v", "classic"), ("cube resolution", "16²")] {
        for row in rows(&facts, "sky", "other", cause, swapped) {
            let [error, other] = ["error", "error_swapped"].map(|name| number(row, "main", name));
            assert!(other > error, "{swapped} should be worse: {row}");
        }
    }
    let change = |swap, cause, swapped| number(rows(&facts, "scene", swap, cause, swapped)[0], "main", "change");
    assert!(change("exact", "compression", "raw") > 1e-3, "blocks cannot hold noise");
    assert!(change("other", "cube resolution", "16²") > 4.0 * change("exact", "cube resolution", "512²"));
    // Rough metal scatters more than once.
    assert!(change("other", "scattering", "once") > 1e-3);
    let bits = number(rows(&facts, "scene", "exact", "8 bits", "f32")[0], "relative_mse", "change");
    assert!(bits > 0.0 && bits < 1e-3, "{bits}");

    for (subject, measure) in
        [("sky, metal", "main"), ("sky, dielectric", "main"), ("scene", "main"), ("scene", "relative_mse")]
    {
        let whole = number(rows(&facts, subject, "whole", "all", "exact")[0], measure, "error");
        let all = facts["rows"].as_array().expect("rows").iter();
        let chain: f64 = all
            .filter(|row| row["subject"] == subject && row["swap"] == "chain")
            .map(|row| number(row, measure, "falls_by"))
            .sum();
        assert!(whole > 0.0 && (chain - whole).abs() < 1e-9 + 1e-6 * whole, "{subject}: {chain} is not {whole}");
    }
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
