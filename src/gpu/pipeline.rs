//! Graphics and compute pipelines.

use std::sync::Arc;

use ash::vk;

use super::deferred::Deferred;
use super::descriptor::DescriptorSetLayout;
use super::device::Gpu;
use super::image::DEPTH_FORMAT;
use super::pipeline_store::RawPipeline;
use super::sampler::Compare;
use super::shader;
use crate::{Error, Result};

/// A 32-bit specialization constant: its id, and its value's bits.
pub type Constant = (u32, u32);

/// The state of a graphics pipeline. Triangles, counter-clockwise front; viewport and culled faces are set while
/// recording.
#[derive(Clone, Copy)]
pub struct GraphicsDesc<'a> {
    pub name: &'a str,
    /// File names in glsl/.
    pub vertex: &'a str,
    /// `None` writes depth only.
    pub fragment: Option<&'a str>,
    pub constants: &'a [Constant],
    pub sets: &'a [&'a DescriptorSetLayout],
    /// Bytes of push constants, for all stages.
    pub push_bytes: u32,
    /// Bytes per vertex, and for each location its format and offset; empty where the shader needs no vertices.
    pub vertex_stride: u32,
    pub vertex_attributes: &'a [(vk::Format, u32)],
    /// Formats of the colour attachments, in their order.
    pub colours: &'a [vk::Format],
    /// `None` without a depth attachment.
    pub depth: Option<DepthState>,
    /// 1 or 4.
    pub samples: u32,
    /// In all colour attachments.
    pub blend: Blend,
}

impl Default for GraphicsDesc<'_> {
    /// No shaders, vertices, sets and attachments; one sample, no blending.
    fn default() -> Self {
        Self {
            name: "",
            vertex: "",
            fragment: None,
            constants: &[],
            sets: &[],
            push_bytes: 0,
            vertex_stride: 0,
            vertex_attributes: &[],
            colours: &[],
            depth: None,
            samples: 1,
            blend: Blend::None,
        }
    }
}

/// How fragments are blended with what is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Blend {
    /// They replace it.
    None,
    /// Source-over with straight alpha.
    Over,
    /// Their first colour is added, and their second one multiplies what is there: one attachment at most, and only where
    /// [`Gpu::blends_two_sources`].
    TwoSources,
    /// They multiply it.
    Multiply,
    /// It stays.
    Keep,
}

/// Depth test and writes of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthState {
    /// A fragment is drawn where its depth passes this comparison with the stored one.
    pub compare: Compare,
    /// Whether drawn fragments store their depth.
    pub write: bool,
    pub bias: Option<DepthBias>,
}

impl DepthState {
    /// Reversed depth, nearer is greater: draws and stores what is nearest.
    pub const WRITE: Self = Self { compare: Compare::GreaterOrEqual, write: true, bias: None };
    /// Reversed depth: draws where nothing nearer is, without storing: the sky.
    pub const TEST: Self = Self { write: false, ..Self::WRITE };
}

/// Added to each fragment's depth before it is tested: `constant` in units of the least difference that a depth of
/// this size can have, `slope` times the triangle's steepest change of depth per pixel. Negative is farther in reversed
/// depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthBias {
    pub constant: f32,
    pub slope: f32,
}

