//! Errors by cause: what each approximation alone does to a sphere's light and to a scene's picture.

mod chart;
mod picture;
mod sweep;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::clock::today;
use super::{MeasureRequest, synthetic};
use crate::asset::file::write_atomically;
use crate::asset::{Panorama, Report, shipped};
use crate::gpu::{Gpu, GpuOptions};
use crate::{Error, Result, say};
use picture::Subject;
use sweep::{CAUSES, Parts, sweep};

/// Pictured where no scene is named.
const SCENES: [&str; 2] = ["sphere", "teapot"];
/// The shipped panorama that spheres stand in, and what its file is reduced to: exact sums take long.
const SHIPPED: &str = "panoramas/courtyard.exr";
const WIDTH: u32 = 256;

/// What one approximation does to the light of spheres under one panorama: over roughnesses, angles and materials.
#[derive(Clone, Debug, Serialize)]
pub struct SweepRow {
    pub panorama: String,
    pub cause: &'static str,
    pub swapped: &'static str,
    /// |error| over the exact radiance: its mean, and what 95 of 100 points stay below.
    pub mean: f64,
    pub p95: f64,
}

/// What one approximation changes in a scene's picture.
#[derive(Clone, Debug, Serialize)]
pub struct PictureRow {
    pub scene: String,
    pub cause: &'static str,
    /// What it is exchanged for.
    pub swapped: &'static str,
    /// Mean FLIP of what a viewer sees.
    pub flip: f64,
    /// Of linear radiance.
    pub relative_mse: f64,
}

/// Everything that was measured.
#[derive(Serialize)]
struct Results {
    gpu: String,
    driver: String,
    date: String,
    size: [u32; 2],
    sweep: Vec<SweepRow>,
    pictures: Vec<PictureRow>,
}

/// Measures, and after each row writes `causes-sweep.csv`, `causes.csv`, `causes.json`, `causes.md` and `causes.svg`.
pub fn run(request: &MeasureRequest<'_>, gpu: GpuOptions<'_>, report: &Report) -> Result<()> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let (size, frames, turns) = if request.full { ([1280, 720], 512, 12) } else { ([384, 216], 128, 1) };
    let size = request.picture.unwrap_or(size);
    let (name, driver) = (gpu.info().name.clone(), gpu.info().driver.clone());
    let mut results = Results { gpu: name, driver, date: today(), size, sweep: vec![], pictures: vec![] };
    let (panoramas, scenes) = (panoramas()?, scenes(request)?);
    let bar = report.stage("causes", (panoramas.len() + scenes.len()) as u64);
    for panorama in &panoramas {
        let parts = sweep(panorama, turns);
        results.sweep.extend((0..CAUSES.len()).map(|cause| sweep_row(&panorama.name, cause, &parts)));
        results.write(request.output)?;
        bar.inc(1);
    }
    for path in &scenes {
        let subject = Subject::new(&gpu, path, size, request.cache, report)?;
        subject.measure(frames, |row| {
            results.pictures.push(row);
            results.write(request.output)
        })?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    results.lines().iter().for_each(|line| say!("{line}"));
    drop(gpu);
    messages.check()
}

/// A sky with a sun, and the shipped panorama, small.
fn panoramas() -> Result<[Panorama; 2]> {
    let shipped = Panorama::load(&shipped::folder()?.join(SHIPPED), &Report::silent())?;
    Ok([synthetic::panorama(WIDTH, true), reduced(&shipped)].map(grey))
}

/// At most [`WIDTH`] texels across, each the mean of a block.
fn reduced(panorama: &Panorama) -> Panorama {
    let step = (panorama.width / WIDTH).max(1);
    let (width, height) = (panorama.width / step, panorama.height / step);
    let mean = |i: u32| {
        let (x, y) = (i % width * step, i / width * step);
        let at = |k: u32| panorama.texels[((y + k / step) * panorama.width + x + k % step) as usize];
        let sum = (0..step * step).map(at).fold([0.0; 3], |sum, t| [sum[0] + t[0], sum[1] + t[1], sum[2] + t[2]]);
        sum.map(|c| c / (step * step) as f32)
    };
    Panorama { name: panorama.name.clone(), width, height, texels: (0..width * height).map(mean).collect() }
}

fn grey(panorama: Panorama) -> Panorama {
    let texels = panorama.texels.iter().map(|[r, g, b]| [(r + g + b) / 3.0; 3]).collect();
    Panorama { texels, ..panorama }
}

fn scenes(request: &MeasureRequest<'_>) -> Result<Vec<PathBuf>> {
    if !request.scenes.is_empty() {
        return Ok(request.scenes.to_vec());
    }
    let folder = shipped::folder()?.join("scenes");
    Ok(SCENES.iter().map(|name| folder.join(name).with_extension("toml")).collect())
}

