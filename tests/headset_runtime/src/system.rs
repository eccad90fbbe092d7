//! IVRSystem: sizes, optics, devices, properties and events.

use std::ffi::{CStr, c_char, c_void};
use std::ptr::null_mut;
use std::sync::LazyLock;

use glam::Vec3;
use openvr_sys as sys;
use serde_json::json;

use crate::client_core::NOTHING;
use crate::place::{rigid, rows};
use crate::runtime::{Runtime, with};
use crate::tracking::{HEAD, LEFT_HAND, RIGHT_HAND};

static TABLE: LazyLock<sys::VR_IVRSystem_FnTable> = LazyLock::new(|| sys::VR_IVRSystem_FnTable {
    GetRecommendedRenderTargetSize: Some(recommended_size),
    GetProjectionRaw: Some(projection_raw),
    GetEyeToHeadTransform: Some(eye_to_head),
    GetOutputDevice: Some(output_device),
    GetTimeSinceLastVsync: Some(time_since_vsync),
    IsDisplayOnDesktop: Some(is_display_on_desktop),
    GetDeviceToAbsoluteTrackingPose: Some(device_poses),
    GetSeatedZeroPoseToStandingAbsoluteTrackingPose: Some(standing_from_seated),
    GetTrackedDeviceActivityLevel: Some(activity_level),
    GetTrackedDeviceIndexForControllerRole: Some(device_of_role),
    GetControllerRoleForTrackedDeviceIndex: Some(role_of_device),
    GetTrackedDeviceClass: Some(device_class),
    IsTrackedDeviceConnected: Some(is_connected),
    GetBoolTrackedDeviceProperty: Some(bool_property),
    GetFloatTrackedDeviceProperty: Some(float_property),
    GetInt32TrackedDeviceProperty: Some(int_property),
    GetUint64TrackedDeviceProperty: Some(long_property),
    GetStringTrackedDeviceProperty: Some(string_property),
    GetPropErrorNameFromEnum: Some(property_error_name),
    PollNextEvent: Some(poll_next_event),
    PollNextEventWithPose: Some(poll_next_event_with_pose),
    GetEventTypeNameFromEnum: Some(event_name),
    GetHiddenAreaMesh: Some(hidden_area_mesh),
    IsInputAvailable: Some(is_input_available),
    IsSteamVRDrawingControllers: Some(no),
    ShouldApplicationPause: Some(no),
    ShouldApplicationReduceRenderingWork: Some(no),
    AcknowledgeQuit_Exiting: Some(acknowledge_quit),
    GetRuntimeVersion: Some(runtime_version),
    ..Default::default()
});

pub fn table() -> *mut c_void {
    (&raw const *TABLE).cast_mut().cast()
}

/// 0 for the left eye, 1 for the right.
pub fn eye_index(eye: sys::EVREye) -> usize {
    usize::from(eye == sys::EVREye_Eye_Right)
}

unsafe extern "C" fn recommended_size(width: *mut u32, height: *mut u32) {
    with(|r| {
        let [w, h] = r.script.size;
        // SAFETY: the interface asks for two places.
        unsafe { (*width, *height) = (w, h) };
        r.call("GetRecommendedRenderTargetSize", json!({ "size": r.script.size }));
    });
}

unsafe extern "C" fn projection_raw(
    eye: sys::EVREye,
    left: *mut f32,
    right: *mut f32,
    top: *mut f32,
    bottom: *mut f32,
) {
    with(|r| {
        let [l, rt, down, up] = r.eyes[eye_index(eye)].tangents;
        // OpenVR's "top" is the tangent down, its "bottom" the one up.
        // SAFETY: the interface asks for four places.
        unsafe { (*left, *right, *top, *bottom) = (l, rt, down, up) };
        r.call("GetProjectionRaw", json!({ "eye": eye }));
    });
}

unsafe extern "C" fn eye_to_head(eye: sys::EVREye) -> sys::HmdMatrix34_t {
    with(|r| {
        let optics = &r.eyes[eye_index(eye)];
        let matrix = rows(rigid(Vec3::from(optics.position), Vec3::from(optics.rotation_degrees)));
        r.call("GetEyeToHeadTransform", json!({ "eye": eye }));
        matrix
    })
}

unsafe extern "C" fn output_device(device: *mut u64, kind: sys::ETextureType, instance: *mut sys::VkInstance_T) {
    with(|r| {
        let wanted = usize::try_from(r.script.gpu).ok();
        let is_vulkan = kind == sys::ETextureType_TextureType_Vulkan;
        let found = wanted.filter(|_| is_vulkan).and_then(|n| r.images.physical_device(instance as u64, n));
        let otherwise = if r.script.gpu == -2 { 0xDEAD_0000 } else { 0 };
        // SAFETY: the interface asks for a place.
        unsafe { *device = found.unwrap_or(otherwise) };
        r.call("GetOutputDevice", json!({ "type": kind, "instance": instance as u64, "found": found.is_some() }));
    });
}

