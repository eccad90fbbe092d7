//! Charts of a sweep: error against time, an SVG for each panorama and cube size.

use std::path::{Path, PathBuf};

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::table::{Row, Sweep};
use crate::asset::file::write_atomically;
use crate::precompute::alternatives::Quantity;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 470);
/// Height of title, legend and caption together.
const FOOT: u32 = 82;
/// Width of a letter of the legend, about; backends without fonts cannot tell.
const LETTER: i32 = 7;
const FRONT: RGBAColor = RGBAColor(0, 0, 0, 0.25);
const FONT: &str = "sans-serif";

/// Method, colour (Okabe and Ito's palette, which colour-blind readers tell apart) and shape.
const LOOKS: [(&str, RGBColor, Shape); 6] = [
    ("ours", RGBColor(213, 94, 0), Shape::Circle),
    ("monte-carlo", RGBColor(0, 114, 178), Shape::Triangle),
    ("filtered-sampling", RGBColor(0, 158, 115), Shape::Square),
    ("fixed-step", RGBColor(86, 180, 233), Shape::Triangle),
    ("fixed-step-without-sine", RGBColor(204, 121, 167), Shape::Diamond),
    ("spherical-harmonics", RGBColor(230, 159, 0), Shape::Square),
];

#[derive(Clone, Copy)]
enum Shape {
    Circle,
    Triangle,
    Square,
    Diamond,
}

/// One method with one parameter, over all of its maps.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    method: String,
    parameter: String,
    ms: f64,
    /// Mean over the maps of the mean error, in percent.
    percent: f64,
}

/// Writes all charts of a sweep; those without a time (other programs' maps) have no place in them.
pub fn write_all(folder: &Path, sweep: &Sweep) -> Result<Vec<PathBuf>> {
    let mut cases: Vec<(&str, u32)> = Vec::new();
    for row in sweep.rows.iter().filter(|row| row.gpu_ms.is_some()) {
        let case = (row.panorama.as_str(), row.cube_size);
        if !cases.contains(&case) {
            cases.push(case);
        }
    }
    let mut paths = Vec::new();
    for (panorama, size) in cases {
        let stem = Path::new(panorama).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let path = folder.join(format!("precompute-{stem}-{size}.svg"));
        let rows: Vec<&Row> =
            sweep.rows.iter().filter(|row| row.panorama == panorama && row.cube_size == size).collect();
        let title = format!("Filling light maps from {stem}, cube of {size}\u{b2} texels a face");
        let caption = format!(
            "{}, {}. Error: mean over maps of the texels' mean relative error against f64 sums. Labels: samples, step \
             in radians, degree.",
            sweep.gpu, sweep.date
        );
        write_atomically(&path, draw(&rows, &title, &caption).map_err(unwritable(&path))?.as_bytes())?;
        paths.push(path);
    }
    Ok(paths)
}

fn unwritable(path: &Path) -> impl FnOnce(String) -> Error {
    let path = path.to_owned();
    move |problem| Error::Write { path, source: std::io::Error::other(problem) }
}

fn draw(rows: &[&Row], title: &str, caption: &str) -> std::result::Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let text = |e: DrawingAreaErrorKind<_>| e.to_string();
        root.fill(&WHITE).map_err(text)?;
        let root = root.titled(title, (FONT, 19)).map_err(text)?;
        let (panels, foot) = root.split_vertically(SIZE.1 - FOOT);
        legend(&foot, rows)?;
        let middle = Pos::new(HPos::Center, VPos::Center);
        let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(middle);
        foot.draw(&Text::new(caption.to_owned(), (SIZE.0 as i32 / 2, 38), style)).map_err(text)?;
        let (left, right) = panels.split_horizontally(SIZE.0 / 2);
        for (area, quantity, name) in
            [(left, Quantity::Specular, "specular levels"), (right, Quantity::Irradiance, "irradiance")]
        {
            panel(&area, &points(rows, quantity), name).map_err(|e| e.to_string())?;
        }
        root.present().map_err(text)?;
    }
    Ok(svg)
}

fn points(rows: &[&Row], quantity: Quantity) -> Vec<Point> {
    let mut points: Vec<(Point, f64)> = Vec::new();
    for row in rows.iter().filter(|row| row.quantity == quantity) {
        let Some(ms) = row.gpu_ms else { continue };
        match points.iter_mut().find(|(p, _)| p.method == row.method && p.parameter == row.parameter) {
            Some((point, count)) => {
                point.percent += 100.0 * row.error.mean;
                *count += 1.0;
            }
            None => {
                let (method, parameter) = (row.method.clone(), row.parameter.clone());
                points.push((Point { method, parameter, ms, percent: 100.0 * row.error.mean }, 1.0));
            }
        }
    }
    let mean = |(point, count): (Point, f64)| Point { percent: point.percent / count, ..point };
    // A logarithm has no place for 0, nor a chart for what did not end well.
    points.into_iter().map(mean).filter(|p| p.ms > 0.0 && p.percent > 0.0 && p.percent.is_finite()).collect()
}

/// Those that no other beats in both time and error, fastest first.
fn front(points: &[Point]) -> Vec<&Point> {
    let mut sorted: Vec<&Point> = points.iter().collect();
    sorted.sort_by(|a, b| a.ms.total_cmp(&b.ms).then(a.percent.total_cmp(&b.percent)));
    let mut least = f64::INFINITY;
    sorted.retain(|p| {
        let better = p.percent < least;
        least = least.min(p.percent);
        better
    });
    sorted
}

