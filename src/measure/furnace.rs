//! The white furnace: surfaces that absorb nothing, under light that is even all around, must come out as bright as it; drawn
//! by the renderer as it is, scattering once and as often as it takes. And what the second costs.
//!
//! The renderer's sum under even light is 1 by construction, whatever its table holds: F0 A + B, and the rest of 1. That the
//! BRDF itself gives that back is shown by sampling it: `furnace_integrated`.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use glam::{Mat4, Vec3};
use serde::Serialize;

use super::ball::gold_ball;
use super::clock::today;
use super::furnace_integrated::{self, Integrated};
use super::turns::{Cost, Limits, Way, take_turns};
use super::{furnace_picture, scenes};
use crate::asset::file::write_atomically;
use crate::asset::{Panorama, Report};
use crate::gpu::{CommandBuffer, Gpu, GpuOptions, Subresource, read_image};
use crate::reference::energy::Scattering;
use crate::render::{Eye, FRAMES_IN_FLIGHT, Output, Renderer, Settings, Shading};
use crate::scene::{Bounds, Environment, Instance, Material, Mesh, Scene, Vertex};
use crate::view::QualityOptions;
use crate::{Error, Result, say};

const ROUGHNESSES: usize = 21;
const METALNESSES: usize = 11;
const VIEWS: usize = 16;
/// Pixels along a patch's side; its middle is looked at.
const PATCH: usize = 4;

/// Surfaces and sides: roughnesses and, within each, views along a line; a line for each material.
pub struct Grid {
    /// From 0 to 1.
    pub roughnesses: usize,
    /// n·v from 1 / views to 1.
    pub views: usize,
    /// Albedo, the same in all channels, and metalness.
    pub lines: Vec<[f32; 2]>,
}

/// Both ways of scattering, in the order of [`FurnaceRow::reflected`].
pub const WAYS: [Scattering; 2] = [Scattering::Single, Scattering::Multiple];

/// One surface seen from one side.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FurnaceRow {
    pub roughness: f64,
    pub metallic: f64,
    pub n_dot_v: f64,
    /// Share of the light that comes back, scattering once and more often: 1 is right.
    pub reflected: [f64; 2],
}

/// What scattering more than once costs in one scene.
#[derive(Clone, Debug, Serialize)]
pub struct CostRow {
    pub scene: String,
    pub single: Cost,
    pub multiple: Cost,
    /// Medians of GPU time, multiple over single; where the GPU is the CPU, of processor time.
    pub ratio: f64,
}

/// Everything that was measured, as `furnace.json` has it.
#[derive(Debug, Serialize)]
pub struct Furnace {
    pub gpu: String,
    pub driver: String,
    pub date: String,
    pub summary: Summary,
    pub integrated: Integrated,
    pub costs: Vec<CostRow>,
    pub rows: Vec<FurnaceRow>,
}

/// The furnace in three numbers for each way of scattering, single first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Furthest from 1.
    pub off: [f64; 2],
    pub least: [f64; 2],
    pub most: [f64; 2],
}

impl Summary {
    fn of(rows: &[FurnaceRow]) -> Self {
        let over = |start: f64, fold: fn(f64, f64) -> f64| {
            [0, 1].map(|way| rows.iter().map(|row| row.reflected[way]).fold(start, fold))
        };
        let (least, most) = (over(f64::INFINITY, f64::min), over(f64::NEG_INFINITY, f64::max));
        Self { off: [0, 1].map(|way| (1.0 - least[way]).max(most[way] - 1.0)), least, most }
    }
}

/// Measures and writes `furnace.csv`, `furnace-integrated.csv`, `furnace.json` and `furnace.png`.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<Furnace> {
    let gpu = Gpu::open(gpu)?;
    let messages = gpu.messages();
    let rows = rows(&gpu)?;
    let summary = Summary::of(&rows);
    for (way, name) in ["single scattering", "multiple scattering"].into_iter().enumerate() {
        let [off, least, most] = [summary.off[way], summary.least[way], summary.most[way]];
        say!("{name}: {least:.4} to {most:.4} of the light comes back, off by {:.2} % at most", 100.0 * off);
    }
    furnace_picture::make(&gpu)?.write(&folder.join("furnace.png"))?;
    let integrated = furnace_integrated::run(&gpu, folder, report)?;
    let (name, driver) = (gpu.info().name.clone(), gpu.info().driver.clone());
    let mut furnace = Furnace { gpu: name, driver, date: today(), summary, integrated, costs: vec![], rows };
    write(folder, &furnace)?;
    furnace.costs = costs(&gpu, full, report)?;
    write(folder, &furnace)?;
    drop(gpu);
    messages.check()?;
    Ok(furnace)
}

