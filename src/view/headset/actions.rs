//! What the user's hands ask for, through OpenVR's actions: this frame's wishes, with presses turned into edges.

use std::ffi::CString;
use std::path::Path;

use glam::{Mat4, Vec4};
use openvr_sys as sys;
use sys::{HmdMatrix34_t, VR_IVRInput_FnTable, VRActionHandle_t, VRInputValueHandle_t};

/// The action manifest inside the assets.
pub const MANIFEST: &str = "openvr/actions.json";

const ACTION_SET: &str = "/actions/demo";
const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];
const POSES: [&str; 2] = ["hand_left", "hand_right"];
const HAPTIC: &str = "/actions/demo/out/haptic";
/// Buttons, in the order of [`Button`].
const BUTTONS: [&str; 8] =
    ["teleport", "turn_left", "turn_right", "grab", "next_scene", "next_panorama", "next_shading", "reset_seated"];

#[derive(Clone, Copy)]
enum Button {
    Teleport,
    TurnLeft,
    TurnRight,
    Grab,
    NextScene,
    NextPanorama,
    NextShading,
    ResetSeated,
}

/// A hand; also an index into pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    Left,
    Right,
}

/// What the user wishes in this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputActions {
    /// The hand that aims a teleport now: show its arc.
    pub aim: Option<Hand>,
    /// The hand that let go of an aim in this frame: go where its arc lands.
    pub teleport: Option<Hand>,
    /// Snap turns begun in this frame: 1 to the right, −1 to the left.
    pub turn: i32,
    /// Whether the left, the right hand holds on to something.
    pub grab: [bool; 2],
    /// Pressed in this frame.
    pub next_scene: bool,
    pub next_panorama: bool,
    pub next_shading: bool,
    pub reset_seated: bool,
    /// `play_from_hand` of the left, the right hand where it is tracked; −Z is where it points.
    pub hands: [Option<Mat4>; 2],
}

/// Each button in each hand: pressed or not, or `None` where the runtime gives no answer (no such controller, dashboard up).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Held([[Option<bool>; 2]; BUTTONS.len()]);

impl Held {
    fn is(&self, button: Button, hand: Hand) -> bool {
        self.0[button as usize][hand as usize] == Some(true)
    }

    /// InputActions that follow from the buttons before and now. What becomes unknown lets go of nothing: a teleport that a
    /// dashboard interrupts does not happen. What was unknown is not pressed anew either.
    fn wishes(before: &Self, now: &Self, hands: [Option<Mat4>; 2]) -> InputActions {
        let both = [Hand::Left, Hand::Right];
        let changed = |button: Button, hand: Hand, to: bool| {
            let at = |held: &Self| held.0[button as usize][hand as usize];
            at(before) == Some(!to) && at(now) == Some(to)
        };
        let pressed = |button: Button| both.iter().any(|hand| changed(button, *hand, true));
        InputActions {
            aim: both.into_iter().rev().find(|hand| now.is(Button::Teleport, *hand)),
            teleport: both.into_iter().rev().find(|hand| changed(Button::Teleport, *hand, false)),
            turn: i32::from(pressed(Button::TurnRight)) - i32::from(pressed(Button::TurnLeft)),
            grab: both.map(|hand| now.is(Button::Grab, hand)),
            next_scene: pressed(Button::NextScene),
            next_panorama: pressed(Button::NextPanorama),
            next_shading: pressed(Button::NextShading),
            reset_seated: pressed(Button::ResetSeated),
            hands,
        }
    }
}

/// The runtime's raw input functions; `None` if it has none.
///
/// # Safety
/// OpenVR has been initialised; the table is used no longer than until its shutdown.
pub unsafe fn input_table() -> Option<&'static VR_IVRInput_FnTable> {
    let name = [b"FnTable:", &sys::IVRInput_Version[..]].concat();
    let mut error = sys::EVRInitError_VRInitError_None;
    // SAFETY: the name ends with a zero, as the version does; OpenVR is initialised.
    let table = unsafe { sys::VR_GetGenericInterface(name.as_ptr().cast(), &raw mut error) };
    let table = table as *const VR_IVRInput_FnTable;
    if error != sys::EVRInitError_VRInitError_None {
        return None;
    }
    // SAFETY: without an error it is such a table or null, and lives until the shutdown.
    unsafe { table.as_ref() }
}

/// The program's actions, known to the runtime.
pub struct Actions {
    table: &'static VR_IVRInput_FnTable,
    set: u64,
    buttons: [VRActionHandle_t; BUTTONS.len()],
    poses: [VRActionHandle_t; 2],
    haptic: VRActionHandle_t,
    /// 0, any device, where the runtime cannot tell hands apart.
    hands: [VRInputValueHandle_t; 2],
    before: Held,
}

impl Actions {
    /// Tells the runtime of the manifest in the folder of assets and asks for handles. Some of the table's entries may be
    /// missing; what they are for is then not there.
    ///
    /// # Errors
    /// A sentence on why there will be no controllers; all else goes on without.
    pub fn new(table: &'static VR_IVRInput_FnTable, assets: &Path) -> Result<Self, String> {
        let set_manifest = table.SetActionManifestPath.ok_or("the runtime takes no action manifest")?;
        let manifest = std::path::absolute(assets.join(MANIFEST)).map_err(|e| e.to_string())?;
        if !manifest.is_file() {
            return Err(format!("{} is missing", manifest.display()));
        }
        // SAFETY: the function belongs to a live table; it reads a string that ends with a zero.
        let status = with_text(&manifest.to_string_lossy(), |text| unsafe { set_manifest(text) })?;
        accepted(status, || format!("the action manifest {}", manifest.display()))?;
        let get_set = table.GetActionSetHandle.ok_or("the runtime has no action sets")?;
        let mut set = 0;
        // SAFETY: as above; it writes one handle.
        let status = with_text(ACTION_SET, |text| unsafe { get_set(text, &raw mut set) })?;
        accepted(status, || format!("the action set {ACTION_SET}"))?;
        let input = |name: &str| action(table, &format!("{ACTION_SET}/in/{name}"));
        let mut buttons = [0; BUTTONS.len()];
        for (handle, name) in buttons.iter_mut().zip(BUTTONS) {
            *handle = input(name)?;
        }
        let poses = [input(POSES[0])?, input(POSES[1])?];
        let hands = HANDS.map(|hand| source(table, hand));
        Ok(Self { table, set, buttons, poses, haptic: action(table, HAPTIC)?, hands, before: Held::default() })
    }

