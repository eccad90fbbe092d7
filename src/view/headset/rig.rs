//! The rig: where the tracked play space stands in the scene, and how the user moves it (start, teleport, snap turn, grab).
//!
//! Pure. One metre of the room is one metre of the scene, the room's up is the scene's up, and nothing moves unless the
//! user asked for it. Poses are rigid; a head or a hand looks along its −Z.

use std::f32::consts::TAU;

use glam::{Mat4, Quat, Vec3};

use crate::scene::{Bounds, Camera};

/// Degrees of one snap turn.
pub const SNAP_DEGREES: f32 = 30.0;
/// Camera heights above the floor, metres, that count as a person's eye height: from a low chair to a tall man.
const PERSON_METRES: std::ops::RangeInclusive<f32> = 0.9..=2.3;
/// The arc's initial speed, m/s, and gravity, m/s².
const ARC_SPEED: f32 = 6.5;
const GRAVITY: f32 = 9.81;
/// Limits for a landing: distance along the floor, and elevation of the aim.
const FARTHEST_METRES: f32 = 7.0;
const STEEPEST_DEGREES: f32 = 70.0;
/// The longest flight of an arc, seconds.
const ARC_SECONDS: f32 = 3.0;
/// Points of an arc, its ends included.
pub const ARC_POINTS: usize = 33;
/// Seconds to fade to black, and back.
const BLINK_SECONDS: f32 = 0.1;
/// The radius, metres, above which a scene is a place and not an object to grab.
const LARGEST_OBJECT_METRES: f32 = 1.5;

/// The play space in the world: turned about +Y, moved, never tilted or scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// The play space's origin, on its floor.
    pub origin_world: Vec3,
    /// Radians about +Y, counter-clockwise seen from above.
    pub yaw: f32,
}

impl Rig {
    /// Places the user at a scene's camera, facing its direction. If the camera is at a person's eye height above `floor`, the
    /// room's floor is aligned with it, as in a room or a church; otherwise, as with a teapot, the eyes are placed at the
    /// camera.
    pub fn start(camera: &Camera, floor: f32, play_from_head: &Mat4) -> Self {
        let eyes = Self::seated(camera, play_from_head);
        if PERSON_METRES.contains(&(camera.position.y - floor)) {
            return Self { origin_world: eyes.origin_world.with_y(floor), ..eyes };
        }
        eyes
    }

    /// Places the head at the camera, facing its direction: the seated position.
    pub fn seated(camera: &Camera, play_from_head: &Mat4) -> Self {
        let yaw = yaw_of(camera.target - camera.position) - yaw_of(-play_from_head.z_axis.truncate());
        let rig = Self { origin_world: Vec3::ZERO, yaw: yaw.rem_euclid(TAU) };
        let head_world = rig.world_from_play().transform_point3(head_of(play_from_head));
        Self { origin_world: camera.position - head_world, ..rig }
    }

    /// Rigid.
    pub fn world_from_play(&self) -> Mat4 {
        Mat4::from_rotation_translation(Quat::from_rotation_y(self.yaw), self.origin_world)
    }

    /// Height of the room's floor in the world.
    pub fn floor(&self) -> f32 {
        self.origin_world.y
    }

    /// Turns about the head: `steps` of [`SNAP_DEGREES`], positive to the right (clockwise seen from above).
    pub fn snap_turn(&mut self, steps: i32, play_from_head: &Mat4) {
        let head_play = head_of(play_from_head);
        let before = self.world_from_play().transform_point3(head_play);
        self.yaw = (self.yaw - (steps as f32 * SNAP_DEGREES).to_radians()).rem_euclid(TAU);
        self.origin_world += before - self.world_from_play().transform_point3(head_play);
    }

    /// Moves the floor under the head to a point of the world.
    pub fn teleport(&mut self, landing_world: Vec3, play_from_head: &Mat4) {
        let under_head = head_of(play_from_head).with_y(0.0);
        self.origin_world += landing_world - self.world_from_play().transform_point3(under_head);
    }
}

/// A teleport's arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// World positions, from the hand on.
    pub points: [Vec3; ARC_POINTS],
    /// The landing on the floor, if it is allowed.
    pub landing: Option<Vec3>,
}

