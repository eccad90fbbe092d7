//! The machine that is measured: its GPU, the date, and this process's processor time.

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime as _, SystemTime};

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

/// The day of the time with which log lines begin.
fn today() -> String {
    let mut text = String::new();
    let time = SystemTime.format_time(&mut Writer::new(&mut text));
    if time.is_ok() { text.chars().take(10).collect() } else { String::new() }
}
