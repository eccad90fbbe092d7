//! The draw calls of a frame: culled ranges of triangles, sorted near to far and merged.

use std::ops::Range;

use glam::Mat4;

use super::culling::Frusta;
use super::eye::Eye;
use crate::gpu::Cull;
use crate::scene::cluster::Cluster;
use crate::scene::probes::MOST_PROBES;
use crate::scene::{Bounds, Probe};

/// One range of triangles of one instance.
#[derive(Clone)]
pub struct Draw {
    /// Of the scene's index buffer.
    pub indices: Range<u32>,
    /// Index into the scene's instances: the push constant.
    pub instance: u32,
    /// Index into the scene's combinations of material features, and with it the pipeline.
    pub variant: u32,
    /// Index into the scene's sets of textures.
    pub textures: u32,
    /// Whether it is not seen from behind.
    pub single_sided: bool,
    pub probes: ProbeUse,
    layer: Layer,
    /// World space, before the common movement of all models.
    bounds: Bounds,
    /// No back face is visible from outside of this box.
    culling_bounds: Option<Bounds>,
}

/// Which probes give a draw's mirror images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProbeUse {
    /// None reaches into its box.
    #[default]
    None,
    /// Several may, or the panorama in their place: a bit for each, the lowest for the first.
    Several(u32),
    /// One gives all: its index.
    One(u32),
}

const _: () = assert!(MOST_PROBES <= u32::BITS as usize);

impl ProbeUse {
    /// How many kinds there are.
    pub const KINDS: usize = 3;
    /// The kind that several may give.
    pub const SEVERAL: usize = 1;

    /// Of these probes, whose order is that in which shaders ask them, for what is in a box.
    pub fn new(probes: &[Probe], bounds: Bounds) -> Self {
        let mut bits = 0;
        for (index, probe) in (0u32..).zip(probes).filter(|(_, probe)| probe.reaches_into(bounds)) {
            let covers = probe.covers(bounds);
            if covers && bits == 0 {
                return Self::One(index);
            }
            bits |= 1 << index;
            if covers {
                break;
            }
        }
        if bits == 0 { Self::None } else { Self::Several(bits) }
    }

    /// Which pipeline of a variant draws it: below [`ProbeUse::KINDS`].
    pub fn kind(self) -> usize {
        match self {
            Self::None => 0,
            Self::Several(_) => Self::SEVERAL,
            Self::One(_) => 2,
        }
    }

    /// A bit for each probe, the lowest for the first.
    pub fn bits(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Several(bits) => bits,
            Self::One(index) => 1 << index,
        }
    }
}

/// What is drawn before what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    Opaque,
    /// Alpha-tested: after opaque surfaces, which hide many of its fragments.
    Masked,
    /// After all else and the sky, far before near.
    Blended,
}

impl Draw {
    /// A cluster at one of its placements, seen from both sides, with variant and texture indices of 0.
    pub fn new(cluster: &Cluster, indices: Range<u32>, instance: u32, world_from_local: Mat4, layer: Layer) -> Self {
        // Back faces show through holes; mirrored placements swap fronts and backs.
        let keeps_sides = layer == Layer::Opaque && world_from_local.determinant() > 0.0;
        let culling_bounds = cluster.culling_bounds.filter(|_| keeps_sides);
        Self {
            indices,
            instance,
            variant: 0,
            textures: 0,
            single_sided: false,
            probes: ProbeUse::None,
            layer,
            bounds: cluster.bounds_at(world_from_local),
            culling_bounds: culling_bounds.map(|bounds| bounds.placed(world_from_local)),
        }
    }

    /// A part of it.
    pub fn part(&self, indices: Range<u32>, bounds: Bounds, probes: ProbeUse) -> Self {
        Self { indices, bounds, probes, ..self.clone() }
    }

    /// Whether it may be split in parts that are not drawn one after the other.
    pub fn is_solid(&self) -> bool {
        self.layer != Layer::Blended
    }

