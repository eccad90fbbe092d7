//! Ctrl-C and termination signals: the first ends the session as if its window was closed, so that report and summary are
//! written; the second ends the process at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The time limit for exit handlers of libraries.
const EXIT_LIMIT: Duration = Duration::from_secs(3);
/// The exit status of a process that is interrupted: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

type Wake = Box<dyn Fn() + Send>;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static WAKE: Mutex<Option<Wake>> = Mutex::new(None);

/// Handles signals from now on; after each first one, `wake` is called on another thread.
pub fn listen(wake: impl Fn() + Send + 'static) {
    *lock() = Some(Box::new(wake));
    // Fails if a handler is already set, which is harmless, or if the system refuses: then signals end the process as by default.
    if let Err(error) = ctrlc::set_handler(on_signal) {
        tracing::debug!("signals are not handled: {error}");
    }
}

/// From now on, signals end the process at once, because no loop checks [`is_requested`] any more.
pub fn stop_listening() {
    *lock() = None;
}

/// Whether a signal has requested the end.
pub fn is_requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Ends the process, even where a library blocks in its exit handlers.
pub fn exit_at_once(code: i32) -> ! {
    let limit = || {
        std::thread::sleep(EXIT_LIMIT);
        std::process::abort();
    };
    // Without a thread the end takes as long as it takes.
    if let Err(error) = std::thread::Builder::new().name("exit".into()).spawn(limit) {
        tracing::debug!("no thread ends the process early: {error}");
    }
    std::process::exit(code)
}

fn on_signal() {
    match (&*lock(), REQUESTED.swap(true, Ordering::Relaxed)) {
        (Some(wake), false) => wake(),
        _ => exit_at_once(INTERRUPTED),
    }
}

fn lock() -> std::sync::MutexGuard<'static, Option<Wake>> {
    WAKE.lock().unwrap_or_else(PoisonError::into_inner)
}