unsafe extern "C" fn time_since_vsync(seconds: *mut f32, frame: *mut u64) -> bool {
    with(|r| {
        // SAFETY: the interface takes null or places.
        unsafe {
            if !seconds.is_null() {
                *seconds = r.pace.seconds_since_vsync();
            }
            if !frame.is_null() {
                *frame = r.frame;
            }
        }
        true
    })
}

unsafe extern "C" fn is_display_on_desktop() -> bool {
    false
}

unsafe extern "C" fn device_poses(
    space: sys::ETrackingUniverseOrigin,
    _seconds: f32,
    poses: *mut sys::TrackedDevicePose_t,
    count: u32,
) {
    // SAFETY: the interface asks for room for `count` poses.
    with(|r| unsafe { r.fill(poses, count, r.frame, space) });
}

unsafe extern "C" fn standing_from_seated() -> sys::HmdMatrix34_t {
    with(|r| rows(r.standing_from_seated))
}

unsafe extern "C" fn activity_level(_device: sys::TrackedDeviceIndex_t) -> sys::EDeviceActivityLevel {
    sys::EDeviceActivityLevel_k_EDeviceActivityLevel_UserInteraction
}

unsafe extern "C" fn device_of_role(role: sys::ETrackedControllerRole) -> sys::TrackedDeviceIndex_t {
    let device = match role {
        sys::ETrackedControllerRole_TrackedControllerRole_LeftHand => LEFT_HAND,
        sys::ETrackedControllerRole_TrackedControllerRole_RightHand => RIGHT_HAND,
        _ => u32::MAX,
    };
    if with(|r| is_there(r, device)) { device } else { u32::MAX }
}

unsafe extern "C" fn role_of_device(device: sys::TrackedDeviceIndex_t) -> sys::ETrackedControllerRole {
    match device {
        LEFT_HAND => sys::ETrackedControllerRole_TrackedControllerRole_LeftHand,
        RIGHT_HAND => sys::ETrackedControllerRole_TrackedControllerRole_RightHand,
        _ => sys::ETrackedControllerRole_TrackedControllerRole_Invalid,
    }
}

unsafe extern "C" fn device_class(device: sys::TrackedDeviceIndex_t) -> sys::ETrackedDeviceClass {
    match device {
        HEAD => sys::ETrackedDeviceClass_TrackedDeviceClass_HMD,
        _ if with(|r| is_there(r, device)) => sys::ETrackedDeviceClass_TrackedDeviceClass_Controller,
        _ => sys::ETrackedDeviceClass_TrackedDeviceClass_Invalid,
    }
}

unsafe extern "C" fn is_connected(device: sys::TrackedDeviceIndex_t) -> bool {
    with(|r| is_there(r, device))
}

fn is_there(r: &Runtime, device: u32) -> bool {
    if device == HEAD { r.is_connected } else { r.place(device, r.frame).is_some() }
}

/// Says how it went, where it is asked for.
fn answer<T: Default>(value: Option<T>, error: *mut sys::ETrackedPropertyError) -> T {
    let code = match value {
        Some(_) => sys::ETrackedPropertyError_TrackedProp_Success,
        None => sys::ETrackedPropertyError_TrackedProp_UnknownProperty,
    };
    if !error.is_null() {
        // SAFETY: the interface takes null or a place.
        unsafe { *error = code };
    }
    value.unwrap_or_default()
}

unsafe extern "C" fn bool_property(
    _device: sys::TrackedDeviceIndex_t,
    _property: sys::ETrackedDeviceProperty,
    error: *mut sys::ETrackedPropertyError,
) -> bool {
    answer(None, error)
}

unsafe extern "C" fn float_property(
    device: sys::TrackedDeviceIndex_t,
    property: sys::ETrackedDeviceProperty,
    error: *mut sys::ETrackedPropertyError,
) -> f32 {
    let value = with(|r| match property {
        _ if device != HEAD => None,
        sys::ETrackedDeviceProperty_Prop_DisplayFrequency_Float => Some(r.pace.hz),
        sys::ETrackedDeviceProperty_Prop_UserIpdMeters_Float => Some(r.eyes[1].position[0] - r.eyes[0].position[0]),
        sys::ETrackedDeviceProperty_Prop_SecondsFromVsyncToPhotons_Float => Some(0.011),
        _ => None,
    });
    answer(value, error)
}

unsafe extern "C" fn int_property(
    _device: sys::TrackedDeviceIndex_t,
    _property: sys::ETrackedDeviceProperty,
    error: *mut sys::ETrackedPropertyError,
) -> i32 {
    answer(None, error)
}

unsafe extern "C" fn long_property(
    _device: sys::TrackedDeviceIndex_t,
    _property: sys::ETrackedDeviceProperty,
    error: *mut sys::ETrackedPropertyError,
) -> u64 {
    answer(None, error)
}

