//! What a panorama becomes for shading: itself with mips, irradiance, and specular levels.

use std::sync::Arc;

use super::Options;
use super::cache::cached;
use crate::asset::Panorama;
use crate::gpu::{
    Bind, Commands, Edge, Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Pipeline, Sampler, Set, SetLayout,
    Shape, Slot, Upload, Use, run,
};
use crate::reference::levels::alpha_from_level;
use crate::{Error, Result};

/// Texels along a face that the environment cube and specular level 0 may have, powers of two.
const FACE_SIZES: std::ops::RangeInclusive<u32> = 16..=1024;
/// Texels along a face of the irradiance map; the clamped cosine leaves nothing finer.
const IRRADIANCE_SIZE: u32 = 32;
/// Texels along a face of the environment's mip that irradiance is summed from, unless the largest is smaller.
const IRRADIANCE_SOURCE_SIZE: u32 = 32;
/// Samples per texel of a specular level.
const LOG2_SAMPLES: u32 = 8;
/// Radiance that the half-float maps hold at most before they are scaled.
const HALF_LIMIT: f32 = 60_000.0;

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
    /// Uploads a panorama and computes its maps, or takes them from the cache.
    ///
    /// # Errors
    /// A face size that is none, a panorama wider than the GPU's images, or no memory.
    pub fn new(gpu: &Arc<Gpu>, panorama: &Panorama, options: &Options) -> Result<Self> {
        check_face_size(options.face_size)?;
        let size = options.face_size;
        let peak = panorama.texels.iter().flatten().copied().fold(0.0, f32::max);
        let scale = (peak / HALF_LIMIT).max(1.0).log2().ceil().exp2();
        let image = upload(gpu, panorama)?;
        let irradiance = cube(gpu, "irradiance", IRRADIANCE_SIZE, 1)?;
        // Faces down to 4 texels; 7 levels from 256.
        let specular = cube(gpu, "specular levels", size, size.ilog2() - 1)?;
        let compute = || {
            let environment = cube(gpu, "environment", size, size.ilog2() + 1)?;
            let passes = Passes::new(gpu, panorama, &image, &environment, &irradiance, &specular)?;
            run(gpu, |commands| {
                passes.record(commands, &environment, &irradiance, &specular, scale);
                Ok(())
            })
        };
        // The irradiance map depends on the face size too, though its own size does not.
        let sides = [panorama.width, panorama.height, size];
        let source = [bytemuck::cast_slice(&sides), bytemuck::cast_slice(&panorama.texels)];
        let maps = [("irradiance", &irradiance), ("specular levels", &specular)];
        let times = cached(gpu, options.cache.as_ref(), "light maps from the cache", &source, &maps, compute)?;
        Ok(Self { panorama: image, irradiance_over_pi: irradiance, specular, scale, times })
    }

    /// The specular levels' cubes.
    pub fn specular_cubes(&self) -> Vec<&Image> {
        vec![&self.specular]
    }

    /// Roughness of what `specular_cubes` hold: mip 0 of each cube, then mip 1 of each, and so on.
    pub fn specular_roughness(&self) -> Vec<f64> {
        let last = f64::from(self.last_level());
        (0..self.specular.desc().mips).map(|level| alpha_from_level(f64::from(level), last).sqrt()).collect()
    }

    /// Index of the last specular level.
    pub fn last_level(&self) -> f32 {
        (self.specular.desc().mips - 1) as f32
    }
}

/// Fails with bad usage unless maps can be made with this many texels along a face.
pub fn check_face_size(size: u32) -> Result<()> {
    if FACE_SIZES.contains(&size) && size.is_power_of_two() {
        return Ok(());
    }
    let (least, most) = (FACE_SIZES.start(), FACE_SIZES.end());
    Err(Error::Usage(format!("faces of {size} texels cannot be made; a power of two from {least} to {most} can")))
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

fn cube(gpu: &Arc<Gpu>, name: &str, size: u32, mips: u32) -> Result<Image> {
    let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | copies;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [size; 2], usage);
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
        let sample_to_store = SetLayout::new(gpu, "sample to store", &[Slot::Sampled, Slot::StorageImage])?;
        let load_to_store = SetLayout::new(gpu, "load to store", &[Slot::StorageImage, Slot::StorageImage])?;
        let face_size = environment.desc().size[0];
        // Two taps for each panorama texel that a cube texel spans at the equator.
        let taps = (panorama.width.div_ceil(4 * face_size) * 2).clamp(2, 16);
        let set = |layout: &SetLayout, binds: &[Bind<'_>]| Set::new(gpu, "precompute", layout, binds);
        let to_cube = Pass {
            pipeline: Pipeline::compute(gpu, "panorama_to_cube.comp", &[(0, taps)], &[&sample_to_store], 4)?,
            sets: vec![(
                set(&sample_to_store, &[Bind::Sampled(image, &sampler), Bind::StorageImage(environment, 0)])?,
                face_size,
            )],
        };
        let halving = |mip: usize| {
            let binds = [Bind::StorageImage(environment, mip), Bind::StorageImage(environment, mip + 1)];
            Ok((set(&load_to_store, &binds)?, face_size >> (mip + 1)))
        };
        let mips = Pass {
            pipeline: Pipeline::compute(gpu, "cube_mip.comp", &[], &[&load_to_store], 0)?,
            sets: (0..face_size.ilog2() as usize).map(halving).collect::<Result<_>>()?,
        };
        let source_mip = (face_size / IRRADIANCE_SOURCE_SIZE).max(1).ilog2() as usize;
        let source = Bind::StorageImage(environment, source_mip);
        let irradiance = Pass {
            pipeline: Pipeline::compute(gpu, "irradiance.comp", &[], &[&load_to_store], 0)?,
            sets: vec![(set(&load_to_store, &[source, Bind::StorageImage(irradiance, 0)])?, IRRADIANCE_SIZE)],
        };
        let level = |level: usize| {
            let binds = [Bind::Sampled(environment, &cube_sampler), Bind::StorageImage(specular, level)];
            Ok((set(&sample_to_store, &binds)?, face_size >> level))
        };
        let specular = Pass {
            pipeline: Pipeline::compute(gpu, "specular.comp", &[(0, LOG2_SAMPLES)], &[&sample_to_store], 4)?,
            sets: (0..specular.desc().mips as usize).map(level).collect::<Result<_>>()?,
        };
        Ok(Self { to_cube, mips, irradiance, specular })
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
        commands.prepare(specular, Use::CopyTo);
        commands.pass("panorama to cube", |commands| self.to_cube.dispatch(commands, 0, &[scale.recip()]));
        commands.pass("cube mips", |commands| {
            for mip in 0..self.mips.sets.len() {
                commands.prepare(environment, Use::Storage);
                self.mips.dispatch(commands, mip, &[]);
            }
        });
        commands.prepare(environment, Use::Storage);
        commands.pass("irradiance", |commands| self.irradiance.dispatch(commands, 0, &[]));
        // Level 0 is the environment itself.
        commands.prepare(environment, Use::CopyFrom);
        commands.copy_mip0(environment, specular);
        commands.prepare(environment, Use::Sampled);
        commands.prepare(specular, Use::Storage);
        commands.pass("specular levels", |commands| {
            let levels = specular.desc().mips;
            for level in 1..levels {
                let alpha = alpha_from_level(f64::from(level), f64::from(levels - 1));
                self.specular.dispatch(commands, level as usize, &[alpha as f32]);
            }
        });
        commands.prepare(specular, Use::Sampled);
        commands.prepare(irradiance, Use::Sampled);
    }
}
