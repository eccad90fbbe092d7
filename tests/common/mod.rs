//! Small scenes and renders that the end-to-end tests share.
#![allow(dead_code)]

pub mod brdf;
pub mod colour;
#[cfg(target_os = "linux")]
pub mod failing;
#[cfg(target_os = "linux")]
pub mod failing_files;
pub mod fault;
pub mod gltf;
pub mod gpus;
pub mod headset;
#[cfg(target_os = "linux")]
pub mod held;
pub mod light;
pub mod room;
pub mod solids;
pub mod stage;
pub mod wall;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{LazyLock, OnceLock};
use std::time::{Duration, Instant};

use glam::DVec3;
use pbr_vr::asset::Cache;
use pbr_vr::asset::picture::Picture;
use pbr_vr::context::Setup;
use pbr_vr::gpu::{Gpu, GpuOptions};
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::energy::Scattering;
use pbr_vr::reference::split_sum::SplitSum;
use pbr_vr::render::{LightDetail, LightModel, RenderSettings, Shading};
use pbr_vr::scene::Model;
use pbr_vr::scene::staging::{Stage, Staging};
use pbr_vr::view::{RenderRequest, render_on};

use gpus::TestGpu;

/// A folder for one test's files, and the GPU that its pictures are drawn on: as it is the same for all, they share pipelines.
pub struct Workshop {
    pub folder: tempfile::TempDir,
    gpu: OnceLock<TestGpu>,
}

impl Workshop {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder"), gpu: OnceLock::new() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).expect("a test file");
        path
    }

    /// Writes an EXR panorama of `width` by `width / 2` texels.
    pub fn panorama(&self, name: &str, width: usize, radiance: impl Fn([f64; 3]) -> [f32; 3] + Sync) -> PathBuf {
        let path = self.path(name);
        let height = width / 2;
        exr::prelude::write_rgb_file(&path, width, height, |x, y| {
            let longitude = ((x as f64 + 0.5) / width as f64 - 0.5) * std::f64::consts::TAU;
            let latitude = (0.5 - (y as f64 + 0.5) / height as f64) * std::f64::consts::PI;
            let across = latitude.cos();
            let [r, g, b] = radiance([across * longitude.cos(), latitude.sin(), across * longitude.sin()]);
            (r, g, b)
        })
        .expect("a test panorama");
        path
    }

    /// Writes `sky.exr`: a different colour from everywhere; `sun` is the radiance around one direction.
    pub fn sky(&self, sun: f32) -> PathBuf {
        self.panorama("sky.exr", 64, |[x, y, z]| {
            let glow = if x > 0.9 { sun } else { 0.0 };
            [1.0 + 0.5 * x as f32 + glow, 1.0 + 0.5 * y as f32 + glow, 1.0 + 0.5 * z as f32 + glow]
        })
    }

    /// Renders a model around the origin under `sky.exr`, seen from far away along -v through an angle of 0.02 degrees, with what
    /// the description says `more`.
    pub fn seen_from_afar(&self, model: &str, v: DVec3, more: &str, options: &PictureOptions<'_>) -> Picture {
        let [x, y, z] = (20.0 * v).to_array();
        let text = format!(
            "environment = {{ panorama = \"sky.exr\" }}\n{more}[[model]]\nfile = \"{model}\"\n[[camera]]\nname = \"c\"\n\
             position = [{x}, {y}, {z}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 0.02\n"
        );
        self.render(&self.write("scene.toml", &text), options).remove(0)
    }

    /// Renders with validation on, and light from [`light`]; any message fails the test at its end.
    pub fn render(&self, scene: &Path, options: &PictureOptions<'_>) -> Vec<Picture> {
        let output = self.path(options.file);
        let request = RenderRequest {
            size: options.size,
            staging: Staging {
                stage: Stage { camera: options.camera.map(str::to_owned), ..Stage::default() },
                ..Staging::default()
            },
            stereo: options.stereo,
            frames: Some(options.frames),
            settings: RenderSettings {
                shading: options.shading,
                geometry: options.geometry,
                scattering: options.scattering,
                split_sum: options.split_sum,
                light: options.light,
                light_detail: LightDetail { lightmap_size: options.lightmap, ..LightDetail::default() },
                model: options.model,
                ..Default::default()
            },
            ..RenderRequest::new(scene, output)
        };
        let gpu = self.gpu.get_or_init(TestGpu::take);
        let context = setup(Some(&light())).with(gpu);
        let facts = render_on(&request, &context).expect("a render");
        facts.files.iter().map(|file| Picture::read(file).expect("the written picture")).collect()
    }
}

/// Options of the pictures that a test renders.
#[derive(Clone, Copy)]
pub struct PictureOptions<'a> {
    pub file: &'a str,
    pub size: [u32; 2],
    pub camera: Option<&'a str>,
    pub stereo: bool,
    pub frames: u64,
    pub shading: Shading,
    pub geometry: Geometry,
    pub scattering: Scattering,
    pub split_sum: SplitSum,
    pub light: LightModel,
    /// Texels along the side of the lightmap, unless it is as large as the scene asks for.
    pub lightmap: Option<u32>,
    pub model: Model,
}

impl PictureOptions<'_> {
    /// A square picture of light that nothing blocks.
    pub fn open(side: u32, shading: Shading, frames: u64) -> Self {
        Self { size: [side; 2], light: LightModel::Open, shading, frames, ..Self::default() }
    }
}

