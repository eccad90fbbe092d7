//! `render --turntable` and `render --path`: numbered pictures along a camera's way, and a video of them. A sequence that was
//! interrupted goes on where it ended; what was drawn with other settings is drawn again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::frame_clock::ms_since;
use super::interrupt;
use super::loader::load_staged;
use super::render::{RenderRequest, drawn_picture};
use super::sequence_files::SequenceFiles;
use super::video::{Ffmpeg, Pictures};
use crate::args::write_json;
use crate::asset::cache::Key;
use crate::asset::contained::from_json;
use crate::asset::file::{read, write_atomically};
use crate::context::{Context, Setup};
use crate::gpu::FrameRing;
use crate::render::{Eye, FRAME_BYTES, FrameInputs, RenderSettings, Renderer, Shading, check_size};
use crate::scene::camera_path::{along, turntable};
use crate::scene::{Camera, Scene};
use crate::{Error, Result, say};

/// Limits for a record and for a picture's file, which are read again: bytes.
const RECORD_BYTES: u64 = 64 << 20;
const PICTURE_BYTES: u64 = 4 << 30;

/// The record beside a sequence: what it was made of, and the pictures that are done.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Record {
    program: String,
    /// A hash of everything that the pictures depend on.
    key: String,
    /// The same in words.
    settings: String,
    /// The hash of each picture's file.
    pictures: BTreeMap<String, String>,
}

impl Record {
    /// The record of a file, with what it holds for this key; a new one if there is none that can be read.
    pub(crate) fn open(file: &Path, new: Self) -> Self {
        let old: Option<Self> = read(file, "the record", RECORD_BYTES).ok().and_then(|bytes| from_json(&bytes).ok());
        match old {
            Some(old) if old.key == new.key => Self { pictures: old.pictures, ..new },
            Some(_) => {
                let file = file.display();
                say!("pbr-vr: {file} is of another scene, program or settings: all pictures are drawn again");
                new
            }
            None => new,
        }
    }

    /// Whether a picture is there as it was written.
    fn holds(&self, folder: &Path, name: &str) -> bool {
        self.pictures.get(name).is_some_and(|hash| hash_of(&folder.join(name)).is_ok_and(|found| found == *hash))
    }

    fn write(&self, file: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::write(file)(e.into()))?;
        write_atomically(file, (text + "\n").as_bytes())
    }
}

fn hash_of(file: &Path) -> Result<String> {
    let mut key = Key::new("picture of a sequence", 1);
    key.add(&read(file, "the picture", PICTURE_BYTES)?);
    Ok(key.text())
}

/// Facts of a sequence, for `--json`.
#[derive(Serialize)]
pub struct SequenceFacts {
    pub scene: PathBuf,
    /// The pictures in order.
    pub files: Vec<PathBuf>,
    pub video: Option<PathBuf>,
    pub size: [u32; 2],
    pub gpu: String,
    pub driver: String,
    /// Pictures that were there already.
    pub kept: usize,
    /// Wall time of drawing and writing the others.
    pub frames_ms: f64,
    pub warnings: Vec<String>,
}

/// Writes the sequence that a request asks for; [`RenderRequest::check`] has checked it. Prints what was written.
///
/// # Errors
/// Whatever stops loading, rendering or writing; [`Error::Interrupted`]; a validation message where asked for.
pub fn render_sequence(request: &RenderRequest, setup: &Setup<'_>) -> Result<()> {
    let Some(files) = request.sequence_files()? else { return Ok(()) };
    let ffmpeg = files.video.as_ref().map(|video| Ok::<_, Error>((Ffmpeg::find()?, video))).transpose()?;
    let context = setup.open()?;
    let messages = context.gpu.messages();
    // Pictures are taken from anywhere.
    let settings = RenderSettings { output: files.content(), viewpoint: None, ..request.settings.clone() };
    check_size(&context, request.size, 1, &settings)?;
    let textures = settings.textures.options(&context);
    let scene = load_staged(&request.scene, request.staging.clone(), &textures, &context.report)?;
    let cameras = cameras(request, &scene, files.count)?;
    let mut record = Record::open(&files.record(), new_record(request, &settings, &context, (&scene, &cameras))?);
    let left: Vec<u32> = (1..=files.count).filter(|n| !record.holds(&files.folder, &files.name(*n))).collect();
    let kept = cameras.len() - left.len();
    if kept > 0 {
        say!("pbr-vr: {kept} of {} pictures are there already", files.count);
    }
    let started = Instant::now();
    if !left.is_empty() {
        draw(&context, (scene, &cameras), (request, settings), (&files, &left, &mut record))?;
    }
    let frames_ms = ms_since(started);
    if let Some((ffmpeg, video)) = ffmpeg {
        let (per_second, count) = (request.sequence.fps.unwrap_or(30), files.count);
        let SequenceFiles { folder, stem, digits, .. } = &files;
        ffmpeg.write(&Pictures { folder, stem, digits: *digits, count, per_second }, video)?;
        say!("pbr-vr: wrote {}", video.display());
    }
    let facts = SequenceFacts {
        scene: request.scene.clone(),
        files: (1..=files.count).map(|number| files.folder.join(files.name(number))).collect(),
        video: files.video,
        size: request.size,
        gpu: context.gpu.info().name.clone(),
        driver: context.gpu.info().driver.clone(),
        kept,
        frames_ms,
        warnings: context.report.warnings(),
    };
    // Destroying the device may add validation messages, for example about leaks.
    drop(context);
    messages.check()?;
    write_json(request.json.as_deref(), &facts)
}

