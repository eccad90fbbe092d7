//! What the user is shown of their own hands in the scene: wands, rays, the teleport's arc and its landing ring.

mod shapes;

use std::mem::offset_of;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::shared::constant;
use super::{FRAMES_IN_FLIGHT, Output, Settings};
use crate::Result;
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, Commands, DepthState, DescriptorSet, DescriptorSetLayout, Gpu,
    GraphicsDesc, Pipeline,
};

/// Vertices that one frame holds at most; triangles beyond are left out.
pub const MAX_GIZMO_VERTICES: usize = 6144;

/// A corner of an unlit triangle, the same as in `glsl/gizmos.vert`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GizmoVertex {
    /// Metres, world space.
    pub position: [f32; 3],
    /// Linear display RGB: shown as it is, whatever the exposure.
    pub colour: [f32; 3],
}

const _: () = assert!(size_of::<GizmoVertex>() == 24 && offset_of!(GizmoVertex, colour) == 12);

/// Triangles of one frame, both sides visible; made anew in each, in room that is kept.
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
    /// Forgets the last frame's.
    pub fn clear(&mut self) {
        self.triangles.clear();
    }

    /// Three per triangle.
    pub fn triangles(&self) -> &[GizmoVertex] {
        &self.triangles
    }

    /// Adds one, if there is room.
    fn triangle(&mut self, corners: [glam::Vec3; 3], colour: glam::Vec3) {
        if self.triangles.len() + 3 <= MAX_GIZMO_VERTICES {
            let vertex = |p: glam::Vec3| GizmoVertex { position: p.into(), colour: colour.into() };
            self.triangles.extend(corners.map(vertex));
        }
    }
}

/// Draws gizmos with the frame's other triangles.
pub(super) struct GizmosPass {
    pipeline: Pipeline,
    /// Per frame in flight: vertices, the set that names them, and how many there are.
    frames: Vec<(Arc<Buffer>, DescriptorSet, u32)>,
    eyes: u32,
}

impl GizmosPass {
    pub fn new(gpu: &Arc<Gpu>, frame_layout: &DescriptorSetLayout, settings: &Settings, eyes: u32) -> Result<Self> {
        let layout = DescriptorSetLayout::new(gpu, "gizmos", &[BindingType::Storage])?;
        let frame = |_| {
            let bytes = (MAX_GIZMO_VERTICES * size_of::<GizmoVertex>()) as u64;
            let vertices = Buffer::new(gpu, "gizmos", BufferKind::StorageFromCpu, bytes)?;
            let set = DescriptorSet::new(gpu, "gizmos", &layout, &[Binding::Storage(&vertices)])?;
            Ok((vertices, set, 0))
        };
        let frames = (0..FRAMES_IN_FLIGHT).map(frame).collect::<Result<_>>()?;
        let pipeline = Pipeline::graphics(
            gpu,
            &GraphicsDesc {
                name: "gizmos",
                vertex: "gizmos.vert",
                fragment: Some("gizmos.frag"),
                constants: &[
                    (constant::EYES, eyes),
                    (constant::LINEAR_OUTPUT, u32::from(settings.output == Output::Linear)),
                ],
                sets: &[frame_layout, &layout],
                push_bytes: 0,
                vertex_stride: 0,
                vertex_attributes: &[],
                colours: &[settings.output.format()],
                depth: Some(DepthState::WRITE),
                samples: settings.samples,
                blend: false,
            },
        )?;
        Ok(Self { pipeline, frames, eyes })
    }

    /// Takes over what the frame in `slot` shows.
    pub fn set(&mut self, slot: usize, gizmos: &ControllerGizmos) {
        let (vertices, _, count) = &mut self.frames[slot];
        vertices.write(0, bytemuck::cast_slice(gizmos.triangles()));
        *count = gizmos.triangles().len() as u32;
    }

    /// Draws them; called while rendering the scene.
    pub fn draw(&self, commands: &mut Commands<'_>, slot: usize, frame: &DescriptorSet) {
        let (_, set, count) = &self.frames[slot];
        if *count > 0 {
            commands.bind(&self.pipeline, &[frame, set]);
            commands.draw(*count, self.eyes);
        }
    }
}
