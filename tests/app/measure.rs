//! `pbr-vr measure`: its list, its errors, and a small run whose tables and chart can be read by others.

use std::path::Path;
use std::process::{Command, Output};

use pbr_vr::asset::picture::Picture;
use pbr_vr::asset::synthetic_panorama;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pbr-vr"))
        .arg("measure")
        .args(arguments)
        .current_dir(folder)
        .env("PBR_VR_ASSETS", Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"))
        .output()
        .expect("the program starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_list_names_what_can_be_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = run(folder.path(), &["--list"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", stderr(&output));
    for name in ["precompute", "panoramas", "ours", "filtered-sampling", "spherical-harmonics"] {
        assert!(text.contains(name), "{text}");
    }
}

#[test]
fn unknown_names_and_bad_sizes_are_usage_errors_and_leave_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    for (arguments, part) in [
        (&["precomputer", "-o", "out"][..], "precompute"),
        (&["precompute", "-o", "out", "--method", "magic"][..], "filtered-sampling"),
        (&["precompute", "-o", "out", "--size", "100"][..], "100"),
        (&["precompute", "-o", "out", "--judge", "maps"][..], "--panorama"),
        (&["precompute"][..], "--output"),
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{arguments:?}: {}", stderr(&output));
        assert!(!folder.path().join("out").exists(), "{arguments:?}");
    }
}

#[test]
fn a_missing_panorama_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = run(folder.path(), &["precompute", "-o", "out", "--panorama", "missing.hdr"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("missing.hdr"), "{}", stderr(&output));
}

#[test]
fn a_small_run_writes_tables_and_a_chart() {
    let folder = tempfile::tempdir().expect("a folder");
    let panorama = synthetic_panorama(256, true);
    let rgba: Vec<[f32; 4]> = panorama.texels.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let file = folder.path().join("a, b.exr");
    Picture::from_radiance("a, b", panorama.width, panorama.height, &rgba).write(&file).expect("a panorama");
    let methods = ["ours", "filtered-sampling", "fixed-step-without-sine", "spherical-harmonics"];
    let mut arguments =
        vec!["precompute", "-o", "out", "--panorama", "a, b.exr", "--size", "256", "--json", "all.json"];
    methods.iter().for_each(|method| arguments.extend(["--method", method]));
    let output = run(folder.path(), &arguments);
    assert!(output.status.success(), "{}", stderr(&output));

    let json = std::fs::read_to_string(folder.path().join("all.json")).expect("all.json");
    assert_eq!(json, std::fs::read_to_string(folder.path().join("out/precompute.json")).expect("precompute.json"));
    let sweep: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let rows = sweep["rows"].as_array().expect("rows");
    for method in methods {
        assert!(rows.iter().any(|row| row["method"] == method), "{method} is missing");
    }
    for row in rows {
        for key in ["mean", "p95", "max", "gpu_ms", "alpha"] {
            let value = row[key].as_f64();
            assert!(value.is_some_and(|v| v.is_finite() && v > 0.0), "{key} of {row}");
        }
        assert!(row["mean"].as_f64() <= row["max"].as_f64() && row["p95"].as_f64() <= row["max"].as_f64(), "{row}");
    }
    let mean = |method: &str, quantity: &str| {
        let of = |row: &&serde_json::Value| row["method"] == method && row["quantity"] == quantity;
        let means: Vec<f64> = rows.iter().filter(of).filter_map(|row| row["mean"].as_f64()).collect();
        means.iter().sum::<f64>() / means.len() as f64
    };
    assert!(mean("fixed-step-without-sine", "irradiance") > 0.5, "it should be twice too bright");
    assert!(mean("ours", "irradiance") < 0.02, "{}", mean("ours", "irradiance"));
    assert!(mean("ours", "specular") < 0.1, "{}", mean("ours", "specular"));

    let csv = std::fs::read_to_string(folder.path().join("out/precompute.csv")).expect("precompute.csv");
    let mut lines = csv.lines();
    let columns = lines.next().expect("a header").split(',').count();
    let rest: Vec<&str> = lines.collect();
    assert_eq!(rest.len(), rows.len());
    for line in rest {
        let values = line.strip_prefix("\"a, b.exr\",").expect("the panorama's name, quoted");
        assert_eq!(values.split(',').count(), columns - 1, "{line}");
        assert!(!line.contains("NaN") && !line.contains("inf"), "{line}");
    }

    let svg = std::fs::read_to_string(folder.path().join("out/precompute-a, b-256.svg")).expect("a chart");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && svg.len() < 300_000);
    assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
    for part in ["GPU time, ms", "mean relative error, %", "Pareto front", "ours", "20"] {
        assert!(svg.contains(part), "the chart does not say {part}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "the chart has no place for what is no number");
}
