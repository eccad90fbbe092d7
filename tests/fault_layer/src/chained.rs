//! Structures of features and properties, and what Vulkan 1.3 requires of them ("Feature Requirements", "Required Limits").
//! Those of single extensions stay as they are.

use std::ffi::c_void;
use std::mem::size_of;

use ash::vk::{self, StructureType as S};

use super::weak::Level;

type Core = vk::PhysicalDeviceFeatures;
type V11 = vk::PhysicalDeviceVulkan11Features<'static>;
type V12 = vk::PhysicalDeviceVulkan12Features<'static>;
type V13 = vk::PhysicalDeviceVulkan13Features<'static>;

/// Features, as far as they are of Vulkan 1.0 to 1.3.
#[derive(Clone, Copy, Default)]
pub struct EnabledFeatures {
    core: Core,
    v11: V11,
    v12: V12,
    v13: V13,
}

/// A structure as its flags, which follow kind and pointer where there are any.
unsafe fn flags<T>(structure: &T, head: usize) -> &[vk::Bool32] {
    let from = std::ptr::from_ref(structure).cast::<u8>();
    // SAFETY: all that follows are flags of 32 bits; what pads the structure's end is not read.
    unsafe { std::slice::from_raw_parts(from.add(head).cast(), (size_of::<T>() - head) / 4) }
}

/// Kind and pointer before the flags.
const HEAD: usize = size_of::<vk::BaseInStructure<'static>>();

impl EnabledFeatures {
    /// What every GPU has, or what pbr-vr needs, too.
    fn of_level(level: Level) -> Self {
        let mut all = Self::default();
        all.core = all.core.robust_buffer_access(true);
        all.v11 = all.v11.multiview(true);
        all.v12 = all
            .v12
            .uniform_buffer_standard_layout(true)
            .subgroup_broadcast_dynamic_id(true)
            .imageless_framebuffer(true)
            .separate_depth_stencil_layouts(true)
            .host_query_reset(true)
            .timeline_semaphore(true)
            .shader_subgroup_extended_types(true)
            .vulkan_memory_model(true)
            .vulkan_memory_model_device_scope(true)
            .buffer_device_address(true);
        all.v13 = all
            .v13
            .robust_image_access(true)
            .inline_uniform_block(true)
            .pipeline_creation_cache_control(true)
            .private_data(true)
            .shader_demote_to_helper_invocation(true)
            .shader_terminate_invocation(true)
            .subgroup_size_control(true)
            .compute_full_subgroups(true)
            .synchronization2(true)
            .shader_zero_initialize_workgroup_memory(true)
            .dynamic_rendering(true)
            .shader_integer_dot_product(true)
            .maintenance4(true);
        if level == Level::Bare {
            all.core = all.core.full_draw_index_uint32(true);
            all.v12 = all.v12.shader_output_layer(true).scalar_block_layout(true);
        }
        all
    }

