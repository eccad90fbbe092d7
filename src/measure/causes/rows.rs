//! Results of ablations, their table and chart.

use std::path::Path;

use serde::Serialize;

use super::super::machine::Machine;
use super::super::plot::{Mark, Panel, Plot, Point};
use super::super::report::{write_json, write_table};
use crate::Result;
use crate::reference::metrics::PIXELS_PER_DEGREE;

/// The kind of comparison of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ablation {
    /// The default against the exact result.
    Whole,
    /// The error of the exact result itself.
    Floor,
    /// The default with one approximation replaced by its exact form.
    Exact,
    /// The default with one setting replaced.
    Other,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    Ball,
    /// A picture's shading, where nothing blocks light or gives it back.
    Picture,
    /// A picture's light between things.
    Light,
}

/// One ablation of one subject. Numbers are, for balls, the mean of |difference| over the exact radiance, in %; for
/// pictures, FLIP.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub kind: Kind,
    /// A panorama and a material, or a scene.
    pub subject: String,
    pub ablation: Ablation,
    pub cause: String,
    pub default: String,
    pub replacement: String,
    /// Difference of both results.
    pub change: f64,
    /// Against the exact result: by default, and with the replacement.
    pub error: f64,
    pub error_replaced: f64,
    /// Their difference; below 0 where two causes had cancelled each other.
    pub gain: f64,
}

impl Row {
    /// `words`: the cause, the default, and what replaces it; `numbers`: change, error and error with the replacement.
    pub fn new(kind: Kind, subject: &str, ablation: Ablation, words: [&str; 3], numbers: [f64; 3]) -> Self {
        let ([cause, default, replacement], subject) = (words.map(str::to_owned), subject.to_owned());
        let [change, error, error_replaced] = numbers;
        let gain = error - error_replaced;
        Self { kind, subject, ablation, cause, default, replacement, change, error, error_replaced, gain }
    }
}

#[derive(Serialize)]
pub struct Results {
    #[serde(flatten)]
    pub machine: Machine,
    /// The pictures' size.
    pub size: [u32; 2],
    pub rows: Vec<Row>,
}

