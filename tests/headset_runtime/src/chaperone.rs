//! IVRChaperone: the play area, and where the seated space begins.

use std::ffi::c_void;
use std::sync::LazyLock;

use openvr_sys as sys;
use serde_json::json;

use crate::client_core::NOTHING;
use crate::runtime::with;

static TABLE: LazyLock<sys::VR_IVRChaperone_FnTable> = LazyLock::new(|| sys::VR_IVRChaperone_FnTable {
    GetCalibrationState: Some(calibration_state),
    GetPlayAreaSize: Some(play_area_size),
    GetPlayAreaRect: Some(play_area_rect),
    AreBoundsVisible: Some(are_bounds_visible),
    ForceBoundsVisible: Some(force_bounds_visible),
    ReloadInfo: Some(reload_info),
    ResetZeroPose: Some(reset_zero_pose),
    ..Default::default()
});

pub fn table() -> *mut c_void {
    (&raw const *TABLE).cast_mut().cast()
}

unsafe extern "C" fn calibration_state() -> sys::ChaperoneCalibrationState {
    sys::ChaperoneCalibrationState_OK
}

unsafe extern "C" fn play_area_size(x: *mut f32, z: *mut f32) -> bool {
    let size = with(|r| r.script.play_area_metres);
    // SAFETY: the interface asks for two places.
    unsafe { (*x, *z) = (size[0], size[1]) };
    size[0] * size[1] > 0.0
}

unsafe extern "C" fn play_area_rect(rect: *mut sys::HmdQuad_t) -> bool {
    let [x, z] = with(|r| r.script.play_area_metres).map(|side| 0.5 * side);
    let corner = |x, z| sys::HmdVector3_t { v: [x, 0.0, z] };
    // SAFETY: the interface asks for a place.
    unsafe { (*rect).vCorners = [corner(-x, z), corner(x, z), corner(x, -z), corner(-x, -z)] };
    x * z > 0.0
}

unsafe extern "C" fn are_bounds_visible() -> bool {
    false
}

unsafe extern "C" fn force_bounds_visible(force: bool) {
    with(|r| r.call("ForceBoundsVisible", json!({ "force": force })));
}

unsafe extern "C" fn reload_info() {
    with(|r| r.call("ReloadInfo", NOTHING));
}

unsafe extern "C" fn reset_zero_pose(space: sys::ETrackingUniverseOrigin) {
    with(|r| {
        r.call("ResetZeroPose", json!({ "space": space }));
        if space == sys::ETrackingUniverseOrigin_TrackingUniverseSeated {
            r.reset_seated();
        }
    });
}
