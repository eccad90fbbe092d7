//! A sweep's rows: to CSV as they come, to JSON at the end.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::texels::Accuracy;
use crate::precompute::alternatives::Quantity;
use crate::{Error, Result};

/// One map of one method.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub panorama: String,
    /// Texels along a face of the environment's cube.
    pub cube_size: u32,
    pub method: String,
    /// Samples, step in radians, or degree; empty for methods without.
    pub parameter: String,
    pub quantity: Quantity,
    pub level: u32,
    pub alpha: f64,
    /// Texels along a face of this map.
    pub face_size: u32,
    /// How many texels were judged.
    pub judged: usize,
    #[serde(flatten)]
    pub error: Accuracy,
    /// GPU time for all of this quantity's maps together, cube and mips included.
    pub gpu_ms: Option<f64>,
    /// Processor time of the process over the same; for `ours` over the whole stage, upload and pipelines included.
    pub cpu_ms: Option<f64>,
}

/// A finished sweep.
#[derive(Clone, Debug, Serialize)]
pub struct Sweep {
    pub gpu: String,
    pub driver: String,
    /// UTC.
    pub date: String,
    pub error: &'static str,
    pub rows: Vec<Row>,
    pub charts: Vec<PathBuf>,
    pub warnings: Vec<String>,
}

const HEADER: &str =
    "panorama,cube_size,method,parameter,quantity,level,alpha,face_size,judged,mean,p95,max,gpu_ms,cpu_ms";

/// A CSV file that holds every row as soon as it is known.
pub struct Csv {
    path: PathBuf,
    file: File,
}

impl Csv {
    pub fn new(path: &Path) -> Result<Self> {
        let mut file = File::create(path).map_err(Error::write(path))?;
        writeln!(file, "{HEADER}").map_err(Error::write(path))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Adds rows and hands them to the system.
    pub fn add(&mut self, rows: &[Row]) -> Result<()> {
        let text: String = rows.iter().map(line).collect();
        self.file.write_all(text.as_bytes()).and_then(|()| self.file.flush()).map_err(Error::write(&self.path))
    }
}

fn line(row: &Row) -> String {
    let ms = |ms: Option<f64>| ms.map_or(String::new(), |ms| format!("{ms:.3}"));
    let quantity = match row.quantity {
        Quantity::Specular => "specular",
        Quantity::Irradiance => "irradiance",
    };
    let Row { panorama, cube_size, method, parameter, level, alpha, face_size, judged, error, .. } = row;
    let Accuracy { mean, p95, max } = error;
    let (gpu_ms, cpu_ms) = (ms(row.gpu_ms), ms(row.cpu_ms));
    let panorama = quoted(panorama);
    format!(
        "{panorama},{cube_size},{method},{parameter},{quantity},{level},{alpha:.6},{face_size},{judged},{mean:.6e},{p95:.6e},{max:.6e},{gpu_ms},{cpu_ms}\n"
    )
}

/// RFC 4180: names of files may hold commas and quotes.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_the_header_s_columns() {
        let row = Row {
            panorama: "a \"b\"".into(),
            cube_size: 256,
            method: "ours".into(),
            parameter: String::new(),
            quantity: Quantity::Specular,
            level: 1,
            alpha: 0.5,
            face_size: 128,
            judged: 96,
            error: Accuracy { mean: 0.001, p95: 0.002, max: 0.003 },
            gpu_ms: Some(1.5),
            cpu_ms: None,
        };
        let text = line(&row);
        assert_eq!(text.trim_end().split(',').count(), HEADER.split(',').count());
        assert!(text.starts_with("\"a \"\"b\"\"\",256,ours,,specular,1,0.500000,128,96,1.000000e-3,"), "{text}");
        assert!(text.ends_with(",1.500,\n"), "{text}");
    }
}
