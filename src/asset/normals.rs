//! Normals for models without, or with unusable ones.

use glam::Vec3;
use rayon::slice::ParallelSliceMut;

use super::mesh::Submesh;

/// Faces that meet at a sharper angle than 60° keep their edge.
const CREASE_COSINE: f32 = 0.5;
/// Where more corners than this meet, all are smoothed together: comparing each with each is quadratic.
const MAX_COMPARED: usize = 256;

/// A vector normalised, of any finite length down to the smallest; zero where it has no direction.
pub fn unit(v: Vec3) -> Vec3 {
    let largest = v.abs().max_element();
    if v.is_finite() && largest > 0.0 { (v / largest).normalize_or_zero() } else { Vec3::ZERO }
}

/// A triangle's corner, sortable by the bits of its position.
struct Place {
    position: [u32; 3],
    submesh: u32,
    corner: u32,
    /// Unit normal of the triangle; zero where it has no area.
    face: Vec3,
    /// Angle at the corner, in radians.
    angle: f32,
    /// Smoothing group; 0: none.
    group: u32,
}

/// Fills in every zero normal: the mean of the triangles around its position, weighted by their angles there (Thürmer
/// and Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998), leaving out those beyond a crease of 60° and those
/// of other smoothing groups. Neighbours count across submeshes and texture seams.
pub fn complete(submeshes: &mut [Submesh]) {
    if submeshes.iter().all(|submesh| submesh.corners.iter().all(|corner| corner.normal != Vec3::ZERO)) {
        return;
    }
    let mut places: Vec<Place> = (0..submeshes.len()).flat_map(|submesh| submesh_places(submeshes, submesh)).collect();
    places.par_sort_unstable_by_key(|place| (place.position, place.submesh, place.corner));
    for around in places.chunk_by(|a, b| a.position == b.position) {
        let all = weighted_mean(around.iter());
        for place in around {
            let normal = &mut submeshes[place.submesh as usize].corners[place.corner as usize].normal;
            if *normal == Vec3::ZERO {
                *normal = smooth_normal(place, around, all);
            }
        }
    }
}

fn submesh_places(submeshes: &[Submesh], index: usize) -> impl Iterator<Item = Place> {
    let Submesh { corners, smoothing, .. } = &submeshes[index];
    (0..corners.len()).map(move |corner| {
        let first = corner / 3 * 3;
        let at = |offset: usize| corners[first + offset % 3].position;
        let here = corner - first;
        let (next, previous) = (unit(at(here + 1) - at(here)), unit(at(here + 2) - at(here)));
        Place {
            // −0 and 0 are the same place.
            position: (at(here) + Vec3::ZERO).to_array().map(f32::to_bits),
            submesh: index as u32,
            corner: corner as u32,
            face: unit(unit(at(1) - at(0)).cross(unit(at(2) - at(0)))),
            angle: next.dot(previous).clamp(-1.0, 1.0).acos(),
            group: smoothing.get(corner / 3).copied().unwrap_or(u32::MAX),
        }
    })
}

fn weighted_mean<'a>(places: impl Iterator<Item = &'a Place>) -> Vec3 {
    unit(places.map(|place| place.face * place.angle).sum())
}

