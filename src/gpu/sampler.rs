//! Samplers: filtering, addressing beyond an image's edge, and comparisons for shadow maps.

use std::sync::Arc;

use ash::vk;

use super::deferred::Deferred;
use super::device::Gpu;
use crate::{Error, Result};

/// How a sampler addresses texels beyond an image's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AddressMode {
    Repeat,
    /// Repeats, every other time mirrored.
    Mirror,
    Clamp,
    /// Repeats along u, clamps along v: panoramas.
    Panorama,
    /// Returns 0 in colour and depth, 1 in alpha.
    BlackBorder,
    /// Returns 1 in all channels.
    WhiteBorder,
}

impl AddressMode {
    fn raw(self) -> [vk::SamplerAddressMode; 2] {
        use vk::SamplerAddressMode as M;
        match self {
            Self::Repeat => [M::REPEAT; 2],
            Self::Mirror => [M::MIRRORED_REPEAT; 2],
            Self::Clamp => [M::CLAMP_TO_EDGE; 2],
            Self::Panorama => [M::REPEAT, M::CLAMP_TO_EDGE],
            Self::BlackBorder | Self::WhiteBorder => [M::CLAMP_TO_BORDER; 2],
        }
    }

    fn border(self) -> vk::BorderColor {
        match self {
            Self::WhiteBorder => vk::BorderColor::FLOAT_OPAQUE_WHITE,
            _ => vk::BorderColor::FLOAT_OPAQUE_BLACK,
        }
    }
}

/// A comparison of a new depth, on the left, with a stored one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compare {
    Less,
    LessOrEqual,
    Equal,
    GreaterOrEqual,
    Greater,
    Always,
}

impl Compare {
    pub(super) fn raw(self) -> vk::CompareOp {
        match self {
            Self::Less => vk::CompareOp::LESS,
            Self::LessOrEqual => vk::CompareOp::LESS_OR_EQUAL,
            Self::Equal => vk::CompareOp::EQUAL,
            Self::GreaterOrEqual => vk::CompareOp::GREATER_OR_EQUAL,
            Self::Greater => vk::CompareOp::GREATER,
            Self::Always => vk::CompareOp::ALWAYS,
        }
    }
}

/// Trilinear filtering, none, or filtered comparisons. Shared by reference count: descriptor sets hold the samplers they bind.
pub struct Sampler {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::Sampler,
}

impl Sampler {
    /// Creates a trilinear sampler that takes up to `anisotropy` samples along a slanted footprint, where the GPU can;
    /// 1 for isotropic filtering.
    pub fn new(gpu: &Arc<Gpu>, name: &str, address: AddressMode, anisotropy: u32) -> Result<Arc<Self>> {
        Self::create(gpu, name, &anisotropic(gpu, info(vk::Filter::LINEAR, address), anisotropy))
    }

    /// Creates a sampler for a material's map, with its own address mode along u and along v; `nearest`: magnified texels are
    /// squares.
    pub fn of_material(gpu: &Arc<Gpu>, [u, v]: [AddressMode; 2], nearest: bool, anisotropy: u32) -> Result<Arc<Self>> {
        let magnified = if nearest { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        let info = info(vk::Filter::LINEAR, u).address_mode_v(v.raw()[1]).mag_filter(magnified);
        Self::create(gpu, "material", &anisotropic(gpu, info, anisotropy))
    }

    /// Creates a sampler that returns the nearest texel of the nearest mip: for depth images, which not every GPU filters.
    pub fn nearest(gpu: &Arc<Gpu>, name: &str, address: AddressMode) -> Result<Arc<Self>> {
        let info = info(vk::Filter::NEAREST, address).mipmap_mode(vk::SamplerMipmapMode::NEAREST);
        Self::create(gpu, name, &info)
    }

    /// Creates a sampler for `sampler2DShadow` and its like on depth images: it returns the share of the four nearest
    /// texels that pass. The shader's reference depth is the new depth of `compare`.
    pub fn compare(gpu: &Arc<Gpu>, name: &str, address: AddressMode, compare: Compare) -> Result<Arc<Self>> {
        let info = info(vk::Filter::LINEAR, address)
            .mipmap_mode(vk::SamplerMipmapMode::NEAREST)
            .compare_enable(true)
            .compare_op(compare.raw());
        Self::create(gpu, name, &info)
    }

    fn create(gpu: &Arc<Gpu>, name: &str, info: &vk::SamplerCreateInfo<'_>) -> Result<Arc<Self>> {
        // SAFETY: the device is alive; anisotropy is enabled only where the feature was.
        let raw = unsafe { gpu.device.create_sampler(info, None) }.map_err(Error::vulkan("creating a sampler"))?;
        gpu.name(raw, name);
        Ok(Arc::new(Self { gpu: Arc::clone(gpu), raw }))
    }
}

/// The sampler with up to so many samples along a slanted footprint, where the GPU can.
fn anisotropic<'a>(gpu: &Gpu, info: vk::SamplerCreateInfo<'a>, samples: u32) -> vk::SamplerCreateInfo<'a> {
    let most = gpu.max_anisotropy.filter(|_| samples > 1).map(|most| most.min(samples as f32));
    info.anisotropy_enable(most.is_some()).max_anisotropy(most.unwrap_or(1.0))
}

fn info(filter: vk::Filter, address: AddressMode) -> vk::SamplerCreateInfo<'static> {
    let [u, v] = address.raw();
    vk::SamplerCreateInfo::default()
        .mag_filter(filter)
        .min_filter(filter)
        .mipmap_mode(vk::SamplerMipmapMode::LINEAR)
        .address_mode_u(u)
        .address_mode_v(v)
        .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
        .border_color(address.border())
        .max_lod(vk::LOD_CLAMP_NONE)
}

impl Drop for Sampler {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::Sampler(self.raw));
    }
}
