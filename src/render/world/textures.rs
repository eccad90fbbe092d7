//! A scene's textures on the GPU.

use std::sync::Arc;

use crate::Result;
use crate::asset::texture::Encoding;
use crate::asset::{Report, Texture};
use crate::gpu::{Format, Gpu, Image, ImageDesc, ImageUsageFlags, Upload};

/// The scene's textures.
pub fn upload(gpu: &Arc<Gpu>, textures: &[Texture], report: &Report) -> Result<Vec<Image>> {
    let images: Vec<Image> = textures.iter().map(|texture| texture_image(gpu, texture)).collect::<Result<_>>()?;
    let progress = report.stage("upload", images.len() as u64);
    let mut upload = Upload::new(gpu);
    for (image, texture) in images.iter().zip(textures.iter()) {
        upload.texture(image, &texture.pixels)?;
        progress.inc(1);
    }
    upload.finish()?;
    progress.finish_and_clear();
    Ok(images)
}

fn texture_image(gpu: &Arc<Gpu>, texture: &Texture) -> Result<Image> {
    let format = match texture.encoding {
        Encoding::Srgb => Format::R8G8B8A8_SRGB,
        Encoding::Linear | Encoding::Normal => Format::R8G8B8A8_UNORM,
    };
    let size = [texture.width, texture.height];
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST | ImageUsageFlags::TRANSFER_SRC;
    let desc = ImageDesc { mips: ImageDesc::full_mips(size), ..ImageDesc::flat(format, size, usage) };
    Image::new(gpu, &texture.name, desc)
}
