//! Renderers that draw a frame each in turn, so that whatever else the machine does hits all of them alike; and how far
//! their times spread.

use std::sync::Arc;
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use serde::{Deserialize, Serialize};

use super::clock::cpu_ms;
use crate::Result;
use crate::gpu::{CommandBuffer, Gpu};
use crate::render::{Eye, Renderer};

/// Frames before time is taken: pipelines are finished with the first.
const WARM_UP: usize = 2;

/// The middle of many times, and those that a tenth of them lie below and above. Milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Spread {
    /// Of any times; `None` of none.
    pub fn of(mut times: Vec<f64>) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        let last = times.len().checked_sub(1)?;
        let at = |share: f64| times[(share * last as f64).round() as usize];
        Some(Self { median: at(0.5), low: at(0.1), high: at(0.9) })
    }
}

/// What one way of drawing costs per frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    pub frames: usize,
    /// GPU time of all passes.
    pub gpu_ms: Spread,
    /// Processor time of all threads, where the system tells it; the GPU's time too where the GPU is the CPU.
    pub cpu_ms: Option<Spread>,
    /// Processor time of the thread that records and submits.
    pub record_ms: Spread,
}

/// One way of drawing: a renderer, and the eyes of each picture of a frame (one after the other into the same targets).
pub struct Way {
    pub renderer: Renderer,
    /// At most one for each frame in flight: each has a slot of its own.
    pub pictures: Vec<Vec<Eye>>,
}

/// How long to go on.
#[derive(Clone, Copy)]
pub struct Limits {
    /// Even when time is up.
    pub least: usize,
    pub most: usize,
    /// Wall time for all ways together.
    pub time: Duration,
}

/// Draws frames in turn, each to its end before the next begins; one cost for each way, in their order.
pub fn take_turns(gpu: &Arc<Gpu>, ways: &mut [Way], limits: Limits) -> Result<Vec<Cost>> {
    Ok(rounds(gpu, &mut ways.iter_mut().collect::<Vec<_>>(), limits)?
        .iter()
        .filter_map(|samples| cost(samples))
        .collect())
}

/// The same for two ways; also how many times the first's time the second takes, round by round: GPU time, or where the GPU is
/// the CPU processor time, which other programs do not disturb.
pub fn compare_in_turns(gpu: &Arc<Gpu>, ways: [&mut Way; 2], limits: Limits) -> Result<Option<([Cost; 2], Spread)>> {
    let [first, second] = ways;
    let samples = rounds(gpu, &mut [first, second], limits)?;
    let software = gpu.info().is_software();
    let time = |sample: &Sample| sample.cpu_ms.filter(|_| software).unwrap_or(sample.gpu_ms);
    let ratios = samples[0].iter().zip(&samples[1]).map(|(first, second)| time(second) / time(first));
    let ratio = Spread::of(ratios.filter(|ratio| ratio.is_finite()).collect());
    Ok(cost(&samples[0]).zip(cost(&samples[1])).zip(ratio).map(|((first, second), ratio)| ([first, second], ratio)))
}

fn rounds(gpu: &Arc<Gpu>, ways: &mut [&mut Way], limits: Limits) -> Result<Vec<Vec<Sample>>> {
    let mut recorder = CommandBuffer::new(gpu)?;
    // Who wants one frame wants its picture.
    let warm_up = if limits.most > 1 { WARM_UP } else { 0 };
    for way in ways.iter_mut() {
        for _ in 0..warm_up {
            frame(&mut recorder, way)?;
        }
    }
    let mut samples = vec![Vec::new(); ways.len()];
    let started = Instant::now();
    for round in 0..limits.most.max(1) {
        if round >= limits.least && started.elapsed() > limits.time {
            break;
        }
        for (way, samples) in ways.iter_mut().zip(&mut samples) {
            samples.push(frame(&mut recorder, way)?);
        }
    }
    Ok(samples)
}

#[derive(Clone, Copy)]
struct Sample {
    gpu_ms: f64,
    cpu_ms: Option<f64>,
    record_ms: f64,
}

fn frame(recorder: &mut CommandBuffer, way: &mut Way) -> Result<Sample> {
    let (before, started) = (cpu_ms(), ThreadTime::now());
    let (mut commands, _) = recorder.begin()?;
    for (slot, eyes) in way.pictures.iter().enumerate() {
        way.renderer.record(&mut commands, slot, eyes, None);
    }
    commands.submit(None)?;
    let record_ms = started.elapsed().as_secs_f64() * 1e3;
    let gpu_ms = recorder.finish()?.total_ms();
    Ok(Sample { gpu_ms, cpu_ms: cpu_ms().zip(before).map(|(now, before)| now - before), record_ms })
}

fn cost(samples: &[Sample]) -> Option<Cost> {
    let spread = |time: fn(&Sample) -> f64| Spread::of(samples.iter().map(time).collect());
    let cpu: Option<Vec<f64>> = samples.iter().map(|sample| sample.cpu_ms).collect();
    Some(Cost {
        frames: samples.len(),
        gpu_ms: spread(|sample| sample.gpu_ms)?,
        cpu_ms: cpu.and_then(Spread::of),
        record_ms: spread(|sample| sample.record_ms)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_slow_frame_does_not_move_the_middle() {
        let mut times: Vec<f64> = (1..=11).map(f64::from).collect();
        assert_eq!(Spread::of(times.clone()), Some(Spread { median: 6.0, low: 2.0, high: 10.0 }));
        times[10] = 1e6;
        times.reverse();
        assert_eq!(Spread::of(times), Some(Spread { median: 6.0, low: 2.0, high: 10.0 }));
        assert_eq!(Spread::of(vec![]), None);
    }
}
