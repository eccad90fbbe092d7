//! Places where light is captured for mirror images, each with a box: one for each room that smooth surfaces are seen in, and for
//! smooth things in it or in the open, found by rays.

use glam::{BVec3, Vec3};
use rayon::prelude::*;

use super::Probe;
use super::bvh::{Bvh, Hit};
use super::mesh::Bounds;
use super::random_paths::{before, path_direction, starts};
use super::surroundings::{FACES, Surroundings, exit, far, normal, spiral};
use super::things::{holds_any, joined, outstanding, things};

/// The most probes of a scene: each takes memory and time to capture.
pub const MOST_PROBES: usize = 16;
/// Part of a box's mean side over which its influence ends, outside of it.
const BORDER: f32 = 0.05;
/// The same of a thing's box, which is raised by it, too, where it stands on something: that has its own mirror images.
const THING_BORDER: f32 = 0.005;
/// Rays that a place is judged by, and that a candidate for the middle of a room is.
const RAYS: u32 = 2048;
const CANDIDATE_RAYS: u32 = 256;
/// Walls of a room, floor and ceiling counted, at least, or one less if two are opposite, as in a street.
const WALLS: u32 = 4;
/// Least mean side of a room in radii of the scene: a gap between things is none.
const NOOK: f32 = 0.05;
/// Of that side, how far a probe is from what is nearest to it, at least, where an axis has no wall to find its middle by: it
/// may lie at the very surface that it was found by, and see little else.
const CLEAR: f32 = 0.05;
/// Share of rays that meet backs from which on a place is inside of a thing.
const BEHIND: f32 = 0.7;
/// Of what two boxes have together, the share that both have from which on they are one room's.
const SAME_ROOM: f32 = 0.75;
/// Least paths that look for smooth surfaces from each camera, and from all together, and how often each is reflected.
const PATHS: u32 = 1024;
const ALL_PATHS: u32 = 8192;
const REFLECTIONS: u32 = 3;
/// Part of the smooth places that a room without a camera needs, and how many of such places are tried.
const ROOM: f32 = 0.02;
const TRIES: usize = 32;
/// Part of the smooth places that a thing needs.
const THING: f32 = 0.001;
/// Of a room's volume, and of the scene's in the open, the most that a thing in it has that gets a probe of its own, or several
/// that share one: larger ones are fixtures, whose sides lie far apart.
const SMALL: f64 = 0.05;

/// Where probes go, and what else was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placement {
    pub probes: Vec<Probe>,
    /// Whether paths from the cameras meet a smooth surface.
    pub sees_smooth: bool,
    /// Places with smooth surfaces around which most is sky.
    pub open: usize,
    /// Whether things get no probe because there are too many.
    pub crowded: bool,
}

impl Probe {
    /// The box in which it gives mirror images.
    pub fn reach(&self) -> Bounds {
        self.thing.unwrap_or(self.bounds)
    }

    /// Metres outside of that box over which its influence ends.
    pub fn border(&self) -> f32 {
        let part = if self.thing.is_some() { THING_BORDER } else { BORDER };
        part * mean_side(self.reach())
    }

    /// The box that its rays leave before they see anything: a little more than a thing's, whose faces may lie in it, and less than
    /// down to what the thing stands on.
    pub fn hidden(&self) -> Bounds {
        self.thing.map_or(Bounds::of([self.position]), |thing| thing.grown(0.5 * self.border()))
    }

    /// Whether it gives mirror images of something in a box, at least in part.
    pub fn reaches_into(&self, bounds: Bounds) -> bool {
        let reach = self.reach().grown(self.border());
        bounds.min.cmplt(reach.max).all() && bounds.max.cmpgt(reach.min).all()
    }

    /// Whether it gives all mirror images of what is in a box, or hardly less: of a thing's probe, where the thing stands, and of a
    /// room's, where its walls are not quite even, others would give a small part.
    pub fn covers(&self, bounds: Bounds) -> bool {
        let slack = if self.thing.is_some() { 2.0 } else { 0.2 };
        self.reach().grown(slack * self.border()).contains(bounds)
    }

    /// Whether it gives the mirror images of a place, at least in part.
    fn reaches(&self, p: Vec3) -> bool {
        let reach = self.reach();
        (reach.min - p).max(p - reach.max).max(Vec3::ZERO).length() < self.border()
    }

