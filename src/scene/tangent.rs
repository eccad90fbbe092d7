//! From the corners of triangles to indexed vertices with tangents.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace};
use glam::{Vec3, Vec4};

use super::mesh::{Bounds, Mesh, Vertex};
use crate::asset::mesh::{Corner, CornerExtra, Submesh};

/// A mesh of `submesh`'s triangles, in their order; equal corners share a vertex.
///
/// Tangents are MikkTSpace's, computed with v upwards, so that w · cross(normal, tangent) points to the picture's top;
/// where there are no texture coordinates, or none of any area, any tangent perpendicular to the normal. Those that the file
/// gives are kept.
pub fn mesh(submesh: &Submesh, material: usize) -> Mesh {
    let tangents = tangents(submesh);
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut known: HashMap<[u32; 18], u32> = HashMap::with_capacity(submesh.corners.len() / 3);
    let extras = submesh.extras.iter().map(Some).chain(std::iter::repeat(None));
    let indices = submesh.corners.iter().zip(tangents).zip(extras).map(|((corner, tangent), extra)| {
        let vertex = vertex(corner, tangent, extra);
        *known.entry(bytemuck::cast(vertex)).or_insert_with(|| {
            vertices.push(vertex);
            vertices.len() as u32 - 1
        })
    });
    let indices = indices.collect();
    let bounds = Bounds::of(submesh.corners.iter().map(|corner| corner.position));
    Mesh { name: submesh.name.clone(), vertices, indices, material, bounds }
}

fn vertex(corner: &Corner, tangent: Vec4, extra: Option<&CornerExtra>) -> Vertex {
    let colour = extra.map_or(Vec4::ONE, |extra| extra.colour);
    Vertex {
        position: corner.position.to_array(),
        normal: corner.normal.to_array(),
        uv: [corner.uv.x, 1.0 - corner.uv.y],
        tangent: tangent.to_array(),
        lightmap_uv: [0.0; 2],
        uv1: extra.map_or([0.0; 2], |extra| [extra.uv1.x, 1.0 - extra.uv1.y]),
        colour: colour.to_array().map(|c| (c.clamp(0.0, 1.0) * 65535.0).round() as u16),
    }
}

fn tangents(submesh: &Submesh) -> Vec<Vec4> {
    let mut corners = Corners { corners: &submesh.corners, tangents: vec![Vec4::ZERO; submesh.corners.len()] };
    let given = |extra: &CornerExtra| extra.tangent != Vec4::ZERO;
    let all_given = !submesh.extras.is_empty() && submesh.extras.iter().all(given);
    if submesh.has_uvs && !all_given {
        let done = bevy_mikktspace::generate_tangents(&mut corners);
        // Its error type has no variants; unusable tangents are replaced below anyway.
        debug_assert!(done.is_ok());
    }
    for (tangent, extra) in corners.tangents.iter_mut().zip(&submesh.extras).filter(|(_, extra)| given(extra)) {
        *tangent = extra.tangent;
    }
    let usable = corners.tangents.iter().zip(corners.corners);
    usable.map(|(tangent, corner)| usable_tangent(*tangent, corner.normal)).collect()
}

/// `tangent`, or any other one if it is not a unit vector perpendicular to the normal.
fn usable_tangent(tangent: Vec4, normal: Vec3) -> Vec4 {
    let t = tangent.truncate();
    if tangent.is_finite() && (t.length() - 1.0).abs() < 1e-3 && t.dot(normal).abs() < 1e-2 {
        tangent
    } else {
        normal.any_orthonormal_vector().extend(1.0)
    }
}

struct Corners<'a> {
    corners: &'a [Corner],
    tangents: Vec<Vec4>,
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.corners.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.corners[face * 3 + vert].position.to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.corners[face * 3 + vert].normal.to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.corners[face * 3 + vert].uv.to_array()
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(space) = tangent_space {
            self.tangents[face * 3 + vert] = Vec4::from_array(space.tangent_encoded());
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    /// A unit square in the xy plane, towards +z, with texture coordinates `uv(x, y)`.
    fn square(uv: impl Fn(Vec2) -> Vec2) -> Submesh {
        let corner =
            |x: f32, y: f32| Corner { position: Vec3::new(x, y, 0.0), normal: Vec3::Z, uv: uv(Vec2::new(x, y)) };
        let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        Submesh {
            name: "square".into(),
            material: None,
            has_uvs: true,
            corners: vec![a, b, c, a, c, d],
            smoothing: vec![],
            extras: vec![],
        }
    }

    fn bitangent(vertex: &Vertex) -> Vec3 {
        let tangent = Vec4::from_array(vertex.tangent);
        tangent.w * Vec3::from_array(vertex.normal).cross(tangent.truncate())
    }

    #[test]
    fn tangents_point_right_and_up_in_the_picture() {
        let mesh = mesh(&square(|p| p), 3);
        assert_eq!((mesh.vertices.len(), mesh.indices.as_slice(), mesh.material), (4, &[0, 1, 2, 0, 2, 3][..], 3));
        for v in &mesh.vertices {
            assert_eq!(v.tangent, [1.0, 0.0, 0.0, 1.0]);
            assert_eq!(bitangent(v), Vec3::Y);
            assert_eq!(v.uv, [v.position[0], 1.0 - v.position[1]], "v runs down from the picture's top");
        }
        assert_eq!(mesh.bounds, Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) });
    }

    #[test]
    fn mirrored_coordinates_turn_the_sign() {
        for v in mesh(&square(|p| Vec2::new(1.0 - p.x, p.y)), 0).vertices {
            assert_eq!(v.tangent, [-1.0, 0.0, 0.0, -1.0]);
            assert_eq!(bitangent(&v), Vec3::Y);
        }
    }

    #[test]
    fn mirrored_halves_split_the_vertices_between_them() {
        let mut submesh = square(|p| p);
        // The left neighbour, mirrored about x = 0: the same coordinates on the common edge.
        let mirrored =
            submesh.corners.iter().rev().map(|c| Corner { position: c.position * Vec3::new(-1.0, 1.0, 1.0), ..*c });
        submesh.corners = submesh.corners.clone().into_iter().chain(mirrored).collect();
        let mesh = mesh(&submesh, 0);
        assert_eq!(mesh.vertices.len(), 8, "two vertices of the common edge are duplicated");
        for v in &mesh.vertices {
            assert!((v.tangent[0].abs() - 1.0).abs() < 1e-6 && (bitangent(v) - Vec3::Y).length() < 1e-6, "{v:?}");
        }
    }

    #[test]
    fn coordinates_without_area_give_some_frame() {
        let degenerate =
            [square(|_| Vec2::ZERO), square(|p| Vec2::splat(p.x)), Submesh { has_uvs: false, ..square(|p| p) }];
        for submesh in degenerate {
            for v in mesh(&submesh, 0).vertices {
                let (t, n) = (Vec4::from_array(v.tangent), Vec3::from_array(v.normal));
                assert!(t.truncate().is_normalized() && t.truncate().dot(n).abs() < 1e-6 && t.w.abs() == 1.0, "{v:?}");
            }
        }
    }

    #[test]
    fn wild_input_never_gives_a_nan() {
        for scale in [1e-30, 1e-10, 1e9] {
            let mut submesh = square(|p| p * 1e6);
            submesh.corners.iter_mut().for_each(|c| c.position *= scale);
            for v in mesh(&submesh, 0).vertices {
                assert!(
                    v.tangent.iter().all(|t| t.is_finite()) && Vec4::from_array(v.tangent).truncate().is_normalized()
                );
            }
        }
    }
}
