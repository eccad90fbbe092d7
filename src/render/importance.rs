//! Importance sampling of the panorama for the reference: an alias table over the panorama's cells, on the GPU.

use std::sync::Arc;

use bytemuck::bytes_of;

use super::layouts::Layouts;
use crate::Result;
use crate::gpu::{Binding, Buffer, BufferKind, DescriptorSet, Gpu, Image, Subresource, read_image};
use crate::reference::importance::{Cell, alias_table};

/// The most cells across the table: 2^19 cells take 6 MiB.
const MOST_CELLS: u32 = 1024;

/// The alias table of one panorama, as `glsl/importance.glsl` reads it.
pub struct Importance {
    /// `bindings::IMPORTANCE`.
    pub set: DescriptorSet,
}

impl Importance {
    /// Builds the table from the panorama's first mip of at most [`MOST_CELLS`] across; waits for its readback from the GPU.
    pub fn new(gpu: &Arc<Gpu>, layouts: &Layouts, panorama: &Image) -> Result<Self> {
        let mips = panorama.desc().mips;
        let mip = (0..mips).find(|mip| panorama.mip_size(*mip)[0] <= MOST_CELLS).unwrap_or(mips - 1);
        let size = panorama.mip_size(mip);
        let texels = read_image(gpu, panorama, Subresource { mip, layer: 0 }, size_of::<[f32; 4]>() as u64)?;
        let cells: Vec<Cell> = alias_table(size, &bytemuck::pod_collect_to_vec(&texels));
        let bytes = [bytes_of(&size), bytemuck::cast_slice(&cells)].concat();
        let buffer = Buffer::with_bytes(gpu, "importance", BufferKind::StorageFromCpu, &bytes)?;
        Ok(Self { set: DescriptorSet::new(gpu, "importance", &layouts.importance, &[Binding::Storage(&buffer)])? })
    }
}
