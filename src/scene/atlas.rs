//! The lightmap's atlas: every triangle of a scene gets a place of its own in one square picture.
//!
//! Charts are cut, flattened and packed by `uvunwrap`, which is plain Rust and needs no C++ compiler. Beside xatlas, at
//! 1024², it gives a room of 18 k triangles 108 texels a metre in 0.3 s (96 in 0.5 s), a still life of 47 k 422 in 1.1 s
//! (390 in 5 s), two halls of 66 k and 262 k 10.9 in 5 s (10 in 9 s) and, folded, 7.2 in 5 s (8 in 25 s).
//!
//! Bilinear filtering reads every texel whose centre is nearer than one texel, along both axes; no texel may be read from
//! two charts. So the packer works on a picture of four times the size: a margin of two of its texels is half a texel
//! around each chart, and what lies in one aligned block of 4 × 4 is one texel, which it never shares. Charts may then
//! start in the middle of a texel, which saves one texel in width and height against whole texels of margin.

mod hidden;
mod kept;
mod layout;
mod unwrap;

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::Mat3;
use rayon::prelude::*;

use super::mesh::{Mesh, Vertex};
use super::{GeometryView, Instance};
use crate::asset::{Cache, Report};
pub use hidden::hidden_triangles;
pub use layout::{Atlas, NoAtlas, STEPS};
use layout::{Layout, MOST_TRIANGLES, Part, triangle_count};
use unwrap::{Failure, Placed, Shape};

/// Sides of an atlas, texels.
pub const SIDES: [u32; 11] = [64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048];
/// More charts than this take minutes to pack.
const MOST_CHARTS: usize = 16_384;
/// Texels for which there may be one chart: small charts take about nine with their margins.
const TEXELS_PER_CHART: usize = 12;
/// How often surfaces are left out until the rest fits, a quarter of the charts being wanted each time.
const ATTEMPTS: u32 = 4;
/// How many times fewer texels hidden surfaces have along each axis. The light of a room is off by 3.0 % instead of 2.3 % with half as many.
pub const COARSER: f32 = 3.0;

/// A scene's geometry with lightmap coordinates.
#[derive(Clone, Debug)]
pub struct Flattened {
    /// One for each instance, in their order, in local space as before: the same triangles, with vertices split where
    /// charts end.
    pub meshes: Vec<Mesh>,
    /// Each with the mesh of its own index.
    pub instances: Vec<Instance>,
    pub atlas: Atlas,
    /// Triangles without a place: degenerate ones, slivers, and the smallest surfaces of a scene that has too many. Each
    /// has the coordinates of one point of a neighbour, or else of the triangle before it.
    pub unplaced: usize,
}

/// A vertex's lightmap coordinates in [`STEPS`].
pub fn steps(lightmap_uv: [f32; 2]) -> [u16; 2] {
    // `as` saturates.
    lightmap_uv.map(|share| (share * STEPS as f32).round() as u16)
}

/// Where an atlas is kept and reported, and what stops it.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    pub cache: Option<&'a Cache>,
    pub report: &'a Report,
    /// Looked at some times a second; packing large scenes, about once a second.
    pub stop: &'a AtomicBool,
}

/// Gives each instance a mesh of its own with lightmap coordinates, in an atlas of `side` × `side` texels, with equally
/// many texels on each square metre, but [`COARSER`] where triangles are hidden; from the cache, or else computed and kept there.
///
/// The result depends on geometry, placements, `hidden` ([`hidden_triangles`], or empty) and `side` only, not on the number of threads.
///
/// # Errors
/// Why there is no atlas; the scene can be drawn without one.
pub fn flatten(
    geometry: GeometryView<'_>,
    hidden: &[Vec<bool>],
    side: u32,
    work: Work<'_>,
) -> Result<Flattened, NoAtlas> {
    let GeometryView { meshes, instances } = geometry;
    let triangles = triangle_count(geometry);
    if triangles > MOST_TRIANGLES {
        return Err(NoAtlas::TooManyTriangles(triangles));
    }
    let layout = match work.cache {
        None => lay_out(geometry, hidden, side, work)?,
        Some(cache) => {
            let key = kept::key(geometry, hidden, side);
            if let Some(layout) = kept::load(cache, &key, meshes, instances, side) {
                layout
            } else {
                let layout = lay_out(geometry, hidden, side, work)?;
                kept::keep(cache, &key, &layout);
                layout
            }
        }
    };
    Ok(apply(meshes, instances, layout))
}

