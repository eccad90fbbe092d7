//! The reference picture that configurations are judged against, and its own error.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::super::bench::{Bench, size_error};
use super::super::noise::{Halves, Parts, blocks, floor_share};
use crate::Result;
use crate::asset::Storage;
use crate::context::Context;
use crate::gpu::Gpu;
use crate::reference::metrics::{Flip, flip, relative_mse};
use crate::reference::tone;
use crate::render::{Eye, Output, RenderSettings, Shading, TextureSettings};
use crate::scene::Scene;

/// The number of reference pixels along a pixel's side: edges are averaged over 16 places a frame, and textures are read
/// from levels so much finer.
const FINENESS: u32 = 4;
/// Samples along a slanted footprint, where they do not take minutes.
const MOST_ANISOTROPY: u32 = 16;

/// A picture's error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// FLIP, mean and largest, of what a viewer sees.
    pub flip: f64,
    pub flip_max: f64,
    /// Relative MSE of linear radiance.
    pub relative_mse: f64,
}

/// Of each pixel's square, the mean radiance; and what a viewer sees, the mean of its light once it is exposed and
/// tone-mapped, as eyes average a finer screen (and multisampling its samples).
pub struct Reference {
    all: Seen,
    halves: [Seen; 2],
    pub facts: ReferenceFacts,
}

/// Each pixel's radiance, and its sRGB bytes.
pub struct Seen {
    pub radiance: Vec<[f32; 3]>,
    pub display: Vec<[u8; 3]>,
}

/// Size, cost and error of the reference picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFacts {
    pub frames: u32,
    /// Pixels drawn along a pixel's side.
    pub fineness: u32,
    /// GPU time of all frames.
    pub gpu_ms: f64,
    /// Mean over the pixels of the standard error over radiance.
    pub standard_error: f64,
    /// Its own error, from its two halves: they are independent, so that their difference has twice the standard deviation of
    /// their mean, and four times its variance; FLIP falls by less ([`floor_share`]).
    pub floor: PictureError,
    /// Pixels per degree of visual angle for FLIP.
    pub pixels_per_degree: f32,
}

/// The view of all pictures: the reference and those that are judged.
#[derive(Clone, Copy)]
pub struct Shot {
    pub eye: Eye,
    pub size: [u32; 2],
    pub exposure_ev: f32,
    /// For FLIP.
    pub pixels_per_degree: f32,
}

/// Texture options of the reference picture's scene.
pub fn textures(gpu: &Gpu) -> TextureSettings {
    let anisotropy = if gpu.info().is_software() { 1 } else { MOST_ANISOTROPY };
    TextureSettings { storage: Some(Storage::Raw), anisotropy: Some(anisotropy), ..TextureSettings::default() }
}

impl Reference {
    /// Draws twice `half` frames of `scene`, which has been loaded with [`textures`].
    pub fn new(context: &Context, shot: Shot, scene: &Scene, settings: &RenderSettings, half: u32) -> Result<Self> {
        let size = shot.size.map(|side| side * FINENESS);
        let (textures, output) = (textures(&context.gpu), Output::Linear);
        let shading = Shading::Reference;
        let settings = RenderSettings { shading, textures, output, viewpoint: None, ..settings.clone() };
        let mut bench = Bench::new(context, scene, settings, size, vec![shot.eye])?;
        let bar = context.report.progress("reference", 2 * u64::from(half));
        let mut gpu_ms = 0.0;
        let draw = || {
            for _ in 0..half {
                gpu_ms += bench.draw()?.gpu;
                bar.inc(1);
            }
            bench.radiance()
        };
        let Parts { all, halves } = Parts::new(draw, |pixels| shot.seen(pixels))?;
        bar.finish_and_clear();
        let apart = shot.error(&halves[0], &halves[1])?;
        let floor = PictureError {
            flip: floor_share() * apart.flip,
            flip_max: floor_share() * apart.flip_max,
            relative_mse: apart.relative_mse / 4.0,
        };
        let facts = ReferenceFacts {
            frames: 2 * half,
            fineness: FINENESS,
            gpu_ms,
            // Of a pixel's FINENESS² samples, whose errors are independent.
            standard_error: bench.standard_error().map_or(f64::INFINITY, |error| error / f64::from(FINENESS)),
            floor,
            pixels_per_degree: shot.pixels_per_degree,
        };
        Ok(Self { all, halves, facts })
    }

    /// A picture's error, and its FLIP against both halves.
    pub fn judge(&self, shot: Shot, picture: &Seen) -> Result<(PictureError, Halves)> {
        let [first, second] = self.halves.each_ref().map(|half| shot.flip(&picture.display, &half.display));
        let halves = Halves([first?, second?].map(|flip| blocks(shot.size, &flip.errors)));
        Ok((shot.error(picture, &self.all)?, halves))
    }
}

impl Shot {
    /// Mean radiance of each pixel's square, and what a viewer sees.
    fn seen(&self, pixels: &[Vec3]) -> Seen {
        let size = self.size.map(|side| side * FINENESS);
        let scale = tone::exposure_scale(f64::from(self.exposure_ev));
        let light = |pixel: Vec3| tone::tone_neutral(pixel.as_dvec3() * scale);
        let byte = |light: DVec3| tone::srgb_encode(light).to_array().map(|c| (255.0 * c).round() as u8);
        let radiance = means(pixels, size, FINENESS, |pixel| pixel.as_dvec3());
        Seen {
            radiance: radiance.into_iter().map(|mean| mean.as_vec3().to_array()).collect(),
            display: means(pixels, size, FINENESS, light).into_iter().map(byte).collect(),
        }
    }

    fn error(&self, picture: &Seen, reference: &Seen) -> Result<PictureError> {
        let flip = self.flip(&picture.display, &reference.display)?;
        let relative_mse = relative_mse(&picture.radiance, &reference.radiance);
        Ok(PictureError { flip: flip.mean.into(), flip_max: flip.max.into(), relative_mse })
    }

    fn flip(&self, test: &[[u8; 3]], reference: &[[u8; 3]]) -> Result<Flip> {
        flip(self.size, test, reference, self.pixels_per_degree).ok_or_else(size_error)
    }
}

/// The mean of a value over each block of `side`² pixels.
fn means(pixels: &[Vec3], [width, height]: [u32; 2], side: u32, value: impl Fn(Vec3) -> DVec3) -> Vec<DVec3> {
    let block = |x: u32, y: u32| {
        let inside = (0..side).flat_map(|v| (0..side).map(move |u| (x * side + u, y * side + v)));
        let sum: DVec3 = inside.map(|(x, y)| value(pixels[(y * width + x) as usize])).sum();
        sum / f64::from(side * side)
    };
    (0..height / side).flat_map(|y| (0..width / side).map(move |x| (x, y))).map(|(x, y)| block(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_pixels_become_their_mean() {
        let pixels: Vec<Vec3> = (0..8 * 4).map(|i| Vec3::new((i % 8) as f32, 1.0, 0.0)).collect();
        let mean = |side| means(&pixels, [8, 4], side, |pixel| pixel.as_dvec3());
        assert_eq!(mean(4), [DVec3::new(1.5, 1.0, 0.0), DVec3::new(5.5, 1.0, 0.0)]);
        assert_eq!(mean(2)[..2], [DVec3::new(0.5, 1.0, 0.0), DVec3::new(2.5, 1.0, 0.0)]);
    }
}
