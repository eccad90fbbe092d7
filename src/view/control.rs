//! Camera control: from drags, wheel and held keys to an eye, orbiting about a point or flying. Independent of the window.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Mat3, Mat4, Vec2, Vec3};

use crate::render::Eye;
use crate::scene::{Bounds, Camera};

/// The rotation of a drag over the picture's height, radians.
const ORBIT_RADIANS: f32 = PI;
const LOOK_RADIANS: f32 = FRAC_PI_2;
/// The factor of one notch of the wheel, on the distance (orbit) or the speed (fly).
const ZOOM_PER_NOTCH: f32 = 0.9;
const SPEED_PER_NOTCH: f32 = 1.25;
/// Scene sizes per second.
const FLY_SPEED: f32 = 0.5;
const FAST: f32 = 4.0;
/// Limits of the distance in scene sizes, and of the speed in scene sizes per second.
const NEAREST: f32 = 1e-3;
const FARTHEST: f32 = 100.0;

/// The mode of camera control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Drags turn the camera about a point; the wheel changes the distance.
    Orbit,
    /// Drags turn the head, keys move.
    Fly,
}

/// A camera that the user controls. Both modes share one pose, so changing the mode moves nothing.
#[derive(Clone, Debug)]
pub struct Control {
    mode: Mode,
    /// The point looked at, world.
    target: Vec3,
    /// Radians about +Y, counter-clockwise seen from above; 0 looks along −Z.
    yaw: f32,
    /// Radians upwards, −π/2 to π/2. The axes come from the angles, so looking straight down is no special case.
    pitch: f32,
    /// Metres from the eye to the target.
    distance: f32,
    /// Limits of the distance, metres.
    nearest: f32,
    farthest: f32,
    vertical_fov_degrees: f32,
    /// Scene sizes per second.
    speed: f32,
    centre: Vec3,
    /// The scene's size, metres.
    size: f32,
}

impl Control {
    /// Starts at a scene's camera; the scene's `bounds` set speed and range.
    pub fn new(camera: &Camera, bounds: Bounds) -> Self {
        let distance = camera.position.distance(camera.target);
        let radius = bounds.radius();
        let known = radius > 0.0 && radius.is_finite();
        let mut control = Self {
            mode: Mode::Orbit,
            target: camera.target,
            yaw: 0.0,
            pitch: 0.0,
            distance,
            nearest: distance,
            farthest: distance,
            vertical_fov_degrees: camera.vertical_fov_degrees,
            speed: FLY_SPEED,
            centre: if known { bounds.centre() } else { camera.target },
            size: if known { radius } else { distance },
        };
        control.set_camera(camera);
        control
    }

    /// Goes to a camera of the same scene.
    pub fn set_camera(&mut self, camera: &Camera) {
        let backward = (camera.position - camera.target).try_normalize().unwrap_or(Vec3::Z);
        self.target = camera.target;
        self.distance = camera.position.distance(camera.target);
        self.nearest = NEAREST * self.size.min(self.distance);
        self.farthest = FARTHEST * self.size.max(self.distance);
        self.pitch = -backward.y.clamp(-1.0, 1.0).asin();
        self.yaw = backward.x.atan2(backward.z);
        self.vertical_fov_degrees = camera.vertical_fov_degrees;
        self.speed = FLY_SPEED;
    }

    /// The current mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Orbit to fly and back.
    pub fn switch_mode(&mut self) {
        self.mode = match self.mode {
            Mode::Orbit => Mode::Fly,
            Mode::Fly => Mode::Orbit,
        };
    }

    /// A drag with the turning button, in picture heights, y downwards.
    pub fn turn(&mut self, drag: Vec2) {
        let position = self.position();
        let radians = drag * if self.mode == Mode::Orbit { ORBIT_RADIANS } else { LOOK_RADIANS };
        self.yaw = (self.yaw - radians.x).rem_euclid(TAU);
        self.pitch = (self.pitch - radians.y).clamp(-FRAC_PI_2, FRAC_PI_2);
        if self.mode == Mode::Fly {
            self.target = position - self.axes().z_axis * self.distance;
        }
    }

    /// A drag with the panning button, in picture heights, y downwards: what lies at the target's depth follows.
    pub fn pan(&mut self, drag: Vec2) {
        let height = 2.0 * self.distance * (0.5 * self.vertical_fov_degrees.to_radians()).tan();
        let axes = self.axes();
        self.move_target((axes.y_axis * drag.y - axes.x_axis * drag.x) * height);
    }

