//! The split sum's table over n·v and roughness: directional albedo, and where the lobe points.

use std::sync::Arc;

use super::cache::{CacheKind, cached};
use crate::Result;
use crate::context::Context;
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Format, Gpu, Image, ImageAccess,
    ImageDesc, ImageUsageFlags, PassTime, Pipeline, Shape, submit_and_wait,
};
use crate::reference::brdf::Geometry;
use crate::reference::lobe::kernel_spread;
use crate::reference::quadrature::gauss_legendre;
use crate::reference::split_sum::SplitSum;
use crate::reference::table::{table_arguments, table_place};

/// Texels along n·v (the same in `glsl/brdf_table.comp`) and along roughness: the error of bilinear lookups is below
/// 1e-3.
pub const SIZE: [u32; 2] = [128, 96];
/// Quadrature nodes over φ and s; the same in `glsl/brdf_table.comp`.
const NODES: [usize; 2] = [8, 16];

const SHADER: &str = "brdf_table.comp";
/// The table in the cache: raise the version when [`SIZE`], the quadrature, the spreads or the weights change.
pub(super) const CACHE_KIND: CacheKind =
    CacheKind { copying: "BRDF table from the cache", version: 3, shaders: &[&[SHADER]] };

/// Layers in f32 (half floats are too coarse near 1): the two parts' albedos and `along`; their `across`
/// (`reference::table`) with the albedos' means (`reference::energy`).
pub struct BrdfTable {
    pub image: Arc<Image>,
    pub times: Vec<PassTime>,
}

impl BrdfTable {
    /// Description of the texels, for other programs.
    pub const MEANING: &str = "specular albedo = F0 * A + B. Layer 0: A, B, then for the lobes of A and of B \
        sqrt(1 - m.r), m being a lobe's mean vector and r = reflect(-v, n). Layer 1: for both lobes \
        m.t / sqrt(1 - (n.v)^2), t being perpendicular to r, towards n; then A and B averaged over directions, \
        2 ∫ A n.v d(n.v), the same for all n.v. x: log(1 + 1024 n.v) / log(1025), \
        y: cbrt(roughness), 0 and 1 at the centres of the outermost texels";

    /// Computes the table for one geometry term and one kind of environment lookup, or takes it from the cache.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn new(context: &Context, geometry: Geometry, split_sum: SplitSum) -> Result<Self> {
        let gpu = &context.gpu;
        let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | copies;
        let flat = ImageDesc::flat(Format::R32G32B32A32_SFLOAT, SIZE, usage);
        let image = Image::new(gpu, "BRDF table", ImageDesc { shape: Shape::Layers(2), ..flat })?;
        let choices = [geometry as u32, u32::from(split_sum == SplitSum::Classic)];
        let compute = || compute(gpu, &image, choices);
        let source = [bytemuck::bytes_of(&choices)];
        let times = cached(context, &CACHE_KIND, &source, &[("BRDF table", &image)], compute)?;
        Ok(Self { image, times })
    }
}

/// Fills the table and waits; `choices` are the shader's specialization constants.
fn compute(gpu: &Arc<Gpu>, image: &Arc<Image>, choices: [u32; 2]) -> Result<Vec<PassTime>> {
    let nodes = storage(gpu, "quadrature", &quadrature())?;
    let spreads = storage(gpu, "kernel spreads", &classic_spreads())?;
    let weights = storage(gpu, "mean weights", &mean_weights())?;
    let [storage, storage_image] = [BindingType::Storage, BindingType::StorageImage];
    let layout = DescriptorSetLayout::new(gpu, "BRDF table", &[storage, storage, storage, storage_image])?;
    let bindings = [
        Binding::Storage(&nodes),
        Binding::Storage(&spreads),
        Binding::Storage(&weights),
        Binding::StorageImage(image, 0),
    ];
    let set = DescriptorSet::new(gpu, "BRDF table", &layout, &bindings)?;
    let constants = [(0, choices[0]), (1, choices[1])];
    let pipeline = Pipeline::compute(gpu, SHADER, &constants, &[&layout], 0)?;
    submit_and_wait(gpu, |commands| {
        commands.prepare(image, ImageAccess::Storage);
        commands.pass("BRDF table", |commands| {
            commands.bind(&pipeline, &[&set]);
            commands.dispatch([1, SIZE[1], 1]);
        });
        commands.prepare(image, ImageAccess::Sampled);
        Ok(())
    })
}

fn storage<T: bytemuck::Pod>(gpu: &Arc<Gpu>, name: &str, values: &[T]) -> Result<Arc<Buffer>> {
    Buffer::with_bytes(gpu, name, BufferKind::FromCpu, bytemuck::cast_slice(values))
}

/// Nodes and weights over φ, then over s; these run as 1 − (1 − t)² towards the horizon.
fn quadrature() -> Vec<[f32; 2]> {
    let [phi, s] = NODES.map(gauss_legendre);
    let crowded = s.into_iter().map(|[t, w]| [1.0 - (1.0 - t).powi(2), 2.0 * (1.0 - t) * w]);
    phi.into_iter().chain(crowded).map(|node| node.map(|v| v as f32)).collect()
}

/// The weight of each column in 2 ∫ f(n·v) n·v d(n·v) of a function that is interpolated between columns. The weights
/// add up to 1. Derivation: src/precompute/README.md.
fn mean_weights() -> Vec<f32> {
    let mut weights = vec![0.0; SIZE[0] as usize];
    for column in 0..SIZE[0] - 1 {
        let [from, to] = [column, column + 1].map(|column| table_arguments([column, 0], SIZE)[0]);
        for [share, weight] in gauss_legendre(NODES[0]) {
            let cosine = from + share * (to - from);
            let weight = weight * (to - from) * 2.0 * cosine;
            let place = table_place(cosine, 0.0)[0] * f64::from(SIZE[0] - 1) - f64::from(column);
            weights[column as usize] += weight * (1.0 - place);
            weights[column as usize + 1] += weight * place;
        }
    }
    weights.into_iter().map(|weight| weight as f32).collect()
}

/// For each row, the spread of the level that the classic split sum looks up for its roughness.
fn classic_spreads() -> Vec<f32> {
    let roughness = |row| table_arguments([0, row], SIZE)[1];
    (0..SIZE[1]).map(|row| kernel_spread(roughness(row) * roughness(row)) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::cache::Key;

    /// The shader is part of the cache's key; this pins what the CPU gives it. Where it fails because the numbers have
    /// changed on purpose: raise the version of [`CACHE_KIND`], and put the new hash here. Linux only: the last digits
    /// of sines and logarithms are those of the system's library.
    #[test]
    #[cfg_attr(not(all(target_os = "linux", target_arch = "x86_64")), ignore = "other systems round other digits")]
    fn numbers_change_only_with_the_version() {
        let mut key = Key::default();
        key.add(bytemuck::cast_slice(&SIZE));
        key.add(bytemuck::cast_slice(&quadrature()));
        key.add(bytemuck::cast_slice(&classic_spreads()));
        key.add(bytemuck::cast_slice(&mean_weights()));
        assert_eq!((CACHE_KIND.version, &key.text()[..16]), (3, "351f1fb42c094fa8"));
    }
}
