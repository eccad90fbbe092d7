//! Charts as SVG: panels of series over a logarithmic x axis and a logarithmic or named y axis, a legend, and a numbered key.

use std::path::Path;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::asset::file::write_atomically;
use crate::{Error, Result};

/// Okabe and Ito's palette, which colour-blind readers tell apart, and grey.
const COLOURS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    GREY,
];
const GREY: RGBColor = RGBColor(140, 140, 140);
const FONT: &str = "sans-serif";
const WIDTH: i32 = 1000;
/// Height of a panel with a logarithmic y axis, and of a line of one with names.
const HEIGHT: i32 = 400;
const NAME_HEIGHT: i32 = 26;
/// Around a panel's plot: title, x axis, y axis.
const ABOVE: i32 = 30;
const BELOW: i32 = 46;
const BESIDE: i32 = 62;
const LINE: i32 = 15;
/// Width of a letter of 12 pixels, about; the backend has no fonts to measure with.
const LETTER: i32 = 7;
/// Width of a panel beside a key.
const WIDTH_BESIDE_KEY: i32 = 760;
/// Values smaller than the largest one by this factor count as zero.
const DECADES: f64 = 1e-4;

/// A chart.
#[derive(Default)]
pub struct Plot {
    pub title: String,
    /// Side by side.
    pub panels: Vec<Panel>,
    /// Lines below.
    pub caption: Vec<String>,
    /// Lines beside the panels: a number (empty for headings) and its text.
    pub key: Vec<(String, String)>,
}

/// One pair of axes.
pub struct Panel {
    pub title: String,
    pub x_label: String,
    pub y: YAxis,
    pub series: Vec<Series>,
    /// A dashed line: an error that is too small to be measured, on x where y has names, else on y.
    pub floor: Option<f64>,
}

pub enum YAxis {
    /// Logarithmic, with a label.
    Log(String),
    /// A line for each name from the top; y is its index.
    Names(Vec<String>),
}

/// Points that look alike. Names appear in the legend, once each.
#[derive(Clone, Default)]
pub struct Series {
    pub name: String,
    /// Index into the palette of seven; the last is grey.
    pub colour: usize,
    pub mark: Mark,
    /// Whether points are joined.
    pub joined: bool,
    pub points: Vec<Point>,
}

#[derive(Clone, Copy, Default, PartialEq)]
pub enum Mark {
    #[default]
    Circle,
    Ring,
    /// No mark: a broad line alone.
    Band,
}

#[derive(Clone, Default)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    /// Ends of error bars.
    pub x_range: Option<[f64; 2]>,
    pub y_range: Option<[f64; 2]>,
    pub label: String,
}

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;
type Pixel = (i32, i32);

impl Plot {
    /// Writes `NAME.svg`.
    pub fn write(&self, folder: &Path, name: &str) -> Result<()> {
        // Names may hold dots: `with_extension` would cut them.
        let path = folder.join(format!("{name}.svg"));
        let svg = self.draw().map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
        write_atomically(&path, svg.as_bytes())
    }

    /// The SVG text.
    pub fn draw(&self) -> Drawn<String> {
        let tallest =
            self.panels.iter().map(Panel::height).max().unwrap_or(0).max(ABOVE + LINE * self.key.len() as i32);
        let top = 54;
        let height = top + tallest + LINE * self.caption.len() as i32 + 14;
        let right = if self.key.is_empty() { WIDTH } else { WIDTH_BESIDE_KEY };
        let longest = self.key.iter().map(|(_, text)| text.chars().count() as i32).max();
        let width = right + longest.map_or(0, |letters| 5 * letters + 50);
        let mut svg = String::new();
        {
            let canvas = Canvas(SVGBackend::with_string(&mut svg, (width as u32, height as u32)).into_drawing_area());
            canvas.0.fill(&WHITE)?;
            canvas.text(&self.title, (width / 2, 18), 19, BLACK, HPos::Center)?;
            for (series, x) in self.legend() {
                canvas.mark((x, 44), series)?;
                canvas.text(&series.name, (x + 12, 44), 13, BLACK, HPos::Left)?;
            }
            let panel_width = right / self.panels.len().max(1) as i32;
            for (i, panel) in (0..).zip(&self.panels) {
                canvas.panel(panel, (i * panel_width, top), panel_width)?;
            }
            for (i, (number, text)) in (0..).zip(&self.key) {
                let y = top + ABOVE + LINE * i;
                canvas.text(number, (right + 28, y), 11, BLACK, HPos::Right)?;
                canvas.text(text, (right + if number.is_empty() { 10 } else { 36 }, y), 11, BLACK, HPos::Left)?;
            }
            for (i, line) in (0..).zip(&self.caption) {
                canvas.text(line, (20, top + tallest + 8 + LINE * i), 12, RGBColor(60, 60, 60), HPos::Left)?;
            }
            canvas.0.present()?;
        }
        Ok(svg)
    }

