//! Importance sampling of the panorama: an alias table over the panorama's cells, on the GPU.

use std::sync::Arc;

use bytemuck::bytes_of;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Image, Subresource, read_image};
use crate::reference::importance::{Cell, alias_table};

/// The most cells across the table: 2^19 cells take 6 MiB.
const MOST_CELLS: u32 = 1024;

/// Builds the table of a panorama from its first mip of at most [`MOST_CELLS`] across, as `glsl/importance.glsl` reads it;
/// waits for its readback from the GPU.
pub fn importance(gpu: &Arc<Gpu>, panorama: &Image) -> Result<Arc<Buffer>> {
    let mips = panorama.desc().mips;
    let mip = (0..mips).find(|mip| panorama.mip_size(*mip)[0] <= MOST_CELLS).unwrap_or(mips - 1);
    let size = panorama.mip_size(mip);
    let texels = read_image(gpu, panorama, Subresource { mip, layer: 0 }, size_of::<[f32; 4]>() as u64)?;
    let cells: Vec<Cell> = alias_table(size, &bytemuck::pod_collect_to_vec(&texels));
    let bytes = [bytes_of(&size), bytemuck::cast_slice(&cells)].concat();
    Buffer::with_bytes(gpu, "importance", BufferKind::StorageFromCpu, &bytes)
}
