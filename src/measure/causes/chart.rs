//! Causes as a chart: how far the result moves for each, as bars; balls on the left, pictures on the right.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Kind, Results, Row, Swap};
use crate::asset::file::write_atomically;
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::{Error, Result};

const WIDTH: u32 = 1000;
/// Height of a line of bars.
const LINE: u32 = 26;
/// Width that names take, left of the bars.
const NAMES: u32 = 210;
const TITLE: u32 = 40;
const AXIS: u32 = 84;
const FOOT: u32 = 58;
const FONT: &str = "sans-serif";
/// Okabe and Ito's palette, which colour-blind readers tell apart: materials or scenes in their order.
const COLOURS: [RGBColor; 4] =
    [RGBColor(213, 94, 0), RGBColor(0, 114, 178), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// One line of bars: a value for each series that has one.
struct Line {
    name: String,
    swap: Swap,
    values: Vec<Option<f64>>,
}

/// What one panel shows.
struct Panel {
    series: Vec<String>,
    lines: Vec<Line>,
    floor: f64,
}

impl Panel {
    /// Balls are averaged over panoramas, in percent.
    fn new(rows: &[Row], kind: Kind) -> Self {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.kind == kind).collect();
        let unit = if kind == Kind::Ball { 100.0 } else { 1.0 };
        let mut series: Vec<String> = Vec::new();
        for row in &rows {
            let name = series_of(row);
            if !series.contains(&name) {
                series.push(name);
            }
        }
        series.truncate(COLOURS.len());
        let mut lines: Vec<Line> = Vec::new();
        for row in rows.iter().filter(|row| matches!(row.swap, Swap::Whole | Swap::ReferenceAccumulator | Swap::Other))
        {
            let name = name_of(row);
            if !lines.iter().any(|line| line.name == name) {
                let mean = |series: &String| {
                    let own = rows.iter().filter(|other| name_of(other) == name && series_of(other) == *series);
                    let own: Vec<f64> =
                        own.filter(|o| o.swap == row.swap).filter_map(|o| Some(o.main?.change)).collect();
                    (!own.is_empty()).then(|| unit * own.iter().sum::<f64>() / own.len() as f64)
                };
                let values: Vec<Option<f64>> = series.iter().map(mean).collect();
                lines.push(Line { name, swap: row.swap, values });
            }
        }
        lines.retain(|line| line.values.iter().any(Option::is_some));
        let most = |line: &Line| line.values.iter().flatten().copied().fold(0.0, f64::max);
        let order = |line: &Line| {
            [Swap::Whole, Swap::ReferenceAccumulator, Swap::Other].iter().position(|swap| *swap == line.swap)
        };
        lines.sort_by(|a, b| order(a).cmp(&order(b)).then(most(b).total_cmp(&most(a))));
        let floors = rows.iter().filter(|row| row.swap == Swap::Floor).filter_map(|row| row.main);
        Self { series, lines, floor: unit * floors.map(|main| main.change).fold(0.0, f64::max) }
    }

    /// Of the axis: whole decades around all that can be told, the floor included.
    fn range(&self) -> Option<(f64, f64)> {
        let values = || self.lines.iter().flat_map(|line| line.values.iter().flatten().copied()).filter(|v| *v > 0.0);
        let most = values().reduce(f64::max)?;
        let least = values().fold(f64::INFINITY, f64::min).min(if self.floor > 0.0 { self.floor } else { most });
        // What is four decades below the largest is as good as none.
        let low = 10f64.powf((least / 1.5).max(most * 1e-4).log10().floor());
        Some((low, 2.0 * most))
    }
}

/// A ball's material, or a scene.
fn series_of(row: &Row) -> String {
    row.subject.rsplit(", ").next().unwrap_or_default().to_owned()
}

fn name_of(row: &Row) -> String {
    match row.swap {
        Swap::Whole => "all together".into(),
        Swap::Other => format!("{}: {}", row.cause, row.swapped.split(':').next().unwrap_or_default()),
        _ => row.cause.clone(),
    }
}

/// Writes `causes.svg`.
pub fn write(folder: &Path, results: &Results) -> Result<()> {
    let path = folder.join("causes.svg");
    let svg = draw(results).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())
}

fn draw(results: &Results) -> Drawn<String> {
    let panels = [Kind::Ball, Kind::Picture].map(|kind| Panel::new(&results.rows, kind));
    let most = panels.iter().map(|panel| panel.lines.len()).max().unwrap_or(0) as u32;
    let height = TITLE + most * LINE + AXIS + FOOT;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let (top, foot) =
            root.titled("What each approximation changes", (FONT, 19))?.split_vertically(height - TITLE - FOOT);
        caption(&foot, results)?;
        let (left, right) = top.split_horizontally(WIDTH / 2);
        let [width, height] = results.size;
        let pictures = format!("pictures of {width}×{height}, mean FLIP");
        for (area, panel, title) in
            [(left, &panels[0], "ball, mean relative difference of radiance, %"), (right, &panels[1], &pictures)]
        {
            if let Some(range) = panel.range() {
                bars(&root, &area, panel, title, range)?;
            }
        }
        root.present()?;
    }
    Ok(svg)
}

