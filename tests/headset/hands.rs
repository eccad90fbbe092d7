//! Controllers end to end: the picture's response to buttons that the script presses.

use headset_runtime::script::{Button, Script, Waypoint};

use crate::common::room::{Room, assert_different, assert_same, head, patient};

/// Frames after a press in which the change must have been made: a teleport takes its time in the dark.
const LATER: u64 = 60;

/// A hand behind the head that points to the floor, where no eye sees it.
fn out_of_sight() -> Vec<Waypoint> {
    vec![Waypoint { frame: 1, position: [0.0, 1.0, 1.0], rotation_degrees: [0.0, -80.0, 0.0] }]
}

fn press(action: &str, hand: &str, frame: u64, last: u64) -> Button {
    Button { frame, last: Some(last), action: format!("/actions/demo/in/{action}"), hand: hand.into() }
}

fn room(button: Vec<Button>, right_hand: Vec<Waypoint>) -> Room {
    let left_hand = out_of_sight();
    Room::with(Script { button, left_hand, right_hand, show: vec![3, LATER], ..patient() })
}

/// Frames whose pictures were handed over as having nothing to do with the ones before, for both eyes alike.
fn jumps(room: &Room) -> Vec<u64> {
    const FRAME_DISCONTINUITY: u64 = 0x20;
    let submits = room.headset.calls_of("Submit");
    assert!(submits.chunks(2).all(|eyes| eyes.len() == 2 && eyes[0]["flags"] == eyes[1]["flags"]), "{submits:?}");
    let flagged = submits.iter().step_by(2).filter(|call| call["flags"] == FRAME_DISCONTINUITY);
    flagged.filter_map(|call| call["frame"].as_u64()).collect()
}

#[test]
fn snap_turns_turn_the_user_by_thirty_degrees_each() {
    for (action, count, degrees) in [("turn_right", 1, -30.0), ("turn_left", 1, 30.0), ("turn_right", 2, -60.0)] {
        let presses = (0..count).map(|i| press(action, "left", 5 + 6 * i, 7 + 6 * i)).collect();
        let room = room(presses, out_of_sight());
        room.view(LATER).assert_clean();
        room.assert_shows(3, &head(1, [0.0; 3], [0.0; 3]));
        room.assert_shows(LATER, &head(1, [0.0; 3], [degrees, 0.0, 0.0]));
        let jumps = jumps(&room);
        assert_eq!((jumps[0], jumps.len()), (1, 1 + count as usize), "the start and each turn: {jumps:?}");
    }
}

#[test]
fn a_teleport_goes_where_the_arc_lands() {
    // Level, a metre above the floor and a metre behind the head: the parabola meets the floor after this long.
    let hand = Waypoint { frame: 1, position: [0.0, 1.0, 1.0], rotation_degrees: [0.0; 3] };
    let fall_seconds = (2.0f32 / 9.81).sqrt();
    let landing_z = 1.0 - 6.5 * fall_seconds;
    let room = room(vec![press("teleport", "right", 5, 9)], vec![hand]);
    room.view(LATER).assert_clean();
    room.assert_shows(LATER, &head(1, [0.0, 0.0, landing_z], [0.0; 3]));
    assert!(!room.headset.calls_of("UpdateActionState").is_empty());
    let jumps = jumps(&room);
    assert!(jumps.len() == 2 && jumps[1] > 5, "the start and the landing: {jumps:?}");
}

#[test]
fn buttons_that_are_inactive_while_untouched_work_as_well() {
    let hand = Waypoint { frame: 1, position: [0.0, 1.0, 1.0], rotation_degrees: [0.0; 3] };
    let button = vec![press("turn_right", "left", 5, 7), press("teleport", "right", 12, 16)];
    let script = Script { left_hand: out_of_sight(), right_hand: vec![hand], show: vec![LATER], ..patient() };
    let room = Room::with(Script { button, are_buttons_shy: true, ..script });
    room.view(LATER).assert_clean();
    let jumps = jumps(&room);
    assert_eq!(jumps.len(), 3, "the start, the turn and the landing: {jumps:?}");
}

#[test]
fn nothing_moves_that_nobody_asked_for() {
    let room = room(vec![press("grab", "left", 5, 9)], out_of_sight());
    room.view(LATER).assert_clean();
    room.assert_shows(LATER, &head(1, [0.0; 3], [0.0; 3]));
    assert_eq!(jumps(&room), [1]);
}

#[test]
fn a_manifest_that_the_runtime_takes_declares_every_action_that_is_asked_for() {
    let room = room(Vec::new(), out_of_sight());
    room.view(3).assert_clean();
    let manifest = room.headset.calls_of("SetActionManifestPath");
    assert_eq!((manifest.len(), &manifest[0]["code"]), (1, &serde_json::json!(0)), "{manifest:?}");
    for call in ["GetActionHandle", "GetActionSetHandle", "GetInputSourceHandle", "UpdateActionState"] {
        let calls = room.headset.calls_of(call);
        assert!(!calls.is_empty() && calls.iter().all(|c| c["code"] == 0), "{calls:?}");
    }
}

#[test]
fn frames_go_on_with_the_old_shading_until_the_next_one_is_ready() {
    // After the start, which makes pipelines of its own. Hundreds of frames take longer than a few pipelines.
    const LAST: u64 = 500;
    let script = Script { button: vec![press("next_shading", "left", 40, 44)], show: vec![3, 42, LAST], ..patient() };
    let room = Room::with(Script { left_hand: out_of_sight(), right_hand: out_of_sight(), ..script });
    room.view(LAST).assert_clean();
    assert_same(&room.shown(42, 0), &room.shown(3, 0), "the frames after the press");
    assert_different(&room.shown(LAST, 0), &room.shown(3, 0), "the first and the last frame");
}
