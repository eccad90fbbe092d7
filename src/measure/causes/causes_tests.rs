//! Causes where the answer is known, and rows for the tests of tables and charts.

use glam::Vec3;

use super::ball::Grid;
use super::*;

const SMALL: Grid = Grid { roughness: &[0.2, 0.5, 0.9], nv: &[0.8, 0.3], log2_normals: 1, cubes: &[16], width: 64 };

/// One large and one small cause of a ball and of a picture, with all that comes beside them.
pub fn rows() -> Vec<Row> {
    let change = |change| Change::of(change, 0.05, 0.03);
    let mut rows = Vec::new();
    for (kind, subject) in [(Kind::Ball, "a ball"), (Kind::Picture, "a scene")] {
        for (swap, cause, size) in [
            (Swap::Whole, "all", 0.05),
            (Swap::Floor, "floor", 0.0004),
            (Swap::ReferenceAccumulator, "small", 0.001),
            (Swap::ReferenceAccumulator, "large", 0.04),
            (Swap::Chain, "large", 0.04),
            (Swap::Other, "large", 0.07),
        ] {
            let relative_mse = (kind == Kind::Picture).then(|| change(size * size));
            let [subject, cause, is, swapped] = [subject, cause, "as it is", "exact"].map(str::to_owned);
            rows.push(Row { kind, subject, swap, cause, is, swapped, main: Some(change(size)), relative_mse });
        }
    }
    rows
}

/// Rows of a small ball.
fn measured(panorama: &Panorama, size: u32) -> Vec<Row> {
    let gpu = Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap();
    let messages = gpu.messages();
    let rows = Ball::new(&gpu, panorama, size, &SMALL, None).unwrap().rows(&SMALL).unwrap();
    drop(gpu);
    messages.check().unwrap();
    rows
}

fn find<'a>(rows: &'a [Row], swap: Swap, cause: &str) -> impl Iterator<Item = (&'a str, Change)> {
    let cause = cause.to_owned();
    let wanted = move |row: &&Row| row.swap == swap && row.cause == cause;
    rows.iter().filter(wanted).map(|row| (row.subject.as_str(), row.main.unwrap()))
}

fn assert_chain_adds_up(rows: &[Row]) {
    for (subject, whole) in find(rows, Swap::Whole, "all") {
        let chain = rows.iter().filter(|row| row.swap == Swap::Chain && row.subject == subject);
        let sum: f64 = chain.map(|row| row.main.unwrap().falls_by).sum();
        assert!((sum - whole.error).abs() < 1e-12, "{subject}: {sum} is not {}", whole.error);
    }
}

#[test]
fn under_even_light_nothing_has_a_cause_but_the_table_and_rounding() {
    let rows = measured(&Panorama::from_fn(64, 32, |_| Vec3::splat(1.1)), 64);
    assert_chain_adds_up(&rows);
    for row in rows.iter().filter(|row| matches!(row.swap, Swap::ReferenceAccumulator | Swap::Chain)) {
        // A half float has ten digits, the table is good to 1e-3, and integrals to the floor.
        let most = match row.cause.as_str() {
            "half float" => 0.5f64.powi(11),
            "the GPU's sums" => 0.5f64.powi(10),
            "table" => 1e-3,
            "n = v (matched)" | "diffuse, multi-scatter" => 3e-3,
            _ => 1e-6,
        };
        let change = row.main.unwrap().change;
        assert!(change <= most, "{}, {:?}, {}: {change}", row.subject, row.swap, row.cause);
    }
    for (subject, change) in find(&rows, Swap::Other, "n = v") {
        assert!(change.change < 1e-3, "{subject}: {change:?}");
    }
    // Counted twice, Fresnel's term adds light, the more the less else there is.
    let twice: Vec<f64> = find(&rows, Swap::Other, "Fresnel").map(|(_, change)| change.change).collect();
    assert!(twice[2] > 0.05 && twice[2] > twice[1], "{twice:?}");
    // Gold that scatters light once loses some of it; the mean over the grid.
    let single: Vec<(&str, Change)> = find(&rows, Swap::Other, "scattering").collect();
    assert!(single[0].0.ends_with("metal") && single[0].1.change > 0.03, "{single:?}");
}

#[test]
fn under_linear_light_matching_the_mean_is_right_and_the_classic_way_is_not() {
    let to_light = Vec3::new(0.5, 0.7, -0.2);
    let rows = measured(&Panorama::from_fn(128, 64, |d| Vec3::splat(1.0 + 0.9 * to_light.dot(d))), 64);
    assert_chain_adds_up(&rows);
    let floor: Vec<f64> = find(&rows, Swap::Floor, "floor").map(|(_, change)| change.error).collect();
    for ((subject, matched), floor) in find(&rows, Swap::ReferenceAccumulator, "n = v (matched)").zip(floor) {
        // Gold's channels have lobes of their own.
        assert!(matched.change < 4e-3 + 2.0 * floor, "{subject}: {matched:?}, floor {floor}");
    }
    let mixing = find(&rows, Swap::ReferenceAccumulator, "level interpolation");
    mixing.for_each(|(subject, change)| assert!(change.change < 3e-3, "{subject}: {change:?}"));
    for (subject, classic) in find(&rows, Swap::Other, "n = v") {
        assert!(classic.falls_by < -0.002 && classic.error_swapped > 1.5 * classic.error, "{subject}: {classic:?}");
    }
}

#[test]
fn coarse_cubes_are_worse_and_what_was_swapped_adds_up_where_light_varies() {
    let rows = measured(&synthetic::panorama(64, true), 128);
    assert_chain_adds_up(&rows);
    for (subject, coarse) in find(&rows, Swap::Other, "cube resolution") {
        assert!(coarse.error_swapped > coarse.error && coarse.change > 0.0, "{subject}: {coarse:?}");
    }
    for cause in chain::Cause::ALL {
        let found: Vec<(&str, Change)> = find(&rows, Swap::ReferenceAccumulator, cause.words()[0]).collect();
        assert_eq!(found.len(), 3, "{cause:?}");
        found.iter().for_each(|(_, change)| {
            assert!(
                change.change.is_finite() && (change.falls_by.abs() <= change.change + 1e-12),
                "{cause:?}: {change:?}"
            );
        });
    }
}

#[test]
fn panoramas_are_halved_until_they_fit_and_keep_their_mean() {
    let panorama = Panorama::from_fn(64, 32, |d| Vec3::ONE + 0.5 * d);
    let small = smaller(panorama.clone(), 20);
    assert_eq!((small.width, small.height, small.texels.len()), (16, 8, 128));
    let mean = |p: &Panorama| p.texels.iter().map(|t| f64::from(t[1])).sum::<f64>() / p.texels.len() as f64;
    assert!((mean(&small) - mean(&panorama)).abs() < 1e-5);
    assert_eq!(smaller(panorama.clone(), 64), panorama);
}
