//! Images of the GPU as KTX2 textures, bit for bit.

use std::sync::Arc;

use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::gpu::{Gpu, Image, Shape, read_mips};
use crate::{Error, Result};

/// Copies an image to the CPU. Several flat images or cubes of the same shape become an array.
///
/// # Errors
/// No memory, or images that a [`Ktx2`] cannot hold: a defect of the caller.
pub fn read_texture(gpu: &Arc<Gpu>, images: &[&Image]) -> Result<Ktx2> {
    let mut texture = images.first().and_then(|image| blank(image)).ok_or_else(not_storable)?;
    let several = images.len() > 1;
    if images.iter().any(|image| !fits(&texture, image)) || (several && texture.layers > 0) {
        return Err(not_storable());
    }
    for image in images {
        let mips = read_mips(gpu, image, u64::from(texture.format.bytes()))?;
        texture.levels.iter_mut().zip(mips).for_each(|(level, mip)| level.extend(mip));
    }
    if several {
        texture.layers = images.len() as u32;
    }
    Ok(texture)
}

/// Whether a texture has the format and shape of an image.
pub(super) fn fits(texture: &Ktx2, image: &Image) -> bool {
    blank(image).is_some_and(|b| {
        (b.format, b.size, b.layers, b.faces, b.levels.len())
            == (texture.format, texture.size, texture.layers, texture.faces, texture.levels.len())
    })
}

/// A texture with an image's format and shape, and empty levels.
fn blank(image: &Image) -> Option<Ktx2> {
    let desc = image.desc();
    let format = u32::try_from(desc.format.as_raw()).ok().and_then(TexelFormat::from_vulkan)?;
    let (layers, faces) = match desc.shape {
        Shape::Flat => (0, 1),
        Shape::Layers(layers) => (layers, 1),
        Shape::Cube => (0, 6),
        Shape::CubeArray(cubes) => (cubes, 6),
    };
    let levels = vec![Vec::new(); desc.mips as usize];
    Some(Ktx2 { format, size: desc.size, layers, faces, levels, key_values: [].into() })
}

fn not_storable() -> Error {
    Error::Usage("these images cannot be stored as one texture; this is a defect of pbr-vr, please report it".into())
}
