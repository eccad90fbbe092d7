//! How much of a long piece of work a frame gets, by what the last pieces took.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use crate::gpu::{FRAMES_IN_FLIGHT, PassTime};

/// Least and greatest size of the next piece as a part of one whose time is known: times of single frames are noisy.
const CHANGE: RangeInclusive<f64> = 0.25..=4.0;

/// The size of a pass's next piece, in any unit of work.
#[derive(Clone, Debug)]
pub struct Pace {
    pass: &'static str,
    size: f64,
    sizes: RangeInclusive<f64>,
    /// Sizes of pieces whose times are not known yet, the oldest first.
    issued: VecDeque<f64>,
}

impl Pace {
    /// Begins with the smallest piece.
    pub fn new(pass: &'static str, sizes: RangeInclusive<f64>) -> Self {
        Self { pass, size: *sizes.start(), sizes, issued: VecDeque::new() }
    }

    /// Units of work in the next piece.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Takes note of a piece that is recorded.
    pub fn issue(&mut self, size: f64) {
        // No more frames are in flight; times of others got lost.
        if self.issued.len() == FRAMES_IN_FLIGHT {
            self.issued.pop_front();
        }
        self.issued.push_back(size);
    }

    /// Makes the next piece take about `target_ms`, from the times of a frame that the oldest piece was part of.
    pub fn follow(&mut self, times: &[PassTime], target_ms: f64) {
        let Some(time) = times.iter().find(|time| time.name == self.pass) else { return };
        let Some(size) = self.issued.pop_front().filter(|_| time.ms > 0.0) else { return };
        // The rest of some work may be much smaller than a piece: that it was short tells nothing.
        if size * CHANGE.end() >= self.size || time.ms > target_ms {
            let change = (target_ms / time.ms).clamp(*CHANGE.start(), *CHANGE.end());
            self.size = (size * change).clamp(*self.sizes.start(), *self.sizes.end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn took(ms: f64) -> [PassTime; 2] {
        [PassTime { name: "other", ms: 9.0 }, PassTime { name: "work", ms }]
    }

    /// With times that come two frames late, as from a ring of frames; returns the sizes of all pieces.
    fn run(pace: &mut Pace, frames: usize, ms_per_unit: f64) -> Vec<f64> {
        let mut sizes = Vec::new();
        for frame in 0..frames {
            if frame >= FRAMES_IN_FLIGHT {
                pace.follow(&took(sizes[frame - FRAMES_IN_FLIGHT] * ms_per_unit), 4.0);
            }
            pace.issue(pace.size());
            sizes.push(pace.size());
        }
        sizes
    }

    #[test]
    fn pieces_become_as_long_as_they_should_and_no_longer_on_the_way() {
        let mut pace = Pace::new("work", 100.0..=1e6);
        let sizes = run(&mut pace, 40, 1e-3);
        assert_eq!(sizes[0], 100.0);
        assert!((pace.size() - 4000.0).abs() < 1.0 && sizes.iter().all(|size| *size < 4001.0), "{sizes:?}");
    }

    #[test]
    fn pieces_change_no_faster_and_become_no_larger_than_they_may() {
        let mut pace = Pace::new("work", 100.0..=1e6);
        pace.issue(4000.0);
        pace.follow(&took(1e-9), 4.0);
        assert_eq!(pace.size(), 16_000.0);
        pace.issue(50.0);
        pace.follow(&took(1.0), 4.0);
        assert_eq!(pace.size(), 16_000.0);
        pace.issue(50.0);
        pace.follow(&took(8.0), 4.0);
        assert_eq!(pace.size(), 100.0);
        run(&mut pace, 80, 1e-12);
        assert_eq!(pace.size(), 1e6);
        run(&mut pace, 80, 1e9);
        assert_eq!(pace.size(), 100.0);
        // A frame without a piece, or without times.
        pace.follow(&[], 4.0);
        pace.follow(&took(0.0), 4.0);
        assert_eq!(pace.size(), 100.0);
    }
}
