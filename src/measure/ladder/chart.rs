//! A ladder as a chart: error over time, both logarithmic, its Pareto front, and every setting by number.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Ladder, Rung};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const WIDTH: u32 = 980;
/// Of the chart alone; the list beside it may be longer.
const HEIGHT: u32 = 540;
/// Of title and caption together.
const FRAME: u32 = 90;
/// Width of the list beside the chart.
const LIST: u32 = 400;
const LINE: i32 = 14;
/// Characters of a setting that fit on a line of the list.
const COLUMNS: usize = 46;
const FONT: &str = "sans-serif";
// Okabe and Ito's palette, which colour-blind readers tell apart; what is beaten is also hollow.
const FRONT: RGBColor = RGBColor(0, 114, 178);
const DEFAULT: RGBColor = RGBColor(213, 94, 0);
const BEATEN: RGBColor = RGBColor(140, 140, 140);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Writes `ladder-SCENE.svg`.
pub fn write(folder: &Path, ladder: &Ladder) -> Result<()> {
    let path = folder.join(format!("ladder-{}.svg", ladder.scene));
    let svg = draw(ladder).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())
}

fn draw(ladder: &Ladder) -> Drawn<String> {
    // A logarithm has no place for 0.
    let mut rungs: Vec<&Rung> = ladder.rungs.iter().filter(|rung| rung.ms > 0.0 && rung.error.flip > 0.0).collect();
    rungs.sort_by(|a, b| place(a).cmp(&place(b)).then(a.ms.total_cmp(&b.ms)));
    let mut svg = String::new();
    {
        let height = HEIGHT.max(list_height(&rungs));
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height + FRAME)).into_drawing_area();
        root.fill(&WHITE)?;
        let title = format!("{}: time and error of every setting", ladder.scene);
        let below = root.titled(&title, (FONT, 19))?;
        let (top, foot) = below.split_vertically(height);
        caption(&foot, ladder)?;
        let (left, right) = top.split_horizontally(WIDTH - LIST);
        list(&right, &rungs)?;
        if !rungs.is_empty() {
            panel(&root, &left.split_vertically(HEIGHT).0, ladder, &rungs)?;
        }
        root.present()?;
    }
    Ok(svg)
}

fn panel(root: &Area<'_>, area: &Area<'_>, ladder: &Ladder, rungs: &[&Rung]) -> Drawn<()> {
    let times = around(rungs.iter().map(|rung| rung.ms));
    let floor = ladder.exact.floor.flip;
    let errors = around(rungs.iter().map(|rung| rung.error.flip).chain((floor > 0.0).then_some(floor)));
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(62)
        .build_cartesian_2d((times.0..times.1).log_scale(), (errors.0..errors.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(match ladder.time.as_str() {
            "GPU time" => "GPU time of a frame, ms".to_owned(),
            ratio => format!("time of a frame, ms: the default's GPU time, times the ratio of {ratio}s"),
        })
        .y_desc("error against the exact picture, mean FLIP")
        .x_labels(20)
        .y_labels(20)
        .max_light_lines(0)
        .bold_line_style(BLACK.mix(0.08))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .x_label_formatter(&|ms| tick(*ms))
        .y_label_formatter(&|flip| tick(*flip))
        .draw()?;
    if floor > 0.0 {
        chart.draw_series(DashedLineSeries::new([(times.0, floor), (times.1, floor)], 4, 4, BLACK.mix(0.5).into()))?;
        let style = (FONT, 11).into_font().color(&BLACK.mix(0.7)).pos(Pos::new(HPos::Left, VPos::Bottom));
        let at = chart.backend_coord(&(times.0, floor));
        root.draw(&Text::new("what is left of the exact picture's own error", (at.0 + 6, at.1 - 3), style))?;
    }
    let front: Vec<(f64, f64)> =
        rungs.iter().filter(|rung| place(rung) == Place::Front).map(|rung| (rung.ms, rung.error.flip)).collect();
    chart.draw_series(LineSeries::new(front, FRONT.mix(0.35).stroke_width(4)))?;
    let mut places = Vec::new();
    for rung in rungs {
        let unit = rung.ms / rung.ratio.median;
        let bar = [(rung.ratio.low * unit, rung.error.flip), (rung.ratio.high * unit, rung.error.flip)];
        let bar = bar.map(|(ms, flip)| (ms.clamp(times.0, times.1), flip));
        let noise = [rung.error.flip - rung.flip_noise, rung.error.flip + rung.flip_noise];
        let noise = noise.map(|flip| (rung.ms, flip.clamp(errors.0, errors.1)));
        chart.draw_series([bar, noise].map(|line| PathElement::new(line, colour(rung).mix(0.45))))?;
        places.push(chart.backend_coord(&(rung.ms, rung.error.flip)));
    }
    // The default last, over the others.
    let mut order: Vec<usize> = (0..rungs.len()).collect();
    order.sort_by_key(|index| (rungs[*index].flags.is_empty(), std::cmp::Reverse(place(rungs[*index]))));
    order.iter().try_for_each(|index| mark(root, places[*index], rungs[*index]))?;
    let mut taken: Vec<(i32, i32)> = places.clone();
    for (number, (rung, place)) in (1..).zip(rungs.iter().zip(&places)) {
        let at = free_place(*place, &taken);
        taken.push(at);
        let centre = Pos::new(HPos::Center, VPos::Center);
        let style = (FONT, 11).into_font().color(&ink(rung)).pos(centre);
        root.draw(&Text::new(format!("{number}"), at, style))?;
    }
    Ok(())
}

/// The place around a mark, nearest first, that is farthest from all that is taken, until one is far enough.
fn free_place((x, y): (i32, i32), taken: &[(i32, i32)]) -> (i32, i32) {
    const FAR_ENOUGH: i32 = 13;
    let ring = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];
    let distance = |at: (i32, i32)| {
        taken.iter().map(|other| (at.0 - other.0).abs().max((at.1 - other.1).abs())).min().unwrap_or(i32::MAX)
    };
    let places = [13, 20, 28, 38].into_iter().flat_map(|away| ring.map(|(u, v)| (x + u * away, y + v * away)));
    let mut best = (x, y - FAR_ENOUGH);
    for place in places {
        if distance(place) >= FAR_ENOUGH {
            return place;
        }
        if distance(place) > distance(best) {
            best = place;
        }
    }
    best
}

/// Where a setting stands.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Front,
    /// Something is better in time or error and as good in the other, as far as can be told or counts.
    Doubtful,
    Beaten,
}

