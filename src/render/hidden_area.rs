//! The hidden area, the part of each eye's picture that no lens shows: drawn first at the nearest depth, so that nothing
//! there is shaded.

use std::sync::Arc;

use super::pipeline_request::PipelineRequest;
use crate::Result;
use crate::gpu::{Buffer, BufferKind, Commands, DepthState, Format, Gpu, GraphicsDesc, Pipeline, Upload};

/// Corners of triangles: x and y of clip space (Vulkan's, y down), and the eye's index.
type Corner = [f32; 3];

/// The hidden triangles of all eyes.
pub struct HiddenArea {
    corners: Arc<Buffer>,
    indices: Arc<Buffer>,
    count: u32,
}

impl HiddenArea {
    /// From the triangles of each eye, three corners each, in the units of the eye's picture: 0 to 1, v downwards.
    /// `None` if there are no triangles.
    pub fn new(gpu: &Arc<Gpu>, eyes: &[Vec<[f32; 2]>]) -> Result<Option<Self>> {
        let corners: Vec<Corner> = (0u8..)
            .zip(eyes)
            .flat_map(|(eye, corners)| {
                // An incomplete last triangle is ignored.
                let whole = &corners[..corners.len() / 3 * 3];
                whole.iter().map(move |[u, v]| [2.0 * u - 1.0, 2.0 * v - 1.0, f32::from(eye)])
            })
            .collect();
        if corners.is_empty() {
            return Ok(None);
        }
        // A runtime counts them in 32 bits.
        let count = corners.len() as u32;
        let indices: Vec<u32> = (0..count).collect();
        let buffer = |kind, bytes: &[u8]| Buffer::new(gpu, "hidden area", kind, bytes.len() as u64);
        let (corners, indices): (&[u8], &[u8]) = (bytemuck::cast_slice(&corners), bytemuck::cast_slice(&indices));
        let (on_corners, on_indices) = (buffer(BufferKind::Vertex, corners)?, buffer(BufferKind::Index, indices)?);
        let mut upload = Upload::new(gpu);
        upload.buffer(&on_corners, corners)?;
        upload.buffer(&on_indices, indices)?;
        upload.finish()?;
        Ok(Some(Self { corners: on_corners, indices: on_indices, count }))
    }
}

/// The pass that draws a hidden area.
pub struct HiddenAreaPass(Pipeline);

impl HiddenAreaPass {
    /// Creates the pipeline.
    pub fn new(PipelineRequest { gpu, settings, .. }: &PipelineRequest) -> Result<Self> {
        let desc = GraphicsDesc {
            name: "hidden area",
            vertex: "hidden_area.vert",
            fragment: Some("hidden_area.frag"),
            vertex_stride: size_of::<Corner>() as u32,
            vertex_attributes: &[(Format::R32G32B32_SFLOAT, 0)],
            colours: &[settings.output.format()],
            depth: Some(DepthState::WRITE),
            samples: settings.samples,
            ..GraphicsDesc::default()
        };
        Ok(Self(Pipeline::graphics(gpu, &desc)?))
    }

    /// Draws the triangles; to be called while rendering, before everything else.
    pub fn draw(&self, commands: &mut Commands<'_>, area: &HiddenArea) {
        commands.bind(&self.0, &[]);
        commands.bind_mesh(&area.corners, &area.indices);
        commands.draw_indexed(0..area.count, 1);
    }
}
