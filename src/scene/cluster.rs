//! A scene's triangles as they are drawn: clusters of one material and neighbourhood, ordered for the GPU's caches.

use std::collections::HashMap;
use std::mem::offset_of;

use glam::{Mat4, Vec3};
use meshopt::VertexDataAdapter;
use rayon::prelude::*;

use super::Instance;
use super::culling_bounds::connected_components;
use super::mesh::{Bounds, Mesh, Vertex};

/// Larger neighbourhoods are split. Small enough for frustum culling and for 16-bit indices (three corners per
/// triangle), large enough that the CPU's cost per draw is negligible.
pub const MOST_TRIANGLES: usize = 4096;
const _: () = assert!(3 * MOST_TRIANGLES <= 1 << 16);
/// Connected blended surfaces of a material that are clusters of their own; the rest are merged.
const MOST_SEPARATE: usize = 1024;
/// How much worse the vertex cache may get for less overdraw (as meshoptimizer recommends).
const OVERDRAW_THRESHOLD: f32 = 1.05;

/// Triangles of one material near each other, with all their instances.
pub struct Cluster {
    pub vertices: Vec<Vertex>,
    /// Three per triangle, each below `vertices.len()`; at most 3 · [`MOST_TRIANGLES`].
    pub indices: Vec<u16>,
    /// Index into the scene's materials.
    pub material: usize,
    /// Local space.
    pub bounds: Bounds,
    /// For closed surfaces: their bounds in local space, from outside of which no back face is visible, so that back
    /// faces can be culled. `None` for open ones.
    pub culling_bounds: Option<Bounds>,
    /// World from local, for each instance.
    pub placements: Vec<Mat4>,
}

impl Cluster {
    /// The bounds of an instance: of a turned one less than those of its turned box.
    pub fn bounds_at(&self, world_from_local: Mat4) -> Bounds {
        Bounds::of(self.vertices.iter().map(|vertex| world_from_local.transform_point3(vertex.position.into())))
    }
}

/// Splits a scene's instances into clusters. Meshes with the same material and transforms are merged.
///
/// `blends`: whether a material's surfaces are blended with what is behind. Each connected one of these is a cluster of its
/// own, so that they can be drawn far before near.
pub fn clusters(meshes: &[Mesh], instances: &[Instance], blends: &[bool]) -> Vec<Cluster> {
    let groups = groups(meshes, instances);
    let cut = |group: &Group<'_>| cut_group(group, blends.get(group.material) == Some(&true));
    groups.par_iter().flat_map_iter(cut).collect()
}

/// Meshes of one material with the same transforms.
struct Group<'a> {
    meshes: Vec<&'a Mesh>,
    material: usize,
    placements: Vec<Mat4>,
}

fn groups<'a>(meshes: &'a [Mesh], instances: &[Instance]) -> Vec<Group<'a>> {
    let mut placements: Vec<Vec<Mat4>> = vec![Vec::new(); meshes.len()];
    instances.iter().for_each(|instance| placements[instance.mesh].push(instance.world_from_local));
    let mut groups: Vec<Group<'a>> = Vec::new();
    let mut known: HashMap<(usize, Vec<u32>), usize> = HashMap::new();
    for (mesh, placements) in meshes.iter().zip(placements) {
        if placements.is_empty() {
            continue;
        }
        let bits = placements.iter().flat_map(|place| place.to_cols_array().map(f32::to_bits)).collect();
        let group = *known.entry((mesh.material, bits)).or_insert(groups.len());
        if group == groups.len() {
            groups.push(Group { meshes: Vec::new(), material: mesh.material, placements });
        }
        groups[group].meshes.push(mesh);
    }
    groups
}

/// Triangles that are not split.
struct Unit {
    triangles: Vec<[u32; 3]>,
    centre: Vec3,
    /// Bounds of the closed surface that they are part of; `None` if it is open.
    culling_bounds: Option<Bounds>,
}