    /// Turns of the wheel, positive away from the hand: nearer while orbiting, faster while flying.
    pub fn wheel(&mut self, notches: f32) {
        match self.mode {
            Mode::Orbit => {
                let wanted = self.distance * ZOOM_PER_NOTCH.powf(notches);
                self.distance = wanted.clamp(self.nearest, self.farthest);
            }
            Mode::Fly => self.speed = (self.speed * SPEED_PER_NOTCH.powf(notches)).clamp(NEAREST, FARTHEST),
        }
    }

    /// Moves for a time: `held` is right, up (the world's) and forward, each −1 to 1. Only while flying.
    pub fn step(&mut self, held: Vec3, fast: bool, seconds: f32) {
        if self.mode == Mode::Fly {
            let axes = self.axes();
            let direction = axes.x_axis * held.x + Vec3::Y * held.y - axes.z_axis * held.z;
            let speed = self.speed * self.size * if fast { FAST } else { 1.0 };
            self.move_target(direction.clamp_length_max(1.0) * (speed * seconds));
        }
    }

    /// The eye, for a picture of this width over height.
    pub fn eye(&self, aspect: f32) -> Eye {
        let world_from_view = Mat4::from(Affine3A::from_mat3_translation(self.axes(), self.position()));
        Eye::symmetric(world_from_view, self.vertical_fov_degrees, aspect, self.distance)
    }

    /// The present view as a camera of a scene.
    pub fn camera(&self, name: &str) -> Camera {
        let (position, target) = (self.position(), self.target);
        Camera { name: name.to_owned(), position, target, vertical_fov_degrees: self.vertical_fov_degrees }
    }

    /// World position, metres.
    pub fn position(&self) -> Vec3 {
        self.target + self.axes().z_axis * self.distance
    }

    /// Right, up, backward.
    fn axes(&self) -> Mat3 {
        Mat3::from_rotation_y(self.yaw) * Mat3::from_rotation_x(self.pitch)
    }

    /// Keeps the eye near enough to the scene for the precision of f32.
    fn move_target(&mut self, by: Vec3) {
        let reach = (FARTHEST * self.size).max(self.target.distance(self.centre));
        self.target = self.centre + (self.target + by - self.centre).clamp_length_max(reach);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(position: Vec3, target: Vec3) -> Camera {
        Camera { name: "test".into(), position, target, vertical_fov_degrees: 45.0 }
    }

    fn bounds(radius: f32) -> Bounds {
        let corner = Vec3::splat(radius / 3f32.sqrt());
        Bounds { min: -corner, max: corner }
    }

    fn control() -> Control {
        Control::new(&camera(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.5, 0.0)), bounds(1.0))
    }

    fn ndc(control: &Control, world: Vec3) -> Vec3 {
        let clip = control.eye(1.5).clip_from_world() * world.extend(1.0);
        clip.truncate() / clip.w
    }

    #[test]
    fn it_starts_exactly_where_the_scenes_camera_is() {
        let far = Vec3::new(-3.0, 0.2, 1.0);
        for position in [Vec3::new(1.0, 2.0, 3.0), far, Vec3::new(0.0, 4.0, 0.0), Vec3::new(0.0, -4.0, 0.0)] {
            let camera = camera(position, Vec3::new(0.0, 0.5, 0.0));
            let (ours, its) = (Control::new(&camera, bounds(1.0)).eye(1.5), Eye::of_camera(&camera, 1.5));
            assert!(ours.world_from_view.abs_diff_eq(its.world_from_view, 2e-6), "{position}: {ours:?} {its:?}");
            assert_eq!((ours.up, ours.right), (its.up, its.right));
        }
    }

    #[test]
    fn orbiting_keeps_target_distance_and_uprightness_even_over_the_poles() {
        let mut control = control();
        let (target, distance) = (control.target, control.distance);
        let mut before = control.eye(1.0).world_from_view;
        for i in 0..2000 {
            // Small steps that repeatedly reach both poles.
            control.turn(Vec2::new(0.004, if (i / 300) % 2 == 0 { 0.005 } else { -0.005 }));
            let now = control.eye(1.0).world_from_view;
            let axes = Mat3::from_mat4(now);
            assert!((axes.determinant() - 1.0).abs() < 1e-5 && axes.y_axis.y >= -1e-6);
            let cosine = 0.5
                * ((Mat3::from_mat4(before).transpose() * axes).to_cols_array_2d().iter().enumerate())
                    .map(|(i, column)| column[i])
                    .sum::<f32>()
                - 0.5;
            assert!(cosine > 0.0065 * -ORBIT_RADIANS + 1.0, "step {i} jumps: cos {cosine}");
            before = now;
        }
        assert!(control.position().distance(target) - distance < 1e-5);
        assert!(ndc(&control, target).truncate().length() < 1e-4);
    }

