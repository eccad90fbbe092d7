//! Bounds for back-face culling: the connected components of a mesh, and which of them are closed surfaces with their
//! front faces outwards. From outside of its bounds, no back face of such a component is visible.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};

use super::mesh::{Bounds, Vertex};

/// Corners nearer than this part of the mesh's size are welded: files may round the two sides of a texture seam
/// differently.
const WELD_PART: f32 = 1.0 / (1 << 20) as f32;
/// Test rays per direction, see [`is_outward`].
const RAYS: usize = 32;

/// Triangles connected by common corners.
pub struct Component {
    /// Corners as indices into the mesh's vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Local space.
    pub bounds: Bounds,
    /// Whether only front faces are visible from outside of `bounds`.
    pub closed: bool,
}

/// Splits a mesh into its connected components; triangles keep their order. Triangles with coinciding corners are
/// dropped: they cover nothing.
pub fn connected_components(vertices: &[Vertex], indices: &[u32]) -> Vec<Component> {
    let points = weld(vertices);
    let position = |corner: u32| vertices[corner as usize].position;
    let triangles = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).filter(|t| {
        let [a, b, c] = t.map(position);
        a != b && b != c && c != a
    });
    let triangles: Vec<[u32; 3]> = triangles.collect();
    let mut groups = Groups::new(vertices.len());
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        groups.join(a, b);
        groups.join(b, c);
    }
    let mut found: Vec<Vec<[u32; 3]>> = Vec::new();
    let mut known: HashMap<u32, usize> = HashMap::new();
    for triangle in triangles {
        let group = groups.of(points[triangle[0] as usize]);
        let component = *known.entry(group).or_insert(found.len());
        if component == found.len() {
            found.push(Vec::new());
        }
        found[component].push(triangle);
    }
    let component = |triangles: Vec<[u32; 3]>| {
        let bounds = Bounds::of(triangles.iter().flatten().map(|corner| position(*corner).into()));
        let welded: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|corner| points[corner as usize])).collect();
        let closed = has_no_border(&welded) && is_outward(&welded, vertices);
        Component { triangles, bounds, closed }
    };
    found.into_iter().map(component).collect()
}

/// The connected component that a triangle is part of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ComponentOf {
    /// Number in the mesh.
    pub component: u32,
    /// Whether it is a closed surface with its front faces outwards.
    pub closed: bool,
}

/// The component of each triangle of a mesh; triangles that cover nothing are of the first one.
pub fn components_of_triangles(vertices: &[Vertex], indices: &[u32]) -> Vec<ComponentOf> {
    let mut known: HashMap<[u32; 3], ComponentOf> = HashMap::with_capacity(indices.len() / 3);
    for (component, found) in (0..).zip(connected_components(vertices, indices)) {
        let of = ComponentOf { component, closed: found.closed };
        known.extend(found.triangles.into_iter().map(|triangle| (triangle, of)));
    }
    indices.as_chunks().0.iter().map(|triangle| known.get(triangle).copied().unwrap_or_default()).collect()
}

/// For each vertex the index of the first one at its position.
fn weld(vertices: &[Vertex]) -> Vec<u32> {
    let bounds = Bounds::of(vertices.iter().map(|v| v.position.into()));
    let cells = (bounds.max - bounds.min).max_element().max(f32::MIN_POSITIVE) * WELD_PART;
    let mut first: HashMap<[i32; 3], u32> = HashMap::with_capacity(vertices.len());
    let cell = |v: &Vertex| ((Vec3::from(v.position) - bounds.min) / cells).round().as_ivec3().to_array();
    (0u32..).zip(vertices).map(|(i, vertex)| *first.entry(cell(vertex)).or_insert(i)).collect()
}

/// Disjoint sets of points (Tarjan 1975, with path halving).
pub struct Groups(Vec<u32>);

impl Groups {
    /// Each point alone.
    pub fn new(count: usize) -> Self {
        Self((0u32..).take(count).collect())
    }

    /// The least point of a point's set.
    pub fn of(&mut self, mut point: u32) -> u32 {
        while self.0[point as usize] != point {
            let up = self.0[self.0[point as usize] as usize];
            self.0[point as usize] = up;
            point = up;
        }
        point
    }

    /// Unites the sets of two points.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Whether every edge is traversed equally often in both directions: only then is the winding number of a point
/// defined.
fn has_no_border(triangles: &[[u32; 3]]) -> bool {
    let mut balance: HashMap<[u32; 2], i32> = HashMap::with_capacity(triangles.len() * 2);
    for [a, b, c] in triangles.iter().copied() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *balance.entry([from.min(to), from.max(to)]).or_default() += i32::from(from < to) - i32::from(from > to);
        }
    }
    balance.values().all(|sum| *sum == 0)
}

