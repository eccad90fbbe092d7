//! What Vulkan requires of formats ("Required Format Support"), as far as it is of use here: whole bytes, floats and depths.

use std::ffi::c_void;

use ash::vk::{self, Format as F, FormatFeatureFlags as Has, ImageUsageFlags as Usage};

use super::weak::Level;

/// What every GPU can do with an image of a format whose texels it tiles as it likes.
fn required(format: F, level: Level) -> Has {
    let copied = Has::TRANSFER_SRC | Has::TRANSFER_DST;
    let sampled = copied | Has::SAMPLED_IMAGE | Has::BLIT_SRC;
    let filtered = sampled | Has::SAMPLED_IMAGE_FILTER_LINEAR;
    let drawn = Has::COLOR_ATTACHMENT | Has::BLIT_DST;
    let blended = drawn | Has::COLOR_ATTACHMENT_BLEND;
    let stored = Has::STORAGE_IMAGE;
    match format {
        F::R8G8B8A8_UNORM | F::A8B8G8R8_UNORM_PACK32 | F::R16G16B16A16_SFLOAT => filtered | blended | stored,
        F::R8_UNORM
        | F::R8G8_UNORM
        | F::R8G8B8A8_SRGB
        | F::A8B8G8R8_SRGB_PACK32
        | F::B8G8R8A8_UNORM
        | F::B8G8R8A8_SRGB
        | F::A2B10G10R10_UNORM_PACK32
        | F::R16_SFLOAT
        | F::R16G16_SFLOAT => filtered | blended,
        F::R8G8B8A8_SNORM => filtered | stored,
        F::R8_SNORM | F::R8G8_SNORM | F::B10G11R11_UFLOAT_PACK32 | F::E5B9G9R9_UFLOAT_PACK32 => filtered,
        F::R32_UINT | F::R32_SINT => sampled | drawn | stored | Has::STORAGE_IMAGE_ATOMIC,
        // pbr-vr needs panoramas to be filtered.
        F::R32G32B32A32_SFLOAT if level == Level::Bare => filtered | drawn | stored,
        F::R32_SFLOAT
        | F::R32G32_UINT
        | F::R32G32_SINT
        | F::R32G32_SFLOAT
        | F::R32G32B32A32_UINT
        | F::R32G32B32A32_SINT
        | F::R32G32B32A32_SFLOAT
        | F::R16G16B16A16_UINT
        | F::R16G16B16A16_SINT
        | F::R8G8B8A8_UINT
        | F::R8G8B8A8_SINT => sampled | drawn | stored,
        F::R8_UINT | F::R8_SINT | F::R8G8_UINT | F::R8G8_SINT | F::R16_UINT | F::R16_SINT => sampled | drawn,
        F::R16G16_UINT | F::R16G16_SINT => sampled | drawn,
        F::D16_UNORM | F::D32_SFLOAT => sampled | Has::DEPTH_STENCIL_ATTACHMENT,
        _ => Has::empty(),
    }
}

/// Drops what need not be there. Buffers keep what they can.
pub fn lower_features_of_format(format: F, out: &mut vk::FormatProperties, level: Level) {
    if level == Level::Whole {
        return;
    }
    out.optimal_tiling_features &= required(format, level);
    out.linear_tiling_features &= Has::TRANSFER_SRC | Has::TRANSFER_DST;
}

/// The same in the structure of 64 bits, whose lower 31 flags are the same.
///
/// # Safety
/// The chain is that of vkGetPhysicalDeviceFormatProperties2, which has filled it.
pub unsafe fn lower_chain(mut chain: *mut c_void, lowered: vk::FormatProperties) {
    const SAME: u64 = (1 << 31) - 1;
    while !chain.is_null() {
        // SAFETY: every structure of a chain begins with its kind and the next one, and is what its kind says.
        unsafe {
            let head = *chain.cast::<vk::BaseOutStructure<'_>>();
            if head.s_type == vk::StructureType::FORMAT_PROPERTIES_3 {
                let out = &mut *chain.cast::<vk::FormatProperties3<'_>>();
                let of = |there: vk::FormatFeatureFlags2, lowered: Has| {
                    vk::FormatFeatureFlags2::from_raw(there.as_raw() & (!SAME | u64::from(lowered.as_raw())))
                };
                out.optimal_tiling_features = of(out.optimal_tiling_features, lowered.optimal_tiling_features);
                out.linear_tiling_features = of(out.linear_tiling_features, lowered.linear_tiling_features);
            }
            chain = head.p_next.cast();
        }
    }
}

/// Lowers the sizes of an image; returns whether there may be one of these uses at all.
pub fn lower_image(
    info: &vk::PhysicalDeviceImageFormatInfo2<'_>,
    there: vk::FormatProperties,
    out: &mut vk::ImageFormatProperties,
    level: Level,
) -> bool {
    if level == Level::Whole {
        return true;
    }
    let is_optimal = info.tiling == vk::ImageTiling::OPTIMAL;
    let side = if info.ty == vk::ImageType::TYPE_3D { 256 } else { 4096 };
    let extent = &mut out.max_extent;
    (extent.width, extent.height, extent.depth) =
        (extent.width.min(side), extent.height.min(side), extent.depth.min(side));
    out.max_mip_levels = out.max_mip_levels.min(32 - side.leading_zeros());
    out.max_array_layers = out.max_array_layers.min(256);
    out.sample_counts &= vk::SampleCountFlags::TYPE_1 | vk::SampleCountFlags::TYPE_4;
    out.max_resource_size = out.max_resource_size.min(1 << 31);
    let has = if is_optimal { there.optimal_tiling_features } else { there.linear_tiling_features };
    let needed = [
        (Usage::TRANSFER_SRC, Has::TRANSFER_SRC),
        (Usage::TRANSFER_DST, Has::TRANSFER_DST),
        (Usage::SAMPLED, Has::SAMPLED_IMAGE),
        (Usage::STORAGE, Has::STORAGE_IMAGE),
        (Usage::COLOR_ATTACHMENT, Has::COLOR_ATTACHMENT),
        (Usage::DEPTH_STENCIL_ATTACHMENT, Has::DEPTH_STENCIL_ATTACHMENT),
    ];
    needed.iter().all(|(usage, needed)| !info.usage.contains(*usage) || has.contains(*needed))
}