    /// Each name once, and where its mark stands.
    fn legend(&self) -> Vec<(&Series, i32)> {
        let (mut places, mut x): (Vec<(&Series, i32)>, i32) = (Vec::new(), 40);
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !places.iter().any(|(other, _)| other.name == series.name) {
                places.push((series, x));
                x += 40 + LETTER * series.name.chars().count() as i32;
            }
        }
        places
    }
}

impl Panel {
    /// With a line for each name, in the order in which they come. Points of the same name and mark are one series; `known` are
    /// the names of other panels' series, to which this one's are added: a name's place there is its colour.
    pub fn named(
        title: &str,
        x_label: &str,
        known: &mut Vec<String>,
        points: impl Iterator<Item = (String, Mark, String, Point)>,
    ) -> Self {
        let (mut lines, mut all): (Vec<String>, Vec<Series>) = Default::default();
        for (name, mark, line, point) in points {
            let [y, colour] = [(&mut lines, line), (&mut *known, name.clone())].map(|(known, new)| {
                known.iter().position(|old| *old == new).unwrap_or_else(|| {
                    known.push(new);
                    known.len() - 1
                })
            });
            let point = Point { y: y as f64, ..point };
            match all.iter_mut().find(|series| series.name == name && series.mark == mark) {
                Some(series) => series.points.push(point),
                None => all.push(Series { name, colour, mark, joined: false, points: vec![point] }),
            }
        }
        let (title, x_label) = (title.to_owned(), x_label.to_owned());
        Self { title, x_label, y: YAxis::Names(lines), series: all, floor: None }
    }

    fn height(&self) -> i32 {
        match &self.y {
            YAxis::Log(_) => HEIGHT,
            YAxis::Names(names) => ABOVE + BELOW + NAME_HEIGHT * names.len() as i32,
        }
    }

    fn points(&self) -> impl Iterator<Item = &Point> {
        self.series.iter().flat_map(|series| &series.points)
    }

    /// Ranges of both axes; of names, from half a line above the first to half a line below the last.
    fn ranges(&self) -> Option<[(f64, f64); 2]> {
        let named = matches!(self.y, YAxis::Names(_));
        let ends = |range: Option<[f64; 2]>| range.into_iter().flatten();
        let x = self.points().flat_map(|p| ends(p.x_range).chain([p.x])).chain(self.floor.filter(|_| named));
        let y = match &self.y {
            YAxis::Names(names) => Some((names.len() as f64 - 0.5, -0.5)),
            YAxis::Log(_) => round_range(self.points().map(|p| p.y).chain(self.floor)),
        };
        Some([round_range(x)?, y?])
    }
}

/// Maps values to the canvas.
struct Axes {
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
    x: (f64, f64),
    y: (f64, f64),
    named: bool,
}

impl Axes {
    fn at(&self, x: f64, y: f64) -> Pixel {
        let log = |v: f64, (low, high): (f64, f64)| (v.clamp(low, high) / low).ln() / (high / low).ln();
        let linear = |v: f64, (low, high): (f64, f64)| (v - low) / (high - low);
        let (u, v) = (log(x, self.x), if self.named { linear(y, self.y) } else { log(y, self.y) });
        let along = |share: f64, from: i32, to: i32| from + (share * f64::from(to - from)).round() as i32;
        (along(u, self.left, self.right), along(v, self.bottom, self.top))
    }
}

