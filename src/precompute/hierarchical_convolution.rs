//! Prefiltering of a panorama by a Barnes–Hut treecode: light is summed over nodes of six quadtrees, coarse ones far
//! from a lobe's centre and fine ones near it. Passes: panorama to cube and finest nodes, coarser nodes, specular
//! levels, irradiance. Derivation: src/precompute/README.md.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::interaction_lists::{InteractionLists, Target, first_node, node_count, tiles_across};
use crate::Result;
use crate::gpu::{
    AddressMode, Binding, BindingType, Buffer, BufferKind, Commands, DescriptorSet, DescriptorSetLayout, Gpu, Image,
    ImageAccess, PassTime, Pipeline, Sampler, Upload, submit_and_wait,
};
use crate::reference::levels::{LEVELS, alpha_from_level};

/// The shaders of the passes, in their order.
pub const SHADERS: [&str; 3] = ["cube_and_nodes.comp", "node_merge.comp", "hierarchical_convolution.comp"];
/// Bytes of `Node` in `glsl/nodes.glsl`.
const NODE_BYTES: u64 = 64;
/// And of what is kept of alpha beside it.
const ALPHA_BYTES: u64 = 16;

/// Push constants of `glsl/node_merge.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MergeBlock {
    first_fine: u32,
    first_coarse: u32,
    size: u32,
}

/// Push constants of `glsl/hierarchical_convolution.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SumBlock {
    alpha2: f32,
    k: f32,
    first_tile: u32,
    first_norm: u32,
}

impl SumBlock {
    fn new(alpha: f64, first_tile: u32, first_norm: u32) -> Self {
        let alpha2 = alpha * alpha;
        Self { alpha2: alpha2 as f32, k: (0.5 * (1.0 - alpha2)) as f32, first_tile, first_norm }
    }
}

/// Specular levels 1.., then irradiance if there is any, for these numbers of texels along a face.
fn targets(face_size: u32, irradiance_size: Option<u32>) -> Vec<Target> {
    (1..LEVELS)
        .map(|level| Target { size: face_size >> (level / 2), alpha: alpha_from_level(level) })
        .chain(irradiance_size.map(|size| Target { size, alpha: 1.0 }))
        .collect()
}

/// Samples of the panorama along each side of a cube texel: two or more for each panorama texel that it spans, at the
/// equator and from pole to pole.
fn taps([width, height]: [u32; 2], face_size: u32) -> u32 {
    width.max(2 * height).div_ceil(2 * face_size).clamp(2, 16)
}

/// Push constants of `glsl/cube_and_nodes.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct NodesBlock {
    inverse_scale: f32,
    first_layer: u32,
}

/// One specular level, or irradiance.
struct Sum {
    set: DescriptorSet,
    block: SumBlock,
    /// Tiles along a face's side.
    across: u32,
}

/// What a panorama's alpha is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alpha {
    /// 1 everywhere.
    One,
    /// A share between 0 and 1 that specular levels average with the light.
    Share,
}

/// Pipelines and descriptor sets for one panorama and its maps. Pipelines have two variants: for the panorama's light,
/// and for uniform white light, whose sums are the norms by which the light's sums are divided.
pub struct HierarchicalConvolution {
    specular: [Arc<Image>; 2],
    irradiance: Option<Arc<Image>>,
    to_cube: [Pipeline; 2],
    to_cube_set: DescriptorSet,
    merge: Pipeline,
    merge_set: DescriptorSet,
    sum: [Pipeline; 2],
    /// Specular levels 1.., then irradiance if there is any.
    sums: Vec<Sum>,
}

/// Indices of a pipeline's variants.
const LIGHT: usize = 0;
const WHITE: usize = 1;

