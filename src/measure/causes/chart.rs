//! A chart of errors by cause: bars, largest first, for spheres on the left and for pictures on the right.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::picture::NOISE;
use super::{PictureRow, SweepRow};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 470);
const FONT: &str = "sans-serif";
/// From Okabe and Ito's palette, which colour-blind readers tell apart: for the first, second and further subjects.
const COLOURS: [RGBColor; 3] = [RGBColor(213, 94, 0), RGBColor(0, 114, 178), RGBColor(0, 158, 115)];

type Drawn<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// One bar: whose, what for, how long.
struct Bar<'a> {
    subject: &'a str,
    cause: &'a str,
    value: f64,
}

/// Writes `causes.svg`.
pub fn write(folder: &Path, sweep: &[SweepRow], pictures: &[PictureRow], caption: &str) -> Result<()> {
    let path = folder.join("causes.svg");
    let svg = draw(sweep, pictures, caption).map_err(|e| Error::write(&path)(std::io::Error::other(e.to_string())))?;
    write_atomically(&path, svg.as_bytes())
}

fn draw(sweep: &[SweepRow], pictures: &[PictureRow], caption: &str) -> Drawn<String> {
    let left: Vec<Bar<'_>> =
        sweep.iter().map(|r| Bar { subject: &r.panorama, cause: r.cause, value: 100.0 * r.mean }).collect();
    let right: Vec<Bar<'_>> =
        pictures.iter().map(|r| Bar { subject: &r.scene, cause: r.cause, value: r.flip }).collect();
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (top, foot) = root.titled("Errors by cause", (FONT, 19))?.split_vertically(SIZE.1 - 60);
        let (first, second) = top.split_horizontally(SIZE.0 / 2);
        panel(&first, &left, "spheres: mean error of radiance, %")?;
        panel(&second, &right, "pictures: mean FLIP of the change")?;
        let style = (FONT, 12).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(HPos::Center, VPos::Center));
        let text = format!("{caption}. Each cause alone: all else is the same in what is compared.");
        foot.draw(&Text::new(text, (SIZE.0 as i32 / 2, 16), style))?;
        root.present()?;
    }
    Ok(svg)
}

/// In the order in which they first come.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.fold(Vec::new(), |mut seen, name| {
        if !seen.contains(&name) {
            seen.push(name);
        }
        seen
    })
}

fn panel(area: &DrawingArea<SVGBackend<'_>, Shift>, bars: &[Bar<'_>], axis: &str) -> Drawn<()> {
    let largest = |cause: &str| bars.iter().filter(|b| b.cause == cause).map(|b| b.value).fold(0.0, f64::max);
    let mut causes = distinct(bars.iter().map(|bar| bar.cause));
    causes.sort_by(|a, b| largest(b).total_cmp(&largest(a)));
    let Some(most) = causes.first().map(|cause| largest(cause)).filter(|most| *most > 0.0) else { return Ok(()) };
    // Four decades; what is less has no bar.
    let (least, most) = (10f64.powf(most.log10().ceil() - 4.0), 10f64.powf(most.log10().ceil()));
    let subjects = distinct(bars.iter().map(|bar| bar.subject));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(24)
        .x_label_area_size(40)
        .y_label_area_size(190)
        .build_cartesian_2d((least..most).log_scale(), -0.5..causes.len() as f64 - 0.5)?;
    chart
        .configure_mesh()
        .x_desc(axis)
        .max_light_lines(0)
        .disable_y_mesh()
        .y_labels(0)
        .x_labels(6)
        .bold_line_style(BLACK.mix(0.12))
        .label_style((FONT, 12))
        .axis_desc_style((FONT, 13))
        .x_label_formatter(&|value| format!("{value}"))
        .draw()?;
    let style = (FONT, 12).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
    let height = 0.8 / subjects.len() as f64;
    for (i, cause) in causes.iter().enumerate() {
        let middle = (causes.len() - 1 - i) as f64;
        let name = Text::new((*cause).to_owned(), (-8, 0), style.clone());
        chart.plotting_area().draw(&(EmptyElement::at((least, middle)) + name))?;
        for bar in bars.iter().filter(|bar| bar.cause == *cause && bar.value > least) {
            let at = subjects.iter().position(|subject| *subject == bar.subject).unwrap_or(0);
            let top = middle + 0.4 - height * at as f64;
            let colour = COLOURS[at.min(COLOURS.len() - 1)].mix(if *cause == NOISE { 0.4 } else { 1.0 });
            chart.draw_series([Rectangle::new([(least, top), (bar.value, top - 0.9 * height)], colour.filled())])?;
        }
    }
    let style = (FONT, 12).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
    let (right, bottom) = area.dim_in_pixel();
    for (i, subject) in subjects.iter().enumerate() {
        let y = bottom as i32 - 110 + 17 * i as i32;
        let colour = COLOURS[i.min(COLOURS.len() - 1)];
        area.draw(&Rectangle::new([(right as i32 - 44, y - 5), (right as i32 - 34, y + 5)], colour.filled()))?;
        area.draw(&Text::new((*subject).to_owned(), (right as i32 - 50, y), style.clone()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::sweep::CAUSES;
    use super::*;

    #[test]
    fn every_cause_has_its_name_and_every_number_its_bar() {
        let sweep: Vec<SweepRow> = (1..)
            .zip(CAUSES)
            .map(|(i, (cause, swapped))| {
                let (panorama, mean) = ("a sky".to_owned(), 0.01 / f64::from(i));
                SweepRow { panorama, cause, swapped, mean, p95: 2.0 * mean }
            })
            .collect();
        let picture =
            |scene: &str, cause, flip| PictureRow { scene: scene.into(), cause, swapped: "b", flip, relative_mse: 0.0 };
        let pictures = [picture("ball", "edges", 0.02), picture("pot", "edges", 0.03), picture("pot", "table", 0.0)];
        let svg = draw(&sweep, &pictures, "a GPU").unwrap();
        for part in ["half floats", "edges", "a sky", "ball", "pot", "a GPU"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        let bars = svg.matches(r##"fill="#D55E00""##).count() + svg.matches(r##"fill="#0072B2""##).count();
        // One for each number above 0, and one for each subject in a legend.
        assert_eq!(bars, CAUSES.len() + 2 + 3, "{svg}");
        assert!(draw(&[], &[], "").is_ok());
    }
}
