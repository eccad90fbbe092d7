//! Poses: waypoints to rigid transforms to OpenVR's matrices.

use glam::{Affine3A, EulerRot, Quat, Vec3};
use openvr_sys as sys;

use crate::script::Waypoint;

/// A rigid transform from a place and yaw, pitch, roll.
pub fn rigid(position: Vec3, rotation_degrees: Vec3) -> Affine3A {
    let [yaw, pitch, roll] = rotation_degrees.to_array().map(f32::to_radians);
    Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll), position)
}

/// Where a way of at least one point is at a frame.
pub fn along(way: &[Waypoint], frame: u64) -> Option<Affine3A> {
    let after = way.iter().find(|w| w.frame >= frame).or(way.last())?;
    let before = way.iter().rev().find(|w| w.frame <= frame).unwrap_or(after);
    let span = after.frame.saturating_sub(before.frame);
    let part = if span == 0 { 0.0 } else { (frame - before.frame) as f32 / span as f32 };
    let mix = |a: [f32; 3], b: [f32; 3]| Vec3::from(a).lerp(Vec3::from(b), part);
    Some(rigid(mix(before.position, after.position), mix(before.rotation_degrees, after.rotation_degrees)))
}

/// OpenVR's rows.
pub fn rows(transform: Affine3A) -> sys::HmdMatrix34_t {
    let (m, t) = (transform.matrix3.transpose(), transform.translation);
    let row = |axis: Vec3, t: f32| [axis.x, axis.y, axis.z, t];
    sys::HmdMatrix34_t { m: [row(m.x_axis.into(), t.x), row(m.y_axis.into(), t.y), row(m.z_axis.into(), t.z)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_rests_before_its_first_and_after_its_last_point_and_moves_evenly_between() {
        let point = |frame, x| Waypoint { frame, position: [x, 0.0, 0.0], rotation_degrees: [0.0; 3] };
        let way = [point(10, 1.0), point(20, 3.0)];
        for (frame, x) in [(1, 1.0), (10, 1.0), (15, 2.0), (20, 3.0), (99, 3.0)] {
            assert_eq!(along(&way, frame).expect("a place").translation.x, x, "frame {frame}");
        }
        assert!(along(&[], 1).is_none());
    }

    #[test]
    fn positive_yaw_looks_left_and_positive_pitch_up() {
        let forward = |rotation: Vec3| rigid(Vec3::ZERO, rotation).transform_vector3(Vec3::NEG_Z);
        assert!((forward(Vec3::new(90.0, 0.0, 0.0)) - Vec3::NEG_X).length() < 1e-6);
        assert!((forward(Vec3::new(0.0, 90.0, 0.0)) - Vec3::Y).length() < 1e-6);
    }

    #[test]
    fn rows_hold_the_translation_last() {
        let m = rows(rigid(Vec3::new(1.0, 2.0, 3.0), Vec3::new(90.0, 0.0, 0.0))).m;
        assert_eq!([m[0][3], m[1][3], m[2][3]], [1.0, 2.0, 3.0]);
        // Yaw to the left turns +Z into +X.
        assert!((m[0][2] - 1.0).abs() < 1e-6 && m[2][2].abs() < 1e-6);
    }
}
