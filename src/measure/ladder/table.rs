//! A ladder's rows as CSV, JSON and Markdown.

use std::fmt::Write as _;
use std::path::Path;

use super::super::clock::today;
use super::{Ladder, Results, Rung};
use crate::asset::file::write_atomically;
use crate::gpu::Gpu;
use crate::{Error, Result};

const HEADER: &str = "scene,dimension,flags,frames,ms,ratio,ratio_low,ratio_high,gpu_ms,gpu_ms_low,gpu_ms_high,cpu_ms,flip,flip_max,\
    flip_over_default,flip_noise,relative_mse,beaten_by,within_noise";

/// Writes `ladder.csv`, `ladder.json` and `ladder.md`, each whole at any time.
pub fn write(folder: &Path, gpu: &Gpu, ladders: &[Ladder]) -> Result<()> {
    let rows = ladders.iter().flat_map(|ladder| ladder.rungs.iter().map(|rung| line(&ladder.scene, rung)));
    let csv: String = [HEADER.to_owned()].into_iter().chain(rows).map(|line| line + "\n").collect();
    write_atomically(&folder.join("ladder.csv"), csv.as_bytes())?;
    write_atomically(&folder.join("ladder.md"), markdown(ladders).as_bytes())?;
    let info = gpu.info();
    let results = Results { gpu: &info.name, driver: &info.driver, date: today(), ladders };
    let path = folder.join("ladder.json");
    let text = serde_json::to_string_pretty(&results).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

fn line(scene: &str, rung: &Rung) -> String {
    let Rung {
        dimension, flags, cost, ratio, ms, error, flip_over_default, flip_noise, beaten_by, within_noise, ..
    } = rung;
    let (g, cpu) = (cost.gpu_ms, cost.cpu_ms.map_or(String::new(), |cpu| format!("{:.3}", cpu.median)));
    let beaten_by = beaten_by.as_deref().unwrap_or_default();
    format!(
        "{scene},{dimension},{flags},{},{ms:.3},{:.4},{:.4},{:.4},{:.3},{:.3},{:.3},{cpu},{:.5},{:.4},\
         {flip_over_default:.5},{flip_noise:.5},{:.4e},{beaten_by},{within_noise}",
        cost.frames,
        ratio.median,
        ratio.low,
        ratio.high,
        g.median,
        g.low,
        g.high,
        error.flip,
        error.flip_max,
        error.relative_mse
    )
}

/// A table for each scene, quickest first.
fn markdown(ladders: &[Ladder]) -> String {
    let mut text = String::from("# Speed against accuracy\n");
    for ladder in ladders {
        let Ladder { scene, gpu, driver, date, size: [width, height], time, exact, .. } = ladder;
        let _ = write!(
            text,
            "\n## {scene}\n\n{width}×{height} on {gpu} ({driver}), {date}. Time: that of the default settings, {time} as a \
             multiple of it, both drawn in turn (medians; in brackets a tenth lies below and above). Error against the exact \
             picture: {} frames of {1}×{1} times the pixels, whose display light (after the tone curve) is averaged; standard \
             error {2:.2} %, its own FLIP {3:.5} and relative MSE {4:.1e}, {5:.1} s of GPU time. FLIP as seen with {6} pixels per \
             degree; in brackets the difference from the default's, ± what the exact picture's noise leaves open (twice the \
             standard error of the paired difference, and what noise draws the two together by). Within noise: of time \
             and FLIP one differs by less, or by less than 1 % of the default's.\n\n| setting | ms | × default | FLIP | relative MSE | beaten by |\n|---|---|---|---|---|---|\n",
            exact.frames,
            exact.fineness,
            100.0 * exact.standard_error,
            exact.floor.flip,
            exact.floor.relative_mse,
            exact.gpu_ms / 1e3,
            exact.pixels_per_degree
        );
        let mut rungs: Vec<&Rung> = ladder.rungs.iter().collect();
        rungs.sort_by(|a, b| a.ms.total_cmp(&b.ms));
        for rung in rungs {
            let beaten = match (&rung.beaten_by, rung.within_noise) {
                (None, _) => "on the front".to_owned(),
                (Some(by), false) => format!("`{by}`"),
                (Some(by), true) => format!("`{by}`, within noise"),
            };
            let Rung { ms, ratio, error, .. } = rung;
            let _ = writeln!(
                text,
                "| `{}` | {ms:.2} | {:.2} ({:.2} to {:.2}) | {:.4} ({:+.5} ± {:.5}) | {:.2e} | {beaten} |",
                rung.name(),
                ratio.median,
                ratio.low,
                ratio.high,
                error.flip,
                rung.flip_over_default,
                rung.flip_noise,
                error.relative_mse
            );
        }
        ladder.notes.iter().for_each(|note| text += &format!("\n- {note}"));
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::ladder;
    use super::*;

    #[test]
    fn lines_have_the_header_s_columns_and_the_table_a_row_for_each_setting() {
        let ladder = ladder(&[
            ("", 8.0, 0.010),
            ("--samples 1", 4.0, 0.020),
            ("--model everything", 9.0, 0.011),
            ("--b", 9.0, 0.0102),
        ]);
        for rung in &ladder.rungs {
            assert_eq!(line("teapot", rung).split(',').count(), HEADER.split(',').count());
        }
        let text = markdown(std::slice::from_ref(&ladder));
        for part in [
            "| `default` | 8.00 |",
            "| `--samples 1` | 4.00 |",
            "| `default` |\n",
            "on the front",
            "## a scene",
            "0.0200 (+0.01000 ± 0.00050)",
            "67 pixels per degree",
            "| `default`, within noise |",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
        let (quick, default) = (text.find("`--samples 1`").unwrap(), text.find("| `default` | 8").unwrap());
        assert!(quick < default, "the quickest comes first");
    }
}