    /// World space, before the common movement of all models.
    pub fn bounds(&self) -> Bounds {
        self.bounds
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

/// Optimisations of a frame. None changes the picture; each can be switched off for measurements.
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

/// The draw calls of one frame; memory is reused for the next.
#[derive(Default)]
pub struct DrawList {
    visible: Vec<Visible>,
    calls: Vec<DrawCall>,
    /// The number of calls before the first blended one.
    solid: usize,
}

/// Ranges of one instance that lie next to each other in the index buffer, drawn together.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawCall {
    pub indices: Range<u32>,
    pub instance: u32,
    pub variant: u32,
    pub textures: u32,
    /// What no eye sees, or what is drawn at another time.
    pub cull: Cull,
    /// Whether backs are not to be seen.
    pub single_sided: bool,
    pub probes: ProbeUse,
}

/// A range that some eye may see.
struct Visible {
    layer: Layer,
    /// Metres from the nearest eye to the box's far end, as the bits of an f32, which sort as numbers that are not negative do; of
    /// blended ones the complement.
    order: u32,
    /// Index in the scene's draws.
    draw: u32,
    call: DrawCall,
}

/// Counts of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct DrawCounts {
    /// Draw calls.
    pub calls: usize,
    /// Ranges of triangles in them.
    pub ranges: usize,
    /// Ranges of the whole scene.
    pub all_ranges: usize,
}

impl DrawList {
    /// Collects the draw calls that some eye may see. Allocates only if there are more draws than ever before.
    ///
    /// Blended surfaces are always drawn far before near: backs by the far end of their box, fronts by its near end, so that
    /// what is inside of another thing comes between its backs and its fronts.
    pub fn fill(&mut self, draws: &[Draw], eyes: &[Eye], culling: CullOptions) {
        let frusta = Frusta::of(eyes);
        self.visible.clear();
        self.visible.reserve(2 * draws.len());
        for (index, draw) in (0u32..).zip(draws).filter(|(_, draw)| !culling.frusta || frusta.may_see(&draw.bounds)) {
            if draw.layer == Layer::Blended {
                let shown = if draw.single_sided { &[Cull::Back][..] } else { &[Cull::Front, Cull::Back] };
                self.visible.extend(shown.iter().map(|cull| Visible::blended(index, draw, &frusta, *cull)));
            } else {
                self.visible.push(Visible::solid(index, draw, &frusta, culling.backs));
            }
        }
        // Odd, so that no two draws share a key (Knuth, "The Art of Computer Programming" 3, section 6.4).
        let shuffled = |draw: u32, seed: u32| (draw ^ seed).wrapping_mul(0x9e37_79b1);
        self.visible.sort_unstable_by_key(|v| match (culling.order, v.layer) {
            (Order::FrontToBack, _) | (_, Layer::Blended) => (v.layer, v.order, v.draw),
            (Order::Listed, _) => (Layer::Opaque, 0, v.draw),
            (Order::Shuffled(seed), _) => (Layer::Opaque, shuffled(v.draw, seed), v.draw),
        });
        self.calls.clear();
        self.calls.reserve(2 * draws.len());
        self.solid = 0;
        for Visible { call, layer, .. } in &self.visible {
            match self.calls.last_mut() {
                Some(last) if last.continues_with(call) => last.indices.end = call.indices.end,
                _ => self.calls.push(call.clone()),
            }
            self.solid = if *layer == Layer::Blended { self.solid } else { self.calls.len() };
        }
    }

    /// All draw calls, in order.
    pub fn calls(&self) -> &[DrawCall] {
        &self.calls
    }

    /// Those that hide all that is behind.
    pub fn solid(&self) -> &[DrawCall] {
        &self.calls[..self.solid]
    }

    /// Those that are blended with what is behind, far before near.
    pub fn blended(&self) -> &[DrawCall] {
        &self.calls[self.solid..]
    }

    /// Their counts, for a scene with `all_ranges` ranges.
    pub fn counts(&self, all_ranges: usize) -> DrawCounts {
        DrawCounts { calls: self.calls.len(), ranges: self.visible.len(), all_ranges }
    }
}

