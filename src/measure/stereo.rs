//! What the second eye costs: one eye, two eyes one after the other, and both at once.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::clock::today;
use super::scenes::{self, BenchConfig};
use super::turns::{Cost, Limits, Way, take_turns};
use crate::asset::Report;
use crate::asset::file::write_atomically;
use crate::gpu::{Gpu, GpuOptions};
use crate::render::{Eye, IPD_METRES, Renderer, Shading};
use crate::{Error, Result, say};

/// One way to draw one scene.
#[derive(Clone, Debug, Serialize)]
pub struct StereoRow {
    pub scene: &'static str,
    pub way: &'static str,
    pub size_per_eye: [u32; 2],
    #[serde(flatten)]
    pub cost: Cost,
    /// Medians over those of one eye.
    pub gpu_ratio: f64,
    pub record_ratio: f64,
}

#[derive(Serialize)]
struct Results<'a> {
    gpu: &'a str,
    driver: &'a str,
    date: String,
    samples: u32,
    rows: &'a [StereoRow],
}

const HEADER: &str = "scene,way,width,height,frames,gpu_ms,gpu_ms_low,gpu_ms_high,record_ms,record_ms_low,record_ms_high,\
    gpu_ratio,record_ratio";

/// Measures the smallest and the largest scene there is; writes `stereo.csv` and `stereo.json`.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let stage = BenchConfig::new(full);
    let all = scenes::there(report)?;
    let mut rows = Vec::new();
    for known in [all.first(), all.last()].into_iter().flatten() {
        rows.extend(measure(&gpu, known, &stage)?);
        rows.iter().rev().take(3).rev().for_each(|row| say!("{}", line(row)));
        write(folder, &gpu, &rows)?;
    }
    drop(gpu);
    messages.check()
}

fn measure(gpu: &Arc<Gpu>, known: &scenes::Known, stage: &BenchConfig) -> Result<Vec<StereoRow>> {
    let report = Report::silent();
    let settings = stage.settings(gpu, None, &report);
    let scene = known.load(&settings.textures, &report)?;
    let size = stage.eye_size;
    let eye = Eye::of_camera(&scene.cameras[0], size[0] as f32 / size[1] as f32);
    let [left, right] = eye.stereo(IPD_METRES);
    let way = |eyes: u32, pictures| {
        let renderer = Renderer::new(gpu, &scene, settings.clone(), Shading::Pbr, size, eyes, &report)?;
        Ok::<_, Error>(Way { renderer, pictures })
    };
    let mut ways =
        [way(1, vec![vec![left]])?, way(1, vec![vec![left], vec![right]])?, way(2, vec![vec![left, right]])?];
    let costs = take_turns(gpu, &mut ways, Limits { least: 5, ..stage.limits })?;
    let Some(one) = costs.first().copied() else { return Ok(Vec::new()) };
    let row = |(way, cost): (&'static str, Cost)| StereoRow {
        scene: known.name,
        way,
        size_per_eye: size,
        cost,
        gpu_ratio: cost.gpu_ms.median / one.gpu_ms.median,
        record_ratio: cost.record_ms.median / one.record_ms.median,
    };
    Ok(["one eye", "two passes", "one pass"].into_iter().zip(costs).map(row).collect())
}

fn write(folder: &Path, gpu: &Gpu, rows: &[StereoRow]) -> Result<()> {
    let csv = rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row) + "\n");
    write_atomically(&folder.join("stereo.csv"), csv.as_bytes())?;
    let (name, driver) = (&gpu.info().name, &gpu.info().driver);
    let results = Results { gpu: name, driver, date: today(), samples: scenes::SAMPLES, rows };
    let path = folder.join("stereo.json");
    let text = serde_json::to_string_pretty(&results).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

fn line(row: &StereoRow) -> String {
    let StereoRow { scene, way, size_per_eye: [width, height], cost, gpu_ratio, record_ratio } = row;
    let Cost { frames, gpu_ms, record_ms, .. } = cost;
    let (g, r) = (gpu_ms, record_ms);
    format!(
        "{scene},{way},{width},{height},{frames},{:.3},{:.3},{:.3},{:.4},{:.4},{:.4},{gpu_ratio:.3},{record_ratio:.3}",
        g.median, g.low, g.high, r.median, r.low, r.high
    )
}

#[cfg(test)]
mod tests {
    use super::super::turns::Spread;
    use super::*;

    #[test]
    fn lines_have_the_header_s_columns() {
        let spread = Spread { median: 2.0, low: 1.0, high: 3.0 };
        let cost = Cost { frames: 7, gpu_ms: spread, cpu_ms: None, record_ms: spread };
        let row = StereoRow {
            scene: "teapot",
            way: "one pass",
            size_per_eye: [10, 20],
            cost,
            gpu_ratio: 1.75,
            record_ratio: 1.0,
        };
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
        assert!(line(&row).starts_with("teapot,one pass,10,20,7,2.000,1.000,3.000,"), "{}", line(&row));
        assert!(line(&row).ends_with(",1.750,1.000"), "{}", line(&row));
    }
}
