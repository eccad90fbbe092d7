//! Tests of `view::headset::steady`: level, calm, quick enough, and never beyond the eye's picture.

use glam::{EulerRot, Mat4};

use super::*;
use crate::render::NEAR_METRES;

const ASPECT: f32 = 16.0 / 9.0;

/// Yaw, pitch and roll in degrees.
fn turn(yaw: f32, pitch: f32, roll: f32) -> Quat {
    Quat::from_euler(EulerRot::YXZ, yaw.to_radians(), pitch.to_radians(), roll.to_radians())
}

/// An eye as headsets have them: canted, and narrower towards the nose.
fn eye(head: Quat) -> Eye {
    let head_from_eye = Mat4::from_rotation_translation(turn(4.0, 0.0, 0.0), Vec3::new(-0.032, 0.0, 0.0));
    let world_from_view = Mat4::from_quat(head) * head_from_eye;
    Eye { world_from_view, left: -1.35, right: 1.1, down: -1.25, up: 1.2, near_metres: NEAR_METRES }
}

/// The corners of the eye's picture.
#[rustfmt::skip]
const HIDDEN: [[f32; 2]; 12] = [
    [0.0, 0.0], [0.16, 0.0], [0.0, 0.16],
    [1.0, 0.0], [1.0, 0.16], [0.84, 0.0],
    [0.0, 1.0], [0.16, 1.0], [0.0, 0.84],
    [1.0, 1.0], [0.84, 1.0], [1.0, 0.84],
];

fn seen(head: Quat, seconds: f32) -> Seen<'static> {
    Seen { eye: eye(head), hidden: &HIDDEN, world_from_head: head, seconds, jumped: false }
}

fn forward(view: &SteadyView) -> Vec3 {
    -view.world_from_view.z_axis
}

/// Degrees between two directions.
fn between(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

#[test]
fn the_horizon_stays_level_whatever_the_head_does() {
    let mut steady = Steady::default();
    for i in 0..900u16 {
        let t = f32::from(i) / 90.0;
        let head = turn(40.0 * t.sin(), 30.0 * (1.7 * t).sin() + (50.0 * t).sin(), 35.0 * (2.3 * t).sin());
        let view = steady.follow(&seen(head, 1.0 / 90.0), ASPECT);
        let [right, up] = [view.world_from_view.x_axis, view.world_from_view.y_axis];
        assert!(right.y.abs() < 1e-5 && up.y > 0.5, "frame {i}: {right} {up}");
        assert!((view.world_from_view.determinant() - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_tremor_is_damped_to_a_fifth() {
    let mut steady = Steady::default();
    let swing = |angle: fn(&SteadyView) -> f32, steady: &mut Steady| {
        let mut most = 0f32;
        for i in 0..360u16 {
            let phase = std::f32::consts::TAU * 8.0 * f32::from(i) / 90.0;
            let head = turn(2.0 * phase.sin(), 2.0 * phase.cos(), 0.0);
            let view = steady.follow(&seen(head, 1.0 / 90.0), ASPECT);
            most = if i < 90 { 0.0 } else { most.max(angle(&view).abs()) };
        }
        most
    };
    let yaw = swing(|view| forward(view).x.asin().to_degrees(), &mut steady);
    let pitch = swing(|view| forward(view).y.asin().to_degrees(), &mut steady);
    assert!(yaw < 0.4 && pitch < 0.4, "of 2 degrees: {yaw} and {pitch}");
}

#[test]
fn a_step_is_followed_to_nine_tenths_in_a_fifth_of_a_second_at_any_rate() {
    let part = |hertz: u16, seconds: f32| {
        let mut steady = Steady::default();
        steady.follow(&seen(turn(0.0, 0.0, 0.0), 0.0), ASPECT);
        let frames = (seconds * f32::from(hertz)).round() as u16;
        let to = turn(6.0, 4.0, 25.0);
        let mut view = None;
        for _ in 0..frames {
            view = Some(steady.follow(&seen(to, 1.0 / f32::from(hertz)), ASPECT));
        }
        let target = to * Vec3::NEG_Z;
        1.0 - between(forward(&view.unwrap()), target) / between(Vec3::NEG_Z, target)
    };
    for hertz in [40, 60, 90, 120, 144] {
        assert!(part(hertz, 0.2) > 0.9, "{hertz} Hz: {}", part(hertz, 0.2));
    }
    let early = [40, 80, 120].map(|hertz| part(hertz, 0.1));
    assert!(early.iter().all(|p| (p - early[0]).abs() < 5e-3 && *p < 0.8), "{early:?}");
}

#[test]
fn nothing_beyond_the_eyes_picture_is_shown() {
    for aspect in [0.5, 1.0, ASPECT, 3.5] {
        let mut steady = Steady::default();
        let (mut narrowest, mut widest) = (f32::INFINITY, 0f32);
        for i in 0..1500u16 {
            let t = f32::from(i) / 90.0;
            // Up to 500 degrees a second, and on the head.
            let head = turn(110.0 * (4.5 * t).sin() + 80.0 * t, 85.0 * (1.3 * t).sin(), 100.0 * (0.7 * t).sin());
            let seen = seen(head, 1.0 / 90.0);
            let view = steady.follow(&seen, aspect);
            assert!(view.is_seen(&seen), "frame {i}: {view:?}");
            (narrowest, widest) = (narrowest.min(view.half.y), widest.max(view.half.y));
        }
        assert!(narrowest > 0.15 && widest <= HALF_HEIGHT, "{aspect}: {narrowest} to {widest}");
    }
}

#[test]
fn a_head_at_rest_is_seen_with_the_field_of_view_of_a_window() {
    let mut steady = Steady::default();
    let view = steady.follow(&seen(turn(20.0, -10.0, 12.0), 0.0), ASPECT);
    let [vertical, horizontal] = [view.half.y, view.half.x].map(|half| 2.0 * half.atan().to_degrees());
    assert!((42.0..=60.0).contains(&vertical) && (68.0..=92.0).contains(&horizontal), "{horizontal} x {vertical}");
}

#[test]
fn a_teleport_is_a_cut() {
    let mut steady = Steady::default();
    steady.follow(&seen(turn(0.0, 0.0, 0.0), 0.0), ASPECT);
    let to = turn(150.0, 0.0, 0.0);
    let view = steady.follow(&Seen { jumped: true, ..seen(to, 1.0 / 90.0) }, ASPECT);
    assert!(between(forward(&view), to * Vec3::NEG_Z) < 1e-3);
}

#[test]
fn overlaps_are_more_than_touching() {
    let square = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let triangle = |x: f32, y: f32| [Vec2::new(x, y), Vec2::new(x + 0.5, y), Vec2::new(x, y + 0.5)];
    assert!(overlap(&square, &triangle(0.25, 0.25)) && overlap(&square, &triangle(-0.2, -0.2)));
    assert!(!overlap(&square, &triangle(1.0, 0.0)) && !overlap(&square, &triangle(-0.3, -0.3)));
}
