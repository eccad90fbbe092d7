//! A scene's copy on the GPU: geometry, materials with their textures, lights.

mod geometry;
mod materials;
mod textures;

use std::sync::Arc;

use glam::Mat4;

use super::shared::LightBlock;
use crate::Result;
use crate::asset::{Report, TextureOptions};
use crate::gpu::{Buffer, BufferKind, Edge, Gpu, Image, Sampler, SetLayout};
use crate::scene::{Material, Scene};
use geometry::{Geometry, MeshRange};
use materials::GpuMaterial;
pub use materials::Needs;
pub use textures::TextureFacts;

/// One draw: a range of the index buffer, placed.
pub struct Draw {
    pub range: MeshRange,
    pub material: usize,
    pub world_from_local: Mat4,
}

/// Everything of a scene but its environment.
pub struct World {
    pub geometry: Geometry,
    pub materials: Vec<GpuMaterial>,
    /// Sorted by what they need, then by material, so that few pipelines and sets are bound.
    pub draws: Vec<Draw>,
    pub lights: Buffer,
    pub light_count: u32,
    pub material_layout: SetLayout,
    pub texture_facts: TextureFacts,
    // The materials' sets refer to them.
    _textures: Vec<Image>,
    _sampler: Sampler,
}

impl World {
    /// Uploads a scene.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, options: &TextureOptions, report: &Report) -> Result<Self> {
        let geometry = Geometry::new(gpu, &scene.meshes)?;
        let (textures, texture_facts) = textures::upload(gpu, &scene.textures, options, report)?;
        let sampler = Sampler::new(gpu, "material", Edge::Repeat, options.anisotropy)?;
        let layout = SetLayout::new(gpu, "material", &materials::SLOTS)?;
        let material = |m: &Material| materials::upload(gpu, &layout, m, &textures, &sampler);
        let materials: Vec<GpuMaterial> = scene.materials.iter().map(material).collect::<Result<_>>()?;
        let mut draws: Vec<Draw> = scene
            .instances
            .iter()
            .map(|instance| Draw {
                range: geometry.ranges[instance.mesh].clone(),
                material: scene.meshes[instance.mesh].material,
                world_from_local: instance.world_from_local,
            })
            .collect();
        draws.sort_by_key(|d| {
            let needs = materials[d.material].needs;
            (needs.alpha_mask, needs.normal_map, needs.albedo_map, needs.surface_map, d.material)
        });
        let lights: Vec<LightBlock> = scene
            .lights
            .iter()
            .map(|l| LightBlock { position: l.position.into(), intensity: l.intensity.into() })
            .collect();
        let light_count = u32::try_from(lights.len()).unwrap_or(u32::MAX);
        let light_bytes: &[u8] =
            if lights.is_empty() { &[0; size_of::<LightBlock>()] } else { bytemuck::cast_slice(&lights) };
        let lights = Buffer::with_bytes(gpu, "lights", BufferKind::StorageFromCpu, light_bytes)?;
        Ok(Self {
            geometry,
            materials,
            draws,
            lights,
            light_count,
            material_layout: layout,
            texture_facts,
            _textures: textures,
            _sampler: sampler,
        })
    }
}