fn apply(meshes: &[Mesh], instances: &[Instance], layout: Layout) -> Flattened {
    let mesh = |(instance, part): (&Instance, Part)| {
        let mesh = &meshes[instance.mesh];
        let vertices = part.sources.iter().zip(&part.coordinates).map(|(source, coordinates)| Vertex {
            lightmap_uv: coordinates.map(|c| f32::from(c) / STEPS as f32),
            ..mesh.vertices[*source as usize]
        });
        let vertices = vertices.collect();
        let (name, material, bounds) = (mesh.name.clone(), mesh.material, mesh.bounds);
        Mesh { name, vertices, indices: part.indices, material, bounds }
    };
    let placed = |(mesh, instance): (usize, &Instance)| Instance { mesh, ..*instance };
    Flattened {
        meshes: instances.par_iter().zip(layout.parts).map(mesh).collect(),
        instances: instances.iter().enumerate().map(placed).collect(),
        atlas: layout.atlas,
        unplaced: layout.unplaced,
    }
}

/// Unwraps a scene; where it falls into too many charts, without the smallest of its connected surfaces.
fn lay_out(
    GeometryView { meshes, instances }: GeometryView<'_>,
    hidden: &[Vec<bool>],
    side: u32,
    work: Work<'_>,
) -> Result<Layout, NoAtlas> {
    let shape = |instance: &Instance| Shape::new(&meshes[instance.mesh], Mat3::from_mat4(instance.world_from_local));
    let mut shapes: Vec<Shape> = instances.par_iter().map(shape).collect();
    shapes.iter_mut().zip(hidden).for_each(|(shape, hidden)| shape.shrink(hidden, COARSER));
    let most = (side as usize * side as usize / TEXELS_PER_CHART).min(MOST_CHARTS);
    let bar = work.report.progress("atlas", unwrap::PROGRESS);
    let mut result = Err(NoAtlas::TooFragmented);
    for attempt in 0..ATTEMPTS {
        if attempt > 0 {
            unwrap::keep_largest(&mut shapes, most >> (2 * attempt));
        }
        let progress = |steps| {
            bar.set_position(steps);
            !work.stop.load(Ordering::Relaxed)
        };
        result = match unwrap::unwrap(&shapes, side, most, progress) {
            Ok(placed) => Ok(parts(meshes, instances, &placed)),
            Err(Failure::TooManyCharts) => continue,
            Err(Failure::Final(why)) => Err(why),
        };
        break;
    }
    bar.finish_and_clear();
    result
}

/// Splits the meshes' vertices by their coordinates.
fn parts(meshes: &[Mesh], instances: &[Instance], placed: &Placed) -> Layout {
    // Corners without a place take that of the corner before, the first ones that of the first corner that has one.
    let mut last = placed.corners.iter().flatten().flatten().next().copied().unwrap_or_default();
    let is_unplaced = |c: &&[Option<[u16; 2]>]| c[0].is_none() || (c[0] == c[1] && c[1] == c[2]);
    let unplaced = placed.corners.iter().map(|c| c.chunks_exact(3).filter(is_unplaced).count()).sum();
    let part = |(instance, corners): (&Instance, &Vec<Option<[u16; 2]>>)| {
        let mut part = Part::default();
        let mut known: HashMap<(u32, [u16; 2]), u32> = HashMap::with_capacity(corners.len() / 4);
        for (source, place) in meshes[instance.mesh].indices.iter().zip(corners) {
            last = place.unwrap_or(last);
            let index = *known.entry((*source, last)).or_insert_with(|| {
                part.sources.push(*source);
                part.coordinates.push(last);
                part.sources.len() as u32 - 1
            });
            part.indices.push(index);
        }
        part
    };
    let parts = instances.iter().zip(&placed.corners).map(part).collect();
    Layout { atlas: placed.atlas, unplaced, parts }
}

#[cfg(test)]
#[path = "atlas_tests.rs"]
mod tests;