fn cut_group(group: &Group<'_>, separately: bool) -> Vec<Cluster> {
    let mut vertices: Vec<Vertex> = Vec::new();
    let (mut closed, mut open, mut separate) = (Vec::new(), Vec::new(), Vec::new());
    for mesh in &group.meshes {
        // OBJ files of 2^32 vertices are rejected when they are read.
        let first = vertices.len() as u32;
        for component in connected_components(&mesh.vertices, &mesh.indices) {
            let triangles: Vec<[u32; 3]> = component.triangles.iter().map(|t| t.map(|corner| corner + first)).collect();
            if component.closed() && triangles.len() <= MOST_TRIANGLES {
                closed.push(Unit {
                    triangles,
                    centre: component.bounds.centre(),
                    culling_bounds: component.culling_bounds,
                });
            } else {
                let units = if component.closed() { &mut closed } else { &mut open };
                let around = component.culling_bounds;
                units.extend(triangles.into_iter().map(|t| {
                    let centre = t.iter().map(|c| corner_position(&mesh.vertices[(c - first) as usize])).sum::<Vec3>();
                    Unit { triangles: vec![t], centre: centre / 3.0, culling_bounds: around }
                }));
            }
            if separately && separate.len() < MOST_SEPARATE {
                separate.push([std::mem::take(&mut closed), std::mem::take(&mut open)]);
            }
        }
        vertices.extend_from_slice(&mesh.vertices);
    }
    let mut parts: Vec<&[Unit]> = Vec::new();
    separate.push([closed, open]);
    separate.iter_mut().flatten().for_each(|units| split(units, &mut parts));
    parts.into_iter().map(|units| cluster(units, &vertices, group)).collect()
}

fn corner_position(vertex: &Vertex) -> Vec3 {
    vertex.position.into()
}

/// Halves at the median along the longest side until every part is small.
fn split<'a>(units: &'a mut [Unit], parts: &mut Vec<&'a [Unit]>) {
    let triangles: usize = units.iter().map(|unit| unit.triangles.len()).sum();
    if triangles == 0 {
        return;
    }
    if triangles <= MOST_TRIANGLES || units.len() == 1 {
        parts.push(units);
        return;
    }
    let bounds = Bounds::of(units.iter().map(|unit| unit.centre));
    let size = bounds.max - bounds.min;
    let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let middle = units.len() / 2;
    // Where centres coincide, the corners of the first triangle decide, so that the same file is always split alike.
    units.select_nth_unstable_by(middle, |a, b| {
        a.centre[axis].total_cmp(&b.centre[axis]).then(a.triangles[0].cmp(&b.triangles[0]))
    });
    let (low, high) = units.split_at_mut(middle);
    split(low, parts);
    split(high, parts);
}

