//! A scene's picture: as it is, exact, and with one cause after the other swapped.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::MeasureRequest;
use super::super::noise::Parts;
use super::{Change, Kind, Row, Swap};
use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::{CommandBuffer, Gpu, Subresource, read_image};
use crate::precompute::Options;
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::metrics::{PIXELS_PER_DEGREE, flip, relative_mse};
use crate::reference::table::SplitSum;
use crate::reference::tone::{exposure_scale, srgb_decode, srgb_encode, tone_neutral};
use crate::render::{Eye, FRAMES_IN_FLIGHT, Output, Renderer, Settings, Shading};
use crate::scene::Scene;
use crate::view::load_scene;
use crate::{Error, Result};

/// How much is drawn.
#[derive(Clone, Copy)]
pub struct Extent {
    /// Pixels.
    pub size: [u32; 2],
    /// Places along a pixel's side where all of a pixel is averaged.
    places: u32,
    /// Frames of a quarter of an exact picture.
    quarter: u32,
    /// Texels along a face of a cube that counts as exact.
    cube: u32,
}

pub const QUICK: Extent = Extent { size: [192, 144], places: 8, quarter: 64, cube: 512 };
pub const FULL: Extent = Extent { size: [640, 480], places: 16, quarter: 256, cube: 1024 };

/// Most samples along a slanted footprint.
const MOST_ANISOTROPY: u32 = 16;

/// Linear light of a display, 0 to 1, rows from the top.
type Picture = Vec<[f32; 3]>;

/// One scene, with its textures in all the ways that are compared.
pub struct Bench<'a> {
    gpu: &'a Arc<Gpu>,
    name: String,
    extent: Extent,
    eye: Eye,
    settings: Settings,
    compressed: Scene,
    raw: Scene,
    report: &'a Report,
}

/// The means over a pixel's square of radiance (tone-mapped after it) and of display light.
struct Averaged {
    radiance: Picture,
    display: Picture,
}

