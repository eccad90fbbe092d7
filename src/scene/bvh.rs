//! A scene's triangles in world space under a bounding volume hierarchy, and rays through it: the twin of
//! `glsl/bvh.glsl`.

use std::collections::HashSet;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::PlocBuilder;
use obvhs::triangle::Triangle;

use super::mesh::Bounds;
use super::{Instance, Mesh};
use crate::{Error, Result};

/// Entries of a traversal's stack; the tree is at most this deep. The same as in `glsl/bvh.glsl`.
pub const STACK: usize = 32;
/// Levels of a binary tree up to which it is made wide by recursion.
const MOST_BINARY: usize = 128;
/// More triangles than this whose boxes have on average this part of the scene's area are nearly all alike.
const FEW: usize = 1000;
const ALIKE: f32 = 0.1;
/// Triangles of a leaf.
const LEAF: u32 = 3;
/// Part of a triangle's height by which it is larger for rays, so that none passes between neighbours.
const EDGE_SLACK: f32 = 1e-6;
/// Slack for rounding, six units in the last place: Ize, "Robust BVH Ray Traversal" (2013), for boxes of bytes.
const SLACK: f32 = 3.6e-7;
/// The most triangles: their indices, and those of their corners, have 32 bits.
const MOST_TRIANGLES: usize = (u32::MAX / 3) as usize;

/// A compressed wide BVH: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
/// BVHs" (2017).
pub struct Bvh {
    nodes: Vec<CwBvhNode>,
    /// In the order of the leaves.
    triangles: Vec<BvhTriangle>,
    bounds: Bounds,
}

/// A triangle of an instance, and where it comes from.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BvhTriangle {
    /// World space, metres.
    pub corners: [[f32; 3]; 3],
    /// Index into the scene's instances.
    pub instance: u32,
    /// Index of the first of its three indices in the mesh.
    pub first_index: u32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// In lengths of the ray's direction.
    pub t: f32,
    /// Index into [`Bvh::triangles`].
    pub triangle: usize,
    /// Of the triangle's corners; their sum is 1.
    pub weights: Vec3,
}

impl BvhTriangle {
    /// The box around it.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.corners.map(Vec3::from))
    }
}

impl Bvh {
    /// Builds the hierarchy; triangles without area are left out, as no ray can hit them.
    ///
    /// # Errors
    /// More triangles than 32-bit indices can name.
    pub fn new(meshes: &[Mesh], instances: &[Instance]) -> Result<Self> {
        let listed = listed(meshes, instances);
        if listed.len() > MOST_TRIANGLES {
            let problem = format!("{} triangles are too many", listed.len());
            return Err(Error::GpuMemory { what: "geometry for rays".into(), problem });
        }
        if listed.is_empty() {
            return Ok(Self { nodes: vec![empty_node()], triangles: Vec::new(), bounds: Bounds::EMPTY });
        }
        let boxed = |triangle: &BvhTriangle| {
            let [v0, v1, v2] = triangle.corners.map(Vec3A::from);
            Triangle { v0, v1, v2 }
        };
        let shapes: Vec<Triangle> = listed.iter().map(boxed).collect();
        let CwBvh { nodes, primitive_indices, .. } = build(&shapes);
        let triangles = primitive_indices.iter().map(|index| listed[*index as usize]).collect();
        let bounds = Bounds::of(listed.iter().flat_map(|t| t.corners.map(Vec3::from)));
        Ok(Self { nodes, triangles, bounds })
    }

