//! Materials as the GPU reads them: factors, maps, and what their pipeline needs.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Bind, Buffer, BufferKind, Gpu, Image, Sampler, Set, SetLayout, Slot};
use crate::render::shared::MaterialBlock;
use crate::scene::Material;

/// The descriptor slots of set 1.
pub const SLOTS: [Slot; 4] = [Slot::Uniform, Slot::Sampled, Slot::Sampled, Slot::Sampled];

/// What a material needs of its pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Needs {
    pub albedo_map: bool,
    pub normal_map: bool,
    pub surface_map: bool,
    pub alpha_mask: bool,
}

/// One material, ready to be bound.
pub struct GpuMaterial {
    pub needs: Needs,
    pub set: Set,
    // The set refers to it.
    _block: Buffer,
}

/// Uploads one material; the last of `textures` is white, for maps that are not there.
pub fn upload(
    gpu: &Arc<Gpu>,
    layout: &SetLayout,
    material: &Material,
    textures: &[Image],
    sampler: &Sampler,
) -> Result<GpuMaterial> {
    let block = MaterialBlock {
        albedo: material.albedo_factor.into(),
        metallic: material.metallic_factor,
        roughness: material.roughness_factor,
        alpha_cutoff: material.alpha_cutoff.unwrap_or(0.0),
    };
    let block = Buffer::with_bytes(gpu, &material.name, BufferKind::Uniform, bytemuck::bytes_of(&block))?;
    let white = textures.len() - 1;
    let map = |index: Option<usize>| Bind::Sampled(&textures[index.unwrap_or(white)], sampler);
    let binds = [Bind::Uniform(&block), map(material.albedo_map), map(material.normal_map), map(material.surface_map)];
    let needs = Needs {
        albedo_map: material.albedo_map.is_some(),
        normal_map: material.normal_map.is_some(),
        surface_map: material.surface_map.is_some(),
        alpha_mask: material.alpha_cutoff.is_some(),
    };
    Ok(GpuMaterial { needs, set: Set::new(gpu, &material.name, layout, &binds)?, _block: block })
}
