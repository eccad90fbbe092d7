//! On the headset, end to end with the validation layer: what both eyes are shown, and that nothing which happens to
//! a headset stops the program or leaves something behind.

use headset_runtime::script::{Block, CallError, Event, EyeOptics, Ipd, Lens, PoseLoss, Script, Timing};
use pbr_vr::asset::picture::Picture;
use serde_json::{Value, json};

use crate::common::headset::command;
use crate::common::room::{Room, SIZE, assert_different, assert_same, head, patient};
#[cfg(unix)]
use crate::common::{signal, wait_until};

/// OpenVR's numbers.
const QUIT: u32 = 700;
const IPD_CHANGED: u32 = 105;
const LENS_CHANGED: u32 = 110;
const DASHBOARD: [u32; 2] = [502, 503];

fn optics(tangents: [f32; 4], position: [f32; 3], rotation_degrees: [f32; 3]) -> EyeOptics {
    EyeOptics { tangents, position, rotation_degrees, hidden_triangles: Vec::new() }
}

#[test]
fn both_eyes_are_shown_what_render_writes_for_a_camera_at_the_head() {
    // The camera's frustum, and eyes as far apart as `render --stereo` has them.
    let up = 30f32.to_radians().tan();
    let right = up * SIZE[0] as f32 / SIZE[1] as f32;
    let eye = |x| optics([-right, right, -up, up], [x, 0.0, 0.0], [0.0; 3]);
    let room = Room::with(Script { left: eye(-0.0315), right: eye(0.0315), show: vec![1, 3], ..patient() });
    room.view(3).assert_clean();
    let size = format!("{}x{}", SIZE[0], SIZE[1]);
    let arguments = ["render", "scene.toml", "-o", "out.png", "--stereo", "--size", &size, "--light", "direct"];
    let output = command(room.workshop.folder.path(), &arguments).output().expect("the program");
    assert!(output.status.success());
    let written = ["left", "right"].map(|name| {
        let file = room.workshop.path(&format!("out-{name}.png"));
        Picture::read(&file).expect("a written eye")
    });
    assert_different(&written[0], &written[1], "the two eyes");
    for frame in [1, 3] {
        for (eye, written) in written.iter().enumerate() {
            assert_same(&room.shown(frame, eye), written, &format!("frame {frame}, eye {eye}"));
        }
    }
}

#[test]
fn eyes_with_their_own_frusta_and_canted_displays_see_the_right_thing() {
    let way = [head(1, [0.0; 3], [0.0; 3]), head(5, [0.3, -0.1, -0.5], [-20.0, 5.0, 8.0])];
    for cant in [0.0, 12.0] {
        let room = Room::with(Script {
            left: optics([-1.39, 1.1, -1.4, 1.2], [-0.033, 0.01, 0.0], [cant, 0.0, 0.0]),
            right: optics([-1.0, 1.42, -1.35, 1.25], [0.031, 0.0, 0.005], [-cant, 0.0, 0.0]),
            head: way.to_vec(),
            show: vec![1, 5],
            ..patient()
        });
        room.view(5).assert_clean();
        room.assert_shows(1, &way[0]);
        room.assert_shows(5, &way[1]);
    }
}

#[test]
fn every_frame_is_drawn_for_its_own_pose() {
    let way = [head(2, [0.0; 3], [0.0; 3]), head(12, [0.5, 0.0, 0.0], [-30.0, 0.0, 0.0])];
    let room = Room::with(Script { head: way.to_vec(), show: vec![7, 12], ..patient() });
    room.view(12).assert_clean();
    room.assert_shows(7, &head(7, [0.25, 0.0, 0.0], [-15.0, 0.0, 0.0]));
    room.assert_shows(12, &way[1]);
}