fn smooth_normal(own: &Place, around: &[Place], all: Vec3) -> Vec3 {
    let compare = own.face != Vec3::ZERO && around.len() <= MAX_COMPARED;
    let joined = |other: &&Place| other.group == own.group && other.face.dot(own.face) >= CREASE_COSINE;
    let mean = if own.group == 0 {
        own.face
    } else if compare {
        weighted_mean(around.iter().filter(joined))
    } else {
        all
    };
    // Where only triangles without area meet, nothing is visible: any direction will do.
    [mean, own.face].into_iter().find(|normal| *normal != Vec3::ZERO).unwrap_or(Vec3::Y)
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::asset::mesh::Corner;

    fn submesh(triangles: &[[Vec3; 3]]) -> Submesh {
        let corner = |position: Vec3| Corner { position, normal: Vec3::ZERO, uv: Vec2::ZERO };
        let corners = triangles.as_flattened().iter().map(|p| corner(*p)).collect();
        Submesh { name: "p".into(), material: None, has_uvs: false, corners, smoothing: Vec::new(), extras: Vec::new() }
    }

    /// Two triangles that meet at an edge along z, the second turned by some degrees out of the plane of the first.
    fn fold(degrees: f32) -> Vec<Submesh> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let far = Vec3::new(cos, -sin, 0.0);
        vec![submesh(&[[Vec3::ZERO, Vec3::Z, Vec3::NEG_X]]), submesh(&[[Vec3::ZERO, far, Vec3::Z]])]
    }

    fn flip_up(mut submeshes: Vec<Submesh>) -> Vec<Submesh> {
        for submesh in &mut submeshes {
            for triangle in submesh.corners.chunks_exact_mut(3) {
                let up =
                    (triangle[1].position - triangle[0].position).cross(triangle[2].position - triangle[0].position);
                if up.y < 0.0 {
                    triangle.swap(1, 2);
                }
            }
        }
        submeshes
    }

    #[test]
    fn directions_of_any_length() {
        for length in [1e-30, 1e-23, 1.0, 1e20, 3e38] {
            assert!((unit(Vec3::new(0.0, length, 0.0)) - Vec3::Y).length() < 1e-6, "{length}");
        }
        assert_eq!(unit(Vec3::ZERO), Vec3::ZERO);
        assert_eq!(unit(Vec3::new(f32::NAN, 0.0, 1.0)), Vec3::ZERO);
        assert_eq!(unit(Vec3::new(f32::INFINITY, 0.0, 1.0)), Vec3::ZERO);
    }

    #[test]
    fn flat_folds_are_smooth_and_sharp_ones_are_not() {
        let mut gentle = flip_up(fold(40.0));
        complete(&mut gentle);
        let (a, b) = (gentle[0].corners[0].normal, gentle[1].corners[0].normal);
        assert!((a - b).length() < 1e-6 && a.is_normalized() && a.x > 0.05, "{a} {b}");
        let mut sharp = flip_up(fold(80.0));
        complete(&mut sharp);
        let (a, b) = (sharp[0].corners[0].normal, sharp[1].corners[0].normal);
        assert!((a - Vec3::Y).length() < 1e-6 && a.angle_between(b).to_degrees() > 79.0, "{a} {b}");
    }

    #[test]
    fn smoothing_groups_part_what_a_crease_would_not() {
        for (groups, smooth) in [([1, 1], true), ([1, 2], false), ([0, 0], false)] {
            let mut parts = flip_up(fold(20.0));
            parts.iter_mut().zip(groups).for_each(|(part, group)| part.smoothing = vec![group]);
            complete(&mut parts);
            let (a, b) = (parts[0].corners[0].normal, parts[1].corners[0].normal);
            assert_eq!((a - b).length() < 1e-6, smooth, "{groups:?}: {a} {b}");
        }
    }

    #[test]
    fn good_normals_stay() {
        let mut submeshes = flip_up(fold(10.0));
        submeshes[0].corners[0].normal = Vec3::X;
        complete(&mut submeshes);
        assert_eq!(submeshes[0].corners[0].normal, Vec3::X);
    }

    #[test]
    fn degenerate_and_huge_fans_neither_fail_nor_take_long() {
        let mut submeshes = vec![submesh(&[[Vec3::ONE; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0]])];
        complete(&mut submeshes);
        assert!(submeshes[0].corners.iter().all(|c| c.normal.is_normalized()));
        let fan = (0..100_000).map(|i| [Vec3::ZERO, Vec3::X + Vec3::Z * i as f32, Vec3::X + Vec3::Z * (i + 1) as f32]);
        let mut submeshes = vec![submesh(&fan.collect::<Vec<_>>())];
        complete(&mut submeshes);
        assert!((submeshes[0].corners[0].normal - Vec3::NEG_Y).length() < 1e-3);
    }
}
