//! The shading of a scene's picture, where nothing blocks light or gives it back: with the default settings, as the
//! reference, and with one approximation after the other replaced.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::super::bench::{Bench, exact, first_eye, size_error};
use super::super::noise::{MeanAndHalves, floor_share};
use super::super::report::stem;
use super::rows::{Ablation, Kind, Row};
use crate::asset::{Storage, TextureOptions};
use crate::context::Context;
use crate::reference::energy::Scattering;
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip};
use crate::reference::split_sum::SplitSum;
use crate::reference::tone::{display_bytes, display_light, srgb_bytes};
use crate::render::{Eye, LightModel, Output, RenderSettings, TextureSettings};
use crate::scene::Scene;
use crate::scene::staging::Staging;
use crate::view::load_staged;
use crate::{Error, Result};

/// Sizes and numbers of samples.
#[derive(Clone, Copy)]
pub struct Detail {
    /// Pixels.
    pub size: [u32; 2],
    /// Places along a pixel's side where all of a pixel is averaged.
    pub places: u32,
    /// Frames of half a reference where nothing blocks light or gives it back.
    pub half: u32,
    /// Frames of half a reference of light along paths, which take many times as long.
    pub half_of_paths: u32,
    /// Texels along a face of a cube that counts as exact.
    pub cube: u32,
}

pub const QUICK: Detail = Detail { size: [192, 144], places: 8, half: 128, half_of_paths: 32, cube: 512 };
pub const FULL: Detail = Detail { size: [640, 480], places: 16, half: 512, half_of_paths: 512, cube: 1024 };

/// Most samples along a slanted footprint.
const MOST_ANISOTROPY: u32 = 16;

/// sRGB bytes, rows from the top.
pub type Picture = Vec<[u8; 3]>;

/// One scene, with its textures in both ways that are compared.
pub struct Subject<'a> {
    context: &'a Context,
    pub name: String,
    pub detail: Detail,
    pub eye: Eye,
    /// Of pictures in which nothing blocks light or gives it back.
    pub settings: RenderSettings,
    /// With compressed textures.
    pub compressed: Scene,
    raw: Scene,
}

impl<'a> Subject<'a> {
    /// Loads a scene, as its first camera sees it.
    pub fn new(context: &'a Context, path: &Path, staging: &Staging, detail: Detail) -> Result<Self> {
        let Context { gpu, cache, report } = context;
        let load = |storage| {
            let textures = TextureOptions { storage, cache: cache.clone(), ..TextureOptions::default() };
            load_staged(path, staging.clone(), &textures, report)
        };
        let (mut compressed, raw) = (load(Storage::Bc)?, load(Storage::Raw)?);
        // What a GPU would read of the blocks, where there is none that does, or where each read takes ten times as long.
        if gpu.info().is_software() || !gpu.compresses_textures() {
            compressed.textures.iter_mut().for_each(|texture| *texture = texture.decompressed());
        }
        let eye = first_eye(&raw, detail.size);
        let anisotropy = Some(TextureOptions::default().anisotropy);
        let textures = TextureSettings { anisotropy, budget_mib: Some(u32::MAX), ..TextureSettings::default() };
        let settings = RenderSettings { textures, light: LightModel::Open, ..RenderSettings::default() };
        Ok(Self { context, name: stem(path), detail, eye, settings, compressed, raw })
    }

