//! The panel at the left hand: a button shows it there, the right hand's laser moves what is on it, and it comes and goes with
//! the hand.

use headset_runtime::script::{Button, Laser, LostHand, Script, Waypoint};
use pbr_vr::asset::picture::Picture;
use serde_json::Value;

use super::dashboard::{DASHBOARD, assert_panel, exposure_in, mean, pictures_of, seen};
use crate::common::room::{Room, assert_same, patient};

const HELD: &str = "pbr-vr.panel-at-hand";
/// OpenVR's number of the flag that turns the laser mouse on, and the test runtime's of the left controller.
const INTERACTIVE: u64 = 1 << 16;
const LEFT_DEVICE: u64 = 1;
/// Metres: where no eye sees it.
const LEFT_HAND: [f32; 3] = [-0.2, 0.9, 0.0];

/// Where hands are that are not looked at.
fn resting(frame: u64) -> Waypoint {
    Waypoint { frame, position: [0.2, 0.9, 0.5], rotation_degrees: [0.0, -80.0, 0.0] }
}

fn press(frame: u64) -> Button {
    let action = "/actions/demo/in/panel".into();
    Button { frame, last: Some(frame + 2), action, hand: "left".into() }
}

/// The panel is shown at a frame and hidden at another.
fn script(frame: u64, last: u64) -> Script {
    let left_hand = vec![Waypoint { frame: 1, position: LEFT_HAND, rotation_degrees: [0.0; 3] }];
    Script { left_hand, right_hand: vec![resting(1)], button: vec![press(frame), press(last)], ..patient() }
}

fn frames_of(calls: &[Value]) -> Vec<u64> {
    calls.iter().map(|call| call["frame"].as_u64().expect("a frame")).collect()
}

fn shown_and_hidden(room: &Room) -> [Vec<u64>; 2] {
    ["ShowOverlay", "HideOverlay"].map(|name| {
        let calls = room.headset.calls_of(name);
        assert!(calls.iter().all(|call| call["overlay"] == HELD && call["code"] == 0), "{calls:?}");
        frames_of(&calls)
    })
}

/// Where the panel was put relative to the left controller: its matrix' rows.
fn place(room: &Room) -> [[f32; 4]; 3] {
    let calls = room.headset.calls_of("SetOverlayTransformTrackedDeviceRelative");
    assert!(!calls.is_empty() && calls.iter().all(|c| c["overlay"] == HELD && c["device"] == LEFT_DEVICE), "{calls:?}");
    serde_json::from_value(calls[0]["rows"].clone()).expect("a matrix")
}

/// When the laser mouse was turned on and off.
fn lasers(room: &Room) -> Vec<(u64, bool)> {
    let calls = room.headset.calls_of("SetOverlayFlag");
    let flags = calls.iter().filter(|call| call["flag"] == INTERACTIVE && call["overlay"] == HELD);
    flags.map(|call| (call["frame"].as_u64().expect("a frame"), call["on"] == true)).collect()
}

/// Overlays that were there when the runtime was shut down.
fn left_over(room: &Room) -> u64 {
    let ended = room.headset.calls_of("Cleanup");
    ended.last().and_then(|call| call["overlays"].as_u64()).expect("a shutdown")
}

#[test]
fn the_button_shows_and_hides_the_panel_beside_the_left_controller() {
    let script = Script { dashboard: seen(110, 160), show: vec![10, 60, 170], ..script(20, 80) };
    let room = Room::with(script);
    let ran = room.view(180);
    ran.assert_clean();
    assert!(!ran.err.contains("panel"), "{ran}");
    assert_eq!(shown_and_hidden(&room), [vec![20], vec![80]]);
    let rows = place(&room);
    // Its middle is above and ahead of the controller; it faces up and back.
    let [front, middle] = [2, 3].map(|column| rows.map(|row| row[column]));
    assert!(middle[1] > 0.1 && middle[2] < 0.0 && front[1] > 0.5 && front[2] > 0.5, "{rows:?}");
    let widths = room.headset.calls_of("SetOverlayWidthInMeters");
    let held = widths.iter().find(|call| call["overlay"] == HELD).expect("a width");
    assert!((held["metres"].as_f64().expect("a width") - 0.3).abs() < 1e-6, "{held}");

    let frames = pictures_of(&room, HELD);
    assert!(!frames.is_empty() && frames[0] >= 20, "{frames:?}");
    // One may be under way when it is hidden.
    assert!(frames.iter().filter(|frame| **frame > 80).count() <= 1, "drawn unseen: {frames:?}");
    let picture = |frame: u64, name: &str| Picture::read(&room.headset.picture(frame, name)).expect("a picture");
    let held = picture(frames[frames.len() - 1], "held");
    assert_panel(&held);
    // The dashboard's shows the same, but for numbers that change.
    let frames = pictures_of(&room, DASHBOARD);
    assert!(!frames.is_empty() && frames[0] >= 110, "{frames:?}");
    let dashboard = picture(frames[frames.len() - 1], "overlay");
    let same = held.pixels.iter().zip(&dashboard.pixels).filter(|(a, b)| a == b).count();
    assert!(same as f32 > 0.95 * held.pixels.len() as f32, "{same} of {} pixels", held.pixels.len());
    // It is beside the scene, not in it, and a hand that rests takes no laser to it.
    for frame in [60, 170] {
        assert_same(&room.shown(frame, 0), &room.shown(10, 0), "with and without the panel");
    }
    assert_eq!(lasers(&room), []);
}

