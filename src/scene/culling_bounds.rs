//! Bounds for back-face culling: the connected components of a mesh, and which of them are closed surfaces with their
//! front faces outwards, or would be but for borders that lie inside such ones. From outside of its bounds, no back face of
//! such a component is visible.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};

use super::caps::{are_buried, caps};
use super::groups::Groups;
use super::mesh::{Bounds, Vertex};

/// Corners nearer than this part of the mesh's size are welded: files may round the two sides of a texture seam
/// differently.
const WELD_PART: f32 = 1.0 / (1 << 20) as f32;
/// Test rays per direction, see [`is_outward`].
const RAYS: usize = 32;
/// Components have at least so many triangles for each one of their caps: others are rather leaves or cloth than things
/// whose ends are hidden.
const TRIANGLES_PER_CAP: usize = 32;
/// Borders end at most this part of the mesh's diagonal before the solid that hides them: a pixel of a picture of the mesh.
/// Modellers let a handle's end touch its cup, not more.
const GAP_PART: f32 = 1.0 / 1024.0;
/// Most triangles, and caps in all, of a mesh whose borders are examined: at most ten microseconds a triangle.
const MOST_TRIANGLES: usize = 1 << 17;
const MOST_CAPS: usize = 128;

/// Triangles connected by common corners.
pub struct Component {
    /// Corners as indices into the mesh's vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Local space.
    pub bounds: Bounds,
    /// Bounds from outside of which only its front faces are visible, local space; `None`: backs are seen from anywhere.
    pub culling_bounds: Option<Bounds>,
}

impl Component {
    /// Whether only its front faces are visible from outside.
    pub fn closed(&self) -> bool {
        self.culling_bounds.is_some()
    }
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
    let welded =
        |triangles: &Vec<[u32; 3]>| Surface::new(triangles.iter().map(|t| t.map(|c| points[c as usize])).collect());
    let surfaces: Vec<Surface> = found.iter().map(welded).collect();
    let all = Bounds::of(vertices.iter().map(|v| v.position.into()));
    let gap = f64::from(2.0 * all.radius() * GAP_PART);
    let closed = closed_surfaces(&surfaces, vertices, gap);
    let component = |((triangles, surface), closed): ((Vec<[u32; 3]>, Surface), bool)| {
        let bounds = Bounds::of(triangles.iter().flatten().map(|corner| position(*corner).into()));
        // What hides a border may be anywhere in the mesh.
        let culling_bounds = closed.then_some(if surface.caps == 0 { bounds } else { all });
        Component { triangles, bounds, culling_bounds }
    };
    found.into_iter().zip(surfaces).zip(closed).map(component).collect()
}

/// A component with caps on its borders.
struct Surface {
    /// Welded; caps are last.
    triangles: Vec<[u32; 3]>,
    caps: usize,
}

impl Surface {
    fn new(mut triangles: Vec<[u32; 3]>) -> Self {
        let caps = caps(&triangles);
        triangles.extend(&caps);
        Self { triangles, caps: caps.len() }
    }

    fn caps(&self) -> &[[u32; 3]] {
        &self.triangles[self.triangles.len() - self.caps..]
    }
}

