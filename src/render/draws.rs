//! What one frame draws, and in which order: nothing that no eye sees, near before far.

use glam::Mat4;

use super::culling::Frusta;
use super::eye::Eye;
use super::scene_resources::MeshRange;
use crate::scene::Bounds;
use crate::scene::cluster::Cluster;

/// One range of triangles, placed.
pub struct Draw {
    pub range: MeshRange,
    pub material: usize,
    pub world_from_local: Mat4,
    /// Fragments may be missing; drawn after those where none is, which then hide many of them.
    masked: bool,
    /// In the world.
    bounds: Bounds,
    /// From outside of this box no back face can be seen.
    culling_bounds: Option<Bounds>,
}

impl Draw {
    /// A cluster at one of its places.
    pub fn new(cluster: &Cluster, range: MeshRange, world_from_local: Mat4, masked: bool) -> Self {
        // Through a hole back faces are seen; a mirror image shows its backs where its original shows fronts.
        let keeps_sides = !masked && world_from_local.determinant() > 0.0;
        Self {
            range,
            material: cluster.material,
            world_from_local,
            masked,
            bounds: cluster.bounds.placed(world_from_local),
            culling_bounds: cluster
                .culling_bounds
                .filter(|_| keeps_sides)
                .map(|culling_bounds| culling_bounds.placed(world_from_local)),
        }
    }
}

/// The order of draws. The picture is the same in each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    FrontToBack,
    /// As the scene lists them.
    Listed,
    /// Any other, the same for the same number.
    Shuffled(u32),
}

/// What is done so that a frame costs less. None of it changes the picture; each can be left out, to measure it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CullOptions {
    /// Leave out ranges outside of every eye's frustum.
    pub frusta: bool,
    /// Leave out the back faces of closed surfaces.
    pub backs: bool,
    pub order: Order,
}

impl Default for CullOptions {
    fn default() -> Self {
        Self { frusta: true, backs: true, order: Order::FrontToBack }
    }
}

/// One frame's draws; its memory is used again for the next.
#[derive(Default)]
pub struct DrawList(Vec<Listed>);

/// A draw that is to be made.
#[derive(Clone, Copy)]
pub struct Listed {
    /// Index into the world's draws.
    pub draw: u32,
    pub cull_back: bool,
    masked: bool,
    distance: f32,
}

impl DrawList {
    /// Lists what some eyes may see. Allocates only where there are more draws than ever before.
    pub fn fill(&mut self, draws: &[Draw], eyes: &[Eye], culling: CullOptions) {
        let frusta = Frusta::of(eyes);
        self.0.clear();
        self.0.reserve(draws.len());
        let seen = (0u32..).zip(draws).filter(|(_, draw)| !culling.frusta || frusta.may_see(&draw.bounds));
        self.0.extend(seen.map(|(index, draw)| Listed {
            draw: index,
            cull_back: culling.backs
                && draw.culling_bounds.is_some_and(|culling_bounds| frusta.all_outside(&culling_bounds)),
            masked: draw.masked,
            distance: frusta.distance(&draw.bounds),
        }));
        // The index decides between equals, so that the order never depends on the sort.
        let far = |a: &Listed, b: &Listed| a.distance.total_cmp(&b.distance).then(a.draw.cmp(&b.draw));
        match culling.order {
            Order::FrontToBack => self.0.sort_unstable_by(|a, b| a.masked.cmp(&b.masked).then(far(a, b))),
            Order::Listed => {}
            // Odd, so that no two draws share a key (Knuth, "The Art of Computer Programming" 3, section 6.4).
            Order::Shuffled(seed) => self.0.sort_unstable_by_key(|l| (l.draw ^ seed).wrapping_mul(0x9e37_79b1)),
        }
    }

    /// The draws, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Listed> {
        self.0.iter()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn draw(x: f32, z: f32, masked: bool, closed: bool) -> Draw {
        let bounds = Bounds { min: Vec3::new(x - 0.5, -0.5, z - 0.5), max: Vec3::new(x + 0.5, 0.5, z + 0.5) };
        let cluster = Cluster {
            vertices: Vec::new(),
            indices: Vec::new(),
            material: 0,
            bounds,
            culling_bounds: closed.then_some(bounds),
            placements: Vec::new(),
        };
        Draw::new(&cluster, MeshRange { indices: 0..0, first_vertex: 0 }, Mat4::IDENTITY, masked)
    }

    fn listed(draws: &[Draw], culling: CullOptions) -> Vec<(u32, bool)> {
        let mut list = DrawList::default();
        let eyes = Eye::symmetric(Mat4::IDENTITY, 60.0, 1.0, 1.0).stereo(0.06);
        list.fill(draws, &eyes, culling);
        list.iter().map(|l| (l.draw, l.cull_back)).collect()
    }

    #[test]
    fn near_comes_before_far_and_masked_comes_last() {
        let draws = [
            draw(0.0, -9.0, false, true),
            draw(0.0, -2.0, true, true),
            draw(0.0, -4.0, false, false),
            draw(0.0, 5.0, false, false),
            draw(0.0, 0.0, false, true),
        ];
        assert_eq!(listed(&draws, CullOptions::default()), [(4, false), (2, false), (0, true), (1, false)]);
        let all = CullOptions { frusta: false, backs: false, order: Order::Listed };
        assert_eq!(listed(&draws, all), [0, 1, 2, 3, 4].map(|i| (i, false)));
        let shuffled = CullOptions { order: Order::Shuffled(3), ..CullOptions::default() };
        let mut order: Vec<u32> = listed(&draws, shuffled).iter().map(|l| l.0).collect();
        assert_ne!(order, [4, 2, 0, 1]);
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 4]);
    }

    #[test]
    fn mirrored_surfaces_keep_their_backs() {
        let mut draws = [draw(0.0, -4.0, false, true), draw(0.0, -4.0, false, true)];
        assert!(draws[0].culling_bounds.is_some());
        let cluster = Cluster {
            vertices: Vec::new(),
            indices: Vec::new(),
            material: 0,
            bounds: draws[0].bounds,
            culling_bounds: draws[0].culling_bounds,
            placements: Vec::new(),
        };
        let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        draws[1] = Draw::new(&cluster, draws[0].range.clone(), mirror, false);
        assert_eq!(listed(&draws, CullOptions::default()), [(0, true), (1, false)]);
    }
}
