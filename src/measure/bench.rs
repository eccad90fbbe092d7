//! Renderers for measurements: a scene on the GPU, its frames drawn and timed one by one or interleaved, its pictures read back.

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ThreadTime;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::machine::cpu_ms;
use super::noise::MeanAndHalves;
use crate::asset::Report;
use crate::context::Context;
use crate::gpu::{FrameRing, Gpu, Subresource, read_image};
use crate::render::{Eye, FRAME_BYTES, FrameInputs, Output, RenderSettings, Renderer, Shading};
use crate::scene::Scene;
use crate::{Error, Result};

/// Frames before the first that is timed: pipelines are finished with the first.
const WARM_UP: usize = 2;

/// Milliseconds of one frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameTime {
    /// GPU time of all passes.
    pub gpu: f64,
    /// Processor time of all threads; `None` where the system does not report it.
    pub cpu: Option<f64>,
    /// Processor time of the thread that records and submits.
    pub record: f64,
}

/// The reference's settings. It reads textures at their finest level: anisotropic filtering does nothing for it, but lavapipe's
/// reads every texel within a pixel, and takes ten times as long.
pub fn exact(mut settings: RenderSettings) -> RenderSettings {
    settings.textures.anisotropy = Some(1);
    RenderSettings { shading: Shading::Reference, output: Output::Linear, ..settings }
}

/// A renderer, the eyes that it draws for, and its frames.
pub struct Bench {
    gpu: Arc<Gpu>,
    pub renderer: Renderer,
    ring: FrameRing,
    pub eyes: Vec<Eye>,
    /// The inputs of every frame, without the eyes.
    pub inputs: FrameInputs<'static>,
    /// What computing lightmap and probes took, where they were neither in the cache nor left out.
    pub baked: Option<BakeCost>,
}

impl Bench {
    /// Uploads a scene, finishes its baked light and prepares pictures of `size` pixels for these eyes.
    pub fn new(
        context: &Context,
        scene: &Scene,
        settings: RenderSettings,
        size: [u32; 2],
        eyes: Vec<Eye>,
    ) -> Result<Self> {
        let gpu = Arc::clone(&context.gpu);
        let silent = Context { report: Arc::new(Report::silent()), ..context.clone() };
        let reference = settings.shading == Shading::Reference;
        let mut renderer = Renderer::new(&silent, scene, settings, size, eyes.len() as u32)?;
        let (ring, inputs) = (FrameRing::new(&gpu, FRAME_BYTES)?, FrameInputs::of(scene, &[]));
        let before = cpu_ms();
        let gpu_ms = if reference { 0.0 } else { renderer.finish_lightmap(&FrameInputs { eyes: &eyes, ..inputs })? };
        let cpu_s = cpu_ms().zip(before).map(|(now, before)| (now - before) / 1e3);
        let baked = (gpu_ms > 0.0).then_some(BakeCost { cpu_s, gpu_s: gpu_ms / 1e3 });
        Ok(Self { gpu, renderer, ring, eyes, inputs, baked })
    }

    /// Draws a frame to its end.
    pub fn draw(&mut self) -> Result<FrameTime> {
        let (before, started) = (cpu_ms(), ThreadTime::now());
        let mut frame = self.ring.begin()?;
        self.renderer.record(&mut frame, &FrameInputs { eyes: &self.eyes, ..self.inputs })?;
        frame.submit(None)?;
        let record = started.elapsed().as_secs_f64() * 1e3;
        let [.., newest] = self.ring.finish_all()?;
        Ok(FrameTime { gpu: newest.total_ms(), cpu: cpu_ms().zip(before).map(|(now, before)| now - before), record })
    }

    /// The last frame's picture as a viewer sees it (`Output::Display`): sRGB bytes, rows from the top, one eye below the
    /// other.
    pub fn display(&self) -> Result<Vec<[u8; 3]>> {
        let pixels: Vec<[u8; 4]> = bytemuck::pod_collect_to_vec(&self.read(4)?);
        Ok(pixels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }

    /// The last frame's radiance (`Output::Linear`), in the same order.
    pub fn radiance(&self) -> Result<Vec<Vec3>> {
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&self.read(16)?);
        Ok(pixels.into_iter().map(|[r, g, b, _]| Vec3::new(r, g, b)).collect())
    }