/// All surfaces from all sides.
fn rows(gpu: &Arc<Gpu>) -> Result<Vec<FurnaceRow>> {
    let lines = (0..METALNESSES).map(|line| [1.0, share(line, METALNESSES)]).collect();
    let grid = Grid { roughnesses: ROUGHNESSES, views: VIEWS, lines };
    let scene = patches(&grid);
    let [single, multiple] = WAYS.map(|scattering| draw(gpu, &scene, grid.pixels(PATCH), 1, scattering));
    let pictures = [single?, multiple?];
    let mut rows = Vec::new();
    for (line, [_, metallic]) in grid.lines.iter().enumerate() {
        for column in 0..grid.columns() {
            let [roughness, n_dot_v] = grid.at(column).map(f64::from);
            let at = (line * PATCH + PATCH / 2) * grid.columns() * PATCH + column * PATCH + PATCH / 2;
            // White on white: all channels are alike.
            let reflected = [0, 1].map(|way| f64::from(pictures[way][at][0]));
            rows.push(FurnaceRow { roughness, metallic: f64::from(*metallic), n_dot_v, reflected });
        }
    }
    Ok(rows)
}

/// The i-th of so many numbers from 0 to 1.
fn share(i: usize, count: usize) -> f32 {
    i as f32 / (count - 1) as f32
}

impl Grid {
    pub fn columns(&self) -> usize {
        self.roughnesses * self.views
    }

    /// Roughness and n·v of a patch.
    pub fn at(&self, column: usize) -> [f32; 2] {
        [share(column / self.views, self.roughnesses), (column % self.views + 1) as f32 / self.views as f32]
    }

    /// The picture's size with patches of so many pixels.
    pub fn pixels(&self, patch: usize) -> [u32; 2] {
        [self.columns(), self.lines.len()].map(|s| (s * patch) as u32)
    }
}

/// A square of side 1 for each surface and side; they face +Z, and their normals are tilted up.
pub fn patches(grid: &Grid) -> Scene {
    let (mut meshes, mut materials) = (Vec::new(), Vec::new());
    for (line, [albedo, metallic]) in grid.lines.iter().enumerate() {
        for first in (0..grid.columns()).step_by(grid.views) {
            let [roughness, _] = grid.at(first);
            let (mut vertices, mut indices) = (Vec::new(), Vec::new());
            for column in first..first + grid.views {
                let [_, n_dot_v] = grid.at(column);
                let normal = [0.0, (1.0 - n_dot_v * n_dot_v).sqrt(), n_dot_v];
                let corner = vertices.len() as u32;
                for [x, y] in [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
                    let [x, y] = [column as f32 + x, -(line as f32 + y)];
                    let tangent = [1.0, 0.0, 0.0, 1.0];
                    vertices.push(Vertex { position: [x, y, 0.0], normal, uv: [0.0; 2], tangent });
                }
                indices.extend([0, 1, 2, 0, 2, 3].map(|i| corner + i));
            }
            let bounds = Bounds::of(vertices.iter().map(|v| v.position.into()));
            meshes.push(Mesh { name: "patches".into(), vertices, indices, material: materials.len(), bounds });
            materials.push(Material::plain("patch", Vec3::splat(*albedo), *metallic, roughness));
        }
    }
    let instances = (0..meshes.len()).map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect();
    in_furnace(meshes, instances, materials)
}

/// A material that absorbs nothing.
pub fn white(metallic: f32, roughness: f32) -> Material {
    Material::plain("white", Vec3::ONE, metallic, roughness)
}

/// A scene under even light of radiance 1.
pub fn in_furnace(meshes: Vec<Mesh>, instances: Vec<Instance>, materials: Vec<Material>) -> Scene {
    let panorama = Panorama::uniform(Vec3::ONE);
    Scene {
        meshes,
        instances,
        materials,
        textures: vec![],
        lights: vec![],
        cameras: vec![],
        environment: Environment { panorama, rotation_degrees: 0.0 },
        exposure_ev: 0.0,
    }
}

/// A picture's radiance, rows from the top, of what lies between the origin and (columns, −lines), seen from so far along +Z
/// that all of it is seen from one direction.
pub fn draw(
    gpu: &Arc<Gpu>,
    scene: &Scene,
    size: [u32; 2],
    samples: u32,
    scattering: Scattering,
) -> Result<Vec<[f32; 4]>> {
    let settings = Settings { scattering, samples, ..Settings::default() };
    draw_frames(gpu, scene, size, settings, Shading::Pbr, &mut (0..1))
}

