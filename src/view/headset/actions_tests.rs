//! Tests of `view::headset::actions`: the JSON files against each other and the code, presses and releases, a fake runtime.

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char};
use std::path::PathBuf;
use std::sync::Mutex;

use glam::Vec3;
use serde_json::Value;

use super::*;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

fn json(name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(assets().join("openvr").join(name)).unwrap()).unwrap()
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("no text {key} in {value}"))
}

fn list<'a>(value: &'a Value, key: &str) -> &'a Vec<Value> {
    value[key].as_array().unwrap_or_else(|| panic!("no list {key} in {value}"))
}

/// Names of the manifest's actions of some type.
fn declared(of_type: &str) -> BTreeSet<String> {
    let manifest = json("actions.json");
    let actions = list(&manifest, "actions").iter().filter(|a| text(a, "type") == of_type);
    actions.map(|a| text(a, "name").to_owned()).collect()
}

fn full(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|name| format!("{ACTION_SET}/in/{name}")).collect()
}

#[test]
fn the_manifest_declares_what_the_code_reads_and_no_more() {
    assert_eq!(declared("boolean"), full(&BUTTONS));
    assert_eq!(declared("pose"), full(&POSES));
    assert_eq!(declared("vibration"), BTreeSet::from([HAPTIC.to_owned()]));
    let manifest = json("actions.json");
    assert_eq!(list(&manifest, "actions").len(), BUTTONS.len() + POSES.len() + 1);
    let sets = list(&manifest, "action_sets");
    assert_eq!((sets.len(), text(&sets[0], "name"), text(&sets[0], "usage")), (1, ACTION_SET, "leftright"));
    let requirements = ["mandatory", "suggested", "optional"];
    let known = |a: &Value| a["requirement"].as_str().is_none_or(|r| requirements.contains(&r));
    assert!(list(&manifest, "actions").iter().all(known));
}

#[test]
fn every_action_has_a_name_for_people() {
    let manifest = json("actions.json");
    let english = &list(&manifest, "localization")[0];
    assert_eq!(text(english, "language_tag"), "en_US");
    for action in list(&manifest, "actions") {
        assert!(!text(english, text(action, "name")).is_empty());
    }
    assert_eq!(english.as_object().unwrap().len(), list(&manifest, "actions").len() + 2);
}

#[test]
fn buttons_are_numbered_like_their_names() {
    let last = Button::Panel as usize;
    assert_eq!((BUTTONS[Button::Grab as usize], BUTTONS[last], last), ("grab", "panel", BUTTONS.len() - 1));
}

#[test]
fn every_controller_has_a_file_and_every_file_a_controller() {
    let manifest = json("actions.json");
    let bindings = list(&manifest, "default_bindings");
    let types: Vec<&str> = bindings.iter().map(|b| text(b, "controller_type")).collect();
    assert_eq!(types, ["vive_controller", "knuckles", "oculus_touch", "generic"]);
    for binding in bindings {
        assert_eq!(text(&json(text(binding, "binding_url")), "controller_type"), text(binding, "controller_type"));
    }
    assert_eq!(std::fs::read_dir(assets().join("openvr")).unwrap().count(), 1 + types.len());
}

/// Inputs that each mode has: Valve's "SteamVR Input" binding documentation.
fn inputs_of(mode: &str) -> &'static [&'static str] {
    match mode {
        "button" => &["click", "touch", "long", "double", "held"],
        "trigger" => &["click", "touch", "pull"],
        "grab" => &["grab"],
        "dpad" => &["north", "south", "east", "west", "center"],
        _ => panic!("mode {mode}"),
    }
}

#[test]
fn bindings_offer_every_action_and_name_none_that_is_not_there() {
    let manifest = json("actions.json");
    for binding in list(&manifest, "default_bindings") {
        let file = text(binding, "binding_url");
        let binding = json(file);
        let sets = binding["bindings"].as_object().unwrap();
        assert_eq!(sets.keys().collect::<Vec<_>>(), [ACTION_SET], "{file}");
        let ours = &binding["bindings"][ACTION_SET];
        let outputs = |kind: &str, middle: &str| -> BTreeSet<String> {
            let entries = list(ours, kind).iter();
            let checked = entries.inspect(|e| {
                let path = text(e, "path");
                assert!(HANDS.iter().any(|hand| path.starts_with(&format!("{hand}/{middle}/"))), "{file}: {path}");
            });
            checked.map(|e| text(e, "output").to_owned()).collect()
        };
        assert_eq!(outputs("poses", "pose"), declared("pose"), "{file}");
        assert_eq!(outputs("haptics", "output"), declared("vibration"), "{file}");
        let (mut used, mut paths) = (BTreeSet::new(), BTreeSet::new());
        for source in list(ours, "sources") {
            let path = text(source, "path");
            assert!(HANDS.iter().any(|hand| path.starts_with(&format!("{hand}/input/"))), "{file}: {path}");
            assert!(paths.insert(path.to_owned()), "{file}: {path} twice");
            let inputs = source["inputs"].as_object().unwrap();
            for (input, output) in inputs {
                assert!(inputs_of(text(source, "mode")).contains(&input.as_str()), "{file}: {path}: {input}");
                used.insert(text(output, "output").to_owned());
            }
        }
        assert_eq!(used, declared("boolean"), "{file}");
    }
}

