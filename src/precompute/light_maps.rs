//! The light maps of a panorama: the panorama with mips, irradiance, and specular levels.

use std::sync::Arc;

use super::Options;
use super::cache::{CacheKind, cached};
use super::hierarchical_convolution::{self, Alpha, HierarchicalConvolution};
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::{Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Shape, upload_rows};
use crate::reference::levels::{LEVELS, alpha_from_level};
use crate::{Error, Result};

/// Accepted face sizes of specular levels 0 and 1, in texels; powers of two.
const FACE_SIZES: std::ops::RangeInclusive<u32> = 16..=1024;
/// Accepted face sizes of the irradiance map, in texels; powers of two.
const IRRADIANCE_SIZES: std::ops::RangeInclusive<u32> = 4..=128;
/// Largest radiance in the half-float maps without scaling.
const HALF_LIMIT: f32 = 60_000.0;

/// Light maps in the cache: raise the version when interaction lists, lobes, sample counts or [`scale`] change.
pub(super) const CACHE_KIND: CacheKind =
    CacheKind { copying: "light maps from the cache", version: 1, shaders: &[&hierarchical_convolution::SHADERS] };

/// The light maps of a panorama on the GPU. Irradiance and specular levels are divided by `scale`.
pub struct LightMaps {
    /// The panorama with mips, in f32 and unscaled.
    pub panorama: Arc<Image>,
    /// Irradiance over pi.
    pub irradiance_over_pi: Arc<Image>,
    /// The even and the odd levels of `reference::levels`: level i is mip i / 2 of cube i % 2.
    pub specular: [Arc<Image>; 2],
    /// A power of two; 1 unless the panorama exceeds the range of half floats.
    pub scale: f32,
    pub times: Vec<PassTime>,
}

impl LightMaps {
    /// Uploads a panorama and computes its maps, or takes them from the cache.
    ///
    /// # Errors
    /// A face size that is not accepted, a panorama larger than the GPU's largest image, or no memory.
    pub fn new(context: &Context, panorama: &Panorama, options: Options) -> Result<Self> {
        let gpu = &context.gpu;
        check_face_size(options.face_size)?;
        check_irradiance_size(options.irradiance_size)?;
        let size = options.face_size;
        let peak = panorama.texels.iter().flatten().copied().fold(0.0, f32::max);
        let scale = scale(peak);
        let image = upload(gpu, panorama)?;
        let irradiance_over_pi = cube(gpu, "irradiance", options.irradiance_size, 1)?;
        let mips = (LEVELS / 2) as u32;
        let specular = [cube(gpu, "even specular levels", size, mips)?, cube(gpu, "odd specular levels", size, mips)?];
        let compute = || {
            HierarchicalConvolution::new(gpu, (&image, Alpha::One), &specular, Some(&irradiance_over_pi))?
                .run(gpu, scale)
        };
        // The irradiance map depends on the face size too, though its own size does not.
        let sides = [panorama.width, panorama.height, size];
        let source = [bytemuck::cast_slice(&sides), bytemuck::cast_slice(&panorama.texels)];
        let [even, odd] = &specular;
        let maps: [(&str, &Image); 3] =
            [("irradiance", &irradiance_over_pi), ("even specular levels", even), ("odd specular levels", odd)];
        let times = cached(context, &CACHE_KIND, &source, &maps, compute)?;
        Ok(Self { panorama: image, irradiance_over_pi, specular, scale, times })
    }

    /// Roughness of each specular level, the square root of its lobe's alpha. The last is above 1.
    pub fn specular_roughness() -> [f64; LEVELS] {
        std::array::from_fn(|level| alpha_from_level(level).sqrt())
    }
}

/// What radiance is divided by so that a peak fits into half floats: a power of two.
fn scale(peak: f32) -> f32 {
    (peak / HALF_LIMIT).max(1.0).log2().ceil().exp2()
}

/// Checks the face size of specular levels.
///
/// # Errors
/// [`Error::Usage`] if it is not a power of two from 16 to 1024.
pub fn check_face_size(size: u32) -> Result<()> {
    check_size(size, FACE_SIZES)
}

/// Checks the face size of the irradiance map.
///
/// # Errors
/// [`Error::Usage`] if it is not a power of two from 4 to 128.
pub fn check_irradiance_size(size: u32) -> Result<()> {
    check_size(size, IRRADIANCE_SIZES)
}

fn check_size(size: u32, sizes: std::ops::RangeInclusive<u32>) -> Result<()> {
    if sizes.contains(&size) && size.is_power_of_two() {
        return Ok(());
    }
    let (least, most) = (sizes.start(), sizes.end());
    Err(Error::Usage(format!("a face cannot have {size} texels a side; choose a power of two from {least} to {most}")))
}

fn upload(gpu: &Arc<Gpu>, panorama: &Panorama) -> Result<Arc<Image>> {
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
    let width = size[0] as usize;
    upload_rows(gpu, &image, size_of::<[f32; 4]>() as u64, |rows| {
        let texels = &panorama.texels[rows.start as usize * width..rows.end as usize * width];
        texels.iter().flat_map(|[r, g, b]| bytemuck::cast::<_, [u8; 16]>([*r, *g, *b, 1.0])).collect()
    })?;
    Ok(image)
}

fn cube(gpu: &Arc<Gpu>, name: &str, size: u32, mips: u32) -> Result<Arc<Image>> {
    let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | copies;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [size; 2], usage);
    Image::new(gpu, name, ImageDesc { shape: Shape::Cube, mips, ..flat })
}

#[cfg(test)]
#[path = "light_maps_tests.rs"]
mod gpu_tests;
