//! Poses: of the head and the hands, in the space that was asked for.

use glam::{Affine3A, EulerRot, Quat};
use openvr_sys as sys;

use crate::place::{along, rows};
use crate::runtime::Runtime;
use crate::script::lasts;

/// Devices by number.
pub const HEAD: u32 = 0;
pub const LEFT_HAND: u32 = 1;
pub const RIGHT_HAND: u32 = 2;

impl Runtime {
    /// Where a device is at a frame in the standing space; none where there is no such device.
    pub fn place(&self, device: u32, frame: u64) -> Option<Affine3A> {
        let frame = frame.max(1);
        match device {
            HEAD => along(&self.script.head, frame),
            LEFT_HAND => along(&self.script.left_hand, frame),
            RIGHT_HAND => along(&self.script.right_hand, frame),
            _ => None,
        }
    }

    /// What is reported about a device.
    pub fn pose(&self, device: u32, frame: u64, space: sys::ETrackingUniverseOrigin) -> sys::TrackedDevicePose_t {
        let Some(place) = self.place(device, frame) else { return sys::TrackedDevicePose_t::default() };
        let is_seated = space == sys::ETrackingUniverseOrigin_TrackingUniverseSeated;
        let place = if is_seated { self.standing_from_seated.inverse() * place } else { place };
        let loss = self.script.pose.iter().find(|p| device == HEAD && lasts(frame, p.frame, p.last));
        let is_there = device != HEAD || self.is_connected;
        let name = ["", "left", "right"].get(device as usize).copied().unwrap_or_default();
        let is_lost = self.script.lost_hand.iter().any(|l| l.hand == name && lasts(frame, l.frame, l.last));
        sys::TrackedDevicePose_t {
            mDeviceToAbsoluteTracking: rows(place),
            eTrackingResult: loss
                .map_or(sys::ETrackingResult_TrackingResult_Running_OK, |l| l.result as sys::ETrackingResult),
            bPoseIsValid: is_there && !is_lost && loss.is_none_or(|l| l.valid),
            bDeviceIsConnected: is_there,
            ..Default::default()
        }
    }

    /// Fills OpenVR's array of `count` poses.
    ///
    /// # Safety
    /// `poses` is null or has room for `count`.
    pub unsafe fn fill(
        &self,
        poses: *mut sys::TrackedDevicePose_t,
        count: u32,
        frame: u64,
        space: sys::ETrackingUniverseOrigin,
    ) {
        if poses.is_null() {
            return;
        }
        for device in 0..count {
            // SAFETY: the caller's promise.
            unsafe { poses.add(device as usize).write(self.pose(device, frame, space)) };
        }
    }

    /// The seated space begins here and now: at the head, looking where it looks, upright.
    pub fn reset_seated(&mut self) {
        let Some(head) = self.place(HEAD, self.frame) else { return };
        let (yaw, ..) = Quat::from_mat3a(&head.matrix3).to_euler(EulerRot::YXZ);
        self.standing_from_seated =
            Affine3A::from_rotation_translation(Quat::from_rotation_y(yaw), head.translation.into());
        self.post(sys::EVREventType_VREvent_SeatedZeroPoseReset as u32, HEAD);
    }
}
