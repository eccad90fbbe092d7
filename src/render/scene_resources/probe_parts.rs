//! Parts of clusters by the probes that give their mirror images, so that what one probe gives looks for no others.

use glam::Mat4;

use crate::render::draws::{Draw, ProbeUse};
use crate::scene::cluster::Cluster;
use crate::scene::{Bounds, Probe};

/// Reorders the triangles of a cluster by the probes that give their mirror images at its only placement, and returns the draws
/// of each part in place of `whole`. Within a part the order stays, which is that of the caches.
pub fn part(whole: &Draw, cluster: &mut Cluster, world_from_local: Mat4, probes: &[Probe]) -> Vec<Draw> {
    let corner = |i: &u16| world_from_local.transform_point3(cluster.vertices[usize::from(*i)].position.into());
    let placed = |triangle: &[u16; 3]| {
        let bounds = Bounds::of(triangle.iter().map(corner));
        (ProbeUse::new(probes, bounds), *triangle, bounds)
    };
    let mut triangles: Vec<(ProbeUse, [u16; 3], Bounds)> = cluster.indices.as_chunks().0.iter().map(placed).collect();
    // One part for all that several give: a part costs a draw call.
    let several = triangles.iter().filter(|(probes, ..)| matches!(probes, ProbeUse::Several(_)));
    let several = ProbeUse::Several(several.fold(0, |all, (probes, ..)| all | probes.bits()));
    for (probes, ..) in &mut triangles {
        *probes = if matches!(probes, ProbeUse::Several(_)) { several } else { *probes };
    }
    triangles.sort_by_key(|(probes, ..)| (probes.kind(), probes.bits()));
    let mut start = whole.indices.start;
    let parts = triangles.chunk_by(|a, b| a.0 == b.0).map(|part| {
        let (first, end) = (start, start + 3 * part.len() as u32);
        start = end;
        let bounds = part.iter().fold(Bounds::EMPTY, |sum, (.., bounds)| sum.union(*bounds));
        whole.part(first..end, bounds, part[0].0)
    });
    let parts = parts.collect();
    cluster.indices = triangles.iter().flat_map(|(_, triangle, _)| *triangle).collect();
    parts
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::render::draws::Layer;
    use crate::scene::Vertex;

    /// A triangle of side 1 at each of these places.
    fn cluster(places: &[Vec3]) -> Cluster {
        let corners = places.iter().flat_map(|p| [*p, *p + Vec3::X, *p + Vec3::Y]);
        let vertices: Vec<Vertex> = corners.map(|p: Vec3| Vertex { position: p.into(), ..Vertex::default() }).collect();
        Cluster {
            bounds: Bounds::of(vertices.iter().map(|vertex| vertex.position.into())),
            indices: (0..vertices.len() as u16).collect(),
            vertices,
            material: 0,
            culling_bounds: None,
            placements: vec![Mat4::IDENTITY],
        }
    }

    #[test]
    fn every_triangle_is_in_the_part_of_its_probes() {
        let around = |low: f32, high: f32| Bounds { min: Vec3::splat(low), max: Vec3::splat(high) };
        let room = Probe { position: Vec3::ZERO, bounds: around(-10.0, 10.0), thing: None };
        let thing = Probe { thing: Some(around(-2.0, 2.0)), ..room };
        let moved = Vec3::new(0.0, 0.0, -1.0);
        let x = [0.0, 5.0, 1.5, 30.0, -1.0, 6.0, -2.5];
        let mut parted = cluster(&x.map(|x| Vec3::new(x, 0.0, 0.0) - moved));
        let world_from_local = Mat4::from_translation(moved);
        let whole = Draw::new(&parted, 9..30, 4, world_from_local, Layer::Opaque);
        let before = parted.indices.clone();
        let parts = part(&whole, &mut parted, world_from_local, &[thing, room]);
        let facts: Vec<_> = parts.iter().map(|part| (part.probes, part.indices.clone())).collect();
        assert_eq!(
            facts,
            [
                (ProbeUse::None, 9..12),
                (ProbeUse::Several(0b11), 12..18),
                (ProbeUse::One(0), 18..24),
                (ProbeUse::One(1), 24..30)
            ]
        );
        assert!(parts.iter().all(|part| part.instance == 4));
        let of = |triangle: usize| &before[3 * triangle..3 * triangle + 3];
        assert_eq!(parted.indices, [3, 2, 6, 0, 4, 1, 5].map(of).concat(), "in their order");
        assert_eq!(parts[3].bounds(), Bounds { min: Vec3::new(5.0, 0.0, 0.0), max: Vec3::new(7.0, 1.0, 0.0) });
    }
}
