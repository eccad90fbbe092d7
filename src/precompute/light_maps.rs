//! What a panorama becomes for shading: itself with mips, irradiance, and specular levels.

use std::sync::Arc;

use super::Options;
use super::cache::cached;
use super::hierarchical_convolution::HierarchicalConvolution;
use crate::asset::Panorama;
use crate::gpu::{Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Shape, upload_rows};
use crate::reference::levels::{LEVELS, alpha_from_level};
use crate::{Error, Result};

/// Texels along a face that specular levels 0 and 1 may have, powers of two.
const FACE_SIZES: std::ops::RangeInclusive<u32> = 16..=1024;
/// Texels along a face that the irradiance map may have, powers of two.
const IRRADIANCE_SIZES: std::ops::RangeInclusive<u32> = 4..=128;
/// Radiance that the half-float maps hold at most before they are scaled.
const HALF_LIMIT: f32 = 60_000.0;

/// Light of one panorama, ready for shading. Maps hold radiance / `scale`.
pub struct LightMaps {
    /// The panorama with mips, in f32 and unscaled.
    pub panorama: Arc<Image>,
    /// Irradiance over pi.
    pub irradiance_over_pi: Arc<Image>,
    /// The even and the odd levels of `reference::levels`: level i is mip i / 2 of cube i % 2.
    pub specular: [Arc<Image>; 2],
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
        check_irradiance_size(options.irradiance_size)?;
        let size = options.face_size;
        let peak = panorama.texels.iter().flatten().copied().fold(0.0, f32::max);
        let scale = (peak / HALF_LIMIT).max(1.0).log2().ceil().exp2();
        let image = upload(gpu, panorama)?;
        let irradiance_over_pi = cube(gpu, "irradiance", options.irradiance_size, 1)?;
        let mips = (LEVELS / 2) as u32;
        let specular = [cube(gpu, "even specular levels", size, mips)?, cube(gpu, "odd specular levels", size, mips)?];
        let compute = || HierarchicalConvolution::new(gpu, &image, &specular, &irradiance_over_pi)?.run(gpu, scale);
        // The irradiance map depends on the face size too, though its own size does not.
        let sides = [panorama.width, panorama.height, size];
        let source = [bytemuck::cast_slice(&sides), bytemuck::cast_slice(&panorama.texels)];
        let [even, odd] = &specular;
        let maps: [(&str, &Image); 3] =
            [("irradiance", &irradiance_over_pi), ("even specular levels", even), ("odd specular levels", odd)];
        let times = cached(gpu, options.cache.as_ref(), "light maps from the cache", &source, &maps, compute)?;
        Ok(Self { panorama: image, irradiance_over_pi, specular, scale, times })
    }

    /// Roughness of each specular level, the square root of its lobe's alpha. The last is above 1.
    pub fn specular_roughness() -> [f64; LEVELS] {
        std::array::from_fn(|level| alpha_from_level(level).sqrt())
    }
}

/// Fails with bad usage unless maps can be made with this many texels along a face.
pub fn check_face_size(size: u32) -> Result<()> {
    check_size(size, FACE_SIZES)
}

/// The same for the irradiance map.
pub fn check_irradiance_size(size: u32) -> Result<()> {
    check_size(size, IRRADIANCE_SIZES)
}

fn check_size(size: u32, sizes: std::ops::RangeInclusive<u32>) -> Result<()> {
    if sizes.contains(&size) && size.is_power_of_two() {
        return Ok(());
    }
    let (least, most) = (sizes.start(), sizes.end());
    Err(Error::Usage(format!("faces of {size} texels cannot be made; a power of two from {least} to {most} can")))
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