fn cameras(request: &RenderRequest, scene: &Scene, count: u32) -> Result<Vec<Camera>> {
    let path = &request.sequence.path;
    if path.is_empty() { Ok(turntable(&scene.cameras[0], count)) } else { along(&scene.cameras, path, count) }
}

/// Frames of each picture.
fn frames(request: &RenderRequest) -> u64 {
    let shading = request.settings.shading;
    request.sequence.average.unwrap_or(shading.default_frames())
}

/// A record without pictures.
fn new_record(
    request: &RenderRequest,
    settings: &RenderSettings,
    context: &Context,
    (scene, cameras): (&Scene, &[Camera]),
) -> Result<Record> {
    let (gpu, [width, height]) = (context.gpu.info(), request.size);
    let frames = frames(request);
    let settings = format!("{width}x{height}, {frames} frame(s) each, {} ({}): {settings:?}", gpu.name, gpu.driver);
    let mut key = Key::new("sequence", 1);
    key.add(settings.as_bytes());
    // Another build may draw other pictures.
    let program = std::env::current_exe().map_err(Error::read("the program"))?;
    key.add(&read(&program, "the program", PICTURE_BYTES)?);
    add_scene(&mut key, scene, cameras);
    let program = format!("pbr-vr {}", env!("CARGO_PKG_VERSION"));
    Ok(Record { program, key: key.text(), settings, pictures: BTreeMap::new() })
}

/// Adds all that is drawn of a scene, as it was loaded.
fn add_scene(key: &mut Key, scene: &Scene, cameras: &[Camera]) {
    let Scene { meshes, instances, materials, textures, lights, environment, probes, exposure_ev, .. } = scene;
    for mesh in meshes {
        key.add(bytemuck::cast_slice(&mesh.vertices));
        key.add(bytemuck::cast_slice(&mesh.indices));
        key.add(&mesh.material.to_le_bytes());
    }
    for level in textures.iter().flat_map(|texture| &texture.levels) {
        key.add(level);
    }
    let shapes: Vec<_> = textures.iter().map(|t| (t.width, t.height, t.format)).collect();
    let panorama = &environment.panorama;
    key.add(bytemuck::cast_slice(&panorama.texels));
    let light = (panorama.width, panorama.height, environment.rotation_degrees, exposure_ev);
    // Cameras in the scene decide which sides of its surfaces can be seen.
    let words = format!(
        "{instances:?} {materials:?} {shapes:?} {lights:?} {light:?} {probes:?} {:?} {cameras:?}",
        scene.cameras
    );
    key.add(words.as_bytes());
}

