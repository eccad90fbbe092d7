//! Optics of the eyes (frusta and poses relative to the head) and the head's pose, from the runtime's raw numbers.

use glam::{Mat3, Mat4, Vec4};
use openvr_sys as sys;

use crate::render::{Eye, NEAR_METRES};
use crate::{Error, Result};

/// One eye of a headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Tangents of the frustum's sides: left, right, down, up.
    pub tangents: [f32; 4],
    /// Rigid; may hold a rotation, for canted displays.
    pub head_from_eye: Mat4,
}

impl Optics {
    /// From the raw projection: left, right, "top", "bottom". Its "top" is the downward tangent, below 0.
    ///
    /// # Errors
    /// The numbers are not a frustum or not a rigid transform.
    pub fn new([left, right, top, bottom]: [f32; 4], head_from_eye: Mat4) -> Result<Self> {
        let problem = |what| Error::Headset { problem: format!("its runtime gives an eye that has {what}") };
        let finite = [left, right, top, bottom].iter().all(|t| t.is_finite());
        if !finite || left >= right || top >= bottom {
            return Err(problem(format!("no field of view: {left} {right} {top} {bottom}")));
        }
        if !is_rigid(&head_from_eye) {
            return Err(problem(format!("no place on the head: {head_from_eye}")));
        }
        Ok(Self { tangents: [left, right, top, bottom], head_from_eye })
    }

    /// The eye in the world.
    pub fn eye(&self, world_from_head: Mat4) -> Eye {
        let [left, right, down, up] = self.tangents;
        Eye { world_from_view: world_from_head * self.head_from_eye, left, right, down, up, near_metres: NEAR_METRES }
    }
}

/// A matrix from its rows.
pub fn matrix(rows: &sys::HmdMatrix34_t) -> Mat4 {
    let [x, y, z] = rows.m.map(Vec4::from_array);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

/// The rows of a matrix.
pub fn rows(matrix: &Mat4) -> sys::HmdMatrix34_t {
    let [x, y, z] = [0, 1, 2].map(|row| matrix.row(row).to_array());
    sys::HmdMatrix34_t { m: [x, y, z] }
}

/// `play_from_device`, where the runtime has a good pose of it.
pub fn place(pose: &sys::TrackedDevicePose_t) -> Option<Mat4> {
    let place = matrix(&pose.mDeviceToAbsoluteTracking);
    (pose.bDeviceIsConnected && pose.bPoseIsValid && is_rigid(&place)).then_some(place)
}

fn is_rigid(matrix: &Mat4) -> bool {
    let turn = Mat3::from_mat4(*matrix);
    matrix.is_finite() && (turn * turn.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-2) && turn.determinant() > 0.0
}

/// The last known pose of the headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// In the play space: metres, floor at y = 0.
    pub space_from_head: Mat4,
    /// Whether any pose has come yet.
    pub is_known: bool,
    /// Frames whose pose was missing; the last good one was shown again.
    pub lost_poses: u64,
}

impl Default for Head {
    /// Standing in the middle, until the first pose comes.
    fn default() -> Self {
        Self { space_from_head: Mat4::from_translation(glam::Vec3::Y * 1.6), is_known: false, lost_poses: 0 }
    }
}

impl Head {
    /// Takes the pose if it is good, else keeps the last one. Codes of tracking do not matter (300 means that only the
    /// rotation is tracked, later ones may be added): the runtime itself says which poses are valid.
    pub fn follow(&mut self, pose: &sys::TrackedDevicePose_t) {
        let place = matrix(&pose.mDeviceToAbsoluteTracking);
        if pose.bPoseIsValid && is_rigid(&place) {
            (self.space_from_head, self.is_known) = (place, true);
        } else {
            self.lost_poses += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn pose(valid: bool, m: [[f32; 4]; 3]) -> sys::TrackedDevicePose_t {
        sys::TrackedDevicePose_t {
            mDeviceToAbsoluteTracking: sys::HmdMatrix34_t { m },
            bPoseIsValid: valid,
            eTrackingResult: 300,
            ..Default::default()
        }
    }

    const AT_123: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];

    #[test]
    fn rows_become_a_matrix_that_moves_points() {
        // A quarter turn about +Y takes -Z to -X.
        let rows = sys::HmdMatrix34_t { m: [[0.0, 0.0, 1.0, 5.0], [0.0, 1.0, 0.0, 6.0], [-1.0, 0.0, 0.0, 7.0]] };
        assert_eq!(matrix(&rows).transform_point3(Vec3::NEG_Z), Vec3::new(4.0, 6.0, 7.0));
        assert_eq!(super::rows(&matrix(&rows)).m, rows.m);
    }

    #[test]
    fn what_openvr_calls_top_is_the_tangent_downwards() {
        let optics = Optics::new([-1.4, 1.25, -1.5, 1.45], Mat4::IDENTITY).expect("a Vive's left eye");
        let eye = optics.eye(Mat4::IDENTITY);
        assert_eq!((eye.left, eye.right, eye.down, eye.up), (-1.4, 1.25, -1.5, 1.45));
        let high = eye.clip_from_world() * Vec4::new(0.0, 1.45, -1.0, 1.0);
        assert!((high.y / high.w + 1.0).abs() < 1e-6, "the picture's top: {high}");
    }

    #[test]
    fn canted_eyes_keep_their_rotation() {
        let turn = Quat::from_rotation_y(0.1);
        let place = Mat4::from_rotation_translation(turn, Vec3::X * -0.032);
        let eye = Optics::new([-1.0, 1.0, -1.0, 1.0], place).expect("a frustum").eye(Mat4::from_translation(Vec3::Y));
        let middle = eye.clip_from_world() * (eye.position() + turn * Vec3::NEG_Z * 2.0).extend(1.0);
        assert!((middle.truncate() / middle.w).truncate().length() < 1e-6);
        assert_eq!(eye.position(), Vec3::new(-0.032, 1.0, 0.0));
    }

    #[test]
    fn nonsense_is_an_error_that_names_the_numbers() {
        for raw in [[0.0; 4], [1.0, -1.0, -1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [f32::NAN, 1.0, -1.0, 1.0]] {
            let error = Optics::new(raw, Mat4::IDENTITY).expect_err("no frustum").to_string();
            assert!(error.contains("field of view"), "{error}");
        }
        assert!(Optics::new([-1.0, 1.0, -1.0, 1.0], Mat4::ZERO).is_err());
    }

    #[test]
    fn a_lost_pose_keeps_the_last_good_one() {
        let mut head = Head::default();
        head.follow(&pose(true, AT_123));
        let good = head.space_from_head;
        head.follow(&pose(false, [[9.0; 4]; 3]));
        head.follow(&pose(true, [[0.0; 4]; 3]));
        head.follow(&pose(true, [[f32::NAN; 4]; 3]));
        assert_eq!((head.space_from_head, head.lost_poses), (good, 3));
        assert_eq!(good.w_axis, Vec4::new(1.0, 2.0, 3.0, 1.0));
    }
}
