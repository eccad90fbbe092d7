//! All meshes of a scene in one vertex and one index buffer.

use std::ops::Range;
use std::sync::Arc;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Upload};
use crate::scene::Mesh;

/// The buffers, and where in them each mesh lies.
pub struct Geometry {
    pub vertices: Buffer,
    pub indices: Buffer,
    pub ranges: Vec<MeshRange>,
}

/// One mesh's part of the buffers.
#[derive(Clone)]
pub struct MeshRange {
    pub indices: Range<u32>,
    pub first_vertex: i32,
}

impl Geometry {
    /// Uploads the meshes; one range each, in their order.
    pub fn new(gpu: &Arc<Gpu>, meshes: &[Mesh]) -> Result<Self> {
        let mut ranges = Vec::with_capacity(meshes.len());
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for mesh in meshes {
            let first = indices.len() as u32;
            let range = first..first + mesh.indices.len() as u32;
            ranges.push(MeshRange { indices: range, first_vertex: vertices.len() as i32 });
            vertices.extend_from_slice(&mesh.vertices);
            indices.extend_from_slice(&mesh.indices);
        }
        let (vertices, indices): (&[u8], &[u8]) = (bytemuck::cast_slice(&vertices), bytemuck::cast_slice(&indices));
        let vertex_buffer = Buffer::new(gpu, "vertices", BufferKind::Vertex, vertices.len() as u64)?;
        let index_buffer = Buffer::new(gpu, "indices", BufferKind::Index, indices.len() as u64)?;
        let mut upload = Upload::new(gpu);
        if !indices.is_empty() {
            upload.buffer(&vertex_buffer, vertices)?;
            upload.buffer(&index_buffer, indices)?;
        }
        upload.finish()?;
        Ok(Self { vertices: vertex_buffer, indices: index_buffer, ranges })
    }
}