#[test]
fn images_are_submitted_as_runtimes_want_them() {
    let room = Room::with(patient());
    room.view(4).assert_clean();
    let submits = room.headset.calls_of("Submit");
    assert_eq!(submits.len(), 8);
    for (i, submit) in submits.iter().enumerate() {
        assert_eq!(submit["eye"], i % 2, "left before right");
        assert_eq!(submit["code"], 0);
        let image = &submit["image"];
        let formats = [37, 43, 44, 50];
        assert!(formats.iter().any(|format| image["format"] == *format), "8-bit RGBA or BGRA: {image}");
        assert_eq!((&image["samples"], &image["size"]), (&json!(1), &json!(SIZE)));
        assert!(image["color_space"] != 2, "never linear: {image}");
        assert_eq!(image["device"], submits[0]["image"]["device"]);
    }
    assert_ne!(submits[0]["image"]["image"], submits[1]["image"]["image"], "an image for each eye");
    let names: Vec<String> = names(&room.headset.calls());
    let count = |name: &str| names.iter().filter(|n| *n == name).count();
    assert_eq!([count("Frame"), count("PostPresentHandoff")], [4, 4]);
    let position = |name: &str| names.iter().rposition(|n| n == name).unwrap_or_else(|| panic!("no {name}"));
    let order = [
        "Init",
        "GetVulkanInstanceExtensionsRequired",
        "GetOutputDevice",
        "GetVulkanDeviceExtensionsRequired",
        "WaitGetPoses",
        "Submit",
        "Cleanup",
    ];
    assert!(order.is_sorted_by_key(|name| position(name)), "{names:?}");
    assert_eq!(names.last().map(String::as_str), Some("CleanupDone"));
}

fn names(calls: &[Value]) -> Vec<String> {
    calls.iter().map(|call| call["call"].as_str().expect("a name").to_owned()).collect()
}

#[test]
fn an_ipd_that_changes_moves_the_eyes() {
    let at = head(1, [0.0; 3], [0.0; 3]);
    let room = Room::with(Script { ipd: vec![Ipd { frame: 4, metres: 0.4 }], show: vec![3, 6], ..patient() });
    room.view(6).assert_clean();
    room.assert_shows(3, &at);
    let eye = |x| optics([-1.0, 1.0, -1.0, 1.0], [x, 0.0, 0.0], [0.0; 3]);
    room.assert_shows_eyes(6, &room.eyes_with(&at, [&eye(-0.2), &eye(0.2)]));
    assert_different(&room.shown(3, 0), &room.shown(6, 0), "before and after");
    assert!(room.headset.calls_of("PollNextEvent").iter().any(|call| call["event"] == IPD_CHANGED));
}

#[test]
fn lenses_that_change_change_the_frusta() {
    let at = head(1, [0.0; 3], [0.0; 3]);
    let (left, right) = ([-1.2, 0.8, -1.0, 1.1], [-0.8, 1.2, -1.0, 1.1]);
    let lens = Lens { frame: 4, left_tangents: left, right_tangents: right };
    let room = Room::with(Script { lens: vec![lens], show: vec![3, 6], ..patient() });
    room.view(6).assert_clean();
    room.assert_shows(3, &at);
    let eye = |tangents, x| optics(tangents, [x, 0.0, 0.0], [0.0; 3]);
    room.assert_shows_eyes(6, &room.eyes_with(&at, [&eye(left, -0.0315), &eye(right, 0.0315)]));
    assert!(room.headset.calls_of("PollNextEvent").iter().any(|call| call["event"] == LENS_CHANGED));
}

#[test]
fn told_to_quit_it_acknowledges_stops_and_shuts_down_at_once() {
    let room = Room::with(Script { event: vec![Event { frame: 5, number: QUIT, device: 0 }], ..patient() });
    room.view_with(&[]).assert_clean();
    let calls = room.headset.calls();
    let told = calls.iter().rposition(|c| c["call"] == "PollNextEvent" && c["event"] == QUIT).expect("the event");
    let after = names(&calls[told + 1..]);
    let acknowledged = after.iter().position(|n| n == "AcknowledgeQuit_Exiting").expect("an acknowledgement");
    assert!(!after[acknowledged..].iter().any(|n| n == "WaitGetPoses" || n == "Submit"), "{after:?}");
    assert_eq!(after[after.len() - 2..], ["Cleanup", "CleanupDone"]);
    let frames = calls.last().expect("a call")["frame"].as_u64().expect("a frame");
    assert!((5..=6).contains(&frames), "stopped in frame {frames}");
    let ms = |call: &Value| call["ms"].as_f64().expect("a time");
    let took = ms(calls.last().expect("a call")) - ms(&calls[told]);
    assert!(took < 3000.0, "{took} ms from the event to the end of the shutdown");
}

