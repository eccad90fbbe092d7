//! `render`: writes a picture of a scene; also used by `view` where there is no display.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use cpu_time::ThreadTime;
use serde::Serialize;

use super::args::Choice;
use super::frame_clock::ms_since;
use super::interrupt;
use super::loader::load_staged;
use super::sequence_files::{SequenceArgs, SequenceFiles};
use crate::args::{parse_size, write_json};
use crate::asset::picture::Picture;
use crate::asset::{Outputs, Report};
use crate::context::{Context, Setup};
use crate::gpu::{FrameRing, PassTime, Subresource, read_image};
use crate::render::{
    DrawCounts, Eye, FRAME_BYTES, FRAMES_IN_FLIGHT, FrameInputs, IPD_METRES, LightModel, Output, RenderSettings,
    Renderer, Shading, StandardError, TextureFacts, check_size,
};
use crate::scene::load::files as scene_files;
use crate::scene::needs::resolution::Viewpoint;
use crate::scene::staging::Staging;
use crate::{Error, Result, say};

/// A picture of a scene and its output file.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct RenderRequest {
    /// A scene description (.toml) or a model (.gltf, .glb, .obj).
    pub scene: PathBuf,
    /// The picture: .png as a viewer sees it, .exr as linear radiance; of a sequence also a video, .mp4.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    pub size: [u32; 2],
    /// Write FILE-left and FILE-right, an eye each.
    #[arg(long)]
    pub stereo: bool,
    /// Draw this many frames, for times; the last is written. With `--shading reference`, average them. 1 if left out, or
    /// 256 to average. With `--path`, the number of pictures.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: Option<u64>,
    /// Write times and facts.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    #[command(flatten)]
    pub sequence: SequenceArgs,
    #[command(flatten)]
    pub staging: Staging,
    #[command(flatten)]
    pub settings: RenderSettings,
    #[command(flatten)]
    pub choice: Choice,
}

impl RenderRequest {
    /// With the command line's defaults.
    pub fn new(scene: impl Into<PathBuf>, output: impl Into<PathBuf>) -> Self {
        Self {
            scene: scene.into(),
            output: output.into(),
            size: [1280, 720],
            stereo: false,
            frames: None,
            json: None,
            sequence: SequenceArgs::default(),
            staging: Staging::default(),
            settings: RenderSettings::default(),
            choice: Choice::default(),
        }
    }

    /// Checks that the outputs can be written and are not inputs.
    ///
    /// # Errors
    /// The first output that cannot be used.
    pub fn check(&self) -> Result<()> {
        let files = scene_files(&self.scene).into_iter().chain(self.staging.panorama.clone());
        let mut outputs = Outputs::of(files);
        match self.sequence_files()? {
            Some(files) => files.check(&mut outputs)?,
            None => picture_files(&self.output, self.stereo).iter().try_for_each(|file| outputs.file(file))?,
        }
        outputs.file_if(self.staging.write_scene.as_deref())?;
        outputs.file_if(self.json.as_deref())
    }

    /// The files of a sequence; `None` for a single picture.
    ///
    /// # Errors
    /// [`Error::Usage`] for flags that do not fit together.
    pub fn sequence_files(&self) -> Result<Option<SequenceFiles>> {
        SequenceFiles::of(&self.sequence, &self.output, self.frames, self.settings.shading)
    }

    /// The command for a single picture: renders, prints the error of a reference picture and writes the facts. [`RenderRequest::check`] has
    /// checked the outputs.
    ///
    /// # Errors
    /// Those of [`render`]; facts that cannot be written.
    pub fn run(&self, setup: &Setup<'_>) -> Result<()> {
        let facts = render(self, setup)?;
        if let Some(error) = &facts.standard_error {
            say!("pbr-vr: {error}");
        }
        write_json(self.json.as_deref(), &facts)
    }
}

/// Times and facts of a render, for `--json`.
#[derive(Serialize)]
pub struct RenderFacts {
    pub scene: PathBuf,
    pub files: Vec<PathBuf>,
    pub size: [u32; 2],
    pub eyes: usize,
    pub gpu: String,
    pub driver: String,
    pub frames: u64,
    pub triangles: usize,
    /// Reading and decoding the scene's files.
    pub load_ms: f64,
    /// Opening the GPU, uploading, precomputing.
    pub prepare_ms: f64,
    /// Where that time went, by stage, over all threads together: parse, hash, decode, mips, compress, cache, upload,
    /// precompute. What is found in the cache is neither decoded nor compressed.
    pub stages_ms: BTreeMap<&'static str, f64>,
    pub textures: TextureFacts,
    /// GPU time of each precompute pass; names of those taken from the cache say so.
    pub precompute: Vec<PassTime>,
    /// GPU time of each pass, one list per frame.
    pub gpu_frames: Vec<Vec<PassTime>>,
    /// Processor time of the thread that records and submits, for each frame.
    pub record_ms: Vec<f64>,
    /// Of the last frame.
    pub draws: DrawCounts,
    /// Wall time from recording the first frame to the end of the last.
    pub frames_ms: f64,
    /// Of the reference, after two frames or more.
    pub standard_error: Option<StandardError>,
    pub warnings: Vec<String>,
}

