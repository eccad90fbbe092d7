//! What the second eye costs: one eye, two eyes recorded and submitted one after the other, two eyes at once.

use std::path::Path;
use std::sync::Arc;

use cpu_time::ThreadTime;
use serde::Serialize;

use super::clock::today;
use super::scenes::{SCENES, eyes_of, load_one, renderer};
use super::spread::Spread;
use super::stereo_chart;
use crate::asset::Report;
use crate::asset::file::write_atomically;
use crate::gpu::{Gpu, GpuOptions, Recorder};
use crate::render::{Eye, Renderer};
use crate::scene::Model;
use crate::{Error, Result};

const SIZE: [u32; 2] = [1512, 1680];
const QUICK_SIZE: [u32; 2] = [252, 280];
const WARM_UP: usize = 3;

/// One way to draw the eyes of one scene.
#[derive(Clone, Debug, Serialize)]
pub struct StereoRow {
    pub scene: &'static str,
    pub way: &'static str,
    /// Processor time of the thread that culls, records and submits.
    pub record_ms: Spread,
    pub gpu_ms: Spread,
    /// Medians against those of one eye.
    pub record_ratio: f64,
    pub gpu_ratio: f64,
}

/// All rows, and what they were measured on.
#[derive(Clone, Debug, Serialize)]
pub struct StereoTable {
    pub gpu: String,
    pub driver: String,
    /// UTC.
    pub date: String,
    /// Pixels of one eye's picture.
    pub size: [u32; 2],
    pub frames: usize,
    pub rows: Vec<StereoRow>,
    pub left_out: Vec<String>,
}

/// What every frame of one way took.
#[derive(Default)]
struct Taken {
    record_ms: Vec<f64>,
    gpu_ms: Vec<f64>,
}

/// The ways by name; the first is what the others are compared with.
pub const WAYS: [&str; 3] = ["mono", "two passes", "one pass"];
const HEADER: &str = "scene,way,record_p10_ms,record_median_ms,record_p90_ms,gpu_p10_ms,gpu_median_ms,gpu_p90_ms,\
                      record_ratio,gpu_ratio";

/// Measures and writes `stereo.csv`, `stereo.json` and `stereo.svg`, anew after each scene.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<StereoTable> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let (size, frames) = if full { (SIZE, 200) } else { (QUICK_SIZE, 30) };
    let (name, driver) = (gpu.info().name.clone(), gpu.info().driver.clone());
    let mut table =
        StereoTable { gpu: name, driver, date: today(), size, frames, rows: Vec::new(), left_out: Vec::new() };
    for known in SCENES.iter().filter(|known| ["tearoom", "crytek-sponza"].contains(&known.name)) {
        let scene = match load_one(&gpu, known, report) {
            Ok((scene, _)) => scene,
            Err(error) if !known.shipped => {
                println!("{}: left out: {error}", known.name);
                table.left_out.push(format!("{}: {error}", known.name));
                continue;
            }
            Err(error) => return Err(error),
        };
        let both = eyes_of(&scene, size, 2);
        let middle = eyes_of(&scene, size, 1);
        let mut one = renderer(&gpu, &scene, Model::Needed, &middle, size, report)?;
        let mut two = renderer(&gpu, &scene, Model::Needed, &both, size, report)?;
        let taken = interleaved(&gpu, &mut one, &mut two, &middle, &both, frames)?;
        let rows = rows_of(known.name, &taken);
        rows.iter().for_each(|row| print!("{}", line(row)));
        table.rows.extend(rows);
        write(folder, &table)?;
    }
    write(folder, &table)?;
    drop(gpu);
    messages.check()?;
    Ok(table)
}

