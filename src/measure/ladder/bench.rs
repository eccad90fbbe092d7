//! One scene ready to be drawn with any settings, timed beside the default ones, and judged.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::super::MeasureRequest;
use super::super::turns::{Limits, Way, compare_in_turns};
use super::exact::{ReferenceAccumulator, Stand, textures};
use super::{Rung, rungs};
use crate::Result;
use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::{CommandBuffer, Gpu, Subresource, read_image};
use crate::precompute::Cache;
use crate::render::{Eye, Output, Renderer, Settings, Shading};
use crate::scene::Scene;
use crate::scene::needs::resolution::Viewpoint;
use crate::view::{QualityOptions, load_scene};

/// A scene, its default way of drawing, and its exact picture.
pub struct Bench<'a> {
    stand: Stand<'a>,
    path: &'a Path,
    cache: Option<&'a Cache>,
    limits: Limits,
    /// By how their textures are stored.
    scenes: Vec<(Storage, Scene)>,
    default: Way,
    default_settings: (Shading, Settings),
    pub exact: ReferenceAccumulator,
}

/// Sizes, and how long is taken.
struct Extent {
    size: [u32; 2],
    /// Frames of a quarter of the exact picture.
    quarter: u32,
    limits: Limits,
}

impl Extent {
    fn new(request: &MeasureRequest<'_>) -> Self {
        let limits = |seconds| Limits { least: 5, most: 200, time: Duration::from_secs(seconds) };
        let (size, quarter, limits) =
            if request.full { ([1280, 720], 32, limits(10)) } else { ([384, 216], 8, limits(2)) };
        Self { size: request.picture.unwrap_or(size), quarter, limits }
    }
}

impl<'a> Bench<'a> {
    /// Loads a scene, draws its exact picture, and makes the default ready, as its first camera sees it.
    pub fn new(gpu: &'a Arc<Gpu>, path: &'a Path, request: &MeasureRequest<'a>, report: &Report) -> Result<Self> {
        let Extent { size, quarter, limits } = Extent::new(request);
        let plain = load_scene(path, &textures(gpu), report)?;
        // A loaded scene has a camera.
        let eye = Eye::of_camera(&plain.cameras[0], size[0] as f32 / size[1] as f32);
        let pixels_per_degree = request.pixels_per_degree;
        let stand = Stand { gpu, eye, size, exposure_ev: plain.exposure_ev, pixels_per_degree };
        let look = QualityOptions::default();
        let settings = settings(&stand, look, request.cache);
        let exact = ReferenceAccumulator::new(&stand, &plain, &settings, quarter, report)?;
        let mut scenes = vec![(Storage::Raw, plain)];
        let scene = stored(&mut scenes, path, &settings.textures)?;
        let default = way(&stand, scene, settings.clone(), look.shading)?;
        let default_settings = (look.shading, settings);
        Ok(Self { stand, path, cache: request.cache, limits, scenes, default, default_settings, exact })
    }

    /// Pixels of each picture.
    pub fn size(&self) -> [u32; 2] {
        self.stand.size
    }

    /// Draws with these flags, in turn with the default, and judges the picture; `None` for flags that are the default here.
    pub fn measure(&mut self, dimension: &str, flags: &str) -> Result<Option<Rung>> {
        let look = rungs::look(flags)?;
        let settings = settings(&self.stand, look, self.cache);
        if !flags.is_empty() && (look.shading, &settings) == (self.default_settings.0, &self.default_settings.1) {
            return Ok(None);
        }
        let stand = &self.stand;
        let scene = stored(&mut self.scenes, self.path, &settings.textures)?;
        let mut timed = way(stand, scene, settings.clone(), look.shading)?;
        let Some(([default, cost], ratio)) = compare_in_turns(stand.gpu, [&mut self.default, &mut timed], self.limits)?
        else {
            return Ok(None);
        };
        let display: Vec<[u8; 4]> = bytemuck::pod_collect_to_vec(&pixels(stand.gpu, &timed.renderer, Output::Display)?);
        drop(timed);
        let mut linear = way(stand, scene, Settings { output: Output::Linear, ..settings }, look.shading)?;
        let radiance: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&draw(stand, &mut linear.renderer)?);
        let (error, halves) = self.exact.judge(
            stand,
            &radiance.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>(),
            &display.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>(),
        )?;
        Ok(Some(Rung {
            dimension: dimension.into(),
            flags: flags.into(),
            cost,
            ratio,
            default_gpu_ms: default.gpu_ms.median,
            ms: cost.gpu_ms.median,
            error,
            halves,
            flip_over_default: 0.0,
            flip_noise: 0.0,
            beaten_by: None,
            within_noise: false,
        }))
    }
}

/// A look's settings for this one picture.
fn settings(stand: &Stand<'_>, look: QualityOptions, cache: Option<&Cache>) -> Settings {
    let Stand { gpu, eye, size, .. } = stand;
    let viewpoint = Viewpoint::new(eye.position(), 0.0, [eye.left, eye.right, eye.down, eye.up], *size);
    // What this GPU cannot do is the default then, and not measured.
    Settings { viewpoint: Some(viewpoint), ..look.settings(gpu, cache, &Report::silent()) }
}

/// The scene with its textures stored so, loaded when it is first asked for.
fn stored<'a>(scenes: &'a mut Vec<(Storage, Scene)>, path: &Path, textures: &TextureOptions) -> Result<&'a Scene> {
    let found = scenes.iter().position(|(storage, _)| *storage == textures.storage);
    let index = match found {
        Some(index) => index,
        None => {
            scenes.push((textures.storage, load_scene(path, textures, &Report::silent())?));
            scenes.len() - 1
        }
    };
    Ok(&scenes[index].1)
}

fn way(stand: &Stand<'_>, scene: &Scene, settings: Settings, shading: Shading) -> Result<Way> {
    let renderer = Renderer::new(stand.gpu, scene, settings, shading, stand.size, 1, &Report::silent())?;
    Ok(Way { renderer, pictures: vec![vec![stand.eye]] })
}

fn pixels(gpu: &Arc<Gpu>, renderer: &Renderer, output: Output) -> Result<Vec<u8>> {
    read_image(gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, output.bytes())
}

/// One frame's linear picture.
fn draw(stand: &Stand<'_>, renderer: &mut Renderer) -> Result<Vec<u8>> {
    let mut recorder = CommandBuffer::new(stand.gpu)?;
    let (mut commands, _) = recorder.begin()?;
    renderer.record(&mut commands, 0, &[stand.eye], None);
    commands.submit(None)?;
    recorder.finish()?;
    pixels(stand.gpu, renderer, Output::Linear)
}