impl Results {
    /// Writes `causes.csv`, `causes.json` and `causes.md`.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let columns = "subject ablation cause default replacement change error gain";
        let mut notes = self.notes();
        notes.push(
            "`change`: difference of both results, of balls in %, of pictures FLIP. `gain`: what is gone of the error; below 0 it had \
             cancelled another, or the other setting is worse."
                .into(),
        );
        write_table(folder, "causes", &notes, &self.rows, columns)?;
        write_json(folder, "causes", self)
    }

    fn notes(&self) -> Vec<String> {
        let Machine { gpu, date, .. } = &self.machine;
        vec![
            "Filled (exact): one approximation is replaced by its exact form, all others stay. Rings (other): by another setting."
                .into(),
            "Dashed (floor): noise of the reference, in all together, split sum and light.".into(),
            format!(
                "{gpu}, {date}. References: radiance averaged, then the tone curve. FLIP as seen with {PIXELS_PER_DEGREE} \
                 pixels per degree."
            ),
        ]
    }

    /// A line for each subject that names its largest cause.
    pub fn largest(&self) -> Vec<String> {
        let line = |whole: &Row| {
            let causes = self.rows.iter().filter(|r| r.kind == whole.kind && r.subject == whole.subject);
            let causes = causes.filter(|r| r.ablation == Ablation::Exact);
            let most = causes.max_by(|a, b| a.change.total_cmp(&b.change));
            let most = most.map_or(String::new(), |most| format!("; most by {} ({:.4})", most.cause, most.change));
            let unit = match whole.kind {
                Kind::Ball => "error in %",
                Kind::Picture => "shading alone, FLIP",
                Kind::Light => "all light, FLIP",
            };
            format!("{}: {unit} {:.4}{most}", whole.subject, whole.change)
        };
        self.rows.iter().filter(|row| row.ablation == Ablation::Whole).map(line).collect()
    }

    /// The change of the result for each cause; balls under all panoramas on the left, pictures on the right.
    pub fn plot(&self) -> Plot {
        let [width, height] = self.size;
        let (ball, picture) =
            ("mean relative difference of radiance, %", format!("mean FLIP, pictures of {width}×{height}"));
        let mut names = Vec::new();
        let panels = [
            (Kind::Ball, "balls", ball),
            (Kind::Picture, "shading alone", &picture),
            (Kind::Light, "light between things", &picture),
        ]
        .map(|(kind, title, unit)| self.panel(kind, title, unit, &mut names));
        let panels = panels.into_iter().filter(|panel| !panel.series.is_empty()).collect();
        let title = "What each approximation changes".into();
        Plot { title, panels, caption: self.notes(), key: Vec::new() }
    }

    /// Largest changes first.
    fn panel(&self, kind: Kind, title: &str, unit: &str, names: &mut Vec<String>) -> Panel {
        let of = |floor| self.rows.iter().filter(move |r| r.kind == kind && (r.ablation == Ablation::Floor) == floor);
        let mut rows: Vec<&Row> = of(false).collect();
        rows.sort_by(|a, b| a.ablation.cmp(&b.ablation).then(b.change.total_cmp(&a.change)));
        let point = |row: &&Row| {
            let (line, mark) = match row.ablation {
                Ablation::Other => (format!("{}: {}", row.cause, row.replacement), Mark::Ring),
                _ => (row.cause.clone(), Mark::Circle),
            };
            let series = row.subject.rsplit(", ").next().unwrap_or_default().to_owned();
            (series, mark, line, Point { x: row.change, ..Point::default() })
        };
        let floor = of(true).map(|row| row.change).reduce(f64::max);
        Panel { floor, ..Panel::named(title, unit, names, rows.iter().map(point)) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::plot::YAxis;
    use super::*;

    /// One large and one small cause of a ball and of a picture, and what stands beside them.
    fn results() -> Results {
        let mut rows = Vec::new();
        for (kind, subject) in [(Kind::Ball, "sky, metal"), (Kind::Picture, "a scene")] {
            for (ablation, cause, size) in [
                (Ablation::Whole, "all", 0.05),
                (Ablation::Floor, "floor", 0.0004),
                (Ablation::Exact, "small", 0.001),
                (Ablation::Exact, "large", 0.04),
                (Ablation::Other, "large", 0.07),
                (Ablation::Exact, "none", 0.0),
            ] {
                rows.push(Row::new(kind, subject, ablation, [cause, "a", "exact"], [size, 0.05, 0.03]));
            }
        }
        let machine = Machine { gpu: "a GPU".into(), driver: "d".into(), date: "2026-01-01".into() };
        Results { machine, size: [64, 48], rows }
    }

    /// Also where it is the only one of a panel.
    #[test]
    fn a_scene_has_one_colour() {
        let mut results = results();
        for (kind, subject) in [(Kind::Picture, "another"), (Kind::Light, "another")] {
            results.rows.push(Row::new(kind, subject, Ablation::Whole, ["all", "a", "exact"], [0.02, 0.02, 0.0]));
        }
        let plot = results.plot();
        let colours = plot.panels.iter().map(|panel| {
            let of = |name: &str| panel.series.iter().find(|series| series.name == name).map(|series| series.colour);
            ["metal", "a scene", "another"].map(of)
        });
        let all = [[Some(0), None, None], [None, Some(1), Some(2)], [None, None, Some(2)]];
        assert_eq!(colours.collect::<Vec<_>>(), all);
    }

    #[test]
    fn the_chart_has_a_line_for_each_cause_and_a_mark_for_each_value() {
        let lines = results().largest();
        assert!(lines[0].starts_with("sky, metal: error in % 0.0500; most by large (0.0400)"), "{lines:?}");
        let plot = results().plot();
        let YAxis::Names(names) = &plot.panels[0].y else { unreachable!() };
        assert_eq!(names.as_slice(), ["all", "large", "small", "none", "large: exact"]);
        assert_eq!(plot.panels[0].floor, Some(0.0004));
        let svg = plot.draw().unwrap();
        // Four of each panel, and two of the legend; what changes nothing is written.
        assert!(
            svg.matches("<circle").count() == 10 && svg.contains("no difference") && svg.contains("64×48"),
            "{svg}"
        );
    }
}