    /// Whether another is of the same room. Places outside of a box, such as a gallery above it, find its room again.
    fn is_same_room(&self, other: &Self) -> bool {
        let (a, b) = (self.bounds, other.bounds);
        let both = a.common(b).volume();
        both >= f64::from(SAME_ROOM) * (a.volume() + b.volume() - both)
    }
}

/// Places probes by rays: for each camera, then for smooth surfaces that paths from cameras meet in other rooms.
/// `smooth` says of a triangle of the hierarchy whether its surface is.
pub fn place(bvh: &Bvh, cameras: &[Vec3], smooth: impl Fn(usize) -> bool + Sync) -> Placement {
    let cameras = starts(cameras);
    let paths = (ALL_PATHS / cameras.len().max(1) as u32).max(PATHS);
    let met: Vec<SmoothHit> = (0u32..)
        .zip(&cameras)
        .flat_map(|(i, camera)| {
            let walk = |path| smooth_met(bvh, *camera, i * paths + path, &smooth);
            (0..paths).into_par_iter().flat_map_iter(walk).collect::<Vec<SmoothHit>>()
        })
        .collect();
    if met.is_empty() {
        return Placement::default();
    }
    let seen: Vec<Vec3> = met.iter().map(|met| met.place).collect();
    let mut placed = Placement { sees_smooth: true, ..Placement::default() };
    for camera in &cameras {
        placed.add(bvh, *camera, &seen, 1);
    }
    let mut others: Vec<Vec3> = seen.iter().copied().filter(|p| !placed.reach(*p)).collect();
    let enough = (ROOM * seen.len() as f32) as usize + 1;
    for _ in 0..TRIES {
        // The middle one: a list's first are those that are seen straight from the first camera.
        let Some(start) = others.get(others.len() / 2).copied().filter(|_| others.len() >= enough) else { break };
        let before = placed.probes.len();
        if Surroundings::new(bvh, start, CANDIDATE_RAYS).backs < BEHIND {
            placed.add(bvh, start, &seen, enough);
        }
        if placed.probes.len() == before {
            others.remove(others.len() / 2);
        }
        others.retain(|p| !placed.reach(*p));
    }
    let triangles: Vec<usize> = met.iter().map(|met| met.triangle).collect();
    let enough = |(_, count): &(Bounds, usize)| *count as f32 >= THING * met.len() as f32;
    let things = things(bvh, &triangles, &smooth, &cameras).into_iter().filter(enough).collect();
    placed.add_things(bvh, things, &cameras);
    // The smallest comes first: a niche within a room is its own.
    placed.probes.sort_by(|a, b| a.reach().volume().total_cmp(&b.reach().volume()));
    placed
}

impl Placement {
    fn reach(&self, p: Vec3) -> bool {
        self.probes.iter().any(|probe| probe.reaches(p))
    }

    /// Adds probes around things, boxes with how often each was met; neighbours share one where there are more than probes are left.
    fn add_things(&mut self, bvh: &Bvh, things: Vec<(Bounds, usize)>, cameras: &[Vec3]) {
        let mut rooms: Vec<Probe> = self.probes.iter().filter(|probe| probe.thing.is_none()).copied().collect();
        rooms.sort_by(|a, b| a.bounds.volume().total_cmp(&b.bounds.volume()));
        let room_of = |thing: Bounds| rooms.iter().find(|room| room.bounds.contains(thing)).map(|room| room.bounds);
        let is_open = |thing: Bounds| !rooms.iter().any(|room| room.reaches(thing.centre()));
        let is_small = |thing: Bounds| thing.volume() <= SMALL * room_of(thing).unwrap_or(bvh.bounds()).volume();
        let has_own = |thing: Bounds| if room_of(thing).is_some() { is_small(thing) } else { is_open(thing) };
        let may_share = |a: Bounds, b: Bounds| {
            let both = a.union(b);
            room_of(a) == room_of(b) && room_of(both) == room_of(a) && is_small(both) && !holds_any(both, cameras)
        };
        let free = MOST_PROBES - self.probes.len();
        let things = joined(things.into_iter().filter(|(thing, _)| has_own(*thing)).collect(), free, may_share);
        let counts: Vec<usize> = things.iter().map(|(_, count)| *count).collect();
        let kept = outstanding(&counts, free);
        let probe = |(thing, _): &(Bounds, usize)| thing_probe(bvh, *thing, room_of(*thing));
        self.probes.extend(things[..kept].iter().filter_map(probe));
        self.crowded = things.len() > kept;
    }

