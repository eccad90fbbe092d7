//! IVRInput: actions from the program's manifest, pressed and moved as the script says.

use std::ffi::{c_char, c_void};
use std::path::Path;
use std::sync::LazyLock;

use openvr_sys as sys;
use serde_json::{Value, json};

use crate::client_core::text;
use crate::runtime::{Runtime, with};
use crate::script::lasts;
use crate::tracking::{LEFT_HAND, RIGHT_HAND};

static TABLE: LazyLock<sys::VR_IVRInput_FnTable> = LazyLock::new(|| sys::VR_IVRInput_FnTable {
    SetActionManifestPath: Some(set_action_manifest_path),
    GetActionSetHandle: Some(action_set_handle),
    GetActionHandle: Some(action_handle),
    GetInputSourceHandle: Some(input_source_handle),
    UpdateActionState: Some(update_action_state),
    GetDigitalActionData: Some(digital_action_data),
    GetAnalogActionData: Some(analog_action_data),
    GetPoseActionDataRelativeToNow: Some(pose_relative_to_now),
    GetPoseActionDataForNextFrame: Some(pose_for_next_frame),
    TriggerHapticVibrationAction: Some(haptic),
    GetOriginTrackedDeviceInfo: Some(origin_info),
    IsUsingLegacyInput: Some(is_legacy),
    ..Default::default()
});

pub fn table() -> *mut c_void {
    (&raw const *TABLE).cast_mut().cast()
}

type Code = sys::EVRInputError;
const OK: Code = sys::EVRInputError_VRInputError_None;
/// Where hands are found; their handles are 1 and 2, like their devices.
const HANDS: [(&str, &str, u32); 2] =
    [("left", "/user/hand/left", LEFT_HAND), ("right", "/user/hand/right", RIGHT_HAND)];

/// What the manifest declares. Handles are places in these lists, counted from 1.
#[derive(Default)]
pub struct Actions {
    sets: Vec<String>,
    /// Path and type.
    actions: Vec<(String, String)>,
    is_updated: bool,
}

impl Actions {
    /// Reads a manifest and looks at the bindings that it names.
    fn read(path: &Path) -> Result<Self, String> {
        let read = |path: &Path| -> Result<Value, String> {
            let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
            serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
        };
        let manifest = read(path)?;
        let list = |key: &str| manifest[key].as_array().cloned().unwrap_or_default();
        let word = |value: &Value, key: &str| value[key].as_str().unwrap_or_default().to_lowercase();
        for binding in list("default_bindings") {
            let file = binding["binding_url"].as_str().unwrap_or_default();
            read(&path.with_file_name(file))?;
        }
        Ok(Self {
            sets: list("action_sets").iter().map(|set| word(set, "name")).collect(),
            actions: list("actions").iter().map(|action| (word(action, "name"), word(action, "type"))).collect(),
            is_updated: false,
        })
    }

    /// An action's path, if it is of one of these types and the states have been updated in this frame.
    fn named(&self, handle: u64, types: &[&str]) -> Result<&str, Code> {
        let found = usize::try_from(handle).ok().and_then(|h| self.actions.get(h.checked_sub(1)?));
        let (name, kind) = found.ok_or(sys::EVRInputError_VRInputError_InvalidHandle)?;
        if !types.contains(&kind.as_str()) {
            return Err(sys::EVRInputError_VRInputError_WrongType);
        }
        if self.is_updated { Ok(name) } else { Err(sys::EVRInputError_VRInputError_NoActiveActionSet) }
    }
}

unsafe extern "C" fn set_action_manifest_path(path: *mut c_char) -> Code {
    // SAFETY: the interface asks for a string.
    let path = unsafe { text(path) };
    let is_absolute = Path::new(path).is_absolute();
    with(|r| {
        let read = if is_absolute { Actions::read(Path::new(path)) } else { Err("not an absolute path".into()) };
        let (code, problem) = match read {
            Ok(actions) => {
                r.actions = actions;
                (OK, String::new())
            }
            Err(problem) => (sys::EVRInputError_VRInputError_InvalidParam, problem),
        };
        let count = r.actions.actions.len();
        r.call("SetActionManifestPath", json!({ "path": path, "actions": count, "code": code, "problem": problem }));
        code
    })
}

