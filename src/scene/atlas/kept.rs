//! Atlases in the cache on disk: a layout as words, stored as the texels of a picture.

use glam::Mat3;

use super::layout::{Atlas, Layout, Part};
use crate::asset::Cache;
use crate::asset::cache::Key;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::scene::{GeometryView, Instance, Mesh};

/// Raise it whenever the same scene gets another layout, as by another version of `uvunwrap`.
const VERSION: u32 = 3;
/// Words in a row of the picture.
const ROW: usize = 4096;
/// Limit of an entry's header, key and values, in bytes.
pub const HEAD_BYTES: u64 = 1 << 16;
/// Words of a layout before its parts.
const HEAD: usize = 4;

/// A hash of everything that a layout depends on.
pub fn key(GeometryView { meshes, instances }: GeometryView<'_>, hidden: &[Vec<bool>], side: u32) -> String {
    let mut key = Key::new("atlas", VERSION);
    key.add(&side.to_le_bytes());
    key.add(&hidden.iter().flatten().map(|hidden| u8::from(*hidden)).collect::<Vec<_>>());
    for mesh in meshes {
        key.add(bytemuck::cast_slice(&mesh.vertices));
        key.add(bytemuck::cast_slice(&mesh.indices));
    }
    for Instance { mesh, world_from_local } in instances {
        key.add(&(*mesh as u64).to_le_bytes());
        // The sum makes −0 and 0 equal.
        let linear = Mat3::from_mat4(*world_from_local).to_cols_array().map(|value| value + 0.0);
        key.add(bytemuck::cast_slice(&linear));
    }
    key.text()
}

/// A layout that was kept, if it fits the scene.
pub fn load(cache: &Cache, key: &str, meshes: &[Mesh], instances: &[Instance], side: u32) -> Option<Layout> {
    // Each corner of a triangle gives an index and at most one vertex of two words.
    let corners: usize = instances.iter().map(|instance| meshes[instance.mesh].indices.len()).sum();
    let words = HEAD + 2 * instances.len() + 3 * corners + ROW;
    let limit = HEAD_BYTES + 4 * words as u64;
    let entry = cache.load(key, limit, |entry| entry.format == TexelFormat::Rgba8 && entry.size[0] as usize == ROW)?;
    // Bytes need not be aligned as words are.
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(entry.levels.first()?);
    parse(&mut Words(&words), meshes, instances, side)
}

/// Keeps a layout; a failure is logged.
pub fn keep(cache: &Cache, key: &str, layout: &Layout) {
    let Layout { atlas, unplaced, parts } = layout;
    let mut words = vec![atlas.charts as u32, atlas.texels_per_metre.to_bits(), atlas.used.to_bits(), *unplaced as u32];
    for part in parts {
        words.extend([part.sources.len() as u32, part.indices.len() as u32]);
        words.extend(&part.sources);
        words.extend(part.coordinates.iter().map(|[u, v]| u32::from(*u) | u32::from(*v) << 16));
        words.extend(&part.indices);
    }
    let rows = words.len().div_ceil(ROW);
    words.resize(rows * ROW, 0);
    let levels = vec![bytemuck::cast_slice(&words).to_vec()];
    let size = [ROW as u32, rows as u32];
    cache.keep(key, Ktx2 { format: TexelFormat::Rgba8, size, layers: 0, faces: 1, levels, key_values: [].into() });
}

/// Words that are still to be read.
struct Words<'a>(&'a [u32]);

impl<'a> Words<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u32]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }
}

fn parse(words: &mut Words<'_>, meshes: &[Mesh], instances: &[Instance], side: u32) -> Option<Layout> {
    let [charts, texels_per_metre, used, unplaced] = words.take(HEAD)?.try_into().ok()?;
    let atlas = Atlas {
        size: [side; 2],
        texels_per_metre: f32::from_bits(texels_per_metre),
        charts: charts as usize,
        used: f32::from_bits(used),
    };
    let parts = instances.iter().map(|instance| part(words, &meshes[instance.mesh])).collect::<Option<_>>()?;
    Some(Layout { atlas, unplaced: unplaced as usize, parts })
}

fn part(words: &mut Words<'_>, mesh: &Mesh) -> Option<Part> {
    let [vertices, indices]: [u32; 2] = words.take(2)?.try_into().ok()?;
    let sources = words.take(vertices as usize)?.to_vec();
    let coordinates = words.take(vertices as usize)?.iter().map(|word| [*word as u16, (word >> 16) as u16]).collect();
    let indices = words.take(indices as usize)?.to_vec();
    let fits = indices.len() == mesh.indices.len()
        && indices.iter().all(|index| *index < vertices)
        && sources.iter().all(|source| (*source as usize) < mesh.vertices.len());
    fits.then_some(Part { sources, coordinates, indices })
}
