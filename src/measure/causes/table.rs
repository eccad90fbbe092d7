//! Rows of causes as CSV, JSON and Markdown.

use std::fmt::Write as _;
use std::path::Path;

use super::{Change, Kind, Results, Row, Swap};
use crate::asset::file::write_atomically;
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::{Error, Result};

const HEADER: &str = "kind,subject,swap,cause,is,swapped,change,error,error_swapped,falls_by,mse_change,mse_error,\
    mse_error_swapped,mse_falls_by";

/// Writes `causes.csv`, `causes.json` and `causes.md`, each whole at any time.
pub fn write(folder: &Path, results: &Results) -> Result<()> {
    let csv: String = [HEADER.to_owned()].into_iter().chain(results.rows.iter().map(line)).map(|l| l + "\n").collect();
    write_atomically(&folder.join("causes.csv"), csv.as_bytes())?;
    write_atomically(&folder.join("causes.md"), markdown(results).as_bytes())?;
    let path = folder.join("causes.json");
    let text = serde_json::to_string_pretty(results).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

fn line(row: &Row) -> String {
    let kind = if row.kind == Kind::Ball { "ball" } else { "picture" };
    let swap = match row.swap {
        Swap::ReferenceAccumulator => "exact",
        Swap::Chain => "chain",
        Swap::Other => "other",
        Swap::Whole => "whole",
        Swap::Floor => "floor",
    };
    let texts =
        [&row.subject, &row.cause, &row.is, &row.swapped].map(|text| format!("\"{}\"", text.replace('"', "\"\"")));
    let numbers = |change: Option<Change>| match change {
        Some(Change { change, error, error_swapped, falls_by }) => {
            format!("{change:.4e},{error:.4e},{error_swapped:.4e},{falls_by:.4e}")
        }
        None => ",,,".into(),
    };
    let [subject, cause, is, swapped] = texts;
    format!("{kind},{subject},{swap},{cause},{is},{swapped},{},{}", numbers(row.main), numbers(row.relative_mse))
}

/// What tables are of, and what the rows of each are.
const PARTS: [(Swap, &str, &str); 3] = [
    (
        Swap::ReferenceAccumulator,
        "One cause exact, all others as they are",
        "`change`: how far the result moves; `falls by`: how much of the error goes (below 0: it had cancelled another).",
    ),
    (
        Swap::Chain,
        "From exact to as it is, one approximation after the other",
        "`falls by`: what each adds to the error; these add up to the whole.",
    ),
    (Swap::Other, "Another setting instead", "`falls by` below 0: the other setting is worse."),
];

fn markdown(results: &Results) -> String {
    let Results { gpu, driver, date, size: [width, height], rows } = results;
    let mut text = format!(
        "# Errors by cause\n\n{gpu} ({driver}), {date}; pictures of {width}×{height}. Balls: mean over roughnesses, angles and \
         normals of the difference over the exact radiance, in %. Pictures: FLIP (as seen with {PIXELS_PER_DEGREE} pixels \
         per degree), and relative MSE of display light. ReferenceAccumulator: each pixel's radiance averaged, then the tone curve (the \
         ladder averages after it).\n"
    );
    let mut subjects: Vec<&str> = Vec::new();
    for row in rows.iter().filter(|row| row.main.is_some()) {
        if !subjects.contains(&row.subject.as_str()) {
            subjects.push(&row.subject);
        }
    }
    for subject in subjects {
        let own = |swap| rows.iter().filter(move |row| row.subject == subject && row.swap == swap);
        let _ = write!(text, "\n## {subject}\n\n");
        for row in own(Swap::Whole).chain(own(Swap::Floor)) {
            let name = if row.swap == Swap::Whole { "The whole error" } else { "What the exact one is good to" };
            let _ = writeln!(text, "{name}: {}.  ", values(row, |change| change.error));
        }
        for (swap, title, meaning) in PARTS.iter().filter(|(swap, ..)| own(*swap).next().is_some()) {
            let _ = write!(
                text,
                "\n### {title}\n\n{meaning}\n\n| cause | is | swapped for | change | falls by |\n|---|---|---|---|---|\n"
            );
            let mut rows: Vec<&Row> = own(*swap).collect();
            if *swap == Swap::ReferenceAccumulator {
                rows.sort_by(|a, b| size_of_change(b).total_cmp(&size_of_change(a)));
            }
            for row in rows {
                let (change, falls) = (values(row, |c| c.change), values(row, |c| c.falls_by));
                let _ = writeln!(text, "| {} | {} | {} | {change} | {falls} |", row.cause, row.is, row.swapped);
            }
        }
    }
    text
}

/// In the units of the row's kind.
fn values(row: &Row, of: impl Fn(&Change) -> f64) -> String {
    match (row.kind, &row.main, &row.relative_mse) {
        (Kind::Ball, Some(main), _) => format!("{:.3} %", 100.0 * of(main)),
        (Kind::Picture, Some(main), Some(mse)) => format!("FLIP {:.4}, MSE {:.1e}", of(main), of(mse)),
        (_, None, Some(mse)) => format!("MSE {:.1e}", of(mse)),
        _ => String::new(),
    }
}

fn size_of_change(row: &Row) -> f64 {
    row.main.map_or(0.0, |main| main.change)
}

/// A line for each subject that names its largest causes.
pub fn largest(rows: &[Row]) -> Vec<String> {
    let whole = rows.iter().filter(|row| row.swap == Swap::Whole);
    whole
        .map(|whole| {
            let mut own: Vec<&Row> = rows
                .iter()
                .filter(|row| row.subject == whole.subject && row.swap == Swap::ReferenceAccumulator)
                .collect();
            own.sort_by(|a, b| size_of_change(b).total_cmp(&size_of_change(a)));
            let most: Vec<String> = own
                .iter()
                .take(3)
                .map(|row| format!("{} ({})", row.cause, values(row, |change| change.change)))
                .collect();
            format!("{}: {} in all; most by {}", whole.subject, values(whole, |change| change.error), most.join(", "))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::gpu_tests::rows;
    use super::*;

    #[test]
    fn lines_have_the_header_s_columns_and_tables_are_sorted() {
        let rows = rows();
        for row in &rows {
            // Texts are quoted; those of the test hold no commas.
            assert_eq!(line(row).split(',').count(), HEADER.split(',').count(), "{}", line(row));
        }
        let results =
            Results { gpu: "a GPU".into(), driver: "d".into(), date: "2026-01-01".into(), size: [8, 4], rows };
        let text = markdown(&results);
        let place = |part: &str| text.find(part).unwrap_or_else(|| panic!("no {part} in {text}"));
        assert!(place("| large |") < place("| small |"));
        assert!(place("67 pixels per degree") < place("averaged, then the tone curve"));
        assert!(place("## a scene") > 0 && place("The whole error") > 0 && !text.contains("NaN"));
        let lines = largest(&results.rows);
        assert!(lines[0].contains("most by large"), "{lines:?}");
    }
}
