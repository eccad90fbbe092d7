//! Importance sampling of the panorama: a table over its cells, on the GPU, with chances for places in the scene.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};
use glam::DVec2;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Image, Subresource, Upload, read_image};
use crate::reference::cube::{panorama_direction, panorama_texel_solid_angle, panorama_uv};
use crate::reference::disc::sample_disc;
use crate::reference::importance::{Cell, ImportanceTable, TILES};
use crate::reference::sun::{Sun, cone_solid_angle};
use crate::scene::places::Places;

/// The most cells across the table that paths draw from: 2^19 cells take 6 MiB.
const PATH_CELLS: u32 = 1024;
/// And across that of lightmaps, whose samples read a mip of about as many texels (`glsl/lightmap_gather.comp`).
const LIGHTMAP_CELLS: u32 = 256;
/// Share of a panorama's light below which what is brighter than the mean is not worth samples of its own.
const WORTH: f64 = 0.01;

/// What the buffer begins with.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Head {
    cells_size: [u32; 2],
    tile_side: u32,
    /// In words behind the head.
    cells_first: u32,
    chances_first: u32,
    relays_first: u32,
    places_size: [u32; 3],
    places_origin: [f32; 3],
    places_scale: f32,
}

/// The table of a panorama with its sun, as `glsl/importance.glsl` reads it, with the panorama's own chances at all places; waits
/// for a readback from the GPU.
pub fn importance(gpu: &Arc<Gpu>, panorama: &Image, sun: Option<&Sun>, places: &Places) -> Result<Arc<Buffer>> {
    let (size, mut texels) = texels(gpu, panorama, PATH_CELLS)?;
    sun.iter().for_each(|sun| add_sun(&mut texels, size, sun));
    table(gpu, size, &texels, places)
}

/// The table of what a panorama without its sun has above its mean, for samples beside those of the cosine, which find the
/// rest; `None` if that is next to nothing. Karlík et al., "MIS Compensation: Optimizing Sampling Techniques in Multiple
/// Importance Sampling" (2019), section 5.
pub fn excess_importance(gpu: &Arc<Gpu>, panorama: &Image) -> Result<Option<Arc<Buffer>>> {
    let (size, mut texels) = texels(gpu, panorama, LIGHTMAP_CELLS)?;
    keep_excess(size, &mut texels).then(|| table(gpu, size, &texels, &Places::default())).transpose()
}

/// Takes the mean away from each texel, or all that it has; returns whether what is left is worth anything.
fn keep_excess(size: [u32; 2], texels: &mut [[f32; 4]]) -> bool {
    let light = |texel: &[f32; 4]| texel[..3].iter().map(|c| f64::from(*c)).sum::<f64>();
    let total = |texels: &[[f32; 4]]| {
        let row =
            |(y, row): (u32, &[[f32; 4]])| panorama_texel_solid_angle(y, size) * row.iter().map(light).sum::<f64>();
        (0..).zip(texels.chunks_exact(size[0] as usize)).map(row).sum::<f64>()
    };
    let before = total(texels);
    let mean = before / (4.0 * PI);
    for texel in texels.iter_mut() {
        let kept = (1.0 - mean / light(texel).max(f64::MIN_POSITIVE)).max(0.0);
        *texel = texel.map(|c| (f64::from(c) * kept) as f32);
    }
    total(texels) > WORTH * before
}

/// The first mip of at most `most` texels across.
fn texels(gpu: &Arc<Gpu>, panorama: &Image, most: u32) -> Result<([u32; 2], Vec<[f32; 4]>)> {
    let mips = panorama.desc().mips;
    let mip = (0..mips).find(|mip| panorama.mip_size(*mip)[0] <= most).unwrap_or(mips - 1);
    let size = panorama.mip_size(mip);
    let texels = read_image(gpu, panorama, Subresource { mip, layer: 0 }, size_of::<[f32; 4]>() as u64)?;
    Ok((size, bytemuck::pod_collect_to_vec(&texels)))
}

fn table(gpu: &Arc<Gpu>, size: [u32; 2], texels: &[[f32; 4]], places: &Places) -> Result<Arc<Buffer>> {
    const CELL_WORDS: usize = size_of::<Cell>() / size_of::<u32>();
    let table = ImportanceTable::new(size, texels);
    let cells_first = places.of_sides.len();
    let chances_first = cells_first + CELL_WORDS * table.cells.len();
    let head = Head {
        cells_size: size,
        tile_side: table.tile_side,
        cells_first: cells_first as u32,
        chances_first: chances_first as u32,
        relays_first: (chances_first + (places.count as usize + 1) * TILES) as u32,
        places_size: places.size,
        places_origin: places.origin.to_array(),
        places_scale: places.scale,
    };
    let mut bytes =
        [bytes_of(&head), bytemuck::cast_slice(&places.of_sides), bytemuck::cast_slice(&table.cells)].concat();
    (0..=places.count).for_each(|_| bytes.extend_from_slice(bytemuck::cast_slice(&table.ends)));
    // Where nothing is learned, there are none.
    let relays = if places.count > 0 { RELAY_BYTES } else { size_of::<u32>() };
    bytes.resize(bytes.len() + relays, 0);
    let buffer = Buffer::new(gpu, "importance", BufferKind::Storage, bytes.len() as u64)?;
    let mut upload = Upload::new(gpu);
    upload.buffer(&buffer, &bytes)?;
    upload.finish()?;
    Ok(buffer)
}

