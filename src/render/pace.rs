//! How much of a long piece of work a frame gets, by what the last pieces took.

use std::ops::RangeInclusive;

use crate::gpu::PassTime;

/// Least and greatest change from one piece to the next: times of single frames are noisy.
const CHANGE: RangeInclusive<f64> = 0.25..=2.0;

/// The size of a pass's next piece, in any unit of work.
#[derive(Clone, Debug)]
pub struct Pace {
    pass: &'static str,
    size: f64,
    sizes: RangeInclusive<f64>,
}

impl Pace {
    /// Begins with the smallest piece.
    pub fn new(pass: &'static str, sizes: RangeInclusive<f64>) -> Self {
        Self { pass, size: *sizes.start(), sizes }
    }

    /// Units of work in the next piece.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Makes the next piece take about `target_ms`, from the times of a frame that a piece was part of.
    pub fn follow(&mut self, times: &[PassTime], target_ms: f64) {
        if let Some(time) = times.iter().find(|time| time.name == self.pass).filter(|time| time.ms > 0.0) {
            let change = (target_ms / time.ms).clamp(*CHANGE.start(), *CHANGE.end());
            self.size = (self.size * change).clamp(*self.sizes.start(), *self.sizes.end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_become_as_long_as_they_should_and_no_larger_than_they_may() {
        let mut pace = Pace::new("work", 100.0..=1e6);
        let took = |ms| [PassTime { name: "other", ms: 9.0 }, PassTime { name: "work", ms }];
        assert_eq!(pace.size(), 100.0);
        // A unit takes 1 µs.
        for _ in 0..20 {
            pace.follow(&took(pace.size() * 1e-3), 4.0);
        }
        assert!((pace.size() - 4000.0).abs() < 1.0, "{}", pace.size());
        pace.follow(&took(1e-9), 4.0);
        assert!((pace.size() - 8000.0).abs() < 1.0, "no faster than twofold: {}", pace.size());
        (0..40).for_each(|_| pace.follow(&took(1e-9), 4.0));
        assert_eq!(pace.size(), 1e6);
        (0..40).for_each(|_| pace.follow(&took(1e9), 4.0));
        assert_eq!(pace.size(), 100.0);
        // A frame without a piece, or without times.
        pace.follow(&[], 4.0);
        pace.follow(&took(0.0), 4.0);
        assert_eq!(pace.size(), 100.0);
    }
}
