//! The limits that Vulkan 1.3 requires of every GPU ("Required Limits" of its specification), and those of them that pbr-vr
//! needs to be higher.

use ash::vk::{PhysicalDeviceLimits, SampleCountFlags as Samples};

use super::weak::{Level, Profile};

/// What pbr-vr needs, as its `src/gpu/limits.rs` says: a stage's samplers and sampled images, and its storage buffers.
const SAMPLED: u32 = 24;
const STORAGE_BUFFERS: u32 = 16;

/// Lowers limits; none is raised.
pub fn lower(limits: &mut PhysicalDeviceLimits, profile: Profile) {
    limits.max_bound_descriptor_sets = limits.max_bound_descriptor_sets.min(profile.sets.unwrap_or(u32::MAX));
    let needs = match profile.level {
        Level::Whole => return,
        Level::Minimum => false,
        Level::Bare => true,
    };
    let or = |least: u32, needed: u32| if needs { needed } else { least };
    macro_rules! at_most {
        ($($name:ident: $value:expr;)*) => { $(limits.$name = limits.$name.min($value);)* };
    }
    macro_rules! at_least {
        ($($name:ident: $value:expr;)*) => { $(limits.$name = limits.$name.max($value);)* };
    }
    at_most! {
        max_image_dimension1_d: 4096;
        max_image_dimension2_d: 4096;
        max_image_dimension3_d: 256;
        max_image_dimension_cube: 4096;
        max_image_array_layers: 256;
        max_texel_buffer_elements: 65536;
        max_uniform_buffer_range: 16384;
        max_storage_buffer_range: 1 << 27;
        max_push_constants_size: 128;
        max_memory_allocation_count: 4096;
        max_sampler_allocation_count: 4000;
        sparse_address_space_size: 0;
        max_bound_descriptor_sets: 4;
        max_per_stage_descriptor_samplers: or(16, SAMPLED);
        max_per_stage_descriptor_uniform_buffers: 12;
        max_per_stage_descriptor_storage_buffers: or(4, STORAGE_BUFFERS);
        max_per_stage_descriptor_sampled_images: or(16, SAMPLED);
        max_per_stage_descriptor_storage_images: 4;
        max_per_stage_descriptor_input_attachments: 4;
        max_per_stage_resources: 128;
        max_descriptor_set_samplers: 96;
        max_descriptor_set_uniform_buffers: 72;
        max_descriptor_set_uniform_buffers_dynamic: 8;
        max_descriptor_set_storage_buffers: 24;
        max_descriptor_set_storage_buffers_dynamic: 4;
        max_descriptor_set_sampled_images: 96;
        max_descriptor_set_storage_images: 24;
        max_descriptor_set_input_attachments: 4;
        max_vertex_input_attributes: 16;
        max_vertex_input_bindings: 16;
        max_vertex_input_attribute_offset: 2047;
        max_vertex_input_binding_stride: 2048;
        max_vertex_output_components: 64;
        max_tessellation_generation_level: 0;
        max_tessellation_patch_size: 0;
        max_geometry_shader_invocations: 0;
        max_geometry_output_vertices: 0;
        max_fragment_input_components: 64;
        max_fragment_output_attachments: 4;
        max_fragment_dual_src_attachments: 0;
        max_fragment_combined_output_resources: 4;
        max_compute_shared_memory_size: 16384;
        max_compute_work_group_invocations: 128;
        sub_pixel_precision_bits: 4;
        sub_texel_precision_bits: 4;
        mipmap_precision_bits: 4;
        max_draw_indexed_index_value: or((1 << 24) - 1, u32::MAX);
        max_draw_indirect_count: 1;
        max_sampler_lod_bias: 2.0;
        max_sampler_anisotropy: 1.0;
        max_viewports: 1;
        viewport_sub_pixel_bits: 0;
        max_texel_offset: 7;
        max_texel_gather_offset: 0;
        max_interpolation_offset: 0.0;
        sub_pixel_interpolation_offset_bits: 0;
        max_framebuffer_width: 4096;
        max_framebuffer_height: 4096;
        max_framebuffer_layers: 256;
        max_color_attachments: 4;
        max_sample_mask_words: 1;
        max_clip_distances: 0;
        max_cull_distances: 0;
        max_combined_clip_and_cull_distances: 0;
        discrete_queue_priorities: 2;
    }
    at_least! {
        buffer_image_granularity: 131_072;
        min_texel_buffer_offset_alignment: 256;
        min_uniform_buffer_offset_alignment: 256;
        min_storage_buffer_offset_alignment: 256;
        min_texel_offset: -8;
        min_texel_gather_offset: 0;
        min_interpolation_offset: 0.0;
        non_coherent_atom_size: 256;
    }
    for (there, most) in limits.max_compute_work_group_count.iter_mut().zip([65535; 3]) {
        *there = most.min(*there);
    }
    for (there, most) in limits.max_compute_work_group_size.iter_mut().zip([128, 128, 64]) {
        *there = most.min(*there);
    }
    limits.max_viewport_dimensions = limits.max_viewport_dimensions.map(|side| side.min(4096));
    limits.viewport_bounds_range = [-8192.0, 8191.0];
    let (one, four) = (Samples::TYPE_1, Samples::TYPE_1 | Samples::TYPE_4);
    limits.framebuffer_color_sample_counts &= four;
    limits.framebuffer_depth_sample_counts &= four;
    limits.framebuffer_stencil_sample_counts &= four;
    limits.framebuffer_no_attachments_sample_counts &= four;
    limits.sampled_image_color_sample_counts &= four;
    limits.sampled_image_integer_sample_counts &= one;
    limits.sampled_image_depth_sample_counts &= four;
    limits.sampled_image_stencil_sample_counts &= four;
    limits.storage_image_sample_counts &= one;
    limits.strict_lines = 0;
    limits.standard_sample_locations = 0;
}
