//! The panel on the dashboard: its picture arrives, and the laser mouse changes what the eyes see.

use headset_runtime::script::{Laser, Script, Shown};
use pbr_vr::asset::picture::Picture;

use crate::common::room::{Room, assert_same, patient};

/// The overlays' keys and pixels, as `SetOverlayMouseScale` gives them.
pub const DASHBOARD: &str = "pbr-vr.panel";
pub const SIZE: [f32; 2] = [960.0, 1200.0];

pub fn seen(frame: u64, last: u64) -> Vec<Shown> {
    vec![Shown { frame, last: Some(last) }]
}

pub fn mean(picture: &Picture) -> f32 {
    picture.pixels.iter().flatten().sum::<f32>() / picture.pixels.len() as f32
}

/// Frames in which an overlay was given a picture.
pub fn pictures_of(room: &Room, overlay: &str) -> Vec<u64> {
    let calls = room.headset.calls_of("SetOverlayTexture");
    let of_overlay = calls.iter().filter(|call| call["overlay"] == overlay);
    of_overlay.map(|call| call["frame"].as_u64().expect("a frame")).collect()
}

/// The picture is the panel's.
pub fn assert_panel(panel: &Picture) {
    assert_eq!([panel.width, panel.height].map(|side| side as f32), SIZE);
    let is = |pixel: &[f32; 3], grey: f32| pixel.iter().all(|c| (c - grey / 255.0).abs() < 0.01);
    let count = |grey: f32| panel.pixels.iter().filter(|pixel| is(pixel, grey)).count();
    assert!(count(24.0) > panel.pixels.len() / 3, "the panel's ground is missing");
    assert!(count(235.0) > 1000, "the panel has no text");
}

/// Where six tenths of the exposure's track are, whose 140 points are 350 pixels; parts of the panel.
pub fn exposure_in(log: &str) -> [f32; 2] {
    let [[x, y], [width, _]] = crate::common::control_in(log, "exposure").expect("the slider");
    [(x - width / 2.0 + 0.6 * 350.0) as f32 / SIZE[0], y as f32 / SIZE[1]]
}

#[test]
fn the_panel_is_seen_on_the_dashboard_and_the_laser_moves_its_exposure() {
    // The first run says where the slider is.
    let room = Room::with(Script { dashboard: seen(20, 60), show: vec![10, 70], ..patient() });
    let ran = room.view_with(&["--frames", "80", "-vv"]);
    ran.assert_clean();
    let frames = pictures_of(&room, DASHBOARD);
    assert!(!frames.is_empty(), "no picture of the panel");
    assert!(frames[0] >= 20, "drawn unseen: {frames:?}");
    // One may be under way when the dashboard goes away.
    assert!(frames.iter().filter(|frame| **frame > 60).count() <= 1, "drawn unseen: {frames:?}");
    assert_panel(&Picture::read(&room.headset.picture(frames[frames.len() - 1], "overlay")).expect("a picture"));
    // It is beside the scene, not in it.
    assert_same(&room.shown(70, 0), &room.shown(10, 0), "before and after the dashboard");

    let at = exposure_in(&ran.err);
    let laser = |frame, pressed| Laser { frame, held: false, at, pressed };
    let laser = vec![laser(30, None), laser(60, Some(true)), laser(90, Some(false))];
    let room = Room::with(Script { dashboard: seen(20, 130), laser, show: vec![25, 140], ..patient() });
    room.view_with(&["--frames", "150"]).assert_clean();
    let [before, after] = [25, 140].map(|frame| mean(&room.shown(frame, 0)));
    assert!(after > 1.1 * before, "{after} after {before}");
}

#[test]
fn a_runtime_without_overlays_costs_one_line_and_nothing_else() {
    let room = Room::with(Script {
        refused_overlays: vec!["dashboard".into(), "held".into()],
        dashboard: seen(1, 20),
        ..patient()
    });
    let ran = room.view(20);
    ran.assert_clean();
    assert_eq!(ran.err.lines().filter(|line| line.contains("dashboard")).count(), 1, "{ran}");
    assert!(room.headset.calls_of("SetOverlayTexture").is_empty());
}

#[test]
fn no_frame_waits_for_the_panel_to_be_shown() {
    // A picture is taken only once the next frame has begun: frames that waited for it would never begin, which the
    // runtime says after a while. None is begun near the end, after which no frame begins.
    let room = Room::with(Script { is_overlay_slow: true, dashboard: seen(5, 300), ..patient() });
    room.view(400).assert_clean();
    let calls = room.headset.calls();
    let name = |at: usize| calls[at]["call"].as_str().expect("a name");
    let begun: Vec<usize> = (0..calls.len()).filter(|at| name(*at) == "SetOverlayTexture").collect();
    assert!(begun.len() > 2, "{} pictures", begun.len());
    // What a picture can delay is the frame that begins meanwhile: none is drawn before the call is over, and none
    // begins but one.
    for from in begun {
        let meanwhile: Vec<&str> =
            (from + 1..calls.len()).map(name).take_while(|n| *n != "SetOverlayTextureEnds").collect();
        let count = |wanted: &str| meanwhile.iter().filter(|name| **name == wanted).count();
        assert!(count("Frame") <= 1, "{meanwhile:?}");
        for uses_queue in ["SubmitExplicitTimingData", "Submit", "PostPresentHandoff"] {
            assert_eq!(count(uses_queue), 0, "the queue is the call's: {meanwhile:?}");
        }
    }
    let submits = room.headset.calls_of("Submit");
    assert!(submits.len() == 800 && submits.iter().all(|submit| submit["code"] == 0), "{} eyes", submits.len());
}