fn bars(root: &Area<'_>, area: &Area<'_>, panel: &Panel, unit: &str, (low, high): (f64, f64)) -> Drawn<()> {
    // Panels with fewer lines end higher up.
    let (area, _) = area.split_vertically(panel.lines.len() as u32 * LINE + AXIS);
    let (head, body) = area.split_vertically(26);
    legend(&head, &panel.series)?;
    let count = panel.lines.len() as f64;
    let mut chart = ChartBuilder::on(&body)
        .margin_right(24)
        .x_label_area_size(AXIS - 30)
        .y_label_area_size(NAMES)
        .build_cartesian_2d((low..high).log_scale(), 0.0..count)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .max_light_lines(0)
        .x_desc(unit)
        .x_labels(12)
        .y_labels(0)
        .bold_line_style(BLACK.mix(0.1))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .x_label_formatter(&|v| tick(*v))
        .draw()?;
    let share = 0.8 / panel.series.len().max(1) as f64;
    for (i, line) in panel.lines.iter().enumerate() {
        let upper = count - i as f64 - 0.1;
        for (series, value) in line.values.iter().enumerate().filter_map(|(s, v)| Some((s, (*v)?))) {
            let (top, colour) = (upper - share * series as f64, COLOURS[series]);
            if value <= low {
                let at = chart.backend_coord(&(low, top - 0.5 * share));
                let style = (FONT, 10).into_font().color(&BLACK.mix(0.6)).pos(Pos::new(HPos::Left, VPos::Center));
                let words = if value > 0.0 { "less" } else { "no difference" };
                root.draw(&Text::new(words, (at.0 + 4, at.1), style))?;
                continue;
            }
            let corners = [(low, top), (value.clamp(low, high), top - share)];
            match line.swap {
                Swap::Other => {
                    chart.draw_series([Rectangle::new(corners, colour.mix(0.25).filled())])?;
                    chart.draw_series([Rectangle::new(corners, colour.stroke_width(1))])?
                }
                _ => chart.draw_series([Rectangle::new(corners, colour.filled())])?,
            };
        }
        let at = chart.backend_coord(&(low, upper - 0.4));
        let style = (FONT, 12).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
        root.draw(&Text::new(line.name.clone(), (at.0 - 8, at.1), style))?;
    }
    if panel.floor > low {
        let line = [(panel.floor, 0.0), (panel.floor, count)];
        chart.draw_series(DashedLineSeries::new(line, 4, 4, BLACK.mix(0.6).into()))?;
    }
    Ok(())
}

fn legend(area: &Area<'_>, series: &[String]) -> Drawn<()> {
    let style = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    for (i, (name, colour)) in series.iter().zip(COLOURS).enumerate() {
        let x = NAMES as i32 + 110 * i as i32;
        area.draw(&Rectangle::new([(x, 7), (x + 12, 19)], colour.filled()))?;
        area.draw(&Text::new(name.clone(), (x + 18, 13), style.clone()))?;
    }
    Ok(())
}

fn caption(area: &Area<'_>, results: &Results) -> Drawn<()> {
    let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
    let lines = [
        "Filled: the one cause exact, all others as they are. Light: another setting instead. Dashed: what an integral (of \
         pictures: all together, split sum) is itself good to."
            .to_owned(),
        format!(
            "{}, {}. ReferenceAccumulator pictures: radiance averaged, then the tone curve. FLIP as seen with {PIXELS_PER_DEGREE} pixels per \
             degree.",
            results.gpu, results.date
        ),
    ];
    for (y, line) in (0..).map(|i| 18 + 18 * i).zip(lines) {
        area.draw(&Text::new(line, (WIDTH as i32 / 2, y), style.clone()))?;
    }
    Ok(())
}

/// Whole decades only.
fn tick(value: f64) -> String {
    let decade = value.log10().round();
    if (value.log10() - decade).abs() > 1e-6 {
        return String::new();
    }
    let digits = (-decade).max(0.0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::super::gpu_tests::rows;
    use super::*;

    #[test]
    fn lines_are_sorted_and_in_the_units_of_their_kind() {
        let panel = Panel::new(&rows(), Kind::Ball);
        let names: Vec<&str> = panel.lines.iter().map(|line| line.name.as_str()).collect();
        assert_eq!(names, ["all together", "large", "small", "large: exact"]);
        assert!((panel.lines[1].values[0].unwrap() - 4.0).abs() < 1e-9 && (panel.floor - 0.04).abs() < 1e-9);
        assert!((Panel::new(&rows(), Kind::Picture).lines[1].values[0].unwrap() - 0.04).abs() < 1e-9);
        let (low, high) = panel.range().unwrap();
        assert!(low <= 0.04 && high >= 7.0);
    }

    #[test]
    fn a_chart_names_every_cause_and_has_no_nonsense_numbers() {
        let mut all = rows();
        all[2].main = all[2].main.map(|main| super::super::Change { change: 0.0, ..main });
        let results =
            |rows| Results { gpu: "a GPU".into(), driver: "d".into(), date: "2026".into(), size: [64, 48], rows };
        let svg = draw(&results(all)).unwrap();
        for part in ["a GPU", "large", "small", "mean FLIP", "64×48", "all together", "a scene", "radiance averaged"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(draw(&results(vec![])).is_ok());
    }

    #[test]
    fn ticks_are_decades() {
        assert_eq!([0.01, 0.1, 1.0, 10.0, 0.2].map(tick), ["0.01", "0.1", "1", "10", ""]);
    }
}
