//! Processor time and memory of this process, and the date.

use std::time::{SystemTime, UNIX_EPOCH};

use cpu_time::ProcessTime;

/// User and system time that all threads of this process have taken, in ms, where the system tells it.
pub fn cpu_ms() -> Option<f64> {
    ProcessTime::try_now().ok().map(|time| time.as_duration().as_secs_f64() * 1e3)
}

/// Begins anew to note the most memory this process has; whether the system does so (Linux).
pub fn reset_peak_ram() -> bool {
    cfg!(target_os = "linux") && std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// The most memory that this process has had since the reset, in MiB, where the system tells it (Linux).
pub fn peak_ram_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok().filter(|_| cfg!(target_os = "linux"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok().map(|kib| kib / 1024.0)
}

/// Today in UTC, as 2026-01-31.
pub fn today() -> String {
    let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400);
    date(days)
}

fn date(mut days: u64) -> String {
    let mut year = 1970;
    let leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
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
        for (days, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (19_782, "2024-02-29"),
            (20_454, "2026-01-01"),
        ] {
            assert_eq!(date(days), expected);
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_most_memory_grows_with_what_is_taken() {
        let before = peak_ram_mib().unwrap();
        let taken = std::hint::black_box(vec![1u8; 256 << 20]);
        // Other tests of this process may have had as much at once.
        let after = peak_ram_mib().unwrap();
        assert!(after >= before.max(256.0), "{before} to {after} MiB, {}", taken[5]);
    }

    #[test]
    fn work_takes_processor_time() {
        let before = cpu_ms().unwrap();
        let started = std::time::Instant::now();
        let mut x = 1u64;
        while started.elapsed().as_millis() < 300 {
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        }
        assert!(cpu_ms().unwrap() > before, "{x}");
    }
}
