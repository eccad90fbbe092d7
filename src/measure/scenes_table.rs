//! The scenes' rows as CSV, JSON and Markdown.

use std::fmt::Write as _;
use std::path::Path;

use super::scenes::{Results, SCENES, SceneRow, StartRow};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const HEADER: &str = "scene,triangles,view,width,height,shading,model,pipelines,frames,gpu_ms,gpu_ms_low,gpu_ms_high,cpu_ms,\
    cpu_ms_low,cpu_ms_high,record_ms,record_ms_low,record_ms_high,fps,thesis_fps,gpu_mib,texture_mib,flip_mean,largest_step";
const STAGES: [&str; 8] = ["parse", "hash", "decode", "mips", "compress", "cache", "upload", "precompute"];
const THESIS: &str = "the thesis's GTX 1070 (i7-6700, Windows 10; stereo: HTC Vive, 1080×1200 per eye, 90 Hz)";

/// Writes `scenes.csv`, `scenes-start.csv`, `scenes.json` and `scenes.md`.
pub fn write(folder: &Path, results: &Results) -> Result<()> {
    let csv = results.rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row) + "\n");
    write_atomically(&folder.join("scenes.csv"), csv.as_bytes())?;
    write_atomically(&folder.join("scenes-start.csv"), starts_csv(&results.starts).as_bytes())?;
    write_atomically(&folder.join("scenes.md"), markdown(results).as_bytes())?;
    let path = folder.join("scenes.json");
    let text = serde_json::to_string_pretty(results).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

/// One row of `scenes.csv`.
pub fn line(row: &SceneRow) -> String {
    let SceneRow { scene, triangles, view, size: [width, height], shading, model, pipelines, cost, .. } = row;
    let (g, r) = (cost.gpu_ms, cost.record_ms);
    let cpu = cost.cpu_ms.map_or(",,".into(), |c| format!("{:.2},{:.2},{:.2}", c.median, c.low, c.high));
    format!(
        "{scene},{triangles},{view},{width},{height},{shading},{model},{pipelines},{},{:.3},{:.3},{:.3},{cpu},{:.4},{:.4},\
         {:.4},{:.2},{},{:.2},{:.2},{:.6},{}",
        cost.frames,
        g.median,
        g.low,
        g.high,
        r.median,
        r.low,
        r.high,
        row.fps,
        row.thesis_fps,
        row.gpu_mib,
        row.texture_mib,
        row.flip_mean,
        row.largest_step
    )
}

fn starts_csv(starts: &[StartRow]) -> String {
    let mut text =
        format!("scene,start,ms,{},peak_ram_mib,gpu_mib\n", STAGES.map(|stage| format!("{stage}_ms")).join(","));
    for row in starts {
        let peak = row.peak_ram_mib.map_or(String::new(), |mib| format!("{mib:.0}"));
        for (start, ms, stages, peak) in [
            ("cold", row.cold_ms, &row.cold_stages_ms, peak.as_str()),
            // The most is that of the cold start.
            ("cached", row.cached_ms, &row.cached_stages_ms, ""),
        ] {
            let stages = STAGES.map(|stage| format!("{:.0}", stages.get(stage).copied().unwrap_or(0.0))).join(",");
            // Writing into a string does not fail.
            let _ = writeln!(text, "{},{start},{ms:.0},{stages},{peak},{:.1}", row.scene, row.gpu_mib);
        }
    }
    text
}

/// The thesis's two tables, with its own numbers beside ours, and what starting took.
fn markdown(results: &Results) -> String {
    let Results { gpu, driver, date, samples, .. } = results;
    let mut text = format!(
        "# Six scenes\n\n{gpu}, {driver}, {date}; {samples} samples a pixel. Thesis: {THESIS}. Frames a second are what the \
         slower of GPU and recording thread allows; times are medians.\n"
    );
    for view in ["desktop", "stereo"] {
        text += &frame_rates(results, view);
    }
    text += "\n## Start\n\nSeconds until the first frame can be drawn, with an empty cache and with a filled one.\n\n\
        | scene | cold | cached | most RAM, MiB | GPU, MiB |\n|---|---|---|---|---|\n";
    for row in &results.starts {
        let peak = row.peak_ram_mib.map_or("not told".into(), |mib| format!("{mib:.0}"));
        let (cold, cached) = (row.cold_ms * 1e-3, row.cached_ms * 1e-3);
        let _ = writeln!(text, "| {} | {cold:.2} | {cached:.2} | {peak} | {:.0} |", row.scene, row.gpu_mib);
    }
    if !results.warnings.is_empty() {
        text += &format!(
            "\nLeft out:\n\n{}\n",
            results.warnings.iter().map(|w| format!("- {w}")).collect::<Vec<_>>().join("\n")
        );
    }
    text
}

