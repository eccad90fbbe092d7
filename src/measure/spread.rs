//! The spread of a number that was measured many times, and frames whose times are taken.

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ThreadTime;
use serde::Serialize;

use crate::Result;
use crate::gpu::{Gpu, Recorder};
use crate::render::{Eye, FRAMES_IN_FLIGHT, Renderer};

/// What lies in the middle, and between what most lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub p10: f64,
    pub median: f64,
    pub p90: f64,
}

impl Spread {
    /// Of at least one value, none of them NaN; between two of them, by distance.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let place = part * (sorted.len() - 1) as f64;
            let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            low + (high - low) * place.fract()
        };
        Self { p10: at(0.1), median: at(0.5), p90: at(0.9) }
    }
}

/// What frames took, each of them.
pub struct Frames {
    /// GPU time of all passes, ms.
    pub gpu_ms: Vec<f64>,
    /// Processor time of the thread that culls, records and submits, ms.
    pub record_ms: Vec<f64>,
    /// Wall time of all of them, ms.
    pub wall_ms: f64,
}

/// Draws `warm_up` frames and then `count` (at least one) whose times are taken; the CPU runs ahead as in a window.
pub fn frames(gpu: &Arc<Gpu>, renderer: &mut Renderer, eyes: &[Eye], warm_up: usize, count: usize) -> Result<Frames> {
    let mut recorders = (0..FRAMES_IN_FLIGHT).map(|_| Recorder::new(gpu)).collect::<Result<Vec<_>>>()?;
    let (mut gpu_ms, mut record_ms) = (Vec::new(), Vec::new());
    let mut started = Instant::now();
    for frame in 0..warm_up + count {
        if frame == warm_up {
            gpu.wait_idle()?;
            started = Instant::now();
        }
        let slot = frame % FRAMES_IN_FLIGHT;
        let times = recorders[slot].finish()?;
        if frame >= FRAMES_IN_FLIGHT {
            gpu_ms.push(times.iter().map(|pass| pass.ms).sum());
        }
        let recording = ThreadTime::now();
        let (mut commands, _) = recorders[slot].begin()?;
        renderer.record(&mut commands, slot, eyes, None);
        commands.submit(None)?;
        record_ms.push(recording.elapsed().as_secs_f64() * 1e3);
    }
    gpu.wait_idle()?;
    let wall_ms = started.elapsed().as_secs_f64() * 1e3;
    // The last ones, oldest first.
    for frame in warm_up + count..warm_up + count + FRAMES_IN_FLIGHT {
        if frame >= FRAMES_IN_FLIGHT {
            gpu_ms.push(recorders[frame % FRAMES_IN_FLIGHT].finish()?.iter().map(|pass| pass.ms).sum());
        }
    }
    Ok(Frames { gpu_ms: gpu_ms.split_off(warm_up), record_ms: record_ms.split_off(warm_up), wall_ms })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_does_not_depend_on_the_order_and_lies_between_values() {
        let spread = Spread::of(&[5.0, 1.0, 3.0, 2.0, 4.0]);
        assert!((spread.p10 - 1.4).abs() < 1e-12 && (spread.median - 3.0).abs() < 1e-12);
        assert!((spread.p90 - 4.6).abs() < 1e-12, "{spread:?}");
        assert_eq!(Spread::of(&[7.0]), Spread { p10: 7.0, median: 7.0, p90: 7.0 });
    }
}