/// Runs with an error code in frames 3 and 4 of 8.
fn run_with_error(in_submit: bool, code: u32) -> (Room, crate::common::headset::Ran) {
    let error = vec![CallError { frame: 3, last: Some(4), code }];
    let script = patient();
    let room = Room::with(if in_submit {
        Script { submit_error: error, ..script }
    } else {
        Script { wait_error: error, ..script }
    });
    let ran = room.view(8);
    (room, ran)
}

#[test]
fn errors_that_pass_do_not_stop_it() {
    // Request failed, no focus, invalid texture, index out of range, submitted already, invalid bounds, one not known yet.
    for code in [1, 101, 102, 107, 108, 109, 4711] {
        for in_submit in [true, false] {
            let (room, ran) = run_with_error(in_submit, code);
            ran.assert_clean();
            let calls = room.headset.calls();
            assert_eq!(calls.last().expect("a call")["call"], "CleanupDone", "{code}: {ran}");
            let shown = calls.iter().filter(|c| c["call"] == "Submit" && c["code"] == 0).map(|c| c["frame"].as_u64());
            assert!(shown.max().flatten() >= Some(8), "{code}, in Submit {in_submit}: it stopped: {ran}");
        }
    }
}

#[test]
fn errors_of_our_own_making_end_it_with_a_line_that_says_what_to_do() {
    // Not a scene application, wrong device, unsupported format, shared textures not supported.
    for code in [103, 104, 105, 106] {
        for in_submit in [true, false] {
            let (room, ran) = run_with_error(in_submit, code);
            ran.assert_fails_with(&["headset", &code.to_string()]);
            assert!(!ran.err.contains("validation"), "{ran}");
            let calls = room.headset.calls();
            assert_eq!(calls.last().expect("a call")["call"], "CleanupDone", "{code}: no shutdown: {ran}");
        }
    }
}

#[test]
fn without_a_pose_it_keeps_the_last_one() {
    let way = [head(2, [0.0; 3], [0.0; 3]), head(12, [0.5, 0.0, 0.0], [-30.0, 0.0, 0.0])];
    let loss = |frame, last, result| PoseLoss { frame, last: Some(last), result, valid: false };
    let room = Room::with(Script {
        head: way.to_vec(),
        // Out of range, and a way to be lost that OpenVR's Rust binding does not know.
        pose: vec![loss(8, 9, 201), loss(10, 10, 300)],
        show: vec![7, 9, 10, 12],
        ..patient()
    });
    room.view(12).assert_clean();
    let seventh = head(7, [0.25, 0.0, 0.0], [-15.0, 0.0, 0.0]);
    for frame in [7, 9, 10] {
        room.assert_shows(frame, &seventh);
    }
    room.assert_shows(12, &way[1]);
}

#[test]
fn a_head_known_by_its_rotation_alone_is_followed() {
    let way = [head(2, [0.0; 3], [0.0; 3]), head(12, [0.5, 0.0, 0.0], [-30.0, 0.0, 0.0])];
    let pose = PoseLoss { frame: 7, last: None, result: 300, valid: true };
    let room = Room::with(Script { head: way.to_vec(), pose: vec![pose], show: vec![7], ..patient() });
    room.view(8).assert_clean();
    room.assert_shows(7, &head(7, [0.25, 0.0, 0.0], [-15.0, 0.0, 0.0]));
}