/// Renders a scene and writes the picture; with `stereo`, one per eye. If the GPU is reset while it computes baked light, the
/// picture has none, and a warning says so.
///
/// # Errors
/// Whatever stops loading, rendering or writing; a validation message where validation was asked for.
pub fn render(request: &RenderRequest, setup: &Setup<'_>) -> Result<RenderFacts> {
    let mut lost_baking = false;
    match render_once(request, setup, &mut lost_baking) {
        Err(_) if lost_baking => {
            let scene = request.scene.display();
            setup.report.warn(format!(
                "{scene}: no light between things (`--light direct`), as the GPU was reset while that was computed; update \
                 its driver if it happens again"
            ));
            render_direct(request, setup)
        }
        done => done,
    }
}

/// Once more, with direct light alone: what was said the first time is not said again.
fn render_direct(request: &RenderRequest, setup: &Setup<'_>) -> Result<RenderFacts> {
    let settings = RenderSettings { light: LightModel::Direct, ..request.settings.clone() };
    let again = Setup { report: Arc::new(Report::silent()), ..setup.clone() };
    let facts = render_once(&RenderRequest { settings, ..request.clone() }, &again, &mut false)?;
    let known = setup.report.warnings();
    let new = again.report.warnings().into_iter().filter(|warning| !known.contains(warning));
    new.for_each(|warning| setup.report.warn(warning));
    Ok(RenderFacts { warnings: setup.report.warnings(), ..facts })
}

/// `lost_baking` says of an error that it is a GPU lost by computing light.
fn render_once(request: &RenderRequest, setup: &Setup<'_>, lost_baking: &mut bool) -> Result<RenderFacts> {
    output_of(&request.output)?;
    let started = Instant::now();
    let context = setup.open()?;
    let messages = context.gpu.messages();
    let open_ms = ms_since(started);
    let mut facts = render_with(request, &context, lost_baking)?;
    facts.prepare_ms += open_ms;
    // Destroying the device may add validation messages, for example about leaks.
    drop(context);
    messages.check()?;
    Ok(facts)
}

/// [`render`] on a GPU that is already open, without the second try after a reset; the caller checks its validation messages.
///
/// # Errors
/// Whatever stops loading, rendering or writing.
pub fn render_on(request: &RenderRequest, context: &Context) -> Result<RenderFacts> {
    render_with(request, context, &mut false)
}

fn render_with(request: &RenderRequest, context: &Context, lost_baking: &mut bool) -> Result<RenderFacts> {
    let output = output_of(&request.output)?;
    let frames = request.frames.unwrap_or(request.settings.shading.default_frames());
    let settings = RenderSettings { output, ..request.settings.clone() };
    // Errors are better found before loading.
    check_size(context, request.size, if request.stereo { 2 } else { 1 }, &settings)?;
    let started = Instant::now();
    let textures = settings.textures.options(context);
    let mut scene = load_staged(&request.scene, request.staging.clone(), &textures, &context.report)?;
    let load_ms = ms_since(started);
    let aspect = request.size[0] as f32 / request.size[1] as f32;
    let eye = Eye::of_camera(&scene.cameras[0], aspect);
    let eyes = if request.stereo { eye.stereo(IPD_METRES).to_vec() } else { vec![eye] };

    let started = Instant::now();
    let around_metres = if request.stereo { 0.5 * IPD_METRES } else { 0.0 };
    let tangents = [eye.left, eye.right, eye.down, eye.up];
    let viewpoint = Some(Viewpoint::new(eye.position(), around_metres, tangents, request.size));
    let settings = RenderSettings { viewpoint, ..settings };
    // The reference traces rays instead of reading a lightmap.
    let is_reference = settings.shading == Shading::Reference;
    let new = if is_reference { Renderer::without_lightmap } else { Renderer::new };
    let mut renderer = new(context, &scene, settings, request.size, eyes.len() as u32)?;
    // The textures are on the GPU now.
    scene.textures = Vec::new();
    let prepare_ms = ms_since(started);
    let started = Instant::now();
    if !is_reference {
        let light = renderer.finish_lightmap(&FrameInputs::of(&scene, &eyes));
        *lost_baking = matches!(&light, Err(error) if error.is_device_lost());
        light?;
    }
    let (gpu_frames, record_ms) = draw(context, &mut renderer, &FrameInputs::of(&scene, &eyes), frames)?;
    let frames = record_ms.len() as u64;
    Ok(RenderFacts {
        scene: request.scene.clone(),
        files: write_layers(context, &renderer, request)?,
        size: request.size,
        eyes: eyes.len(),
        gpu: context.gpu.info().name.clone(),
        driver: context.gpu.info().driver.clone(),
        frames,
        triangles: scene.triangles(),
        load_ms,
        prepare_ms,
        stages_ms: context.report.times_ms(),
        textures: renderer.texture_facts().clone(),
        precompute: renderer.precompute_times().cloned().collect(),
        gpu_frames,
        record_ms,
        draws: renderer.draw_counts(),
        frames_ms: ms_since(started),
        standard_error: renderer.standard_error(last_slot(frames)),
        warnings: context.report.warnings(),
    })
}

