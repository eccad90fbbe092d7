//! Controller input through OpenVR's action system: button presses, releases and hand poses of each frame.

use std::ffi::CString;
use std::path::Path;

use glam::Mat4;
use openvr_sys as sys;
use sys::{VR_IVRInput_FnTable, VRActionHandle_t, VRInputValueHandle_t};

use super::optics::matrix;

/// The action manifest inside the assets.
pub const MANIFEST: &str = "openvr/actions.json";

const ACTION_SET: &str = "/actions/demo";
const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];
const POSES: [&str; 2] = ["hand_left", "hand_right"];
const HAPTIC: &str = "/actions/demo/out/haptic";
/// Buttons, in the order of [`Button`].
const BUTTONS: [&str; 9] = [
    "teleport",
    "turn_left",
    "turn_right",
    "grab",
    "next_scene",
    "next_panorama",
    "next_shading",
    "reset_seated",
    "panel",
];

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
    Panel,
}

/// A hand; also an index into pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    Left,
    Right,
}

/// Whom the controllers' buttons belong to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ButtonOwner {
    #[default]
    Scene,
    /// The laser mouse on the panel at the left hand: the scene has only the button that hides the panel, where the
    /// runtime reports it.
    Laser,
    /// The runtime's dashboard.
    Dashboard,
}

/// What the user does with the controllers in this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputActions {
    /// The hand that aims a teleport: its arc is shown.
    pub aim: Option<Hand>,
    /// The hand that released the teleport button in this frame: its arc's landing is the target.
    pub teleport: Option<Hand>,
    /// Snap turns begun in this frame: 1 to the right, −1 to the left.
    pub turn: i32,
    /// Whether the left, the right hand's grab button is pressed.
    pub grab: [bool; 2],
    /// Pressed in this frame.
    pub next_scene: bool,
    pub next_panorama: bool,
    pub next_shading: bool,
    pub reset_seated: bool,
    /// The panel at the left hand is to be shown or hidden.
    pub panel: bool,
    /// `play_from_hand` of the left, the right hand where it is tracked; −Z is where it points.
    pub hands: [Option<Mat4>; 2],
}

/// The state of each button in each hand: pressed or not, or `None` where it is unknown (no such controller, dashboard
/// open).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Buttons([[Option<bool>; 2]; BUTTONS.len()]);

impl Buttons {
    fn is_pressed(&self, button: Button, hand: Hand) -> bool {
        self.0[button as usize][hand as usize] == Some(true)
    }

    /// With all others unknown.
    fn only(&self, button: Button) -> Self {
        let mut only = Self::default();
        only.0[button as usize] = self.0[button as usize];
        only
    }
}

impl InputActions {
    /// From the buttons of the last frame and of this one. A state that becomes unknown is no release, so that opening the
    /// dashboard while aiming does not teleport; a state that was unknown is no press either.
    fn between(before: &Buttons, now: &Buttons, hands: [Option<Mat4>; 2]) -> Self {
        let both = [Hand::Left, Hand::Right];
        let changed = |button: Button, hand: Hand, to: bool| {
            let state = |buttons: &Buttons| buttons.0[button as usize][hand as usize];
            state(before) == Some(!to) && state(now) == Some(to)
        };
        let pressed = |button: Button| both.iter().any(|hand| changed(button, *hand, true));
        Self {
            aim: both.into_iter().rev().find(|hand| now.is_pressed(Button::Teleport, *hand)),
            teleport: both.into_iter().rev().find(|hand| changed(Button::Teleport, *hand, false)),
            turn: i32::from(pressed(Button::TurnRight)) - i32::from(pressed(Button::TurnLeft)),
            grab: both.map(|hand| now.is_pressed(Button::Grab, hand)),
            next_scene: pressed(Button::NextScene),
            next_panorama: pressed(Button::NextPanorama),
            next_shading: pressed(Button::NextShading),
            reset_seated: pressed(Button::ResetSeated),
            panel: pressed(Button::Panel),
            hands,
        }
    }
}

/// Handles of the program's actions. The function table is passed to each call instead of being kept: it is the runtime's
/// and valid only while the runtime is connected.
pub struct Actions {
    set: u64,
    buttons: [VRActionHandle_t; BUTTONS.len()],
    poses: [VRActionHandle_t; 2],
    haptic: VRActionHandle_t,
    /// 0, meaning any device, where the runtime cannot tell hands apart.
    hands: [VRInputValueHandle_t; 2],
    before: Buttons,
}

impl Actions {
    /// Registers the manifest in the folder of assets and gets the handles. Entries of the table may be missing; the input
    /// they are for is then missing, too.
    ///
    /// # Errors
    /// Why there will be no controllers, in one line. Everything else works without them.
    pub fn new(table: &VR_IVRInput_FnTable, assets: &Path) -> Result<Self, String> {
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
        Ok(Self { set, buttons, poses, haptic: action(table, HAPTIC)?, hands, before: Buttons::default() })
    }

