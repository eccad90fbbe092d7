//! Importance sampling of the panorama: an alias table over the panorama's cells, on the GPU.

use std::sync::Arc;

use bytemuck::bytes_of;
use glam::DVec2;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Image, Subresource, read_image};
use crate::reference::cube::{panorama_texel_solid_angle, panorama_uv};
use crate::reference::disc::sample_disc;
use crate::reference::importance::{Cell, alias_table};
use crate::reference::sun::Sun;

/// The most cells across the table: 2^19 cells take 6 MiB.
const MOST_CELLS: u32 = 1024;

/// Builds the table of a panorama from its first mip of at most [`MOST_CELLS`] across, with its sun, as
/// `glsl/importance.glsl` reads it; waits for its readback from the GPU.
pub fn importance(gpu: &Arc<Gpu>, panorama: &Image, sun: Option<&Sun>) -> Result<Arc<Buffer>> {
    let mips = panorama.desc().mips;
    let mip = (0..mips).find(|mip| panorama.mip_size(*mip)[0] <= MOST_CELLS).unwrap_or(mips - 1);
    let size = panorama.mip_size(mip);
    let texels = read_image(gpu, panorama, Subresource { mip, layer: 0 }, size_of::<[f32; 4]>() as u64)?;
    let mut texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&texels);
    sun.iter().for_each(|sun| add_sun(&mut texels, size, sun));
    let cells: Vec<Cell> = alias_table(size, &texels);
    let bytes = [bytes_of(&size), bytemuck::cast_slice(&cells)].concat();
    Buffer::with_bytes(gpu, "importance", BufferKind::StorageFromCpu, &bytes)
}

/// Adds a sun's light to the mean radiance of the cells that its disc covers, by points on it.
fn add_sun(texels: &mut [[f32; 4]], size: [u32; 2], sun: &Sun) {
    /// Points along each axis of the disc's coordinates.
    const POINTS: u32 = 64;
    let [width, height] = size.map(f64::from);
    let light = sun.light() / f64::from(POINTS * POINTS);
    for i in 0..POINTS * POINTS {
        let u = DVec2::new(f64::from(i % POINTS) + 0.5, f64::from(i / POINTS) + 0.5) / f64::from(POINTS);
        let uv = panorama_uv(sample_disc(u, sun.direction, sun.angular_radius.sin()));
        let [x, y] = [(uv.x * width).min(width - 1.0) as u32, (uv.y * height).min(height - 1.0) as u32];
        let radiance = light / panorama_texel_solid_angle(y, size);
        let cell = &mut texels[(y * size[0] + x) as usize];
        (0..3).for_each(|c| cell[c] += radiance[c] as f32);
    }
}
