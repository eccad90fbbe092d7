//! What a panorama becomes for shading: itself with mips, irradiance, and specular levels.

use std::sync::Arc;

use super::kernel_sum::KernelSum;
use crate::asset::Panorama;
use crate::gpu::{Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Shape, Upload};
use crate::reference::levels::LEVELS;
use crate::{Error, Result};

/// Texels along a face of specular levels 0 and 1.
pub const CUBE_SIZE: u32 = 256;
/// Texels along a face of the irradiance map; the clamped cosine leaves nothing finer.
pub const IRRADIANCE_SIZE: u32 = 32;
/// Radiance that the half-float maps hold at most before they are scaled.
const HALF_LIMIT: f32 = 60_000.0;

/// Light of one panorama, ready for shading. Maps hold radiance / `scale`.
pub struct LightMaps {
    /// The panorama with mips, in f32 and unscaled.
    pub panorama: Image,
    /// Irradiance over pi.
    pub irradiance_over_pi: Image,
    /// The even and the odd levels of `reference::levels`: level i is mip i / 2 of cube i % 2.
    pub specular: [Image; 2],
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
        let panorama = upload(gpu, panorama)?;
        let irradiance_over_pi = cube(gpu, "irradiance", IRRADIANCE_SIZE, 1)?;
        let mips = (LEVELS / 2) as u32;
        let specular =
            [cube(gpu, "even specular levels", CUBE_SIZE, mips)?, cube(gpu, "odd specular levels", CUBE_SIZE, mips)?];
        let times = KernelSum::new(gpu, &panorama, &specular, &irradiance_over_pi)?.run(gpu, scale)?;
        Ok(Self { panorama, irradiance_over_pi, specular, scale, times })
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

fn cube(gpu: &Arc<Gpu>, name: &str, size: u32, mips: u32) -> Result<Image> {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::TRANSFER_SRC;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [size; 2], usage);
    Image::new(gpu, name, ImageDesc { shape: Shape::Cube, mips, ..flat })
}

#[cfg(test)]
#[path = "light_maps_tests.rs"]
mod tests;