/// Draws frames; returns the GPU times and the recording time of each. An interrupt ends the averaging of a reference
/// early, as what there is of it is a picture already.
fn draw(
    context: &Context,
    renderer: &mut Renderer,
    inputs: &FrameInputs<'_>,
    frames: u64,
) -> Result<(Vec<Vec<PassTime>>, Vec<f64>)> {
    let mut ring = FrameRing::new(&context.gpu, FRAME_BYTES)?;
    let (mut times, mut record_ms) = (Vec::new(), Vec::new());
    let averages = renderer.settings().shading == Shading::Reference;
    let progress = averages.then(|| context.report.progress("reference", frames));
    if averages {
        interrupt::listen(|| {});
    }
    for _ in 0..frames {
        ring.finish_slot()?;
        if averages && interrupt::is_requested() && !record_ms.is_empty() {
            context.report.warn(format!("interrupted after {} of {frames} frames", record_ms.len()));
            break;
        }
        progress.iter().for_each(|bar| bar.inc(1));
        let started = ThreadTime::now();
        let mut frame = ring.begin()?;
        times.push(frame.finished.to_vec());
        renderer.record(&mut frame, inputs)?;
        frame.submit(None)?;
        record_ms.push(started.elapsed().as_secs_f64() * 1e3);
    }
    times.extend(ring.finish_all()?.map(|frame| frame.to_vec()));
    times.retain(|frame| !frame.is_empty());
    progress.iter().for_each(|bar| bar.finish_and_clear());
    interrupt::stop_listening();
    Ok((times, record_ms))
}

/// The slot of the last of `frames` frames.
fn last_slot(frames: u64) -> usize {
    usize::try_from((frames.max(1) - 1) % FRAMES_IN_FLIGHT as u64).unwrap_or(0)
}

fn write_layers(context: &Context, renderer: &Renderer, request: &RenderRequest) -> Result<Vec<PathBuf>> {
    let files = picture_files(&request.output, request.stereo);
    for (layer, file) in (0u32..).zip(&files) {
        let picture = drawn_picture(context, renderer, layer)?;
        picture.write(file)?;
        let lost = picture.pixels.iter().filter(|pixel| !pixel.iter().all(|v| v.is_finite())).count();
        if lost > 0 {
            let file = file.display();
            context.report.warn(format!(
                "{file}: {lost} pixel(s) are infinite or no number; the scene's light is too bright there"
            ));
        }
    }
    Ok(files)
}

/// One eye's picture as the renderer has drawn it.
///
/// # Errors
/// A failed Vulkan call.
pub fn drawn_picture(context: &Context, renderer: &Renderer, layer: u32) -> Result<Picture> {
    let (output, [width, height]) = (renderer.settings().output, renderer.picture().desc().size);
    let bytes = read_image(&context.gpu, renderer.picture(), Subresource { mip: 0, layer }, output.bytes())?;
    Ok(match output {
        Output::Display => Picture::from_srgb8("render", width, height, &bytes),
        Output::Linear => Picture::from_radiance("render", width, height, &bytemuck::pod_collect_to_vec(&bytes)),
    })
}

/// The files of a render: one, or one for each eye.
pub fn picture_files(output: &Path, stereo: bool) -> Vec<PathBuf> {
    if stereo { vec![suffixed(output, "-left"), suffixed(output, "-right")] } else { vec![output.to_owned()] }
}

fn output_of(path: &Path) -> Result<Output> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "png" => Ok(Output::Display),
        "exr" => Ok(Output::Linear),
        _ => Err(Error::Usage(format!("{}: pictures are written as .png or .exr", path.display()))),
    }
}

fn suffixed(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(suffix);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::args::parsed;

    #[test]
    fn a_request_has_the_command_lines_defaults() {
        let request: RenderRequest = parsed(&["a.toml", "-o", "b.png"]).expect("arguments");
        assert_eq!(request, RenderRequest::new("a.toml", "b.png"));
        assert!(parsed::<RenderRequest>(&["a.toml", "-o", "b.png", "--tolerance", "1", "--samples", "1"]).is_err());
    }

    #[test]
    fn eyes_are_written_beside_each_other() {
        assert_eq!(
            picture_files(Path::new("d/a.b.png"), true),
            [Path::new("d/a.b-left.png"), Path::new("d/a.b-right.png")]
        );
        assert_eq!(picture_files(Path::new("a.exr"), false), [Path::new("a.exr")]);
    }
}
