//! Maps on the GPU as KTX2 textures on the CPU, bit for bit.

use std::sync::Arc;

use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::gpu::{Gpu, Image, Shape, read_mips};
use crate::{Error, Result};

/// Copies an image to the CPU; of several, which must have one shape, an array is made with one layer for each.
///
/// # Errors
/// No memory, or images that no KTX2 texture of ours can hold: a defect of the caller.
pub fn read_texture(gpu: &Arc<Gpu>, images: &[&Image]) -> Result<Ktx2> {
    let mut texture = images.first().and_then(|image| blank(image)).ok_or_else(not_storable)?;
    if images.iter().any(|image| !fits(&texture, image)) {
        return Err(not_storable());
    }
    texture.layers = if images.len() == 1 { 0 } else { images.len() as u32 };
    for image in images {
        let mips = read_mips(gpu, image, u64::from(texture.format.bytes()))?;
        texture.levels.iter_mut().zip(mips).for_each(|(level, mip)| level.extend(mip));
    }
    Ok(texture)
}

/// Whether a texture, if it is no array, has the format and shape of an image.
pub(super) fn fits(texture: &Ktx2, image: &Image) -> bool {
    blank(image).is_some_and(|b| {
        (b.format, b.size, b.layers, b.faces, b.levels.len())
            == (texture.format, texture.size, texture.layers, texture.faces, texture.levels.len())
    })
}

/// A texture of an image's format and shape with nothing in its levels.
fn blank(image: &Image) -> Option<Ktx2> {
    let desc = image.desc();
    let format = u32::try_from(desc.format.as_raw()).ok().and_then(TexelFormat::from_vulkan)?;
    let faces = match desc.shape {
        Shape::Flat => 1,
        Shape::Cube => 6,
        Shape::Layers(_) => return None,
    };
    let levels = vec![Vec::new(); desc.mips as usize];
    Some(Ktx2 { format, size: desc.size, layers: 0, faces, levels, key_values: [].into() })
}

fn not_storable() -> Error {
    Error::Usage("these images cannot be made one texture; this is a defect of pbr-vr, please report it".into())
}