type Area<'a, 'b> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn panel(area: &Area<'_, '_>, points: &[Point], name: &str) -> Drawn<()> {
    if points.is_empty() {
        return Ok(());
    }
    let (x, y) = (range(points.iter().map(|p| p.ms)), range(points.iter().map(|p| p.percent)));
    let mut chart = ChartBuilder::on(area)
        .caption(name, (FONT, 15))
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("GPU time, ms")
        .y_desc("mean relative error, %")
        .max_light_lines(0)
        .x_labels(40)
        .y_labels(40)
        .bold_line_style(BLACK.mix(0.1))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .x_label_formatter(&|v| tick(*v, x))
        .y_label_formatter(&|v| tick(*v, y))
        .draw()?;
    let best: Vec<(f64, f64)> = front(points).iter().map(|p| (p.ms, p.percent)).collect();
    chart.draw_series(LineSeries::new(best.iter().copied(), FRONT.stroke_width(7)))?;
    chart.draw_series(best.iter().map(|at| Circle::new(*at, 9, FRONT.stroke_width(2))))?;
    for (method, colour, shape) in LOOKS {
        let own: Vec<&Point> = points.iter().filter(|p| p.method == method).collect();
        if own.is_empty() {
            continue;
        }
        chart.draw_series(LineSeries::new(own.iter().map(|p| (p.ms, p.percent)), colour.mix(0.6)))?;
        chart.draw_series(own.iter().map(|p| EmptyElement::at((p.ms, p.percent)) + marker((0, 0), colour, shape)))?;
        let style = (FONT, 11).into_font().color(&BLACK.mix(0.8)).pos(Pos::new(HPos::Left, VPos::Bottom));
        chart
            .draw_series(own.iter().map(|p| {
                EmptyElement::at((p.ms, p.percent)) + Text::new(p.parameter.clone(), (6, -5), style.clone())
            }))?;
    }
    Ok(())
}

/// One line that names the Pareto front and every method there is a row of.
fn legend(area: &Area<'_, '_>, rows: &[&Row]) -> std::result::Result<(), String> {
    let text = |e: DrawingAreaErrorKind<_>| e.to_string();
    let known = LOOKS.into_iter().filter(|(method, ..)| rows.iter().any(|row| row.method == *method));
    let style = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let write = |name: &str, x: i32| area.draw(&Text::new(name.to_owned(), (x, 14), style.clone()));
    let mut x = 40;
    area.draw(&PathElement::new([(x - 7, 14), (x + 7, 14)], FRONT.stroke_width(7))).map_err(text)?;
    write("Pareto front", x + 14).map_err(text)?;
    x += 36 + 12 * LETTER;
    for (method, colour, shape) in known {
        area.draw(&marker((x, 14), colour, shape)).map_err(text)?;
        write(method, x + 12).map_err(text)?;
        x += 34 + method.len() as i32 * LETTER;
    }
    Ok(())
}

/// A filled mark around a point, in pixels.
fn marker(at: (i32, i32), colour: RGBColor, shape: Shape) -> Polygon<(i32, i32)> {
    let corners: &[(i32, i32)] = match shape {
        Shape::Circle => &[(-3, -6), (3, -6), (6, -3), (6, 3), (3, 6), (-3, 6), (-6, 3), (-6, -3)],
        Shape::Triangle => &[(0, -6), (6, 5), (-6, 5)],
        Shape::Square => &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
        Shape::Diamond => &[(0, -6), (6, 0), (0, 6), (-6, 0)],
    };
    Polygon::new(corners.iter().map(|(x, y)| (at.0 + x, at.1 + y)).collect::<Vec<_>>(), colour.filled())
}

/// An axis around positive values; it begins at a power of ten, below whose first the ticks would be missing.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)));
    (10f64.powf((low / 1.15).log10().floor()), high * 1.8)
}

/// A tick's label with as few digits as tell it; empty where a logarithmic axis over `range` would be too crowded.
fn tick(value: f64, range: (f64, f64)) -> String {
    let decade = value.log10().floor();
    let mantissa = (value / 10f64.powf(decade)).round() as u32;
    let shown: &[u32] = if range.1 / range.0 > 3000.0 { &[1, 10] } else { &[1, 2, 5, 10] };
    if !shown.contains(&mantissa) {
        return String::new();
    }
    let digits = (-decade).max(0.0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(ms: f64, percent: f64) -> Point {
        Point { method: "ours".into(), parameter: String::new(), ms, percent }
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [point(2.0, 3.0), point(1.0, 5.0), point(3.0, 4.0), point(4.0, 1.0), point(4.0, 2.0)];
        let front: Vec<(f64, f64)> = front(&points).iter().map(|p| (p.ms, p.percent)).collect();
        assert_eq!(front, [(1.0, 5.0), (2.0, 3.0), (4.0, 1.0)]);
    }

    #[test]
    fn ticks_are_short() {
        let near = [0.01, 0.2, 1.0, 30.0, 50.0, 1000.0].map(|v| tick(v, (1.0, 100.0)));
        assert_eq!(near, ["0.01", "0.2", "1", "", "50", "1000"]);
        let far = [0.1, 0.2, 1.0, 50.0, 10_000.0].map(|v| tick(v, (0.1, 10_000.0)));
        assert_eq!(far, ["0.1", "", "1", "", "10000"]);
    }
}