impl HierarchicalConvolution {
    /// Creates pipelines and lists; the faces of all levels are a power of two, at least 2, texels wide. The maps are
    /// cubes, or arrays of as many cubes each; irradiance is left out where there is no map for it.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn new(
        gpu: &Arc<Gpu>,
        (panorama, alpha): (&Arc<Image>, Alpha),
        specular: &[Arc<Image>; 2],
        irradiance: Option<&Arc<Image>>,
    ) -> Result<Self> {
        let size = specular[0].desc().size[0];
        let targets = targets(size, irradiance.map(|map| map.desc().size[0]));
        let lists = InteractionLists::new(size / 2, &targets);
        // Irradiance has two.
        let norms: u32 = targets.iter().chain(targets.last()).map(|target| target.size * target.size).sum();
        let (count, has_alpha) = (u64::from(node_count(size / 2)), u32::from(alpha == Alpha::Share));
        let buffers = [
            Buffer::new(gpu, "nodes", BufferKind::Storage, count * NODE_BYTES)?,
            // Bound even where it is not read.
            Buffer::new(gpu, "alphas", BufferKind::Storage, if has_alpha == 1 { count } else { 1 } * ALPHA_BYTES)?,
            filled(gpu, "node lists", bytemuck::cast_slice(&lists.entries))?,
            filled(gpu, "tiles", bytemuck::cast_slice(&lists.tiles))?,
            Buffer::new(gpu, "norms", BufferKind::Storage, u64::from(norms) * size_of::<f32>() as u64)?,
        ];
        let [nodes, alphas, entries, tiles, norms] = &buffers;
        let sampler = Sampler::new(gpu, "panorama", AddressMode::Panorama, 1)?;
        let set = |layout: &DescriptorSetLayout, bindings: &[Binding<'_>]| {
            DescriptorSet::new(gpu, "hierarchical convolution", layout, bindings)
        };
        let variants = |shader, constants: [&[u32]; 2], layout: &DescriptorSetLayout, push_bytes: usize| {
            let variant = |constants: &[u32]| {
                let constants: Vec<_> = (0..).zip(constants.iter().copied()).collect();
                Pipeline::compute(gpu, shader, &constants, &[layout], push_bytes as u32)
            };
            Ok::<_, crate::Error>([variant(constants[LIGHT])?, variant(constants[WHITE])?])
        };

        let layout = DescriptorSetLayout::new(
            gpu,
            "panorama to cube",
            &[BindingType::Sampled, BindingType::StorageImage, BindingType::Storage, BindingType::Storage],
        )?;
        let bindings = [
            Binding::Sampled(panorama, &sampler),
            Binding::StorageImage(&specular[0], 0),
            Binding::Storage(nodes),
            Binding::Storage(alphas),
        ];
        let taps = taps(panorama.desc().size, size);
        let [to_cube_shader, merge_shader, sum_shader] = SHADERS;
        // White light needs few samples: it is constant over a texel.
        let constants: [&[u32]; 2] = [&[taps, 0, has_alpha], &[2, 1, has_alpha]];
        let to_cube = variants(to_cube_shader, constants, &layout, size_of::<NodesBlock>())?;
        let to_cube_set = set(&layout, &bindings)?;

        let layout = DescriptorSetLayout::new(gpu, "node merge", &[BindingType::Storage; 2])?;
        let constants = [(0, has_alpha)];
        let merge = Pipeline::compute(gpu, merge_shader, &constants, &[&layout], size_of::<MergeBlock>() as u32)?;
        let merge_set = set(&layout, &[Binding::Storage(nodes), Binding::Storage(alphas)])?;

        let binding_types = [
            BindingType::Storage,
            BindingType::Storage,
            BindingType::Storage,
            BindingType::Storage,
            BindingType::StorageImage,
            BindingType::Storage,
        ];
        let layout = DescriptorSetLayout::new(gpu, "hierarchical convolution", &binding_types)?;
        let constants: [&[u32]; 2] = [&[0, has_alpha], &[1, 0]];
        let sum = variants(sum_shader, constants, &layout, size_of::<SumBlock>() + size_of::<u32>())?;
        let outputs = (1..LEVELS).map(|level| (&specular[level % 2], level / 2)).chain(irradiance.map(|map| (map, 0)));
        let mut first_norm = 0;
        let mut sums = Vec::new();
        for ((image, mip), (target, first_tile)) in outputs.zip(targets.iter().zip(&lists.first_tile)) {
            let [nodes, alphas, entries, tiles, norms] = [nodes, alphas, entries, tiles, norms].map(Binding::Storage);
            sums.push(Sum {
                set: set(&layout, &[nodes, entries, tiles, norms, Binding::StorageImage(image, mip), alphas])?,
                block: SumBlock::new(target.alpha, *first_tile, first_norm),
                across: tiles_across(target.size),
            });
            first_norm += target.size * target.size;
        }
        let (specular, irradiance) = (specular.clone(), irradiance.cloned());
        Ok(Self { specular, irradiance, to_cube, to_cube_set, merge, merge_set, sum, sums })
    }

    /// Fills the maps with radiance / `scale` and waits; returns the GPU times of the passes.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn run(&self, gpu: &Arc<Gpu>, scale: f32) -> Result<Vec<PassTime>> {
        submit_and_wait(gpu, |commands| {
            self.maps().for_each(|map| commands.prepare(map, ImageAccess::Storage));
            commands.pass("norms", |commands| self.record_norms(commands));
            commands.pass("panorama to cube and nodes", |commands| self.nodes(commands, LIGHT, scale.recip(), 0));
            let (levels, irradiance) = self.sums.split_at(LEVELS - 1);
            for (name, sums) in [("specular levels", levels), ("irradiance", irradiance)] {
                commands.pass(name, |commands| sums.iter().for_each(|sum| self.sum(commands, LIGHT, sum, 0)));
            }
            self.maps().for_each(|map| commands.prepare(map, ImageAccess::Sampled));
            Ok(())
        })
    }

    /// Specular levels and irradiance.
    fn maps(&self) -> impl Iterator<Item = &Arc<Image>> {
        self.specular.iter().chain(&self.irradiance)
    }

    /// Records the sums for white light, which [`HierarchicalConvolution::record_light`] divides by; once is enough. The maps are
    /// prepared as storage.
    pub fn record_norms(&self, commands: &mut Commands<'_>) {
        self.nodes(commands, WHITE, 1.0, 0);
        self.sums.iter().for_each(|sum| self.sum(commands, WHITE, sum, 0));
        commands.buffers_written();
    }

    /// Records the filling of one cube of each map with radiance / `scale`. The maps are prepared as storage.
    pub fn record_light(&self, commands: &mut Commands<'_>, scale: f32, cube: u32) {
        self.nodes(commands, LIGHT, scale.recip(), cube);
        self.sums.iter().for_each(|sum| self.sum(commands, LIGHT, sum, cube));
        commands.buffers_written();
    }

    fn nodes(&self, commands: &mut Commands<'_>, variant: usize, inverse_scale: f32, cube: u32) {
        let finest = self.specular[0].desc().size[0] / 2;
        let pipeline = &self.to_cube[variant];
        commands.bind(pipeline, &[&self.to_cube_set]);
        commands.push(pipeline, bytemuck::bytes_of(&NodesBlock { inverse_scale, first_layer: 6 * cube }));
        commands.dispatch([finest.div_ceil(8), finest.div_ceil(8), 6]);
        commands.bind(&self.merge, &[&self.merge_set]);
        for size in (0..finest.ilog2()).rev().map(|level| 1 << level) {
            commands.buffers_written();
            let (first_fine, first_coarse) = (first_node(2 * size, finest), first_node(size, finest));
            commands.push(&self.merge, bytemuck::bytes_of(&MergeBlock { first_fine, first_coarse, size }));
            commands.dispatch([size.div_ceil(8), size.div_ceil(8), 6]);
        }
        commands.buffers_written();
    }

    /// All faces for light, one for white light, whose sums are the same for each face.
    fn sum(&self, commands: &mut Commands<'_>, variant: usize, sum: &Sum, cube: u32) {
        let pipeline = &self.sum[variant];
        commands.bind(pipeline, &[&sum.set]);
        let first_layer = 6 * cube;
        commands.push(pipeline, &[bytemuck::bytes_of(&sum.block), bytemuck::bytes_of(&first_layer)].concat());
        commands.dispatch([sum.across, sum.across, if variant == WHITE { 1 } else { 6 }]);
    }
}

fn filled(gpu: &Arc<Gpu>, name: &str, bytes: &[u8]) -> Result<Arc<Buffer>> {
    let buffer = Buffer::new(gpu, name, BufferKind::Storage, bytes.len() as u64)?;
    let mut upload = Upload::new(gpu);
    upload.buffer(&buffer, bytes)?;
    upload.finish()?;
    Ok(buffer)
}

/// Hash of the inputs from the CPU for these sizes: with the shaders, everything that the maps depend on.
#[cfg(test)]
pub(super) fn input_hash(panorama: [u32; 2], face_size: u32, irradiance_size: u32) -> String {
    let mut key = crate::asset::cache::Key::default();
    let targets = targets(face_size, Some(irradiance_size));
    let lists = InteractionLists::new(face_size / 2, &targets);
    key.add(bytemuck::cast_slice(&lists.entries));
    key.add(bytemuck::cast_slice(&lists.tiles));
    for (target, first_tile) in targets.iter().zip(&lists.first_tile) {
        key.add(bytemuck::bytes_of(&SumBlock::new(target.alpha, *first_tile, target.size)));
    }
    key.add(&taps(panorama, face_size).to_le_bytes());
    key.text()
}
