//! Materials as the GPU reads them: factors, maps, and what their pipeline needs.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Format, Gpu, Image, ImageDesc,
    ImageUsageFlags, Sampler, upload_rows,
};
use crate::render::shared::MaterialBlock;
use crate::scene::{Material, MaterialFeatures};

/// The descriptor slots of set 1.
pub const SLOTS: [BindingType; 4] =
    [BindingType::Uniform, BindingType::Sampled, BindingType::Sampled, BindingType::Sampled];

/// One material, ready to be bound.
pub struct GpuMaterial {
    pub needs: MaterialFeatures,
    pub set: DescriptorSet,
}

/// One texel each, for maps that are not there.
pub struct StandIns {
    /// 1 in every channel.
    white: Arc<Image>,
    /// The normal map that bends nothing: in half float, because no eight-bit number is one half.
    flat: Arc<Image>,
}

impl StandIns {
    /// Uploads them.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let texel = |name, normal: [f32; 4]| {
            let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
            let image = Image::new(gpu, name, ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [1, 1], usage))?;
            let halves = normal.map(half::f16::from_f32);
            upload_rows(gpu, &image, size_of_val(&halves) as u64, |_| bytemuck::cast_slice(&halves).to_vec())?;
            Ok::<_, crate::Error>(image)
        };
        Ok(Self { white: texel("white", [1.0; 4])?, flat: texel("flat normal", [0.5, 0.5, 1.0, 1.0])? })
    }
}

/// Uploads one material, whose pipeline is made for `needs`.
pub fn upload(
    gpu: &Arc<Gpu>,
    layout: &DescriptorSetLayout,
    (material, needs): (&Material, MaterialFeatures),
    (textures, stand_ins): (&[Arc<Image>], &StandIns),
    sampler: &Arc<Sampler>,
) -> Result<GpuMaterial> {
    let block = MaterialBlock {
        base_color: material.base_color_factor.into(),
        metallic: material.metallic_factor,
        roughness: material.roughness_factor,
        alpha_cutoff: material.alpha_cutoff.unwrap_or(0.0),
    };
    let block = Buffer::with_bytes(gpu, &material.name, BufferKind::Uniform, bytemuck::bytes_of(&block))?;
    let map = |index: Option<usize>, absent| Binding::Sampled(index.map_or(absent, |index| &textures[index]), sampler);
    let StandIns { white, flat } = stand_ins;
    let binds = [
        Binding::Uniform(&block),
        map(material.base_color_map, white),
        map(material.normal_map, flat),
        map(material.orm_map, white),
    ];
    Ok(GpuMaterial { needs, set: DescriptorSet::new(gpu, &material.name, layout, &binds)? })
}