    #[test]
    fn dragging_right_and_down_turns_the_scene_with_the_hand() {
        let mut control = Control::new(&camera(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO), bounds(1.0));
        control.turn(Vec2::splat(0.05));
        let front = ndc(&control, Vec3::Z);
        assert!(front.x > 0.0 && front.y > 0.0, "{front}");
    }

    #[test]
    fn panning_follows_the_pointer() {
        let mut control = control();
        let target = control.target;
        control.pan(Vec2::new(0.25, -0.125));
        // A quarter of the height is 0.5 / aspect of the clip square.
        let at = ndc(&control, target);
        assert!((at.truncate() - Vec2::new(0.5 / 1.5, -0.25)).length() < 1e-5, "{at}");
    }

    #[test]
    fn zooming_goes_towards_the_target_and_back_and_never_through_it() {
        let mut control = control();
        let (start, direction) = (control.distance, control.axes().z_axis);
        control.wheel(3.5);
        assert!(control.distance < start);
        control.wheel(-3.5);
        assert!((control.distance / start - 1.0).abs() < 1e-5);
        for notches in [1000.0, -1000.0] {
            control.wheel(notches);
            assert!(control.distance > 0.0 && control.distance.is_finite());
            assert_eq!(control.axes().z_axis, direction);
        }
    }

    #[test]
    fn flying_does_not_depend_on_the_frame_rate() {
        let fly = |frames: u16| {
            let mut control = control();
            control.switch_mode();
            (0..frames).for_each(|_| control.step(Vec3::new(1.0, -0.5, 1.0), true, 2.0 / f32::from(frames)));
            control.position()
        };
        assert!(fly(20).distance(fly(288)) < 1e-4);
        assert!((fly(20).distance(control().position()) - 2.0 * FLY_SPEED * FAST).abs() < 1e-4);
    }

    #[test]
    fn keys_move_along_their_axes_and_only_while_flying() {
        let mut control = Control::new(&camera(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO), bounds(1.0));
        let start = control.position();
        control.step(Vec3::Z, false, 1.0);
        assert_eq!(control.position(), start);
        control.switch_mode();
        for (held, way) in [(Vec3::X, Vec3::X), (Vec3::Y, Vec3::Y), (Vec3::Z, Vec3::NEG_Z)] {
            let before = control.position();
            control.step(held, false, 1.0);
            assert!((control.position() - before).distance(way * FLY_SPEED) < 1e-5);
        }
    }

    #[test]
    fn looking_around_and_changing_the_mode_keep_the_position() {
        let mut control = control();
        let eye = control.eye(1.0);
        control.switch_mode();
        assert_eq!(control.eye(1.0), eye);
        for i in 0..500 {
            control.turn(Vec2::new(0.01, if i % 100 < 50 { 0.02 } else { -0.02 }));
        }
        assert!(control.position().distance(eye.position()) < 1e-3);
        assert_ne!(control.eye(1.0).world_from_view, eye.world_from_view);
    }

    #[test]
    fn tiny_and_huge_scenes_stay_in_view_and_in_range() {
        for size in [1e-4, 1.0, 1e6] {
            let camera = camera(Vec3::new(0.0, 1.0, 3.0) * size, Vec3::ZERO);
            let mut control = Control::new(&camera, bounds(size));
            for notches in [0.0, 500.0, -1000.0] {
                control.wheel(notches);
                let eye = control.eye(1.0);
                let depth = ndc(&control, control.target).z;
                assert!(eye.clip_from_world().is_finite() && depth > 0.0 && depth < 1.0, "size {size}: depth {depth}");
            }
            control.switch_mode();
            (0..1000).for_each(|_| control.step(Vec3::Z, true, 100.0));
            assert!(control.position().is_finite() && control.target.length() <= 1.01 * FARTHEST * size);
        }
    }

    #[test]
    fn a_scene_without_geometry_is_as_large_as_the_view() {
        let mut control = Control::new(&camera(Vec3::Z * 4.0, Vec3::ZERO), Bounds::EMPTY);
        control.wheel(2.0);
        control.switch_mode();
        control.step(Vec3::X, false, 1.0);
        assert!(control.position().is_finite() && control.position().x > 0.0);
    }
}