    fn read(&self, pixel_bytes: u64) -> Result<Vec<u8>> {
        let layers = 0..self.eyes.len() as u32;
        let read = |layer| read_image(&self.gpu, self.renderer.picture(), Subresource { mip: 0, layer }, pixel_bytes);
        Ok(layers.map(read).collect::<Result<Vec<_>>>()?.concat())
    }

    /// The mean of twice `half` frames of `Shading::Reference` and of both halves, converted by `shown`; `drawn` is
    /// called after each frame.
    pub fn integrated<T>(
        &mut self,
        half: u32,
        drawn: impl Fn(),
        shown: impl Fn(&[Vec3]) -> T,
    ) -> Result<MeanAndHalves<T>> {
        let draw = || {
            for _ in 0..half {
                self.draw()?;
                drawn();
            }
            self.radiance()
        };
        MeanAndHalves::new(draw, shown)
    }
}

/// A scene's first camera.
pub fn first_eye(scene: &Scene, [width, height]: [u32; 2]) -> Eye {
    // Every scene that has been loaded has a camera.
    Eye::of_camera(&scene.cameras[0], width as f32 / height as f32)
}

/// Pictures that are compared must have one size.
pub fn size_error() -> Error {
    Error::Usage("pictures of different sizes; this is a defect, please report it".into())
}

/// What computing a scene's lightmap and probes took, seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakeCost {
    /// Processor time of all threads; `None` where the system does not report it.
    pub cpu_s: Option<f64>,
    /// GPU time of all passes.
    pub gpu_s: f64,
}

/// The number of timed frames: at least this many, and at most [`MOST_FRAMES`], until the time is up.
#[derive(Clone, Copy)]
pub struct Budget {
    pub least: usize,
    /// Wall time for all benches together.
    pub seconds: u64,
}

const MOST_FRAMES: usize = 200;

/// Draws a frame of each bench in turn, so that whatever else the machine does disturbs all of them alike; returns each
/// bench's times.
pub fn interleaved(benches: &mut [&mut Bench], budget: Budget) -> Result<Vec<Vec<FrameTime>>> {
    for bench in benches.iter_mut() {
        for _ in 0..WARM_UP {
            bench.draw()?;
        }
    }
    let mut times = vec![Vec::new(); benches.len()];
    let started = Instant::now();
    for round in 0..MOST_FRAMES {
        if round >= budget.least && started.elapsed().as_secs() >= budget.seconds {
            break;
        }
        for (bench, times) in benches.iter_mut().zip(&mut times) {
            times.push(bench.draw()?);
        }
    }
    Ok(times)
}

/// Median and first and last decile of times in milliseconds, or of ratios.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Spread {
    /// `None` without values.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        Some(Self { median: at(0.5), low: at(0.1), high: at(0.9) })
    }
}

/// Distributions of frame times, as in [`FrameTime`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    pub frames: usize,
    pub gpu_ms: Spread,
    pub cpu_ms: Option<Spread>,
    pub record_ms: Spread,
}

impl Cost {
    /// `None` without frames.
    pub fn of(times: &[FrameTime]) -> Option<Self> {
        let spread = |time: fn(&FrameTime) -> f64| Spread::of(times.iter().map(time).collect());
        let cpu: Option<Vec<f64>> = times.iter().map(|time| time.cpu).collect();
        let (gpu_ms, record_ms) = (spread(|time| time.gpu)?, spread(|time| time.record)?);
        Some(Self { frames: times.len(), gpu_ms, cpu_ms: cpu.and_then(Spread::of), record_ms })
    }
}

/// Ratios of the second's to the first's time, per frame of two interleaved benches: GPU time, or, on a software renderer,
/// processor time, which other programs disturb less.
pub fn ratio(gpu: &Gpu, first: &[FrameTime], second: &[FrameTime]) -> Option<Spread> {
    let software = gpu.info().is_software();
    let time = |frame: &FrameTime| frame.cpu.filter(|_| software).unwrap_or(frame.gpu);
    let ratios = first.iter().zip(second).map(|(first, second)| time(second) / time(first));
    Spread::of(ratios.filter(|ratio| ratio.is_finite()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_slow_frame_does_not_move_the_median() {
        let mut times: Vec<f64> = (1..=11).map(f64::from).collect();
        let expected = Some(Spread { median: 6.0, low: 2.0, high: 10.0 });
        assert_eq!(Spread::of(times.clone()), expected);
        times[10] = 1e6;
        times.reverse();
        assert_eq!(Spread::of(times), expected);
        assert_eq!(Spread::of(vec![]), None);
    }
}
