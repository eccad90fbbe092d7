//! What settings are judged against: the exact picture of a scene, and how exact it is.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::{Gpu, Part, Recorder, read_image};
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip, relative_mse};
use crate::reference::tone;
use crate::render::{Eye, FRAMES_IN_FLIGHT, Output, Renderer, Settings, Shading};
use crate::scene::Scene;
use crate::{Error, Result};

/// It is drawn with so many pixels along a pixel's side: edges are averaged over 16 places a frame, and textures are read
/// from levels so much finer.
pub const FINENESS: u32 = 4;
/// Samples along a slanted footprint, where they do not take minutes.
const MOST_ANISOTROPY: u32 = 16;

/// How far a picture is from the exact one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// FLIP, mean and largest, of what a viewer sees.
    pub flip: f64,
    pub flip_max: f64,
    /// Of linear radiance.
    pub relative_mse: f64,
}

/// The exact picture: of each pixel's square, the mean radiance; and what a viewer sees, the mean of its light once it is
/// exposed and tone-mapped, as eyes average a finer screen (and multisampling its samples).
pub struct Exact {
    size: [u32; 2],
    radiance: Vec<[f32; 3]>,
    display: Vec<[u8; 3]>,
    pub facts: ExactFacts,
}

/// What the exact picture took, and what it is worth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactFacts {
    pub frames: u32,
    /// Pixels drawn along a pixel's side.
    pub fineness: u32,
    /// GPU time of all frames.
    pub gpu_ms: f64,
    /// Mean over the pixels of the standard error over radiance.
    pub standard_error: f64,
    /// What is left of its own error, from its two halves: they are independent, so that their difference has twice the
    /// standard deviation of their mean, and four times its variance.
    pub floor: PictureError,
}

/// How a rung's pictures and the exact one are taken.
pub struct Stand<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub eye: Eye,
    pub size: [u32; 2],
    pub exposure_ev: f32,
}

/// The textures that the exact picture's scene is loaded with.
pub fn textures(gpu: &Gpu) -> TextureOptions {
    let anisotropy = if gpu.info().is_software() { 1 } else { MOST_ANISOTROPY };
    TextureOptions { storage: Storage::Raw, anisotropy, ..TextureOptions::default() }
}

impl Exact {
    /// Draws twice `half` frames of `scene`, which has been loaded with [`textures`].
    pub fn new(stand: &Stand<'_>, scene: &Scene, settings: &Settings, half: u32, report: &Report) -> Result<Self> {
        let size = stand.size.map(|side| side * FINENESS);
        let (textures, output) = (textures(stand.gpu), Output::Linear);
        let settings = Settings { textures, output, viewpoint: None, ..settings.clone() };
        let mut renderer = Renderer::new(stand.gpu, scene, settings, Shading::Reference, size, 1, &Report::silent())?;
        let mut recorder = Recorder::new(stand.gpu)?;
        let bar = report.stage("exact", 2 * u64::from(half));
        let mut gpu_ms = 0.0;
        let mut draw = |renderer: &mut Renderer| {
            for frame in 0..half as usize {
                let (mut commands, _) = recorder.begin()?;
                renderer.record(&mut commands, frame % FRAMES_IN_FLIGHT, &[stand.eye], None);
                commands.submit(None)?;
                gpu_ms += recorder.finish()?.total_ms();
                bar.inc(1);
            }
            let bytes = read_image(stand.gpu, renderer.picture(), Part { mip: 0, layer: 0 }, Output::Linear.bytes())?;
            Ok::<Vec<[f32; 4]>, Error>(bytemuck::pod_collect_to_vec(&bytes))
        };
        let first = draw(&mut renderer)?;
        let all = draw(&mut renderer)?;
        bar.finish_and_clear();
        let standard_error = renderer.standard_error((half as usize - 1) % FRAMES_IN_FLIGHT);
        // All frames' mean is that of both halves' means.
        let second = all.iter().zip(&first);
        let second: Vec<[f32; 4]> =
            second.map(|(all, a)| std::array::from_fn(|c| (2.0 * all[c] - a[c]).max(0.0))).collect();
        let [(radiance, display), first, second] = [&all, &first, &second].map(|pixels| stand.shown(pixels));
        let apart = errors(stand.size, (&first.0, &first.1), (&second.0, &second.1))?;
        let floor = PictureError {
            flip: apart.flip / 2.0,
            flip_max: apart.flip_max / 2.0,
            relative_mse: apart.relative_mse / 4.0,
        };
        let facts = ExactFacts {
            frames: 2 * half,
            fineness: FINENESS,
            gpu_ms,
            // Of a pixel's FINENESS² samples, whose errors are independent.
            standard_error: standard_error.map_or(f64::INFINITY, |e| e.mean_relative / f64::from(FINENESS)),
            floor,
        };
        Ok(Self { size: stand.size, radiance, display, facts })
    }

