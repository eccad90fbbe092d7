//! A calm camera for those who watch: follows the head without its roll and its tremor, and shows only what the eye sees.
//!
//! It is cut out of the left eye's picture by a turn about that eye (`reference::reprojection`): a third view of the scene
//! would cost the headset half as much again as both eyes. So its position is the eye's: only its direction can be calm, which
//! is what shakes a picture; a head that moves shows true parallax.

use glam::{DMat3, DVec2, Mat3, Quat, Vec2, Vec3};

use crate::reference::reprojection::homography;
use crate::render::Eye;

/// Half of the vertical field of view at most, as a tangent: 60°, a usual one of windows.
const HALF_HEIGHT: f32 = 0.577_350_3;
/// The spring's frequency, rad/s. A critically damped one has come to 1 − (1 + ωt) e^(−ωt) of a step: 90 % after 0.177 s. It
/// lags 2/ω = 0.09 s behind a steady turn, and passes 16 % of a tremor of 8 Hz.
const FREQUENCY: f32 = 22.0;
/// The field of view leaves this much to each side of the eye's picture where it can, radians: so far the camera may lag.
const MARGIN: f32 = 0.09;
/// Seconds in which the field of view changes by 63 %.
const ZOOM_SECONDS: f32 = 0.6;
/// The smallest part of the field of view that is shown for the sake of the margin.
const LEAST_ZOOM: f32 = 0.6;
/// Steps of bisections.
const STEPS: u32 = 10;
/// Sines of the pitch from which on the horizon is given up, and at which it is: straight up and down there is none.
const STEEP: [f32; 2] = [0.87, 0.97];

/// What a frame of the headset was drawn with.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The left eye in the world.
    pub eye: Eye,
    /// What its lens hides: triangles in texture coordinates, v downwards.
    pub hidden: &'a [[f32; 2]],
    pub world_from_head: Quat,
    /// Since the frame before.
    pub seconds: f32,
    /// The user was moved: the camera is, too, at once.
    pub jumped: bool,
}

/// The calm camera, from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct Steady {
    /// `world_from_view` and angular velocity, rad/s; `None` before the first frame.
    state: Option<(Quat, Vec3)>,
    /// Part of the greatest field of view, as tangents.
    zoom: f32,
}

/// The calm camera of one frame: at the eye's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyView {
    /// Columns: right, up, backward.
    pub world_from_view: Mat3,
    /// Tangents to the right and upwards.
    pub half: Vec2,
}

impl Steady {
    /// Follows a frame for a window of this aspect, width over height.
    pub fn follow(&mut self, seen: &Seen<'_>, aspect: f32) -> SteadyView {
        let head = seen.world_from_head;
        let (rotation, is_new) = match self.state {
            Some((rotation, velocity)) if !seen.jumped => {
                let (rotation, velocity) = spring(rotation, velocity, head, seen.seconds);
                self.state = Some((rotation, velocity));
                (rotation, false)
            }
            _ => {
                self.state = Some((head, Vec3::ZERO));
                (head, true)
            }
        };
        let widest = Vec2::new(HALF_HEIGHT * aspect, HALF_HEIGHT);
        let wanted = zoom_with_margin(seen, head, widest);
        let share = if is_new { 1.0 } else { 1.0 - (-seen.seconds / ZOOM_SECONDS).exp() };
        self.zoom += (wanted - self.zoom) * share;
        let view = fitted(seen, [rotation, head], self.zoom * widest);
        // Where not even the head's own direction fits, the field of view grows again from what did.
        self.zoom = view.half.y / HALF_HEIGHT;
        view
    }
}

impl SteadyView {
    /// To texture coordinates of the eye's whole picture.
    pub fn uv_from_clip(&self, eye: &Eye) -> DMat3 {
        let view_from_world = Mat3::from_mat4(eye.world_from_view).transpose();
        let tangents = [eye.left, eye.right, eye.down, eye.up].map(f64::from);
        homography((view_from_world * self.world_from_view).as_dmat3(), self.half.as_dvec2(), tangents)
    }

    /// Whether all of it lies in the eye's picture, and nothing of it is hidden by the lens.
    fn is_seen(&self, seen: &Seen<'_>) -> bool {
        let uv_from_clip = self.uv_from_clip(&seen.eye);
        let corner = |(x, y): (f64, f64)| crate::reference::reprojection::source(uv_from_clip, DVec2::new(x, y));
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner);
        let inside = |uv: DVec2| uv.min_element() >= 0.0 && uv.max_element() <= 1.0;
        let mut quad = [Vec2::ZERO; 4];
        for (to, corner) in quad.iter_mut().zip(corners) {
            let Some(uv) = corner.filter(|uv| inside(*uv)) else { return false };
            *to = uv.as_vec2();
        }
        !seen.hidden.chunks_exact(3).any(|triangle| {
            let triangle = [0, 1, 2].map(|i| Vec2::from(triangle[i]));
            overlap(&quad, &triangle)
        })
    }
}

