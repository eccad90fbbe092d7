//! Shadow maps in f64: where a point lies in one, twins of `glsl/shadow_place.glsl`; and the truth that they approach: rays
//! against triangles, and the visible share of a disc behind an edge.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

/// Tangent of half the angle of a face: a little more than a cube's, so that filters at a face's edge stay inside it.
pub const FACE_TANGENT: f64 = 1.125;
/// Texels by which a receiver is moved along its normal, Holbert, "Saying Goodbye to Shadow Acne" (2011): as many as its
/// plane's height changes from a tap to the farthest of the four texels compared there, and a quarter more.
pub const NORMAL_OFFSET_TEXELS: f64 = 1.25;
/// And by as much in any case, for edges of hollow things.
pub const LEAST_OFFSET_TEXELS: f64 = 0.25;
/// Surfaces seen by the light at a smaller cosine are taken to slant no more.
pub const LEAST_SLANT: f64 = 0.01;

/// A place in a shadow map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowPlace {
    pub uv: DVec2,
    /// Of the lamp's six layers: +X, −X, +Y, −Y, +Z, −Z.
    pub layer: u32,
    /// Reversed: 1 at the near plane, 0 at infinity.
    pub depth: f64,
    /// Change of depth per uv on the plane through the point.
    pub slope: DVec2,
    /// From `uv` to where the point would be if it had not been moved; of the sun's map.
    pub back: DVec2,
    /// Radius of the light's disc in uv, seen through a hole, per depth between hole and point.
    pub spread: DVec2,
}

/// A vector in the axes of a face's view (across, up, along); `axis` is 0, 1 or 2.
fn turned(v: DVec3, axis: usize) -> DVec3 {
    DVec3::new(v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis])
}

/// The place of a point at `q` from a lamp, with normal `n` towards it; `near` and `radius` in metres, `texels` along
/// a face. On each face, u runs
/// along the axis after its own (against it where the face is positive), v against the one after that. Depth is near over
/// the distance along the face's axis, which is linear in uv on every plane.
pub fn lamp_place(q: DVec3, n: DVec3, near: f64, radius: f64, texels: f64) -> ShadowPlace {
    let a = q.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    let (p, m) = (turned(q, axis), turned(n, axis));
    let texel = 2.0 * FACE_TANGENT * p.z.abs() / texels;
    let p = p + texel * (LEAST_OFFSET_TEXELS + NORMAL_OFFSET_TEXELS * (m.x.abs() + m.y.abs())) * m;
    let along = p.z.abs().max(1e-20);
    let negative = p.z < 0.0;
    let sides = DVec2::new(if negative { 1.0 } else { -1.0 }, -1.0);
    let uv = 0.5 / FACE_TANGENT;
    let height = m.dot(p).min(-LEAST_SLANT * along);
    ShadowPlace {
        uv: DVec2::splat(0.5) + uv * sides * p.truncate() / along,
        layer: 2 * axis as u32 + u32::from(negative),
        depth: near / along,
        slope: near / (uv * height) * sides * m.truncate(),
        back: DVec2::ZERO,
        spread: DVec2::splat(uv * radius / near),
    }
}

/// The place of a point in the sun's map, `p` by u, v and depth; `gradient`: the unit normal of the point's plane, each number
/// in metres of the map's size along its axis, the last one towards the sun; `size2`: squares of the sizes, m²; `spread` as in
/// [`ShadowPlace`], `texels` along the map. The receiver is moved along its normal, as for lamps.
pub fn sun_place(p: DVec3, gradient: DVec3, size2: DVec3, spread: DVec2, texels: f64) -> ShadowPlace {
    let least = LEAST_OFFSET_TEXELS * size2.truncate().max_element().sqrt();
    let offset = (least + NORMAL_OFFSET_TEXELS * gradient.truncate().abs().element_sum()) / texels;
    let moved = offset * gradient / size2;
    let p = p + moved;
    let steepest = gradient.z.max(LEAST_SLANT * gradient.length());
    let slope = -gradient.truncate() / steepest;
    ShadowPlace { uv: p.truncate(), layer: 0, depth: p.z, slope, back: -moved.truncate(), spread }
}

/// The distance along the ray from `from` in direction `d` at which it meets a triangle, in lengths of `d`: Möller and
/// Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection" (1997).
pub fn hit(from: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = d.cross(ac);
    let determinant = ab.dot(across);
    let to = from - a;
    let u = to.dot(across) / determinant;
    let along = to.cross(ab);
    let v = d.dot(along) / determinant;
    // Every comparison with 0 / 0 is false.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(along) / determinant)
}

/// Whether a triangle lies between two points, beyond `margin` metres from both.
pub fn is_blocked(from: DVec3, to: DVec3, triangles: &[[DVec3; 3]], margin: f64) -> bool {
    let part = margin / from.distance(to);
    triangles.iter().filter_map(|t| hit(from, to - from, *t)).any(|at| at > part && at < 1.0 - part)
}

