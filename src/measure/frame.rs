//! What a frame costs: processor time of all cores while drawing, and of the one thread that records, with each saving and
//! without.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use cpu_time::ThreadTime;
use glam::{Mat4, Vec3};
use serde::Serialize;

use super::clock::cpu_ms;
use super::synthetic;
use crate::asset::Report;
use crate::asset::file::write_atomically;
use crate::gpu::{Gpu, GpuOptions, Recorder};
use crate::render::{Eye, FRAMES_IN_FLIGHT, IPD_METRES, Order, Renderer, Savings, Settings, Shading};
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Bounds, Camera, Environment, Instance, Material, Mesh, Scene, Vertex};
use crate::{Error, Result};

/// The picture's side. Sponza's is smaller in a quick run: recording costs the same at any size.
const SIDE: u32 = 512;
const QUICK_SIDE: u32 = 128;
/// Rings and sectors of the ball: 2 · 100 · (101 − 1) = 20,000 triangles.
const BALL: [u32; 2] = [101, 100];
/// Frames before time is taken.
const WARM_UP: usize = 4;
/// The least of so many runs counts: other programs can only add.
const RUNS: usize = 3;

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
    /// Of all threads, the GPU's time too where the GPU is the CPU.
    pub cpu_ms: Option<f64>,
    /// Of the calling thread: culling, ordering, recording, submitting.
    pub record_ms: f64,
    /// GPU time of all passes; the mean.
    pub gpu_ms: f64,
}

const HEADER: &str = "scene,what,side,eyes,samples,draws,cpu_ms,record_ms,gpu_ms";

/// Measures and writes `frame.csv` and `frame.json`: a metal ball of 20,000 triangles under a panorama, and Sponza where
/// the environment variable PBR_VR_SCENES leads to it.
pub fn run(folder: &Path, full: bool, gpu: GpuOptions<'_>, report: &Report) -> Result<Vec<FrameRow>> {
    let gpu = Gpu::open(gpu)?;
    let (frames, sponza_side) = if full { (200, SIDE) } else { (30, QUICK_SIDE) };
    let mut rows = Vec::new();
    let all = Savings::default();
    let ball = metal_ball();
    let ways = [
        ("default", all),
        ("back faces drawn", Savings { backs: false, ..all }),
        ("back faces drawn, order as listed", Savings { backs: false, order: Order::Listed, ..all }),
    ];
    rows.extend(measure(&gpu, "metal ball", &ball, [SIDE, 1, 1], &ways, frames, report)?);
    rows.extend(measure(&gpu, "metal ball", &ball, [SIDE, 1, 4], &ways[..1], frames, report)?);
    let sponza = std::env::var_os("PBR_VR_SCENES").map(|folder| Path::new(&folder).join("crytek-sponza/sponza.obj"));
    match sponza.filter(|file| file.is_file()) {
        Some(file) => rows.extend(sponza_rows(&gpu, &file, sponza_side, frames / 3, report)?),
        None => println!("Sponza: skipped (set PBR_VR_SCENES)"),
    }
    write(folder, &rows)?;
    Ok(rows)
}

/// From a third of the way in, along the nave.
fn sponza_rows(gpu: &Arc<Gpu>, file: &Path, side: u32, frames: usize, report: &Report) -> Result<Vec<FrameRow>> {
    let mut scene = load(file, &LoadOptions::default(), report)?;
    let Bounds { min, max } = scene.bounds();
    let at = |x: f32, y: f32, z: f32| min + (max - min) * Vec3::new(x, y, z);
    let (position, target) = (at(0.3, 0.15, 0.5), at(0.9, 0.2, 0.5));
    scene.cameras = vec![Camera { name: "nave".into(), position, target, vertical_fov_degrees: 70.0 }];
    let all = Savings::default();
    let ways = [
        ("default", all),
        ("order as listed", Savings { order: Order::Listed, ..all }),
        ("no frustum culling", Savings { frusta: false, ..all }),
        ("back faces drawn", Savings { backs: false, ..all }),
        ("nothing saved", Savings { frusta: false, backs: false, order: Order::Listed }),
    ];
    let mut rows = measure(gpu, "Sponza", &scene, [side, 1, 1], &ways, frames, report)?;
    rows.extend(measure(gpu, "Sponza", &scene, [side, 2, 1], &ways[..1], frames, report)?);
    Ok(rows)
}

/// Draws a scene in several ways, in pictures of a side of so many pixels, for so many eyes, with so many samples.
fn measure(
    gpu: &Arc<Gpu>,
    name: &str,
    scene: &Scene,
    [side, eye_count, samples]: [u32; 3],
    ways: &[(&str, Savings)],
    frames: usize,
    report: &Report,
) -> Result<Vec<FrameRow>> {
    let settings = Settings { samples, ..Settings::default() };
    let mut renderer = Renderer::new(gpu, scene, settings, Shading::Pbr, [side; 2], eye_count, report)?;
    let eye = Eye::of_camera(&scene.cameras[0], 1.0);
    let eyes = if eye_count == 2 { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] };
    let mut recorders = (0..FRAMES_IN_FLIGHT).map(|_| Recorder::new(gpu)).collect::<Result<Vec<_>>>()?;
    let mut rows = Vec::new();
    for (what, savings) in ways {
        *renderer.savings() = *savings;
        draw(gpu, &mut renderer, &mut recorders, &eyes, WARM_UP)?;
        let mut best: Option<Cost> = None;
        for _ in 0..RUNS {
            let cost = draw(gpu, &mut renderer, &mut recorders, &eyes, frames)?;
            best = Some(best.map_or(cost, |best| best.least(cost)));
        }
        let Some(Cost { cpu_ms, record_ms, gpu_ms }) = best else { continue };
        let draws = renderer.draw_counts()[0];
        let (scene, what) = (name.to_owned(), (*what).to_owned());
        let row = FrameRow { scene, what, side, eyes: eyes.len(), samples, draws, cpu_ms, record_ms, gpu_ms };
        print!("{}", line(&row));
        rows.push(row);
    }
    Ok(rows)
}

