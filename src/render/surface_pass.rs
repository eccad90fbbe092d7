//! Draws surfaces without their light: their depth into shadow maps, or which material is seen. Holes stay open.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::Mat4;

use super::draws::DrawCall;
use super::pipeline_request::PipelineRequest;
use super::scene_resources::{PackedVertex, SceneResources};
use crate::Result;
use crate::gpu::{Blend, Commands, Cull, DepthState, DescriptorSet, Format, GraphicsDesc, Pipeline};
use crate::scene::MaterialFeatures;

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

/// What [`SurfacePass::shadow`] draws into beside depth, where it [`tints`](SurfacePass::tints).
pub const TRANSMISSION: Format = Format::A2B10G10R10_UNORM_PACK32;

/// How surfaces are drawn.
#[derive(Clone, Copy, PartialEq)]
enum Look {
    Whole,
    /// With holes.
    Cutout,
    /// As sheets that colour light, after all others: the nearest of those is where it ends.
    Tinting,
}

/// Pipelines for each [`Look`] that the scene's surfaces have.
pub struct SurfacePass {
    whole: Pipeline,
    cutout: Option<Pipeline>,
    tinting: Option<Pipeline>,
    /// Of each of the scene's variants.
    looks: Vec<Look>,
    /// Whether only those faces are drawn that a picture shows.
    as_seen: bool,
}

/// What the passes differ in.
struct Kind<'a> {
    name: &'a str,
    fragments: [Option<&'a str>; 2],
    /// Of sheets that colour light, if they differ; without it they are surfaces with holes.
    tinting: Option<&'a str>,
    colours: &'a [Format],
    as_seen: bool,
}

impl SurfacePass {
    /// Draws depth, and what of light sheets before it let through.
    pub fn shadow(request: &PipelineRequest) -> Result<Self> {
        let fragments = [None, Some("shadow_cutout.frag")];
        let tints = request.variants.iter().any(|features| features.tints);
        let (tinting, colours) =
            if tints { (Some("shadow_tint.frag"), &[TRANSMISSION][..]) } else { Default::default() };
        Self::new(request, Kind { name: "shadow", fragments, tinting, colours, as_seen: false })
    }

    /// Draws one more than the index of each fragment's material, into a target of [`PICKED`].
    pub fn picking(request: &PipelineRequest) -> Result<Self> {
        let fragments = [Some("pick.frag"), Some("pick_cutout.frag")];
        Self::new(request, Kind { name: "pick", fragments, tinting: None, colours: &[PICKED], as_seen: true })
    }

    fn new(PipelineRequest { gpu, layouts, variants, .. }: &PipelineRequest, kind: Kind<'_>) -> Result<Self> {
        let Kind { name, fragments: [whole, cutout], tinting, colours, as_seen } = kind;
        let pipeline = |fragment, depth, blend| {
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
                    depth: Some(depth),
                    blend,
                    ..GraphicsDesc::default()
                },
            )
        };
        let look = |features: &MaterialFeatures| match () {
            () if features.tints && tinting.is_some() => Look::Tinting,
            () if features.alpha_mask || features.blends => Look::Cutout,
            () => Look::Whole,
        };
        let looks: Vec<Look> = variants.iter().map(look).collect();
        let blend = if tinting.is_some() { Blend::Keep } else { Blend::None };
        let write = |fragment| pipeline(fragment, DepthState::WRITE, blend);
        Ok(Self {
            whole: write(whole)?,
            cutout: looks.contains(&Look::Cutout).then(|| write(cutout)).transpose()?,
            tinting: tinting.map(|stage| pipeline(Some(stage), DepthState::TEST, Blend::Multiply)).transpose()?,
            looks,
            as_seen,
        })
    }

    /// Whether it has an attachment of [`TRANSMISSION`].
    pub fn tints(&self) -> bool {
        self.tinting.is_some()
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
        let mut last: Option<(Look, &DrawCall)> = None;
        let look = |call: &DrawCall| self.looks[call.variant as usize];
        let blocks = calls.iter().filter(|call| look(call) != Look::Tinting);
        for call in blocks.chain(calls.iter().filter(|call| look(call) == Look::Tinting)) {
            let look = look(call);
            let special = match look {
                Look::Whole => None,
                Look::Cutout => self.cutout.as_ref(),
                Look::Tinting => self.tinting.as_ref(),
            };
            let pipeline = special.unwrap_or(&self.whole);
            if last.is_none_or(|(last, _)| last != look) {
                commands.bind_pipeline(pipeline);
            }
            if last.is_none() {
                commands.bind_set(pipeline, 1, scene_set, &[]);
            }
            if special.is_some() {
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
            last = Some((look, call));
        }
        commands.cull(Cull::Nothing);
    }
}
