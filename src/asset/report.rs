//! Warnings, progress bars and times of one run, collected while it loads and works.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle, WeakProgressBar};

use crate::error::shown;

/// Collects warnings and times, and shows progress; one for each run, shared by all threads.
pub struct Report {
    /// Whether warnings are logged.
    logs: bool,
    warnings: Mutex<Vec<String>>,
    times: Mutex<BTreeMap<&'static str, Duration>>,
    bars: MultiProgress,
    /// The bars that were started, and the labels of work that is being timed, oldest first.
    started: Mutex<Vec<WeakProgressBar>>,
    running: Mutex<Vec<&'static str>>,
    /// Number of warnings beyond [`MAX_KEPT`].
    dropped: AtomicUsize,
}

/// What is being worked on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stage {
    pub label: String,
    /// Steps done, of how many; `None` where they are not counted.
    pub steps: Option<(u64, u64)>,
}

/// Warnings that are logged, and that are kept for `--json`: a broken file can cause millions.
const MAX_LOGGED: usize = 100;
const MAX_KEPT: usize = 10_000;

impl Drop for Report {
    fn drop(&mut self) {
        let more = self.lock().len().saturating_sub(MAX_LOGGED) + self.dropped.load(Ordering::Relaxed);
        if self.logs && more > 0 {
            tracing::warn!("and {more} more warnings");
        }
    }
}

impl Report {
    /// Prints warnings to stderr as they come, and progress where stderr is a terminal.
    pub fn to_terminal() -> Self {
        Self::with_target(ProgressDrawTarget::stderr())
    }

    /// Shows no progress.
    pub fn silent() -> Self {
        Self::with_target(ProgressDrawTarget::hidden())
    }

    /// Says nothing at all: for files of which everything has been said before.
    pub fn repeated() -> Self {
        let mut report = Self::silent();
        report.logs = false;
        report
    }

    fn with_target(target: ProgressDrawTarget) -> Self {
        Self {
            logs: true,
            warnings: Mutex::default(),
            times: Mutex::default(),
            bars: MultiProgress::with_draw_target(target),
            started: Mutex::default(),
            running: Mutex::default(),
            dropped: AtomicUsize::new(0),
        }
    }

    /// Adds a warning: something that the user should know but that stops nothing. File first, then key, then what was
    /// done.
    pub fn warn(&self, message: impl Into<String>) {
        let message = shown(&message.into(), false);
        let mut warnings = self.lock();
        if self.logs && warnings.len() < MAX_LOGGED {
            tracing::warn!("{message}");
        }
        if warnings.len() < MAX_KEPT {
            warnings.push(message);
        } else {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// All warnings so far, in order.
    pub fn warnings(&self) -> Vec<String> {
        self.lock().clone()
    }

    /// How many warnings there are, and the newest of them, in order.
    pub fn newest_warnings(&self, most: usize) -> (usize, Vec<String>) {
        let warnings = self.lock();
        (warnings.len(), warnings[warnings.len().saturating_sub(most)..].to_vec())
    }

    /// What is being worked on, if that is known: the bar that was started last, or else what is timed.
    pub fn stage(&self) -> Option<Stage> {
        let mut started = locked(&self.started);
        started.retain(|bar| bar.upgrade().is_some_and(|bar| !bar.is_finished()));
        let bar = started.last().and_then(WeakProgressBar::upgrade);
        let counted =
            bar.map(|bar| Stage { label: bar.message(), steps: bar.length().map(|len| (bar.position(), len)) });
        counted.or_else(|| Some(Stage { label: (*locked(&self.running).last()?).to_owned(), steps: None }))
    }

    /// Starts a progress bar of `total` steps; call `inc(1)` for each and `finish_and_clear()` at the end.
    pub fn progress(&self, label: &'static str, total: u64) -> ProgressBar {
        // The template is a constant that indicatif accepts, as every test that loads a scene shows.
        let style = ProgressStyle::with_template("{msg:12} {bar:30} {pos}/{len}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.bars.add(ProgressBar::new(total));
        bar.set_style(style);
        bar.set_message(label);
        locked(&self.started).push(bar.downgrade());
        bar
    }

    /// Runs `work` and adds its duration to the times under `label`. Concurrent threads each add their own, so that a
    /// sum can exceed the elapsed time; `work` must not wait for other threads, or their work would be counted twice.
    pub fn time<T>(&self, label: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        locked(&self.running).push(label);
        let done = work();
        let mut running = locked(&self.running);
        // Other threads may have begun and ended since.
        if let Some(at) = running.iter().rposition(|other| *other == label) {
            running.remove(at);
        }
        drop(running);
        *self.lock_times().entry(label).or_default() += start.elapsed();
        done
    }

    /// Milliseconds under each label so far, summed over all threads.
    pub fn times_ms(&self) -> BTreeMap<&'static str, f64> {
        self.lock_times().iter().map(|(label, time)| (*label, time.as_secs_f64() * 1e3)).collect()
    }

    fn lock_times(&self) -> std::sync::MutexGuard<'_, BTreeMap<&'static str, Duration>> {
        locked(&self.times)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<String>> {
        locked(&self.warnings)
    }
}

/// Lists and maps whose entries are whole even if a thread died while adding one.
fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stage_is_the_newest_bar_or_else_what_is_timed() {
        let report = Report::silent();
        assert_eq!(report.stage(), None);
        report.time("parse", || {
            assert_eq!(report.stage(), Some(Stage { label: "parse".into(), steps: None }));
            let bar = report.progress("textures", 5);
            bar.inc(2);
            assert_eq!(report.stage(), Some(Stage { label: "textures".into(), steps: Some((2, 5)) }));
            bar.finish_and_clear();
            assert_eq!(report.stage().map(|stage| stage.label), Some("parse".into()));
        });
        assert_eq!(report.stage(), None);
        report.warn("first");
        report.warn("second");
        assert_eq!(report.newest_warnings(1), (2, vec!["second".into()]));
        assert_eq!(report.newest_warnings(9).1, ["first", "second"]);
    }

    #[test]
    fn warnings_are_lines_and_not_without_end() {
        let report = Report::silent();
        report.warn("a\nb");
        (0..2 * MAX_KEPT).for_each(|i| report.warn(format!("{i}")));
        assert_eq!(report.warnings()[0], "a\\nb");
        assert_eq!(report.warnings().len(), MAX_KEPT);
        assert_eq!(report.dropped.load(Ordering::Relaxed), MAX_KEPT + 1);
    }
}