/// One step of a critically damped spring towards `target`, exact while that rests, so that it does not depend on the
/// frame rate.
fn spring(rotation: Quat, velocity: Vec3, target: Quat, seconds: f32) -> (Quat, Vec3) {
    let error = rotation * target.inverse();
    // The shorter way around.
    let error = (if error.w < 0.0 { -error } else { error }).to_scaled_axis();
    let slope = velocity + FREQUENCY * error;
    let decay = (-FREQUENCY * seconds).exp();
    let rest = (error + slope * seconds) * decay;
    let velocity = (velocity - FREQUENCY * seconds * slope) * decay;
    ((Quat::from_scaled_axis(rest) * target).normalize(), velocity)
}

/// The direction of a rotation with a level horizon, as far as there is one.
fn level(rotation: Quat) -> Mat3 {
    let (backward, own_up) = (rotation * Vec3::Z, rotation * Vec3::Y);
    let t = ((backward.y.abs() - STEEP[0]) / (STEEP[1] - STEEP[0])).clamp(0.0, 1.0);
    let keeps = t * t * (3.0 - 2.0 * t);
    let level_up = backward.cross(Vec3::Y.cross(backward)).try_normalize().unwrap_or(own_up);
    let up = level_up.lerp(own_up, keeps);
    let right = up.cross(backward).try_normalize().unwrap_or(rotation * Vec3::X);
    Mat3::from_cols(right, backward.cross(right), backward)
}

/// The part of the widest field of view that leaves the margin in all directions around the head's own.
fn zoom_with_margin(seen: &Seen<'_>, head: Quat, widest: Vec2) -> f32 {
    let upright = Quat::from_mat3(&level(head));
    let turned = [(MARGIN, MARGIN), (-MARGIN, MARGIN), (MARGIN, -MARGIN), (-MARGIN, -MARGIN)]
        .map(|(yaw, pitch)| level(upright * Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch)));
    let fits =
        |zoom: f32| turned.iter().all(|axes| SteadyView { world_from_view: *axes, half: zoom * widest }.is_seen(seen));
    greatest([LEAST_ZOOM, 1.0], fits)
}

/// The view between the calm rotation and the head's that is nearest to the calm one and seen; with a smaller field of view
/// if even the head's is not.
fn fitted(seen: &Seen<'_>, [calm, head]: [Quat; 2], half: Vec2) -> SteadyView {
    let at = |calmness: f32| level(head.slerp(calm, calmness));
    let view = |calmness: f32, half: Vec2| SteadyView { world_from_view: at(calmness), half };
    let calmness = greatest([0.0, 1.0], |calmness| view(calmness, half).is_seen(seen));
    if calmness > 0.0 || view(0.0, half).is_seen(seen) {
        return view(calmness, half);
    }
    view(0.0, half * greatest([1e-3, 1.0], |part| view(0.0, half * part).is_seen(seen)))
}

/// The greatest value in a range that fits, where smaller ones do if greater ones do; the least if none does.
fn greatest([mut least, most]: [f32; 2], fits: impl Fn(f32) -> bool) -> f32 {
    if fits(most) {
        return most;
    }
    let mut beyond = most;
    for _ in 0..STEPS {
        let middle = 0.5 * (least + beyond);
        if fits(middle) { least = middle } else { beyond = middle }
    }
    least
}

/// Whether two convex polygons have more than their borders in common: none of their sides separates them.
fn overlap(a: &[Vec2], b: &[Vec2]) -> bool {
    let extent = |polygon: &[Vec2], axis: Vec2| {
        let along = polygon.iter().map(|p| p.dot(axis));
        along.fold([f32::INFINITY, f32::NEG_INFINITY], |[least, most], at| [least.min(at), most.max(at)])
    };
    let separates = |axis: Vec2| {
        let ([a0, a1], [b0, b1]) = (extent(a, axis), extent(b, axis));
        a1 <= b0 || b1 <= a0
    };
    let sides = |polygon: &[Vec2]| {
        (0..polygon.len()).any(|i| separates((polygon[(i + 1) % polygon.len()] - polygon[i]).perp()))
    };
    // The upright box first: most triangles lie in corners.
    !separates(Vec2::X) && !separates(Vec2::Y) && !sides(a) && !sides(b)
}

#[cfg(test)]
#[path = "steady_tests.rs"]
mod tests;
