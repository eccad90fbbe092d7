//! Synthetic ladders: verdicts, choices, tables and charts, and what is tried together.

use super::super::bench::{Cost, Spread};
use super::super::noise::Halves;
use super::super::pareto::Limit;
use super::reference::{PictureError, ReferenceFacts};
use super::*;
use crate::reference::metrics::PIXELS_PER_DEGREE;

/// Uncertainty of all differences of FLIP.
const NOISE: f64 = 0.0005;

/// Configurations by flags, time and FLIP; the first must be the default.
pub fn ladder(configs: &[(&str, f64, f64)]) -> Ladder {
    let default_ms = configs[0].1;
    let config = |(index, &(flags, ms, flip)): (usize, &(&str, f64, f64))| {
        // Noise in a block of its own: any two differ by it in two blocks.
        let half = |noise: f64| {
            let mut blocks = vec![0.0; configs.len() + 1];
            (blocks[index], blocks[configs.len()]) = (noise, flip);
            blocks
        };
        let off = NOISE / 8f64.sqrt();
        let spread = |median: f64| Spread { median, low: 0.99 * median, high: 1.01 * median };
        let cost = Cost { frames: 100, gpu_ms: spread(ms), cpu_ms: None, record_ms: spread(0.1) };
        let dimension = flags.split(' ').next().unwrap();
        Config {
            dimension: dimension.into(),
            flags: flags.into(),
            cost,
            bake: None,
            ratio: spread(ms / default_ms),
            default_gpu_ms: default_ms,
            ms,
            error: error(flip),
            halves: Halves([half(off), half(-off)]),
            flip_over_default: 0.0,
            flip_noise: 0.0,
            dominated_by: None,
        }
    };
    let reference =
        ReferenceFacts { frames: 32, fineness: 4, floor: error(0.0005), pixels_per_degree: PIXELS_PER_DEGREE };
    let mut ladder = Ladder {
        scene: "a scene".into(),
        machine: Machine { gpu: "a GPU".into(), driver: "a driver".into(), date: "2026-01-31".into() },
        size: [384, 216],
        time: "GPU time".into(),
        reference,
        configs: configs.iter().enumerate().map(config).collect(),
        notes: Vec::new(),
    };
    ladder.settle();
    ladder
}

fn error(flip: f64) -> PictureError {
    PictureError { flip, flip_max: 10.0 * flip, relative_mse: flip * flip }
}

#[test]
fn verdicts_say_how_the_default_stands_and_what_is_within_noise() {
    let verdict = |configs: &[(&str, f64, f64)]| ladder(configs).verdict().remove(0);
    let default = ("", 8.0, 0.010);
    assert!(verdict(&[default, ("--a", 4.0, 0.02), ("--b", 9.0, 0.005)]).ends_with("is on the Pareto front"));
    assert!(
        verdict(&[default, ("--a", 4.0, 0.009)])
            .contains("is dominated by --a: 0.50 ± 0.00 of its time, FLIP -0.00100 ± 0.00050")
    );
    for flip in [0.0102, 0.0098] {
        let words = verdict(&[default, ("--a", 2.0, flip), ("--b", 1.0, 0.0106)]);
        assert!(words.contains("is dominated by --"), "{words}");
    }
    assert!(verdict(&[default, ("--a", 7.999, 0.0099)]).ends_with("is on the Pareto front"), "equal within noise");
    // Errors ten times as large: noise hides little of them, and a hundredth does not count.
    assert!(verdict(&[("", 8.0, 0.1), ("--a", 2.0, 0.1009)]).contains("dominated by --a:"));
    assert!(verdict(&[("", 8.0, 0.1), ("--a", 2.0, 0.1011)]).ends_with("is on the Pareto front"), "more than 1 %");
    let far = ladder(&[("", 8.0, 0.7), ("--a", 9.0, 0.1), ("--b", 10.0, 0.097)]);
    assert!(
        far.configs.iter().all(|config| config.dominated_by.is_none()),
        "little of the default's error, much of its own"
    );
    assert!(ladder(&[("", 8.0, 0.001)]).verdict()[1].contains("own error"));
}