struct Canvas<'a>(DrawingArea<SVGBackend<'a>, Shift>);

impl Canvas<'_> {
    fn text(&self, text: &str, at: Pixel, size: i32, colour: RGBColor, side: HPos) -> Drawn<()> {
        let style = (FONT, size).into_font().color(&colour).pos(Pos::new(side, VPos::Center));
        Ok(self.0.draw(&Text::new(text.to_owned(), at, style))?)
    }

    fn line(&self, points: Vec<Pixel>, style: impl Into<ShapeStyle>) -> Drawn<()> {
        Ok(self.0.draw(&PathElement::new(points, style))?)
    }

    fn mark(&self, at @ (x, y): Pixel, series: &Series) -> Drawn<()> {
        let colour = COLOURS[series.colour % COLOURS.len()];
        match series.mark {
            Mark::Circle => Ok(self.0.draw(&Circle::new(at, 5, colour.filled()))?),
            Mark::Ring => Ok(self.0.draw(&Circle::new(at, 4, colour.stroke_width(2)))?),
            Mark::Band => self.line(vec![(x - 8, y), (x + 8, y)], colour.mix(0.25).stroke_width(7)),
        }
    }

    fn panel(&self, panel: &Panel, (left, top): Pixel, width: i32) -> Drawn<()> {
        let Some([x, y]) = panel.ranges() else { return Ok(()) };
        let names: &[String] = if let YAxis::Names(names) = &panel.y { names } else { &[] };
        let beside = names.iter().map(|name| LETTER * name.chars().count() as i32 + 10).max().unwrap_or(BESIDE);
        let (right, bottom) = (left + width - 20, top + panel.height() - BELOW);
        let named = !names.is_empty();
        let axes = Axes { left: left + beside, right, top: top + ABOVE, bottom, x, y, named };
        self.axes(panel, &axes)?;
        for (i, name) in names.iter().enumerate() {
            self.text(name, (axes.left - 8, axes.at(x.0, i as f64).1), 12, BLACK, HPos::Right)?;
        }
        let (mut labels, mut taken) = (Vec::new(), Vec::new());
        let mut colours: Vec<usize> = panel.series.iter().map(|series| series.colour).collect();
        colours.sort_unstable();
        colours.dedup();
        let place = |series: &Series| colours.iter().position(|colour| *colour == series.colour).unwrap_or(0);
        for series in &panel.series {
            // Side by side within a name's line, by colour.
            let aside = if named { 0.8 * (place(series) as f64 + 0.5) / colours.len() as f64 - 0.4 } else { 0.0 };
            for (point, at) in self.series(series, &axes, aside)? {
                taken.push(at);
                labels.push((&point.label, at));
            }
        }
        for (label, at) in labels.into_iter().filter(|(label, _)| !label.is_empty()) {
            let place = free_place(at, &taken);
            if distance(place, at) > BESIDE_MARK {
                self.line(vec![at, place], BLACK.mix(0.15))?;
            }
            taken.push(place);
            self.text(label, place, 11, BLACK, HPos::Center)?;
        }
        Ok(())
    }

    /// Grid, ticks, titles and the floor.
    fn axes(&self, panel: &Panel, axes: &Axes) -> Drawn<()> {
        let Axes { left, right, top, bottom, x, y, named } = *axes;
        let (middle, grid) = ((left + right) / 2, BLACK.mix(0.1));
        self.text(&panel.title, (middle, top - 20), 15, BLACK, HPos::Center)?;
        self.text(&panel.x_label, (middle, bottom + 36), 13, BLACK, HPos::Center)?;
        for tick in ticks(x, (right - left) / 40) {
            let at = axes.at(tick, y.0).0;
            self.line(vec![(at, top), (at, bottom)], grid)?;
            self.text(&tick_label(tick), (at, bottom + 14), 12, BLACK, HPos::Center)?;
        }
        if let YAxis::Log(label) = &panel.y {
            for tick in ticks(y, (bottom - top) / 20) {
                let at = axes.at(x.0, tick).1;
                self.line(vec![(left, at), (right, at)], grid)?;
                self.text(&tick_label(tick), (left - 8, at), 12, BLACK, HPos::Right)?;
            }
            let style = (FONT, 13).into_font().transform(FontTransform::Rotate270).color(&BLACK);
            let style = style.pos(Pos::new(HPos::Center, VPos::Center));
            self.0.draw(&Text::new(label.clone(), (left - BESIDE + 12, (top + bottom) / 2), style))?;
        }
        self.line(vec![(left, top), (left, bottom), (right, bottom)], BLACK.mix(0.6))?;
        if let Some(floor) = panel.floor.filter(|floor| *floor > 0.0) {
            let ends = if named { [(floor, y.0), (floor, y.1)] } else { [(x.0, floor), (x.1, floor)] };
            let ends = ends.map(|(x, y)| axes.at(x, y));
            self.0.draw(&DashedPathElement::new(ends, 4, 4, BLACK.mix(0.6)))?;
        }
        Ok(())
    }

    /// Draws a series; returns its points and where their marks are.
    fn series<'s>(&self, series: &'s Series, axes: &Axes, aside: f64) -> Drawn<Vec<(&'s Point, Pixel)>> {
        let colour = COLOURS[series.colour % COLOURS.len()];
        let mut marks = Vec::new();
        for point in &series.points {
            let at = axes.at(point.x, point.y + aside);
            if !(point.x >= axes.x.0 && (axes.named || point.y >= axes.y.0)) {
                if axes.named {
                    let words = if point.x > 0.0 { "less" } else { "no difference" };
                    self.text(words, (axes.left + 4, at.1), 9, GREY, HPos::Left)?;
                }
                continue;
            }
            let across = point.x_range.map(|range| range.map(|x| axes.at(x, point.y + aside)));
            let upright = point.y_range.map(|range| range.map(|y| axes.at(point.x, y)));
            for bar in [across, upright].into_iter().flatten() {
                self.line(bar.into(), colour.mix(0.5))?;
            }
            marks.push((point, at));
        }
        let path = || marks.iter().map(|(_, at)| *at).collect::<Vec<_>>();
        if series.mark == Mark::Band {
            self.line(path(), colour.mix(0.25).stroke_width(7))?;
            return Ok(Vec::new());
        }
        if series.joined {
            self.line(path(), colour.mix(0.6))?;
        }
        marks.iter().try_for_each(|(_, at)| self.mark(*at, series))?;
        Ok(marks)
    }
}

