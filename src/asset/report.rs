//! What loading tells its user: warnings, and progress on a terminal.

use std::sync::Mutex;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Collects warnings and shows progress; shared by every loader of one run.
pub struct Report {
    warnings: Mutex<Vec<String>>,
    bars: MultiProgress,
}

impl Report {
    /// Prints warnings to stderr as they come, and progress where stderr is a terminal.
    pub fn to_terminal() -> Self {
        Self { warnings: Mutex::default(), bars: MultiProgress::with_draw_target(ProgressDrawTarget::stderr()) }
    }

    /// Only collects.
    pub fn silent() -> Self {
        Self { warnings: Mutex::default(), bars: MultiProgress::with_draw_target(ProgressDrawTarget::hidden()) }
    }

    /// Notes something the user should know but that stops nothing: file first, then key, then what was done.
    pub fn warn(&self, message: impl Into<String>) {
        let message = message.into();
        tracing::warn!("{message}");
        self.lock().push(message);
    }

    /// All warnings so far, in order.
    pub fn warnings(&self) -> Vec<String> {
        self.lock().clone()
    }

    /// Starts a bar of `total` steps; call `inc(1)` for each and `finish_and_clear()` at the end.
    pub fn stage(&self, name: &'static str, total: u64) -> ProgressBar {
        // The template is a constant that indicatif accepts, as every test that loads a scene shows.
        let style = ProgressStyle::with_template("{msg:12} {bar:30} {pos}/{len}").unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.bars.add(ProgressBar::new(total));
        bar.set_style(style);
        bar.set_message(name);
        bar
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<String>> {
        // A list of strings is whole even if a thread died while pushing to it.
        self.warnings.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
