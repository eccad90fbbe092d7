//! A scene's copy on the GPU: geometry, materials with their textures, lights.

mod geometry;
mod materials;
mod textures;
mod vertex;

use std::sync::Arc;

use super::draws::Draw;
use super::shared::LightBlock;
use crate::Result;
use crate::asset::{Report, TextureOptions};
use crate::gpu::{AddressMode, Buffer, BufferKind, DescriptorSetLayout, Gpu, Sampler};
use crate::scene::cluster::clusters;
use crate::scene::{Scene, SceneFeatures};
use geometry::Geometry;
pub use geometry::MeshRange;
use materials::{GpuMaterial, StandIns};
pub use textures::TextureFacts;
pub use vertex::{ATTRIBUTES, PackedVertex};

/// Everything of a scene but its environment.
pub struct SceneResources {
    pub geometry: Geometry,
    pub materials: Vec<GpuMaterial>,
    pub draws: Vec<Draw>,
    pub lights: Arc<Buffer>,
    pub light_count: u32,
    /// The number that shaders are made for; `None` for any.
    pub lights_needed: Option<u32>,
    pub material_layout: DescriptorSetLayout,
    pub texture_facts: TextureFacts,
}

impl SceneResources {
    /// Uploads what a scene needs.
    pub fn new(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        needs: &SceneFeatures,
        options: &TextureOptions,
        report: &Report,
    ) -> Result<Self> {
        let clusters = clusters(&scene.meshes, &scene.instances);
        let geometry = Geometry::new(gpu, &clusters)?;
        let (textures, texture_facts) = textures::upload(gpu, &scene.textures, &needs.first_levels, options, report)?;
        let sampler = Sampler::new(gpu, "material", AddressMode::Repeat, options.anisotropy)?;
        let layout = DescriptorSetLayout::new(gpu, "material", &materials::SLOTS)?;
        let stand_ins = StandIns::new(gpu)?;
        let material = |material| materials::upload(gpu, &layout, material, (&textures, &stand_ins), &sampler);
        let each = scene.materials.iter().zip(needs.materials.iter().copied());
        let materials: Vec<GpuMaterial> = each.map(material).collect::<Result<_>>()?;
        let draws = clusters.iter().zip(&geometry.ranges).flat_map(|(cluster, range)| {
            let masked = materials[cluster.material].needs.alpha_mask;
            cluster.placements.iter().map(move |place| Draw::new(cluster, range.clone(), *place, masked))
        });
        let draws = draws.collect();
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
            lights_needed: needs.lights,
            material_layout: layout,
            texture_facts,
        })
    }
}