fn place(rung: &Rung) -> Place {
    match (&rung.beaten_by, rung.within_noise) {
        (None, _) => Place::Front,
        (Some(_), true) => Place::Doubtful,
        (Some(_), false) => Place::Beaten,
    }
}

/// Filled on the front, a ring if that is doubtful, a thin one if it is not.
fn mark(area: &Area<'_>, at: (i32, i32), rung: &Rung) -> Drawn<()> {
    let radius = match (rung.flags.is_empty(), place(rung)) {
        (true, _) => 7,
        (false, Place::Beaten) => 4,
        (false, _) => 5,
    };
    let style = match place(rung) {
        Place::Front => colour(rung).filled(),
        Place::Doubtful => colour(rung).stroke_width(3),
        Place::Beaten => colour(rung).stroke_width(2),
    };
    area.draw(&Circle::new(at, radius, style))?;
    Ok(())
}

fn colour(rung: &Rung) -> RGBColor {
    match (rung.flags.is_empty(), place(rung)) {
        (true, _) => DEFAULT,
        (false, Place::Beaten) => BEATEN,
        (false, _) => FRONT,
    }
}

/// Of text: what is beaten is grey, and dark enough to be read.
fn ink(rung: &Rung) -> RGBColor {
    if place(rung) == Place::Beaten && !rung.flags.is_empty() { RGBColor(110, 110, 110) } else { BLACK }
}

/// Every setting by its number, the front first, quickest first.
fn list(area: &Area<'_>, rungs: &[&Rung]) -> Drawn<()> {
    let left = Pos::new(HPos::Left, VPos::Center);
    let text = |words: &str, x: i32, y: i32, ink: RGBColor| {
        area.draw(&Text::new(words.to_owned(), (x, y), (FONT, 11).into_font().color(&ink).pos(left)))
    };
    let mut y = 12;
    let mut before = None;
    for (number, rung) in (1..).zip(rungs) {
        if before != Some(place(rung)) {
            y += if before.is_some() { LINE + 4 } else { 0 };
            let heading = match place(rung) {
                Place::Front => "On the front (settings, times the default's time, FLIP):",
                Place::Doubtful => "Beaten in one, in the other by less than noise or 1 %:",
                Place::Beaten => "Beaten in both:",
            };
            text(heading, 4, y, BLACK)?;
            before = Some(place(rung));
        }
        for (line, part) in wrapped(&words(rung)).into_iter().enumerate() {
            y += LINE - i32::from(line > 0);
            if line == 0 {
                mark(area, (12, y), rung)?;
                text(&format!("{number}"), 24, y, ink(rung))?;
            }
            text(&part, 44, y, ink(rung))?;
        }
    }
    Ok(())
}

/// What [`list`] takes, about.
fn list_height(rungs: &[&Rung]) -> u32 {
    let lines: usize = rungs.iter().map(|rung| wrapped(&words(rung)).len()).sum();
    (lines as u32 + 5) * LINE as u32
}

/// A setting with what it takes and how far off it is.
fn words(rung: &Rung) -> String {
    let Rung { ratio, error, flip_noise, .. } = rung;
    let noise = if rung.flags.is_empty() { String::new() } else { format!(" ± {flip_noise:.5}") };
    format!("{} ({:.2}×, {:.4}{noise})", short(rung), ratio.median, error.flip)
}