    /// This frame's wishes; call once a frame, after waiting for poses. None while the runtime gives no input, as with the
    /// dashboard up.
    pub fn read(&mut self) -> InputActions {
        let (held, hands) = if self.update() { (self.held(), self.poses()) } else { Default::default() };
        let wishes = Held::wishes(&self.before, &held, hands);
        self.before = held;
        wishes
    }

    /// A short tick in a hand, if its controller can.
    pub fn tick(&self, hand: Hand) {
        if let Some(vibrate) = self.table.TriggerHapticVibrationAction {
            let (seconds, hertz, strength) = (0.02, 160.0, 0.5);
            // SAFETY: plain numbers. A controller that cannot vibrate is none of our errors.
            let _ = unsafe { vibrate(self.haptic, 0.0, seconds, hertz, strength, self.hands[hand as usize]) };
        }
    }

    fn update(&self) -> bool {
        let Some(update) = self.table.UpdateActionState else { return false };
        let mut active = sys::VRActiveActionSet_t { ulActionSet: self.set, ..Default::default() };
        // SAFETY: one set of the size given.
        let status = unsafe { update(&raw mut active, size_of_val(&active) as u32, 1) };
        status == sys::EVRInputError_VRInputError_None
    }

    fn held(&self) -> Held {
        let same = self.hands[0] == self.hands[1];
        // Hands that cannot be told apart count as the right one.
        let hand = |action, i: usize| if same && i == 0 { None } else { self.button(action, self.hands[i]) };
        Held(self.buttons.map(|action| [hand(action, 0), hand(action, 1)]))
    }

    fn button(&self, action: VRActionHandle_t, hand: VRInputValueHandle_t) -> Option<bool> {
        let read = self.table.GetDigitalActionData?;
        let mut data = sys::InputDigitalActionData_t::default();
        // SAFETY: it writes one struct of the size given.
        let status = unsafe { read(action, &raw mut data, size_of_val(&data) as u32, hand) };
        (status == sys::EVRInputError_VRInputError_None && data.bActive).then_some(data.bState)
    }

    fn poses(&self) -> [Option<Mat4>; 2] {
        self.poses.map(|action| {
            let mut data = sys::InputPoseActionData_t::default();
            let (to, size) = (&raw mut data, size_of::<sys::InputPoseActionData_t>() as u32);
            let origin = sys::ETrackingUniverseOrigin_TrackingUniverseStanding;
            let table = self.table;
            // SAFETY: either writes one struct of the size given.
            let status = unsafe {
                match (table.GetPoseActionDataForNextFrame, table.GetPoseActionDataRelativeToNow) {
                    (Some(read), _) => read(action, origin, to, size, 0),
                    (None, Some(read)) => read(action, origin, 0.0, to, size, 0),
                    (None, None) => return None,
                }
            };
            let there = status == sys::EVRInputError_VRInputError_None && data.bActive && data.pose.bPoseIsValid;
            there.then(|| matrix(&data.pose.mDeviceToAbsoluteTracking)).filter(|pose| pose.is_finite())
        })
    }
}

fn action(table: &VR_IVRInput_FnTable, name: &str) -> Result<VRActionHandle_t, String> {
    let get = table.GetActionHandle.ok_or("the runtime has no actions")?;
    let mut handle = 0;
    // SAFETY: the function belongs to a live table; it reads a string that ends with a zero and writes one handle.
    let status = with_text(name, |text| unsafe { get(text, &raw mut handle) })?;
    accepted(status, || format!("the action {name}")).map(|()| handle)
}

fn source(table: &VR_IVRInput_FnTable, name: &str) -> VRInputValueHandle_t {
    let mut handle = 0;
    if let Some(get) = table.GetInputSourceHandle {
        // SAFETY: as for actions.
        let status = with_text(name, |text| unsafe { get(text, &raw mut handle) });
        if status != Ok(sys::EVRInputError_VRInputError_None) {
            return 0;
        }
    }
    handle
}

fn with_text<R>(text: &str, call: impl FnOnce(*mut std::ffi::c_char) -> R) -> Result<R, String> {
    let text = CString::new(text).map_err(|e| format!("{text:?}: {e}"))?;
    // The binding lost the header's const; no runtime writes there.
    Ok(call(text.as_ptr().cast_mut()))
}

fn accepted(status: sys::EVRInputError, what: impl FnOnce() -> String) -> Result<(), String> {
    let good = status == sys::EVRInputError_VRInputError_None;
    good.then_some(()).ok_or_else(|| format!("the runtime refuses {}: input error {status}", what()))
}

/// OpenVR's rows to columns.
fn matrix(rows: &HmdMatrix34_t) -> Mat4 {
    let [x, y, z] = rows.m.map(Vec4::from);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

#[cfg(test)]
#[path = "actions_tests.rs"]
mod tests;