/// Makes a cluster with its own vertices in the order of use, and triangles ordered for the vertex cache and against
/// overdraw.
fn cluster(units: &[Unit], all: &[Vertex], group: &Group<'_>) -> Cluster {
    let mut known: HashMap<u32, u32> = HashMap::new();
    let mut vertices: Vec<Vertex> = Vec::new();
    let corners = units.iter().flat_map(|unit| unit.triangles.as_flattened());
    let local = corners.map(|corner| {
        *known.entry(*corner).or_insert_with(|| {
            vertices.push(all[*corner as usize]);
            vertices.len() as u32 - 1
        })
    });
    let mut indices: Vec<u32> = local.collect();
    meshopt::optimize_vertex_cache_in_place(&mut indices, vertices.len());
    let bytes = bytemuck::cast_slice(&vertices);
    // It fails only where the stride does not divide the bytes.
    if let Ok(positions) = VertexDataAdapter::new(bytes, size_of::<Vertex>(), offset_of!(Vertex, position)) {
        meshopt::optimize_overdraw_in_place(&mut indices, &positions, OVERDRAW_THRESHOLD);
    }
    let used = meshopt::optimize_vertex_fetch_in_place(&mut indices, &mut vertices);
    vertices.truncate(used);
    let around = |a: Bounds, b: Bounds| Bounds::of([a.min, a.max, b.min, b.max]);
    Cluster {
        bounds: Bounds::of(vertices.iter().map(corner_position)),
        // At most three per triangle, which fit 16 bits, as asserted above.
        indices: indices.into_iter().map(|i| i as u16).collect(),
        vertices,
        material: group.material,
        culling_bounds: units.iter().map(|unit| unit.culling_bounds).reduce(|a, b| Some(around(a?, b?))).flatten(),
        placements: group.placements.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(ball: Mesh, material: usize, at: Vec3) -> Mesh {
        let moved =
            |v: Vertex| Vertex { position: (Vec3::from(v.position) + at).into(), lightmap_uv: [v.uv[1], v.uv[0]], ..v };
        let vertices: Vec<Vertex> = ball.vertices.into_iter().map(moved).collect();
        let bounds = Bounds::of(vertices.iter().map(corner_position));
        Mesh { vertices, material, bounds, ..ball }
    }

    fn placed(mesh: usize, world_from_local: Mat4) -> Instance {
        Instance { mesh, world_from_local }
    }

    /// Corners of all triangles with area, each turned so that its least corner comes first.
    fn triangles<'a>(of: impl Iterator<Item = (&'a [Vertex], Vec<u32>)>) -> Vec<[[u32; 18]; 3]> {
        let mut all: Vec<[[u32; 18]; 3]> = Vec::new();
        for (vertices, indices) in of {
            for t in indices.chunks_exact(3) {
                let mut corners = [t[0], t[1], t[2]].map(|i| bytemuck::cast::<Vertex, [u32; 18]>(vertices[i as usize]));
                let place = |c: &[u32; 18]| [c[0], c[1], c[2]].map(|bits| f32::from_bits(bits) + 0.0);
                if place(&corners[0]) == place(&corners[1])
                    || place(&corners[1]) == place(&corners[2])
                    || place(&corners[2]) == place(&corners[0])
                {
                    continue;
                }
                let least = (0..3).min_by_key(|i| corners[*i]).unwrap();
                corners.rotate_left(least);
                all.push(corners);
            }
        }
        all.sort_unstable();
        all
    }

    #[test]
    fn clusters_hold_every_triangle_once_with_unchanged_corners() {
        let meshes = [
            mesh(Mesh::ball(70, 1.0), 0, Vec3::ZERO),
            mesh(Mesh::ball(20, 0.5), 0, Vec3::X * 3.0),
            mesh(
                {
                    let ball = Mesh::ball(60, 1.0);
                    Mesh { indices: ball.indices[600..].to_vec(), ..ball }
                },
                1,
                Vec3::Y * 3.0,
            ),
        ];
        let instances = [0, 1, 2].map(|i| placed(i, Mat4::IDENTITY));
        let clusters = clusters(&meshes, &instances, &[]);
        assert!(clusters.iter().all(|c| c.indices.len() <= 3 * MOST_TRIANGLES && c.placements == [Mat4::IDENTITY]));
        assert!(clusters.len() < 14, "{} ranges", clusters.len());
        for material in [0, 1] {
            let wanted = meshes.iter().filter(|m| m.material == material).map(|m| (&m.vertices[..], m.indices.clone()));
            let got = clusters.iter().filter(|c| c.material == material);
            let got = got.map(|c| (&c.vertices[..], c.indices.iter().map(|i| u32::from(*i)).collect()));
            assert!(triangles(got) == triangles(wanted));
        }
        for c in &clusters {
            assert_eq!(c.bounds, Bounds::of(c.vertices.iter().map(corner_position)));
            assert_eq!(c.culling_bounds.is_some(), c.material == 0, "the third ball has a hole");
            let outer = c.culling_bounds.unwrap_or(c.bounds);
            assert!(outer.min.cmple(c.bounds.min).all() && outer.max.cmpge(c.bounds.max).all());
        }
    }

    #[test]
    fn only_meshes_with_the_same_transforms_are_merged() {
        let meshes = [0.0, 3.0, 6.0].map(|x| mesh(Mesh::ball(6, 1.0), 0, Vec3::X * x));
        let there = Mat4::from_translation(Vec3::Y);
        let one = clusters(&meshes, &[0, 1, 2].map(|i| placed(i, there)), &[]);
        assert_eq!((one.len(), &one[0].placements), (1, &vec![there]));
        let two = clusters(&meshes, &[placed(0, there), placed(1, there), placed(0, Mat4::IDENTITY)], &[]);
        let apart = clusters(&meshes, &[0, 1, 2].map(|i| placed(i, there)), &[true]);
        assert_eq!(apart.len(), 3, "blended");
        assert_eq!(two.iter().map(|c| c.placements.len()).collect::<Vec<_>>(), [2, 1], "the third is not shown");
    }

    #[test]
    fn triangles_are_ordered_for_the_vertex_cache() {
        let mut source = mesh(Mesh::ball(40, 1.0), 0, Vec3::ZERO);
        // Every 97th triangle: an order without any locality.
        let count = source.indices.len() / 3;
        let scattered = (0..count).flat_map(|i| source.indices[i * 97 % count * 3..][..3].to_vec());
        source.indices = scattered.collect();
        let vertices = source.vertices.len();
        let before = meshopt::analyze_vertex_cache(&source.indices, vertices, 32, 0, 0).acmr;
        let clusters = clusters(&[source], &[placed(0, Mat4::IDENTITY)], &[]);
        for c in clusters {
            let indices: Vec<u32> = c.indices.iter().map(|i| u32::from(*i)).collect();
            let after = meshopt::analyze_vertex_cache(&indices, c.vertices.len(), 32, 0, 0).acmr;
            assert!(after < 0.85 && after < 0.4 * before, "vertices per triangle: {before}, then {after}");
        }
    }
}