impl Visible {
    fn solid(index: u32, draw: &Draw, frusta: &Frusta, cull_backs: bool) -> Self {
        let hides_backs = cull_backs && draw.culling_bounds.is_some_and(|bounds| frusta.all_outside(&bounds));
        let call = DrawCall::of(draw, if hides_backs { Cull::Back } else { Cull::Nothing });
        // By near ends all boxes that the eye is in would come first: in a room, what is behind its walls before its things.
        Self { layer: draw.layer, order: frusta.reach(&draw.bounds).to_bits(), draw: index, call }
    }

    /// The fronts of a blended surface, or its backs.
    fn blended(index: u32, draw: &Draw, frusta: &Frusta, cull: Cull) -> Self {
        let metres = if cull == Cull::Back { frusta.distance(&draw.bounds) } else { frusta.reach(&draw.bounds) };
        Self { layer: draw.layer, order: !metres.to_bits(), draw: index, call: DrawCall::of(draw, cull) }
    }
}

impl DrawCall {
    fn of(draw: &Draw, cull: Cull) -> Self {
        let Draw { indices, instance, variant, textures, single_sided, probes, .. } = draw;
        Self {
            indices: indices.clone(),
            instance: *instance,
            variant: *variant,
            textures: *textures,
            cull,
            single_sided: *single_sided,
            probes: *probes,
        }
    }

    /// What is left out of a picture: surfaces without a back are not seen from there, though they cast shadows.
    pub fn seen_faces(&self) -> Cull {
        if self.single_sided { Cull::Back } else { self.cull }
    }