/// Whether the front faces point outwards: of rays from outside through the centres of some triangles, none may hit a
/// back face before the front face that belongs to it.
fn is_outward(triangles: &[[u32; 3]], vertices: &[Vertex]) -> bool {
    // Oblique, so that rays miss the edges of boxes and of surfaces of revolution.
    let directions = [DVec3::new(0.3, 0.85, 0.43), DVec3::new(-0.77, 0.29, 0.57)];
    let (mut sound, mut rays) = (0, 0);
    for direction in directions {
        let depth = direction.normalize();
        let across = depth.any_orthonormal_vector();
        let up = depth.cross(across);
        let project = |corner: u32| {
            let p = Vec3::from(vertices[corner as usize].position).as_dvec3();
            (DVec2::new(p.dot(across), p.dot(up)), p.dot(depth))
        };
        let has_area = |[a, b, c]: &&[u32; 3]| a != b && b != c && c != a;
        let flat: Vec<[(DVec2, f64); 3]> = triangles.iter().filter(has_area).map(|t| t.map(project)).collect();
        for triangle in flat.iter().step_by(flat.len().div_ceil(RAYS).max(1)) {
            rays += 1;
            match enclosure(hits(&flat, triangle.iter().map(|(p, _)| *p).sum::<DVec2>() / 3.0)) {
                (0, 0) => sound += 1,
                (0, _) => return false,
                // It hit an edge, which counts twice or not at all.
                _ => {}
            }
        }
    }
    2 * sound > rays
}

/// The winding number at the end of a ray, and its minimum on the way.
fn enclosure(mut hits: Vec<(f64, i32)>) -> (i32, i32) {
    // At the same depth front faces first.
    hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    hits.iter().fold((0, 0), |(inside, least), (_, step)| (inside + step, least.min(inside + step)))
}

/// Hits of a ray: depth, and 1 for a front face, -1 for a back face.
fn hits(flat: &[[(DVec2, f64); 3]], at: DVec2) -> Vec<(f64, i32)> {
    let hit = |triangle: &[(DVec2, f64); 3]| {
        let [a, b, c] = triangle.map(|(p, _)| p - at);
        let weights = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
        let inside = weights.iter().all(|w| *w >= 0.0) || weights.iter().all(|w| *w <= 0.0);
        let area: f64 = weights.iter().sum();
        let depth: f64 = triangle.iter().zip(weights).map(|((_, depth), w)| depth * w).sum();
        (inside && area != 0.0).then(|| (depth / area, if area < 0.0 { 1 } else { -1 }))
    };
    flat.iter().filter_map(hit).collect()
}

#[cfg(test)]
mod tests {
    use super::super::mesh::Mesh;
    use super::*;

    fn ball(rows: u32, radius: f32) -> (Vec<Vertex>, Vec<u32>) {
        let Mesh { vertices, indices, .. } = Mesh::ball(rows, radius);
        (vertices, indices)
    }

    fn flipped(indices: &[u32]) -> Vec<u32> {
        indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect()
    }

    #[test]
    fn a_ball_is_closed_although_its_seam_is_duplicated() {
        let (vertices, indices) = ball(16, 2.0);
        let components = connected_components(&vertices, &indices);
        assert_eq!(components.len(), 1);
        assert!(components[0].closed);
        assert!((components[0].bounds.max - Vec3::splat(2.0)).length() < 1e-6);
    }

    #[test]
    fn a_ball_with_a_hole_or_a_turned_triangle_is_open() {
        let (vertices, indices) = ball(16, 1.0);
        let middle = indices.len() / 2;
        assert!(!connected_components(&vertices, &indices[..indices.len() - 300]).iter().any(|s| s.closed));
        let mut turned = indices;
        turned.swap(middle, middle + 1);
        assert!(!connected_components(&vertices, &turned).iter().any(|s| s.closed));
    }

    #[test]
    fn a_ball_turned_inside_out_is_not_closed_to_those_outside() {
        let (vertices, indices) = ball(16, 1.0);
        assert!(!connected_components(&vertices, &flipped(&indices)).iter().any(|s| s.closed));
    }

    /// Two lobes that meet in a twist, one of them inside out: a closed surface that shows back faces.
    #[test]
    fn a_twisted_surface_is_not_closed_to_those_outside() {
        let (mut vertices, indices) = ball(32, 1.0);
        for v in &mut vertices {
            let [x, y, z] = v.position;
            v.position = [x * y, y, z];
        }
        assert!(!connected_components(&vertices, &indices).iter().any(|s| s.closed));
    }

    #[test]
    fn components_are_separated() {
        let (mut vertices, mut indices) = ball(8, 1.0);
        let (second, more) = ball(8, 0.5);
        let start = vertices.len() as u32;
        vertices.extend(second.iter().map(|v| Vertex { position: [v.position[0] + 4.0, 0.5, v.position[2]], ..*v }));
        indices.extend(more.iter().map(|i| i + start));
        let components = connected_components(&vertices, &indices);
        assert_eq!(components.iter().map(|s| s.closed).collect::<Vec<_>>(), [true, false], "the second one is flat");
        let triangles: usize = components.iter().map(|s| s.triangles.len()).sum();
        assert!(triangles < indices.len() / 3, "triangles at the poles are left out");
    }

    #[test]
    fn empty_and_degenerate_meshes_have_no_components() {
        assert!(connected_components(&[], &[]).is_empty());
        let v = Vertex { normal: [0.0, 1.0, 0.0], tangent: [1.0, 0.0, 0.0, 1.0], ..bytemuck::Zeroable::zeroed() };
        assert!(connected_components(&[v; 3], &[0, 1, 2]).is_empty());
    }
}
