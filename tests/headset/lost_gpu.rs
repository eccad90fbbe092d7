//! A GPU that is lost while a headset is on.

use crate::common::fault::FaultLayer;
use crate::common::headset::finish;
use crate::common::room::{Room, patient};

#[test]
fn the_headset_goes_on_with_another_gpu() {
    let room = Room::with(patient());
    let folder = room.workshop.folder.path();
    let layer = FaultLayer::install(folder);
    let arguments = ["view", "scene.toml", "--on", "headset", "--light", "direct", "--frames", "40"];
    let child = room.headset.start_with(folder, &arguments, layer.environment());
    while room.headset.frame() < 10 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    layer.lose_in("vkQueueSubmit2");
    layer.wait();
    let ran = finish(child);
    assert_eq!((ran.code, ran.err.lines().count()), (Some(0), 1), "{ran}");
    let faults = room.headset.calls_of("Fault");
    assert!(faults.is_empty(), "{faults:?}");
    // The runtime was left and joined again, and frames went on after that.
    let calls = room.headset.calls();
    let last_start = calls.iter().rposition(|call| call["call"] == "Init").expect("a start");
    assert!(calls[..last_start].iter().any(|call| call["call"] == "CleanupDone"), "{ran}");
    assert!(calls[last_start..].iter().filter(|call| call["call"] == "Submit").count() >= 80, "{ran}");
}