    /// How far a picture is from it: its radiance, and what a viewer sees of it.
    pub fn judge(&self, radiance: &[[f32; 3]], display: &[[u8; 3]]) -> Result<PictureError> {
        errors(self.size, (radiance, display), (&self.radiance, &self.display))
    }
}

impl Stand<'_> {
    /// Mean radiance of each pixel's square, and what a viewer sees.
    fn shown(&self, pixels: &[[f32; 4]]) -> (Vec<[f32; 3]>, Vec<[u8; 3]>) {
        let size = self.size.map(|side| side * FINENESS);
        let scale = tone::exposure_scale(f64::from(self.exposure_ev));
        let light = |pixel: &[f32; 4]| tone::tone_neutral(radiance(pixel) * scale);
        let byte = |light: DVec3| tone::srgb_encode(light).to_array().map(|c| (255.0 * c).round() as u8);
        (blocks(pixels, size, FINENESS), means(pixels, size, FINENESS, light).into_iter().map(byte).collect())
    }
}

type Shown<'a> = (&'a [[f32; 3]], &'a [[u8; 3]]);

fn errors(size: [u32; 2], test: Shown<'_>, reference: Shown<'_>) -> Result<PictureError> {
    let flip = flip(size, test.1, reference.1, PIXELS_PER_DEGREE)
        .ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))?;
    let relative_mse = relative_mse(test.0, reference.0);
    Ok(PictureError { flip: flip.mean.into(), flip_max: flip.max.into(), relative_mse })
}

fn blocks(pixels: &[[f32; 4]], size: [u32; 2], side: u32) -> Vec<[f32; 3]> {
    means(pixels, size, side, radiance).into_iter().map(|mean| mean.as_vec3().to_array()).collect()
}

fn radiance(pixel: &[f32; 4]) -> DVec3 {
    Vec3::from_slice(pixel).as_dvec3()
}

/// The mean of a value over each block of `side`² pixels.
fn means(pixels: &[[f32; 4]], [width, height]: [u32; 2], side: u32, value: impl Fn(&[f32; 4]) -> DVec3) -> Vec<DVec3> {
    let block = |x: u32, y: u32| {
        let inside = (0..side).flat_map(|v| (0..side).map(move |u| (x * side + u, y * side + v)));
        let sum: DVec3 = inside.map(|(x, y)| value(&pixels[(y * width + x) as usize])).sum();
        sum / f64::from(side * side)
    };
    (0..height / side).flat_map(|y| (0..width / side).map(move |x| (x, y))).map(|(x, y)| block(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_pixels_become_their_mean() {
        let pixels: Vec<[f32; 4]> = (0..8 * 4).map(|i| [(i % 8) as f32, 1.0, 0.0, 9.0]).collect();
        assert_eq!(blocks(&pixels, [8, 4], 4), [[1.5, 1.0, 0.0], [5.5, 1.0, 0.0]]);
        assert_eq!(blocks(&pixels, [8, 4], 2)[..2], [[0.5, 1.0, 0.0], [2.5, 1.0, 0.0]]);
    }
}
