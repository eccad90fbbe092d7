//! The reference picture that configurations are judged against, and its own error.

use glam::{DVec3, DVec4, Vec3};
use serde::{Deserialize, Serialize};

use super::super::bench::{Bench, exact, size_error};
use super::super::noise::{Halves, MeanAndHalves, blocks, floor_share};
use crate::Result;
use crate::asset::Storage;
use crate::context::Context;
use crate::reference::metrics::{Flip, flip, relative_mse};
use crate::reference::mip::box_average;
use crate::reference::tone::{display_light, srgb_bytes};
use crate::render::{Eye, LightModel, RenderSettings, TextureSettings};
use crate::scene::Scene;

/// The number of reference pixels along a pixel's side: edges are averaged over 16 places a frame, and textures are read
/// from levels so much finer.
const FINENESS: u32 = 4;

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
    all: Pixels,
    halves: [Pixels; 2],
    pub facts: ReferenceFacts,
}

/// Each pixel's radiance, and its sRGB bytes.
pub struct Pixels {
    pub radiance: Vec<[f32; 3]>,
    pub display: Vec<[u8; 3]>,
}

/// Size, cost and error of the reference picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFacts {
    pub frames: u32,
    /// Pixels drawn along a pixel's side.
    pub fineness: u32,
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
pub fn textures() -> TextureSettings {
    TextureSettings { storage: Some(Storage::Raw), ..TextureSettings::default() }
}

impl Reference {
    /// Draws twice `half` frames of all light in `scene`, along all paths; the scene has been loaded with [`textures`].
    pub fn new(context: &Context, shot: Shot, scene: &Scene, settings: &RenderSettings, half: u32) -> Result<Self> {
        let size = shot.size.map(|side| side * FINENESS);
        let (textures, light) = (textures(), LightModel::Baked);
        let settings = RenderSettings { light, textures, viewpoint: None, ..settings.clone() };
        let mut bench = Bench::new(context, scene, exact(settings), size, vec![shot.eye])?;
        let bar = context.report.progress("reference", 2 * u64::from(half));
        let MeanAndHalves { all, halves } = bench.integrated(half, || bar.inc(1), |pixels| shot.reduced(pixels))?;
        bar.finish_and_clear();
        let apart = shot.difference(&halves[0], &halves[1])?;
        let floor = PictureError {
            flip: floor_share() * apart.flip,
            flip_max: floor_share() * apart.flip_max,
            relative_mse: apart.relative_mse / 4.0,
        };
        let facts =
            ReferenceFacts { frames: 2 * half, fineness: FINENESS, floor, pixels_per_degree: shot.pixels_per_degree };
        Ok(Self { all, halves, facts })
    }

    /// A picture's error, and its FLIP against both halves.
    pub fn compare(&self, shot: Shot, picture: &Pixels) -> Result<(PictureError, Halves)> {
        let [first, second] = self.halves.each_ref().map(|half| shot.flip(&picture.display, &half.display));
        let halves = Halves([first?, second?].map(|flip| blocks(shot.size, &flip.errors)));
        Ok((shot.difference(picture, &self.all)?, halves))
    }
}

impl Shot {
    /// Mean radiance of each pixel's square, and what a viewer sees.
    fn reduced(&self, pixels: &[Vec3]) -> Pixels {
        let fine = self.size.map(|side| side * FINENESS);
        let means = |value: &dyn Fn(DVec3) -> DVec3| {
            let values: Vec<DVec4> = pixels.iter().map(|pixel| value(pixel.as_dvec3()).extend(0.0)).collect();
            box_average(&values, fine, self.size).into_iter().map(DVec4::truncate)
        };
        let display = means(&|radiance| display_light(radiance, self.exposure_ev.into())).map(srgb_bytes).collect();
        Pixels { radiance: means(&|radiance| radiance).map(|mean| mean.as_vec3().to_array()).collect(), display }
    }

    fn difference(&self, picture: &Pixels, reference: &Pixels) -> Result<PictureError> {
        let flip = self.flip(&picture.display, &reference.display)?;
        let relative_mse = relative_mse(&picture.radiance, &reference.radiance);
        Ok(PictureError { flip: flip.mean.into(), flip_max: flip.max.into(), relative_mse })
    }

    fn flip(&self, test: &[[u8; 3]], reference: &[[u8; 3]]) -> Result<Flip> {
        flip(self.size, test, reference, self.pixels_per_degree).ok_or_else(size_error)
    }
}