    /// Draws everything; each row is kept as soon as it is known.
    pub fn measure(&self, keep: &mut impl FnMut(Vec<Row>) -> Result<()>) -> Result<()> {
        let bar = self.context.report.progress("pictures", 5);
        let seen = self.drawn(&self.compressed, &self.settings)?;
        let bare = top_levels(&self.compressed);
        let parts = self.reference(&top_levels(&self.raw))?;
        let reference = &parts.all;
        bar.inc(1);
        let row = |ablation, words: [&str; 3], seen: &Picture, other: &Picture| {
            let numbers = [self.flip(seen, other)?, self.flip(seen, reference)?, self.flip(other, reference)?];
            Ok::<Row, Error>(Row::new(Kind::Picture, &self.name, ablation, words, numbers))
        };
        // The reference's own error, from its two halves.
        let floor = floor_share() * self.flip(&parts.halves[0], &parts.halves[1])?;
        let words = ["floor", "reference", "its own two halves"];
        let floor = Row::new(Kind::Picture, &self.name, Ablation::Floor, words, [floor, floor, 0.0]);
        keep(vec![row(Ablation::Whole, ["all", "as it is", "exact"], &seen, reference)?, floor])?;
        let exactly = |cause, default, instead, a, b| row(Ablation::Exact, [cause, default, instead], a, b);
        let raw = self.drawn(&self.raw, &self.settings)?;
        keep(vec![exactly("compression", "BC7 and BC5", "raw", &seen, &raw)?])?;
        for (ablation, [cause, default, other], settings) in self.other_settings() {
            let other_picture = self.drawn(&self.compressed, &settings)?;
            keep(vec![row(ablation, [&cause, &default, &other], &seen, &other_picture)?])?;
        }
        bar.inc(1);
        let [radiance, display] = self.averaged(&self.compressed)?;
        let places = format!("{} places", self.detail.places.pow(2));
        bar.inc(1);
        keep(vec![
            exactly("MSAA", "4 samples, shaded once", &places, &seen, &display)?,
            exactly("averaging after the tone curve", "display light", "radiance", &display, &radiance)?,
        ])?;
        let [_, unfiltered] = self.averaged(&bare)?;
        bar.inc(1);
        let words = ("mips and anisotropy, then all places", "all places, finest level");
        keep(vec![exactly("mips", words.0, words.1, &display, &unfiltered)?])?;
        drop(bare);
        let integrated = self.reference(&self.compressed)?.all;
        keep(vec![exactly("split sum, maps and table", "looked up", "integrated", &radiance, &integrated)?])?;
        bar.finish_and_clear();
        Ok(())
    }

    /// Stops.
    pub fn exposure_ev(&self) -> f64 {
        self.raw.exposure_ev.into()
    }

    /// Settings that replace one of the defaults: the cause, the default, the replacement.
    fn other_settings(&self) -> Vec<(Ablation, [String; 3], RenderSettings)> {
        use Ablation::{Exact, Other};
        let mut all = Vec::new();
        let mut add = |ablation, cause: &str, default: &str, other: &str, change: &dyn Fn(&mut RenderSettings)| {
            let mut settings = self.settings.clone();
            change(&mut settings);
            all.push((ablation, [cause, default, other].map(str::to_owned), settings));
        };
        let (texels, samples) = (|side: u32| format!("{side}²"), |count: u32| format!("{count} of a slanted texel"));
        let RenderSettings { cube_size, irradiance_size, textures, .. } = &self.settings;
        let (cube, default, best) = ("cube resolution", texels(*cube_size), texels(self.detail.cube));
        add(Exact, cube, &default, &best, &|s| s.cube_size = self.detail.cube);
        add(Other, cube, &default, &texels(16), &|s| s.cube_size = 16);
        let default = texels(*irradiance_size);
        add(Exact, "irradiance resolution", &default, &texels(128), &|s| s.irradiance_size = 128);
        for count in [1, 2, 4, MOST_ANISOTROPY].into_iter().filter(|count| Some(*count) != textures.anisotropy) {
            let ablation = if count == MOST_ANISOTROPY { Exact } else { Other };
            let change = |s: &mut RenderSettings| s.textures.anisotropy = Some(count);
            add(ablation, "anisotropy", &samples(textures.anisotropy.unwrap_or(1)), &samples(count), &change);
        }
        add(Other, "n = v", "matched by its mean", "classic: along r", &|s| s.split_sum = SplitSum::Classic);
        add(Other, "scattering", "as often as it takes", "once", &|s| s.scattering = Scattering::Single);
        add(Other, "MSAA", "4 samples", "1 sample", &|s| s.samples = 1);
        all
    }

    /// One frame as a viewer sees it.
    pub fn drawn(&self, scene: &Scene, settings: &RenderSettings) -> Result<Picture> {
        let mut bench = self.bench(scene, settings.clone())?;
        bench.draw()?;
        bench.display()
    }