/// Answers with a handle, or 0 and `NameNotFound`.
fn handle(r: &mut Runtime, call: &str, name: &str, found: Option<usize>, out: *mut u64) -> Code {
    let code = if found.is_some() { OK } else { sys::EVRInputError_VRInputError_NameNotFound };
    // SAFETY: the interface asks for a place.
    unsafe { *out = found.map_or(0, |n| n as u64 + 1) };
    r.call(call, json!({ "name": name, "code": code }));
    code
}

unsafe extern "C" fn action_set_handle(name: *mut c_char, out: *mut sys::VRActionSetHandle_t) -> Code {
    // SAFETY: the interface asks for a string.
    let name = unsafe { text(name) };
    with(|r| {
        let found = r.actions.sets.iter().position(|set| *set == name.to_lowercase());
        handle(r, "GetActionSetHandle", name, found, out)
    })
}

unsafe extern "C" fn action_handle(name: *mut c_char, out: *mut sys::VRActionHandle_t) -> Code {
    // SAFETY: the interface asks for a string.
    let name = unsafe { text(name) };
    with(|r| {
        let found = r.actions.actions.iter().position(|(action, _)| *action == name.to_lowercase());
        handle(r, "GetActionHandle", name, found, out)
    })
}

unsafe extern "C" fn input_source_handle(name: *mut c_char, out: *mut sys::VRInputValueHandle_t) -> Code {
    // SAFETY: the interface asks for a string.
    let name = unsafe { text(name) };
    with(|r| {
        let found = HANDS.iter().position(|(_, path, _)| *path == name);
        handle(r, "GetInputSourceHandle", name, found, out)
    })
}

unsafe extern "C" fn update_action_state(sets: *mut sys::VRActiveActionSet_t, size: u32, count: u32) -> Code {
    with(|r| {
        let is_right_size = size as usize == size_of::<sys::VRActiveActionSet_t>();
        let known = r.actions.sets.len() as u64;
        // SAFETY: the interface asks for `count` sets of `size` bytes.
        let are_known =
            is_right_size && (0..count as usize).all(|n| (1..=known).contains(unsafe { &(*sets.add(n)).ulActionSet }));
        r.actions.is_updated = are_known && count > 0;
        let code = if r.actions.is_updated { OK } else { sys::EVRInputError_VRInputError_InvalidHandle };
        r.call("UpdateActionState", json!({ "sets": count, "code": code }));
        code
    })
}

/// Whether something that `hand` does counts where only `source` does; 0 is any.
fn is_from(hand: &str, source: u64) -> bool {
    source == 0 || HANDS.iter().any(|(name, _, device)| *name == hand && u64::from(*device) == source)
}

/// Whether there is a controller that could act from a source; 0 is any.
fn is_held(r: &Runtime, source: u64) -> bool {
    HANDS.iter().any(|hand| (source == 0 || u64::from(hand.2) == source) && r.place(hand.2, r.frame).is_some())
}

fn origin(hand: &str) -> u64 {
    HANDS.iter().find(|(name, ..)| *name == hand).map_or(0, |(_, _, device)| u64::from(*device))
}

unsafe extern "C" fn digital_action_data(
    action: sys::VRActionHandle_t,
    out: *mut sys::InputDigitalActionData_t,
    _size: u32,
    source: sys::VRInputValueHandle_t,
) -> Code {
    with(|r| {
        let name = match r.actions.named(action, &["boolean"]) {
            Ok(name) => name,
            Err(code) => return code,
        };
        let pressed = |frame: u64| {
            let mut buttons = r.script.button.iter();
            buttons.find(|b| b.action == name && lasts(frame, b.frame, b.last) && is_from(&b.hand, source))
        };
        let (now, before) = (pressed(r.frame), pressed(r.frame.saturating_sub(1)));
        // In laser mouse mode, buttons are the overlays'.
        let is_muted = r.has_laser();
        let now = now.filter(|_| !is_muted);
        let data = sys::InputDigitalActionData_t {
            bActive: is_held(r, source) && !is_muted && (now.is_some() || !r.script.are_buttons_shy),
            activeOrigin: now.or(before).map_or(0, |b| origin(&b.hand)),
            bState: now.is_some(),
            bChanged: now.is_some() != before.is_some(),
            fUpdateTime: 0.0,
        };
        // SAFETY: the interface asks for a place.
        unsafe { *out = data };
        OK
    })
}