unsafe extern "C" fn string_property(
    device: sys::TrackedDeviceIndex_t,
    property: sys::ETrackedDeviceProperty,
    value: *mut c_char,
    size: u32,
    error: *mut sys::ETrackedPropertyError,
) -> u32 {
    let text = match property {
        sys::ETrackedDeviceProperty_Prop_TrackingSystemName_String => Some(c"pbr-vr test runtime"),
        sys::ETrackedDeviceProperty_Prop_ManufacturerName_String => Some(c"nobody"),
        sys::ETrackedDeviceProperty_Prop_ModelNumber_String if device == HEAD => Some(c"simulated headset"),
        sys::ETrackedDeviceProperty_Prop_ModelNumber_String => Some(c"simulated controller"),
        sys::ETrackedDeviceProperty_Prop_SerialNumber_String => Some(c"0"),
        sys::ETrackedDeviceProperty_Prop_ControllerType_String if device != HEAD => Some(c"vive_controller"),
        _ => None,
    };
    // SAFETY: the interface asks for room for `size` bytes, or null and 0.
    let needed = text.map_or(0, |text| unsafe { copy_string(text, value, size) });
    answer(text.map(|_| true), error);
    if needed > size && !error.is_null() {
        // SAFETY: the interface takes null or a place.
        unsafe { *error = sys::ETrackedPropertyError_TrackedProp_BufferTooSmall };
    }
    needed
}

/// Copies with the closing 0 if there is room; the room that is needed.
///
/// # Safety
/// `target` has room for `size` bytes, or `size` is 0.
pub unsafe fn copy_string(text: &CStr, target: *mut c_char, size: u32) -> u32 {
    let bytes = text.to_bytes_with_nul();
    let needed = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    if needed <= size && !target.is_null() {
        // SAFETY: there is room, by the caller's promise.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), target.cast::<u8>(), bytes.len()) };
    }
    needed
}

unsafe extern "C" fn property_error_name(_error: sys::ETrackedPropertyError) -> *mut c_char {
    c"property error".as_ptr().cast_mut()
}

unsafe extern "C" fn poll_next_event(event: *mut sys::VREvent_t, size: u32) -> bool {
    with(|r| {
        if size as usize != size_of::<sys::VREvent_t>() {
            r.fault(&format!("PollNextEvent wants events of {size} bytes"));
            return false;
        }
        let Some(next) = r.events.pop_front() else { return false };
        let (number, device) = (next.eventType, next.trackedDeviceIndex);
        // SAFETY: the interface asks for a place of the size given.
        unsafe { *event = next };
        r.call("PollNextEvent", json!({ "event": number, "device": device }));
        true
    })
}

unsafe extern "C" fn poll_next_event_with_pose(
    space: sys::ETrackingUniverseOrigin,
    event: *mut sys::VREvent_t,
    size: u32,
    pose: *mut sys::TrackedDevicePose_t,
) -> bool {
    // SAFETY: both places are the caller's.
    let polled = unsafe { poll_next_event(event, size) };
    if polled && !pose.is_null() {
        // SAFETY: as above; `event` has just been written.
        unsafe { *pose = with(|r| r.pose((*event).trackedDeviceIndex, r.frame, space)) };
    }
    polled
}

unsafe extern "C" fn event_name(_number: sys::EVREventType) -> *mut c_char {
    c"event".as_ptr().cast_mut()
}

unsafe extern "C" fn hidden_area_mesh(eye: sys::EVREye, kind: sys::EHiddenAreaMeshType) -> sys::HiddenAreaMesh_t {
    with(|r| {
        let is_standard = kind == sys::EHiddenAreaMeshType_k_eHiddenAreaMesh_Standard;
        let corners = if is_standard { r.hidden[eye_index(eye)].as_mut_slice() } else { &mut [] };
        let triangles = corners.len() / 3;
        let data = if corners.is_empty() { null_mut() } else { corners.as_mut_ptr() };
        r.call("GetHiddenAreaMesh", json!({ "eye": eye, "type": kind, "triangles": triangles }));
        sys::HiddenAreaMesh_t { pVertexData: data, unTriangleCount: u32::try_from(triangles).unwrap_or(0) }
    })
}

unsafe extern "C" fn is_input_available() -> bool {
    true
}

unsafe extern "C" fn no() -> bool {
    false
}

unsafe extern "C" fn acknowledge_quit() {
    with(|r| {
        r.call("AcknowledgeQuit_Exiting", NOTHING);
        if !r.was_told_to_quit {
            eprintln!("headset runtime: AcknowledgeQuit_Exiting, but nobody said quit");
            std::process::abort();
        }
    });
}

unsafe extern "C" fn runtime_version() -> *mut c_char {
    c"0.1.0".as_ptr().cast_mut()
}
