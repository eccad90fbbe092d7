//! What a frame costs: processor time of all cores while drawing, and of the one thread that records, with each saving and
//! without.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use super::ball::gold_ball;
use super::scenes;
use super::turns::{Cost, Limits, Way, take_turns};
use crate::asset::Report;
use crate::asset::file::write_atomically;
use crate::gpu::{Gpu, GpuOptions};
use crate::render::{CullOptions, Eye, IPD_METRES, Order, Renderer, Settings, Shading};
use crate::scene::Scene;
use crate::view::QualityOptions;
use crate::{Error, Result, say};

/// The picture's side. Sponza's is smaller in a quick run: recording costs the same at any size.
const SIDE: u32 = 512;
const QUICK_SIDE: u32 = 128;

/// One way to draw one scene.
#[derive(Clone, Debug, Serialize)]
pub struct FrameRow {
    pub scene: String,
    pub what: String,
    /// Pixels along each side of the picture.
    pub side: u32,
    pub eyes: usize,
    pub samples: u32,
    pub draws: usize,
    #[serde(flatten)]
    pub cost: Cost,
}

const HEADER: &str = "scene,what,side,eyes,samples,draws,frames,cpu_ms,record_ms,gpu_ms";

/// Measures and writes `frame.csv` and `frame.json`: a metal ball of 20,000 triangles under a panorama, and Crytek Sponza
/// where it is at hand.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<Vec<FrameRow>> {
    let gpu = Gpu::open(gpu)?;
    let (sponza_side, seconds) = if full { (SIDE, 30) } else { (QUICK_SIDE, 6) };
    let limits = Limits { least: 5, most: 200, time: Duration::from_secs(seconds) };
    let all = CullOptions::default();
    let ball = gold_ball(0.3);
    let ways = [
        ("default", all),
        ("back faces drawn", CullOptions { backs: false, ..all }),
        ("back faces drawn, order as listed", CullOptions { backs: false, order: Order::Listed, ..all }),
    ];
    let mut rows = measure(&gpu, "metal ball", &ball, [SIDE, 1, 1], &ways, limits)?;
    write(folder, &rows)?;
    rows.extend(measure(&gpu, "metal ball", &ball, [SIDE, 1, 4], &ways[..1], limits)?);
    if let Some(known) = scenes::there(report)?.iter().find(|known| known.name == "crytek-sponza") {
        let textures = QualityOptions::default().settings(&gpu, None, report).textures;
        let sponza = known.load(&textures, report)?;
        let ways = [
            ("default", all),
            ("order as listed", CullOptions { order: Order::Listed, ..all }),
            ("no frustum culling", CullOptions { frusta: false, ..all }),
            ("back faces drawn", CullOptions { backs: false, ..all }),
            ("nothing saved", CullOptions { frusta: false, backs: false, order: Order::Listed }),
        ];
        write(folder, &rows)?;
        rows.extend(measure(&gpu, known.name, &sponza, [sponza_side, 1, 1], &ways, limits)?);
        write(folder, &rows)?;
        rows.extend(measure(&gpu, known.name, &sponza, [sponza_side, 2, 1], &ways[..1], limits)?);
    }
    write(folder, &rows)?;
    Ok(rows)
}

/// Draws a scene in several ways by turns, in pictures of a side of so many pixels, for so many eyes, with so many samples.
fn measure(
    gpu: &Arc<Gpu>,
    name: &str,
    scene: &Scene,
    [side, eye_count, samples]: [u32; 3],
    culling: &[(&str, CullOptions)],
    limits: Limits,
) -> Result<Vec<FrameRow>> {
    let report = Report::silent();
    let settings = Settings { samples, ..QualityOptions::default().settings(gpu, None, &report) };
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    let eyes = if eye_count == 2 { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] };
    let mut ways = Vec::new();
    for (_, culling) in culling {
        let size = [side; 2];
        let mut renderer = Renderer::new(gpu, scene, settings.clone(), Shading::Pbr, size, eye_count, &report)?;
        *renderer.culling() = *culling;
        ways.push(Way { renderer, pictures: vec![eyes.clone()] });
    }
    let costs = take_turns(gpu, &mut ways, limits)?;
    let row = |(((what, _), cost), way): (((&&str, _), Cost), &Way)| FrameRow {
        scene: name.to_owned(),
        what: (*what).to_owned(),
        side,
        eyes: eyes.len(),
        samples,
        draws: way.renderer.draw_counts()[0],
        cost,
    };
    let named = culling.iter().map(|(what, culling)| (what, culling));
    let rows: Vec<FrameRow> = named.zip(costs).zip(&ways).map(row).collect();
    rows.iter().for_each(|row| say!("{}", line(row)));
    Ok(rows)
}

fn write(folder: &Path, rows: &[FrameRow]) -> Result<()> {
    let csv = rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row) + "\n");
    write_atomically(&folder.join("frame.csv"), csv.as_bytes())?;
    let path = folder.join("frame.json");
    let json = serde_json::to_string_pretty(rows).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, json.as_bytes())
}

/// Medians.
fn line(row: &FrameRow) -> String {
    let FrameRow { scene, what, side, eyes, samples, draws, cost } = row;
    let Cost { frames, gpu_ms, cpu_ms, record_ms } = cost;
    let cpu_ms = cpu_ms.map_or(String::new(), |ms| format!("{:.2}", ms.median));
    let (gpu_ms, record_ms) = (gpu_ms.median, record_ms.median);
    format!("{scene},\"{what}\",{side},{eyes},{samples},{draws},{frames},{cpu_ms},{record_ms:.4},{gpu_ms:.2}")
}

#[cfg(test)]
mod tests {
    use super::super::turns::Spread;
    use super::*;

    #[test]
    fn lines_have_the_header_s_columns() {
        let spread = |median| Spread { median, low: 0.0, high: 9.0 };
        let cost = Cost { frames: 7, cpu_ms: None, record_ms: spread(0.25), gpu_ms: spread(3.0) };
        let (scene, what) = ("ball".to_owned(), "default".to_owned());
        let row = FrameRow { scene, what, side: 512, eyes: 1, samples: 4, draws: 5, cost };
        assert_eq!(line(&row), "ball,\"default\",512,1,4,5,7,,0.2500,3.00");
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
    }
}