/// Draws the pictures that are `left` and records them one by one.
fn draw(
    context: &Context,
    (mut scene, cameras): (Scene, &[Camera]),
    (request, settings): (&RenderRequest, RenderSettings),
    (files, left, record): (&SequenceFiles, &[u32], &mut Record),
) -> Result<()> {
    let (size, is_reference) = (request.size, settings.shading == Shading::Reference);
    // From here on Ctrl-C ends it between two pictures.
    interrupt::listen(|| {});
    // The reference traces rays instead of reading a lightmap.
    let new = if is_reference { Renderer::without_lightmap } else { Renderer::new };
    let mut renderer = new(context, &scene, settings, size, 1)?;
    scene.textures = Vec::new();
    let eye = |number: u32| [Eye::of_camera(&cameras[number as usize - 1], size[0] as f32 / size[1] as f32)];
    if !is_reference {
        renderer.finish_lightmap(&FrameInputs::of(&scene, &eye(left[0])))?;
    }
    let mut ring = FrameRing::new(&context.gpu, FRAME_BYTES)?;
    let progress = context.report.progress("pictures", cameras.len() as u64);
    progress.inc((cameras.len() - left.len()) as u64);
    for number in left {
        let eyes = eye(*number);
        renderer.begin_average();
        for _ in 0..frames(request) {
            ring.finish_slot()?;
            if interrupt::is_requested() {
                progress.finish_and_clear();
                let (done, all) = (progress.position(), cameras.len());
                return Err(Error::Interrupted(format!("after {done} of {all} pictures")));
            }
            let mut frame = ring.begin()?;
            renderer.record(&mut frame, &FrameInputs::of(&scene, &eyes))?;
            frame.submit(None)?;
        }
        let name = files.name(*number);
        let file = files.folder.join(&name);
        drawn_picture(context, &renderer, 0)?.write(&file)?;
        record.pictures.insert(name, hash_of(&file)?);
        record.write(&files.record())?;
        progress.inc(1);
    }
    ring.finish_all()?;
    progress.finish_and_clear();
    say!("pbr-vr: wrote {} to {}", files.folder.join(files.name(1)).display(), files.name(files.count));
    interrupt::stop_listening();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Output;
    use crate::view::args::parsed;

    fn files(arguments: &[&str]) -> Result<Option<SequenceFiles>> {
        let all = [&["a.toml", "-o"], arguments].concat();
        parsed::<RenderRequest>(&all).expect("arguments").sequence_files()
    }

    #[test]
    fn files_are_numbered_beside_each_other() {
        let of = |arguments: &[&str]| files(arguments).expect("fitting flags").expect("a sequence");
        let turn = of(&["d/turn.png", "--turntable", "12"]);
        assert_eq!((turn.name(1), turn.name(12)), ("turn-0001.png".into(), "turn-0012.png".into()));
        assert_eq!(turn.record(), Path::new("d").join("turn-sequence.json"));
        let long = of(&["t.EXR", "--path", "a,b", "--frames", "100000"]);
        assert_eq!((long.name(7), long.content()), ("t-000007.exr".into(), Output::Linear));
        let video = of(&["t.mp4", "--turntable", "2", "--fps", "60"]);
        assert_eq!((video.name(2), video.video.is_some()), ("t-0002.png".into(), true));
        assert!(files(&["t.png", "--frames", "3"]).is_ok_and(|files| files.is_none()));
    }

    #[test]
    fn flags_that_do_not_fit_are_refused() {
        for arguments in [
            &["t.mp4"][..],
            &["t.png", "--average", "3"],
            &["t.png", "--fps", "3"],
            &["t.png", "--turntable", "3", "--fps", "3"],
            &["t.png", "--turntable", "3", "--average", "3"],
            &["t.gif", "--turntable", "3"],
            &["t.png", "--path", "a,b", "--frames", "100001"],
        ] {
            assert!(matches!(files(arguments), Err(Error::Usage(_))), "{arguments:?}");
        }
        for arguments in [
            &["--turntable", "0"][..],
            &["--turntable", "3", "--frames", "3"],
            &["--turntable", "3", "--stereo"],
            &["--path", "a,b"],
            &["--path", "a,b", "--frames", "3", "--camera", "c"],
        ] {
            assert!(
                parsed::<RenderRequest>(&[&["a.toml", "-o", "t.png"], arguments].concat()).is_err(),
                "{arguments:?}"
            );
        }
    }

    #[test]
    fn only_whole_pictures_of_the_same_key_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, picture) = (folder.path().join("r.json"), folder.path().join("p.png"));
        std::fs::write(&picture, "whole").expect("a picture");
        let new = |key: &str| Record { key: key.into(), ..Record::default() };
        let mut record = Record::open(&file, new("a"));
        record.pictures.insert("p.png".into(), hash_of(&picture).expect("its hash"));
        record.write(&file).expect("a record");
        assert!(Record::open(&file, new("a")).holds(folder.path(), "p.png"));
        assert!(!Record::open(&file, new("b")).holds(folder.path(), "p.png"), "other settings");
        std::fs::write(&picture, "cut").expect("a picture");
        assert!(!Record::open(&file, new("a")).holds(folder.path(), "p.png"), "another file");
        std::fs::write(&file, "{").expect("a broken record");
        assert!(Record::open(&file, new("a")).pictures.is_empty());
    }
}
