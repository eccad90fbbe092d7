//! Caps on the borders of a surface, and whether they lie inside solids: a handle that ends within the wall of its cup shows
//! nothing of its inside.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::groups::Groups;

/// Triangles that close a surface of indexed triangles: a fan for each border. There is none exactly where every edge is
/// traversed equally often in both directions: only then is the winding number of a point defined.
pub fn caps(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut balance: HashMap<[u32; 2], i32> = HashMap::with_capacity(triangles.len() * 2);
    for [a, b, c] in triangles.iter().copied() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *balance.entry([from.min(to), from.max(to)]).or_default() += i32::from(from < to) - i32::from(from > to);
        }
    }
    let mut edges: Vec<([u32; 2], i32)> = balance.into_iter().filter(|(_, sum)| *sum != 0).collect();
    edges.sort_unstable();
    let mut corners: Vec<u32> = edges.iter().flat_map(|(edge, _)| *edge).collect();
    corners.sort_unstable();
    corners.dedup();
    let number = |corner: u32| corners.partition_point(|known| *known < corner) as u32;
    let mut groups = Groups::new(corners.len());
    for ([a, b], _) in &edges {
        groups.join(number(*a), number(*b));
    }
    let fan = edges.into_iter().flat_map(|([low, high], sum)| {
        let apex = corners[groups.of(number(low)) as usize];
        let [from, to] = if sum > 0 { [low, high] } else { [high, low] };
        let triangles = if apex == low || apex == high { 0 } else { sum.unsigned_abs() as usize };
        std::iter::repeat_n([to, from, apex], triangles)
    });
    fan.collect()
}

/// Whether all of the caps lie inside a solid, a closed surface whose fronts are outwards: what is `depth` outside of four points of
/// each triangle, three of them beside the border, has a winding number of at least 1. So borders may end nearly that far before
/// the solid. `position` gives a corner's place.
pub fn are_buried(caps: &[[u32; 3]], solid: &[[u32; 3]], depth: f64, position: impl Fn(u32) -> DVec3 + Sync) -> bool {
    let points: Vec<DVec3> = caps.iter().flat_map(|cap| outer_points(cap.map(&position), depth)).collect();
    let solid: Vec<[DVec3; 3]> = solid.iter().map(|triangle| triangle.map(&position)).collect();
    !points.is_empty() && points.par_iter().all(|point| winding_number(*point, &solid) > 0.5)
}

/// Points `depth` outside of a cap's triangle whose first edge is of the border; none where it has no area.
fn outer_points([a, b, apex]: [DVec3; 3], depth: f64) -> Vec<DVec3> {
    let Some(normal) = (b - a).cross(apex - a).try_normalize() else { return Vec::new() };
    let weights = [[0.95, 0.0, 0.05], [0.45, 0.45, 0.1], [0.0, 0.95, 0.05], [1.0 / 3.0; 3]];
    weights.map(|[i, j, k]| i * a + j * b + k * apex + depth * normal).into()
}

/// How often triangles surround a point: the sum of their solid angles, positive where their backs are seen, in parts of 4π. A whole
/// number where they close a surface.
///
/// Half of a triangle's solid angle is the argument of a complex number (Van Oosterom and Strackee, 1983). The sum is that of
/// their product, and the turns in which it passed the negative real axis: one arctangent for all.
fn winding_number(point: DVec3, triangles: &[[DVec3; 3]]) -> f64 {
    let (mut product, mut turns) = (DVec2::X, 0);
    for [a, b, c] in triangles {
        let (a, b, c) = (*a - point, *b - point, *c - point);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let across = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let factor = DVec2::new(across, a.dot(b.cross(c)));
        let size = factor.x.abs() + factor.y.abs();
        // None where the point is a corner.
        if size > 0.0 {
            let before = [product.y < 0.0, factor.y < 0.0];
            product = product.rotate(factor / size);
            product /= product.x.abs() + product.y.abs();
            match (before, product.y < 0.0) {
                ([false, false], true) => turns += 1,
                ([true, true], false) => turns -= 1,
                _ => {}
            }
        }
    }
    (product.to_angle() + f64::from(turns) * TAU) / TAU
}

