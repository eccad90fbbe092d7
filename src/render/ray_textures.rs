//! Reduced copies of a scene's textures, which rays read.

use std::sync::Arc;

use bytemuck::bytes_of;

use super::layouts::Layouts;
use crate::Result;
use crate::gpu::{
    Binding, DescriptorSet, Format, Gpu, Image, ImageAccess, ImageDesc, ImageUsageFlags, Pipeline, Shape,
    submit_and_wait,
};

/// Memory for the reduced textures, and the part of the GPU's that they may take.
const TEXTURE_BYTES: u64 = 192 << 20;
const MEMORY_PART: u64 = 8;
/// Of a texel of each layer with emission, and of extensions.
const TEXEL_BYTES: u64 = 24;
const EXTENSION_BYTES: u64 = 8;
/// Sides of the reduced textures, in texels.
const SIDES: [u32; 6] = [1024, 512, 256, 128, 64, 32];
/// Texels along a side of `glsl/ray_textures.comp`'s workgroups.
const GROUP: u32 = 8;

/// Copies of all textures at one size: layer i holds those of texture set i.
pub struct RayTextures {
    pub base_color: Arc<Image>,
    pub normal: Arc<Image>,
    pub orm: Arc<Image>,
    pub emission: Arc<Image>,
    pub extension: Arc<Image>,
}

impl RayTextures {
    /// Reduces the textures of each set to a layer. `has` says whether any has texels that differ, and maps of emission and of
    /// extensions; what has not takes one texel.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(gpu: &Arc<Gpu>, layouts: &Layouts, sets: &[DescriptorSet], has: [bool; 3]) -> Result<Self> {
        let [any, emissive, extended] = has;
        let texel_bytes = TEXEL_BYTES + if extended { EXTENSION_BYTES } else { 0 };
        let side = if any { affordable_side(gpu, sets.len() as u64 * texel_bytes) } else { 1 };
        let side_of = |has: bool| if has { side } else { 1 };
        let layers = (sets.len() as u32).max(1);
        let image = |name, format, side: u32| {
            let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE;
            let flat = ImageDesc::flat(format, [side; 2], usage);
            Image::new(gpu, name, ImageDesc { shape: Shape::Layers(layers), ..flat })
        };
        // sRGB images cannot be written by shaders, and eight linear bits are too few.
        let textures = Self {
            base_color: image("ray base color", Format::R16G16B16A16_SFLOAT, side)?,
            normal: image("ray normal", Format::R8G8B8A8_UNORM, side)?,
            orm: image("ray orm", Format::R8G8B8A8_UNORM, side)?,
            emission: image("ray emission", Format::R16G16B16A16_SFLOAT, side_of(emissive))?,
            extension: image("ray extension", Format::R16G16B16A16_SFLOAT, side_of(extended))?,
        };
        let Self { base_color, normal, orm, emission, extension } = &textures;
        let targets = |last| {
            let images = [base_color, normal, orm, last].map(|image| Binding::StorageImage(image, 0));
            DescriptorSet::new(gpu, "ray textures", &layouts.ray_textures, &images)
        };
        let passes = [(targets(emission)?, side, 0u32), (targets(extension)?, side_of(extended), 1)];
        let used = [&layouts.frame, &layouts.ray_textures, &layouts.textures];
        let pipeline = Pipeline::compute(gpu, "ray_textures.comp", &[], &used, size_of::<[u32; 2]>() as u32)?;
        submit_and_wait(gpu, |commands| {
            let all = [base_color, normal, orm, emission, extension];
            all.iter().for_each(|image| commands.prepare_fresh(image, ImageAccess::Storage));
            commands.bind_pipeline(&pipeline);
            for (targets, side, is_extension) in &passes {
                commands.bind_set(&pipeline, 1, targets, &[]);
                for (layer, set) in (0u32..).zip(sets) {
                    commands.bind_set(&pipeline, 2, set, &[]);
                    commands.push(&pipeline, bytes_of(&[layer, *is_extension]));
                    commands.dispatch([side.div_ceil(GROUP), side.div_ceil(GROUP), 1]);
                }
            }
            all.iter().for_each(|image| commands.prepare(image, ImageAccess::Sampled));
            Ok(())
        })?;
        Ok(textures)
    }
}

/// The side on this GPU, for so many bytes of each texel in all layers; says if it has little memory.
fn affordable_side(gpu: &Gpu, texel_bytes: u64) -> u32 {
    let usual = side(texel_bytes, TEXTURE_BYTES);
    let side = side(texel_bytes, TEXTURE_BYTES.min(gpu.info().memory / MEMORY_PART));
    if side < usual {
        tracing::warn!("GPU memory: rays see textures of {side}x{side} texels instead of {usual}x{usual}");
    }
    side
}

/// The largest side whose layers fit into the memory for them.
fn side(texel_bytes: u64, memory: u64) -> u32 {
    let fits = |side: &&u32| u64::from(**side) * u64::from(**side) * texel_bytes <= memory;
    *SIDES.iter().find(fits).unwrap_or(&SIDES[SIDES.len() - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_for_rays_stay_within_their_memory() {
        for (layers, want) in [(1, 1024), (8, 1024), (9, 512), (32, 512), (33, 256), (9000, 32)] {
            assert_eq!(side(layers * TEXEL_BYTES, TEXTURE_BYTES), want, "{layers} layers");
        }
    }
}
