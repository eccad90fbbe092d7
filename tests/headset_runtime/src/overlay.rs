//! IVROverlay, as far as a dashboard needs it: one overlay, its picture, and the laser mouse of the script.

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_void};
use std::sync::LazyLock;

use openvr_sys as sys;
use serde_json::json;

use crate::images::Submitted;
use crate::runtime::{Runtime, with};
use crate::script::{Laser, lasts};

static TABLE: LazyLock<sys::VR_IVROverlay_FnTable> = LazyLock::new(|| sys::VR_IVROverlay_FnTable {
    CreateDashboardOverlay: Some(create_dashboard_overlay),
    DestroyOverlay: Some(destroy_overlay),
    SetOverlayWidthInMeters: Some(set_width),
    SetOverlayInputMethod: Some(set_input_method),
    SetOverlayMouseScale: Some(set_mouse_scale),
    SetOverlayFlag: Some(set_flag),
    SetOverlayTexture: Some(set_texture),
    IsOverlayVisible: Some(is_visible),
    PollNextOverlayEvent: Some(poll_next_event),
    ..Default::default()
});

pub fn table() -> *mut c_void {
    (&raw const *TABLE).cast_mut().cast()
}

type Code = sys::EVROverlayError;
const OK: Code = sys::EVROverlayError_VROverlayError_None;
/// The overlay's handle; its thumbnail's is the next.
const HANDLE: u64 = 4711;

/// The program's overlay.
#[derive(Default)]
pub struct Dashboard {
    is_there: bool,
    is_mouse: bool,
    scale: [f32; 2],
    /// Of the script's list, those that have been turned into events.
    taken: usize,
    events: VecDeque<sys::VREvent_t>,
    /// Pictures set so far.
    pictures: u64,
}

/// Calls `f` for the overlay's handle; other handles are the program's fault.
fn of(handle: u64, call: &str, f: impl FnOnce(&mut Runtime)) -> Code {
    with(|r| {
        let known = r.dashboard.is_there && handle == HANDLE;
        let code = if known { OK } else { sys::EVROverlayError_VROverlayError_UnknownOverlay };
        if known {
            f(r);
        } else {
            r.fault(&format!("{call} of an overlay that is not there"));
        }
        r.call(call, json!({ "handle": handle, "code": code }));
        code
    })
}

unsafe extern "C" fn create_dashboard_overlay(
    key: *mut c_char,
    name: *mut c_char,
    main: *mut u64,
    thumbnail: *mut u64,
) -> Code {
    // SAFETY: the interface asks for two strings.
    let [key, name] = [key, name].map(|text| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned());
    with(|r| {
        let code = if r.script.no_overlays {
            sys::EVROverlayError_VROverlayError_PermissionDenied
        } else if std::mem::replace(&mut r.dashboard.is_there, true) {
            sys::EVROverlayError_VROverlayError_KeyInUse
        } else {
            // SAFETY: the interface asks for two places.
            unsafe { (*main, *thumbnail) = (HANDLE, HANDLE + 1) };
            OK
        };
        r.call("CreateDashboardOverlay", json!({ "key": key, "name": name, "code": code }));
        code
    })
}

unsafe extern "C" fn destroy_overlay(handle: u64) -> Code {
    of(handle, "DestroyOverlay", |r| r.dashboard.is_there = false)
}

unsafe extern "C" fn set_width(handle: u64, _: f32) -> Code {
    of(handle, "SetOverlayWidthInMeters", |_| ())
}

unsafe extern "C" fn set_input_method(handle: u64, method: sys::VROverlayInputMethod) -> Code {
    of(handle, "SetOverlayInputMethod", |r| r.dashboard.is_mouse = method == sys::VROverlayInputMethod_Mouse)
}

unsafe extern "C" fn set_mouse_scale(handle: u64, scale: *mut sys::HmdVector2_t) -> Code {
    // SAFETY: the interface asks for a vector.
    let scale = unsafe { (*scale).v };
    of(handle, "SetOverlayMouseScale", |r| r.dashboard.scale = scale)
}

unsafe extern "C" fn set_flag(handle: u64, _: sys::VROverlayFlags, _: bool) -> Code {
    of(handle, "SetOverlayFlag", |_| ())
}

unsafe extern "C" fn set_texture(handle: u64, texture: *mut sys::Texture_t) -> Code {
    // SAFETY: the interface asks for a texture whose handle is one of Vulkan's.
    let submitted = unsafe { Submitted::read(0, texture, std::ptr::null()) };
    let mut refused = None;
    let code = of(handle, "SetOverlayTexture", |r| {
        r.dashboard.pictures += 1;
        let frame = r.frame;
        let copied = submitted.and_then(|submitted| r.images.copy_overlay(&submitted, frame));
        refused = copied.err();
    });
    if refused.is_some() { sys::EVROverlayError_VROverlayError_InvalidTexture } else { code }
}

unsafe extern "C" fn is_visible(handle: u64) -> bool {
    with(|r| handle == HANDLE && r.script.dashboard.iter().any(|d| lasts(r.frame, d.frame, d.last)))
}

unsafe extern "C" fn poll_next_event(handle: u64, event: *mut sys::VREvent_t, size: u32) -> bool {
    with(|r| {
        if size as usize != size_of::<sys::VREvent_t>() || handle != HANDLE {
            r.fault(&format!("PollNextOverlayEvent of overlay {handle} wants events of {size} bytes"));
            return false;
        }
        let (script, frame) = (std::sync::Arc::clone(&r.script), r.frame);
        let dashboard = &mut r.dashboard;
        while let Some(laser) = script.laser.get(dashboard.taken).filter(|laser| laser.frame <= frame) {
            dashboard.taken += 1;
            if dashboard.is_mouse {
                dashboard.point(laser);
            }
        }
        let Some(next) = dashboard.events.pop_front() else { return false };
        // SAFETY: the interface asks for a place of the size given.
        unsafe { *event = next };
        true
    })
}

impl Dashboard {
    /// The laser points at a part of the overlay and, where the script says so, presses or releases.
    fn point(&mut self, laser: &Laser) {
        // OpenVR's origin is the lower left corner.
        let [x, y] = [laser.at[0] * self.scale[0], (1.0 - laser.at[1]) * self.scale[1]];
        let mut post = |number: sys::EVREventType| {
            let button = sys::EVRMouseButton_VRMouseButton_Left as u32;
            let mouse = sys::VREvent_Mouse_t { x, y, button, cursorIndex: 0 };
            let data = sys::VREvent_Data_t { mouse };
            self.events.push_back(sys::VREvent_t { eventType: number as u32, data, ..Default::default() });
        };
        post(sys::EVREventType_VREvent_MouseMove);
        match laser.pressed {
            Some(true) => post(sys::EVREventType_VREvent_MouseButtonDown),
            Some(false) => post(sys::EVREventType_VREvent_MouseButtonUp),
            None => {}
        }
    }
}