#[cfg(test)]
thread_local! {
    static MADE: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// Pipelines that the calling thread has created so far.
#[cfg(test)]
pub fn pipelines_of_this_thread() -> usize {
    MADE.get()
}

/// A pipeline and its layout, shared with all that were asked for with the same description.
pub struct Pipeline {
    gpu: Arc<Gpu>,
    pub(super) raw: RawPipeline,
    pub(super) point: vk::PipelineBindPoint,
}

impl Pipeline {
    /// A compute pipeline of `glsl/{shader}`.
    pub fn compute(
        gpu: &Arc<Gpu>,
        shader: &str,
        constants: &[Constant],
        sets: &[&DescriptorSetLayout],
        push_bytes: u32,
    ) -> Result<Self> {
        let code = shader::load(shader)?;
        let key = key(&[&code], constants, sets, push_bytes, "compute");
        Self::shared(gpu, vk::PipelineBindPoint::COMPUTE, shader, (sets, push_bytes), key, |layout| {
            let module = Module::new(gpu, shader, &code)?;
            let special = Specialization::new(constants);
            let special = special.info();
            let info = vk::ComputePipelineCreateInfo::default()
                .stage(module.stage(vk::ShaderStageFlags::COMPUTE, &special))
                .layout(layout);
            // SAFETY: module and layout are alive until the call returns.
            let created =
                gpu.pipeline_cache.with(|cache| unsafe { gpu.device.create_compute_pipelines(cache, &[info], None) });
            first(created)
        })
    }

    /// A graphics pipeline.
    pub fn graphics(gpu: &Arc<Gpu>, desc: &GraphicsDesc<'_>) -> Result<Self> {
        let vertex = shader::load(desc.vertex)?;
        let fragment = desc.fragment.map(|name| Ok((name, shader::load(name)?))).transpose()?;
        let code: Vec<&[u32]> =
            [&vertex].into_iter().chain(fragment.iter().map(|(_, code)| code)).map(|c| &c[..]).collect();
        let GraphicsDesc { vertex_stride, vertex_attributes, colours, depth, samples, blend, .. } = desc;
        let state = (vertex_stride, vertex_attributes, colours, depth, samples, blend);
        let key = key(&code, desc.constants, desc.sets, desc.push_bytes, state);
        Self::shared(gpu, vk::PipelineBindPoint::GRAPHICS, desc.name, (desc.sets, desc.push_bytes), key, |layout| {
            let vertex = Module::new(gpu, desc.vertex, &vertex)?;
            let fragment = fragment.as_ref().map(|(name, code)| Module::new(gpu, name, code)).transpose()?;
            create_graphics(gpu, desc, &vertex, fragment.as_ref(), layout)
        })
    }

    /// The pipeline of a description, or a new one.
    fn shared(
        gpu: &Arc<Gpu>,
        point: vk::PipelineBindPoint,
        name: &str,
        (sets, push_bytes): (&[&DescriptorSetLayout], u32),
        key: blake3::Hash,
        create: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<Self> {
        let pipeline = |raw| Self { gpu: Arc::clone(gpu), raw, point };
        if let Some(raw) = gpu.pipelines.take(key) {
            return Ok(pipeline(raw));
        }
        let layout = create_layout(gpu, sets, push_bytes)?;
        let created = create(layout).inspect_err(|_| {
            // SAFETY: nothing refers to it.
            unsafe { gpu.device.destroy_pipeline_layout(layout, None) };
        })?;
        gpu.name(created, name);
        #[cfg(test)]
        MADE.set(MADE.get() + 1);
        let raw = RawPipeline { pipeline: created, layout };
        gpu.pipelines.add(key, raw);
        Ok(pipeline(raw))
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        if let Some(unused) = self.gpu.pipelines.release(self.raw) {
            self.gpu.defer_destruction(Deferred::Pipeline(unused));
        }
    }
}

/// A hash of all that a pipeline is created from: the text of plain data tells all of it.
fn key(
    stages: &[&[u32]],
    constants: &[Constant],
    sets: &[&DescriptorSetLayout],
    push_bytes: u32,
    state: impl std::fmt::Debug,
) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for code in stages {
        hasher.update(blake3::hash(bytemuck::cast_slice(code)).as_bytes());
    }
    // Set layouts with the same bindings are compatible.
    let bindings: Vec<_> = sets.iter().map(|set| set.kinds()).collect();
    hasher.update(format!("{constants:?} {bindings:?} {push_bytes} {state:?}").as_bytes());
    hasher.finalize()
}

fn create_layout(gpu: &Gpu, sets: &[&DescriptorSetLayout], push_bytes: u32) -> Result<vk::PipelineLayout> {
    let sets: Vec<_> = sets.iter().map(|s| s.raw).collect();
    let ranges = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::ALL).size(push_bytes)];
    let info = vk::PipelineLayoutCreateInfo::default()
        .set_layouts(&sets)
        .push_constant_ranges(&ranges[..usize::from(push_bytes > 0)]);
    // SAFETY: the set layouts are alive.
    unsafe { gpu.device.create_pipeline_layout(&info, None) }.map_err(Error::vulkan("creating a pipeline layout"))
}

fn create_graphics(
    gpu: &Gpu,
    desc: &GraphicsDesc<'_>,
    vertex: &Module<'_>,
    fragment: Option<&Module<'_>>,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let special = Specialization::new(desc.constants);
    let special = special.info();
    let mut stages = vec![vertex.stage(vk::ShaderStageFlags::VERTEX, &special)];
    stages.extend(fragment.map(|fragment| fragment.stage(vk::ShaderStageFlags::FRAGMENT, &special)));
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
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
    let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = rasterization(desc.depth.and_then(|depth| depth.bias));
    let multisample = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::from_raw(desc.samples));
    let depth = depth_state(desc.depth);
    let blends = vec![blend(desc.blend); desc.colours.len()];
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
    let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR, vk::DynamicState::CULL_MODE];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
    let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(desc.colours);
    if desc.depth.is_some() {
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
        .layout(layout)
        .push_next(&mut rendering);
    // SAFETY: all that `info` points to lives until the call returns.
    let created =
        gpu.pipeline_cache.with(|cache| unsafe { gpu.device.create_graphics_pipelines(cache, &[info], None) });
    first(created)
}

