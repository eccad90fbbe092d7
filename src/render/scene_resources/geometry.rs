//! All of a scene's triangles in one vertex and one index buffer.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::vertex::PackedVertex;
use crate::gpu::{Buffer, BufferKind, Gpu, Upload};
use crate::scene::cluster::Cluster;
use crate::{Error, Result};

/// The buffers, and where in them each cluster lies.
pub struct Geometry {
    pub vertices: Arc<Buffer>,
    pub indices: Arc<Buffer>,
    pub ranges: Vec<MeshRange>,
}

/// One cluster's part of the buffers.
#[derive(Clone)]
pub struct MeshRange {
    pub indices: Range<u32>,
    pub first_vertex: i32,
}

impl Geometry {
    /// Uploads the clusters; one range each, in their order.
    ///
    /// # Errors
    /// More vertices or indices than Vulkan can number, or than there is memory for.
    pub fn new(gpu: &Arc<Gpu>, clusters: &[Cluster]) -> Result<Self> {
        let mut ranges = Vec::with_capacity(clusters.len());
        let (mut first_vertex, mut first_index) = (0, 0);
        for cluster in clusters {
            let end = first_index + cluster.indices.len();
            let (Ok(start), Ok(end), Ok(vertex)) = (first_index.try_into(), end.try_into(), first_vertex.try_into())
            else {
                let problem = format!("{first_vertex} vertices and {end} indices are too many");
                return Err(Error::GpuMemory { what: "geometry".into(), problem });
            };
            ranges.push(MeshRange { indices: start..end, first_vertex: vertex });
            (first_vertex, first_index) = (first_vertex + cluster.vertices.len(), first_index + cluster.indices.len());
        }
        let vertices: Vec<PackedVertex> =
            clusters.par_iter().flat_map_iter(|c| c.vertices.iter().map(PackedVertex::from)).collect();
        let indices: Vec<u16> = clusters.iter().flat_map(|c| &c.indices).copied().collect();
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
