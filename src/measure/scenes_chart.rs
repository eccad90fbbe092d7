//! A chart of the scenes' GPU times: a line for each scene, a mark for each way of drawing.

use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::scenes::{Results, SCENES, SceneRow};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 400);
const FONT: &str = "sans-serif";
/// Shading, model, colour (Okabe and Ito's palette, which colour-blind readers tell apart), whether it is filled.
const LOOKS: [(&str, &str, RGBColor, bool); 4] = [
    ("pbr", "everything", RGBColor(213, 94, 0), false),
    ("pbr", "needed", RGBColor(213, 94, 0), true),
    ("phong", "everything", RGBColor(0, 114, 178), false),
    ("phong", "needed", RGBColor(0, 114, 178), true),
];

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Writes `scenes.svg`.
pub fn write(folder: &Path, results: &Results) -> Result<PathBuf> {
    let path = folder.join("scenes.svg");
    let svg = draw(results).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())?;
    Ok(path)
}

fn draw(results: &Results) -> Drawn<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (top, foot) = root.titled("GPU time of a frame", (FONT, 19))?.split_vertically(SIZE.1 - 92);
        legend(&foot, &format!("{}, {}", results.gpu, results.date))?;
        let (left, right) = top.split_horizontally(SIZE.0 / 2);
        for (area, view) in [(left, "desktop"), (right, "stereo")] {
            let rows: Vec<&SceneRow> = results.rows.iter().filter(|row| row.view == view).collect();
            panel(&area, &rows, view)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn panel(area: &DrawingArea<SVGBackend<'_>, Shift>, rows: &[&SceneRow], view: &str) -> Drawn<()> {
    let Some(first) = rows.first() else { return Ok(()) };
    let size = format!("{view}, {}×{}{}", first.size[0], first.size[1], if view == "stereo" { " per eye" } else { "" });
    let times = || rows.iter().flat_map(|row| [row.cost.gpu_ms.low, row.cost.gpu_ms.high]).filter(|ms| *ms > 0.0);
    let (least, most) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
    if most <= 0.0 {
        return Ok(());
    }
    let decade = |ms: f64| 10f64.powf(ms.log10().floor());
    let names: Vec<&str> =
        SCENES.iter().map(|known| known.name).filter(|n| rows.iter().any(|r| r.scene == *n)).collect();
    let mut chart = ChartBuilder::on(area)
        .caption(size, (FONT, 15))
        .margin(8)
        .margin_right(20)
        .x_label_area_size(40)
        .y_label_area_size(110)
        .build_cartesian_2d((decade(least)..1.3 * most).log_scale(), -0.5..names.len() as f64 - 0.5)?;
    let is_round = |ms: f64| [1.0, 2.0, 5.0].iter().any(|step| (ms / decade(ms * 1.000_001) - step).abs() < 1e-6);
    chart
        .configure_mesh()
        .x_desc("ms")
        .max_light_lines(0)
        .disable_y_mesh()
        .x_labels(30)
        .y_labels(0)
        .bold_line_style(BLACK.mix(0.1))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .x_label_formatter(&|ms| if is_round(*ms) { format!("{ms}") } else { String::new() })
        .draw()?;
    let style = (FONT, 12).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
    for (i, name) in names.iter().enumerate() {
        let height = (names.len() - 1 - i) as f64;
        let at = (decade(least), height);
        chart.plotting_area().draw(&(EmptyElement::at(at) + Text::new((*name).to_owned(), (-8, 0), style.clone())))?;
        for (step, (shading, model, colour, filled)) in LOOKS.into_iter().enumerate() {
            let Some(row) = rows.iter().find(|r| (r.scene, r.shading, r.model) == (*name, shading, model)) else {
                continue;
            };
            let (height, ms) = (height + 0.27 - 0.18 * step as f64, row.cost.gpu_ms);
            let style = if filled { colour.filled() } else { colour.stroke_width(2) };
            chart.draw_series([PathElement::new([(ms.low, height), (ms.high, height)], colour.mix(0.6))])?;
            chart.draw_series([Circle::new((ms.median, height), 4, style)])?;
        }
    }
    Ok(())
}

fn legend(area: &DrawingArea<SVGBackend<'_>, Shift>, caption: &str) -> Drawn<()> {
    let style = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    for (x, (shading, model, colour, filled)) in (0..).zip(LOOKS).map(|(i, look)| (100 + 200 * i, look)) {
        let name = if shading == "pbr" { "physically based" } else { "Phong" };
        area.draw(&Circle::new((x, 12), 4, if filled { colour.filled() } else { colour.stroke_width(2) }))?;
        area.draw(&Text::new(format!("{name}, {model}"), (x + 10, 12), style.clone()))?;
    }
    let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
    let text = format!("{caption}. Marks: medians; lines: from the tenth fastest frame of a hundred to the ninetieth.");
    area.draw(&Text::new(text, (SIZE.0 as i32 / 2, 36), style))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::scenes_table::tests::{results, rows};
    use super::*;

    #[test]
    fn a_chart_names_each_scene_and_has_a_mark_for_each_row() {
        let all =
            [rows("teapot", "desktop", 4.0), rows("tearoom", "desktop", 30.0), rows("teapot", "stereo", 6.0)].concat();
        let count = all.len();
        let svg = draw(&results(all)).unwrap();
        for part in ["teapot", "tearoom", "a GPU", "Phong, everything"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("crytek") && !svg.contains("NaN") && !svg.contains("inf"));
        // The legend has four of its own.
        assert_eq!(svg.matches("<circle").count(), count + 4);
        assert!(draw(&results(vec![])).is_ok());
    }
}
