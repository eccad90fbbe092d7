//! All of a scene's triangles in one vertex and one index buffer.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::vertex::PackedVertex;
use crate::gpu::{Buffer, BufferKind, Gpu, Upload};
use crate::render::shared::VertexExtraBlock;
use crate::scene::cluster::Cluster;
use crate::{Error, Result};

/// The buffers, and each cluster's range of indices.
pub struct Geometry {
    pub vertices: Arc<Buffer>,
    /// 32 bits each, into all vertices: ranges that lie next to each other can be drawn as one.
    pub indices: Arc<Buffer>,
    /// `VertexExtraBlock` of each vertex, or a single one where no vertex needs any.
    pub extras: Arc<Buffer>,
    pub ranges: Vec<Range<u32>>,
}

impl Geometry {
    /// Uploads the clusters; returns one range per cluster, in their order. `second_uv`: second texture coordinates are read,
    /// be they 0 everywhere.
    ///
    /// # Errors
    /// Too many vertices or indices for 32 bits or for the GPU's memory.
    pub fn new(gpu: &Arc<Gpu>, clusters: &[Cluster], second_uv: bool) -> Result<Self> {
        let mut ranges = Vec::with_capacity(clusters.len());
        let (mut vertex, mut index) = (0, 0);
        for cluster in clusters {
            (vertex, index) = (vertex + cluster.vertices.len(), index + cluster.indices.len());
            let (Ok(_), Ok(end)) = (u32::try_from(vertex), u32::try_from(index)) else {
                let problem = format!("{vertex} vertices and {index} indices are too many");
                return Err(Error::GpuMemory { what: "geometry".into(), problem });
            };
            ranges.push(end - cluster.indices.len() as u32..end);
        }
        let vertices: Vec<PackedVertex> =
            clusters.par_iter().flat_map_iter(|c| c.vertices.iter().map(PackedVertex::from)).collect();
        let is_needed = |cluster: &Cluster| cluster.vertices.iter().any(VertexExtraBlock::is_needed);
        let has_extras = second_uv || clusters.par_iter().any(is_needed);
        let extra = |cluster: &Cluster| cluster.vertices.iter().map(VertexExtraBlock::from).collect::<Vec<_>>();
        let extras: Vec<VertexExtraBlock> = match has_extras {
            true => clusters.par_iter().flat_map_iter(extra).collect(),
            false => vec![VertexExtraBlock::default()],
        };
        let indices = absolute_indices(clusters);
        let (vertices, indices): (&[u8], &[u8]) = (bytemuck::cast_slice(&vertices), bytemuck::cast_slice(&indices));
        let vertex_buffer = Buffer::new(gpu, "vertices", BufferKind::Vertex, vertices.len() as u64)?;
        let index_buffer = Buffer::new(gpu, "indices", BufferKind::Index, indices.len() as u64)?;
        let extras: &[u8] = bytemuck::cast_slice(&extras);
        let extra_buffer = Buffer::new(gpu, "vertex extras", BufferKind::Storage, extras.len() as u64)?;
        let mut upload = Upload::new(gpu);
        upload.buffer(&extra_buffer, extras)?;
        if !indices.is_empty() {
            upload.buffer(&vertex_buffer, vertices)?;
            upload.buffer(&index_buffer, indices)?;
        }
        upload.finish()?;
        Ok(Self { vertices: vertex_buffer, indices: index_buffer, extras: extra_buffer, ranges })
    }

    /// Uploads the indices of the same clusters in another order. Nothing may be drawn meanwhile.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn reorder(&self, gpu: &Arc<Gpu>, clusters: &[Cluster]) -> Result<()> {
        let indices = absolute_indices(clusters);
        let mut upload = Upload::new(gpu);
        upload.buffer(&self.indices, bytemuck::cast_slice(&indices))?;
        upload.finish()
    }
}

/// Indices into the vertices of all clusters, which are as many as 32 bits can count.
fn absolute_indices(clusters: &[Cluster]) -> Vec<u32> {
    let mut indices = Vec::with_capacity(clusters.iter().map(|cluster| cluster.indices.len()).sum());
    let mut first = 0;
    for cluster in clusters {
        indices.extend(cluster.indices.iter().map(|index| first + u32::from(*index)));
        first += cluster.vertices.len() as u32;
    }
    indices
}