/// The only pipeline of a call that creates one.
fn first(created: std::result::Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>) -> Result<vk::Pipeline> {
    let created = created.map_err(|(_, result)| Error::Vulkan { doing: "creating a pipeline", result })?;
    Ok(created.first().copied().unwrap_or_default())
}

fn depth_state(depth: Option<DepthState>) -> vk::PipelineDepthStencilStateCreateInfo<'static> {
    let Some(DepthState { compare, write, .. }) = depth else { return Default::default() };
    vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(true)
        .depth_write_enable(write)
        .depth_compare_op(compare.raw())
}

fn rasterization(bias: Option<DepthBias>) -> vk::PipelineRasterizationStateCreateInfo<'static> {
    let DepthBias { constant, slope } = bias.unwrap_or(DepthBias { constant: 0.0, slope: 0.0 });
    vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
        .depth_bias_enable(bias.is_some())
        .depth_bias_constant_factor(constant)
        .depth_bias_slope_factor(slope)
        .line_width(1.0)
}

fn blend(blend: Blend) -> vk::PipelineColorBlendAttachmentState {
    let mask = if blend == Blend::Keep { vk::ColorComponentFlags::empty() } else { vk::ColorComponentFlags::RGBA };
    let (source, behind, alpha_behind) = match blend {
        Blend::None | Blend::Keep | Blend::Over => {
            (vk::BlendFactor::SRC_ALPHA, vk::BlendFactor::ONE_MINUS_SRC_ALPHA, vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        }
        Blend::TwoSources => (vk::BlendFactor::ONE, vk::BlendFactor::SRC1_COLOR, vk::BlendFactor::SRC1_ALPHA),
        Blend::Multiply => (vk::BlendFactor::ZERO, vk::BlendFactor::SRC_COLOR, vk::BlendFactor::ONE),
    };
    vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(mask)
        .blend_enable(!matches!(blend, Blend::None | Blend::Keep))
        .src_color_blend_factor(source)
        .dst_color_blend_factor(behind)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(alpha_behind)
}

/// Specialization constants in the form Vulkan takes.
struct Specialization {
    entries: Vec<vk::SpecializationMapEntry>,
    data: Vec<u8>,
}

impl Specialization {
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

/// A shader module, alive while a pipeline is created from it.
struct Module<'a> {
    gpu: &'a Gpu,
    raw: vk::ShaderModule,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, name: &str, code: &[u32]) -> Result<Self> {
        let info = vk::ShaderModuleCreateInfo::default().code(code);
        // SAFETY: the code is SPIR-V that shaderc compiled for Vulkan 1.3.
        let raw = unsafe { gpu.device.create_shader_module(&info, None) }
            .map_err(Error::vulkan("creating a shader module"))?;
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
        // SAFETY: the pipeline created from it no longer needs it.
        unsafe { self.gpu.device.destroy_shader_module(self.raw, None) };
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{BindingType, with_gpu};

    #[test]
    fn what_is_asked_for_again_is_created_once() {
        with_gpu(|gpu| {
            let bindings = [vec![BindingType::Storage; 3], vec![BindingType::StorageImage; 2]].concat();
            let made = |bindings: &[BindingType], constants: &[Constant], push_bytes| {
                let before = pipelines_of_this_thread();
                let layout = DescriptorSetLayout::new(gpu, "layout", bindings).unwrap();
                Pipeline::compute(gpu, "brdf_table.comp", constants, &[&layout], push_bytes).unwrap();
                pipelines_of_this_thread() - before
            };
            assert_eq!(made(&bindings, &[], 0), 1);
            assert_eq!(made(&bindings, &[], 0), 0, "for other objects with the same bindings");
            let others = [made(&bindings[..4], &[], 0), made(&bindings, &[(0, 1)], 0), made(&bindings, &[], 4)];
            assert_eq!(others, [1; 3]);
            let graphics = |depth| {
                let before = pipelines_of_this_thread();
                let desc = GraphicsDesc {
                    name: "fill",
                    vertex: "test_fill.vert",
                    push_bytes: 12,
                    depth,
                    ..Default::default()
                };
                Pipeline::graphics(gpu, &desc).unwrap();
                pipelines_of_this_thread() - before
            };
            assert_eq!(
                [Some(DepthState::TEST), Some(DepthState::WRITE), Some(DepthState::TEST)].map(graphics),
                [1, 1, 0]
            );
        });
    }
}