    fn continues_with(&self, next: &Self) -> bool {
        let alike = self.instance == next.instance && self.probes == next.probes && self.cull == next.cull;
        alike && self.indices.end == next.indices.start
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::Vertex;

    fn draw(x: f32, z: f32, masked: bool, closed: bool) -> Draw {
        layered(x, z, if masked { Layer::Masked } else { Layer::Opaque }, closed)
    }

    fn layered(x: f32, z: f32, layer: Layer, closed: bool) -> Draw {
        let bounds = Bounds { min: Vec3::new(x - 0.5, -0.5, z - 0.5), max: Vec3::new(x + 0.5, 0.5, z + 0.5) };
        Draw::new(&cluster(bounds, closed), 0..3, 0, Mat4::IDENTITY, layer)
    }

    fn cluster(bounds: Bounds, closed: bool) -> Cluster {
        let corner = |p: Vec3| Vertex { position: p.into(), ..Vertex::default() };
        Cluster {
            vertices: [bounds.min, bounds.max].map(corner).into(),
            indices: Vec::new(),
            material: 0,
            bounds,
            culling_bounds: closed.then_some(bounds),
            placements: Vec::new(),
        }
    }

    #[test]
    fn draws_that_one_probe_reaches_wholly_need_not_look_for_others() {
        let around = |low: f32, high: f32| Bounds { min: Vec3::splat(low), max: Vec3::splat(high) };
        let room = Probe { position: Vec3::ZERO, bounds: around(-4.0, 4.0), thing: None };
        let thing = Probe { thing: Some(around(-1.0, 1.0)), ..room };
        let probes = [thing, room];
        for (bounds, expected) in [
            (around(-0.9, 0.9), ProbeUse::One(0)),
            (around(-1.005, 1.0), ProbeUse::One(0)),
            (around(0.5, 1.5), ProbeUse::Several(0b11)),
            (around(1.5, 2.5), ProbeUse::One(1)),
            (around(-4.05, 4.05), ProbeUse::Several(0b11)),
            (around(3.0, 6.0), ProbeUse::Several(0b10)),
            (around(6.0, 7.0), ProbeUse::None),
        ] {
            assert_eq!(ProbeUse::new(&probes, bounds), expected, "{bounds:?}");
        }
        assert_eq!(ProbeUse::new(&[room], around(-4.05, 4.05)), ProbeUse::One(0), "a wall");
        assert_eq!(ProbeUse::new(&[], around(-1.0, 1.0)), ProbeUse::None);
    }

    fn listed(draws: &[Draw], culling: CullOptions) -> Vec<(u32, bool)> {
        let mut list = DrawList::default();
        let eyes = Eye::symmetric(Mat4::IDENTITY, 60.0, 1.0, 1.0).stereo(0.06);
        list.fill(draws, &eyes, culling);
        list.visible.iter().map(|v| (v.draw, v.call.cull == Cull::Back)).collect()
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
    fn a_room_around_the_eye_comes_after_the_things_in_it() {
        let mut room = draw(0.0, 0.0, false, false);
        room.bounds = Bounds { min: Vec3::splat(-9.0), max: Vec3::splat(9.0) };
        let draws = [room, draw(0.0, -4.0, false, false), draw(0.0, -2.0, false, false)];
        assert_eq!(listed(&draws, CullOptions::default()), [(2, false), (1, false), (0, false)]);
    }

    #[test]
    fn blended_surfaces_come_last_and_far_before_near() {
        let mut outer = layered(0.0, -4.0, Layer::Blended, true);
        outer.bounds = Bounds { min: Vec3::new(-2.0, -2.0, -6.0), max: Vec3::new(2.0, 2.0, -2.0) };
        let mut pane = layered(0.0, -9.0, Layer::Blended, false);
        pane.single_sided = true;
        let draws = [outer, layered(0.0, -4.0, Layer::Blended, true), draw(0.0, -20.0, false, false), pane];
        for order in [Order::FrontToBack, Order::Listed, Order::Shuffled(7)] {
            let mut list = DrawList::default();
            let eye = Eye::symmetric(Mat4::IDENTITY, 60.0, 1.0, 1.0);
            list.fill(&draws, &[eye], CullOptions { order, ..CullOptions::default() });
            let seen: Vec<_> = list.visible.iter().map(|v| (v.draw, v.call.cull)).collect();
            // What is inside comes between the backs and the fronts of what is around it.
            let (back, front) = (Cull::Front, Cull::Back);
            assert_eq!(seen[1..], [(3, front), (0, back), (1, back), (1, front), (0, front)], "{order:?}");
            assert_eq!((list.solid().len(), list.blended().len()), (1, 5));
        }
    }

    #[test]
    fn neighbours_of_one_instance_are_drawn_together() {
        let near = |instance, indices| Draw { indices, instance, ..draw(0.0, -2.0, false, true) };
        let draws = [near(0, 3..6), near(0, 0..3), near(0, 6..9), near(1, 9..12), near(0, 15..18)];
        let mut list = DrawList::default();
        let eye = Eye::symmetric(Mat4::IDENTITY, 60.0, 1.0, 1.0);
        list.fill(&draws, &[eye], CullOptions { order: Order::Listed, ..CullOptions::default() });
        let calls: Vec<_> = list.calls().iter().map(|call| (call.instance, call.indices.clone())).collect();
        assert_eq!(calls, [(0, 3..6), (0, 0..3), (0, 6..9), (1, 9..12), (0, 15..18)]);
        let in_order = [near(0, 0..3), near(0, 3..6), near(0, 6..9), near(1, 9..12), near(0, 15..18)];
        list.fill(&in_order, &[eye], CullOptions::default());
        let calls: Vec<_> = list.calls().iter().map(|call| (call.instance, call.indices.clone())).collect();
        assert_eq!(calls, [(0, 0..9), (1, 9..12), (0, 15..18)]);
        assert_eq!(list.counts(5), DrawCounts { calls: 3, ranges: 5, all_ranges: 5 });
    }

    #[test]
    fn mirrored_surfaces_keep_their_backs() {
        let mut draws = [draw(0.0, -4.0, false, true), draw(0.0, -4.0, false, true)];
        assert!(draws[0].culling_bounds.is_some());
        let cluster = cluster(draws[0].bounds, true);
        let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        draws[1] = Draw::new(&cluster, 0..3, 1, mirror, Layer::Opaque);
        assert_eq!(listed(&draws, CullOptions::default()), [(0, true), (1, false)]);
    }
}
