//! The chart of stereo: each way's recording and GPU time against that of one eye.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::stereo::{StereoRow, StereoTable};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 340);
const FONT: &str = "sans-serif";
/// Okabe and Ito's palette, which colour-blind readers tell apart.
const RECORD: RGBColor = RGBColor(0, 114, 178);
const GPU: RGBColor = RGBColor(213, 94, 0);
/// Pixels from the left, for names and for the longest number.
const NAMES: i32 = 190;
const NUMBERS: i32 = 180;
const BAR: i32 = 13;

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Writes `stereo.svg`.
pub fn write(folder: &Path, table: &StereoTable) -> Result<()> {
    let path = folder.join("stereo.svg");
    let svg = draw(table).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())
}

fn draw(table: &StereoTable) -> Drawn<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
        let [width, height] = table.size;
        let caption = format!(
            "{}, {}, {width}\u{d7}{height} an eye. Medians of {} frames, blue: recording and submitting, orange: GPU.",
            table.gpu, table.date, table.frames
        );
        root.draw(&Text::new(caption, (SIZE.0 as i32 / 2, SIZE.1 as i32 - 14), style))?;
        let area = root.titled("Two eyes against one", (FONT, 19))?;
        let most = table.rows.iter().fold(1.0, |most: f64, row| most.max(row.record_ratio).max(row.gpu_ratio));
        for (place, row) in (0..).zip(&table.rows) {
            draw_row(&area, row, 10 + place * 44, f64::from(SIZE.0 as i32 - NAMES - NUMBERS) / most)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn draw_row(area: &DrawingArea<SVGBackend<'_>, Shift>, row: &StereoRow, y: i32, pixels: f64) -> Drawn<()> {
    let left = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let right = left.clone().pos(Pos::new(HPos::Right, VPos::Center));
    area.draw(&Text::new(format!("{}, {}", row.scene, row.way), (NAMES - 10, y + BAR), right))?;
    for (y, colour, ratio, ms) in
        [(y, RECORD, row.record_ratio, row.record_ms.median), (y + BAR + 2, GPU, row.gpu_ratio, row.gpu_ms.median)]
    {
        let end = NAMES + (ratio * pixels) as i32;
        area.draw(&Rectangle::new([(NAMES, y), (end, y + BAR)], colour.filled()))?;
        let text = format!("{ratio:.2}\u{d7}, {ms:.3} ms");
        area.draw(&Text::new(text, (end + 8, y + BAR / 2), left.clone()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::stereo::tests::rows;
    use super::*;

    #[test]
    fn the_chart_says_every_ratio() {
        let (gpu, date) = ("a GPU".into(), "2026-01-31".into());
        let (size, driver, left_out) = ([252, 280], String::new(), vec![]);
        let svg = draw(&StereoTable { gpu, driver, date, size, frames: 3, rows: rows(), left_out }).unwrap();
        for part in ["tearoom, one pass", "1.50\u{d7}, 3.000 ms", "2.00\u{d7}, 8.000 ms", "252\u{d7}280"] {
            assert!(svg.contains(part), "the chart does not say {part}: {svg}");
        }
    }
}
