//! What each approximation does to a scene's picture: two pictures that differ in one factor alone.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;

use super::super::ladder::blocks;
use super::PictureRow;
use crate::asset::{Cache, MipChain, Report, Storage, TextureOptions};
use crate::gpu::{Gpu, Part, Recorder, read_image};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip, relative_mse};
use crate::reference::table::SplitSum;
use crate::reference::tone;
use crate::render::{Eye, FRAMES_IN_FLIGHT, Output, Renderer, Settings, Shading};
use crate::scene::Scene;
use crate::view::{Look, load_scene};
use crate::{Error, Result};

/// Pictures are averaged over so many places of each pixel, along each side.
const PLACES: u32 = 4;
/// No cause, but what the sampled picture can tell.
pub const NOISE: &str = "noise of the sampled BRDF";

/// A scene and what it is seen with.
pub struct Subject<'a> {
    gpu: &'a Arc<Gpu>,
    scene: Scene,
    eye: Eye,
    size: [u32; 2],
    settings: Settings,
    name: String,
    path: PathBuf,
}

/// Linear radiance, and what a viewer sees, decoded from its bytes.
#[derive(Clone)]
struct Seen {
    radiance: Vec<[f32; 3]>,
    display: Vec<[u8; 3]>,
}

impl<'a> Subject<'a> {
    /// Loads a scene with plain textures; light is the shipped default's.
    pub fn new(gpu: &'a Arc<Gpu>, path: &Path, size: [u32; 2], cache: Option<&Cache>, report: &Report) -> Result<Self> {
        let mut settings = Look::default().settings(gpu, cache, report);
        settings.textures.storage = Storage::Raw;
        let scene = load_scene(path, &settings.textures, report)?;
        // A loaded scene has a camera.
        let eye = Eye::of_camera(&scene.cameras[0], size[0] as f32 / size[1] as f32);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { gpu, scene, eye, size, settings, name, path: path.to_owned() })
    }

    /// One row after the other goes to `done` as it is measured.
    pub fn measure(&self, frames: u32, mut done: impl FnMut(PictureRow) -> Result<()>) -> Result<()> {
        let default = self.draw(&self.scene, &self.settings, &[self.eye])?;
        let mut row = |cause, swapped, test: &Seen, reference: &Seen| done(self.row(cause, swapped, test, reference)?);
        for (cause, swapped, settings) in self.swaps() {
            row(cause, swapped, &default, &self.draw(&self.scene, &settings, &[self.eye])?)?;
        }
        let places = self.draw(&self.scene, &self.settings, &self.places())?;
        row("edges", "4 samples a pixel for 64", &default, &places)?;
        row("texture levels", "as they are for 4×4 times finer ones", &places, &self.fine()?)?;
        let averaged = Seen { display: self.displayed(&places.radiance), ..places.clone() };
        row("tone curve", "display values averaged, not radiance", &places, &averaged)?;
        let [exact, half] = self.exact(frames)?;
        row("light from the panorama", "split sum and maps for the sampled BRDF", &averaged, &exact)?;
        // Half the frames are off by √2 as much as all of them, and share half of these.
        row(NOISE, "half the samples for all of them", &half, &exact)?;
        if self.gpu.compresses_textures() {
            row("texture compression", "BC7 and BC5 for plain", &self.compressed()?, &default)?;
        }
        Ok(())
    }

    /// Settings that differ from the default's in one thing, which is exact or finer by far.
    fn swaps(&self) -> Vec<(&'static str, &'static str, Settings)> {
        let plain = &self.settings;
        let precompute = |face_size, irradiance_size| Settings {
            precompute: crate::precompute::Options { face_size, irradiance_size, ..plain.precompute.clone() },
            ..plain.clone()
        };
        let [face, irradiance] = [plain.precompute.face_size, plain.precompute.irradiance_size];
        let mut swaps = vec![
            ("cube texels", "faces of 256² for 1024²", precompute(4 * face, irradiance)),
            ("irradiance texels", "faces of 32² for 128²", precompute(face, 4 * irradiance)),
            (
                "mirror direction",
                "the lobe's mean for classic n = v = r",
                Settings { split_sum: SplitSum::Classic, ..plain.clone() },
            ),
            (
                "masking",
                "height-correlated Smith for Karis 2013",
                Settings { geometry: Geometry::Karis2013, ..plain.clone() },
            ),
            ("scattering", "multiple for single", Settings { scattering: Scattering::Single, ..plain.clone() }),
        ];
        if !self.gpu.info().is_software() {
            let textures = TextureOptions { anisotropy: 16, ..plain.textures.clone() };
            swaps.push(("slanted textures", "8 samples for 16", Settings { textures, ..plain.clone() }));
        }
        swaps
    }

    fn row(&self, cause: &'static str, swapped: &'static str, test: &Seen, reference: &Seen) -> Result<PictureRow> {
        let flip = flip(self.size, &test.display, &reference.display, PIXELS_PER_DEGREE)
            .ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))?;
        let relative_mse = relative_mse(&test.radiance, &reference.radiance);
        Ok(PictureRow { scene: self.name.clone(), cause, swapped, flip: flip.mean.into(), relative_mse })
    }

    /// The eye at the centres of [`PLACES`]² parts of a pixel.
    fn places(&self) -> Vec<Eye> {
        let step = |side: f32, pixels: u32, i: u32| side / pixels as f32 * ((i as f32 + 0.5) / PLACES as f32 - 0.5);
        let places = (0..PLACES * PLACES).map(|i| {
            let Eye { left, right, down, up, .. } = self.eye;
            let dx = step(right - left, self.size[0], i % PLACES);
            let dy = step(up - down, self.size[1], i / PLACES);
            Eye { left: left + dx, right: right + dx, down: down + dy, up: up + dy, ..self.eye }
        });
        places.collect()
    }

    /// The mean of one picture for each eye, both of radiance and of what is displayed.
    fn draw(&self, scene: &Scene, settings: &Settings, eyes: &[Eye]) -> Result<Seen> {
        let radiance = self.mean(scene, settings, Output::Linear, eyes, linear)?;
        let display = self.mean(scene, settings, Output::Display, eyes, |bytes| {
            bytes.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from)).collect()
        })?;
        Ok(Seen { radiance, display: display.iter().map(|p| p.map(|c| c.round() as u8)).collect() })
    }

    fn mean(
        &self,
        scene: &Scene,
        settings: &Settings,
        output: Output,
        eyes: &[Eye],
        pixels: impl Fn(&[u8]) -> Vec<[f32; 3]>,
    ) -> Result<Vec<[f32; 3]>> {
        let settings = Settings { output, ..settings.clone() };
        let mut renderer = self.renderer(scene, settings, Shading::Pbr, self.size)?;
        let (mut sum, mut count) = (vec![[0.0; 3]; (self.size[0] * self.size[1]) as usize], 0.0f32);
        for eye in eyes {
            self.frames(&mut renderer, *eye, 1)?;
            let bytes = read_image(self.gpu, renderer.picture(), Part { mip: 0, layer: 0 }, output.bytes())?;
            sum.iter_mut().zip(pixels(&bytes)).for_each(|(sum, pixel)| (0..3).for_each(|c| sum[c] += pixel[c]));
            count += 1.0;
        }
        Ok(sum.into_iter().map(|pixel| pixel.map(|c| c / count)).collect())
    }

    fn renderer(&self, scene: &Scene, settings: Settings, shading: Shading, size: [u32; 2]) -> Result<Renderer> {
        Renderer::new(self.gpu, scene, settings, shading, size, 1, &Report::silent())
    }

    fn frames(&self, renderer: &mut Renderer, eye: Eye, count: u32) -> Result<()> {
        let mut recorder = Recorder::new(self.gpu)?;
        for frame in 0..count as usize {
            let (mut commands, _) = recorder.begin()?;
            renderer.record(&mut commands, frame % FRAMES_IN_FLIGHT, &[eye], None);
            commands.submit(None)?;
            recorder.finish()?;
        }
        Ok(())
    }

    /// A picture with [`PLACES`]² times the pixels, averaged: as many places of each pixel, textures from finer levels.
    fn fine(&self) -> Result<Seen> {
        let size = self.size.map(|side| side * PLACES);
        let picture = |output: Output| -> Result<Vec<u8>> {
            let settings = Settings { output, ..self.settings.clone() };
            let mut renderer = self.renderer(&self.scene, settings, Shading::Pbr, size)?;
            self.frames(&mut renderer, self.eye, 1)?;
            read_image(self.gpu, renderer.picture(), Part { mip: 0, layer: 0 }, output.bytes())
        };
        let radiance = blocks(&bytemuck::pod_collect_to_vec(&picture(Output::Linear)?), size, PLACES);
        let pixels: Vec<[f32; 4]> =
            picture(Output::Display)?.as_chunks::<4>().0.iter().map(|p| p.map(f32::from)).collect();
        let display = blocks(&pixels, size, PLACES).iter().map(|p| p.map(|c| c.round() as u8)).collect();
        Ok(Seen { radiance, display })
    }

    /// The sampled BRDF at the default's own texture levels, averaged over places of a pixel by its own jitter; and what half
    /// the frames give.
    fn exact(&self, frames: u32) -> Result<[Seen; 2]> {
        let settings = Settings { output: Output::Linear, ..self.settings.clone() };
        let mut renderer = self.renderer(&self.scene, settings, Shading::Reference, self.size)?;
        let mut seen = || -> Result<Seen> {
            self.frames(&mut renderer, self.eye, frames / 2)?;
            let bytes = read_image(self.gpu, renderer.picture(), Part { mip: 0, layer: 0 }, Output::Linear.bytes())?;
            let radiance = linear(&bytes);
            Ok(Seen { display: self.displayed(&radiance), radiance })
        };
        let half = seen()?;
        Ok([seen()?, half])
    }

    fn compressed(&self) -> Result<Seen> {
        // A processor would take long to decode each block for each texel; what comes out is the same.
        let textures = TextureOptions { storage: Storage::Bc, ..self.settings.textures.clone() };
        let mut scene = load_scene(&self.path, &textures, &Report::silent())?;
        scene.textures.iter_mut().for_each(|texture| *texture = MipChain::decompressed(texture));
        self.draw(&scene, &self.settings, &[self.eye])
    }

    fn displayed(&self, radiance: &[[f32; 3]]) -> Vec<[u8; 3]> {
        let ev = f64::from(self.scene.exposure_ev);
        radiance.iter().map(|p| tone::display_bytes(Vec3::from(*p).as_dvec3(), ev)).collect()
    }
}

