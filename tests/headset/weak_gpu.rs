//! A headset on a GPU that has no more than Vulkan 1.3 and the program require.

use crate::common::fault::FaultLayer;
use crate::common::headset::finish;
use crate::common::room::{Room, patient};

#[test]
fn a_gpu_without_options_shows_what_others_show() {
    let room = Room::with(patient());
    let folder = room.workshop.0.path();
    let layer = FaultLayer::install(folder);
    let arguments = ["view", "scene.toml", "--on", "headset", "--light", "direct", "--frames", "4"];
    let ran = finish(room.headset.start_with(folder, &arguments, layer.weak("bare")));
    ran.assert_clean();
    assert_eq!(ran.err, "", "{ran}");
    assert!(room.headset.calls_of("Submit").len() >= 8, "{ran}");
    assert!(room.headset.calls_of("Fault").is_empty(), "{ran}");
}
