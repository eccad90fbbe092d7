//! The machine that is measured: its GPU, the date, and this process's processor time.

use std::time::{SystemTime, UNIX_EPOCH};

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};

use crate::gpu::Gpu;

/// GPU and date of a measurement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Machine {
    pub gpu: String,
    pub driver: String,
    /// UTC, as 2026-01-31.
    pub date: String,
}

impl Machine {
    /// This GPU, today.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.info().name.clone(), driver: gpu.info().driver.clone(), date: today() }
    }
}

/// Milliseconds of user and system time of all threads of this process; `None` where the system does not report it.
pub fn cpu_ms() -> Option<f64> {
    ProcessTime::try_now().ok().map(|time| time.as_duration().as_secs_f64() * 1e3)
}

fn today() -> String {
    date(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400))
}

/// The date so many days after 1 January 1970.
fn date(mut days: u64) -> String {
    let leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(leap(year)) {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while days >= lengths[month] {
        days -= lengths[month];
        month += 1;
    }
    format!("{year}-{:02}-{:02}", month + 1, days + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (days, expected) in [(0, "1970-01-01"), (59, "1970-03-01"), (11_016, "2000-02-29"), (20_454, "2026-01-01")]
        {
            assert_eq!(date(days), expected);
        }
    }
}
