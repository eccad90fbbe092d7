//! A headset on a GPU that has no more than Vulkan 1.3 and the program require.

use crate::common::fault::FaultLayer;
use crate::common::headset::{command, finish};
use crate::common::room::{Room, patient};
use crate::common::wall::{four_large, told_mib};
#[cfg(target_os = "linux")]
use crate::desktop::{Display, ESCAPE, Hands, Program};

#[test]
fn a_gpu_without_options_shows_what_others_show() {
    let room = Room::with(patient());
    let folder = room.workshop.folder.path();
    let layer = FaultLayer::install(folder);
    let arguments = ["view", "scene.toml", "--on", "headset", "--light", "direct", "--frames", "4"];
    let ran = finish(room.headset.start_with(folder, &arguments, layer.weak("bare")));
    ran.assert_clean();
    assert_eq!(ran.err, "", "{ran}");
    assert!(room.headset.calls_of("Submit").len() >= 8, "{ran}");
    assert!(room.headset.calls_of("Fault").is_empty(), "{ran}");
}

/// Other programs take memory while a scene is shown: frames go on, with textures that have lost levels, until memory is back.
#[cfg(target_os = "linux")]
#[test]
fn frames_go_on_while_textures_give_memory_back() {
    let Some(display) = Display::start() else { return };
    let room = Room::with(patient());
    let folder = room.workshop.folder.path();
    four_large(&room.workshop);
    let layer = FaultLayer::install(folder);
    layer.set_budget(200);
    let arguments = ["view", "wall.toml", "--on", "headset", "--light", "direct", "--textures", "raw", "--validate"];
    let mut command = command(folder, &arguments);
    command.envs(room.headset.environment()).envs(layer.with_budget("memory:256"));
    let mut program = Program::spawn(&display, command);
    program.wait_for("headset");
    Hands::on(&display).resize([64, 64]);
    layer.set_budget(20);
    assert!(program.until_from(0, "never said", |errors| errors.lines().count()), "{}", program.errors());
    let said = program.errors();
    let [after, before] = told_mib(&said);
    assert!(said.contains("WARN") && after < 0.3 * before, "{said}");
    layer.set_budget(200);
    let told = program.wait_for("GPU memory");
    assert_eq!(told_mib(&told), [before, after], "{told}");
    let last = room.headset.frame() + 3;
    while room.headset.frame() < last {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    Hands::on(&display).press(&[ESCAPE]);
    assert_eq!(program.end(), (Some(0), said));
    let faults = room.headset.calls_of("Fault");
    assert!(faults.is_empty(), "{faults:?}");
    // Each frame was submitted for both eyes.
    let submitted: Vec<u64> =
        room.headset.calls_of("Submit").iter().map(|call| call["frame"].as_u64().expect("a frame")).collect();
    let first = submitted[0];
    assert!(submitted.iter().enumerate().all(|(i, frame)| *frame == first + i as u64 / 2), "{submitted:?}");
}
