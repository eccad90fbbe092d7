//! A scene's copy on the GPU: geometry, materials with their textures, lights.

use std::sync::Arc;

use glam::Mat4;

use super::shared::{LightBlock, MaterialBlock};
use crate::Result;
use crate::asset::texture::Encoding;
use crate::asset::{Report, Texture};
use crate::gpu::{
    Bind, Buffer, BufferKind, Edge, Format, Gpu, Image, ImageDesc, ImageUsageFlags, Sampler, Set, SetLayout, Slot,
    Upload,
};
use crate::scene::{Material, Mesh, Scene};

/// The descriptor slots of set 1.
const MATERIAL_SLOTS: [Slot; 4] = [Slot::Uniform, Slot::Sampled, Slot::Sampled, Slot::Sampled];

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

/// One draw: a range of the index buffer, placed.
pub struct Draw {
    pub indices: std::ops::Range<u32>,
    pub first_vertex: i32,
    pub material: usize,
    pub world_from_local: Mat4,
}

/// Everything of a scene but its environment.
pub struct World {
    pub vertices: Buffer,
    pub indices: Buffer,
    pub materials: Vec<GpuMaterial>,
    /// Sorted by what they need, then by material, so that few pipelines and sets are bound.
    pub draws: Vec<Draw>,
    pub lights: Buffer,
    pub light_count: u32,
    pub material_layout: SetLayout,
    // The materials' sets refer to them.
    _textures: Vec<Image>,
    _sampler: Sampler,
}

impl World {
    /// Uploads a scene.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, report: &Report) -> Result<Self> {
        let (vertices, indices, ranges) = upload_geometry(gpu, &scene.meshes)?;
        let textures = upload_textures(gpu, &scene.textures, report)?;
        let sampler = Sampler::new(gpu, "material", Edge::Repeat, true)?;
        let layout = SetLayout::new(gpu, "material", &MATERIAL_SLOTS)?;
        let material = |m: &Material| upload_material(gpu, &layout, m, &textures, &sampler);
        let materials: Vec<GpuMaterial> = scene.materials.iter().map(material).collect::<Result<_>>()?;
        let mut draws: Vec<Draw> = scene
            .instances
            .iter()
            .map(|instance| Draw {
                indices: ranges[instance.mesh].0.clone(),
                first_vertex: ranges[instance.mesh].1,
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
            vertices,
            indices,
            materials,
            draws,
            lights,
            light_count,
            material_layout: layout,
            _textures: textures,
            _sampler: sampler,
        })
    }
}

/// One vertex and one index buffer for all meshes; returns each mesh's index range and first vertex.
type Ranges = Vec<(std::ops::Range<u32>, i32)>;

fn upload_geometry(gpu: &Arc<Gpu>, meshes: &[Mesh]) -> Result<(Buffer, Buffer, Ranges)> {
    let mut ranges = Vec::with_capacity(meshes.len());
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let first = indices.len() as u32;
        ranges.push((first..first + mesh.indices.len() as u32, vertices.len() as i32));
        vertices.extend_from_slice(&mesh.vertices);
        indices.extend_from_slice(&mesh.indices);
    }
    let (vertices, indices): (&[u8], &[u8]) = (bytemuck::cast_slice(&vertices), bytemuck::cast_slice(&indices));
    let vertex_buffer = Buffer::new(gpu, "vertices", BufferKind::Vertex, vertices.len() as u64)?;
    let index_buffer = Buffer::new(gpu, "indices", BufferKind::Index, indices.len() as u64)?;
    let mut upload = Upload::new(gpu);
    if !indices.is_empty() {
        upload.buffer(&vertex_buffer, vertices)?;
        upload.buffer(&index_buffer, indices)?;
    }
    upload.finish()?;
    Ok((vertex_buffer, index_buffer, ranges))
}

/// The scene's textures, and a white one at the end for materials that have none.
fn upload_textures(gpu: &Arc<Gpu>, textures: &[Texture], report: &Report) -> Result<Vec<Image>> {
    let white = Texture { name: "white".into(), width: 1, height: 1, encoding: Encoding::Linear, pixels: vec![255; 4] };
    let images: Vec<Image> =
        textures.iter().chain([&white]).map(|texture| texture_image(gpu, texture)).collect::<Result<_>>()?;
    let progress = report.stage("upload", images.len() as u64);
    let mut upload = Upload::new(gpu);
    for (image, texture) in images.iter().zip(textures.iter().chain([&white])) {
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

fn upload_material(
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