fn buttons(button: Button, hand: Hand, state: Option<bool>) -> Buttons {
    let mut buttons = Buttons([[Some(false); 2]; BUTTONS.len()]);
    buttons.0[button as usize][hand as usize] = state;
    buttons
}

fn between(before: Buttons, now: Buttons) -> InputActions {
    InputActions::between(&before, &now, [None; 2])
}

#[test]
fn a_press_counts_once_and_a_teleport_happens_at_the_release() {
    let idle = buttons(Button::Teleport, Hand::Left, Some(false));
    let right = buttons(Button::TurnRight, Hand::Left, Some(true));
    assert_eq!((between(idle, right).turn, between(right, right).turn, between(right, idle).turn), (1, 0, 0));
    assert_eq!(between(idle, buttons(Button::TurnLeft, Hand::Right, Some(true))).turn, -1);
    let aiming = buttons(Button::Teleport, Hand::Left, Some(true));
    let pressed = between(idle, aiming);
    assert_eq!((pressed.aim, pressed.teleport), (Some(Hand::Left), None));
    let released = between(aiming, idle);
    assert_eq!((released.aim, released.teleport), (None, Some(Hand::Left)));
    assert_eq!(between(idle, buttons(Button::Grab, Hand::Right, Some(true))).grab, [false, true]);
    assert_eq!(between(idle, idle), InputActions::default());
}

#[test]
fn a_state_that_becomes_unknown_is_neither_press_nor_release() {
    let aiming = buttons(Button::Teleport, Hand::Right, Some(true));
    assert_eq!(between(aiming, Buttons::default()), InputActions::default());
    // The dashboard closes while the button of the next scene is down.
    let pressed = buttons(Button::NextScene, Hand::Right, Some(true));
    assert!(!between(Buttons::default(), pressed).next_scene);
    assert!(between(buttons(Button::NextScene, Hand::Right, Some(false)), pressed).next_scene);
}

/// What the fake runtime holds: names by handle − 1, pressed names, and whether input is to be had.
struct Runtime {
    names: Vec<String>,
    pressed: Vec<(&'static str, &'static str)>,
    available: bool,
    /// Only pressed buttons are active.
    shy: bool,
    /// Whether pose actions are active.
    held: bool,
}

static RUNTIME: Mutex<Runtime> =
    Mutex::new(Runtime { names: Vec::new(), pressed: Vec::new(), available: true, shy: false, held: true });
/// Tests that use the runtime take turns.
static TURN: Mutex<()> = Mutex::new(());

fn runtime() -> std::sync::MutexGuard<'static, Runtime> {
    RUNTIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn string(text: *mut c_char) -> String {
    // SAFETY: the code under test hands over strings that end with a zero.
    unsafe { CStr::from_ptr(text) }.to_str().unwrap().to_owned()
}

unsafe extern "C" fn set_manifest(path: *mut c_char) -> sys::EVRInputError {
    let path = string(path);
    sys::EVRInputError::from(!(Path::new(&path).is_absolute() && Path::new(&path).is_file()))
}

unsafe extern "C" fn get_handle(name: *mut c_char, handle: *mut u64) -> sys::EVRInputError {
    let (mut runtime, name) = (runtime(), string(name));
    runtime.names.push(name);
    // SAFETY: the caller's handle.
    unsafe { *handle = runtime.names.len() as u64 };
    sys::EVRInputError_VRInputError_None
}

unsafe extern "C" fn update(sets: *mut sys::VRActiveActionSet_t, size: u32, count: u32) -> sys::EVRInputError {
    let runtime = runtime();
    // SAFETY: `count` is checked below.
    let set = unsafe { &*sets };
    let good = size == 32 && count == 1 && runtime.names[set.ulActionSet as usize - 1] == ACTION_SET;
    if good && runtime.available {
        sys::EVRInputError_VRInputError_None
    } else {
        sys::EVRInputError_VRInputError_NoData
    }
}