/// The same, the last of so many frames.
pub fn draw_frames(
    gpu: &Arc<Gpu>,
    scene: &Scene,
    size: [u32; 2],
    settings: Settings,
    shading: Shading,
    frames: &mut dyn Iterator<Item = usize>,
) -> Result<Vec<[f32; 4]>> {
    let bounds = scene.bounds();
    let [width, height] = [bounds.max.x.ceil(), -bounds.min.y.floor()];
    let (middle, away) = (Vec3::new(0.5 * width, -0.5 * height, 0.0), 200.0 * width);
    let fov = 2.0 * (0.5 * height / away).atan().to_degrees();
    let eye = Eye::looking(middle + away * Vec3::Z, middle, fov, size[0] as f32 / size[1] as f32);
    let settings = Settings { output: Output::Linear, ..settings };
    let mut renderer = Renderer::new(gpu, scene, settings, shading, size, 1, &Report::silent())?;
    let mut recorder = CommandBuffer::new(gpu)?;
    for frame in frames {
        let (mut commands, _) = recorder.begin()?;
        renderer.record(&mut commands, frame % FRAMES_IN_FLIGHT, &[eye], None);
        commands.submit(None)?;
        recorder.finish()?;
    }
    let bytes = read_image(gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, Output::Linear.bytes())?;
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}

/// A ball of rough gold that fills the picture's height, and Crytek Sponza, where scattering is seen nowhere or little.
fn costs(gpu: &Arc<Gpu>, full: bool, report: &Report) -> Result<Vec<CostRow>> {
    let limits = Limits { least: 5, most: 200, time: Duration::from_secs(if full { 20 } else { 6 }) };
    let mut rows = vec![cost(gpu, "gold ball", &gold_ball(0.6), limits)?];
    if let Some(known) = scenes::there(report)?.iter().find(|known| known.name == "crytek-sponza") {
        let scene = known.load(&QualityOptions::default().settings(gpu, None, report).textures, report)?;
        rows.push(cost(gpu, known.name, &scene, limits)?);
    }
    Ok(rows)
}

fn cost(gpu: &Arc<Gpu>, name: &str, scene: &Scene, limits: Limits) -> Result<CostRow> {
    let report = Report::silent();
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    let mut ways = Vec::new();
    for scattering in WAYS {
        let settings = QualityOptions { scattering, ..QualityOptions::default() }.settings(gpu, None, &report);
        let renderer = Renderer::new(gpu, scene, settings, Shading::Pbr, [256; 2], 1, &report)?;
        ways.push(Way { renderer, pictures: vec![vec![eye]] });
    }
    let [single, multiple] = take_turns(gpu, &mut ways, limits)?
        .try_into()
        .map_err(|_| Error::Usage("no frame was timed; this is a defect, please report it".into()))?;
    let of = |cost: &Cost| match cost.cpu_ms {
        Some(cpu_ms) if gpu.info().is_software() => cpu_ms.median,
        _ => cost.gpu_ms.median,
    };
    let ratio = of(&multiple) / of(&single);
    say!("{name}: multiple scattering takes {ratio:.3} times the frame of single");
    Ok(CostRow { scene: name.into(), single, multiple, ratio })
}

fn write(folder: &Path, furnace: &Furnace) -> Result<()> {
    let header = "roughness,metallic,n_dot_v,single,multiple\n".to_owned();
    let csv = furnace.rows.iter().fold(header, |text, row| {
        let FurnaceRow { roughness, metallic, n_dot_v, reflected: [single, multiple] } = row;
        text + &format!("{roughness:.2},{metallic:.1},{n_dot_v},{single:.5},{multiple:.5}\n")
    });
    write_atomically(&folder.join("furnace.csv"), csv.as_bytes())?;
    let path = folder.join("furnace.json");
    let text = serde_json::to_string_pretty(furnace).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, (text + "\n").as_bytes())
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::precompute::harness_tests::with_gpu;
    use crate::reference::energy::furnace;

    /// Case 20 of tests/gpu/stability.rs: the renderer itself, over 21 × 11 × 16 roughnesses, metalnesses and views. Its terms add up
    /// to 1 by construction; what they hold is tested in `furnace_integrated`.
    #[test]
    fn the_renderer_s_furnace_hides_every_white_surface() {
        let rows = with_gpu(|gpu| rows(gpu).unwrap());
        assert_eq!(rows.len(), ROUGHNESSES * METALNESSES * VIEWS);
        let Summary { off, least, most } = Summary::of(&rows);
        println!("off by {off:?}, {least:?} to {most:?}");
        assert!(off[1] < 0.005 && most[1] < 1.005, "off by {}, up to {}", off[1], most[1]);
        assert!(least[0] < 0.5 && most[0] < 1.005, "single scattering no longer loses light: {}", least[0]);
        for row in rows.iter().step_by(397) {
            let FurnaceRow { roughness, metallic, n_dot_v, reflected } = *row;
            for (scattering, drawn) in WAYS.into_iter().zip(reflected) {
                let truth = furnace(glam::DVec3::ONE, metallic, roughness, n_dot_v, scattering).x;
                assert!((drawn - truth).abs() < 0.005, "{drawn} is not {truth}, {scattering:?} {row:?}");
            }
        }
    }
}
