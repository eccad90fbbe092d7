//! A watchdog thread for calls into the runtime: some block for ever when the link to the headset drops, and cannot be
//! interrupted.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::view::interrupt;
use crate::{Error, Result};

/// Time limits of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// After this, a message is printed.
    pub notice: Duration,
    /// After this, the program ends, because a blocked call cannot be interrupted.
    pub give_up: Duration,
}

impl Patience {
    /// For starting, which may start the runtime's own programs.
    pub const START: Self = Self { notice: Duration::from_secs(5), give_up: Duration::from_secs(90) };
    /// For one call of the frame loop.
    pub const FRAME: Self = Self { notice: Duration::from_secs(3), give_up: Duration::from_secs(30) };
}

/// The interval between checks.
const TICK: Duration = Duration::from_millis(100);

#[derive(Clone, Copy)]
struct Watched {
    what: &'static str,
    since: Instant,
    patience: Patience,
    noticed: bool,
}

#[derive(Default)]
struct Shared {
    watched: Mutex<(Option<Watched>, bool)>,
    woken: Condvar,
}

impl Shared {
    /// The watched call, and whether the watchdog has been stopped.
    fn lock(&self) -> MutexGuard<'_, (Option<Watched>, bool)> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The watchdog; its thread ends when it is dropped.
pub struct Watchdog {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// The result of a check.
#[derive(Debug, PartialEq, Eq)]
enum Finding {
    Nothing,
    Late,
    Hopeless,
}

impl Watchdog {
    /// Starts the thread.
    pub fn new() -> Result<Self> {
        let shared = Arc::new(Shared::default());
        let watching = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("watchdog".into()).spawn(move || watch(&watching));
        let thread =
            thread.map_err(|e| Error::Headset { problem: format!("no thread can be started to watch it ({e})") })?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Makes a call that is watched.
    pub fn watch<R>(&self, what: &'static str, patience: Patience, call: impl FnOnce() -> R) -> R {
        self.shared.lock().0 = Some(Watched { what, since: Instant::now(), patience, noticed: false });
        let result = call();
        self.shared.lock().0 = None;
        result
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.shared.lock().1 = true;
        self.shared.woken.notify_all();
        // The thread returns nothing.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn watch(shared: &Shared) {
    let mut state = shared.lock();
    while !state.1 {
        state = shared.woken.wait_timeout(state, TICK).unwrap_or_else(PoisonError::into_inner).0;
        let Some(watched) = &mut state.0 else { continue };
        match look(watched, Instant::now()) {
            Finding::Nothing => {}
            Finding::Late => crate::complain!(
                "pbr-vr: headset: {} has not come back for {} s; wait, check its cable or link, or restart SteamVR; at {} s \
                 this program ends",
                watched.what,
                watched.patience.notice.as_secs(),
                watched.patience.give_up.as_secs()
            ),
            Finding::Hopeless => give_up(watched),
        }
    }
}

fn look(watched: &mut Watched, now: Instant) -> Finding {
    let taken = now.saturating_duration_since(watched.since);
    if taken >= watched.patience.give_up {
        Finding::Hopeless
    } else if taken >= watched.patience.notice && !watched.noticed {
        watched.noticed = true;
        Finding::Late
    } else {
        Finding::Nothing
    }
}

fn give_up(watched: &Watched) -> ! {
    crate::complain!(
        "pbr-vr: headset: {} never came back; restart SteamVR, then this program, or use `--on window`",
        watched.what
    );
    interrupt::exit_at_once(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_call_is_noticed_once_and_a_hopeless_one_given_up() {
        let start = Instant::now();
        let mut watched = Watched { what: "Submit", since: start, patience: Patience::FRAME, noticed: false };
        let mut at = |seconds| look(&mut watched, start + Duration::from_secs(seconds));
        assert_eq!([0, 1, 3, 4, 29].map(|s| at(s) == Finding::Late), [false, false, true, false, false]);
        assert_eq!(at(30), Finding::Hopeless);
    }

    #[test]
    fn what_is_watched_gives_its_result_and_the_thread_ends() {
        let dog = Watchdog::new().expect("a thread");
        assert_eq!(dog.watch("nothing", Patience::FRAME, || 7), 7);
        assert!(dog.shared.lock().0.is_none());
    }
}