unsafe extern "C" fn digital(
    action: u64,
    data: *mut sys::InputDigitalActionData_t,
    size: u32,
    hand: u64,
) -> sys::EVRInputError {
    let runtime = runtime();
    let name = |handle: u64| handle.checked_sub(1).map_or("any", |i| runtime.names[i as usize].as_str());
    assert_eq!(size, 24);
    let matches = |(button, of): &(&str, &str)| name(action).ends_with(button) && name(hand).ends_with(of);
    // SAFETY: the caller's struct.
    let data = unsafe { &mut *data };
    data.bState = runtime.pressed.iter().any(matches);
    data.bActive = data.bState || !runtime.shy;
    sys::EVRInputError_VRInputError_None
}

unsafe extern "C" fn pose(
    action: u64,
    origin: sys::ETrackingUniverseOrigin,
    data: *mut sys::InputPoseActionData_t,
    size: u32,
    _: u64,
) -> sys::EVRInputError {
    assert_eq!((size, origin), (96, 1));
    let runtime = runtime();
    let is_left = runtime.names[action as usize - 1].ends_with("left");
    // SAFETY: the caller's struct.
    let data = unsafe { &mut *data };
    data.bActive = runtime.held;
    data.pose.bPoseIsValid = is_left;
    data.pose.mDeviceToAbsoluteTracking.m = [[0.0, 0.0, 1.0, 10.0], [0.0, 1.0, 0.0, 20.0], [-1.0, 0.0, 0.0, 30.0]];
    sys::EVRInputError_VRInputError_None
}

fn empty_table() -> VR_IVRInput_FnTable {
    // SAFETY: a table of nullable function pointers; all of them null.
    unsafe { std::mem::zeroed() }
}

fn table() -> VR_IVRInput_FnTable {
    VR_IVRInput_FnTable {
        SetActionManifestPath: Some(set_manifest),
        GetActionSetHandle: Some(get_handle),
        GetActionHandle: Some(get_handle),
        GetInputSourceHandle: Some(get_handle),
        UpdateActionState: Some(update),
        GetDigitalActionData: Some(digital),
        GetPoseActionDataForNextFrame: Some(pose),
        ..empty_table()
    }
}

/// Runs `work` with a runtime of its own that has this table.
fn with_runtime(table: VR_IVRInput_FnTable, work: impl FnOnce(&VR_IVRInput_FnTable)) {
    let _turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    *runtime() = Runtime { names: Vec::new(), pressed: Vec::new(), available: true, shy: false, held: true };
    work(&table);
}

#[test]
fn buttons_and_poses_come_from_the_right_hand_and_the_left() {
    with_runtime(table(), |table| {
        let mut actions = Actions::new(table, &assets()).unwrap();
        actions.read(table, ButtonOwner::Scene);
        runtime().pressed = vec![("teleport", "left"), ("grab", "right"), ("next_scene", "right")];
        let input = actions.read(table, ButtonOwner::Scene);
        assert_eq!((input.aim, input.grab, input.next_scene), (Some(Hand::Left), [false, true], true));
        let hand = input.hands[0].unwrap();
        assert_eq!(hand.transform_point3(Vec3::X), Vec3::new(10.0, 20.0, 29.0));
        assert_eq!(input.hands[1], None, "an invalid pose");
        runtime().pressed.clear();
        assert_eq!(actions.read(table, ButtonOwner::Scene).teleport, Some(Hand::Left));
        actions.tick(table, Hand::Left);
    });
}

#[test]
fn input_that_stops_while_aiming_does_not_teleport() {
    with_runtime(table(), |table| {
        let mut actions = Actions::new(table, &assets()).unwrap();
        runtime().pressed = vec![("teleport", "right")];
        assert_eq!(actions.read(table, ButtonOwner::Scene).aim, Some(Hand::Right));
        runtime().available = false;
        assert_eq!(actions.read(table, ButtonOwner::Scene), InputActions::default());
        runtime().pressed.clear();
        runtime().available = true;
        assert_eq!(actions.read(table, ButtonOwner::Scene).teleport, None);
    });
}

#[test]
fn a_button_that_is_inactive_while_nobody_touches_it_is_released() {
    with_runtime(table(), |table| {
        let mut actions = Actions::new(table, &assets()).unwrap();
        runtime().shy = true;
        actions.read(table, ButtonOwner::Scene);
        runtime().pressed = vec![("teleport", "right"), ("turn_left", "left")];
        let input = actions.read(table, ButtonOwner::Scene);
        assert_eq!((input.aim, input.turn), (Some(Hand::Right), -1));
        runtime().pressed.clear();
        assert_eq!(actions.read(table, ButtonOwner::Scene).teleport, Some(Hand::Right));
        // Another button of the hand tells as much as its pose.
        runtime().pressed = vec![("teleport", "right"), ("grab", "right")];
        actions.read(table, ButtonOwner::Scene);
        (runtime().held, runtime().pressed) = (false, vec![("grab", "right")]);
        assert_eq!(actions.read(table, ButtonOwner::Scene).teleport, Some(Hand::Right));
        // A controller that is switched off while aiming does not.
        runtime().pressed = vec![("teleport", "right")];
        assert_eq!(actions.read(table, ButtonOwner::Scene).aim, Some(Hand::Right));
        runtime().pressed.clear();
        assert_eq!(actions.read(table, ButtonOwner::Scene), InputActions::default());
    });
}