/// Which surfaces show only their fronts from outside: those without borders, and those whose borders lie inside such ones, or
/// at most `gap` before them.
fn closed_surfaces(surfaces: &[Surface], vertices: &[Vertex], gap: f64) -> Vec<bool> {
    let may_be = |surface: &Surface| {
        surface.caps * TRIANGLES_PER_CAP <= surface.triangles.len() && is_outward(&surface.triangles, vertices)
    };
    let mut closed: Vec<bool> = surfaces.iter().map(may_be).collect();
    let sizes = surfaces.iter().zip(&closed).filter(|(_, closed)| **closed).map(|(s, _)| [s.triangles.len(), s.caps]);
    let [triangles, caps] = sizes.fold([0, 0], |[t, c], [triangles, caps]| [t + triangles, c + caps]);
    if triangles > MOST_TRIANGLES || caps > MOST_CAPS {
        closed.iter_mut().zip(surfaces).for_each(|(closed, surface)| *closed &= surface.caps == 0);
    }
    let position = |corner: u32| Vec3::from(vertices[corner as usize].position).as_dvec3();
    let ends_inside = |(surface, closed): (&Surface, &bool)| *closed && surface.caps > 0;
    // A bowl is no solid, whatever ends in it: what is open itself hides nothing of the others.
    while surfaces.iter().zip(&closed).any(ends_inside) {
        let solids = surfaces.iter().zip(&closed).filter(|(_, closed)| **closed);
        let solid: Vec<[u32; 3]> = solids.flat_map(|(surface, _)| surface.triangles.iter().copied()).collect();
        let open = |both| ends_inside(both) && !are_buried(both.0.caps(), &solid, gap, position);
        let open: Vec<bool> = surfaces.iter().zip(&closed).map(open).collect();
        if !open.contains(&true) {
            break;
        }
        closed.iter_mut().zip(open).for_each(|(closed, open)| *closed &= !open);
    }
    closed
}

/// The connected component that a triangle is part of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ComponentOf {
    /// Number in the mesh.
    pub component: u32,
    /// Whether only its front faces are visible from outside.
    pub closed: bool,
}

