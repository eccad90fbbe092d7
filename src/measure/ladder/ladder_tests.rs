//! Made-up ladders: what is said of them, what is chosen, and what is tried together.

use super::*;

/// Settings by flags, time and FLIP; the first must be the default.
pub fn ladder(rungs: &[(&str, f64, f64)]) -> Ladder {
    let default_ms = rungs[0].1;
    let rung = |&(flags, ms, flip): &(&str, f64, f64)| {
        let ratio = ms / default_ms;
        let spread = |middle: f64| Spread { median: middle, low: 0.99 * middle, high: 1.01 * middle };
        let cost = Cost { frames: 100, gpu_ms: spread(ms), cpu_ms: None, record_ms: spread(0.1) };
        let dimension = flags.split(' ').next().unwrap().to_owned();
        Rung {
            dimension,
            flags: flags.into(),
            cost,
            ratio: spread(ratio),
            default_gpu_ms: default_ms,
            ms,
            error: error(flip),
            beaten_by: None,
            within_noise: false,
        }
    };
    let exact = ExactFacts { frames: 32, fineness: 4, gpu_ms: 2000.0, standard_error: 0.001, floor: error(0.0005) };
    let mut ladder = Ladder {
        scene: "a scene".into(),
        gpu: "a GPU".into(),
        driver: "a driver".into(),
        date: "2026-01-31".into(),
        size: [384, 216],
        time: "GPU time".into(),
        exact,
        rungs: rungs.iter().map(rung).collect(),
        notes: Vec::new(),
    };
    ladder.settle();
    ladder
}

fn error(flip: f64) -> PictureError {
    PictureError { flip, flip_max: 10.0 * flip, relative_mse: flip * flip }
}

#[test]
fn a_default_that_is_beaten_is_said_so_unless_it_is_noise() {
    let said = |rungs: &[(&str, f64, f64)]| ladder(rungs).verdict().remove(0);
    let default = ("", 8.0, 0.010);
    assert!(said(&[default, ("--a", 4.0, 0.02), ("--b", 9.0, 0.005)]).ends_with("is on the front"));
    assert!(said(&[default, ("--a", 4.0, 0.009)]).contains("IS NOT ON THE FRONT: it is beaten by --a"));
    assert!(said(&[default, ("--a", 8.0, 0.005)]).contains("NOT ON THE FRONT"), "as quick, but clearly more accurate");
    assert!(said(&[default, ("--a", 7.999, 0.0099)]).contains("less than can be told"));
    let blurred = ladder(&[("", 8.0, 0.001)]).verdict();
    assert!(blurred[1].contains("own error"), "{blurred:?}");
}

#[test]
fn a_default_drawn_twice_is_one_time_itself() {
    let mut twice = ladder(&[("", 8.0, 0.01), ("--a", 16.0, 0.02)]);
    twice.rungs[0].ratio.median = 1.03;
    twice.rungs[1].default_gpu_ms = 10.0;
    twice.settle();
    assert_eq!(twice.rungs[0].ms, 10.0, "the median of the default's times; of two, the later");
    assert_eq!(twice.rungs[1].ms, 20.0, "a ratio of it");
}

#[test]
fn choices_are_said_in_a_line_and_so_is_that_there_is_none() {
    let ladder = ladder(&[("", 8.0, 0.010), ("--a", 4.0, 0.02), ("--b", 9.0, 0.005)]);
    let limit = Limit::Tolerance(0.02);
    let rung = ladder.choice(limit).unwrap();
    assert_eq!(rung.flags, "--a");
    let said = ladder.words(limit, rung);
    assert!(said.contains("--a (4.00 ms, FLIP 0.0200, measured at 384x216 on 2026-01-31)"), "{said}");
    assert_eq!(ladder.choice(Limit::BudgetMs(8.5)).unwrap().name(), "default");
    assert!(ladder.choice(Limit::Tolerance(0.001)).unwrap_err().contains("the best has FLIP 0.0050"));
    assert!(ladder.choice(Limit::BudgetMs(1.0)).unwrap_err().contains("the best has 4.00 ms"));
}

#[test]
fn settings_of_others_are_no_part_of_combinations() {
    let mut ladder = ladder(&[("", 8.0, 0.010), ("--samples 1", 4.0, 0.02), ("--cube-size 64", 6.0, 0.02)]);
    assert_eq!(ladder.combinations(), ["--samples 1 --cube-size 64"]);
    ladder.rungs[2].dimension = rungs::KNOWN[0].0.into();
    assert!(ladder.combinations().is_empty());
}
