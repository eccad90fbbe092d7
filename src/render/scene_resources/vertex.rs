//! A vertex as the GPU reads it: 32 bytes.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::{DVec4, Vec3, Vec4};

use crate::gpu::Format;
use crate::reference::octahedral::pack_frame;
use crate::scene::Vertex;
use crate::scene::atlas::steps;

/// Positions and texture coordinates keep 32 bits: with 16, adjacent walls would show gaps of a part of a pixel, and
/// coordinates over several repetitions would be too coarse for the texels of a 2048² map.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PackedVertex {
    pub position: [f32; 3],
    /// Normal, tangent and the bitangent's sign: `reference::octahedral`.
    pub frame: [i16; 4],
    pub uv: [f32; 2],
    /// In 65536ths. Read as UNORM it has to be multiplied by 65535 / 65536.
    pub lightmap_uv: [u16; 2],
}

/// Locations 0.. of `glsl/forward.vert`.
pub const ATTRIBUTES: [(Format, u32); 4] = [
    (Format::R32G32B32_SFLOAT, offset_of!(PackedVertex, position) as u32),
    (Format::R16G16B16A16_SNORM, offset_of!(PackedVertex, frame) as u32),
    (Format::R32G32_SFLOAT, offset_of!(PackedVertex, uv) as u32),
    (Format::R16G16_UNORM, offset_of!(PackedVertex, lightmap_uv) as u32),
];

impl From<&Vertex> for PackedVertex {
    fn from(vertex: &Vertex) -> Self {
        let normal = Vec3::from(vertex.normal).as_dvec3();
        let tangent: DVec4 = Vec4::from(vertex.tangent).as_dvec4();
        let lightmap_uv = steps(vertex.lightmap_uv);
        Self { position: vertex.position, frame: pack_frame(normal, tangent), uv: vertex.uv, lightmap_uv }
    }
}

#[cfg(test)]
mod gpu_tests {
    use glam::DVec3;

    use super::*;
    use crate::precompute::harness_tests::{Judge, evaluate, with_gpu};
    use crate::reference::octahedral::tests::directions;
    use crate::reference::octahedral::{frame_normal, frame_tangent, unpack_frame};
    use crate::scene::atlas::STEPS;

    #[test]
    fn the_gpu_unpacks_frames_as_its_twin_does() {
        let frames: Vec<DVec4> = directions()
            .into_iter()
            .flat_map(|n| [1.0, -1.0].map(|sign| pack_frame(n, n.any_orthonormal_vector().extend(sign))))
            .map(unpack_frame)
            .collect();
        let inputs: Vec<[f32; 4]> = frames.iter().map(|f| f.as_vec4().to_array()).collect();
        let mut judge = Judge::default();
        let outputs: Vec<[f32; 7]> = with_gpu(|gpu| evaluate(gpu, "test_octahedral.comp", &inputs));
        for (frame, got) in frames.iter().zip(&outputs) {
            let (normal, tangent): (DVec3, DVec4) = (frame_normal(*frame), frame_tangent(*frame));
            judge.near("frame_normal", frame, &got[..3], &normal.to_array(), [5e-7, 0.0]);
            judge.near("frame_tangent", frame, &got[3..], &tangent.to_array(), [5e-7, 0.0]);
        }
    }

    #[test]
    fn vertices_lie_close() {
        assert_eq!(size_of::<PackedVertex>(), 32);
        let v = Vertex {
            position: [1.0, 2.0, 3.0],
            normal: [0.0, 1.0, 0.0],
            uv: [0.5, 7.0],
            tangent: [1.0, 0.0, 0.0, -1.0],
            lightmap_uv: [0.25, 1.0],
            ..Vertex::default()
        };
        let packed = PackedVertex::from(&v);
        assert_eq!((packed.position, packed.uv, packed.frame), (v.position, v.uv, [0, 32767, 32767, packed.frame[3]]));
        assert_eq!(packed.lightmap_uv, [STEPS as u16 / 4, STEPS as u16]);
        assert!((-16384..=-16383).contains(&packed.frame[3]), "{packed:?}");
    }
}