    /// The nodes as `glsl/bvh.glsl` reads them, 80 bytes each; at least one.
    pub fn node_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.nodes)
    }

    /// All triangles that have an area.
    pub fn triangles(&self) -> &[BvhTriangle] {
        &self.triangles
    }

    /// Bounds of the triangles in world space; empty without any.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The nearest hit before `t`, of those that `accept` does not reject.
    pub fn trace(&self, o: Vec3, d: Vec3, mut t: f32, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let inverse = inverse(d);
        let octant: u32 = (0..3).map(|axis| u32::from(inverse[axis] >= 0.0) << (2 - axis)).sum();
        let mut nearest = None;
        let mut stack = vec![(0u32, 0x8000_0000u32)];
        while let Some((base, mut bits)) = stack.pop() {
            let highest: u32 = 31 - bits.leading_zeros();
            bits &= !(1 << highest);
            if bits > 0x00ff_ffff {
                stack.push((base, bits));
            }
            let slot = (highest - 24) ^ octant;
            let before = (bits & 0xff & !(u32::MAX << slot)).count_ones();
            let node = &self.nodes[(base + before) as usize];
            let hits = children(node, o, inverse, t, octant);
            let mut triangles = hits & 0x00ff_ffff;
            while triangles != 0 {
                let bit = 31 - triangles.leading_zeros();
                triangles &= !(1 << bit);
                let index = (node.primitive_base_idx + bit) as usize;
                if let Some(hit) = self.meet(index, o, d).filter(|hit| hit.t < t && accept(hit)) {
                    (nearest, t) = (Some(hit), hit.t);
                }
            }
            let inner = (hits & 0xff00_0000) | u32::from(node.imask);
            if inner > 0x00ff_ffff {
                stack.push((node.child_base_idx, inner));
            }
        }
        nearest
    }

    /// Where a ray meets a triangle, from the volumes that its direction spans with each edge (Plücker coordinates). Sums
    /// and differences of corners lose fewer digits than their products.
    fn meet(&self, index: usize, o: Vec3, d: Vec3) -> Option<Hit> {
        let [a, b, c] = self.triangles[index].corners.map(|corner| Vec3::from(corner) - o);
        let volume = |from: Vec3, to: Vec3| (to - from).cross(to + from).dot(d);
        let volumes = Vec3::new(volume(b, c), volume(c, a), volume(a, b));
        let sum = volumes.element_sum();
        let weights = volumes / sum;
        if sum == 0.0 || weights.min_element() < -EDGE_SLACK {
            return None;
        }
        let t = (weights.x * a + weights.y * b + weights.z * c).dot(d) / d.length_squared();
        (t >= 0.0).then_some(Hit { t, triangle: index, weights })
    }
}

/// The triangles of all instances that have an area.
fn listed(meshes: &[Mesh], instances: &[Instance]) -> Vec<BvhTriangle> {
    let of_instance = |(number, instance): (usize, &Instance)| -> Vec<BvhTriangle> {
        let mesh = &meshes[instance.mesh];
        let position = |index: &u32| mesh.vertices[*index as usize].position.into();
        let place = |index: &u32| instance.world_from_local.transform_point3(position(index)).to_array();
        let triangle = |(triangle, indices): (usize, &[u32; 3])| BvhTriangle {
            corners: indices.each_ref().map(place),
            instance: number as u32,
            first_index: 3 * triangle as u32,
        };
        mesh.indices.as_chunks().0.iter().enumerate().map(triangle).filter(has_area).collect()
    };
    // Copies of one triangle would hide each other, and make a tree as deep as they are many.
    let mut known = HashSet::new();
    let all = instances.iter().enumerate().flat_map(of_instance);
    all.filter(|triangle| known.insert(triangle.corners.map(|corner| corner.map(f32::to_bits)))).collect()
}

fn has_area(triangle: &BvhTriangle) -> bool {
    let [a, b, c] = triangle.corners.map(|corner| Vec3::from(corner).as_dvec3());
    (b - a).cross(c - a).length_squared() > 0.0
}

/// The best tree that is not too deep.
fn build(shapes: &[Triangle]) -> CwBvh {
    // Of boxes that are nearly all alike, the builder merges one pair at a time.
    let corners = |shape: &Triangle| [shape.aabb().min, shape.aabb().max].map(|p| p.to_array().map(f32::to_bits));
    let distinct: HashSet<_> = shapes.iter().map(corners).collect();
    let around = shapes.iter().fold(Aabb::empty(), |a, shape| a.union(&shape.aabb()));
    let mean_area = shapes.iter().map(|shape| shape.aabb().half_area()).sum::<f32>() / shapes.len() as f32;
    let alike = 2 * distinct.len() < shapes.len() || mean_area > ALIKE * around.half_area();
    if shapes.len() > FEW && alike {
        return bvh2_to_cwbvh(&halved(shapes), LEAF, true, false);
    }
    let BvhBuildParams {
        ploc_search_distance, search_depth_threshold, reinsertion_batch_ratio, sort_precision, ..
    } = BvhBuildParams::medium_build();
    let indices: Vec<u32> = (0..shapes.len() as u32).collect();
    let mut bvh2 = PlocBuilder::with_capacity(shapes.len()).build(
        ploc_search_distance,
        shapes,
        indices,
        sort_precision,
        search_depth_threshold,
    );
    let is_leaf = |node: &Bvh2Node| node.prim_count > 0;
    let binary_depth = |bvh2: &Bvh2| {
        depth(|index| if is_leaf(&bvh2.nodes[index]) { 0..0 } else { range(bvh2.nodes[index].first_index, 2) })
    };
    if binary_depth(&bvh2) <= MOST_BINARY {
        ReinsertionOptimizer::default().run(&mut bvh2, reinsertion_batch_ratio, None);
        if binary_depth(&bvh2) <= MOST_BINARY {
            let wide = bvh2_to_cwbvh(&bvh2, LEAF, true, false);
            let children = |index: usize| range(wide.nodes[index].child_base_idx, wide.nodes[index].imask.count_ones());
            if depth(children) <= STACK {
                return wide;
            }
        }
    }
    bvh2_to_cwbvh(&halved(shapes), LEAF, true, false)
}

