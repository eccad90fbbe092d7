//! Shapes that furniture is made of: boxes, lathed bodies, bent tubes. UVs are metres × repeats per metre.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};

use super::obj::{Obj, Point};

/// A flat four-sided sheet: `right` × `up` points outwards. Its texture starts at `uv_origin`, in metres.
pub struct Sheet {
    pub corner: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub uv_origin: DVec2,
    pub repeats_per_metre: f64,
}

impl Sheet {
    /// Adds it as `columns` × `rows` cells.
    pub fn build(&self, obj: &mut Obj, columns: usize, rows: usize) {
        let size = DVec2::new(self.right.length(), self.up.length());
        obj.surface(columns, rows, |u, v| Point {
            position: self.corner + self.right * u + self.up * v,
            normal: self.right.cross(self.up),
            uv: (self.uv_origin + DVec2::new(u, v) * size) * self.repeats_per_metre,
        });
    }
}

/// A box from `min` to `max`; the texture's v follows each face's longer side, as grain does in wood.
pub fn block(obj: &mut Obj, min: DVec3, max: DVec3, repeats_per_metre: f64) {
    let size = max - min;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let faces = [
        (DVec3::new(min.x, min.y, max.z), x, y),
        (DVec3::new(max.x, min.y, min.z), -x, y),
        (max - y, -z, y),
        (min, z, y),
        (max - x, x, -z),
        (min, x, z),
    ];
    for (number, (corner, mut right, mut up)) in faces.into_iter().enumerate() {
        let mut start = corner;
        if right.length() > up.length() {
            // A quarter turn: the old right becomes up.
            start += right;
            (right, up) = (up, -right);
        }
        // Every face shows another part of the texture.
        let uv_origin = DVec2::splat(0.37 * number as f64) + DVec2::new(min.x + min.z, min.y);
        Sheet { corner: start, right, up, uv_origin, repeats_per_metre }.build(obj, 1, 1);
    }
}

/// A surface of revolution around local y. `profile` holds (radius, y) so that the outside is on the right hand of the
/// way along it; a point named twice makes an edge.
pub fn lathe(obj: &mut Obj, world_from_local: DAffine3, profile: &[[f64; 2]], slices: usize, repeats_per_metre: f64) {
    let points: Vec<DVec2> = profile.iter().map(|p| DVec2::from_array(*p)).collect();
    let girth = TAU * points.iter().map(|p| p.x).fold(0.0, f64::max);
    let repeats_around = (girth * repeats_per_metre).round().max(1.0);
    let mut distance = 0.0;
    for (i, pair) in points.windows(2).enumerate() {
        let (a, b) = (pair[0], pair[1]);
        let length = a.distance(b);
        if length == 0.0 {
            continue;
        }
        let normals = [profile_normal(&points, i, i), profile_normal(&points, i, i + 1)];
        obj.surface(slices, 1, |u, v| {
            let (sin, cos) = (u * TAU).sin_cos();
            let (p, n) = (a.lerp(b, v), normals[0].lerp(normals[1], v));
            let around = |p: DVec2| DVec3::new(p.x * sin, p.y, p.x * cos);
            let uv = DVec2::new(u * repeats_around, (distance + v * length) * repeats_per_metre);
            Point { position: around(p), normal: around(n), uv }.transformed(world_from_local)
        });
        distance += length;
    }
}

/// The normal of segment `segment`, smoothed with its neighbour at point `end` (one of its two ends).
fn profile_normal(points: &[DVec2], segment: usize, end: usize) -> DVec2 {
    let normal_of = |i: usize| {
        let along = (points[i + 1] - points[i]).normalize_or_zero();
        DVec2::new(along.y, -along.x)
    };
    let own = normal_of(segment);
    let neighbour = if end == segment { segment.checked_sub(1) } else { Some(segment + 1) };
    let at_axis = points[end].x == 0.0;
    match neighbour.filter(|i| i + 1 < points.len()) {
        _ if at_axis => DVec2::new(0.0, own.y.signum()),
        // The neighbour of a doubled point has no length, so its normal is zero: an edge.
        Some(i) => own + normal_of(i),
        None => own,
    }
}

/// A tube of round section along `path` (at least two points, in a plane whose normal is `side`).
pub fn tube(
    obj: &mut Obj,
    world_from_local: DAffine3,
    path: &[DVec3],
    side: DVec3,
    radius: f64,
    slices: usize,
    repeats_per_metre: f64,
) {
    let tangent = |i: usize| (path[(i + 1).min(path.len() - 1)] - path[i.saturating_sub(1)]).normalize_or_zero();
    let mut distance = 0.0;
    for i in 0..path.len() - 1 {
        let length = path[i].distance(path[i + 1]);
        obj.surface(slices, 1, |u, v| {
            // The surface calls with v = 0 or 1 only.
            let end = if v == 0.0 { i } else { i + 1 };
            let (sin, cos) = (u * TAU).sin_cos();
            let normal = side * cos + tangent(end).cross(side) * sin;
            let uv = DVec2::new(u * TAU * radius, distance + v * length) * repeats_per_metre;
            Point { position: path[end] + normal * radius, normal, uv }.transformed(world_from_local)
        });
        distance += length;
    }
}