    /// The input of this frame; call once a frame, after waiting for poses. Empty while the runtime gives no input, for
    /// example with its dashboard open; buttons that are another's are unknown.
    pub fn read(&mut self, table: &VR_IVRInput_FnTable, owner: ButtonOwner) -> InputActions {
        let has_input = self.update(table);
        let poses = if has_input { self.poses(table) } else { [Pose::default(); 2] };
        let held = poses.map(|pose| pose.active);
        let buttons = match owner {
            _ if !has_input => Buttons::default(),
            ButtonOwner::Scene => self.buttons(table, held),
            ButtonOwner::Laser => self.buttons(table, held).only(Button::Panel),
            ButtonOwner::Dashboard => Buttons::default(),
        };
        let actions = InputActions::between(&self.before, &buttons, poses.map(|pose| pose.play_from_hand));
        self.before = buttons;
        actions
    }

    /// A short tick in a hand, if its controller can vibrate.
    pub fn tick(&self, table: &VR_IVRInput_FnTable, hand: Hand) {
        if let Some(vibrate) = table.TriggerHapticVibrationAction {
            let (seconds, hertz, strength) = (0.02, 160.0, 0.5);
            // SAFETY: plain numbers. A controller that cannot vibrate returns an error that does not matter.
            let _ = unsafe { vibrate(self.haptic, 0.0, seconds, hertz, strength, self.hands[hand as usize]) };
        }
    }

    fn update(&self, table: &VR_IVRInput_FnTable) -> bool {
        let Some(update) = table.UpdateActionState else { return false };
        let mut active = sys::VRActiveActionSet_t { ulActionSet: self.set, ..Default::default() };
        // SAFETY: one set of the size given.
        let status = unsafe { update(&raw mut active, size_of_val(&active) as u32, 1) };
        status == sys::EVRInputError_VRInputError_None
    }

    /// `held`: whether the left, the right hand's pose is active.
    fn buttons(&self, table: &VR_IVRInput_FnTable, held: [bool; 2]) -> Buttons {
        let same = self.hands[0] == self.hands[1];
        let read = |hand: usize| self.buttons.map(|action| state(table, action, self.hands[hand]));
        // Hands that cannot be told apart count as the right one.
        let left = if same { [State::Unknown; BUTTONS.len()] } else { read(0) };
        let right = read(1);
        let held = if same { [false, held[0] || held[1]] } else { held };
        let [left, right] = [(left, held[0]), (right, held[1])].map(|(states, held)| known(states, held));
        Buttons(std::array::from_fn(|button| [left[button], right[button]]))
    }

    fn poses(&self, table: &VR_IVRInput_FnTable) -> [Pose; 2] {
        self.poses.map(|action| {
            let mut data = sys::InputPoseActionData_t::default();
            let (to, size) = (&raw mut data, size_of::<sys::InputPoseActionData_t>() as u32);
            let origin = sys::ETrackingUniverseOrigin_TrackingUniverseStanding;
            // SAFETY: either writes one struct of the size given.
            let status = unsafe {
                match (table.GetPoseActionDataForNextFrame, table.GetPoseActionDataRelativeToNow) {
                    (Some(read), _) => read(action, origin, to, size, 0),
                    (None, Some(read)) => read(action, origin, 0.0, to, size, 0),
                    (None, None) => return Pose::default(),
                }
            };
            let active = status == sys::EVRInputError_VRInputError_None && data.bActive;
            let pose = (active && data.pose.bPoseIsValid).then(|| matrix(&data.pose.mDeviceToAbsoluteTracking));
            Pose { active, play_from_hand: pose.filter(|pose| pose.is_finite()) }
        })
    }
}

/// A hand's pose action.
#[derive(Clone, Copy, Default)]
struct Pose {
    /// Whether a controller is in the hand, tracked or not.
    active: bool,
    play_from_hand: Option<Mat4>,
}

/// A hand's button as the runtime reports it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    /// An error, or nothing to ask.
    Unknown,
    /// No controller has such a button; with some runtimes also: it is not touched.
    Inactive,
    Pressed(bool),
}

fn state(table: &VR_IVRInput_FnTable, action: VRActionHandle_t, hand: VRInputValueHandle_t) -> State {
    let Some(read) = table.GetDigitalActionData else { return State::Unknown };
    let mut data = sys::InputDigitalActionData_t::default();
    // SAFETY: it writes one struct of the size given.
    let status = unsafe { read(action, &raw mut data, size_of_val(&data) as u32, hand) };
    match (status, data.bActive) {
        (sys::EVRInputError_VRInputError_None, true) => State::Pressed(data.bState),
        (sys::EVRInputError_VRInputError_None, false) => State::Inactive,
        _ => State::Unknown,
    }
}

/// The states of one hand's buttons. Where the hand is there, because its pose (`held`) or another button is active, an
/// inactive button is not pressed: some runtimes report a trackpad's parts as inactive while nobody touches them.
fn known(states: [State; BUTTONS.len()], held: bool) -> [Option<bool>; BUTTONS.len()] {
    let is_there = held || states.iter().any(|state| matches!(state, State::Pressed(_)));
    states.map(|state| match state {
        State::Pressed(pressed) => Some(pressed),
        State::Inactive if is_there => Some(false),
        State::Inactive | State::Unknown => None,
    })
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

#[cfg(test)]
#[path = "actions_tests.rs"]
mod tests;
