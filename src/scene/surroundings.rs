//! What rays to all sides of a place meet, and the walls around it by that.

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::{Bvh, Hit};
use super::mesh::Bounds;
use crate::reference::probe::box_exit;

/// Share of rays to the sky from which on a place is open: what it mirrors is mostly the panorama.
const OPEN: f32 = 1.0 / 3.0;
/// Of the rays that meet surfaces which face a place from one side, each weighted by its length, the share that ends before or at
/// the wall: furniture is nearer, what is seen through doors is farther. At first, when a far room counts for more than its door
/// covers; and then, when no ray counts for more than to where the wall was found first.
const WALL: [f32; 2] = [0.55, 0.7];
/// Cosine from which on a surface faces a side of the box, and how many rays have to meet such.
pub const FACES: f32 = 0.7;
const FACING: usize = 8;
/// Of the rays that come as far as a wall, the share that goes on beyond this multiple of its distance from which on it is none: cars
/// in a street, and pillars before a wall, face a place, too.
const OPENING: f32 = 0.7;
const BEYOND: f32 = 1.1;
/// Radii of the scene that a side without a wall is away.
const NO_WALL: f32 = 10.0;

/// What a ray meets.
#[derive(Clone, Copy)]
pub struct Met {
    pub d: Vec3,
    pub t: f32,
    /// The triangle's normal, towards where the ray came from.
    n: Vec3,
    back: bool,
}

/// What rays to all sides of a place meet.
pub struct Surroundings {
    pub from: Vec3,
    pub met: Vec<Met>,
    /// Directions in which rays meet nothing.
    open: Vec<Vec3>,
    /// Share of the rays that meet a triangle's back.
    pub backs: f32,
    /// The distance that one ray in twenty does not reach.
    pub clearance: f32,
}

impl Surroundings {
    pub fn new(bvh: &Bvh, from: Vec3, rays: u32) -> Self {
        Self::around(bvh, from, Bounds::of([from]), rays)
    }

    /// Rays begin where they leave the box that `from` is in.
    pub fn around(bvh: &Bvh, from: Vec3, within: Bounds, rays: u32) -> Self {
        let trace = |i: u32| {
            let d = spiral(i, rays);
            let begin = exit(from, d, within);
            let hit = bvh.trace(begin, d, f32::INFINITY, |_| true).ok_or(d)?;
            let n = normal(bvh, &hit);
            let back = n.dot(d) > 0.0;
            Ok(Met { d, t: begin.distance(from) + hit.t, n: if back { -n } else { n }, back })
        };
        let all: Vec<Result<Met, Vec3>> = (0..rays).into_par_iter().map(trace).collect();
        let met: Vec<Met> = all.iter().filter_map(|met| met.ok()).collect();
        let mut distances: Vec<f32> = met.iter().map(|met| met.t).collect();
        distances.sort_by(f32::total_cmp);
        Self {
            from,
            open: all.iter().filter_map(|met| met.err()).collect(),
            backs: met.iter().filter(|met| met.back).count() as f32 / rays as f32,
            clearance: distances.get(distances.len() / 20).copied().unwrap_or(0.0),
            met,
        }
    }

    fn rays(&self) -> usize {
        self.met.len() + self.open.len()
    }

    pub fn is_open(&self) -> bool {
        self.open.len() as f32 > OPEN * self.rays() as f32
    }

    /// The box whose sides are the walls; those without one are [`far`] away.
    pub fn bounds(&self, bvh: &Bvh) -> Bounds {
        let mut reach =
            [-1.0, 1.0].map(|sign| Vec3::from(std::array::from_fn(|axis| self.wall(bvh, axis, sign, false))));
        for [across, along] in [[0, 2], [2, 0]] {
            let is_street = reach.iter().all(|reach| reach[across] < far(bvh));
            for (reach, sign) in reach.iter_mut().zip([-1.0, 1.0]) {
                if is_street && reach[along] == far(bvh) {
                    reach[along] = self.wall(bvh, along, sign, true);
                }
            }
        }
        Bounds { min: self.from - reach[0], max: self.from + reach[1] }
    }

