//! The end of a process whose threads are still at work, and which nothing would gain by waiting for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Ends the process after a time, unless it is dropped before.
pub struct QuitTimer(Arc<AtomicBool>);

impl QuitTimer {
    /// Starts the time.
    pub fn start(limit: Duration) -> Self {
        let due = Arc::new(AtomicBool::new(true));
        let its = Arc::clone(&due);
        let wait = move || {
            std::thread::sleep(limit);
            if its.swap(false, Ordering::SeqCst) {
                quit();
            }
        };
        // Without a thread the end takes as long as it takes.
        if let Err(error) = std::thread::Builder::new().name("quit".into()).spawn(wait) {
            tracing::debug!("no thread ends the process early: {error}");
        }
        Self(due)
    }
}

impl Drop for QuitTimer {
    fn drop(&mut self) {
        self.0.store(false, Ordering::SeqCst);
    }
}

/// Ends the process with success. Exit handlers are left out: a driver's would take away what other threads still use.
fn quit() -> ! {
    // SAFETY: no memory is touched; the system frees whatever the process has.
    #[cfg(unix)]
    unsafe {
        libc::_exit(0)
    }
    #[cfg(windows)]
    {
        use windows_sys::Win32::System::Threading::{GetCurrentProcess, TerminateProcess};
        // SAFETY: the handle stands for this process; no memory is touched.
        unsafe { TerminateProcess(GetCurrentProcess(), 0) };
        // It is over before the call returns.
        std::process::abort()
    }
}
