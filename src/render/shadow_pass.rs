//! The pass that draws depth into shadow maps; surfaces with holes leave them open.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::Mat4;

use super::draws::DrawCall;
use super::pipeline_request::PipelineRequest;
use super::scene_resources::{PackedVertex, SceneResources};
use crate::Result;
use crate::gpu::{Commands, Cull, DepthState, DescriptorSet, Format, GraphicsDesc, Pipeline};

/// Push constants of `glsl/shadow.vert`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_models: [[f32; 4]; 4],
    instance: u32,
}

/// Locations of `glsl/shadow.vert`.
const ATTRIBUTES: [(Format, u32); 2] = [
    (Format::R32G32B32_SFLOAT, offset_of!(PackedVertex, position) as u32),
    (Format::R32G32_SFLOAT, offset_of!(PackedVertex, uv) as u32),
];

/// Pipelines for whole surfaces and for those with holes.
pub struct ShadowPass {
    whole: Pipeline,
    /// Only where the scene has some.
    cutout: Option<Pipeline>,
    /// Of each of the scene's variants, whether it has holes.
    has_holes: Vec<bool>,
}

impl ShadowPass {
    /// Creates the pipelines.
    pub fn new(PipelineRequest { gpu, layouts, variants, .. }: &PipelineRequest) -> Result<Self> {
        let pipeline = |fragment| {
            Pipeline::graphics(
                gpu,
                &GraphicsDesc {
                    name: "shadow",
                    vertex: "shadow.vert",
                    fragment,
                    sets: &layouts.drawing(),
                    push_bytes: size_of::<Push>() as u32,
                    vertex_stride: size_of::<PackedVertex>() as u32,
                    vertex_attributes: &ATTRIBUTES,
                    depth: Some(DepthState::WRITE),
                    ..GraphicsDesc::default()
                },
            )
        };
        let has_holes: Vec<bool> = variants.iter().map(|features| features.alpha_mask || features.blends).collect();
        let cutout = has_holes.contains(&true).then(|| pipeline(Some("shadow_cutout.frag"))).transpose()?;
        Ok(Self { whole: pipeline(None)?, cutout, has_holes })
    }

    /// Draws depth, reversed; to be called while rendering into a map.
    pub fn draw(
        &self,
        commands: &mut Commands<'_>,
        resources: &SceneResources,
        scene_set: &DescriptorSet,
        calls: &[DrawCall],
        clip_from_models: Mat4,
    ) {
        let clip_from_models = clip_from_models.to_cols_array_2d();
        commands.bind_mesh(&resources.geometry.vertices, &resources.geometry.indices);
        let mut last: Option<(bool, &DrawCall)> = None;
        for call in calls {
            let cutout = self.cutout.as_ref().filter(|_| self.has_holes[call.variant as usize]);
            let pipeline = cutout.unwrap_or(&self.whole);
            if last.is_none_or(|(holes, _)| holes != cutout.is_some()) {
                commands.bind_pipeline(pipeline);
            }
            if last.is_none() {
                commands.bind_set(pipeline, 1, scene_set, &[]);
            }
            if cutout.is_some() {
                commands.bind_set(pipeline, 2, &resources.textures.sets[call.textures as usize], &[]);
            }
            if last.is_none_or(|(_, last)| last.instance != call.instance) {
                commands.push(pipeline, bytemuck::bytes_of(&Push { clip_from_models, instance: call.instance }));
            }
            if last.is_none_or(|(_, last)| last.cull != call.cull) {
                commands.cull(call.cull);
            }
            commands.draw_indexed(call.indices.clone(), 1);
            last = Some((cutout.is_some(), call));
        }
        commands.cull(Cull::Nothing);
    }
}