/// A parabola from the hand along its −Z to the floor of height `floor`; no landing if it is too steep or too far.
pub fn teleport_arc(world_from_hand: &Mat4, floor: f32) -> Arc {
    let start = world_from_hand.w_axis.truncate();
    let velocity = -world_from_hand.z_axis.truncate().normalize_or(Vec3::Z) * ARC_SPEED;
    // start.y + v t − g/2 t² = floor: the later of both times.
    let discriminant = velocity.y * velocity.y + 2.0 * GRAVITY * (start.y - floor);
    let seconds = (velocity.y + discriminant.max(0.0).sqrt()) / GRAVITY;
    let meets = discriminant >= 0.0 && seconds > 0.0 && seconds <= ARC_SECONDS;
    let seconds = if meets { seconds } else { ARC_SECONDS };
    let at = |t: f32| start + velocity * t - Vec3::Y * (0.5 * GRAVITY * t * t);
    let points = std::array::from_fn(|i| at(seconds * i as f32 / (ARC_POINTS - 1) as f32));
    let landing = points[ARC_POINTS - 1].with_y(floor);
    let near = landing.distance(start.with_y(floor)) <= FARTHEST_METRES;
    let flat = velocity.y <= ARC_SPEED * STEEPEST_DEGREES.to_radians().sin();
    Arc { points, landing: (meets && near && flat).then_some(landing) }
}

/// The short fade during which a teleport happens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TeleportFade {
    target: Option<Vec3>,
    /// Seconds since the release; nothing is faded after the end.
    seconds: Option<f32>,
}

impl TeleportFade {
    /// Starts a fade to black and back, with a move to `landing_world` in between; replaces a teleport that has not moved the
    /// user yet.
    pub fn begin(&mut self, landing_world: Vec3) {
        let seconds = self.seconds.filter(|s| *s < BLINK_SECONDS).unwrap_or(0.0);
        *self = Self { target: Some(landing_world), seconds: Some(seconds) };
    }

    /// Advances by a frame. Returns the darkness, 0 to 1, and, in one frame, the place to move to.
    pub fn step(&mut self, frame_seconds: f32) -> (f32, Option<Vec3>) {
        let Some(seconds) = self.seconds.map(|s| s + frame_seconds.max(0.0)) else { return (0.0, None) };
        let arrived = if seconds >= BLINK_SECONDS { self.target.take() } else { None };
        // The frame in which the user is moved is black, however long it was.
        let seconds = if arrived.is_some() { BLINK_SECONDS } else { seconds };
        self.seconds = (seconds < 2.0 * BLINK_SECONDS).then_some(seconds);
        let fade = 1.0 - (seconds - BLINK_SECONDS).abs() / BLINK_SECONDS;
        (fade.max(0.0), arrived)
    }
}

/// Whether a scene is an object that can be taken into the hand. Moving a whole room would move what the user stands in.
pub fn is_object(bounds: Bounds) -> bool {
    let radius = bounds.radius();
    radius > 0.0 && radius <= LARGEST_OBJECT_METRES
}

/// The models in a hand: they turn and move with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grab {
    hand_from_models: Mat4,
}

impl Grab {
    /// Grabs models at `world_from_models`.
    pub fn begin(world_from_hand: &Mat4, world_from_models: &Mat4) -> Self {
        Self { hand_from_models: world_from_hand.inverse() * *world_from_models }
    }

    /// `world_from_models` with the hand here; rigid, however often it goes from hand to hand.
    pub fn models(&self, world_from_hand: &Mat4) -> Mat4 {
        let (_, rotation, translation) = (*world_from_hand * self.hand_from_models).to_scale_rotation_translation();
        Mat4::from_rotation_translation(rotation.normalize(), translation)
    }
}

/// Models turned on the spot about the upright axis through `centre_world`: the turntable.
pub fn turned_models(world_from_models: &Mat4, centre_world: Vec3, degrees: f32) -> Mat4 {
    let turn = Mat4::from_rotation_y(degrees.to_radians());
    Mat4::from_translation(centre_world) * turn * Mat4::from_translation(-centre_world) * *world_from_models
}

fn head_of(play_from_head: &Mat4) -> Vec3 {
    play_from_head.w_axis.truncate()
}

/// Of a direction, 0 for −Z; looking straight up or down counts as −Z.
fn yaw_of(direction: Vec3) -> f32 {
    let flat = direction.with_y(0.0);
    if flat.length() <= 1e-6 * direction.length() { 0.0 } else { (-flat.x).atan2(-flat.z) }
}

#[cfg(test)]
#[path = "rig_tests.rs"]
mod tests;