/// The share of a disc of radius 1 that lies beyond a straight edge at `x` from its centre, from 1 at −1 to 0 at 1.
pub fn disc_beyond(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    (x.acos() - x * (1.0 - x * x).sqrt()) / PI
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texels so small that nothing is moved.
    const EXACT: f64 = f64::INFINITY;
    const AXES: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];

    #[test]
    fn faces_look_along_their_axes_and_reach_beyond_the_cube() {
        for (layer, axis) in (0..).zip(AXES) {
            let place = lamp_place(2.0 * axis, -axis, 0.1, 0.0, EXACT);
            assert_eq!((place.layer, place.uv, place.depth), (layer, DVec2::splat(0.5), 0.05));
            let side = AXES[(layer as usize / 2 * 2 + 2) % 6];
            let corner = lamp_place(2.0 * axis + 1.999 * side, -axis, 0.1, 0.0, EXACT);
            assert_eq!(corner.layer, layer);
            assert!((corner.uv - 0.5).abs().max_element() < 0.5 / FACE_TANGENT);
        }
    }

    #[test]
    fn depth_on_a_plane_follows_its_slope() {
        for axis in AXES {
            let n = (-axis + 0.4 * AXES[0] - 0.3 * AXES[4] + 0.2 * AXES[2]).normalize();
            let q = 3.0 * axis + 0.3 * axis.any_orthonormal_vector();
            let here = lamp_place(q, n, 0.01, 0.0, EXACT);
            for step in [n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector())] {
                let there = lamp_place(q + 0.2 * step, n, 0.01, 0.0, EXACT);
                assert_eq!(here.layer, there.layer);
                let want = here.depth + here.slope.dot(there.uv - here.uv);
                assert!((there.depth - want).abs() < 1e-12, "{axis}: {} is not {want}", there.depth);
            }
        }
    }

    #[test]
    fn a_plane_in_the_suns_map_is_nearer_than_all_four_texels() {
        let n = DVec3::new(-0.3, 0.2, 0.9).normalize();
        let sizes = DVec3::new(3.0, 2.0, 5.0);
        let gradient = n * sizes;
        let p = DVec3::new(0.4, 0.6, 0.5);
        let place = sun_place(p, gradient, sizes * sizes, DVec2::ONE, 100.0);
        let moved = (DVec3::from((place.uv, place.depth)) - p) * sizes;
        assert!(moved.cross(n).length() < 1e-12 && moved.length() < 0.03, "{moved}");
        for (x, y) in [(-0.01, -0.01), (0.01, -0.01), (-0.01, 0.01), (0.01, 0.01)] {
            // The plane's own depth a texel away: where the gradient is perpendicular to the step.
            let there = p.z - (gradient.x * x + gradient.y * y) / gradient.z;
            let here = place.depth + place.slope.dot(p.truncate() - place.uv);
            assert!(here > there && here - p.z < 0.02, "{place:?}, {there}");
            assert!((p.z + place.slope.dot(DVec2::new(x, y)) - there).abs() < 1e-12);
        }
        assert!(sun_place(p, -gradient, sizes * sizes, DVec2::ONE, 100.0).slope.is_finite());
    }

    #[test]
    fn a_hole_shows_the_lamp_as_wide_as_similar_triangles_say() {
        // A hole 1 m from a lamp of 5 cm, a point 2 m from it: the cone is 2.5 cm wide at the hole.
        let (near, radius) = (0.01, 0.05);
        let place = |along: f64| lamp_place(DVec3::Z * along, DVec3::NEG_Z, near, radius, EXACT);
        let width = place(2.0).spread * (place(1.0).depth - place(2.0).depth);
        assert!((width.x * 2.0 * FACE_TANGENT - 0.025).abs() < 1e-12);
    }

    #[test]
    fn rays_are_blocked_by_what_lies_between_alone() {
        let triangle = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)];
        let blocked = |from: DVec3, to: DVec3| is_blocked(from, to, &[triangle], 1e-6);
        assert!(blocked(DVec3::Z, DVec3::NEG_Z) && blocked(DVec3::NEG_Z, DVec3::Z));
        assert!(!blocked(DVec3::Z, 0.1 * DVec3::Z) && !blocked(DVec3::Z + DVec3::X, DVec3::NEG_Z + DVec3::X));
        assert!(!blocked(DVec3::ZERO, DVec3::Z), "a point of the triangle itself");
        assert!(!blocked(DVec3::NEG_X, DVec3::X), "a ray in its plane");
    }

    #[test]
    fn half_a_disc_lies_beyond_an_edge_through_its_middle() {
        assert_eq!([-1.0, 1.0, 2.0].map(disc_beyond), [1.0, 0.0, 0.0]);
        assert!((disc_beyond(0.0) - 0.5).abs() < 1e-15);
        assert!((disc_beyond(0.3) + disc_beyond(-0.3) - 1.0).abs() < 1e-15);
    }
}
