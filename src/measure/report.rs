//! Results as files: rows that serde can write become CSV and Markdown tables; whole results become JSON.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::asset::file::write_atomically;
use crate::{Error, Result};

/// What results call a file: its name without folder and ending.
pub fn stem(path: impl AsRef<Path>) -> String {
    path.as_ref().file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes `NAME.json`.
pub fn write_json(folder: &Path, name: &str, value: &impl Serialize) -> Result<()> {
    let path = folder.join(name).with_extension("json");
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

/// Writes `NAME.csv`, and the same below notes as `NAME.md`. `columns` are names of the rows' fields, separated by
/// spaces; fields of nested structs and elements of arrays are joined by `_`.
pub fn write_table<T: Serialize>(folder: &Path, name: &str, notes: &[String], rows: &[T], columns: &str) -> Result<()> {
    let path = folder.join(name).with_extension("csv");
    let columns: Vec<&str> = columns.split(' ').collect();
    let cells = rows.iter().map(|row| cells(row, &columns)).collect::<serde_json::Result<Vec<_>>>();
    let lines = [columns.iter().map(|column| (*column).to_owned()).collect()];
    let lines: Vec<Vec<String>> = lines.into_iter().chain(cells.map_err(|e| Error::write(&path)(e.into()))?).collect();
    write_atomically(&path, csv(&lines).as_bytes())?;
    let text = format!("# {name}\n\n{}\n\n{}", notes.join("\n\n"), markdown(&lines));
    write_atomically(&folder.join(name).with_extension("md"), text.as_bytes())
}

fn cells(row: &impl Serialize, columns: &[&str]) -> serde_json::Result<Vec<String>> {
    let row = serde_json::to_value(row)?;
    Ok(columns.iter().map(|column| find(&row, column).unwrap_or_default()).collect())
}

/// The value of a column; `None` for what is `None`.
fn find(value: &Value, column: &str) -> Option<String> {
    let below = |name: &str, value: &Value| find(value, column.strip_prefix(name)?.trim_start_matches('_'));
    match value {
        Value::Object(fields) => fields.iter().find_map(|(name, value)| below(name, value)),
        Value::Array(items) => items.iter().enumerate().find_map(|(i, value)| below(&i.to_string(), value)),
        _ if !column.is_empty() => None,
        Value::Null => None,
        Value::String(text) => Some(text.clone()),
        // Five digits.
        Value::Number(number) if number.is_f64() => {
            let value = number.as_f64()?;
            Some(format!("{value:.4e}").parse::<f64>().unwrap_or(value).to_string())
        }
        other => Some(other.to_string()),
    }
}

fn markdown(lines: &[Vec<String>]) -> String {
    let lines: Vec<String> = lines.iter().map(|cells| format!("| {} |\n", cells.join(" | "))).collect();
    let columns = lines[0].matches(" | ").count() + 1;
    format!("{}|{}\n{}", lines[0], "---|".repeat(columns), lines[1..].concat())
}

/// RFC 4180: what holds commas, quotes or line ends is quoted.
fn csv(lines: &[Vec<String>]) -> String {
    let quoted = |cell: &String| {
        let needs = cell.contains([',', '"', '\n']);
        if needs { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.clone() }
    };
    lines.iter().map(|cells| cells.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_the_columns_that_were_asked_for() {
        #[derive(Serialize)]
        struct Row {
            name: &'static str,
            size: [u32; 2],
            size_limit: Option<[f64; 2]>,
        }
        let rows = [
            Row { name: "a, \"b\"", size: [3, 4], size_limit: Some([0.1 + 0.2, 1.234_567e-5]) },
            Row { name: "c", size: [5, 6], size_limit: None },
        ];
        let folder = tempfile::tempdir().unwrap();
        write_table(folder.path(), "t", &["note".into()], &rows, "name size_1 size_limit_0 size_limit_1").unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let expected = "name,size_1,size_limit_0,size_limit_1\n\"a, \"\"b\"\"\",4,0.3,0.000012346\nc,6,,\n";
        assert_eq!(read("t.csv"), expected);
        assert!(
            read("t.md").ends_with(
                "note\n\n| name | size_1 | size_limit_0 | size_limit_1 |\n|---|---|---|---|\n\
            | a, \"b\" | 4 | 0.3 | 0.000012346 |\n| c | 6 |  |  |\n"
            ),
            "{}",
            read("t.md")
        );
    }
}