#[test]
fn buttons_are_the_dashboards_while_it_is_up() {
    with_runtime(table(), |table| {
        let mut actions = Actions::new(table, &assets()).unwrap();
        runtime().pressed = vec![("teleport", "right")];
        assert_eq!(actions.read(table, ButtonOwner::Scene).aim, Some(Hand::Right));
        runtime().pressed.clear();
        let input = actions.read(table, ButtonOwner::Dashboard);
        assert!(input.teleport.is_none() && input.hands[0].is_some(), "{input:?}");
        assert_eq!(actions.read(table, ButtonOwner::Scene).teleport, None);
    });
}

#[test]
fn the_laser_leaves_the_scene_only_the_button_of_the_panel() {
    with_runtime(table(), |table| {
        let mut actions = Actions::new(table, &assets()).unwrap();
        runtime().pressed = vec![("teleport", "right")];
        assert_eq!(actions.read(table, ButtonOwner::Scene).aim, Some(Hand::Right));
        runtime().pressed = vec![("grab", "right"), ("next_scene", "right")];
        let muted = actions.read(table, ButtonOwner::Laser);
        assert!(muted.grab == [false; 2] && !muted.next_scene && muted.teleport.is_none(), "{muted:?}");
        runtime().pressed = vec![("panel", "left")];
        assert!(actions.read(table, ButtonOwner::Laser).panel);
        assert!(!actions.read(table, ButtonOwner::Laser).panel, "a press counts once");
    });
}

#[test]
fn the_panels_button_is_the_left_hands_alone_and_shares_its_place_with_no_other() {
    for binding in list(&json("actions.json"), "default_bindings") {
        let file = text(binding, "binding_url");
        let binding = json(file);
        let panel = format!("{ACTION_SET}/in/panel");
        let sources = list(&binding["bindings"][ACTION_SET], "sources");
        let all = sources.iter().flat_map(|source| {
            let inputs = source["inputs"].as_object().unwrap();
            inputs.iter().map(move |(input, output)| (text(source, "path"), input, text(output, "output")))
        });
        let of_panel: Vec<_> = all.filter(|(.., output)| *output == panel).collect();
        assert!(matches!(of_panel[..], [(path, ..)] if path.starts_with(HANDS[0])), "{file}: {of_panel:?}");
    }
}

#[test]
fn missing_entries_are_survived() {
    for (table, why) in [
        (empty_table(), "the runtime takes no action manifest"),
        (VR_IVRInput_FnTable { GetActionSetHandle: None, ..table() }, "the runtime has no action sets"),
        (VR_IVRInput_FnTable { GetActionHandle: None, ..table() }, "the runtime has no actions"),
    ] {
        with_runtime(table, |table| assert_eq!(Actions::new(table, &assets()).err().as_deref(), Some(why)));
    }
    let read = |table: VR_IVRInput_FnTable| {
        let mut input = InputActions::default();
        with_runtime(table, |table| {
            let mut actions = Actions::new(table, &assets()).unwrap();
            runtime().pressed = vec![("grab", "")];
            input = actions.read(table, ButtonOwner::Scene);
            actions.tick(table, Hand::Right);
        });
        input
    };
    assert_eq!(read(VR_IVRInput_FnTable { UpdateActionState: None, ..table() }), InputActions::default());
    let no_buttons = read(VR_IVRInput_FnTable { GetDigitalActionData: None, ..table() });
    assert!(no_buttons.grab == [false; 2] && no_buttons.hands[0].is_some());
    let no_poses = read(VR_IVRInput_FnTable { GetPoseActionDataForNextFrame: None, ..table() });
    assert!(no_poses.grab == [true; 2] && no_poses.hands == [None; 2]);
    let no_hands = read(VR_IVRInput_FnTable { GetInputSourceHandle: None, ..table() });
    assert_eq!(no_hands.grab, [false, true], "any hand counts as the right one");
}

#[test]
fn a_manifest_that_is_not_there_is_named() {
    with_runtime(table(), |table| {
        let problem = Actions::new(table, Path::new("nowhere")).err().unwrap();
        assert!(problem.contains("actions.json") && problem.ends_with("is missing"), "{problem}");
    });
}