/// The component of each triangle of a mesh; triangles that cover nothing are of the first one.
pub fn components_of_triangles(vertices: &[Vertex], indices: &[u32]) -> Vec<ComponentOf> {
    let mut known: HashMap<[u32; 3], ComponentOf> = HashMap::with_capacity(indices.len() / 3);
    for (component, found) in (0..).zip(connected_components(vertices, indices)) {
        let of = ComponentOf { component, closed: found.closed() };
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
        assert!(components[0].closed());
        assert!((components[0].bounds.max - Vec3::splat(2.0)).length() < 1e-6);
    }

    #[test]
    fn a_ball_with_a_hole_or_a_turned_triangle_is_open() {
        let (vertices, indices) = ball(16, 1.0);
        let middle = indices.len() / 2;
        assert!(!connected_components(&vertices, &indices[..indices.len() - 300]).iter().any(|s| s.closed()));
        let mut turned = indices;
        turned.swap(middle, middle + 1);
        assert!(!connected_components(&vertices, &turned).iter().any(|s| s.closed()));
    }

    #[test]
    fn a_ball_turned_inside_out_is_not_closed_to_those_outside() {
        let (vertices, indices) = ball(16, 1.0);
        assert!(!connected_components(&vertices, &flipped(&indices)).iter().any(|s| s.closed()));
    }

    /// Two lobes that meet in a twist, one of them inside out: a closed surface that shows back faces.
    #[test]
    fn a_twisted_surface_is_not_closed_to_those_outside() {
        let (mut vertices, indices) = ball(32, 1.0);
        for v in &mut vertices {
            let [x, y, z] = v.position;
            v.position = [x * y, y, z];
        }
        assert!(!connected_components(&vertices, &indices).iter().any(|s| s.closed()));
    }

    #[test]
    fn components_are_separated() {
        let (mut vertices, mut indices) = ball(8, 1.0);
        let (second, more) = ball(8, 0.5);
        let start = vertices.len() as u32;
        vertices.extend(second.iter().map(|v| Vertex { position: [v.position[0] + 4.0, 0.5, v.position[2]], ..*v }));
        indices.extend(more.iter().map(|i| i + start));
        let components = connected_components(&vertices, &indices);
        assert_eq!(components.iter().map(|s| s.closed()).collect::<Vec<_>>(), [true, false], "the second one is flat");
        let triangles: usize = components.iter().map(|s| s.triangles.len()).sum();
        assert!(triangles < indices.len() / 3, "triangles at the poles are left out");
    }

    /// A tube around x from `from` to `to`, without ends.
    fn tube(from: f32, to: f32, radius: f32) -> (Vec<Vertex>, Vec<u32>) {
        let (rows, sides) = (40u32, 12u32);
        let vertex = |i: u32| {
            let (row, angle) =
                ((i / sides) as f32 / rows as f32, (i % sides) as f32 / sides as f32 * std::f32::consts::TAU);
            let position = [from + (to - from) * row, radius * angle.cos(), radius * angle.sin()];
            Vertex { position, ..bytemuck::Zeroable::zeroed() }
        };
        let quad = |i: u32| {
            let (row, side) = (i / sides, i % sides);
            let [a, b] = [side, (side + 1) % sides].map(|s| row * sides + s);
            [a, b, b + sides, a, b + sides, a + sides]
        };
        ((0..(rows + 1) * sides).map(vertex).collect(), (0..rows * sides).flat_map(quad).collect())
    }

    /// Which components of a ball of radius 1, and a tube, are closed.
    fn ball_and_tube(ball: (Vec<Vertex>, Vec<u32>), tube: (Vec<Vertex>, Vec<u32>)) -> Vec<bool> {
        let (mut vertices, mut indices) = ball;
        let start = vertices.len() as u32;
        vertices.extend(tube.0);
        indices.extend(tube.1.iter().map(|i| i + start));
        connected_components(&vertices, &indices).iter().map(Component::closed).collect()
    }

    #[test]
    fn a_tube_is_closed_if_both_its_ends_are_inside_the_ball() {
        let of = |from, to| ball_and_tube(ball(16, 1.0), tube(from, to, 0.1));
        assert_eq!(of(-0.5, 0.5), [true, true]);
        assert_eq!(of(0.5, 2.0), [true, false], "one end shows its inside");
        assert_eq!(of(2.0, 4.0), [true, false]);
        assert_eq!(of(-0.5, 0.96), [true, true]);
        assert_eq!(of(-0.5, 1.0), [true, false], "its border is visible");
        assert_eq!(of(1.0, 1.5), [true, false], "one end is hidden by the wall, the other is not");
        let (vertices, indices) = tube(-0.5, 0.5, 0.1);
        assert_eq!(ball_and_tube(ball(16, 1.0), (vertices, flipped(&indices))), [true, false], "inside out");
    }

    #[test]
    fn what_ends_in_a_bowl_is_open() {
        let (vertices, mut indices) = ball(64, 1.0);
        let is_below = |t: &[u32]| t.iter().any(|i| vertices[*i as usize].position[1] < 0.9);
        indices = indices.chunks_exact(3).filter(|t| is_below(t)).flatten().copied().collect();
        assert_eq!(ball_and_tube((vertices, indices), tube(-0.5, 0.5, 0.1)), [false, false]);
    }

    #[test]
    fn what_is_sealed_is_culled_from_outside_of_the_whole_mesh() {
        let (mut vertices, mut indices) = ball(16, 1.0);
        let (more, tube) = tube(-0.5, 0.5, 0.1);
        indices.extend(tube.iter().map(|i| i + vertices.len() as u32));
        vertices.extend(more);
        let bounds: Vec<_> = connected_components(&vertices, &indices).iter().map(|c| c.culling_bounds).collect();
        let [Some(of_ball), Some(of_tube)] = bounds[..] else { panic!("{bounds:?}") };
        assert!(of_ball.min == of_tube.min && of_ball.max == of_tube.max);
    }

    #[test]
    fn empty_and_degenerate_meshes_have_no_components() {
        assert!(connected_components(&[], &[]).is_empty());
        let v = Vertex { normal: [0.0, 1.0, 0.0], tangent: [1.0, 0.0, 0.0, 1.0], ..bytemuck::Zeroable::zeroed() };
        assert!(connected_components(&[v; 3], &[0, 1, 2]).is_empty());
    }
}