    /// How far it is along an axis to where most of what faces the place from there ends. `below_sky`: at a street's end, which a
    /// house closes though rays go on above it.
    fn wall(&self, bvh: &Bvh, axis: usize, sign: f32, below_sky: bool) -> f32 {
        let distance = |met: &Met| met.d[axis] * sign * met.t;
        let along = |met: &&Met| distance(met) > 0.0 && met.d.abs().max_position() == axis;
        let faces = |met: &&Met| distance(met) > 0.0 && met.n[axis] * sign < -FACES;
        // A sixth of all rays go to each side; where half of them meet nothing, there is no wall.
        if self.met.iter().filter(along).count() < self.rays() / 12 {
            return far(bvh);
        }
        let is_faced = self.met.iter().filter(faces).count() >= FACING;
        let mut distances: Vec<f32> =
            self.met.iter().filter(|met| if is_faced { faces(met) } else { along(met) }).map(distance).collect();
        distances.sort_by(f32::total_cmp);
        while let Some(wall) = most_end(&distances) {
            if !self.goes_on(axis, sign, wall, below_sky) {
                return wall;
            }
            distances.retain(|distance| *distance > BEYOND * wall);
            if distances.len() < FACING {
                break;
            }
        }
        far(bvh)
    }

    /// Whether most rays that come so far along an axis as a wall is go on; `below_sky`: of those to the sky such as pass between
    /// what is met there.
    fn goes_on(&self, axis: usize, sign: f32, wall: f32, below_sky: bool) -> bool {
        let distance = |met: &&Met| met.d[axis] * sign * met.t;
        let reaching = self.met.iter().filter(|met| distance(met) > wall / BEYOND);
        let (beyond, ended): (Vec<&Met>, Vec<&Met>) = reaching.partition(|met| distance(met) > BEYOND * wall);
        let slopes = |d: &Vec3| *d / d[axis].abs();
        let span = Bounds::of(ended.iter().map(|met| slopes(&met.d)));
        let counts = |d: &&Vec3| d[axis] * sign > 0.0 && (!below_sky || span.contains(Bounds::of([slopes(d)])));
        let went = (beyond.len() + self.open.iter().filter(counts).count()) as f32;
        went > OPENING * (went + ended.len() as f32)
    }
}

/// The wall by what faces a place at these ascending distances: see [`WALL`].
fn most_end(distances: &[f32]) -> Option<f32> {
    let end = |most: f32, share: f32| {
        let mut left = share * distances.iter().map(|distance| distance.min(most)).sum::<f32>();
        let ends = |distance: &&f32| {
            left -= distance.min(most);
            left <= 0.0
        };
        distances.iter().find(ends).or(distances.last()).copied()
    };
    WALL.into_iter().try_fold(f32::INFINITY, end)
}

/// How far a side without a wall is away.
pub fn far(bvh: &Bvh) -> f32 {
    NO_WALL * bvh.bounds().radius()
}

/// Where a ray leaves a box that it begins in.
pub fn exit(from: Vec3, d: Vec3, within: Bounds) -> Vec3 {
    box_exit(from.as_dvec3(), d.as_dvec3(), [within.min.as_dvec3(), within.max.as_dvec3()]).as_vec3()
}

/// Directions along a spiral over the sphere: Roberts, "How to evenly distribute points on a sphere" (2018).
pub fn spiral(i: u32, count: u32) -> Vec3 {
    let (up, longitude) = (1.0 - (2.0 * i as f32 + 1.0) / count as f32, i as f32 * 2.399_963_2);
    Vec3::new(longitude.cos(), 0.0, longitude.sin()) * (1.0 - up * up).sqrt() + up * Vec3::Y
}

pub fn normal(bvh: &Bvh, hit: &Hit) -> Vec3 {
    let [a, b, c] = bvh.triangles()[hit.triangle].corners.map(Vec3::from);
    (b - a).cross(c - a).normalize_or_zero()
}