#[test]
fn it_starts_without_a_pose_and_without_focus() {
    let pose = PoseLoss { frame: 1, last: Some(3), result: 1, valid: false };
    let error = CallError { frame: 1, last: Some(2), code: 101 };
    let (wait_error, submit_error) = (vec![error.clone()], vec![error]);
    let room = Room::with(Script { pose: vec![pose], wait_error, submit_error, show: vec![5], ..patient() });
    room.view(5).assert_clean();
    room.assert_shows(5, &head(1, [0.0; 3], [0.0; 3]));
}

#[test]
fn the_dashboard_takes_the_focus_and_gives_it_back() {
    let [up, down] = DASHBOARD;
    let event = |frame, number| Event { frame, number, device: 0 };
    let error = CallError { frame: 4, last: Some(6), code: 101 };
    let room = Room::with(Script {
        event: vec![event(4, up), event(7, down)],
        submit_error: vec![error],
        show: vec![9],
        ..patient()
    });
    room.view(9).assert_clean();
    room.assert_shows(9, &head(1, [0.0; 3], [0.0; 3]));
    let submits = room.headset.calls_of("Submit");
    assert_eq!(submits.len(), 18, "it keeps submitting");
}

#[test]
fn a_submit_that_blocks_is_noticed_and_told() {
    let room = Room::with(Script { block_submit: vec![Block { frame: 3, seconds: 6.0 }], ..patient() });
    let ran = room.view(5);
    ran.assert_clean();
    assert!(ran.err.contains("Submit") && ran.err.contains("cable"), "{ran}");
}

#[test]
fn a_submit_that_never_comes_back_ends_it_with_a_report() {
    let room = Room::with(Script { block_submit: vec![Block { frame: 6, seconds: 600.0 }], ..patient() });
    let ran = room.view_with(&[]);
    ran.assert_fails_with(&["Submit never came back"]);
    assert!(ran.out.contains("hidden by the lenses"), "no summary: {ran}");
    let report = room.report();
    assert_eq!((&report["frames"], &report["ended"]), (&json!(5), &json!("Submit never came back")));
    assert_eq!(report["timeline"].as_array().map(Vec::len), Some(5));
}

#[test]
fn messages_about_the_runtimes_own_vulkan_calls_are_no_failure_and_counted() {
    let room = Room::with(Script { bad_vulkan: vec![3, 4], ..patient() });
    let ran = room.view(6);
    assert_eq!(ran.code, Some(0), "{ran}");
    let told: Vec<&str> = ran.err.lines().filter(|line| line.contains("validation")).collect();
    assert!(told.len() == 1 && told[0].contains("runtime's own calls"), "{ran}");
    let messages = room.report()["runtime_messages"].as_u64().expect("a number");
    assert!(messages >= 4, "two frames of two eyes: {messages}");
    assert!(ran.out.contains(&format!("{messages} message(s) of the validation layer")), "{ran}");
}

#[test]
fn what_the_lenses_hide_is_left_black_and_the_rest_drawn() {
    let eye = |x, triangle| EyeOptics {
        hidden_triangles: vec![triangle],
        ..optics([-1.0, 1.0, -1.0, 1.0], [x, 0.0, 0.0], [0.0; 3])
    };
    // The lower left corner of one eye, the upper right one of the other.
    let left = eye(-0.0315, [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]]);
    let right = eye(0.0315, [[1.0, 1.0], [0.5, 1.0], [1.0, 0.5]]);
    let room = Room::with(Script { left, right, show: vec![2], ..patient() });
    room.view(3).assert_clean();
    let drawn = room.drawn(&room.eyes(&head(1, [0.0; 3], [0.0; 3])));
    for (eye, drawn) in drawn.iter().enumerate() {
        let shown = room.shown(2, eye);
        let mut seen = [0, 0];
        for i in 0..drawn.pixels.len() {
            let at = [i % SIZE[0] as usize, i / SIZE[0] as usize];
            let [u, down] = [0, 1].map(|axis| (at[axis] as f32 + 0.5) / SIZE[axis] as f32);
            // How far inside the triangle; its edge is smoothed.
            let inside = if eye == 0 { 0.5 - (u + 1.0 - down) } else { (u + 1.0 - down) - 1.5 };
            if inside > 0.03 {
                assert_eq!(shown.pixels[i][..3], [0.0; 3], "eye {eye}, hidden pixel {at:?}");
                seen[0] += 1;
            } else if inside < -0.03 {
                assert_eq!(shown.pixels[i], drawn.pixels[i], "eye {eye}, pixel {at:?}");
                seen[1] += 1;
            }
        }
        assert!(seen[0] > 1000 && seen[1] > 9000, "{seen:?}");
    }
    for share in room.report()["hidden_area_share"].as_array().expect("shares") {
        assert!((share.as_f64().expect("a share") - 0.125).abs() < 2e-3, "an eighth of the pixels is saved: {share}");
    }
}