/// A setting's flags in few words.
fn short(rung: &Rung) -> String {
    if rung.flags.is_empty() {
        return "default".into();
    }
    let words = rung.flags.trim_start_matches("--").replace(" --", ", ");
    [("irradiance-size", "irradiance"), ("cube-size", "cube"), ("drop-levels", "drop")]
        .into_iter()
        .fold(words, |words, (long, short)| words.replace(long, short))
}

/// Lines of at most [`COLUMNS`] characters, cut at spaces.
fn wrapped(words: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split(' ') {
        // `lines` is never empty.
        let Some(line) = lines.last_mut() else { break };
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= COLUMNS {
            *line += &format!(" {word}");
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

fn caption(area: &Area<'_>, ladder: &Ladder) -> Drawn<()> {
    let Ladder { gpu, date, size: [width, height], exact, .. } = ladder;
    let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Left, VPos::Center));
    let lines = [
        format!(
            "{gpu}, {date}, {width}×{height}. Level lines: from the tenth quickest frame of a hundred to the ninetieth."
        ),
        "Upright lines, and ±: what of a FLIP's difference from the default's cannot be told.".to_owned(),
        format!(
            "ReferenceAccumulator picture: {} frames of {1}×{1} times the pixels, display light (after the tone curve) averaged. FLIP as seen \
             with {2} pixels per degree.",
            exact.frames, exact.fineness, exact.pixels_per_degree
        ),
    ];
    for (y, line) in [8, 24, 40].into_iter().zip(lines) {
        area.draw(&Text::new(line, (14, y), style.clone()))?;
    }
    Ok(())
}

/// A little more than the values' range, in steps of 1, 2 and 5.
fn around(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)));
    let decade = |v: f64| 10f64.powf(v.log10().floor());
    let below = [5.0, 2.0, 1.0].iter().map(|step| step * decade(low / 1.1)).find(|v| *v <= low / 1.1);
    let above = [1.0, 2.0, 5.0, 10.0].iter().map(|step| step * decade(1.1 * high)).find(|v| *v >= 1.1 * high);
    (below.unwrap_or(low / 2.0), above.unwrap_or(2.0 * high))
}

/// 1, 2 and 5 of each decade; others would crowd.
fn tick(value: f64) -> String {
    let decade = 10f64.powf((value * 1.000_001).log10().floor());
    let round = [1.0, 2.0, 5.0].iter().any(|step| (value / decade - step).abs() < 1e-3);
    if !round {
        return String::new();
    }
    let digits = (-decade.log10()).round().max(0.0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::super::tests::ladder;
    use super::*;

    #[test]
    fn a_chart_names_and_marks_every_setting_twice() {
        let ladder = ladder(&[
            ("", 8.0, 0.010),
            ("--samples 1", 4.0, 0.020),
            ("--model everything", 9.0, 0.011),
            ("--anisotropy 4", 9.0, 0.0101),
            ("--samples 1 --scale 0.5 --cube-size 32 --irradiance-size 8 --drop-levels 4", 1.0, 0.2),
        ]);
        let svg = draw(&ladder).unwrap();
        for part in [
            "a scene",
            "a GPU",
            "samples 1",
            "GPU time of a frame, ms",
            "mean FLIP",
            "Beaten in both",
            "cube 32",
            "0.0101 ± 0.00050",
            "less than noise or 1 %",
            "67 pixels per degree",
            "display light",
        ] {
            assert!(svg.contains(part), "{part}");
        }
        assert_eq!(svg.matches("<circle").count(), 2 * ladder.rungs.len());
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(draw(&Ladder { rungs: Vec::new(), ..ladder }).is_ok(), "an empty one");
    }

    #[test]
    fn axes_and_ticks_are_round() {
        assert_eq!(around([0.003, 0.4].into_iter()), (0.002, 0.5));
        assert_eq!(around([10.0, 95.0].into_iter()), (5.0, 200.0));
        let ticks = [0.001, 0.02, 0.03, 1.0, 5.0, 700.0, 1000.0].map(tick);
        assert_eq!(ticks, ["0.001", "0.02", "", "1", "5", "", "1000"]);
    }

    #[test]
    fn numbers_keep_clear_of_each_other() {
        let mut taken = vec![(100, 100)];
        for _ in 0..8 {
            let at = free_place((100, 100), &taken);
            assert!(taken.iter().all(|o| (at.0 - o.0).abs().max((at.1 - o.1).abs()) >= 13), "{at:?} in {taken:?}");
            taken.push(at);
        }
    }

    #[test]
    fn long_settings_are_wrapped() {
        let words = "samples 1, scale 0.5, cube 32, irradiance 8, drop 4 (0.10×, 0.2000)";
        let lines = wrapped(words);
        assert!(lines.len() == 2 && lines.iter().all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        assert_eq!(lines.join(" "), words);
    }
}