    /// Those that a device is created with.
    ///
    /// # Safety
    /// The chain is that of vkCreateDevice.
    pub unsafe fn of(info: &vk::DeviceCreateInfo<'_>) -> Self {
        let mut all = Self::default();
        // SAFETY: structures of a chain are what their kind says.
        unsafe {
            if !info.p_enabled_features.is_null() {
                all.core = *info.p_enabled_features;
            }
            each(info.p_next.cast_mut(), |kind, at| match kind {
                S::PHYSICAL_DEVICE_FEATURES_2 => all.core = (*at.cast::<vk::PhysicalDeviceFeatures2<'_>>()).features,
                S::PHYSICAL_DEVICE_VULKAN_1_1_FEATURES => all.v11 = *at.cast::<V11>(),
                S::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => all.v12 = *at.cast::<V12>(),
                S::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES => all.v13 = *at.cast::<V13>(),
                _ => (),
            });
        }
        all
    }

    /// Has a function fill in all of them.
    pub fn fill(&mut self, fill: impl FnOnce(&mut vk::PhysicalDeviceFeatures2<'_>)) {
        let Self { v11, v12, v13, .. } = self;
        let mut all = vk::PhysicalDeviceFeatures2::default().push_next(v11).push_next(v12).push_next(v13);
        fill(&mut all);
        self.core = all.features;
    }

    /// Whether these are no more than others.
    pub fn are_among(&self, others: &Self) -> bool {
        let all = self.slices().into_iter().zip(others.slices());
        all.into_iter().all(|(these, others)| these.iter().zip(others).all(|(this, other)| this & !other == 0))
    }

    fn slices(&self) -> [&[vk::Bool32]; 4] {
        // SAFETY: structures of flags only, behind a head in all but the first.
        unsafe { [flags(&self.core, 0), of_version(&self.v11), of_version(&self.v12), of_version(&self.v13)] }
    }
}

/// The number of flags of a Vulkan version's structure. It is odd in some, whose end is padded.
fn flags_of_version(kind: S) -> usize {
    match kind {
        S::PHYSICAL_DEVICE_VULKAN_1_1_FEATURES => 12,
        S::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => 47,
        _ => 15,
    }
}

unsafe fn of_version<T: vk::TaggedStructure>(structure: &T) -> &[vk::Bool32] {
    let count = flags_of_version(T::STRUCTURE_TYPE);
    // SAFETY: as for `flags`.
    unsafe { &flags(structure, HEAD)[..count] }
}

/// Calls a function for each structure of a chain.
unsafe fn each(mut chain: *mut c_void, mut call: impl FnMut(S, *mut c_void)) {
    while !chain.is_null() {
        // SAFETY: every structure of a chain begins with its kind and the next one.
        let head = unsafe { *chain.cast::<vk::BaseOutStructure<'_>>() };
        call(head.s_type, chain);
        chain = head.p_next.cast();
    }
}

/// Drops features that a level lacks.
///
/// # Safety
/// The chain is that of vkGetPhysicalDeviceFeatures2, which has filled it.
pub unsafe fn lower_features(all: &mut vk::PhysicalDeviceFeatures2<'_>, level: Level) {
    if level == Level::Whole {
        return;
    }
    let kept = EnabledFeatures::of_level(level);
    let and = |to: *mut vk::Bool32, kept: &[vk::Bool32]| {
        for (i, kept) in kept.iter().enumerate() {
            // SAFETY: a structure of the same kind as the one whose flags are kept.
            unsafe { *to.add(i) &= kept };
        }
    };
    let [core, v11, v12, v13] = kept.slices();
    and(std::ptr::from_mut(&mut all.features).cast(), core);
    // SAFETY: the flags begin behind the head.
    unsafe {
        each(all.p_next, |kind, at| match kind {
            S::PHYSICAL_DEVICE_VULKAN_1_1_FEATURES => and(at.byte_add(HEAD).cast(), v11),
            S::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => and(at.byte_add(HEAD).cast(), v12),
            S::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES => and(at.byte_add(HEAD).cast(), v13),
            _ => (),
        });
    }
}

/// The least of what a buffer may have, and of one allocation of memory: bytes.
const LEAST_SIZE: u64 = 1 << 30;
const LEAST_DESCRIPTORS: u32 = 1024;

/// Lowers the properties behind the limits of Vulkan 1.0.
///
/// # Safety
/// The chain is that of vkGetPhysicalDeviceProperties2, which has filled it.
pub unsafe fn lower_properties(chain: *mut c_void, level: Level) {
    if level == Level::Whole {
        return;
    }
    let (first, one) = (vk::ResolveModeFlags::SAMPLE_ZERO, vk::SampleCountFlags::TYPE_1);
    // SAFETY: structures of a chain are what their kind says.
    unsafe {
        each(chain, |kind, at| match kind {
            S::PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceVulkan11Properties<'_>>();
                out.max_per_set_descriptors = out.max_per_set_descriptors.min(LEAST_DESCRIPTORS);
                out.max_memory_allocation_size = out.max_memory_allocation_size.min(LEAST_SIZE);
                out.max_multiview_view_count = out.max_multiview_view_count.min(6);
                out.subgroup_supported_stages &= vk::ShaderStageFlags::COMPUTE;
                out.subgroup_supported_operations &= vk::SubgroupFeatureFlags::BASIC;
            }
            S::PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceMaintenance3Properties<'_>>();
                out.max_per_set_descriptors = out.max_per_set_descriptors.min(LEAST_DESCRIPTORS);
                out.max_memory_allocation_size = out.max_memory_allocation_size.min(LEAST_SIZE);
            }
            S::PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceVulkan12Properties<'_>>();
                out.supported_depth_resolve_modes &= first;
                out.supported_stencil_resolve_modes &= first;
                out.independent_resolve = vk::FALSE;
                out.independent_resolve_none = vk::FALSE;
                out.filter_minmax_single_component_formats = vk::FALSE;
                out.framebuffer_integer_color_sample_counts &= one;
                let most = out.max_timeline_semaphore_value_difference;
                out.max_timeline_semaphore_value_difference = most.min((1 << 31) - 1);
            }
            S::PHYSICAL_DEVICE_DEPTH_STENCIL_RESOLVE_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceDepthStencilResolveProperties<'_>>();
                out.supported_depth_resolve_modes &= first;
                out.supported_stencil_resolve_modes &= first;
            }
            S::PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceVulkan13Properties<'_>>();
                out.max_buffer_size = out.max_buffer_size.min(LEAST_SIZE);
            }
            S::PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES => {
                let out = &mut *at.cast::<vk::PhysicalDeviceMaintenance4Properties<'_>>();
                out.max_buffer_size = out.max_buffer_size.min(LEAST_SIZE);
            }
            _ => (),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets every flag.
    fn set_all(all: &mut vk::PhysicalDeviceFeatures2<'_>) {
        let set = |at: *mut vk::Bool32, count| {
            for i in 0..count {
                // SAFETY: a structure of as many flags.
                unsafe { *at.add(i) = vk::TRUE };
            }
        };
        set(std::ptr::from_mut(&mut all.features).cast(), size_of::<Core>() / 4);
        // SAFETY: the structures that follow are those of versions, with flags behind the head.
        unsafe { each(all.p_next, |kind, at| set(at.byte_add(HEAD).cast(), flags_of_version(kind))) };
    }

    #[test]
    fn of_a_gpu_that_has_everything_the_required_stays() {
        let (mut all, mut lowered) = (EnabledFeatures::default(), EnabledFeatures::default());
        all.fill(set_all);
        lowered.fill(|all| {
            set_all(all);
            // SAFETY: the chain is that of `fill`.
            unsafe { lower_features(all, Level::Bare) };
        });
        assert!(all.core.inherited_queries == 1 && all.v12.subgroup_broadcast_dynamic_id == 1);
        assert!(all.v11.shader_draw_parameters == 1 && all.v13.maintenance4 == 1);
        assert_eq!((lowered.core.full_draw_index_uint32, lowered.core.texture_compression_bc), (1, 0));
        assert_eq!((lowered.v11.multiview, lowered.v11.shader_draw_parameters), (1, 0));
        assert_eq!((lowered.v12.scalar_block_layout, lowered.v12.shader_float16), (1, 0));
        assert_eq!((lowered.v13.maintenance4, lowered.v13.texture_compression_astc_hdr), (1, 0));
        assert!(lowered.are_among(&all) && !all.are_among(&lowered));
    }
}
