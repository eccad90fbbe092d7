//! Unwrapping by `uvunwrap`: what it is given, and coordinates for each corner of what it returns.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use uvunwrap::{Density, Error, MeshInput, Options, OutputMesh, Packing, Progress, Stage};

use super::layout::{Atlas, NoAtlas, STEPS};
use crate::scene::groups::Groups;
use crate::scene::mesh::{Mesh, Vertex};

/// Steps of progress.
pub const PROGRESS: u64 = 100;
/// The packer's texels along the side of one of ours, as its blocks are.
const BLOCK: u32 = 4;
/// Half a texel.
const MARGIN: u32 = BLOCK / 2;
/// From this many triangles on, charts are folded into rows, which is ten times faster than trying their shapes, for a
/// tenth fewer texels along each axis.
const FOLD: usize = 100_000;

/// One instance's surface in world space, but for its translation.
pub struct Shape {
    positions: Vec<[f32; 3]>,
    /// Of `positions`; the mesh's triangles in their order.
    indices: Vec<u32>,
    /// Triangles that get no place.
    ignored: Vec<bool>,
    /// Connected triangles and their area, m²; only where some have to be left out.
    surfaces: Vec<(Vec<u32>, f64)>,
}

impl Shape {
    /// Vertices of equal position and normal are one: charts end at sharp edges, where light may change at once, and not
    /// where a texture's coordinates do.
    pub fn new(mesh: &Mesh, world_from_local: Mat3) -> Self {
        let mut known: HashMap<[u32; 6], u32> = HashMap::with_capacity(mesh.vertices.len());
        let mut positions: Vec<[f32; 3]> = Vec::new();
        let mut weld = |vertex: &Vertex| {
            let ([x, y, z], [a, b, c]) = (vertex.position, vertex.normal);
            // The sum makes −0 and 0 equal.
            let bits = [x, y, z, a, b, c].map(|value| (value + 0.0).to_bits());
            *known.entry(bits).or_insert_with(|| {
                positions.push((world_from_local * Vec3::new(x, y, z)).to_array());
                positions.len() as u32 - 1
            })
        };
        let welded: Vec<u32> = mesh.vertices.iter().map(&mut weld).collect();
        let indices: Vec<u32> = mesh.indices.iter().map(|index| welded[*index as usize]).collect();
        let is_finite = |index: &u32| positions[*index as usize].iter().all(|value| value.is_finite());
        let ignored = indices.chunks_exact(3).map(|triangle| !triangle.iter().all(is_finite)).collect();
        for position in positions.iter_mut().filter(|p| !p.iter().all(|value| value.is_finite())) {
            *position = [0.0; 3];
        }
        Self { positions, indices, ignored, surfaces: Vec::new() }
    }

    fn input(&self) -> MeshInput<'_> {
        MeshInput { ignored_faces: Some(&self.ignored), ..MeshInput::new(&self.positions, &self.indices) }
    }

    fn area(&self, triangle: u32) -> f64 {
        let corner = |i: u32| Vec3::from(self.positions[self.indices[(3 * triangle + i) as usize] as usize]).as_dvec3();
        let (a, b, c) = (corner(0), corner(1), corner(2));
        (b - a).cross(c - a).length() * 0.5
    }

    /// Its connected triangles, and their areas, m².
    pub fn into_surfaces(mut self) -> Vec<(Vec<u32>, f64)> {
        self.find_surfaces();
        self.surfaces
    }

    /// Gives surfaces whose triangles are hidden so much fewer texels along each axis; no vertex is part of two surfaces.
    pub fn shrink(&mut self, hidden: &[bool], factor: f32) {
        let mut shrunk = vec![false; self.positions.len()];
        for (triangle, _) in self.indices.chunks_exact(3).zip(hidden).filter(|(_, hidden)| **hidden) {
            for corner in triangle.iter().map(|corner| *corner as usize) {
                if !std::mem::replace(&mut shrunk[corner], true) {
                    self.positions[corner] = self.positions[corner].map(|value| value / factor);
                }
            }
        }
    }

    fn find_surfaces(&mut self) {
        if !self.surfaces.is_empty() {
            return;
        }
        let mut groups = Groups::new(self.positions.len());
        for triangle in self.indices.chunks_exact(3) {
            groups.join(triangle[0], triangle[1]);
            groups.join(triangle[1], triangle[2]);
        }
        let mut surfaces: BTreeMap<u32, (Vec<u32>, f64)> = BTreeMap::new();
        for (triangle, corners) in (0..).zip(self.indices.chunks_exact(3)) {
            let (triangles, area) = surfaces.entry(groups.of(corners[0])).or_default();
            triangles.push(triangle);
            *area += self.area(triangle);
        }
        self.surfaces = surfaces.into_values().collect();
    }
}