/// Means per frame.
#[derive(Clone, Copy)]
struct Cost {
    cpu_ms: Option<f64>,
    record_ms: f64,
    gpu_ms: f64,
}

impl Cost {
    fn least(self, other: Self) -> Self {
        Self {
            cpu_ms: self.cpu_ms.zip(other.cpu_ms).map(|(a, b)| a.min(b)),
            record_ms: self.record_ms.min(other.record_ms),
            gpu_ms: self.gpu_ms.min(other.gpu_ms),
        }
    }
}

fn draw(
    gpu: &Arc<Gpu>,
    renderer: &mut Renderer,
    recorders: &mut [Recorder],
    eyes: &[Eye],
    frames: usize,
) -> Result<Cost> {
    let (before, mut record_ms, mut gpu_ms) = (cpu_ms(), 0.0, 0.0);
    for frame in 0..frames {
        let slot = frame % FRAMES_IN_FLIGHT;
        // The wait is no part of recording.
        let times = recorders[slot].finish()?;
        gpu_ms += times.iter().map(|time| time.ms).sum::<f64>();
        let started = ThreadTime::now();
        let (mut commands, _) = recorders[slot].begin()?;
        renderer.record(&mut commands, slot, eyes, None);
        commands.submit(None)?;
        record_ms += started.elapsed().as_secs_f64() * 1e3;
    }
    gpu.wait_idle()?;
    // The first frames' times are those of the run before: the same way, once it is warm.
    let mean = |ms: f64| ms / frames as f64;
    let cpu_ms = cpu_ms().zip(before).map(|(now, before)| mean(now - before));
    Ok(Cost { cpu_ms, record_ms: mean(record_ms), gpu_ms: mean(gpu_ms) })
}

fn write(folder: &Path, rows: &[FrameRow]) -> Result<()> {
    let csv = rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row));
    write_atomically(&folder.join("frame.csv"), csv.as_bytes())?;
    let path = folder.join("frame.json");
    let json = serde_json::to_string_pretty(rows).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, json.as_bytes())
}

fn line(row: &FrameRow) -> String {
    let FrameRow { scene, what, side, eyes, samples, draws, cpu_ms, record_ms, gpu_ms } = row;
    let cpu_ms = cpu_ms.map_or(String::new(), |ms| format!("{ms:.2}"));
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = writeln!(text, "{scene},\"{what}\",{side},{eyes},{samples},{draws},{cpu_ms},{record_ms:.4},{gpu_ms:.2}");
    text
}

/// A ball of gold of radius 1, roughness 0.3, that fills three quarters of the picture's height.
fn metal_ball() -> Scene {
    let [rings, sectors] = BALL;
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for ring in 0..=rings {
        for sector in 0..=sectors {
            let (v, u) = (ring as f32 / rings as f32, sector as f32 / sectors as f32);
            let ((across, y), (sin, cos)) =
                ((v * std::f32::consts::PI).sin_cos(), (u * std::f32::consts::TAU).sin_cos());
            let position = [across * cos, y, -across * sin];
            vertices.push(Vertex { position, normal: position, uv: [u, v], tangent: [-sin, 0.0, -cos, 1.0] });
            if ring == rings || sector == sectors {
                continue;
            }
            let a = ring * (sectors + 1) + sector;
            let (b, c, d) = (a + sectors + 1, a + sectors + 2, a + 1);
            // Rings at the poles are of triangles.
            if ring + 1 < rings {
                indices.extend([a, b, c]);
            }
            if ring > 0 {
                indices.extend([a, c, d]);
            }
        }
    }
    let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    let position = Vec3::Z * 3.4;
    Scene {
        meshes: vec![Mesh { name: "ball".into(), vertices, indices, material: 0, bounds }],
        instances: vec![Instance { mesh: 0, world_from_local: Mat4::IDENTITY }],
        materials: vec![Material::plain("gold", Vec3::new(1.0, 0.77, 0.34), 1.0, 0.3)],
        textures: Vec::new(),
        lights: Vec::new(),
        cameras: vec![Camera { name: "front".into(), position, target: Vec3::ZERO, vertical_fov_degrees: 45.0 }],
        environment: Environment { panorama: synthetic::panorama(synthetic::WIDTH, true), rotation_degrees: 0.0 },
        exposure_ev: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_is_round_and_has_the_triangles_it_is_named_for() {
        let Mesh { vertices, indices, .. } = metal_ball().meshes.remove(0);
        assert_eq!(indices.len() / 3, 20_000);
        for t in indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| Vec3::from(vertices[i as usize].position));
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "a triangle without area or inside out: {a} {b} {c}");
        }
    }

    #[test]
    fn lines_have_the_header_s_columns() {
        let (scene, what) = ("ball".to_owned(), "default".to_owned());
        let row = FrameRow {
            scene,
            what,
            side: 512,
            eyes: 1,
            samples: 4,
            draws: 5,
            cpu_ms: None,
            record_ms: 0.25,
            gpu_ms: 3.0,
        };
        assert_eq!(line(&row), "ball,\"default\",512,1,4,5,,0.2500,3.00\n");
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
    }
}
