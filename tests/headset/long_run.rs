//! Many frames on a headset: memory and file descriptors stay flat, and nothing is left at the end.

use std::fs;
use std::time::Duration;

use headset_runtime::script::{Script, Waypoint};

use crate::common::headset::{Headset, finish};
use crate::common::{Workshop, material, sphere};

/// Frames of the long run, if not the default.
const FRAMES_VARIABLE: &str = "PBR_VR_LONG_RUN_FRAMES";
const FRAMES: u64 = 20_000;

/// What a process holds.
#[derive(Clone, Copy, Debug)]
struct Held {
    frame: u64,
    resident_kb: u64,
    descriptors: usize,
}

fn held(process: u32, frame: u64) -> Option<Held> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let resident_kb = line.trim().split(' ').next()?.parse().ok()?;
    let descriptors = fs::read_dir(format!("/proc/{process}/fd")).ok()?.count();
    Some(Held { frame, resident_kb, descriptors })
}

fn median(mut values: Vec<u64>) -> f64 {
    values.sort_unstable();
    values[values.len() / 2] as f64
}

#[test]
fn a_long_run_keeps_memory_and_descriptors_flat_and_leaks_nothing() {
    let frames = std::env::var(FRAMES_VARIABLE).map_or(FRAMES, |n| n.parse().expect("a number of frames"));
    let workshop = Workshop::new();
    workshop.sky(0.0);
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    workshop.write("ball.obj", &sphere("gold.mtl"));
    workshop.write("scene.toml", "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"ball.obj\"\n");
    let turn = |frame, yaw| Waypoint { frame, position: [0.0, 1.6, 0.0], rotation_degrees: [yaw, 0.0, 0.0] };
    let script = Script { size: [16, 16], hz: 0.1, head: vec![turn(1, 0.0), turn(frames, 720.0)], ..Script::default() };
    let headset = Headset::install(workshop.0.path(), &script);
    let arguments = ["view", "scene.toml", "--on", "headset", "--frames", &frames.to_string()];
    let mut child = headset.start(workshop.0.path(), &arguments);
    let mut samples = Vec::new();
    while child.try_wait().expect("a child").is_none() {
        samples.extend(held(child.id(), headset.frame()));
        std::thread::sleep(Duration::from_millis(50));
    }
    finish(child).assert_clean();

    let done = headset.calls_of("CleanupDone");
    assert_eq!(done.last().expect("a shutdown")["copied"], 2 * frames);
    let part = |from: f64, to: f64| -> Vec<Held> {
        let is_in = |s: &&Held| (from * frames as f64..to * frames as f64).contains(&(s.frame as f64));
        samples.iter().filter(is_in).copied().collect()
    };
    let parts = [0.2, 0.4, 0.6, 0.8].map(|from| part(from, from + 0.2));
    let samples: Vec<usize> = parts.iter().map(Vec::len).collect();
    assert!(samples.iter().all(|count| *count >= 5), "only {samples:?} samples");
    let resident = parts.each_ref().map(|part| median(part.iter().map(|s| s.resident_kb).collect()));
    let growth: Vec<f64> = resident.windows(2).map(|pair| 100.0 * (pair[1] / pair[0] - 1.0)).collect();
    println!("{frames} frames: {resident:?} kB, {growth:.2?} %");
    // A leak takes from every part; an allocator or a driver may take more once, as when the machine is busy.
    let least = growth.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(3.0 * least <= 1.0, "memory grows by {growth:.2?} %");
    let [early, .., late] = parts;
    let most = |part: &[Held]| part.iter().map(|s| s.descriptors).max().expect("a sample");
    assert!(most(&late) <= most(&early), "descriptors: {} and then {}", most(&early), most(&late));
}