#[test]
fn the_right_hands_laser_moves_the_exposure_on_it_and_leaves_the_scene_its_buttons() {
    // The first run says where the panel and its slider are.
    let room = Room::with(script(20, 80));
    let ran = room.view_with(&["--frames", "90", "-vv"]);
    ran.assert_clean();
    let rows = place(&room);
    let at = exposure_in(&ran.err);
    assert!(at.iter().all(|part| (0.0..1.0).contains(part)), "{at:?}");

    // Half a metre before its middle, and toward it.
    let position = std::array::from_fn(|i| LEFT_HAND[i] + rows[i][3] + 0.5 * rows[i][2]);
    let rotation_degrees = [0.0, -rows[1][2].asin().to_degrees(), 0.0];
    let pointing = |frame| Waypoint { frame, position, rotation_degrees };
    let right_hand = vec![resting(49), pointing(50), pointing(199), resting(200)];
    let laser = |frame, pressed| Laser { frame, held: true, at, pressed };
    let laser = vec![laser(70, None), laser(110, Some(true)), laser(150, Some(false))];
    let turn = Button { frame: 60, last: Some(62), action: "/actions/demo/in/turn_right".into(), hand: "right".into() };
    let script = script(20, 210);
    let button = [script.button.clone(), vec![turn]].concat();
    let room = Room::with(Script { right_hand, laser, button, show: vec![40, 230], ..script });
    room.view(240).assert_clean();
    let done = room.headset.calls_of("Laser");
    assert!(done.len() == 3 && done.iter().all(|laser| laser["on"] == true), "{done:?}");
    for eye in [0, 1] {
        let [before, after] = [40, 230].map(|frame| mean(&room.shown(frame, eye)));
        assert!(after > 1.1 * before, "eye {eye}: {after} after {before}");
    }
    assert_eq!(lasers(&room), [(50, true), (200, false)], "only while the hand points at it");
    assert_eq!(shown_and_hidden(&room), [vec![20], vec![210]], "the button works again afterwards");
    let submits = room.headset.calls_of("Submit");
    let jumps = submits.iter().filter(|call| call["flags"] == 0x20 && call["eye"] == 0).count();
    assert_eq!(jumps, 1, "the turn's button was the laser's");
}

#[test]
fn the_panel_goes_with_the_hand_and_comes_back_with_it() {
    let lost_hand = vec![LostHand { frame: 40, last: Some(50), hand: "left".into() }];
    let room = Room::with(Script { lost_hand, ..script(20, 70) });
    room.view(80).assert_clean();
    assert_eq!(shown_and_hidden(&room), [vec![20, 51], vec![40, 70]]);
    // What is there at the end, VR_Shutdown destroys.
    assert_eq!(left_over(&room), 2);
}

#[test]
fn what_the_runtime_refuses_costs_a_line_and_the_other_panel_stays() {
    for (refused, stays, place) in [("held", DASHBOARD, "hand"), ("dashboard", HELD, "dashboard")] {
        let script = Script { dashboard: seen(50, 90), refused_overlays: vec![refused.into()], ..script(10, 48) };
        let room = Room::with(script);
        let ran = room.view(100);
        ran.assert_clean();
        let lines: Vec<&str> = ran.err.lines().filter(|line| line.contains("panel")).collect();
        assert!(lines.len() == 1 && lines[0].contains(place), "{ran}");
        let calls = room.headset.calls_of("SetOverlayTexture");
        assert!(!calls.is_empty() && calls.iter().all(|call| call["overlay"] == stays), "{refused}: {calls:?}");
        assert_eq!(room.headset.calls_of("Submit").len(), 200, "all eyes of all frames");
    }
}

#[test]
fn an_overlay_that_cannot_be_used_is_destroyed() {
    for refused in ["SetOverlayInputMethod", "ShowOverlay"] {
        let room = Room::with(Script { refused_held_calls: vec![refused.into()], ..script(10, 20) });
        let ran = room.view(30);
        ran.assert_clean();
        let lines: Vec<&str> = ran.err.lines().filter(|line| line.contains("panel")).collect();
        assert!(lines.len() == 1 && lines[0].contains(refused), "{ran}");
        let destroyed = room.headset.calls_of("DestroyOverlay");
        assert!(destroyed.len() == 1 && destroyed[0]["overlay"] == HELD, "{destroyed:?}");
        assert_eq!(left_over(&room), 1, "the dashboard's");
        assert_eq!(room.headset.calls_of("Submit").len(), 60, "all eyes of all frames");
    }
}