/// Ignores all but the `most` largest connected surfaces.
pub fn keep_largest(shapes: &mut [Shape], most: usize) {
    shapes.par_iter_mut().for_each(Shape::find_surfaces);
    let of_shape = |(shape, it): (usize, &Shape)| {
        it.surfaces.iter().enumerate().map(move |(surface, (_, area))| (*area, shape, surface)).collect::<Vec<_>>()
    };
    let mut all: Vec<(f64, usize, usize)> = shapes.iter().enumerate().flat_map(of_shape).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    for (_, shape, surface) in all.into_iter().skip(most) {
        let Shape { surfaces, ignored, .. } = &mut shapes[shape];
        surfaces[surface].0.iter().for_each(|triangle| ignored[*triangle as usize] = true);
    }
}

/// Coordinates for each corner of each shape, in [`STEPS`]; `None` for corners of triangles without a place.
pub struct Placed {
    pub atlas: Atlas,
    pub corners: Vec<Vec<Option<[u16; 2]>>>,
}

/// Why there are no coordinates.
pub enum Failure {
    TooManyCharts,
    Final(NoAtlas),
}

/// Cuts, flattens and packs. `progress` is told steps up to [`PROGRESS`]; where it returns false, that ends the work.
pub fn unwrap(
    shapes: &[Shape],
    side: u32,
    most_charts: usize,
    progress: impl Fn(u64) -> bool + Sync,
) -> Result<Placed, Failure> {
    let inputs: Vec<MeshInput<'_>> = shapes.iter().map(Shape::input).collect();
    let triangles: usize = shapes.iter().map(|shape| shape.ignored.iter().filter(|ignored| !**ignored).count()).sum();
    let options = Options {
        density: Density::Auto { page_size: BLOCK * side },
        padding: MARGIN,
        block_align: true,
        packing: if triangles < FOLD { Packing::Shape } else { Packing::Fast },
        ..Options::default()
    };
    // One report for each chart.
    let charts = AtomicUsize::new(0);
    let go_on = |now: Progress| {
        let more = usize::from(now.stage == Stage::Parameterizing);
        progress(steps(now)) && charts.fetch_add(more, Ordering::Relaxed) + more <= most_charts
    };
    let found = match uvunwrap::generate_with_progress(&inputs, &options, go_on) {
        Ok(found) => found,
        Err(Error::Cancelled) if charts.load(Ordering::Relaxed) > most_charts => return Err(Failure::TooManyCharts),
        Err(Error::Cancelled) => return Err(Failure::Final(NoAtlas::Stopped)),
        Err(error) => return Err(Failure::Final(NoAtlas::Defect(error.to_string()))),
    };
    if found.chart_count == 0 {
        return Err(Failure::Final(NoAtlas::NoArea));
    }
    if found.page_count != 1 {
        return Err(Failure::TooManyCharts);
    }
    // Rows that are not used are cut off, which is undone here.
    let height = f64::from(found.height) / f64::from(BLOCK * side);
    let atlas = Atlas {
        size: [side; 2],
        texels_per_metre: found.texels_per_unit / BLOCK as f32,
        charts: found.chart_count as usize,
        used: found.utilization * height as f32,
    };
    Ok(Placed { atlas, corners: found.meshes.par_iter().map(|mesh| corners(mesh, height)).collect() })
}

/// Half of the work is flattening, the other half packing, whose trials are about 20.
fn steps(now: Progress) -> u64 {
    let share = now.total.filter(|total| *total > 0).map_or(0.0, |total| now.done as f64 / total as f64);
    match now.stage {
        Stage::Segmenting => (5.0 * share) as u64,
        Stage::Parameterizing => 5 + (45.0 * share) as u64,
        Stage::Packing => 50 + (2 * now.done as u64).min(48),
        _ => PROGRESS - 1,
    }
}

/// Rounded to whole steps, which never moves a corner across a border of texels.
fn corners(mesh: &OutputMesh, height: f64) -> Vec<Option<[u16; 2]>> {
    let step = |share: f64| (share * f64::from(STEPS)).round().clamp(0.0, f64::from(STEPS - 1)) as u16;
    let corner = |index: &u32| {
        let vertex = &mesh.vertices[*index as usize];
        let [u, v] = vertex.uv.map(f64::from);
        vertex.chart.map(|_| [step(u), step(v * height)])
    };
    mesh.indices.iter().map(corner).collect()
}