/// Frames of all ways in turn, so that what else the machine does meets all of them.
fn interleaved(
    gpu: &Arc<Gpu>,
    one: &mut Renderer,
    two: &mut Renderer,
    middle: &[Eye],
    both: &[Eye],
    frames: usize,
) -> Result<[Taken; 3]> {
    let mut taken = <[Taken; 3]>::default();
    let mut recorders = [Recorder::new(gpu)?, Recorder::new(gpu)?];
    let (left, right) = both.split_at(1);
    for frame in 0..WARM_UP + frames {
        for (way, taken) in taken.iter_mut().enumerate() {
            let (record_ms, gpu_ms) = match way {
                0 => draw(one, &mut recorders, &[middle])?,
                1 => draw(one, &mut recorders, &[left, right])?,
                _ => draw(two, &mut recorders, &[both])?,
            };
            if frame >= WARM_UP {
                taken.record_ms.push(record_ms);
                taken.gpu_ms.push(gpu_ms);
            }
        }
    }
    Ok(taken)
}

/// Records and submits each pass, a recorder each, then waits; returns the thread's and the GPU's time, ms.
fn draw(renderer: &mut Renderer, recorders: &mut [Recorder], passes: &[&[Eye]]) -> Result<(f64, f64)> {
    let started = ThreadTime::now();
    for (slot, (recorder, eyes)) in recorders.iter_mut().zip(passes).enumerate() {
        let (mut commands, _) = recorder.begin()?;
        renderer.record(&mut commands, slot, eyes, None);
        commands.submit(None)?;
    }
    let record_ms = started.elapsed().as_secs_f64() * 1e3;
    let mut gpu_ms = 0.0;
    for recorder in &mut recorders[..passes.len()] {
        gpu_ms += recorder.finish()?.iter().map(|pass| pass.ms).sum::<f64>();
    }
    Ok((record_ms, gpu_ms))
}

fn rows_of(scene: &'static str, taken: &[Taken; 3]) -> Vec<StereoRow> {
    let spreads = taken.each_ref().map(|taken| (Spread::of(&taken.record_ms), Spread::of(&taken.gpu_ms)));
    let (mono_record, mono_gpu) = (spreads[0].0.median, spreads[0].1.median);
    let row = |(way, (record_ms, gpu_ms)): (&'static str, (Spread, Spread))| StereoRow {
        scene,
        way,
        record_ms,
        gpu_ms,
        record_ratio: record_ms.median / mono_record,
        gpu_ratio: gpu_ms.median / mono_gpu,
    };
    WAYS.into_iter().zip(spreads).map(row).collect()
}

fn write(folder: &Path, table: &StereoTable) -> Result<()> {
    let csv = table.rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row));
    write_atomically(&folder.join("stereo.csv"), csv.as_bytes())?;
    let path = folder.join("stereo.json");
    let json = serde_json::to_string_pretty(table).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (json + "\n").as_bytes())?;
    stereo_chart::write(folder, table)
}

fn line(row: &StereoRow) -> String {
    let StereoRow { scene, way, record_ms, gpu_ms, record_ratio, gpu_ratio } = row;
    let spread = |Spread { p10, median, p90 }: &Spread| format!("{p10:.4},{median:.4},{p90:.4}");
    let (record, gpu) = (spread(record_ms), spread(gpu_ms));
    format!("{scene},{way},{record},{gpu},{record_ratio:.3},{gpu_ratio:.3}\n")
}

#[cfg(test)]
pub mod tests {
    use super::*;

    fn taken(ms: f64) -> Taken {
        Taken { record_ms: vec![0.5 * ms; 3], gpu_ms: vec![ms; 3] }
    }

    pub fn rows() -> Vec<StereoRow> {
        rows_of("tearoom", &[taken(4.0), taken(8.0), taken(6.0)])
    }

    #[test]
    fn ratios_are_against_one_eye() {
        let ratios: Vec<[f64; 2]> = rows().iter().map(|row| [row.record_ratio, row.gpu_ratio]).collect();
        assert_eq!(ratios, [[1.0, 1.0], [2.0, 2.0], [1.5, 1.5]]);
    }

    #[test]
    fn lines_have_the_header_s_columns() {
        assert_eq!(line(&rows()[1]).split(',').count(), HEADER.split(',').count());
    }
}
