//! The six scenes' chart: GPU time of a frame, with its spread, beside the thesis's.

use std::path::Path;

use plotters::coord::ranged1d::SegmentedCoord;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::scenes::{SCENES, SceneRow, SceneTable};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 430);
const FONT: &str = "sans-serif";
/// Okabe and Ito's palette, which colour-blind readers tell apart.
const PBR: RGBColor = RGBColor(213, 94, 0);
const PHONG: RGBColor = RGBColor(0, 114, 178);
const THESIS: RGBColor = RGBColor(110, 110, 110);
/// A Vive's frame.
const VIVE_MS: f64 = 1e3 / 90.0;

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Writes `scenes.svg`.
pub fn write(folder: &Path, table: &SceneTable) -> Result<()> {
    let path = folder.join("scenes.svg");
    let svg = draw(table).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())
}

fn draw(table: &SceneTable) -> Drawn<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
        let caption = format!("{}, {}. Lines: p10 to p90. Thesis: {}.", table.gpu, table.date, table.thesis_hardware);
        root.draw(&Text::new(caption, (SIZE.0 as i32 / 2, SIZE.1 as i32 - 12), style))?;
        let (top, foot) = root.titled("GPU time of a frame, six scenes", (FONT, 19))?.split_vertically(SIZE.1 - 72);
        legend(&foot)?;
        let (left, right) = top.split_horizontally(SIZE.0 / 2);
        for (area, view) in [(left, "desktop"), (right, "stereo")] {
            let rows: Vec<&SceneRow> = table.rows.iter().filter(|row| row.view == view).collect();
            panel(&area, view, &rows)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn panel(area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>, view: &str, rows: &[&SceneRow]) -> Drawn<()> {
    let Some(first) = rows.first() else { return Ok(()) };
    let values = rows.iter().flat_map(|row| [row.gpu_ms.p10, row.gpu_ms.p90, 1e3 / row.thesis_fps]);
    let (low, high) = values.filter(|v| *v > 0.0).fold((VIVE_MS, VIVE_MS), |(low, high), v| (low.min(v), high.max(v)));
    // From a decade on, below whose first tick there would be none.
    let low = 10f64.powf((low / 1.2).log10().floor());
    let [width, height] = first.size;
    let eyes = if first.eyes == 2 { " an eye" } else { "" };
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{view}, {width}\u{d7}{height}{eyes}, {}\u{d7}MSAA", first.samples), (FONT, 15))
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(52)
        .build_cartesian_2d((0..SCENES.len() - 1).into_segmented(), (low..high * 1.5).log_scale())?;
    let name = |at: &SegmentValue<usize>| match at {
        SegmentValue::CenterOf(i) => SCENES.get(*i).map_or(String::new(), |s| s.name.replace("-sponza", " S.")),
        _ => String::new(),
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .y_desc("ms")
        .max_light_lines(0)
        .bold_line_style(BLACK.mix(0.1))
        .label_style((FONT, 12))
        .x_labels(SCENES.len())
        .x_label_formatter(&name)
        .draw()?;
    let (start, end) = (SegmentValue::Exact(0), SegmentValue::Last);
    chart.draw_series([PathElement::new([(start, VIVE_MS), (end, VIVE_MS)], BLACK.mix(0.5))])?;
    for row in rows {
        draw_row(&mut chart, row)?;
    }
    Ok(())
}

type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<SegmentedCoord<plotters::coord::types::RangedCoordusize>, plotters::coord::combinators::LogCoord<f64>>,
>;

/// A row's mark, beside the others of its scene: hollow with everything modelled.
fn draw_row(chart: &mut Chart<'_, '_>, row: &SceneRow) -> Drawn<()> {
    let Some(place) = SCENES.iter().position(|scene| scene.name == row.scene) else { return Ok(()) };
    let (colour, side) = if row.shading == "pbr" { (PBR, -12) } else { (PHONG, 8) };
    let needed = row.model == "needed";
    let x = side + if needed { 0 } else { 7 };
    let middle = (SegmentValue::CenterOf(place), row.gpu_ms.median);
    let pixel = |chart: &Chart<'_, '_>, ms: f64| chart.backend_coord(&(SegmentValue::CenterOf(place), ms)).1;
    let at = pixel(chart, row.gpu_ms.median);
    let line = [row.gpu_ms.p10, row.gpu_ms.p90].map(|ms| (x, pixel(chart, ms) - at));
    let style = if needed { colour.filled() } else { colour.stroke_width(1) };
    chart.draw_series([EmptyElement::at(middle.clone())
        + PathElement::new(line.to_vec(), colour.stroke_width(1))
        + Circle::new((x, 0), 4, style)])?;
    if row.shading == "pbr" && needed {
        let thesis = (middle.0, 1e3 / row.thesis_fps);
        chart.draw_series([Cross::new(thesis, 5, THESIS.stroke_width(2))])?;
    }
    Ok(())
}

fn legend(area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>) -> Drawn<()> {
    let style = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let entries = [
        (40, PBR.filled(), "PBR"),
        (120, PBR.stroke_width(1), "PBR, everything modelled"),
        (330, PHONG.filled(), "Phong"),
        (420, PHONG.stroke_width(1), "Phong, everything modelled"),
    ];
    for (x, look, name) in entries {
        area.draw(&Circle::new((x, 12), 4, look))?;
        area.draw(&Text::new(name.to_owned(), (x + 12, 12), style.clone()))?;
    }
    area.draw(&Cross::new((640, 12), 5, THESIS.stroke_width(2)))?;
    area.draw(&Text::new("thesis, PBR, 1/fps".to_owned(), (652, 12), style.clone()))?;
    area.draw(&PathElement::new([(790, 12), (810, 12)], BLACK.mix(0.5)))?;
    area.draw(&Text::new("90 Hz".to_owned(), (816, 12), style))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::scene_table::tests::table;
    use super::*;

    #[test]
    fn the_chart_names_every_scene_and_is_small() {
        let svg = draw(&table()).unwrap();
        for part in ["sphere", "crytek S.", "desktop, 320\u{d7}180, 4\u{d7}MSAA", "a GPU, 2026-01-31", "thesis"] {
            assert!(svg.contains(part), "the chart does not say {part}");
        }
        assert!(!svg.contains("NaN") && svg.len() < 300_000);
    }
}