/// Cells of each tile that light is followed from: `glsl/sky_relay.glsl`.
pub const RELAY_CELLS: usize = 16 * 16;
/// Bytes at the end for them: whether light is followed from any, ends of tiles' chances, ends of cells' for each tile.
pub const RELAY_BYTES: usize = (1 + TILES * (1 + RELAY_CELLS)) * size_of::<u32>();
/// Bytes that one place takes here.
pub const PLACE_BYTES: u64 = (TILES * size_of::<u32>()) as u64;

/// Adds a sun's light to the mean radiance of the cells that its disc covers.
fn add_sun(texels: &mut [[f32; 4]], size: [u32; 2], sun: &Sun) {
    let radiance = sun.radiance();
    for (cell, share) in covered(size, sun) {
        (0..3).for_each(|c| texels[cell][c] += (share * radiance[c]) as f32);
    }
}

/// The cells that a sun's disc covers, with the share that is covered: by points of the disc, or where cells are much smaller
/// than it, as near a pole, by points of the cells.
fn covered(size: [u32; 2], sun: &Sun) -> HashMap<usize, f64> {
    /// Points along each axis of the disc's coordinates, and of a cell.
    const POINTS: u32 = 64;
    const OF_CELL: u32 = 8;
    let disc = cone_solid_angle(sun.angular_radius);
    let is_small = |y: u32| 16.0 * panorama_texel_solid_angle(y, size) < disc;
    let [width, height] = size.map(f64::from);
    let mut shares: HashMap<usize, f64> = HashMap::new();
    for i in 0..POINTS * POINTS {
        let u = DVec2::new(f64::from(i % POINTS) + 0.5, f64::from(i / POINTS) + 0.5) / f64::from(POINTS);
        let uv = panorama_uv(sample_disc(u, sun.direction, sun.angular_radius.sin()));
        let [x, y] = [(uv.x * width).min(width - 1.0) as u32, (uv.y * height).min(height - 1.0) as u32];
        if is_small(y) {
            continue;
        }
        let point = disc / f64::from(POINTS * POINTS);
        *shares.entry((y * size[0] + x) as usize).or_default() += point / panorama_texel_solid_angle(y, size);
    }
    let is_in_disc = |x: f64, y: f64| {
        panorama_direction(DVec2::new(x / width, y / height)).dot(sun.direction) >= sun.angular_radius.cos()
    };
    let polar = panorama_uv(sun.direction).y * PI;
    let row = |angle: f64| ((angle / PI * height).max(0.0) as u32).min(size[1] - 1);
    let rows = (row(polar - sun.angular_radius)..=row(polar + sun.angular_radius)).filter(|y| is_small(*y));
    for (y, x) in rows.flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
        let at = |i: u32, k: u32| f64::from(i) + (f64::from(k) + 0.5) / f64::from(OF_CELL);
        let inside = (0..OF_CELL * OF_CELL).filter(|k| is_in_disc(at(x, k % OF_CELL), at(y, k / OF_CELL))).count();
        if inside > 0 {
            shares.insert((y * size[0] + x) as usize, inside as f64 / f64::from(OF_CELL * OF_CELL));
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn what_is_above_the_mean_is_kept_if_there_is_enough_of_it() {
        let size = [16, 8];
        let grey = |v: f32| [v, v, v, 1.0];
        let mut even = vec![grey(0.7); 128];
        assert!(!keep_excess(size, &mut even));
        assert!(!keep_excess(size, &mut vec![grey(0.0); 128]));
        let mut bright = vec![grey(1.0); 128];
        bright[70] = [9.0, 6.0, 0.0, 1.0];
        assert!(keep_excess(size, &mut bright));
        let mean = 1.0 + 4.0 * panorama_texel_solid_angle(70 / 16, size) / (4.0 * PI);
        let kept = 1.0 - 3.0 * mean / 15.0;
        let is = |got: f32, want: f64| assert!((f64::from(got) - want).abs() < 1e-5, "{got} is not {want}");
        is(bright[70][0], 9.0 * kept);
        is(bright[70][1], 6.0 * kept);
        assert!(bright.iter().enumerate().all(|(i, texel)| i == 70 || texel[..3] == [0.0; 3]));
    }

    /// The disc's cells, each whole one with about all of its light; also at a pole, where a row's cells are smaller than the
    /// distances of any points, and in cells that are larger than the disc.
    #[test]
    fn a_suns_cells_are_all_found() {
        for (width, direction) in
            [(1024, DVec3::Y), (1024, DVec3::new(0.02, -1.0, 0.0)), (1024, DVec3::X), (512, -DVec3::X), (16, DVec3::Z)]
        {
            let direction = direction.normalize();
            let sun = Sun { direction, irradiance: DVec3::ONE, angular_radius: 1f64.to_radians(), share: 1.0 };
            let size = [width, width / 2];
            let shares = covered(size, &sun);
            let solid_angle = |i: usize| panorama_texel_solid_angle(i as u32 / width, size);
            let total: f64 = shares.iter().map(|(i, share)| share * solid_angle(*i)).sum();
            let ratio = total / cone_solid_angle(sun.angular_radius);
            assert!((0.95..1.05).contains(&ratio), "{width}, {direction}: {ratio}");
            for y in 0..size[1] {
                for x in 0..width {
                    let corner = |k: u32| {
                        DVec2::new(f64::from(x + k % 2), f64::from(y + k / 2))
                            / DVec2::new(f64::from(width), f64::from(size[1]))
                    };
                    let is_whole =
                        (0..4).all(|k| panorama_direction(corner(k)).dot(direction) > sun.angular_radius.cos());
                    let share = shares.get(&((y * width + x) as usize)).copied().unwrap_or(0.0);
                    assert!(!is_whole || share > 0.95, "{width}, {direction}: {share} at {x}, {y}");
                }
            }
        }
    }
}