#[cfg(test)]
mod tests {
    use super::super::mesh::Mesh;
    use super::*;

    fn ball() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mesh = Mesh::ball(16, 1.0);
        let points: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from(v.position.map(f64::from))).collect();
        let first = |corner: u32| points.iter().position(|p| p.distance(points[corner as usize]) < 1e-6);
        let weld = |corner| first(corner).expect("itself at least") as u32;
        let triangles = mesh.indices.as_chunks().0.iter().map(|t: &[u32; 3]| t.map(weld));
        let has_area = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        let triangles = triangles.filter(has_area).collect();
        (points, triangles)
    }

    /// The same from the sum of angles.
    fn summed(point: DVec3, (points, triangles): &(Vec<DVec3>, Vec<[u32; 3]>)) -> f64 {
        let half_angle = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|corner| points[corner as usize] - point);
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        };
        triangles.iter().map(half_angle).sum::<f64>() / TAU
    }

    fn winding(point: DVec3, (points, triangles): &(Vec<DVec3>, Vec<[u32; 3]>)) -> f64 {
        let triangles: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(|corner| points[corner as usize])).collect();
        winding_number(point, &triangles)
    }

    #[test]
    fn the_winding_number_is_one_inside_and_none_outside() {
        let ball = ball();
        assert!((winding(DVec3::new(0.3, -0.5, 0.2), &ball) - 1.0).abs() < 1e-12);
        assert!(winding(DVec3::new(0.8, 0.7, 0.2), &ball).abs() < 1e-12);
    }

    #[test]
    fn turns_are_counted_in_both_directions() {
        let (points, triangles) = ball();
        let inwards: Vec<[u32; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let open = triangles[..triangles.len() * 3 / 4].to_vec();
        let thrice = [triangles.clone(), triangles.clone(), triangles.clone(), open.clone()].concat();
        for triangles in [triangles, inwards.clone(), [inwards.clone(), inwards].concat(), open, thrice] {
            let surface = (points.clone(), triangles);
            for point in [[0.3, -0.5, 0.2], [0.0, 0.0, 0.0], [0.8, 0.7, 0.2], [-0.1, 0.9, 0.1]].map(DVec3::from) {
                let (got, expected) = (winding(point, &surface), summed(point, &surface));
                assert!((got - expected).abs() < 1e-12, "{got} instead of {expected} at {point}");
            }
        }
    }

    #[test]
    fn caps_close_what_was_cut_off() {
        let (points, mut triangles) = ball();
        assert!(caps(&triangles).is_empty());
        let whole = triangles.len();
        // A border around the top, and another around a single triangle.
        triangles.retain(|t| t.iter().any(|corner| points[*corner as usize].y < 0.5));
        triangles.swap_remove(triangles.len() / 2);
        assert!(triangles.len() < whole - 10);
        let lids = caps(&triangles);
        let closed = [triangles.clone(), lids.clone()].concat();
        assert!(caps(&closed).is_empty() && lids.len() > 5);
        let inside = DVec3::new(0.1, 0.2, -0.3);
        assert!((winding(inside, &(points.clone(), closed)) - 1.0).abs() < 1e-12);
        assert!((winding(inside, &(points, triangles)) - 1.0).abs() > 0.05);
    }

    #[test]
    fn a_cap_is_buried_where_it_is_inside_a_solid_only() {
        let (mut points, triangles) = ball();
        for (centre, buried) in [(0.0, true), (0.5, true), (0.95, false), (2.0, false)] {
            let first = points.len() as u32;
            let corner = |x, y| DVec3::new(centre + x, y, 0.1);
            points.extend([corner(-0.1, -0.1), corner(0.1, -0.1), corner(0.0, 0.1)]);
            let cap = [[first, first + 1, first + 2]];
            assert_eq!(are_buried(&cap, &triangles, 1e-3, |corner| points[corner as usize]), buried, "at {centre}");
        }
        assert!(!are_buried(&[], &triangles, 1e-3, |corner| points[corner as usize]), "nothing is not inside");
    }
}