/// Pixels from a mark to a label that plainly belongs to it; one that is farther away has a line to it.
const BESIDE_MARK: f64 = 16.0;

fn distance(a: Pixel, b: Pixel) -> f64 {
    f64::from(a.0 - b.0).hypot(f64::from(a.1 - b.1))
}

/// Whether labels of two digits at these places, or a label and a mark, keep clear of each other.
fn are_clear(a: Pixel, b: Pixel) -> bool {
    (a.0 - b.0).abs() >= 15 || (a.1 - b.1).abs() >= 12
}

/// The nearest place around a mark that is clear of all that is taken; above it if there is none.
fn free_place((x, y): Pixel, taken: &[Pixel]) -> Pixel {
    const DIRECTIONS: u32 = 24;
    let ring = |away: f64| {
        // From above, clockwise.
        let angle = |i| std::f64::consts::TAU * f64::from(i) / f64::from(DIRECTIONS);
        let along = move |part: f64| (away * part).round() as i32;
        (0..DIRECTIONS).map(move |i| (x + along(angle(i).sin()), y - along(angle(i).cos())))
    };
    let mut places = [13.0, 16.0, 22.0, 30.0, 40.0, 52.0, 66.0, 82.0].into_iter().flat_map(ring);
    places.find(|at| taken.iter().all(|other| are_clear(*at, *other))).unwrap_or((x, y - 13))
}

