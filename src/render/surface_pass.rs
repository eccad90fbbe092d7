//! Draws surfaces without their light: their depth into shadow maps, or which material is seen. Holes stay open.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::Mat4;

use super::draws::DrawCall;
use super::pipeline_request::PipelineRequest;
use super::scene_resources::{PackedVertex, SceneResources};
use crate::Result;
use crate::gpu::{Commands, Cull, DepthState, DescriptorSet, Format, GraphicsDesc, Pipeline};

/// Push constants of `glsl/placed.vert`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_models: [[f32; 4]; 4],
    instance: u32,
}

/// Locations of `glsl/placed.vert`.
const ATTRIBUTES: [(Format, u32); 2] = [
    (Format::R32G32B32_SFLOAT, offset_of!(PackedVertex, position) as u32),
    (Format::R32G32_SFLOAT, offset_of!(PackedVertex, uv) as u32),
];

/// What [`SurfacePass::picking`] draws into.
pub const PICKED: Format = Format::R32_UINT;

/// Pipelines for whole surfaces and for those with holes.
pub struct SurfacePass {
    whole: Pipeline,
    /// Only where the scene has some.
    cutout: Option<Pipeline>,
    /// Of each of the scene's variants, whether it has holes.
    has_holes: Vec<bool>,
    /// Whether only those faces are drawn that a picture shows.
    as_seen: bool,
}

/// What the passes differ in.
struct Kind<'a> {
    name: &'a str,
    fragments: [Option<&'a str>; 2],
    colours: &'a [Format],
    as_seen: bool,
}

impl SurfacePass {
    /// Draws depth alone.
    pub fn shadow(request: &PipelineRequest) -> Result<Self> {
        let fragments = [None, Some("shadow_cutout.frag")];
        Self::new(request, Kind { name: "shadow", fragments, colours: &[], as_seen: false })
    }

    /// Draws one more than the index of each fragment's material, into a target of [`PICKED`].
    pub fn picking(request: &PipelineRequest) -> Result<Self> {
        let fragments = [Some("pick.frag"), Some("pick_cutout.frag")];
        Self::new(request, Kind { name: "pick", fragments, colours: &[PICKED], as_seen: true })
    }

    fn new(PipelineRequest { gpu, layouts, variants, .. }: &PipelineRequest, kind: Kind<'_>) -> Result<Self> {
        let Kind { name, fragments: [whole, cutout], colours, as_seen } = kind;
        let pipeline = |fragment| {
            Pipeline::graphics(
                gpu,
                &GraphicsDesc {
                    name,
                    vertex: "placed.vert",
                    fragment,
                    colours,
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
        let cutout = has_holes.contains(&true).then(|| pipeline(cutout)).transpose()?;
        Ok(Self { whole: pipeline(whole)?, cutout, has_holes, as_seen })
    }

    /// Draws, with reversed depth; to be called while rendering into a map or target.
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
            let faces = |call: &DrawCall| if self.as_seen { call.seen_faces() } else { call.cull };
            if last.is_none_or(|(_, last)| faces(last) != faces(call)) {
                commands.cull(faces(call));
            }
            commands.draw_indexed(call.indices.clone(), 1);
            last = Some((cutout.is_some(), call));
        }
        commands.cull(Cull::Nothing);
    }
}