fn sweep_row(panorama: &str, index: usize, parts: &[Parts]) -> SweepRow {
    let mut errors: Vec<f64> = parts.iter().map(|parts| parts[index].abs()).collect();
    errors.sort_by(f64::total_cmp);
    let count = errors.len().max(1);
    let (cause, swapped) = CAUSES[index];
    SweepRow {
        panorama: panorama.to_owned(),
        cause,
        swapped,
        mean: errors.iter().sum::<f64>() / count as f64,
        p95: errors.get((0.95 * (count - 1) as f64).ceil() as usize).copied().unwrap_or(0.0),
    }
}

const SWEEP_HEADER: &str = "panorama,cause,swapped,mean,p95";
const PICTURE_HEADER: &str = "scene,cause,swapped,flip,relative_mse";

impl SweepRow {
    fn line(&self) -> String {
        let Self { panorama, cause, swapped, mean, p95 } = self;
        format!("{panorama},\"{cause}\",\"{swapped}\",{mean:.6},{p95:.6}")
    }
}

impl PictureRow {
    fn line(&self) -> String {
        let Self { scene, cause, swapped, flip, relative_mse } = self;
        format!("{scene},\"{cause}\",\"{swapped}\",{flip:.6},{relative_mse:.4e}")
    }
}

impl Results {
    fn lines(&self) -> Vec<String> {
        self.sweep.iter().map(SweepRow::line).chain(self.pictures.iter().map(PictureRow::line)).collect()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let table = |header: &str, lines: Vec<String>| [vec![header.to_owned()], lines].concat().join("\n") + "\n";
        let sweep = table(SWEEP_HEADER, self.sweep.iter().map(SweepRow::line).collect());
        write_atomically(&folder.join("causes-sweep.csv"), sweep.as_bytes())?;
        let pictures = table(PICTURE_HEADER, self.pictures.iter().map(PictureRow::line).collect());
        write_atomically(&folder.join("causes.csv"), pictures.as_bytes())?;
        write_atomically(&folder.join("causes.md"), self.markdown().as_bytes())?;
        let path = folder.join("causes.json");
        let json = serde_json::to_string_pretty(self).map_err(|e| Error::write(&path)(e.into()))?;
        write_atomically(&path, (json + "\n").as_bytes())?;
        chart::write(folder, &self.sweep, &self.pictures, &format!("{}, {}", self.gpu, self.date))
    }

    fn markdown(&self) -> String {
        let Self { gpu, driver, date, size: [width, height], .. } = self;
        let mut text = format!(
            "# Errors by cause\n\n{gpu} ({driver}), {date}.\n\n## Light of spheres, in f64\n\nOver the exact radiance.\n\n\
             | panorama | cause | what stands for the exact | mean | 95 of 100 below |\n|---|---|---|---|---|\n"
        );
        for SweepRow { panorama, cause, swapped, mean, p95 } in &self.sweep {
            text += &format!("| {panorama} | {cause} | {swapped} | {:.3} % | {:.3} % |\n", 100.0 * mean, 100.0 * p95);
        }
        text += &format!(
            "\n## Pictures, {width}×{height}\n\n| scene | cause | what for what | FLIP | relative MSE |\n|---|---|---|---|---|\n"
        );
        for PictureRow { scene, cause, swapped, flip, relative_mse } in &self.pictures {
            text += &format!("| {scene} | {cause} | {swapped} | {flip:.5} | {relative_mse:.2e} |\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_their_headers_columns_and_their_numbers() {
        let parts: Vec<Parts> = (0..101).map(|i| [f64::from(i) / 100.0 - 0.5; CAUSES.len()]).collect();
        let row = sweep_row("a sky", 2, &parts);
        assert!((row.mean - 0.25).abs() < 0.01 && (0.46..=0.5).contains(&row.p95), "{row:?}");
        // Quoted texts have commas of their own.
        let columns = |line: &str| line.split('"').step_by(2).map(|part| part.matches(',').count()).sum::<usize>();
        assert_eq!(columns(&row.line()), columns(SWEEP_HEADER));
        let row = PictureRow { scene: "s".into(), cause: "c", swapped: "a, b", flip: 0.5, relative_mse: 1e-3 };
        assert_eq!(columns(&row.line()), columns(PICTURE_HEADER));
    }

    #[test]
    fn reduced_panoramas_keep_their_mean() {
        let panorama = Panorama::from_fn(1024, 512, |d| glam::Vec3::splat(1.0 + d.y));
        let small = reduced(&panorama);
        assert_eq!([small.width, small.height], [256, 128]);
        let mean = |p: &Panorama| p.texels.iter().map(|t| f64::from(t[0])).sum::<f64>() / p.texels.len() as f64;
        assert!((mean(&small) - mean(&panorama)).abs() < 1e-5);
    }
}
