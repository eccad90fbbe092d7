//! Charts of textures: memory, and time of a frame, against the error that a viewer sees; an SVG for each scene.

use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::textures::TextureRow;
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 430);
const FONT: &str = "sans-serif";
/// Okabe and Ito's palette, which colour-blind readers tell apart.
const RAW: RGBColor = RGBColor(0, 114, 178);
const COMPRESSED: RGBColor = RGBColor(213, 94, 0);

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Writes `textures-SCENE.svg` for each scene of the rows.
pub fn write_all(folder: &Path, rows: &[TextureRow], gpu: &str, date: &str) -> Result<Vec<PathBuf>> {
    let mut scenes: Vec<&str> = rows.iter().map(|row| row.scene.as_str()).collect();
    scenes.dedup();
    let write = |scene: &str| {
        let path = folder.join(format!("textures-{scene}.svg"));
        let own: Vec<&TextureRow> = rows.iter().filter(|row| row.scene == scene).collect();
        let caption = format!("{gpu}, {date}. FLIP against plain textures with 16 samples of anisotropy.");
        let unwritable = |e: Box<dyn std::error::Error>| Error::write(&path)(std::io::Error::other(e.to_string()));
        let svg = draw(&own, &format!("Textures of {scene}"), &caption).map_err(unwritable)?;
        write_atomically(&path, svg.as_bytes())?;
        Ok(path)
    };
    scenes.into_iter().map(write).collect()
}

fn draw(rows: &[&TextureRow], title: &str, caption: &str) -> Drawn<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
        root.draw(&Text::new(caption.to_owned(), (SIZE.0 as i32 / 2, SIZE.1 as i32 - 14), style))?;
        let (top, _) = root.titled(title, (FONT, 19))?.split_vertically(SIZE.1 - 58);
        let (left, right) = top.split_horizontally(SIZE.0 / 2);
        let memory: Vec<&TextureRow> = rows.iter().copied().filter(|row| row.anisotropy == 8).collect();
        panel(
            &left,
            &memory,
            "texture memory, MiB",
            |row| row.mib,
            |row| match (row.storage, row.dropped_levels) {
                ("raw", _) => "raw".into(),
                (_, 0) => "BC7 + BC5".into(),
                (_, n) => format!("−{n}"),
            },
        )?;
        let time = |row: &TextureRow| row.frame_cpu_ms.filter(|ms| *ms > 0.0).or(row.frame_gpu_ms).unwrap_or(0.0);
        let plain: Vec<&TextureRow> =
            rows.iter().copied().filter(|row| row.dropped_levels == 0 && time(row) > 0.0).collect();
        panel(&right, &plain, "a frame, ms (processor time where it is known)", time, |row| {
            format!("{} {}x", row.storage, row.anisotropy)
        })?;
        root.present()?;
    }
    Ok(svg)
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    rows: &[&TextureRow],
    what: &str,
    x: impl Fn(&TextureRow) -> f64,
    label: impl Fn(&TextureRow) -> String,
) -> Drawn<()> {
    let flip = |row: &TextureRow| f64::from(row.flip_mean);
    let largest = |value: &dyn Fn(&TextureRow) -> f64| rows.iter().map(|row| value(row)).fold(1e-6, f64::max);
    let (right, top) = (1.25 * largest(&|row| x(row)), 1.15 * largest(&flip));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(58)
        .build_cartesian_2d(0.0..right, 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc(what)
        .y_desc("mean FLIP")
        .max_light_lines(0)
        .bold_line_style(BLACK.mix(0.1))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .draw()?;
    for (storage, colour) in [("raw", RAW), ("bc", COMPRESSED)] {
        let own = || rows.iter().filter(|row| row.storage == storage).map(|row| (x(row), flip(row)));
        chart.draw_series(LineSeries::new(own(), colour.mix(0.5)))?;
        chart.draw_series(own().map(|at| Circle::new(at, 4, colour.filled())))?;
    }
    let style = (FONT, 11).into_font().color(&BLACK.mix(0.8)).pos(Pos::new(HPos::Left, VPos::Bottom));
    chart.draw_series(
        rows.iter().map(|row| EmptyElement::at((x(row), flip(row))) + Text::new(label(row), (6, -4), style.clone())),
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_names_every_variant_and_has_no_nonsense_numbers() {
        let row = |storage, dropped_levels, anisotropy| TextureRow {
            scene: "s".into(),
            storage,
            dropped_levels,
            anisotropy,
            mib: 4.0,
            raw_mib: 16.0,
            load_ms: 1.0,
            load_cpu_ms: None,
            frame_gpu_ms: Some(3.0),
            frame_cpu_ms: None,
            flip_mean: 0.0,
            flip_max: 0.0,
            truth_flip_mean: 0.1,
        };
        let folder = tempfile::tempdir().unwrap();
        let rows = [row("raw", 0, 16), row("raw", 0, 8), row("bc", 0, 8), row("bc", 2, 8)];
        let paths = write_all(folder.path(), &rows, "a GPU", "2026-01-01").unwrap();
        let svg = std::fs::read_to_string(&paths[0]).unwrap();
        for part in ["raw 16x", "BC7 + BC5", "−2", "a GPU", "mean FLIP"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
