//! What settings are judged against: the exact picture of a scene, and how exact it is.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::super::noise::{Halves, Parts, blocks};
use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::{CommandBuffer, Gpu, Subresource, read_image};
use crate::reference::metrics::{Flip, flip, relative_mse};
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
pub struct ReferenceAccumulator {
    all: Shown,
    halves: [Shown; 2],
    pub facts: ExactFacts,
}

/// Each pixel's mean radiance, and what a viewer sees of it.
struct Shown {
    radiance: Vec<[f32; 3]>,
    display: Vec<[u8; 3]>,
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
    /// standard deviation of their mean, and four times its variance; FLIP falls by less ([`Parts::floor_share`]).
    pub floor: PictureError,
    /// Of visual angle: how near FLIP sees all pictures.
    pub pixels_per_degree: f32,
}

/// How a rung's pictures and the exact one are taken.
pub struct Stand<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub eye: Eye,
    pub size: [u32; 2],
    pub exposure_ev: f32,
    /// For FLIP.
    pub pixels_per_degree: f32,
}

/// The textures that the exact picture's scene is loaded with.
pub fn textures(gpu: &Gpu) -> TextureOptions {
    let anisotropy = if gpu.info().is_software() { 1 } else { MOST_ANISOTROPY };
    TextureOptions { storage: Storage::Raw, anisotropy, ..TextureOptions::default() }
}

impl ReferenceAccumulator {
    /// Draws four times `quarter` frames of `scene`, which has been loaded with [`textures`].
    pub fn new(stand: &Stand<'_>, scene: &Scene, settings: &Settings, quarter: u32, report: &Report) -> Result<Self> {
        let size = stand.size.map(|side| side * FINENESS);
        let (textures, output) = (textures(stand.gpu), Output::Linear);
        let settings = Settings { textures, output, viewpoint: None, ..settings.clone() };
        let mut renderer = Renderer::new(stand.gpu, scene, settings, Shading::Reference, size, 1, &Report::silent())?;
        let mut recorder = CommandBuffer::new(stand.gpu)?;
        let bar = report.progress("exact", 4 * u64::from(quarter));
        let mut gpu_ms = 0.0;
        let draw = || {
            for frame in 0..quarter as usize {
                let (mut commands, _) = recorder.begin()?;
                renderer.record(&mut commands, frame % FRAMES_IN_FLIGHT, &[stand.eye], None);
                commands.submit(None)?;
                gpu_ms += recorder.finish()?.total_ms();
                bar.inc(1);
            }
            let bytes =
                read_image(stand.gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, Output::Linear.bytes())?;
            Ok::<Vec<[f32; 4]>, Error>(bytemuck::pod_collect_to_vec(&bytes))
        };
        let parts = Parts::new(draw, |pixels| Ok(stand.shown(pixels)))?;
        bar.finish_and_clear();
        let standard_error = renderer.standard_error((quarter as usize - 1) % FRAMES_IN_FLIGHT);
        let share = parts.floor_share(|a, b| Ok(flip_of(stand, &a.display, &b.display)?.mean.into()))?;
        let Parts { all, halves, .. } = parts;
        let apart = errors(stand, (&halves[0].radiance, &halves[0].display), &halves[1])?;
        let floor = PictureError {
            flip: share * apart.flip,
            flip_max: share * apart.flip_max,
            relative_mse: apart.relative_mse / 4.0,
        };
        let facts = ExactFacts {
            frames: 4 * quarter,
            fineness: FINENESS,
            gpu_ms,
            // Of a pixel's FINENESS² samples, whose errors are independent.
            standard_error: standard_error.map_or(f64::INFINITY, |e| e.mean_relative / f64::from(FINENESS)),
            floor,
            pixels_per_degree: stand.pixels_per_degree,
        };
        Ok(Self { all, halves, facts })
    }

    /// How far a picture is from it and from its halves: its radiance, and what a viewer sees of it.
    pub fn judge(
        &self,
        stand: &Stand<'_>,
        radiance: &[[f32; 3]],
        display: &[[u8; 3]],
    ) -> Result<(PictureError, Halves)> {
        let [first, second] = self.halves.each_ref().map(|half| flip_of(stand, display, &half.display));
        let halves = Halves([first?, second?].map(|flip| blocks(stand.size, &flip.errors)));
        Ok((errors(stand, (radiance, display), &self.all)?, halves))
    }
}

impl Stand<'_> {
    /// Mean radiance of each pixel's square, and what a viewer sees.
    fn shown(&self, pixels: &[[f32; 4]]) -> Shown {
        let size = self.size.map(|side| side * FINENESS);
        let scale = tone::exposure_scale(f64::from(self.exposure_ev));
        let light = |pixel: &[f32; 4]| tone::tone_neutral(radiance(pixel) * scale);
        let byte = |light: DVec3| tone::srgb_encode(light).to_array().map(|c| (255.0 * c).round() as u8);
        Shown {
            radiance: mean_radiance(pixels, size, FINENESS),
            display: means(pixels, size, FINENESS, light).into_iter().map(byte).collect(),
        }
    }
}

fn errors(
    stand: &Stand<'_>,
    (radiance, display): (&[[f32; 3]], &[[u8; 3]]),
    reference: &Shown,
) -> Result<PictureError> {
    let flip = flip_of(stand, display, &reference.display)?;
    let relative_mse = relative_mse(radiance, &reference.radiance);
    Ok(PictureError { flip: flip.mean.into(), flip_max: flip.max.into(), relative_mse })
}

fn flip_of(stand: &Stand<'_>, test: &[[u8; 3]], reference: &[[u8; 3]]) -> Result<Flip> {
    flip(stand.size, test, reference, stand.pixels_per_degree)
        .ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))
}

fn mean_radiance(pixels: &[[f32; 4]], size: [u32; 2], side: u32) -> Vec<[f32; 3]> {
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
        assert_eq!(mean_radiance(&pixels, [8, 4], 4), [[1.5, 1.0, 0.0], [5.5, 1.0, 0.0]]);
        assert_eq!(mean_radiance(&pixels, [8, 4], 2)[..2], [[0.5, 1.0, 0.0], [2.5, 1.0, 0.0]]);
    }
}
