//! Graphics and compute pipelines.

use std::sync::Arc;

use ash::vk;

use super::descriptor::DescriptorSetLayout;
use super::device::{Deferred, Gpu};
use super::shader;
use crate::{Error, Result};

/// A 32-bit specialization constant: its id, and its value's bits.
pub type Constant = (u32, u32);

/// What a graphics pipeline draws with. Triangles, counter-clockwise front; viewport and culled faces are set while
/// recording.
pub struct GraphicsDesc<'a> {
    pub name: &'a str,
    /// File names under glsl/.
    pub vertex: &'a str,
    pub fragment: &'a str,
    pub constants: &'a [Constant],
    pub sets: &'a [&'a DescriptorSetLayout],
    /// Bytes of push constants, for all stages.
    pub push_bytes: u32,
    /// Bytes per vertex, and for each location its format and offset; empty where the shader needs no vertices.
    pub vertex_stride: u32,
    pub vertex_attributes: &'a [(vk::Format, u32)],
    pub colour: vk::Format,
    pub depth: Depth,
    pub samples: u32,
    /// Source-over with straight alpha.
    pub blend: bool,
}

/// How a pipeline uses depth; reversed, so nearer is greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// No depth attachment.
    None,
    /// Tests and writes.
    Write,
    /// Draws where nothing nearer is, without writing: the sky.
    Test,
}

/// The format of every depth image.
pub const DEPTH_FORMAT: vk::Format = vk::Format::D32_SFLOAT;

/// A pipeline and its layout.
pub struct Pipeline {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) point: vk::PipelineBindPoint,
}

impl Pipeline {
    /// Makes a compute pipeline from `glsl/{shader}`.
    pub fn compute(
        gpu: &Arc<Gpu>,
        shader: &str,
        constants: &[Constant],
        sets: &[&DescriptorSetLayout],
        push_bytes: u32,
    ) -> Result<Self> {
        let mut pipeline = Self::bare(gpu, vk::PipelineBindPoint::COMPUTE, sets, push_bytes)?;
        let module = Module::new(gpu, shader)?;
        let special = Special::new(constants);
        let special = special.info();
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(module.stage(vk::ShaderStageFlags::COMPUTE, &special))
            .layout(pipeline.layout);
        // SAFETY: module and layout are alive until the call returns.
        let made = unsafe { gpu.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        pipeline.take(made, shader)?;
        Ok(pipeline)
    }

    /// Makes a graphics pipeline.
    pub fn graphics(gpu: &Arc<Gpu>, desc: &GraphicsDesc<'_>) -> Result<Self> {
        let mut pipeline = Self::bare(gpu, vk::PipelineBindPoint::GRAPHICS, desc.sets, desc.push_bytes)?;
        let (vertex, fragment) = (Module::new(gpu, desc.vertex)?, Module::new(gpu, desc.fragment)?);
        let special = Special::new(desc.constants);
        let special = special.info();
        let stages = [
            vertex.stage(vk::ShaderStageFlags::VERTEX, &special),
            fragment.stage(vk::ShaderStageFlags::FRAGMENT, &special),
        ];
        let attributes: Vec<_> = (0u32..)
            .zip(desc.vertex_attributes)
            .map(|(i, (format, offset))| {
                vk::VertexInputAttributeDescription::default().location(i).format(*format).offset(*offset)
            })
            .collect();
        let bindings = [vk::VertexInputBindingDescription::default().stride(desc.vertex_stride)];
        let input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_attribute_descriptions(&attributes)
            .vertex_binding_descriptions(&bindings[..usize::from(!attributes.is_empty())]);
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
            .line_width(1.0);
        let multisample = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::from_raw(desc.samples));
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(desc.depth != Depth::None)
            .depth_write_enable(desc.depth == Depth::Write)
            .depth_compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let blends = [blend(desc.blend)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR, vk::DynamicState::CULL_MODE];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let formats = [desc.colour];
        let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
        if desc.depth != Depth::None {
            rendering = rendering.depth_attachment_format(DEPTH_FORMAT);
        }
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(pipeline.layout)
            .push_next(&mut rendering);
        // SAFETY: all that `info` points to lives until the call returns.
        let made = unsafe { gpu.device.create_graphics_pipelines(vk::PipelineCache::null(), &[info], None) };
        pipeline.take(made, desc.name)?;
        Ok(pipeline)
    }

    fn bare(
        gpu: &Arc<Gpu>,
        point: vk::PipelineBindPoint,
        sets: &[&DescriptorSetLayout],
        push_bytes: u32,
    ) -> Result<Self> {
        let sets: Vec<_> = sets.iter().map(|s| s.raw).collect();
        let ranges = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::ALL).size(push_bytes)];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&sets)
            .push_constant_ranges(&ranges[..usize::from(push_bytes > 0)]);
        // SAFETY: the set layouts are alive.
        let layout = unsafe { gpu.device.create_pipeline_layout(&info, None) }
            .map_err(Error::vulkan("making a pipeline layout"))?;
        Ok(Self { gpu: Arc::clone(gpu), raw: vk::Pipeline::null(), layout, point })
    }

    fn take(
        &mut self,
        made: std::result::Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
        name: &str,
    ) -> Result<()> {
        let made = made.map_err(|(_, result)| Error::Vulkan { doing: "making a pipeline", result })?;
        self.raw = made.first().copied().unwrap_or_default();
        self.gpu.name(self.raw, name);
        Ok(())
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::Pipeline(self.raw, self.layout));
    }
}

fn blend(on: bool) -> vk::PipelineColorBlendAttachmentState {
    vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(vk::ColorComponentFlags::RGBA)
        .blend_enable(on)
        .src_color_blend_factor(vk::BlendFactor::SRC_ALPHA)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
}

/// Specialization constants as Vulkan wants them.
struct Special {
    entries: Vec<vk::SpecializationMapEntry>,
    data: Vec<u8>,
}

impl Special {
    fn new(constants: &[Constant]) -> Self {
        let entries = (0u32..)
            .zip(constants)
            .map(|(i, (id, _))| vk::SpecializationMapEntry { constant_id: *id, offset: i * 4, size: 4 })
            .collect();
        Self { entries, data: constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect() }
    }

    fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(&self.data)
    }
}

/// A shader module for as long as a pipeline is being made.
struct Module<'a> {
    gpu: &'a Gpu,
    raw: vk::ShaderModule,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, name: &str) -> Result<Self> {
        let words = shader::load(name)?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the code is what shaderc made for Vulkan 1.3.
        let raw =
            unsafe { gpu.device.create_shader_module(&info, None) }.map_err(Error::vulkan("making a shader module"))?;
        gpu.name(raw, name);
        Ok(Self { gpu, raw })
    }

    fn stage<'b>(
        &self,
        stage: vk::ShaderStageFlags,
        special: &'b vk::SpecializationInfo<'b>,
    ) -> vk::PipelineShaderStageCreateInfo<'b> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.raw)
            .name(c"main")
            .specialization_info(special)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: the pipeline made from it no longer needs it.
        unsafe { self.gpu.device.destroy_shader_module(self.raw, None) };
    }
}
