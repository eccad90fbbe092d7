//! Controller gizmos: wands, rays, the teleport's arc and its landing ring, as unlit triangles.

mod shapes;

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

use super::frame_set::FrameSet;
use super::output::Output;
use super::pipeline_request::PipelineRequest;
use super::shared::constant;
use crate::Result;
use crate::gpu::{Commands, DepthState, GraphicsDesc, Pipeline};

/// The most vertices of one frame; further triangles are left out.
pub const MAX_GIZMO_VERTICES: usize = 6144;

/// A vertex of an unlit triangle, as `glsl/gizmos.vert` reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GizmoVertex {
    /// Metres, world space.
    pub position: [f32; 3],
    /// Linear display RGB: shown as it is, whatever the exposure.
    pub colour: [f32; 3],
}

const _: () = assert!(size_of::<GizmoVertex>() == 24 && offset_of!(GizmoVertex, colour) == 12);

/// Triangles of one frame, visible from both sides. They are built again for each frame, in memory that is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerGizmos {
    /// Three per triangle.
    triangles: Vec<GizmoVertex>,
}

impl Default for ControllerGizmos {
    fn default() -> Self {
        Self { triangles: Vec::with_capacity(MAX_GIZMO_VERTICES) }
    }
}

impl ControllerGizmos {
    /// Removes all triangles.
    pub fn clear(&mut self) {
        self.triangles.clear();
    }

    /// Three per triangle.
    pub fn triangles(&self) -> &[GizmoVertex] {
        &self.triangles
    }

    /// Adds a triangle, if there is room.
    fn triangle(&mut self, corners: [glam::Vec3; 3], colour: glam::Vec3) {
        if self.triangles.len() + 3 <= MAX_GIZMO_VERTICES {
            let vertex = |p: glam::Vec3| GizmoVertex { position: p.into(), colour: colour.into() };
            self.triangles.extend(corners.map(vertex));
        }
    }
}

/// The pass that draws gizmos together with the scene.
pub(super) struct GizmoPass {
    pipeline: Pipeline,
    eyes: u32,
}

impl GizmoPass {
    pub fn new(PipelineRequest { gpu, layouts, settings, eyes, .. }: &PipelineRequest) -> Result<Self> {
        let pipeline = Pipeline::graphics(
            gpu,
            &GraphicsDesc {
                name: "gizmos",
                vertex: "gizmos.vert",
                fragment: Some("gizmos.frag"),
                constants: &[
                    (constant::EYES, *eyes),
                    (constant::LINEAR_OUTPUT, u32::from(settings.output == Output::Linear)),
                ],
                sets: &[&layouts.frame],
                colours: &[settings.output.format()],
                depth: Some(DepthState::WRITE),
                samples: settings.samples,
                ..GraphicsDesc::default()
            },
        )?;
        Ok(Self { pipeline, eyes: *eyes })
    }

    /// Draws `vertices` vertices that were pushed at the offset `storage`; to be called while the scene is rendered.
    pub fn draw(&self, commands: &mut Commands<'_>, frame: FrameSet<'_>, storage: u32, vertices: u32) {
        if vertices > 0 {
            frame.bind(commands, &self.pipeline, storage);
            commands.draw(vertices, self.eyes);
        }
    }
}
