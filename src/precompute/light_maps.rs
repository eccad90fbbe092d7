//! What a panorama becomes for shading: itself with mips, irradiance, and specular levels.

use std::sync::Arc;

use super::lobe;
use crate::asset::Panorama;
use crate::gpu::{
    Bind, Buffer, BufferKind, Commands, Edge, Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Pipeline,
    Sampler, Set, SetLayout, Shape, Slot, Upload, Use, run,
};
use crate::reference::levels::alpha_from_level;
use crate::{Error, Result};

/// Texels along a face of the environment cube and of specular level 0.
const CUBE_SIZE: u32 = 256;
/// Specular levels: faces of 256 down to 4 texels, alpha 0, 1/32 … 1.
const LEVELS: u32 = 7;
/// Texels along a face of the irradiance map; the clamped cosine leaves nothing finer.
const IRRADIANCE_SIZE: u32 = 32;
/// The environment's mip that irradiance is summed from: 32 texels along a face.
const IRRADIANCE_SOURCE_MIP: usize = 3;
/// Samples per texel of specular levels 1, 2 …: more where texels are fewer.
const LOG2_SAMPLES: [u32; LEVELS as usize - 1] = [8, 8, 9, 10, 11, 12];
/// Radiance that the half-float maps hold at most before they are scaled.
const HALF_LIMIT: f32 = 60_000.0;

const HALF_FLOAT: Format = Format::R16G16B16A16_SFLOAT;

/// Light of one panorama, ready for shading. Maps hold radiance / `scale`.
pub struct LightMaps {
    /// The panorama with mips, in f32 and unscaled.
    pub panorama: Image,
    /// Irradiance over pi.
    pub irradiance_over_pi: Image,
    /// Level i holds the lobe of `alpha_from_level(i)`.
    pub specular: Image,
    /// A power of two, 1 unless the panorama is brighter than half floats go.
    pub scale: f32,
    pub times: Vec<PassTime>,
}

impl LightMaps {
    /// Uploads a panorama and computes its maps.
    ///
    /// # Errors
    /// A panorama wider than the GPU's images, or no memory.
    pub fn new(gpu: &Arc<Gpu>, panorama: &Panorama) -> Result<Self> {
        let peak = panorama.texels.iter().flatten().copied().fold(0.0, f32::max);
        let scale = (peak / HALF_LIMIT).max(1.0).log2().ceil().exp2();
        let image = upload(gpu, panorama)?;
        let environment = environment_cube(gpu)?;
        let irradiance = cube(gpu, "irradiance", HALF_FLOAT, IRRADIANCE_SIZE, 1)?;
        let specular = cube(gpu, "specular levels", HALF_FLOAT, CUBE_SIZE, LEVELS)?;
        let passes = Passes::new(gpu, panorama, &image, &environment, &irradiance, &specular)?;
        let times = run(gpu, |commands| {
            passes.record(commands, &environment, &irradiance, &specular, scale);
            Ok(())
        })?;
        Ok(Self { panorama: image, irradiance_over_pi: irradiance, specular, scale, times })
    }

    /// Index of the last specular level.
    pub fn last_level(&self) -> f32 {
        (self.specular.desc().mips - 1) as f32
    }
}

fn upload(gpu: &Arc<Gpu>, panorama: &Panorama) -> Result<Image> {
    let size = [panorama.width, panorama.height];
    let most = gpu.max_image_size();
    if size.iter().any(|s| *s > most) {
        return Err(Error::TooLarge {
            path: panorama.name.clone().into(),
            what: "panorama",
            size: format!("{}x{}", size[0], size[1]),
            limit: format!("{most} texels a side on {}", gpu.info().name),
        });
    }
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST | ImageUsageFlags::TRANSFER_SRC;
    let format = Format::R32G32B32A32_SFLOAT;
    let desc = ImageDesc { mips: ImageDesc::full_mips(size), ..ImageDesc::flat(format, size, usage) };
    let image = Image::new(gpu, &panorama.name, desc)?;
    let texels: Vec<[f32; 4]> = panorama.texels.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let mut upload = Upload::new(gpu);
    upload.texture(&image, bytemuck::cast_slice(&texels))?;
    upload.finish()?;
    Ok(image)
}

/// In f32, so that no rounding adds up from mip to mip.
fn environment_cube(gpu: &Arc<Gpu>) -> Result<Image> {
    cube(gpu, "environment", Format::R32G32B32A32_SFLOAT, CUBE_SIZE, CUBE_SIZE.ilog2() + 1)
}

fn cube(gpu: &Arc<Gpu>, name: &str, format: Format, size: u32, mips: u32) -> Result<Image> {
    let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | copies;
    let flat = ImageDesc::flat(format, [size; 2], usage);
    Image::new(gpu, name, ImageDesc { shape: Shape::Cube, mips, ..flat })
}

/// A compute pipeline with one descriptor set per dispatch, and the faces' size of each.
struct Pass {
    pipeline: Pipeline,
    sets: Vec<(Set, u32)>,
}

impl Pass {
    fn dispatch(&self, commands: &mut Commands<'_>, index: usize, push: &[f32]) {
        let (set, size) = &self.sets[index];
        commands.bind(&self.pipeline, &[set]);
        if !push.is_empty() {
            commands.push(&self.pipeline, bytemuck::cast_slice(push));
        }
        commands.dispatch([size.div_ceil(8), size.div_ceil(8), 6]);
    }
}