    /// Adds a probe for the room around a place where none reaches it, if it gives so many smooth places their light.
    fn add(&mut self, bvh: &Bvh, start: Vec3, seen: &[Vec3], enough: usize) {
        if self.probes.len() == MOST_PROBES || self.reach(start) {
            return;
        }
        let Some(probe) = room(bvh, start) else {
            self.open += 1;
            return;
        };
        if self.probes.iter().any(|placed| placed.is_same_room(&probe)) {
            return;
        }
        // Things that enclose a place hide others beside them, which its box has, too.
        let shows = |p: &&Vec3| probe.reaches(**p) && is_clear(bvh, probe.position, **p);
        if seen.iter().filter(shows).take(enough).count() >= enough {
            self.probes.push(probe);
        }
    }
}

fn mean_side(bounds: Bounds) -> f32 {
    (bounds.max - bounds.min).min(Vec3::splat(1e6)).element_sum() / 3.0
}

/// The probe of what a thing in this box mirrors, in a room with these bounds or in the open; `None` where that is the panorama
/// alone, or the inside of another thing.
fn thing_probe(bvh: &Bvh, mut thing: Bounds, room: Option<Bounds>) -> Option<Probe> {
    let border = THING_BORDER * mean_side(thing);
    // The underside of what hangs, or stands on wheels, is its own.
    thing.min.y = ground(bvh, thing, 2.0 * border).map_or(thing.min.y - border, |height| height + border);
    let position = thing.centre();
    let mut probe = Probe { position, bounds: thing, thing: Some(thing) };
    let view = Surroundings::around(bvh, position, probe.hidden(), RAYS);
    let around = view.bounds(bvh);
    // What it stands on is its floor, in a room, too.
    probe.bounds = room.map_or(around, |room| Bounds { min: room.min.with_y(around.min.y), ..room }).union(thing);
    // A room may be seen from its walls' backs.
    let is_outside = room.is_some() || view.backs < BEHIND;
    (!view.met.is_empty() && is_outside).then_some(probe)
}

/// How high the ground is that a thing stands on, up to some metres below its box, or is sunk in; `None` where it does not.
fn ground(bvh: &Bvh, thing: Bounds, below: f32) -> Option<f32> {
    let (centre, within) = (thing.centre(), Bounds { min: thing.min - below * Vec3::Y, ..thing });
    let is_part = |hit: &Hit| thing.contains(bvh.triangles()[hit.triangle].bounds());
    let down = (0..CANDIDATE_RAYS).map(|i| spiral(i, CANDIDATE_RAYS)).filter(|d| d.y < -FACES);
    let height = |d: Vec3| {
        let hit = bvh.trace(centre, d, exit(centre, d, within).distance(centre), |hit| !is_part(hit))?;
        (normal(bvh, &hit).y.abs() > FACES).then_some(centre.y + hit.t * d.y)
    };
    let heights: Vec<Option<f32>> = down.map(height).collect();
    let mut met: Vec<f32> = heights.iter().flatten().copied().collect();
    met.sort_by(f32::total_cmp);
    (2 * met.len() > heights.len()).then(|| met[met.len() / 2])
}