fn frame_rates(results: &Results, view: &str) -> String {
    let rows = |scene: &str, shading: &str, model: &str| {
        let is = |r: &&SceneRow| (r.scene, r.view, r.shading, r.model) == (scene, view, shading, model);
        results.rows.iter().find(is)
    };
    let Some(first) = results.rows.iter().find(|row| row.view == view) else { return String::new() };
    let mut text = format!(
        "\n## {view}, {}×{}{}\n\n| scene | triangles (thesis) | GPU ms | fps | fps, thesis | PBR ÷ Phong | everything ÷ needed, \
         PBR | largest difference, of 255 |\n|---|---|---|---|---|---|---|---|\n",
        first.size[0],
        first.size[1],
        if view == "stereo" { " per eye" } else { "" }
    );
    for known in SCENES {
        let (Some(pbr), Some(phong), Some(all)) = (
            rows(known.name, "pbr", "needed"),
            rows(known.name, "phong", "needed"),
            rows(known.name, "pbr", "everything"),
        ) else {
            continue;
        };
        let g = pbr.cost.gpu_ms;
        let ratio = |a: &SceneRow, b: &SceneRow| a.cost.gpu_ms.median / b.cost.gpu_ms.median;
        let _ = writeln!(
            text,
            "| {} | {} ({}) | {:.2} ({:.2}–{:.2}) | {:.0} | {} | {:.2} | {:.2} | {} |",
            known.name,
            pbr.triangles,
            known.thesis_triangles,
            g.median,
            g.low,
            g.high,
            pbr.fps,
            pbr.thesis_fps,
            ratio(pbr, phong),
            ratio(all, pbr),
            all.largest_step
        );
    }
    text
}

#[cfg(test)]
pub mod tests {
    use std::collections::BTreeMap;

    use super::super::turns::{Cost, Spread};
    use super::*;

    /// A scene whose physically based frame takes so long, and Phong half of it; everything a quarter longer.
    pub fn rows(scene: &'static str, view: &'static str, ms: f64) -> Vec<SceneRow> {
        let ways = [
            ("pbr", "needed", 1.0),
            ("pbr", "everything", 1.25),
            ("phong", "needed", 0.5),
            ("phong", "everything", 0.5),
        ];
        let row = |(shading, model, share): (&'static str, &'static str, f64)| {
            let median = ms * share;
            let spread = Spread { median, low: 0.9 * median, high: 1.1 * median };
            let record_ms = Spread { median: 0.1, low: 0.1, high: 0.1 };
            SceneRow {
                scene,
                triangles: 12,
                view,
                size: [4, 3],
                shading,
                model,
                pipelines: 1,
                cost: Cost { frames: 9, gpu_ms: spread, cpu_ms: Some(spread), record_ms },
                fps: 1e3 / median,
                thesis_fps: 1000.0,
                gpu_mib: 1.0,
                texture_mib: 0.5,
                flip_mean: 0.0,
                largest_step: 0,
            }
        };
        ways.map(row).into()
    }

    pub fn results(rows: Vec<SceneRow>) -> Results {
        let (gpu, driver, date) = ("a GPU".into(), "1.2".into(), "2026-01-01".into());
        Results { gpu, driver, date, samples: 4, rows, starts: vec![], warnings: vec!["head: not there".into()] }
    }

    #[test]
    fn lines_have_the_header_s_columns() {
        let mut row = rows("teapot", "desktop", 4.0).remove(0);
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
        row.cost.cpu_ms = None;
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
        let stages = BTreeMap::from([("parse", 2.0)]);
        let start = StartRow {
            scene: "teapot",
            cold_ms: 3.0,
            cached_ms: 1.0,
            cold_stages_ms: stages.clone(),
            cached_stages_ms: stages,
            peak_ram_mib: None,
            gpu_mib: 5.0,
        };
        let csv = starts_csv(&[start]);
        let counts: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(counts, [counts[0]; 3], "{csv}");
    }

    #[test]
    fn the_tables_hold_ratios_and_the_thesis_s_numbers_and_name_what_was_left_out() {
        let text = markdown(&results(rows("teapot", "desktop", 4.0)));
        assert!(text.contains("| teapot | 12 (15704) | 4.00 (3.60–4.40) | 250 | 1000 | 2.00 | 1.25 | 0 |"), "{text}");
        assert!(text.contains("GTX 1070") && text.contains("- head: not there"), "{text}");
        assert!(!text.contains("stereo, "), "a table without rows: {text}");
    }
}