#[test]
fn times_are_multiples_of_the_default_s_median_and_differences_survive_a_round_trip_as_json() {
    let mut ladder = ladder(&[("", 8.0, 0.010), ("--a", 16.0, 0.0102)]);
    let [default, other] = [0, 1].map(|i| (ladder.configs[i].flip_over_default, ladder.configs[i].flip_noise));
    assert_eq!(default, (0.0, 0.0), "the default differs from itself by nothing, for sure");
    assert!((other.0 - 0.0002).abs() < 1e-12 && (other.1 - NOISE).abs() < 1e-12, "{other:?}");
    ladder.configs[0].ratio.median = 1.03;
    ladder.configs[1].default_gpu_ms = 10.0;
    ladder.settle();
    let text = serde_json::to_string(&ladder).unwrap();
    assert!(text.contains("\"flip_noise\":0.0005") && !text.contains("halves"), "{text}");
    let stored: Ladder = serde_json::from_str(&text).unwrap();
    assert_eq!([0, 1].map(|i| stored.configs[i].ms), [10.0, 20.0], "of two medians, the later");
}

#[test]
fn a_tolerance_takes_the_quickest_that_holds_it_and_a_budget_the_most_accurate() {
    let ladder = ladder(&[("", 8.0, 0.010), ("--a", 4.0, 0.02), ("--b", 9.0, 0.005), ("--c", 9.5, 0.005)]);
    let name = |limit| ladder.choice(limit).map(Config::name);
    assert_eq!(name(Limit::Tolerance(0.02)), Ok("--a"));
    assert_eq!(name(Limit::Tolerance(0.01)), Ok("default"));
    assert_eq!(name(Limit::BudgetMs(8.5)), Ok("default"));
    assert_eq!(name(Limit::BudgetMs(100.0)), Ok("--b"), "of two as accurate, the quicker");
    assert!(name(Limit::Tolerance(0.001)).unwrap_err().contains("the best has FLIP 0.0050"));
    assert!(name(Limit::BudgetMs(1.0)).unwrap_err().contains("the best has 4.00 ms"));
    let (limit, mut near) = (Limit::Tolerance(0.02), ladder.clone());
    let config = ladder.choice(limit).unwrap();
    let words = ladder.words(limit, config);
    assert!(words.contains("--a (4.00 ms, FLIP 0.0200, measured at 384x216 on 2026-01-31)"), "{words}");
    near.reference.pixels_per_degree = 11.0;
    assert!(near.words(limit, config).contains("FLIP 0.0200 at 11 pixels per degree, measured"));
}

#[test]
fn combinations_go_from_the_best_bargain_to_the_quickest_and_the_most_accurate() {
    let default = ("", 8.0, 0.010);
    let mut ladder = ladder(&[
        default,
        ("--p", 2.0, 0.011),
        ("--s 1", 4.0, 0.030),
        ("--s 2", 6.0, 0.020),
        ("--c 1", 7.0, 0.011),
        ("--c 2", 9.0, 0.009),
        ("--m", 10.0, 0.010),
        ("--n", 4.0, 0.012),
        ("--a", 9.0, 0.008),
    ]);
    ladder.configs[1].dimension = settings::SHADING.into();
    assert_eq!(ladder.combinations(), ["--n --c 1", "--n --c 1 --s 1", "--n --c 1 --s 1 --p", "--a --c 2"]);
    ladder.configs = vec![ladder.configs[0].clone(), ladder.configs[6].clone()];
    assert_eq!(ladder.combinations(), [""; 0], "what is slower alone is tried with nothing");
}

#[test]
fn the_chart_holds_every_configuration_and_how_it_stands() {
    let ladder = ladder(&[
        ("", 8.0, 0.010),
        ("--samples 1", 4.0, 0.020),
        ("--model everything", 9.0, 0.0102),
        ("--anisotropy 4", 9.0, 0.013),
        ("--samples 1 --scale 0.5 --cube-size 32", 1.0, 0.2),
    ]);
    let svg = chart::plot(&ladder).draw().unwrap();
    for part in
        ["a scene", "samples 1", "GPU time of a frame, ms", "cube 32", "0.0102 ± 0.00050", "67 pixels per degree"]
    {
        assert!(svg.contains(part), "{part}");
    }
    assert_eq!(svg.matches("<circle").count(), ladder.configs.len() + 3, "and the legend's");
    assert!(chart::plot(&Ladder { configs: Vec::new(), ..ladder }).draw().is_ok(), "an empty one");
}