/// The probe of the room around a place; `None` in the open.
fn room(bvh: &Bvh, start: Vec3) -> Option<Probe> {
    let from_start = Surroundings::new(bvh, start, RAYS);
    let seen_from = |position: Vec3, view: &Surroundings| {
        let bounds = view.bounds(bvh).union(Bounds::of([position]));
        Probe { position, bounds, thing: None }
    };
    let (mut probe, mut clearance) = (seen_from(start, &from_start), from_start.clearance);
    let mut is_open = from_start.is_open();
    // From the middle more of the walls is seen than from a corner, and less of the surface that the start lies at.
    for _ in 0..2 {
        if is_open {
            return None;
        }
        let position = middle(bvh, start, probe.bounds, &from_start);
        let view = Surroundings::new(bvh, position, RAYS);
        let next = seen_from(position, &view);
        is_open = view.is_open();
        // Unless a thing hides one there.
        if !is_open && wall_count(bvh, &next) < wall_count(bvh, &probe) {
            break;
        }
        (probe, clearance) = (next, view.clearance);
    }
    let without = sides_without_wall(bvh, &probe);
    // An axis without a wall says nothing of a room's size.
    let walled = !(without[0] | without[1]);
    let axes = walled.bitmask().count_ones().max(1);
    let side = Vec3::select(walled, probe.bounds.max - probe.bounds.min, Vec3::ZERO).element_sum() / axes as f32;
    let is_nook = side < NOOK * bvh.bounds().radius() || (axes < 3 && clearance < CLEAR * side);
    let walls = wall_count(bvh, &probe);
    let is_street = walls + 1 == WALLS && (walled.x || walled.z);
    (!is_open && !is_nook && (walls >= WALLS || is_street)).then_some(probe)
}

/// Of a room's sides, towards less and more of each axis, those where no wall was found.
fn sides_without_wall(bvh: &Bvh, room: &Probe) -> [BVec3; 2] {
    let far = Vec3::splat(0.99 * far(bvh));
    [room.position - room.bounds.min, room.bounds.max - room.position].map(|reach| reach.cmpge(far))
}

/// How many walls a room has, floor and ceiling counted.
fn wall_count(bvh: &Bvh, room: &Probe) -> u32 {
    6 - sides_without_wall(bvh, room).map(|sides| sides.bitmask().count_ones()).iter().sum::<u32>()
}

/// The freest place near a room's centre; `start` if nothing else is inside of the room.
fn middle(bvh: &Bvh, start: Vec3, bounds: Bounds, from_start: &Surroundings) -> Vec3 {
    // A side without a wall says nothing of where the middle is.
    let is_far = (bounds.max - bounds.min).cmpgt(Vec3::splat(far(bvh)));
    let centre = Vec3::select(is_far, start, bounds.centre());
    let half = Vec3::select(is_far, Vec3::ZERO, 0.5 * (bounds.max - bounds.min));
    let steps = [0.0, -0.25, 0.25];
    let offsets = steps.iter().flat_map(|x| steps.iter().flat_map(|y| steps.map(|z| Vec3::new(*x, *y, z)))).collect();
    let offsets: Vec<Vec3> = offsets;
    let rated = offsets.par_iter().filter_map(|offset| {
        let place = centre + *offset * half;
        let view = Surroundings::new(bvh, place, CANDIDATE_RAYS);
        let inside = view.backs > from_start.backs + 0.25;
        (!inside).then(|| (place, view.clearance - 0.5 * (*offset * half).length()))
    });
    rated.collect::<Vec<_>>().into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a }).map_or(start, |(place, _)| place)
}

/// A smooth surface that a path meets.
struct SmoothHit {
    /// A little off it, where rays go to all sides.
    place: Vec3,
    /// Of the hierarchy.
    triangle: usize,
}

/// Whether nothing lies between two places.
fn is_clear(bvh: &Bvh, from: Vec3, to: Vec3) -> bool {
    bvh.trace(from, to - from, 1.0, |_| true).is_none()
}

/// Places before the smooth surfaces that one random path meets.
fn smooth_met(bvh: &Bvh, camera: Vec3, path: u32, smooth: &impl Fn(usize) -> bool) -> Vec<SmoothHit> {
    let (mut met, mut o, mut axis) = (Vec::new(), camera, None);
    for reflection in 0..=REFLECTIONS {
        let d = path_direction(axis, path * (REFLECTIONS + 1) + reflection);
        let Some(hit) = bvh.trace(o, d, f32::INFINITY, |_| true) else { break };
        let place = o + hit.t * d;
        let side;
        (o, side) = before(bvh, o, d, &hit);
        if smooth(hit.triangle) {
            met.push(SmoothHit { place: place + 1e-3 * bvh.bounds().radius() * side, triangle: hit.triangle });
        }
        axis = Some(side);
    }
    met
}

#[cfg(test)]
#[path = "probes_tests.rs"]
pub mod tests;
