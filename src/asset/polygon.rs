//! Triangles of polygons, concave ones included.

use glam::{DVec2, DVec3, Vec3};

/// Polygons with more corners become fans: cutting ears is quadratic at least.
const MOST_EARS: usize = 2048;

/// Triangles of a polygon, as numbers of its corners in its own order. One that is flat and does not cross itself is
/// covered exactly; of any other at least each corner is used. Convex ones become fans around their first corner.
///
/// Cutting ears: Meisters, "Polygons have ears" (1975), in the plane that the polygon covers most of.
pub fn triangulate(corners: &[Vec3]) -> Vec<[usize; 3]> {
    let flat = flattened(corners);
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len().saturating_sub(2));
    if corners.len() <= MOST_EARS {
        while left.len() > 3 && !is_convex(&left, &flat) {
            let Some(ear) = (0..left.len()).find(|i| is_ear(&left, *i, &flat)) else { break };
            triangles.push(around(&left, ear));
            left.remove(ear);
        }
    }
    let fan = left.windows(2).skip(1).map(|pair| [left[0], pair[0], pair[1]]);
    triangles.extend(fan);
    triangles
}

/// Corners in a plane in which the polygon turns to the left; without area all are 0.
fn flattened(corners: &[Vec3]) -> Vec<DVec2> {
    let from_first = |corner: &Vec3| corner.as_dvec3() - corners[0].as_dvec3();
    // Newell's normal: twice the area, projected along each axis.
    let normal: DVec3 = corners.windows(2).map(|pair| from_first(&pair[0]).cross(from_first(&pair[1]))).sum();
    let axis = [normal.x, normal.y, normal.z].map(f64::abs);
    let drop = if axis[0] >= axis[1] && axis[0] >= axis[2] {
        0
    } else if axis[1] >= axis[2] {
        1
    } else {
        2
    };
    let side = normal[drop].signum();
    corners
        .iter()
        .map(|corner| {
            let d = from_first(corner);
            let (x, y) = (d[(drop + 1) % 3], d[(drop + 2) % 3]);
            if normal == DVec3::ZERO { DVec2::ZERO } else { DVec2::new(side * x, y) }
        })
        .collect()
}

/// A corner between its neighbours.
fn around(left: &[usize], i: usize) -> [usize; 3] {
    let count = left.len();
    [left[(i + count - 1) % count], left[i], left[(i + 1) % count]]
}

/// Twice the area of a triangle that turns to the left.
fn area(flat: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (flat[b] - flat[a]).perp_dot(flat[c] - flat[a])
}

fn is_convex(left: &[usize], flat: &[DVec2]) -> bool {
    (0..left.len()).all(|i| area(flat, around(left, i)) >= 0.0)
}

/// Whether a corner can be cut off: it turns to the left, and no other corner lies in the triangle.
fn is_ear(left: &[usize], i: usize, flat: &[DVec2]) -> bool {
    let ear @ [a, b, c] = around(left, i);
    let inside =
        |p: usize| area(flat, [a, b, p]) >= 0.0 && area(flat, [b, c, p]) >= 0.0 && area(flat, [c, a, p]) >= 0.0;
    let is_corner = |p: usize| ear.iter().any(|own| flat[*own] == flat[p]);
    area(flat, ear) > 0.0 && !left.iter().any(|p| !is_corner(*p) && inside(*p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area_of(corners: &[Vec3], triangles: &[[usize; 3]]) -> (f32, f32) {
        let signed = |t: &[usize; 3]| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).z * 0.5;
        (triangles.iter().map(signed).sum(), triangles.iter().map(|t| signed(t).abs()).sum())
    }

    fn outline(points: &[[f32; 2]]) -> Vec<Vec3> {
        points.iter().map(|[x, y]| Vec3::new(*x, *y, 0.0)).collect()
    }

    #[test]
    fn convex_polygons_are_fans() {
        let square = outline(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangulate(&square), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangulate(&square[..3]), [[0, 1, 2]]);
    }

    /// Whatever corner comes first, in whichever plane and from either side.
    #[test]
    fn concave_polygons_are_covered_exactly() {
        let arrow = outline(&[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.6, 1.0]]);
        let comb = [[0., 0.], [5., 0.], [5., 3.], [4., 3.], [4., 1.], [3., 1.], [3., 3.], [2., 3.], [2., 1.], [1., 1.]];
        let comb = outline(&[&comb[..], &[[1., 3.], [0., 3.]]].concat());
        for (polygon, whole) in [(arrow, 1.4), (comb, 11.0)] {
            for first in 0..polygon.len() {
                let mut turned = polygon.clone();
                turned.rotate_left(first);
                let triangles = triangulate(&turned);
                assert_eq!(triangles.len(), polygon.len() - 2);
                let (signed, covered) = area_of(&turned, &triangles);
                assert!((signed - whole).abs() < 1e-5 && (covered - whole).abs() < 1e-5, "{first}: {signed} {covered}");
                let back: Vec<Vec3> = turned.iter().rev().copied().collect();
                let (signed, covered) = area_of(&back, &triangulate(&back));
                assert!((signed + whole).abs() < 1e-5 && (covered - whole).abs() < 1e-5, "{first}: {signed} {covered}");
                let upright: Vec<Vec3> = turned.iter().map(|p| Vec3::new(7.0, p.x, p.y)).collect();
                assert_eq!(triangulate(&upright), triangles);
            }
        }
    }

    #[test]
    fn polygons_without_area_or_that_cross_themselves_end() {
        assert_eq!(triangulate(&[Vec3::ONE; 6]).len(), 4);
        let bow = outline(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, 2.0]]);
        assert_eq!(triangulate(&bow).len(), 3);
        let many: Vec<Vec3> = (0..100_000).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect();
        assert_eq!(triangulate(&many).len(), 99_998);
    }
}