    /// The means over each pixel's square of radiance (tone-mapped after it) and of display light, by pictures of one sample
    /// seen from evenly spread places in it.
    fn averaged(&self, scene: &Scene) -> Result<[Picture; 2]> {
        let settings = RenderSettings { output: Output::Linear, samples: 1, ..self.settings_for(scene) };
        let mut bench = self.bench(scene, settings)?;
        let (count, size, ev) = (self.detail.places, self.detail.size, self.raw.exposure_ev.into());
        let mut sums = vec![[DVec3::ZERO; 2]; size.iter().product::<u32>() as usize];
        for eye in self.places() {
            bench.eyes = vec![eye];
            bench.draw()?;
            for ([radiance, display], light) in sums.iter_mut().zip(bench.radiance()?) {
                *radiance += light.as_dvec3();
                *display += display_light(light.as_dvec3(), ev);
            }
        }
        let mean = |sum: DVec3| sum / f64::from(count * count);
        Ok([
            sums.iter().map(|[sum, _]| display_bytes(mean(*sum), ev)).collect(),
            sums.iter().map(|[_, sum]| srgb_bytes(mean(*sum))).collect(),
        ])
    }

    /// The eye at evenly spread places of a pixel.
    pub fn places(&self) -> impl Iterator<Item = Eye> {
        let count = self.detail.places;
        (0..count * count).map(move |place| {
            let offset = [place % count, place / count].map(|i| (i as f32 + 0.5) / count as f32 - 0.5);
            shifted(&self.eye, offset, self.detail.size)
        })
    }

    /// The reference of many frames, and of both halves of them; radiance is averaged, then tone-mapped.
    fn reference(&self, scene: &Scene) -> Result<MeanAndHalves<Picture>> {
        let mut bench = self.bench(scene, exact(self.settings_for(scene)))?;
        let bytes = |radiance: &Vec3| display_bytes(radiance.as_dvec3(), self.raw.exposure_ev.into());
        bench.integrated(self.detail.half, || (), |pixels| pixels.iter().map(bytes).collect())
    }

    /// Without mips, anisotropic filtering is off: it could not choose a level, and lavapipe would read whole textures.
    pub fn settings_for(&self, scene: &Scene) -> RenderSettings {
        let mut settings = self.settings.clone();
        if scene.textures.iter().all(|texture| texture.levels.len() == 1) {
            settings.textures.anisotropy = Some(1);
        }
        settings
    }

    /// Mean FLIP.
    pub fn flip(&self, a: &Picture, b: &Picture) -> Result<f64> {
        Ok(flip(self.detail.size, a, b, PIXELS_PER_DEGREE).ok_or_else(size_error)?.mean.into())
    }

    /// A renderer of these pictures.
    pub fn bench(&self, scene: &Scene, settings: RenderSettings) -> Result<Bench> {
        Bench::new(self.context, scene, settings, self.detail.size, vec![self.eye])
    }
}

/// The eye looking `offset` pixels beside each pixel's centre.
fn shifted(eye: &Eye, offset: [f32; 2], size: [u32; 2]) -> Eye {
    let dx = offset[0] * (eye.right - eye.left) / size[0] as f32;
    let dy = offset[1] * (eye.up - eye.down) / size[1] as f32;
    Eye { left: eye.left + dx, right: eye.right + dx, down: eye.down + dy, up: eye.up + dy, ..*eye }
}

/// The scene with no level but the finest of each texture.
fn top_levels(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.textures.iter_mut().for_each(|texture| texture.levels.truncate(1));
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_moves_what_is_seen_by_parts_of_a_pixel() {
        let eye = Eye::looking(Vec3::Z, Vec3::ZERO, 60.0, 2.0);
        let moved = shifted(&eye, [0.5, -0.25], [200, 100]);
        let pixel = (eye.right - eye.left) / 200.0;
        assert!((moved.left - eye.left - 0.5 * pixel).abs() < 1e-6 && (moved.up - eye.up + 0.25 * pixel).abs() < 1e-6);
        assert!((moved.right - moved.left - (eye.right - eye.left)).abs() < 1e-6);
        assert_eq!(shifted(&eye, [0.0; 2], [200, 100]), eye);
    }
}
