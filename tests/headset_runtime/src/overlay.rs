//! IVROverlay, as far as a program's panel needs it: an overlay on the dashboard and one fixed to a controller, their
//! pictures, and the laser mouse of the script.

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_void};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::{Duration, Instant};

use openvr_sys as sys;
use serde_json::{Value, json};

use crate::client_core::NOTHING;
use crate::images::Submitted;
use crate::runtime::{Runtime, with};
use crate::script::{Laser, lasts};

static TABLE: LazyLock<sys::VR_IVROverlay_FnTable> = LazyLock::new(|| sys::VR_IVROverlay_FnTable {
    CreateOverlay: Some(create_overlay),
    CreateDashboardOverlay: Some(create_dashboard_overlay),
    DestroyOverlay: Some(destroy_overlay),
    SetOverlayWidthInMeters: Some(set_width),
    SetOverlayTransformTrackedDeviceRelative: Some(set_transform),
    ShowOverlay: Some(show_overlay),
    HideOverlay: Some(hide_overlay),
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
/// The handle of the first overlay; the others' follow.
const FIRST: u64 = 4711;
/// After so long a frame that does not begin is taken to wait for SetOverlayTexture.
const PATIENCE: Duration = Duration::from_secs(20);

/// What the program has made.
#[derive(Default)]
pub struct Overlays {
    /// By handle; none where one was destroyed, or is a thumbnail.
    list: Vec<Option<Overlay>>,
    /// Of the script's list, those that have happened.
    lasers: usize,
}

#[derive(Default)]
struct Overlay {
    key: String,
    is_dashboard: bool,
    is_mouse: bool,
    /// It turns the laser mouse on wherever it is visible.
    is_interactive: bool,
    is_shown: bool,
    /// The device that it is fixed to.
    device: Option<u32>,
    scale: [f32; 2],
    events: VecDeque<sys::VREvent_t>,
}

/// Into the list; beyond it for a handle of none.
fn index(handle: u64) -> usize {
    handle.checked_sub(FIRST).and_then(|index| usize::try_from(index).ok()).unwrap_or(usize::MAX)
}

impl Overlays {
    /// Those that have not been destroyed.
    pub fn count(&self) -> usize {
        self.list.iter().flatten().count()
    }

    fn get(&self, handle: u64) -> Option<&Overlay> {
        self.list.get(index(handle))?.as_ref()
    }

    fn get_mut(&mut self, handle: u64) -> Option<&mut Overlay> {
        self.list.get_mut(index(handle))?.as_mut()
    }

    /// The new one's handle.
    fn add(&mut self, overlay: Overlay) -> Result<u64, Code> {
        if self.list.iter().flatten().any(|other| other.key == overlay.key) {
            return Err(sys::EVROverlayError_VROverlayError_KeyInUse);
        }
        self.list.push(Some(overlay));
        Ok(FIRST + self.list.len() as u64 - 1)
    }
}

impl Runtime {
    fn is_dashboard_up(&self) -> bool {
        self.script.dashboard.iter().any(|d| lasts(self.frame, d.frame, d.last))
    }

    fn sees(&self, overlay: &Overlay) -> bool {
        // Overlays without VROverlayFlags_VisibleInDashboard are not.
        if overlay.is_dashboard { self.is_dashboard_up() } else { overlay.is_shown && !self.is_dashboard_up() }
    }

    /// Whether an overlay of the program has turned the laser mouse on.
    pub fn has_laser(&self) -> bool {
        let mut overlays = self.overlays.list.iter().flatten();
        overlays.any(|overlay| overlay.is_interactive && overlay.is_mouse && self.sees(overlay))
    }

    /// What the laser has done since the last call.
    fn follow_laser(&mut self) {
        let script = Arc::clone(&self.script);
        while let Some(laser) = script.laser.get(self.overlays.lasers).filter(|laser| laser.frame <= self.frame) {
            self.overlays.lasers += 1;
            let is_on = if laser.held { self.has_laser() } else { self.is_dashboard_up() };
            self.call("Laser", json!({ "held": laser.held, "on": is_on }));
            let overlay = self.overlays.list.iter_mut().flatten().find(|o| o.is_dashboard != laser.held && o.is_mouse);
            if let Some(overlay) = overlay.filter(|_| is_on) {
                overlay.point(laser);
            }
        }
    }
}

/// Calls `f` for an overlay; a handle of none is the program's fault.
fn of(handle: u64, call: &str, details: Value, f: impl FnOnce(&mut Overlay) -> Code) -> Code {
    with(|r| {
        let is_refused = r.script.refused_held_calls.iter().any(|refused| refused == call);
        let (key, code) = match r.overlays.get_mut(handle) {
            Some(overlay) if is_refused && !overlay.is_dashboard => {
                (overlay.key.clone(), sys::EVROverlayError_VROverlayError_PermissionDenied)
            }
            Some(overlay) => (overlay.key.clone(), f(overlay)),
            None => {
                r.fault(&format!("{call} of an overlay that is not there"));
                (String::new(), sys::EVROverlayError_VROverlayError_UnknownOverlay)
            }
        };
        let mut line = json!({ "overlay": key, "code": code });
        if let (Some(line), Value::Object(details)) = (line.as_object_mut(), details) {
            line.extend(details);
        }
        r.call(call, line);
        code
    })
}

/// Makes an overlay whose kind is the script's name for it.
fn create(call: &str, kind: &str, key: *mut c_char, name: *mut c_char) -> Result<u64, Code> {
    // SAFETY: the interface asks for two strings.
    let [key, name] = [key, name].map(|text| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned());
    with(|r| {
        let is_dashboard = kind == "dashboard";
        let made = match r.script.refused_overlays.iter().any(|refused| refused == kind) {
            true => Err(sys::EVROverlayError_VROverlayError_PermissionDenied),
            false => r.overlays.add(Overlay { key: key.clone(), is_dashboard, ..Overlay::default() }),
        };
        let code = made.err().unwrap_or(OK);
        r.call(call, json!({ "overlay": key, "name": name, "code": code }));
        made
    })
}

unsafe extern "C" fn create_overlay(key: *mut c_char, name: *mut c_char, handle: *mut u64) -> Code {
    match create("CreateOverlay", "held", key, name) {
        Ok(made) => {
            // SAFETY: the interface asks for a place.
            unsafe { *handle = made };
            OK
        }
        Err(code) => code,
    }
}

unsafe extern "C" fn create_dashboard_overlay(
    key: *mut c_char,
    name: *mut c_char,
    main: *mut u64,
    thumbnail: *mut u64,
) -> Code {
    match create("CreateDashboardOverlay", "dashboard", key, name) {
        Ok(made) => {
            // The thumbnail takes the next handle.
            with(|r| r.overlays.list.push(None));
            // SAFETY: the interface asks for two places.
            unsafe { (*main, *thumbnail) = (made, made + 1) };
            OK
        }
        Err(code) => code,
    }
}

unsafe extern "C" fn destroy_overlay(handle: u64) -> Code {
    let code = of(handle, "DestroyOverlay", NOTHING, |_| OK);
    with(|r| r.overlays.list.get_mut(index(handle)).map(Option::take));
    code
}

unsafe extern "C" fn set_width(handle: u64, metres: f32) -> Code {
    of(handle, "SetOverlayWidthInMeters", json!({ "metres": metres }), |_| OK)
}

unsafe extern "C" fn set_transform(handle: u64, device: u32, place: *mut sys::HmdMatrix34_t) -> Code {
    // SAFETY: the interface asks for a matrix.
    let rows = unsafe { (*place).m };
    let details = json!({ "device": device, "rows": rows });
    of(handle, "SetOverlayTransformTrackedDeviceRelative", details, |overlay| {
        if overlay.is_dashboard {
            return sys::EVROverlayError_VROverlayError_WrongTransformType;
        }
        overlay.device = Some(device);
        OK
    })
}

/// Shows or hides one that is fixed to something.
fn set_shown(handle: u64, call: &str, shown: bool) -> Code {
    of(handle, call, NOTHING, |overlay| {
        if overlay.is_dashboard || (shown && overlay.device.is_none()) {
            return sys::EVROverlayError_VROverlayError_WrongVisibilityType;
        }
        overlay.is_shown = shown;
        OK
    })
}

unsafe extern "C" fn show_overlay(handle: u64) -> Code {
    set_shown(handle, "ShowOverlay", true)
}

unsafe extern "C" fn hide_overlay(handle: u64) -> Code {
    set_shown(handle, "HideOverlay", false)
}

unsafe extern "C" fn set_input_method(handle: u64, method: sys::VROverlayInputMethod) -> Code {
    of(handle, "SetOverlayInputMethod", NOTHING, |overlay| {
        overlay.is_mouse = method == sys::VROverlayInputMethod_Mouse;
        OK
    })
}

unsafe extern "C" fn set_mouse_scale(handle: u64, scale: *mut sys::HmdVector2_t) -> Code {
    // SAFETY: the interface asks for a vector.
    let scale = unsafe { (*scale).v };
    of(handle, "SetOverlayMouseScale", NOTHING, |overlay| {
        overlay.scale = scale;
        OK
    })
}

unsafe extern "C" fn set_flag(handle: u64, flag: sys::VROverlayFlags, on: bool) -> Code {
    of(handle, "SetOverlayFlag", json!({ "flag": flag, "on": on }), |overlay| {
        if flag == sys::VROverlayFlags_MakeOverlaysInteractiveIfVisible {
            overlay.is_interactive = on;
        }
        OK
    })
}

/// Copies the picture, which is always written, with the number of the frame before it.
unsafe extern "C" fn set_texture(handle: u64, texture: *mut sys::Texture_t) -> Code {
    // SAFETY: the interface asks for a texture whose handle is one of Vulkan's.
    let submitted = unsafe { Submitted::read(0, texture, std::ptr::null()) };
    let mut is_dashboard = false;
    let code = of(handle, "SetOverlayTexture", NOTHING, |overlay| {
        is_dashboard = overlay.is_dashboard;
        OK
    });
    if code != OK {
        return code;
    }
    let copied = with(|r| {
        let mut submitted = submitted?;
        submitted.eye = if is_dashboard { 2 } else { 3 };
        r.images.copy(&submitted, r.frame, true, false).map(|()| r.script.is_overlay_slow)
    });
    if copied == Ok(true) {
        wait_for_frame();
    }
    with(|r| r.call("SetOverlayTextureEnds", NOTHING));
    if copied.is_ok() { OK } else { sys::EVROverlayError_VROverlayError_InvalidTexture }
}

/// Waits, without the lock, until a frame has begun since the last was handed over.
fn wait_for_frame() {
    let started = Instant::now();
    while with(|r| r.is_handed_off) {
        if started.elapsed() > PATIENCE {
            with(|r| r.fault("the next frame waits for SetOverlayTexture"));
            return;
        }
        thread::sleep(Duration::from_millis(1));
    }
}

unsafe extern "C" fn is_visible(handle: u64) -> bool {
    with(|r| r.overlays.get(handle).is_some_and(|overlay| r.sees(overlay)))
}

unsafe extern "C" fn poll_next_event(handle: u64, event: *mut sys::VREvent_t, size: u32) -> bool {
    with(|r| {
        r.follow_laser();
        let is_right_size = size as usize == size_of::<sys::VREvent_t>();
        let Some(overlay) = r.overlays.get_mut(handle).filter(|_| is_right_size) else {
            r.fault(&format!("PollNextOverlayEvent of overlay {handle} wants events of {size} bytes"));
            return false;
        };
        let Some(next) = overlay.events.pop_front() else { return false };
        // SAFETY: the interface asks for a place of the size given.
        unsafe { *event = next };
        true
    })
}

impl Overlay {
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
