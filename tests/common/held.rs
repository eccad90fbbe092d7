//! What a process holds while it runs for long, and that this does not grow.

use std::fs;

/// glibc's settings (mallopt(3)) for a process whose resident memory is to be compared with itself: one heap instead of one for
/// each thread, without holes, and what is freed goes back at once. Without them 15 bakes on a busy machine differ by 5 MB, with
/// them by 0.1. They make each frame of a headset slower by half: too much for tens of thousands.
pub const ONE_HEAP: [(&str, &str); 4] = [
    ("MALLOC_ARENA_MAX", "1"),
    ("MALLOC_MMAP_THRESHOLD_", "32768"),
    ("MALLOC_TRIM_THRESHOLD_", "0"),
    ("MALLOC_TOP_PAD_", "0"),
];

/// Memory, open files, threads and mappings of a process.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// How far the run has come: frames, or whatever it counts.
    pub at: u64,
    pub resident_kb: u64,
    pub descriptors: u64,
    pub threads: u64,
    pub mappings: u64,
}

impl Held {
    /// `None` where the process has ended.
    pub fn by(process: u32, at: u64) -> Option<Self> {
        let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
        let number = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            line.split_whitespace().next()?.parse().ok()
        };
        let descriptors = fs::read_dir(format!("/proc/{process}/fd")).ok()?.count() as u64;
        let mappings = fs::read_to_string(format!("/proc/{process}/maps")).ok()?.lines().count() as u64;
        Some(Self { at, resident_kb: number("VmRSS:")?, descriptors, threads: number("Threads:")?, mappings })
    }
}

fn median(mut values: Vec<u64>) -> f64 {
    values.sort_unstable();
    values[values.len() / 2] as f64
}

/// Nothing grows from the first fifth of a run, which warms up, to its end at `last`; `what` names the run, `step_kb` is the
/// memory that a step may keep.
///
/// A leak takes from every part of a run. An allocator, a driver or a pool of threads may take more once, as when the machine
/// is busy, and pages come and go: a third of a percent between the medians of two parts is no leak's, where parts are long. What
/// the driver and the validation layer keep of each step for ever, and holes in the heap, grow with the run; callers say how
/// much less `step_kb` is than what the step would leak. Mappings are also the heap's, which the kernel joins and splits as blocks
/// are freed: up to ten for a part of a run, or half of what would be one for each of its steps, are no leak's.
pub fn assert_flat(what: &str, samples: &[Held], last: u64, step_kb: f64) {
    let part = |from: f64, to: f64| -> Vec<Held> {
        let is_in = |s: &&Held| (from * last as f64..to * last as f64).contains(&(s.at as f64));
        samples.iter().filter(is_in).copied().collect()
    };
    let parts = [0.2, 0.4, 0.6, 0.8].map(|from| part(from, from + 0.2));
    let counts: Vec<usize> = parts.iter().map(Vec::len).collect();
    assert!(counts.iter().all(|count| *count >= 3), "{what}: only {counts:?} samples");
    let medians = |of: fn(&Held) -> u64| parts.each_ref().map(|part| median(part.iter().map(of).collect()));
    let kept_kb = step_kb * 0.2 * last as f64;
    let quantities = [
        ("resident kB", medians(|s| s.resident_kb), kept_kb),
        ("open files", medians(|s| s.descriptors), 0.0),
        ("threads", medians(|s| s.threads), 0.0),
        ("mappings", medians(|s| s.mappings), (0.1 * last as f64).clamp(2.0, 10.0)),
    ];
    for (name, medians, kept) in quantities {
        let growth = [0, 1, 2].map(|i| medians[i + 1] - medians[i]);
        println!("{what}, {last} in all: {name} {medians:?}");
        let least = growth.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least <= kept + medians[0] / 300.0, "{what}: {name} grow: {medians:?}, by {growth:?}");
    }
    // Files and threads are counted, not measured: what is opened once more and never closed is a leak, too. A few samples
    // may miss what others see for a moment.
    if counts.iter().any(|count| *count < 20) {
        return;
    }
    let [early, .., late] = &parts;
    for (name, of) in [("open files", (|s| s.descriptors) as fn(&Held) -> u64), ("threads", |s| s.threads)] {
        let [early, late] = [early, late].map(|part| part.iter().map(of).max().expect("a sample"));
        assert!(late <= early, "{what}: {name}: {early} and then {late}");
    }
}

/// The length of a long run: a variable's, or the one of every test run.
pub fn length(variable: &str, ordinary: u64) -> u64 {
    std::env::var(variable).map_or(ordinary, |n| n.parse().expect("the length of a long run"))
}
