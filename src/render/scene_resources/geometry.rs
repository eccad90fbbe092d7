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
        let (mut first_vertices, mut vertex, mut index) = (Vec::with_capacity(clusters.len()), 0, 0);
        for cluster in clusters {
            let end = index + cluster.indices.len();
            let (Ok(first), Ok(start), Ok(end_index)) = (u32::try_from(vertex), index.try_into(), end.try_into())
            else {
                let problem = format!("{vertex} vertices and {end} indices are too many");
                return Err(Error::GpuMemory { what: "geometry".into(), problem });
            };
            ranges.push(start..end_index);
            first_vertices.push(first);
            (vertex, index) = (vertex + cluster.vertices.len(), end);
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
        let absolute = |(cluster, first): (&Cluster, u32)| -> Vec<u32> {
            cluster.indices.iter().map(|index| first + u32::from(*index)).collect()
        };
        let indices: Vec<u32> = clusters.iter().zip(first_vertices).flat_map(absolute).collect();
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
}
