//! The Utah teapot, tessellated: analytic normals, closed poles, one texture density over the whole pot.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DAffine3, DVec2, DVec3};

use super::newell::{self, Patch};
use super::obj::{Material, Obj, Point};

/// The pot's height with its knob.
const HEIGHT_METRES: f64 = 0.18;
const HEIGHT_UNITS: f64 = 3.15;
/// Newell's units that one repeat of the texture covers: a quarter of the belly's girth.
const UNITS_PER_REPEAT: f64 = TAU * 2.0 / 4.0;

/// Segments per patch: around and along it.
#[derive(Clone, Copy)]
pub struct Segments {
    pub around: usize,
    pub along: usize,
}

/// The pot alone, about 15,000 triangles.
pub fn model() -> Obj {
    let mut obj = Obj::default();
    obj.object("teapot", "oxidised-gold");
    pot(&mut obj, DAffine3::IDENTITY, Segments { around: 15, along: 16 });
    obj
}

/// Oxidised gold.
pub fn materials() -> Vec<Material> {
    vec![Material {
        name: "oxidised-gold",
        albedo: [1.0; 3],
        metallic: 1.0,
        roughness: 1.0,
        maps: Some("oxidised-gold"),
    }]
}

/// The pot, standing on local y = 0 around the y axis, handle towards −x, spout towards +x.
pub fn pot(obj: &mut Obj, world_from_pot: DAffine3, segments: Segments) {
    let Segments { around, along } = segments;
    let mut place = |rows: usize, at: &dyn Fn(f64, f64) -> Point| {
        obj.surface(around, rows, |u, v| y_up(at(u, v)).transformed(world_from_pot));
    };
    for turn in 0..4 {
        let quarters =
            |parts: &[[newell::Ring; 4]]| parts.iter().map(|p| Part::new(newell::quarter(p, turn))).collect();
        let turns = |u: f64| turn as f64 + u;
        for part in chain(quarters(&newell::BODY)) {
            place(along, &|u, v| part.point(u, v, DVec2::new(turns(u), part.distance(v) / UNITS_PER_REPEAT)));
        }
        let lid = chain(quarters(&newell::LID));
        let knob = lid.iter().map(|part| part.length).sum::<f64>();
        for part in &lid {
            place(along, &|u, v| part.point(u, v, disc(turns(u), knob - part.distance(v))));
        }
        for part in chain(quarters(&newell::BOTTOM)) {
            place(along, &|u, v| part.point(u, v, disc(-turns(u), part.distance(v))));
        }
        place(1, &|u, v| groove(turn, u, v));
    }
    for (hoops, half_girth) in [(&newell::HANDLE, 0.7), (&newell::SPOUT, 1.2)] {
        for side in [-1.0, 1.0] {
            for part in chain(hoops.iter().map(|p| Part::new(newell::half(p, side))).collect()) {
                place(along, &|u, v| {
                    // Both halves count from the inner edge: mirrored, so that the texture meets itself on both seams.
                    let from_inner_edge = if side < 0.0 { u } else { 1.0 - u };
                    let uv = DVec2::new(from_inner_edge * half_girth, part.distance(v)) / UNITS_PER_REPEAT;
                    part.point(u, v, uv)
                });
            }
        }
    }
    place(1, &spout_level);
}

/// A patch in a chain of patches, with arc lengths along v.
struct Part {
    patch: Patch,
    /// Length of the patch, and of those before it in the chain.
    length: f64,
    before: f64,
}

impl Part {
    fn new(patch: Patch) -> Self {
        let mut part = Self { patch, length: 0.0, before: 0.0 };
        part.length = part.distance(1.0);
        part
    }

    /// Arc length from the chain's start to `v`, in Newell's units.
    fn distance(&self, v: f64) -> f64 {
        const STEPS: usize = 64;
        let at = |i: usize| newell::evaluate(&self.patch, 0.5, v * i as f64 / STEPS as f64).0;
        self.before + (0..STEPS).map(|i| at(i).distance(at(i + 1))).sum::<f64>()
    }

    /// The patch's point; where it closes to a pole, the normal is the axis that the pole lies on.
    fn point(&self, u: f64, v: f64, uv: DVec2) -> Point {
        let (position, du, dv) = newell::evaluate(&self.patch, u, v);
        let normal = if du.length() > 1e-9 {
            du.cross(dv)
        } else {
            let (_, du, dv) = newell::evaluate(&self.patch, u, v.clamp(0.01, 0.99));
            DVec3::Z * du.cross(dv).z.signum()
        };
        Point { position, normal, uv }
    }
}

/// Lets each part's distances start where the one before it ends.
fn chain(mut parts: Vec<Part>) -> Vec<Part> {
    let mut before = 0.0;
    for part in &mut parts {
        part.before = before;
        before += part.length;
    }
    parts
}

/// Texture coordinates of lid and bottom: a disc around the pole, without seam or pinch.
fn disc(quarter_turns: f64, distance: f64) -> DVec2 {
    DVec2::from_angle(quarter_turns * FRAC_PI_2) * (distance / UNITS_PER_REPEAT)
}

/// Newell's lid is a little smaller than the rim: a flat ring closes what would be a slit into the empty pot.
fn groove(turn: usize, u: f64, v: f64) -> Point {
    let edge = |rings, v| newell::evaluate(&newell::quarter(rings, turn), u, v).0;
    let (rim, lid) = (edge(&newell::BODY[2], 1.0), edge(&newell::LID[0], 0.0));
    let position = rim.lerp(lid, v);
    Point { position, normal: DVec3::Z, uv: position.truncate() / UNITS_PER_REPEAT }
}

/// A level surface just inside the lip: Newell's spout is an open tube.
fn spout_level(u: f64, v: f64) -> Point {
    let left = newell::evaluate(&newell::half(&newell::SPOUT[1], -1.0), u, 1.0).0;
    let right = DVec3::new(left.x, -left.y, left.z);
    let position = left.lerp(right, v);
    Point { position, normal: DVec3::Z, uv: position.truncate() / UNITS_PER_REPEAT }
}

/// Newell's z up to our y up, his units to metres.
fn y_up(point: Point) -> Point {
    let turned = |p: DVec3| DVec3::new(p.x, p.z, -p.y);
    Point {
        position: turned(point.position) * (HEIGHT_METRES / HEIGHT_UNITS),
        normal: turned(point.normal),
        uv: point.uv,
    }
}