fn linear(bytes: &[u8]) -> Vec<[f32; 3]> {
    bytemuck::pod_collect_to_vec::<u8, [f32; 4]>(bytes).iter().map(|[r, g, b, _]| [*r, *g, *b]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::shipped;
    use crate::precompute::harness_tests::with_gpu;

    #[test]
    fn a_finer_cube_changes_less_than_another_way_to_look_it_up() {
        let mut rows = Vec::new();
        with_gpu(|gpu| {
            let path = shipped::folder().unwrap().join("scenes/sphere.toml");
            let subject = Subject::new(gpu, &path, [64, 36], None, &Report::silent()).unwrap();
            let mut keep = |row| {
                rows.push(row);
                Ok(())
            };
            subject.measure(8, &mut keep).unwrap();
        });
        let of = |cause: &str| rows.iter().find(|row| row.cause == cause).unwrap_or_else(|| panic!("{cause}: no row"));
        assert!(rows.iter().all(|row| row.flip.is_finite() && row.relative_mse.is_finite()), "{rows:?}");
        assert!(of("cube texels").flip < 0.5 * of("mirror direction").flip, "{rows:?}");
        assert!(of("texture compression").flip > 0.0 && of("edges").flip > 0.0, "{rows:?}");
        // Its radiance is the same; what a viewer sees is not.
        assert!(of("tone curve").relative_mse == 0.0 && of("tone curve").flip > 0.0, "{rows:?}");
        // Tiles are dielectric: nothing of theirs is scattered more than once.
        assert_eq!(of("scattering").flip, 0.0, "{rows:?}");
        assert!(of("light from the panorama").flip > 0.0 && of(NOISE).flip > 0.0, "{rows:?}");
    }
}
