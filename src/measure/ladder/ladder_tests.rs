//! Made-up ladders: what is said of them, what is chosen, and what is tried together.

use super::*;

/// What of a difference of FLIP cannot be told in [`ladder`].
const NOISE: f64 = 0.0005;

/// Settings by flags, time and FLIP; the first must be the default.
pub fn ladder(rungs: &[(&str, f64, f64)]) -> Ladder {
    let default_ms = rungs[0].1;
    let rung = |(index, &(flags, ms, flip)): (usize, &(&str, f64, f64))| {
        // Noise in a block of its own: any two differ by it in two blocks.
        let half = |noise: f64| {
            let mut blocks = vec![0.0; rungs.len() + 1];
            (blocks[index], blocks[rungs.len()]) = (noise, flip);
            blocks
        };
        let off = NOISE / 8f64.sqrt();
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
            halves: Halves([half(off), half(-off)]),
            flip_over_default: 0.0,
            flip_noise: 0.0,
            beaten_by: None,
            within_noise: false,
        }
    };
    let exact = ExactFacts {
        frames: 32,
        fineness: 4,
        gpu_ms: 2000.0,
        standard_error: 0.001,
        floor: error(0.0005),
        pixels_per_degree: PIXELS_PER_DEGREE,
    };
    let mut ladder = Ladder {
        scene: "a scene".into(),
        gpu: "a GPU".into(),
        driver: "a driver".into(),
        date: "2026-01-31".into(),
        size: [384, 216],
        time: "GPU time".into(),
        exact,
        rungs: rungs.iter().enumerate().map(rung).collect(),
        notes: Vec::new(),
    };
    ladder.settle();
    ladder
}

fn error(flip: f64) -> PictureError {
    PictureError { flip, flip_max: 10.0 * flip, relative_mse: flip * flip }
}

#[test]
fn a_default_that_is_beaten_is_said_so_and_so_is_what_cannot_be_told() {
    let said = |rungs: &[(&str, f64, f64)]| ladder(rungs).verdict().remove(0);
    let default = ("", 8.0, 0.010);
    assert!(said(&[default, ("--a", 4.0, 0.02), ("--b", 9.0, 0.005)]).ends_with("is on the front"));
    assert!(said(&[default, ("--a", 4.0, 0.009)]).contains("IS NOT ON THE FRONT: it is beaten by --a"));
    let doubted = said(&[default, ("--a", 2.0, 0.0102), ("--b", 1.0, 0.0106)]);
    let words =
        "is on the front, but in FLIP cannot be told from --a at 0.25 ± 0.00 of its time (FLIP +0.00020 ± 0.00050)";
    assert!(doubted.ends_with(words), "{doubted}");
    let beaten = said(&[default, ("--a", 2.0, 0.0098)]);
    let words =
        "is beaten by --a at 0.25 ± 0.00 of its time (FLIP -0.00020 ± 0.00050), but in one of both by less than";
    assert!(beaten.contains(words), "{beaten}");
    let as_quick = said(&[default, ("--a", 8.0, 0.005)]);
    assert!(
        as_quick.contains("but in time cannot be told from --a at 1.00") && as_quick.contains("FLIP -0.00500"),
        "{as_quick}"
    );
    assert!(said(&[default, ("--a", 7.999, 0.0099)]).ends_with("is on the front"), "as good, as far as can be told");
    // Errors ten times as large: noise hides little of them, and a hundredth does not count.
    let little = said(&[("", 8.0, 0.1), ("--a", 2.0, 0.1009)]);
    assert!(little.contains("on the front, but in FLIP less than 1 % better than --a at 0.25"), "{little}");
    assert!(said(&[("", 8.0, 0.1), ("--a", 2.0, 0.1011)]).ends_with("is on the front"), "told, and more than 1 %");
    let blurred = ladder(&[("", 8.0, 0.001)]).verdict();
    assert!(blurred[1].contains("own error"), "{blurred:?}");
}

#[test]
fn what_the_default_and_others_differ_by_is_kept_without_what_it_came_from() {
    let ladder = ladder(&[("", 8.0, 0.010), ("--a", 4.0, 0.0102)]);
    let [default, other] = [0, 1].map(|i| (ladder.rungs[i].flip_over_default, ladder.rungs[i].flip_noise));
    assert_eq!(default, (0.0, 0.0), "the default differs from itself by nothing, for sure");
    assert!((other.0 - 0.0002).abs() < 1e-12 && (other.1 - NOISE).abs() < 1e-12, "{other:?}");
    let text = serde_json::to_string(&ladder).unwrap();
    assert!(text.contains("\"flip_noise\":0.0005") && !text.contains("halves"), "{text}");
    let kept: Ladder = serde_json::from_str(&text).unwrap();
    assert_eq!(kept.choice(Limit::Tolerance(0.0102)).unwrap().flags, "--a");
    assert_eq!(kept.rungs[1].flip_noise, other.1);
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
    let mut near = ladder.clone();
    near.exact.pixels_per_degree = 11.0;
    assert!(near.words(limit, rung).contains("FLIP 0.0200 at 11 pixels per degree, measured"));
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