/// 1, 2 and 5 of each decade from `low` to `high`.
fn steps(low: f64, high: f64) -> impl Iterator<Item = f64> {
    let decades = low.log10().floor() as i32 - 1..=high.log10().ceil() as i32 + 1;
    // As a quotient, so that 0.2 is the number that is written so.
    let power =
        |decade: i32, step: f64| if decade < 0 { step / 10f64.powi(-decade) } else { step * 10f64.powi(decade) };
    decades.flat_map(move |decade| [1.0, 2.0, 5.0].map(|step| power(decade, step)))
}

/// A range in round steps around all positive values; `None` without any.
fn round_range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let positive = values.filter(|v| *v > 0.0 && v.is_finite()).collect::<Vec<_>>();
    let high = positive.iter().copied().reduce(f64::max)?;
    let low = positive.iter().copied().fold(high, f64::min).max(high * DECADES);
    let (below, above) =
        (steps(low, high).filter(|v| *v <= low / 1.1).last()?, steps(low, high).find(|v| *v >= high * 1.1)?);
    Some((below, above))
}

/// Ticks of an axis with room for so many; whole decades alone where others would not fit.
fn ticks((low, high): (f64, f64), room: i32) -> impl Iterator<Item = f64> {
    let long = 3.0 * (high / low).log10() > f64::from(room);
    let round = |v: f64| (v.log10() - v.log10().round()).abs() < 1e-6;
    steps(low, high).filter(move |v| (low..=high).contains(v) && (!long || round(*v)))
}

fn tick_label(value: f64) -> String {
    let digits = (-value.log10().floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(y: YAxis, points: Vec<Point>) -> Panel {
        let series = vec![Series { name: "a & b".into(), points, ..Series::default() }];
        Panel { title: "panel".into(), x_label: "ms".into(), y, series, floor: Some(0.02) }
    }

    #[test]
    fn charts_hold_names_marks_labels_and_no_nonsense() {
        let point = |x, y| Point { x, y, label: format!("at {x}"), x_range: Some([0.9 * x, 1.1 * x]), y_range: None };
        let log = panel(YAxis::Log("FLIP".into()), vec![point(3.0, 0.1), point(20.0, 0.03), point(0.0, 0.1)]);
        let named = panel(YAxis::Names(vec!["first".into(), "second".into()]), vec![point(4.0, 0.0), point(0.0, 1.0)]);
        let key = vec![(String::new(), "heading".into()), ("7".into(), "seven".into())];
        let plot = Plot { title: "title".into(), panels: vec![log, named], caption: vec!["caption".into()], key };
        let svg = plot.draw().unwrap();
        for part in
            ["title", "panel", "ms", "FLIP", "second", "at 20", "no difference", "heading", "caption", "a &amp; b"]
        {
            assert!(svg.contains(part), "{part} in {svg}");
        }
        assert!(svg.matches("<circle").count() == 4, "three marks and the legend's");
        assert!(svg.matches("a &amp; b").count() == 1 && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(
            Plot { panels: vec![panel(YAxis::Log(String::new()), vec![])], ..Plot::default() }.draw().is_ok(),
            "an empty one"
        );
    }

    #[test]
    fn axes_and_ticks_are_round() {
        assert_eq!(round_range([0.003, 0.4].into_iter()), Some((0.002, 0.5)));
        assert_eq!(round_range([10.0, 95.0, 0.0, f64::NAN].into_iter()), Some((5.0, 200.0)));
        assert_eq!(round_range([1e-9, 10.0].into_iter()), Some((5e-4, 20.0)), "what is too small to be shown");
        assert_eq!(
            ticks((0.02, 1.0), 9).map(tick_label).collect::<Vec<_>>(),
            ["0.02", "0.05", "0.1", "0.2", "0.5", "1"]
        );
        assert_eq!(ticks((0.5, 5000.0), 9).map(tick_label).collect::<Vec<_>>(), ["1", "10", "100", "1000"]);
    }

    #[test]
    fn labels_keep_clear_of_each_other() {
        let mut taken = vec![(100, 100)];
        // As many settings as a ladder has at one time and error.
        for _ in 0..40 {
            let at = free_place((100, 100), &taken);
            assert!(taken.iter().all(|other| are_clear(at, *other)), "{at:?} in {taken:?}");
            taken.push(at);
        }
    }
}