impl<'a> Bench<'a> {
    /// Loads a scene, as its first camera sees it.
    pub fn new(
        gpu: &'a Arc<Gpu>,
        path: &Path,
        request: &MeasureRequest<'_>,
        extent: Extent,
        report: &'a Report,
    ) -> Result<Self> {
        let extent = Extent { size: request.picture.unwrap_or(extent.size), ..extent };
        let load = |storage| {
            let textures = TextureOptions { storage, cache: request.cache.cloned(), ..TextureOptions::default() };
            load_scene(path, &textures, report)
        };
        let (mut compressed, raw) = (load(Storage::Bc)?, load(Storage::Raw)?);
        // What a GPU would read of the blocks, where there is none that does, or where each read takes ten times as long.
        if gpu.info().is_software() || !gpu.compresses_textures() {
            compressed.textures.iter_mut().for_each(|texture| *texture = texture.decompressed());
        }
        // A loaded scene has a camera.
        let eye = Eye::of_camera(&raw.cameras[0], extent.size[0] as f32 / extent.size[1] as f32);
        let precompute = Options { cache: request.cache.cloned(), ..Options::default() };
        let textures = TextureOptions { budget_bytes: Some(u64::MAX), ..TextureOptions::default() };
        let settings = Settings { precompute, textures, ..Settings::default() };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { gpu, name, extent, eye, settings, compressed, raw, report })
    }

    /// Draws everything; each row is kept as soon as it is known.
    pub fn measure(&self, keep: &mut impl FnMut(Vec<Row>) -> Result<()>) -> Result<()> {
        let bar = self.report.progress("pictures", 6);
        let seen = self.drawn(&self.compressed, &self.settings)?;
        let (bare, raw_bare) = (top_levels(&self.compressed), top_levels(&self.raw));
        let parts = self.exact(&raw_bare)?;
        let exact = &parts.all;
        bar.inc(1);
        let judge = Judge { name: &self.name, size: self.extent.size, exact };
        keep(vec![judge.row(Swap::Whole, ["all", "as it is", "exact"], &seen, exact)?, judge.floor(&parts)?])?;
        for (swap, words, scene, settings) in self.other_settings() {
            keep(vec![judge.row(swap, [&words[0], &words[1], &words[2]], &seen, &self.drawn(scene, &settings)?)?])?;
        }
        bar.inc(1);
        let many = self.averaged(&self.compressed)?;
        bar.inc(1);
        let bytes = rounded(&many.display);
        let places = format!("{} places", self.extent.places.pow(2));
        keep(vec![
            judge.row(Swap::ReferenceAccumulator, ["MSAA", "4 samples, shaded once", &places], &seen, &bytes)?,
            judge.row(
                Swap::ReferenceAccumulator,
                ["averaging after the tone curve", "display light", "radiance"],
                &many.display,
                &many.radiance,
            )?,
            Row {
                main: None,
                ..judge.row(Swap::ReferenceAccumulator, ["8 bits", "sRGB bytes", "f32"], &bytes, &many.display)?
            },
        ])?;
        let unfiltered = self.averaged(&bare)?;
        bar.inc(1);
        let words = ["mips", "mips and anisotropy, then all places", "all places, finest level"];
        keep(vec![judge.row(Swap::ReferenceAccumulator, words, &many.display, &unfiltered.display)?])?;
        drop((bare, raw_bare));
        let filtered = self.exact(&self.raw)?.all;
        let blocks = self.exact(&self.compressed)?.all;
        bar.inc(2);
        let light = ["split sum, maps and table", "looked up", "integrated"];
        keep(vec![judge.row(Swap::ReferenceAccumulator, light, &many.radiance, &blocks)?])?;
        let chain = [
            (["mips", "mips and anisotropy", "finest level"], &filtered),
            (["compression", "BC7 and BC5", "raw"], &blocks),
            (light, &many.radiance),
            (["averaging after the tone curve", "display light", "radiance"], &many.display),
            (["MSAA and 8 bits", "4 samples, shaded once", &places], &seen),
        ];
        let mut before = exact;
        for (words, after) in chain {
            keep(vec![judge.row(Swap::Chain, words, after, before)?])?;
            before = after;
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// What one setting swaps, drawn as it is otherwise.
    fn other_settings(&self) -> Vec<(Swap, [String; 3], &Scene, Settings)> {
        let now = &self.settings;
        let words = |cause: &str, is: &str, swapped: &str| [cause, is, swapped].map(str::to_owned);
        let with = |change: &dyn Fn(&mut Settings)| {
            let mut settings = now.clone();
            change(&mut settings);
            settings
        };
        let (cube, even, slanted) = (now.precompute.face_size, now.precompute.irradiance_size, now.textures.anisotropy);
        let squared = |size: u32| format!("{size}²");
        let samples = |count: u32| if count == 1 { "1 sample".to_owned() } else { format!("{count} samples") };
        let mut all = vec![
            (Swap::ReferenceAccumulator, words("compression", "BC7 and BC5", "raw"), &self.raw, now.clone()),
            (
                Swap::ReferenceAccumulator,
                words("cube resolution", &squared(cube), &squared(self.extent.cube)),
                &self.compressed,
                with(&|s| s.precompute.face_size = self.extent.cube),
            ),
            (
                Swap::ReferenceAccumulator,
                words("irradiance resolution", &squared(even), &squared(128)),
                &self.compressed,
                with(&|s| s.precompute.irradiance_size = 128),
            ),
            (
                Swap::ReferenceAccumulator,
                words("anisotropy", &samples(slanted), &samples(MOST_ANISOTROPY)),
                &self.compressed,
                with(&|s| s.textures.anisotropy = MOST_ANISOTROPY),
            ),
            (
                Swap::Other,
                words("n = v", "matched by its mean", "classic: along r, by roughness"),
                &self.compressed,
                with(&|s| s.split_sum = SplitSum::Classic),
            ),
            (
                Swap::Other,
                words("slices", "the whole lobe", "two halves, each matched"),
                &self.compressed,
                with(&|s| s.split_sum = SplitSum::Slices),
            ),
            (
                Swap::Other,
                words("scattering", "as often as it takes", "once"),
                &self.compressed,
                with(&|s| s.scattering = Scattering::Single),
            ),
            (
                Swap::Other,
                words("geometry", "Smith", "Karis 2013"),
                &self.compressed,
                with(&|s| s.geometry = Geometry::Karis2013),
            ),
            (Swap::Other, words("MSAA", "4 samples", "1 sample"), &self.compressed, with(&|s| s.samples = 1)),
            (
                Swap::Other,
                words("cube resolution", &squared(cube), &squared(16)),
                &self.compressed,
                with(&|s| s.precompute.face_size = 16),
            ),
        ];
        for count in [1, 2, 4].into_iter().filter(|count| *count != slanted) {
            let settings = with(&|s| s.textures.anisotropy = count);
            let words = words("anisotropy", &samples(slanted), &samples(count));
            all.push((Swap::Other, words, &self.compressed, settings));
        }
        all
    }

    /// One frame as a viewer sees it.
    fn drawn(&self, scene: &Scene, settings: &Settings) -> Result<Picture> {
        let mut renderer = self.renderer(scene, settings.clone(), Shading::Pbr)?;
        let bytes: Vec<[u8; 4]> = bytemuck::pod_collect_to_vec(&self.frame(&mut renderer, 0, &self.eye)?);
        Ok(bytes.into_iter().map(|[r, g, b, _]| light_of([r, g, b])).collect())
    }

    /// All of each pixel's square, by pictures of one sample seen from evenly spread places in it.
    fn averaged(&self, scene: &Scene) -> Result<Averaged> {
        let settings = Settings { output: Output::Linear, samples: 1, ..self.settings_for(scene) };
        let mut renderer = self.renderer(scene, settings, Shading::Pbr)?;
        let count = self.extent.places;
        let mut sums = vec![[DVec3::ZERO; 2]; self.extent.size.iter().product::<u32>() as usize];
        for place in 0..count * count {
            let offset = [place % count, place / count].map(|i| (i as f32 + 0.5) / count as f32 - 0.5);
            let eye = shifted(&self.eye, offset, self.extent.size);
            let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&self.frame(&mut renderer, 0, &eye)?);
            for ([radiance, display], [r, g, b, _]) in sums.iter_mut().zip(pixels) {
                let light = Vec3::new(r, g, b).as_dvec3();
                *radiance += light;
                *display += self.toned(light);
            }
        }
        let mean = |sum: DVec3| sum / f64::from(count * count);
        Ok(Averaged {
            radiance: sums.iter().map(|[sum, _]| self.toned(mean(*sum)).as_vec3().to_array()).collect(),
            display: sums.iter().map(|[_, sum]| mean(*sum).as_vec3().to_array()).collect(),
        })
    }

    /// The integrated picture of many frames, and of parts of them; radiance is averaged, then tone-mapped.
    fn exact(&self, scene: &Scene) -> Result<Parts<Picture>> {
        let settings = Settings { output: Output::Linear, ..self.settings_for(scene) };
        let mut renderer = self.renderer(scene, settings, Shading::Reference)?;
        let quarter = || {
            let mut bytes = Vec::new();
            for frame in 0..self.extent.quarter as usize {
                bytes = self.frame(&mut renderer, frame % FRAMES_IN_FLIGHT, &self.eye)?;
            }
            Ok(bytemuck::pod_collect_to_vec(&bytes))
        };
        let light = |[r, g, b, _]: &[f32; 4]| self.toned(Vec3::new(*r, *g, *b).as_dvec3()).as_vec3().to_array();
        Parts::new(quarter, |pixels| Ok(pixels.iter().map(light).collect()))
    }

    /// Without smaller levels there is nothing that anisotropy could choose; lavapipe walks whole textures for it then.
    fn settings_for(&self, scene: &Scene) -> Settings {
        let mut settings = self.settings.clone();
        if scene.textures.iter().all(|texture| texture.levels.len() == 1) {
            settings.textures.anisotropy = 1;
        }
        settings
    }

    fn toned(&self, radiance: DVec3) -> DVec3 {
        tone_neutral(radiance * exposure_scale(f64::from(self.raw.exposure_ev)))
    }

    fn renderer(&self, scene: &Scene, settings: Settings, shading: Shading) -> Result<Renderer> {
        Renderer::new(self.gpu, scene, settings, shading, self.extent.size, 1, &Report::silent())
    }

    /// Draws a frame and reads the picture.
    fn frame(&self, renderer: &mut Renderer, slot: usize, eye: &Eye) -> Result<Vec<u8>> {
        let mut recorder = CommandBuffer::new(self.gpu)?;
        let (mut commands, _) = recorder.begin()?;
        renderer.record(&mut commands, slot, std::slice::from_ref(eye), None);
        commands.submit(None)?;
        recorder.finish()?;
        let picture = renderer.picture();
        let bytes = if picture.desc().format == Output::Linear.format() { Output::Linear } else { Output::Display };
        read_image(self.gpu, picture, Subresource { mip: 0, layer: 0 }, bytes.bytes())
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

fn light_of(bytes: [u8; 3]) -> [f32; 3] {
    srgb_decode(DVec3::from(bytes.map(|byte| f64::from(byte) / 255.0))).as_vec3().into()
}

fn bytes_of(light: &[f32; 3]) -> [u8; 3] {
    srgb_encode(Vec3::from(*light).as_dvec3()).to_array().map(|c| (c * 255.0).round() as u8) // `as` saturates
}

/// As bytes hold it.
fn rounded(picture: &Picture) -> Picture {
    picture.iter().map(|light| light_of(bytes_of(light))).collect()
}

/// Makes rows of one scene's pictures.
struct Judge<'a> {
    name: &'a str,
    size: [u32; 2],
    exact: &'a Picture,
}

impl Judge<'_> {
    /// From `other` to `seen`, and both against the exact one.
    fn row(&self, swap: Swap, [cause, is, swapped]: [&str; 3], seen: &Picture, other: &Picture) -> Result<Row> {
        let [change, error, error_swapped] =
            [self.apart(seen, other)?, self.apart(seen, self.exact)?, self.apart(other, self.exact)?];
        Ok(Row {
            kind: Kind::Picture,
            subject: self.name.into(),
            swap,
            cause: cause.into(),
            is: is.into(),
            swapped: swapped.into(),
            main: Some(Change::of(change[0], error[0], error_swapped[0])),
            relative_mse: Some(Change::of(change[1], error[1], error_swapped[1])),
        })
    }

    /// What is left of the exact picture's own error: its halves are independent, so that their difference has twice the
    /// standard deviation of their mean, and four times its variance; FLIP falls by less ([`Parts::floor_share`]).
    fn floor(&self, parts: &Parts<Picture>) -> Result<Row> {
        let [half, other_half] = &parts.halves;
        let [flip, mse] = self.apart(half, other_half)?;
        let share = parts.floor_share(|a, b| Ok(self.apart(a, b)?[0]))?;
        let row = self.row(Swap::Floor, ["floor", "exact picture", "its own two halves"], half, other_half)?;
        let only = |value: f64| Some(Change::of(value, value, 0.0));
        Ok(Row { main: only(share * flip), relative_mse: only(mse / 4.0), ..row })
    }

    /// FLIP and relative MSE.
    fn apart(&self, a: &Picture, b: &Picture) -> Result<[f64; 2]> {
        let [shown, reference] = [a, b].map(|picture| picture.iter().map(bytes_of).collect::<Vec<_>>());
        let flip = flip(self.size, &shown, &reference, PIXELS_PER_DEGREE)
            .ok_or_else(|| Error::Usage("pictures of different sizes; this is a defect, please report it".into()))?;
        Ok([flip.mean.into(), relative_mse(a, b)])
    }
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

    #[test]
    fn bytes_survive_a_round_trip_and_light_is_rounded_to_them() {
        for byte in 0..=255 {
            assert_eq!(bytes_of(&light_of([byte; 3])), [byte; 3]);
        }
        let rounded = rounded(&vec![[0.5003; 3]]);
        assert!((rounded[0][0] - 0.5003).abs() < 4e-3 && rounded[0][0] != 0.5003);
    }

    #[test]
    fn a_cause_swapped_with_itself_changes_nothing_and_a_floor_is_a_share_of_what_halves_differ_by() {
        let exact: Picture = (0..32 * 16).map(|i| [(i % 32) as f32 / 32.0; 3]).collect();
        let other: Picture = exact.iter().map(|p| p.map(|c| (c + 0.1).min(1.0))).collect();
        let judge = Judge { name: "s", size: [32, 16], exact: &exact };
        let same = judge.row(Swap::ReferenceAccumulator, ["a", "b", "c"], &other, &other).unwrap();
        for change in [same.main.unwrap(), same.relative_mse.unwrap()] {
            assert!(change.change == 0.0 && change.falls_by == 0.0 && change.error > 0.0, "{change:?}");
        }
        let whole = judge.row(Swap::Whole, ["a", "b", "c"], &other, &exact).unwrap().main.unwrap();
        assert_eq!((whole.change, whole.error_swapped), (whole.error, 0.0));
        let parts = |quarters| Parts { all: exact.clone(), halves: [other.clone(), exact.clone()], quarters };
        let mixed = parts([&other, &exact, &exact, &exact].map(Picture::clone));
        let floor = judge.floor(&mixed).unwrap();
        // Quarters that differ by half of that say that FLIP does not fall at all.
        assert!((floor.main.unwrap().change - whole.change).abs() < 1e-9);
        let halved = judge.floor(&parts([&exact; 4].map(Picture::clone))).unwrap();
        assert!((halved.main.unwrap().change - 0.5 * whole.change).abs() < 1e-9);
        assert!((halved.relative_mse.unwrap().change / floor.relative_mse.unwrap().change - 1.0).abs() < 1e-9);
    }
}