impl Default for PictureOptions<'_> {
    fn default() -> Self {
        Self {
            file: "out.exr",
            size: [96, 96],
            camera: None,
            stereo: false,
            frames: 1,
            shading: Shading::Pbr,
            geometry: Geometry::Smith,
            scattering: Scattering::Multiple,
            split_sum: SplitSum::Moment,
            light: LightModel::Direct,
            lightmap: None,
            model: Model::Needed,
        }
    }
}

/// An MTL of one material, `m`.
pub fn material(base_color: [f32; 3], metallic: f32, roughness: f32) -> String {
    let [r, g, b] = base_color;
    format!("newmtl m\nKd {r} {g} {b}\nPm {metallic}\nPr {roughness}\n")
}

/// A unit square in the plane z = 0, facing +Z, u along +X and v along +Y, with material `m` of `mtl`.
pub fn square(mtl: &str) -> String {
    let corners = "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";
    format!("mtllib {mtl}\n{corners}usemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")
}

/// A unit sphere with exact normals and material `m` of `mtl`.
pub fn sphere(mtl: &str) -> String {
    let (rows, columns) = (64, 128);
    let mut obj = format!("mtllib {mtl}\n");
    for row in 0..=rows {
        for column in 0..=columns {
            let (v, u) = (f64::from(row) / f64::from(rows), f64::from(column) / f64::from(columns));
            let (polar, around) = (v * std::f64::consts::PI, u * std::f64::consts::TAU);
            let (x, y, z) = (polar.sin() * around.cos(), polar.cos(), -polar.sin() * around.sin());
            writeln!(obj, "v {x} {y} {z}\nvn {x} {y} {z}\nvt {u} {}", 1.0 - v).expect("a string");
        }
    }
    obj.push_str("usemtl m\n");
    for row in 0..rows {
        for column in 1..=columns {
            let a = row * (columns + 1) + column;
            let corners = [a, a + columns + 1, a + columns + 2, a + 1].map(|i| format!("{i}/{i}/{i}")).join(" ");
            writeln!(obj, "f {corners}").expect("a string");
        }
    }
    obj
}

/// The mean of the pixels in a square of side 2·`reach` + 1 about a point.
pub fn mean_at(picture: &Picture, x: u32, y: u32, reach: u32) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for row in y - reach..=y + reach {
        for column in x - reach..=x + reach {
            let pixel = pixel(picture, column, row);
            (0..3).for_each(|c| sum[c] += pixel[c]);
        }
    }
    sum.map(|s| s / f64::from((2 * reach + 1).pow(2)))
}

/// One pixel's RGB.
pub fn pixel(picture: &Picture, x: u32, y: u32) -> [f64; 3] {
    let p = picture.pixels[(y * picture.width + x) as usize];
    [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])]
}

/// The mean RGB of a picture.
pub fn mean_colour(picture: &Picture) -> DVec3 {
    let sum: DVec3 = picture.pixels.iter().map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into())).sum();
    sum / picture.pixels.len() as f64
}

/// The folder of test scenes, or a printed reason to skip; in CI a missing folder fails the test.
pub fn scenes(what: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("PBR_VR_SCENES").map(PathBuf::from).filter(|f| f.is_dir());
    if folder.is_none() {
        assert!(std::env::var_os("CI").is_none(), "{what} needs PBR_VR_SCENES");
        println!("skipped: {what} (set PBR_VR_SCENES to the folder of test scenes)");
    }
    folder
}

/// A cache that the tests of a process share, because most draw under the same few panoramas. It is empty at the start:
/// an entry from before could hide a changed constant whose version was not raised.
fn light() -> Cache {
    static CACHE: LazyLock<Cache> = LazyLock::new(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("light");
        match fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != ErrorKind::NotFound => panic!("{}: {error}", folder.display()),
            _ => Cache::in_folder(folder.join("maps")),
        }
    });
    CACHE.clone()
}

/// Under validation, and silent.
pub fn setup(cache: Option<&Cache>) -> Setup<'static> {
    Setup { cache: cache.cloned(), ..Setup::silent(validated()) }
}

/// Any validation message will be a failure.
pub fn validated() -> GpuOptions<'static> {
    GpuOptions { validate: true, ..GpuOptions::default() }
}

/// The program with its cache in `folder`/cache.
pub fn program(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_pbr-vr"))
        .args(arguments)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("LOCALAPPDATA", folder.join("cache"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// Waits for something; fails after two minutes.
pub fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < Duration::from_secs(120), "no {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Sends a process a signal, by its name.
#[cfg(unix)]
pub fn signal(process: u32, name: &str) {
    let sent = Command::new("kill").args(["-s", name, &process.to_string()]).status();
    assert!(sent.expect("kill").success());
}

/// Waits for its end.
pub fn finish(child: Child) -> Output {
    child.wait_with_output().expect("its end")
}

/// Waits for its good end; what it said on stdout.
pub fn succeeds(child: Child) -> String {
    let output = finish(child);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Where a control of the panel is, as `-vv` says it last: its middle and its size, pixels of what it is drawn on.
pub fn control_in(log: &str, name: &str) -> Option<[[f64; 2]; 2]> {
    let start = format!("panel: {name} at ");
    let line = log.lines().rev().find_map(|line| line.split(&start).nth(1))?;
    let numbers: Vec<f64> = line.trim().split([',', ' ', 'x']).map(|n| n.parse().expect("a number")).collect();
    let [x, y, width, height] = numbers[..] else { panic!("{line}") };
    Some([[x + width / 2.0, y + height / 2.0], [width, height]])
}

/// A JSON file's content.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).expect("the facts")).expect("JSON")
}

/// All files of a folder with their content; none if there is no folder.
pub fn entries(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry").path());
    files.map(|path| (path.clone(), fs::read(&path).expect("an entry's content"))).collect()
}