#[test]
fn what_is_too_slow_is_drawn_smaller_into_the_same_images() {
    // Nobody keeps up with this display.
    let room = Room::with(Script { hz: 5000.0, show_every: 10, ..patient() });
    room.view(200).assert_clean();
    let submits = room.headset.calls_of("Submit");
    let images: std::collections::BTreeSet<u64> = submits.iter().filter_map(|s| s["image"]["image"].as_u64()).collect();
    assert!(images.len() <= 2 * 3, "{} images for two eyes and the frames in flight", images.len());
    assert!(submits.iter().all(|s| s["image"]["size"] == json!(SIZE)));
    let last = submits.last().expect("a frame");
    let bounds: Vec<f64> =
        last["image"]["bounds"].as_array().expect("bounds").iter().filter_map(Value::as_f64).collect();
    assert!(bounds[..2] == [0.0, 0.0] && bounds[2] < 0.95 && bounds[3] < 0.95, "{bounds:?}");
    // The smaller picture shows the same.
    let shown = room.shown(200, 0);
    let size = [shown.width, shown.height];
    assert!(size[0] < SIZE[0], "{size:?}");
    let drawn = room.drawn_at(&room.eyes(&head(1, [0.0; 3], [0.0; 3])), size);
    assert_same(&shown, &drawn[0], "the smaller picture");
}

#[test]
fn beyond_the_edge_of_a_smaller_picture_its_last_texels_are_repeated() {
    let room = Room::with(Script { hz: 5000.0, show_every: 10, show_border: true, ..patient() });
    room.view(100).assert_clean();
    let mut smaller = 0;
    for frame in (10..=100).step_by(10) {
        for eye in 0..2 {
            let shown = room.shown(frame, eye);
            let [width, height] = [shown.width, shown.height].map(|side| side as usize);
            if [shown.width, shown.height] == SIZE {
                continue;
            }
            smaller += 1;
            let at = |x: usize, y: usize| shown.pixels[y * width + x];
            assert!((0..height).all(|y| at(width - 1, y) == at(width - 2, y)), "frame {frame}, eye {eye}: last column");
            assert!((0..width).all(|x| at(x, height - 1) == at(x, height - 2)), "frame {frame}, eye {eye}: last row");
        }
    }
    assert!(smaller > 0, "no picture was smaller");
}

#[cfg(unix)]
#[test]
fn a_signal_ends_it_with_report_summary_and_shutdown() {
    for name in ["INT", "TERM"] {
        let room = Room::with(patient());
        let arguments = ["view", "scene.toml", "--on", "headset", "--report", "report.json", "--light", "direct"];
        let child = room.headset.start(room.workshop.folder.path(), &arguments);
        wait_until("frames", || room.headset.frame() >= 10);
        signal(child.id(), name);
        let ran = crate::common::headset::finish(child);
        ran.assert_clean();
        assert!(ran.out.contains("frames") && ran.out.contains("hidden by the lenses"), "no summary: {ran}");
        assert!(room.report()["frames"].as_u64().is_some_and(|frames| frames >= 10));
        assert_eq!(room.headset.calls().last().expect("a call")["call"], "CleanupDone");
    }
}