unsafe extern "C" fn analog_action_data(
    action: sys::VRActionHandle_t,
    out: *mut sys::InputAnalogActionData_t,
    _size: u32,
    source: sys::VRInputValueHandle_t,
) -> Code {
    with(|r| {
        let name = match r.actions.named(action, &["vector1", "vector2"]) {
            Ok(name) => name,
            Err(code) => return code,
        };
        let mut axes = r.script.axis.iter();
        let moved = axes.find(|a| a.action == name && lasts(r.frame, a.frame, a.last) && is_from(&a.hand, source));
        let [x, y] = moved.map_or([0.0; 2], |a| a.value);
        let origin = moved.map_or(0, |a| origin(&a.hand));
        let data = sys::InputAnalogActionData_t {
            bActive: is_held(r, source),
            activeOrigin: origin,
            x,
            y,
            ..Default::default()
        };
        // SAFETY: the interface asks for a place.
        unsafe { *out = data };
        OK
    })
}

fn pose_action(
    action: u64,
    space: sys::ETrackingUniverseOrigin,
    out: *mut sys::InputPoseActionData_t,
    source: u64,
) -> Code {
    with(|r| {
        let name = match r.actions.named(action, &["pose"]) {
            Ok(name) => name,
            Err(code) => return code,
        };
        // Without a source, the action's name tells the hand.
        let is_meant =
            |hand: &&(&str, &str, u32)| if source == 0 { name.contains(hand.0) } else { u64::from(hand.2) == source };
        let hand = HANDS.iter().find(is_meant).filter(|hand| r.place(hand.2, r.frame).is_some());
        let data = match hand {
            Some((_, _, device)) => sys::InputPoseActionData_t {
                bActive: true,
                activeOrigin: u64::from(*device),
                pose: r.pose(*device, r.frame, space),
            },
            None => sys::InputPoseActionData_t::default(),
        };
        // SAFETY: the interface asks for a place.
        unsafe { *out = data };
        OK
    })
}

unsafe extern "C" fn pose_relative_to_now(
    action: sys::VRActionHandle_t,
    space: sys::ETrackingUniverseOrigin,
    _seconds: f32,
    out: *mut sys::InputPoseActionData_t,
    _size: u32,
    source: sys::VRInputValueHandle_t,
) -> Code {
    pose_action(action, space, out, source)
}

unsafe extern "C" fn pose_for_next_frame(
    action: sys::VRActionHandle_t,
    space: sys::ETrackingUniverseOrigin,
    out: *mut sys::InputPoseActionData_t,
    _size: u32,
    source: sys::VRInputValueHandle_t,
) -> Code {
    pose_action(action, space, out, source)
}

unsafe extern "C" fn haptic(
    _action: sys::VRActionHandle_t,
    _start: f32,
    seconds: f32,
    _frequency: f32,
    amplitude: f32,
    _source: sys::VRInputValueHandle_t,
) -> Code {
    with(|r| r.call("TriggerHapticVibrationAction", json!({ "seconds": seconds, "amplitude": amplitude })));
    OK
}

unsafe extern "C" fn origin_info(
    origin: sys::VRInputValueHandle_t,
    out: *mut sys::InputOriginInfo_t,
    _size: u32,
) -> Code {
    let Ok(device @ (LEFT_HAND | RIGHT_HAND)) = u32::try_from(origin) else {
        return sys::EVRInputError_VRInputError_InvalidHandle;
    };
    let info = sys::InputOriginInfo_t {
        devicePath: origin,
        trackedDeviceIndex: device,
        rchRenderModelComponentName: [0; 128],
    };
    // SAFETY: the interface asks for a place.
    unsafe { *out = info };
    OK
}

unsafe extern "C" fn is_legacy() -> bool {
    false
}
