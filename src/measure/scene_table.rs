//! The six scenes' rows as CSV, JSON and Markdown.

use std::fmt::Write as _;
use std::path::Path;

use super::scenes::{SceneRow, SceneTable};
use super::spread::Spread;
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const HEADER: &str = "scene,view,width,height,samples,model,shading,frames,triangles,gpu_p10_ms,gpu_median_ms,gpu_p90_ms,\
                      record_p10_ms,record_median_ms,record_p90_ms,fps,thesis_fps,gpu_mib,texture_mib,load_ms,prepare_ms";

/// Writes `scenes.csv`, `scenes.json` and `scenes.md`.
pub fn write(folder: &Path, table: &SceneTable) -> Result<()> {
    let csv = table.rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row));
    write_atomically(&folder.join("scenes.csv"), csv.as_bytes())?;
    let path = folder.join("scenes.json");
    let json = serde_json::to_string_pretty(table).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (json + "\n").as_bytes())?;
    write_atomically(&folder.join("scenes.md"), markdown(table).as_bytes())
}

/// A row of the CSV file.
pub fn line(row: &SceneRow) -> String {
    let SceneRow { scene, view, size: [width, height], samples, model, shading, frames, triangles, .. } = row;
    let SceneRow { fps, thesis_fps, gpu_mib, texture_mib, load_ms, prepare_ms, .. } = row;
    let spread = |Spread { p10, median, p90 }: Spread| format!("{p10:.4},{median:.4},{p90:.4}");
    let (gpu, record) = (spread(row.gpu_ms), spread(row.record_ms));
    format!(
        "{scene},{view},{width},{height},{samples},{model},{shading},{frames},{triangles},{gpu},{record},{fps:.2},\
         {thesis_fps},{gpu_mib:.1},{texture_mib:.1},{load_ms:.0},{prepare_ms:.0}\n"
    )
}

fn markdown(table: &SceneTable) -> String {
    let mut text = format!("# Six scenes on {}, {}\n\n", table.gpu, table.date);
    text += "| scene | view | model | shading | triangles | GPU ms (p10–p90) | record ms | fps | thesis fps | PBR ÷ Phong | \
             GPU MiB | textures MiB | load ms | prepare ms |\n|---|---|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
    for row in &table.rows {
        let SceneRow { scene, view, model, shading, triangles, gpu_ms, record_ms, fps, thesis_fps, .. } = row;
        let SceneRow { gpu_mib, texture_mib, load_ms, prepare_ms, .. } = row;
        let ratio = against_phong(table, row).map_or("".into(), |ratio| format!("{ratio:.2}"));
        let thesis = if shading == "pbr" { format!("{thesis_fps}") } else { String::new() };
        // Writing into a string does not fail.
        let _ = writeln!(
            text,
            "| {scene} | {view} | {model} | {shading} | {triangles} | {:.2} ({:.2}–{:.2}) | {:.3} | {fps:.1} | {thesis} \
             | {ratio} | {gpu_mib:.0} | {texture_mib:.0} | {load_ms:.0} | {prepare_ms:.0} |",
            gpu_ms.median, gpu_ms.p10, gpu_ms.p90, record_ms.median
        );
    }
    let _ = writeln!(text, "\nThesis: {}.", table.thesis_hardware);
    text += "Its frame rates of Crytek Sponza are those with high-resolution textures; with default ones 90 on the desktop \
             and 35 in VR; Phong on the desktop 180.\n";
    for left_out in &table.left_out {
        let _ = writeln!(text, "\nLeft out: {left_out}");
    }
    text
}

/// GPU time against that of Phong, all else equal.
fn against_phong(table: &SceneTable, row: &SceneRow) -> Option<f64> {
    let same = |other: &&SceneRow| {
        other.scene == row.scene && other.view == row.view && other.model == row.model && other.shading == "phong"
    };
    let phong = table.rows.iter().find(same).filter(|_| row.shading == "pbr")?;
    Some(row.gpu_ms.median / phong.gpu_ms.median)
}

#[cfg(test)]
pub mod tests {
    use std::collections::BTreeMap;

    use super::*;

    pub fn row(shading: &str, median: f64) -> SceneRow {
        let spread = Spread { p10: 0.5 * median, median, p90: 2.0 * median };
        SceneRow {
            scene: "sphere",
            view: "desktop",
            eyes: 1,
            size: [320, 180],
            samples: 4,
            model: "needed".into(),
            shading: shading.into(),
            frames: 12,
            triangles: 20_480,
            gpu_ms: spread,
            record_ms: spread,
            fps: 50.0,
            thesis_fps: 1000.0,
            gpu_mib: 80.0,
            texture_mib: 20.0,
            load_ms: 300.0,
            prepare_ms: 900.0,
        }
    }

    pub fn table() -> SceneTable {
        SceneTable {
            gpu: "a GPU".into(),
            driver: String::new(),
            date: "2026-01-31".into(),
            thesis_hardware: "theirs",
            rows: vec![row("pbr", 3.0), row("phong", 2.0)],
            stages_ms: BTreeMap::new(),
            left_out: vec!["head: not there".into()],
            warnings: vec![],
        }
    }

    #[test]
    fn lines_have_the_header_s_columns() {
        assert_eq!(line(&row("pbr", 1.0)).split(',').count(), HEADER.split(',').count());
    }

    #[test]
    fn the_page_says_the_ratio_to_phong_the_thesis_s_rate_and_what_is_missing() {
        let text = markdown(&table());
        assert!(text.contains("| 3.00 (1.50–6.00) | 3.000 | 50.0 | 1000 | 1.50 |"), "{text}");
        assert!(text.contains("| 2.00 (1.00–4.00) | 2.000 | 50.0 |  |  |"), "{text}");
        assert!(text.contains("Left out: head: not there"), "{text}");
    }
}