#[cfg(unix)]
#[test]
fn a_second_signal_ends_it_at_once() {
    let room = Room::with(Script { block_submit: vec![Block { frame: 5, seconds: 600.0 }], ..patient() });
    let child = room
        .headset
        .start(room.workshop.folder.path(), &["view", "scene.toml", "--on", "headset", "--light", "direct"]);
    wait_until("frames", || !room.headset.calls_of("SubmitBlocks").is_empty());
    signal(child.id(), "INT");
    std::thread::sleep(std::time::Duration::from_millis(500));
    signal(child.id(), "TERM");
    let ran = crate::common::headset::finish(child);
    assert!(ran.code == Some(130) && ran.took.as_secs() < 10, "{ran}");
}

#[test]
fn extensions_that_the_runtime_asks_for_are_enabled_or_missing_ones_told() {
    // Both are part of Vulkan 1.3 and yet must be enabled by name.
    let script = Script {
        instance_extensions: "VK_KHR_get_physical_device_properties2 VK_KHR_external_memory_capabilities".into(),
        device_extensions: "VK_KHR_dedicated_allocation VK_KHR_get_memory_requirements2".into(),
        ..patient()
    };
    Room::with(script).view(2).assert_clean();
    let instance = Script { instance_extensions: "VK_NOBODY_has_this".into(), ..patient() };
    let device_extensions = "VK_NOBODY_has_that VK_KHR_dedicated_allocation".into();
    let device = Script { device_extensions, ..patient() };
    Room::with(instance).view(2).assert_fails_with(&["VK_NOBODY_has_this"]);
    // Runtimes ask for more of the device than they need.
    let ran = Room::with(device.clone()).view(2);
    ran.assert_clean();
    let lines: Vec<&str> = ran.err.lines().filter(|line| line.contains("VK_NOBODY_has_that")).collect();
    assert!(lines.len() == 1 && lines[0].contains("WARN") && !ran.err.contains("VK_KHR"), "{ran}");
    // Where no picture is ever taken, that may be why; once one was taken, it is not.
    let refuse = |frame| vec![CallError { frame, last: None, code: 105 }];
    let first = Script { submit_error: refuse(1), ..device.clone() };
    Room::with(first).view(3).assert_fails_with(&["105", "VK_NOBODY_has_that"]);
    let ran = Room::with(Script { submit_error: refuse(2), ..device }).view(3);
    ran.assert_fails_with(&["105"]);
    assert!(!ran.err.lines().last().is_some_and(|line| line.contains("VK_NOBODY")), "{ran}");
}

#[test]
fn a_runtime_that_names_no_gpu_leaves_the_choice_to_us() {
    Room::with(Script { gpu: -1, ..patient() }).view(2).assert_clean();
}

#[test]
fn a_runtime_that_names_a_gpu_nobody_knows_leaves_the_choice_to_us_too() {
    let ran = Room::with(Script { gpu: -2, ..patient() }).view(2);
    ran.assert_clean();
    assert!(ran.err.lines().filter(|line| line.contains("WARN") && line.contains("GPU")).count() == 1, "{ran}");
}

#[test]
fn dropped_and_reprojected_frames_are_counted_and_told() {
    let timing = Timing { frame: 3, last: Some(6), dropped: 1, presents: 2, reprojection_flags: 2 };
    let room = Room::with(Script { timing: vec![timing], ..patient() });
    room.view(10).assert_clean();
    let counts = &room.report()["compositor"];
    assert_eq!([&counts["dropped"], &counts["reprojected"], &counts["late_gpu"]], [4, 4, 4], "{counts}");
}

#[test]
fn a_runtime_that_dies_takes_the_program_along_but_not_the_next_start() {
    use headset_runtime::script::Death;
    let room = Room::with(Script { die: vec![Death { frame: 4 }], ..patient() });
    let ran = room.view(8);
    assert_ne!(ran.code, Some(0), "{ran}");
    assert_eq!(room.headset.calls().last().expect("a call")["call"], "Die");
    // What was written is whole: the next start reads it.
    room.headset.rewrite(&patient());
    room.view(2).assert_clean();
}
