//! Boxes around probes: parallax and influence, in f64; twins of `glsl/probe_box.glsl`.

use glam::DVec3;

/// Where a ray from p, towards d of any length, leaves a box: Lagarde and Zanuttini, "Local Image-based Lighting With
/// Parallax-corrected Cubemaps" (2012). From outside of the box the ray begins at its nearest point.
pub fn box_exit(p: DVec3, d: DVec3, [low, high]: [DVec3; 2]) -> DVec3 {
    let start = p.clamp(low, high);
    let along = |axis: usize| match d[axis] {
        0.0 => f64::INFINITY,
        d if d > 0.0 => (high[axis] - start[axis]) / d,
        d => (low[axis] - start[axis]) / d,
    };
    start + (0..3).map(along).fold(f64::INFINITY, f64::min) * d
}

/// Whether what a ray from p along a unit direction meets after t metres is part of the image that is taken to lie on a box: nothing
/// is that lies nearer than three quarters of the way.
pub fn is_in_image(p: DVec3, d: DVec3, t: f64, bounds: [DVec3; 2]) -> bool {
    t > 0.75 * p.distance(box_exit(p, d, bounds))
}

/// Share of a point's mirror image that a probe gives: 1 in its box, 0 from `border` metres outside of it on.
pub fn probe_weight(p: DVec3, [low, high]: [DVec3; 2], border: f64) -> f64 {
    let part = ((low - p).max(p - high).max(DVec3::ZERO).length() / border).min(1.0);
    1.0 - part * part * (3.0 - 2.0 * part)
}
