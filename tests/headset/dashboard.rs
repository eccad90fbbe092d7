//! The panel on the dashboard: its picture arrives, and the laser mouse changes what the eyes see.

use headset_runtime::script::{Laser, Script, Shown};
use pbr_vr::asset::picture::Picture;

use crate::common::control_in;
use crate::common::room::{Room, assert_same, patient};

/// The overlay's pixels, as `SetOverlayMouseScale` gives them.
const SIZE: [f32; 2] = [960.0, 1200.0];

fn seen(frame: u64, last: u64) -> Vec<Shown> {
    vec![Shown { frame, last: Some(last) }]
}

fn mean(picture: &Picture) -> f32 {
    picture.pixels.iter().flatten().sum::<f32>() / picture.pixels.len() as f32
}

#[test]
fn the_panel_is_seen_on_the_dashboard_and_the_laser_moves_its_exposure() {
    // The first run says where the slider is.
    let room = Room::with(Script { dashboard: seen(20, 60), show: vec![10, 70], ..patient() });
    let ran = room.view_with(&["--frames", "80", "-vv"]);
    ran.assert_clean();
    let calls = room.headset.calls_of("SetOverlayTexture");
    assert!(!calls.is_empty(), "no picture of the panel");
    let frames: Vec<u64> = calls.iter().map(|call| call["frame"].as_u64().expect("a frame")).collect();
    assert!(frames.iter().all(|frame| (20..=60).contains(frame)), "drawn unseen: {frames:?}");
    let panel = Picture::read(&room.headset.picture(frames[frames.len() - 1], "overlay")).expect("the panel's picture");
    assert_eq!([panel.width, panel.height].map(|side| side as f32), SIZE);
    let is = |pixel: &[f32; 3], grey: f32| pixel.iter().all(|c| (c - grey / 255.0).abs() < 0.01);
    let count = |grey: f32| panel.pixels.iter().filter(|pixel| is(pixel, grey)).count();
    assert!(count(24.0) > panel.pixels.len() / 3, "the panel's ground is missing");
    assert!(count(235.0) > 1000, "the panel has no text");
    // It is beside the scene, not in it.
    assert_same(&room.shown(70, 0), &room.shown(10, 0), "before and after the dashboard");

    // Six tenths along the track, whose 140 points are 350 pixels.
    let [[x, y], [width, _]] = control_in(&ran.err, "exposure").expect("the slider");
    let at = [(x - width / 2.0 + 0.6 * 350.0) as f32 / SIZE[0], y as f32 / SIZE[1]];
    let laser = |frame, pressed| Laser { frame, at, pressed };
    let laser = vec![laser(30, None), laser(60, Some(true)), laser(90, Some(false))];
    let room = Room::with(Script { dashboard: seen(20, 130), laser, show: vec![25, 140], ..patient() });
    room.view_with(&["--frames", "150"]).assert_clean();
    let [before, after] = [25, 140].map(|frame| mean(&room.shown(frame, 0)));
    assert!(after > 1.1 * before, "{after} after {before}");
}

#[test]
fn a_runtime_without_overlays_costs_one_line_and_nothing_else() {
    let room = Room::with(Script { no_overlays: true, dashboard: seen(1, 20), ..patient() });
    let ran = room.view(20);
    ran.assert_clean();
    assert_eq!(ran.err.lines().filter(|line| line.contains("dashboard")).count(), 1, "{ran}");
    assert!(room.headset.calls_of("SetOverlayTexture").is_empty());
}