fn range(first: u32, count: u32) -> Range<usize> {
    first as usize..(first + count) as usize
}

/// Halves the triangles by their centres until one is left: a poorer tree, of the least depth.
fn halved(shapes: &[Triangle]) -> Bvh2 {
    let mut indices: Vec<u32> = (0..shapes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::default()];
    let mut left = vec![(0, 0..shapes.len())];
    while let Some((node, part)) = left.pop() {
        let boxes = || indices[part.clone()].iter().map(|index| shapes[*index as usize].aabb());
        let around = boxes().fold(Aabb::empty(), |a, b| a.union(&b));
        if part.len() == 1 {
            nodes[node] = Bvh2Node::new(around, 1, part.start as u32);
            continue;
        }
        let centres = boxes().fold(Aabb::empty(), |a, b| a.union(&Aabb::from_point(b.center())));
        let (axis, middle) = (centres.largest_axis(), part.len() / 2);
        let along = |index: &u32| shapes[*index as usize].aabb().center()[axis];
        indices[part.clone()].select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
        let first = nodes.len();
        nodes[node] = Bvh2Node::new(around, 0, first as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        left.extend([(first, part.start..part.start + middle), (first + 1, part.start + middle..part.end)]);
    }
    Bvh2 { nodes, primitive_indices: indices, ..Bvh2::default() }
}

/// A node that no ray finds a child in.
fn empty_node() -> CwBvhNode {
    CwBvhNode::zeroed()
}

/// Levels of a tree whose nodes have these children.
fn depth(children: impl Fn(usize) -> Range<usize>) -> usize {
    let mut deepest = 0;
    let mut left = vec![(0, 1)];
    while let Some((index, level)) = left.pop() {
        deepest = deepest.max(level);
        left.extend(children(index).map(|child| (child, level + 1)));
    }
    deepest
}

/// Reciprocals that stay finite: a ray along an axis still has a sign on the other two.
fn inverse(d: Vec3) -> Vec3 {
    const LEAST: f32 = 1e-18;
    let component = |x: f32| if x.abs() < LEAST { LEAST.copysign(if x < 0.0 { -1.0 } else { 1.0 }) } else { x };
    Vec3::new(component(d.x), component(d.y), component(d.z)).recip()
}

/// Bits of the children that the ray meets before `t`: leaves' triangles in bits 0 to 23, nodes in 24 to 31, nearest
/// highest.
fn children(node: &CwBvhNode, o: Vec3, inverse: Vec3, t: f32, octant: u32) -> u32 {
    let exponents = Vec3::from(node.e.map(|e| f32::from_bits(u32::from(e) << 23)));
    let (scale, start) = (exponents * inverse, (node.p - o) * inverse);
    let low = [node.child_min_x, node.child_min_y, node.child_min_z];
    let high = [node.child_max_x, node.child_max_y, node.child_max_z];
    let mut hits = 0;
    for child in 0..8 {
        let plane = |axis: usize, far: bool| {
            let bytes = if far == (inverse[axis] >= 0.0) { high[axis] } else { low[axis] };
            let slack = if far { SLACK } else { -SLACK };
            f32::from(bytes[child]) * scale[axis] + (start[axis] + slack * start[axis].abs())
        };
        let enter = (0..3).map(|axis| plane(axis, false)).fold(0.0, f32::max);
        let leave = (0..3).map(|axis| plane(axis, true)).fold(t, f32::min);
        let meta = u32::from(node.child_meta[child]);
        let place = if meta & 31 >= 24 { (meta & 31) ^ octant } else { meta & 31 };
        if enter <= leave * (1.0 + SLACK) {
            hits |= (meta >> 5) << place;
        }
    }
    hits
}

#[cfg(test)]
#[path = "bvh_tests.rs"]
pub mod tests;