struct Passes {
    to_cube: Pass,
    mips: Pass,
    irradiance: Pass,
    specular: Pass,
    // The sets refer to them.
    _lobes: Vec<Buffer>,
    _samplers: [Sampler; 2],
}

impl Passes {
    fn new(
        gpu: &Arc<Gpu>,
        panorama: &Panorama,
        image: &Image,
        environment: &Image,
        irradiance: &Image,
        specular: &Image,
    ) -> Result<Self> {
        let sampler = Sampler::new(gpu, "panorama", Edge::Panorama, false)?;
        let cube_sampler = Sampler::new(gpu, "cube", Edge::Clamp, false)?;
        let to_cube_layout =
            SetLayout::new(gpu, "panorama to cube", &[Slot::Sampled, Slot::StorageImage, Slot::StorageImage])?;
        let specular_layout =
            SetLayout::new(gpu, "specular level", &[Slot::Sampled, Slot::StorageImage, Slot::Storage])?;
        let load_to_store = SetLayout::new(gpu, "load to store", &[Slot::StorageImage, Slot::StorageImage])?;
        // Two taps or more for each panorama texel that a cube texel spans, at the equator and from pole to pole.
        let taps = panorama.width.max(2 * panorama.height).div_ceil(2 * CUBE_SIZE).clamp(2, 16);
        let set = |layout: &SetLayout, binds: &[Bind<'_>]| Set::new(gpu, "precompute", layout, binds);
        let to_cube = Pass {
            pipeline: Pipeline::compute(gpu, "panorama_to_cube.comp", &[(0, taps)], &[&to_cube_layout], 4)?,
            sets: vec![(
                set(
                    &to_cube_layout,
                    &[
                        Bind::Sampled(image, &sampler),
                        Bind::StorageImage(environment, 0),
                        Bind::StorageImage(specular, 0),
                    ],
                )?,
                CUBE_SIZE,
            )],
        };
        let halving = |mip: usize| {
            let binds = [Bind::StorageImage(environment, mip), Bind::StorageImage(environment, mip + 1)];
            Ok((set(&load_to_store, &binds)?, CUBE_SIZE >> (mip + 1)))
        };
        let mips = Pass {
            pipeline: Pipeline::compute(gpu, "cube_mip.comp", &[], &[&load_to_store], 0)?,
            sets: (0..CUBE_SIZE.ilog2() as usize).map(halving).collect::<Result<_>>()?,
        };
        let source = Bind::StorageImage(environment, IRRADIANCE_SOURCE_MIP);
        let irradiance = Pass {
            pipeline: Pipeline::compute(gpu, "irradiance.comp", &[], &[&load_to_store], 0)?,
            sets: vec![(set(&load_to_store, &[source, Bind::StorageImage(irradiance, 0)])?, IRRADIANCE_SIZE)],
        };
        let lobes = (1u32..).zip(LOG2_SAMPLES).map(|(level, log2_count)| {
            let alpha = alpha_from_level(f64::from(level), f64::from(LEVELS - 1));
            let samples = lobe::samples(alpha, log2_count, CUBE_SIZE);
            Buffer::with_bytes(gpu, "lobe", BufferKind::StorageFromCpu, bytemuck::cast_slice(&samples))
        });
        let lobes: Vec<Buffer> = lobes.collect::<Result<_>>()?;
        let level = |(level, lobe): (usize, &Buffer)| {
            let environment = Bind::Sampled(environment, &cube_sampler);
            let binds = [environment, Bind::StorageImage(specular, level), Bind::Storage(lobe)];
            Ok((set(&specular_layout, &binds)?, CUBE_SIZE >> level))
        };
        let specular = Pass {
            pipeline: Pipeline::compute(gpu, "specular.comp", &[], &[&specular_layout], 0)?,
            sets: (1..).zip(&lobes).map(level).collect::<Result<_>>()?,
        };
        Ok(Self { to_cube, mips, irradiance, specular, _lobes: lobes, _samplers: [sampler, cube_sampler] })
    }

    fn record(
        &self,
        commands: &mut Commands<'_>,
        environment: &Image,
        irradiance: &Image,
        specular: &Image,
        scale: f32,
    ) {
        commands.prepare(environment, Use::Storage);
        commands.prepare(irradiance, Use::Storage);
        commands.prepare(specular, Use::Storage);
        commands.pass("panorama to cube", |commands| self.to_cube.dispatch(commands, 0, &[scale.recip()]));
        commands.pass("cube mips", |commands| {
            for mip in 0..self.mips.sets.len() {
                commands.prepare(environment, Use::Storage);
                self.mips.dispatch(commands, mip, &[]);
            }
        });
        commands.prepare(environment, Use::Storage);
        commands.pass("irradiance", |commands| self.irradiance.dispatch(commands, 0, &[]));
        commands.prepare(environment, Use::Sampled);
        commands.pass("specular levels", |commands| {
            (0..self.specular.sets.len()).for_each(|set| self.specular.dispatch(commands, set, &[]));
        });
        commands.prepare(specular, Use::Sampled);
        commands.prepare(irradiance, Use::Sampled);
    }
}

#[cfg(test)]
#[path = "light_maps_tests.rs"]
mod tests;
