//! A watchdog thread for calls into the runtime: some block for ever when the link to the headset drops, and cannot be
//! interrupted.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::gpu::Gpu;
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

/// What is done before the process ends because the named call never came back.
type OnGiveUp = Box<dyn FnOnce(&str) + Send>;

#[derive(Default)]
struct Shared {
    watched: Mutex<(Option<Watched>, bool)>,
    woken: Condvar,
    on_give_up: Mutex<Option<OnGiveUp>>,
    /// The GPU that draws, once it is open.
    gpu: Mutex<Weak<Gpu>>,
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

    /// Notes the GPU that draws: a call may be late because that is.
    pub fn set_gpu(&self, gpu: &Arc<Gpu>) {
        *self.shared.gpu.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(gpu);
    }

    /// Sets what is done before the process ends because a call, whose name is given, never came back.
    pub fn set_on_give_up(&self, call: impl FnOnce(&str) + Send + 'static) {
        *self.shared.on_give_up.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(call));
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
            Finding::Late => {
                let gpu = shared.gpu.lock().unwrap_or_else(PoisonError::into_inner).upgrade();
                let busy = gpu.filter(|gpu| gpu.is_busy()).map(|gpu| gpu.info().name.clone());
                crate::complain!("pbr-vr: headset: {}", late(watched, busy.as_deref()));
            }
            Finding::Hopeless => give_up(watched, shared),
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

/// The message about a late call; `busy` is the GPU that still draws this program's own pictures, if it does.
fn late(Watched { what, patience, .. }: &Watched, busy: Option<&str>) -> String {
    let [notice, give_up] = [patience.notice, patience.give_up].map(|time| time.as_secs());
    let advice = match busy {
        Some(gpu) => format!("{gpu} is still drawing: wait, or choose less by --scale or --samples 1"),
        None => "wait, check its cable or link, or restart SteamVR".into(),
    };
    format!("{what} has not come back for {notice} s; {advice}; at {give_up} s this program ends")
}

fn give_up(watched: &Watched, shared: &Shared) -> ! {
    crate::complain!(
        "pbr-vr: headset: {} never came back; restart SteamVR, then this program, or use `--on window`",
        watched.what
    );
    let on_give_up = shared.on_give_up.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(on_give_up) = on_give_up {
        on_give_up(watched.what);
    }
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
    fn a_late_call_is_blamed_on_the_link_only_where_the_gpu_has_nothing_to_do() {
        let watched = Watched { what: "Submit", since: Instant::now(), patience: Patience::FRAME, noticed: false };
        let (idle, busy) = (late(&watched, None), late(&watched, Some("llvmpipe")));
        assert!(idle.contains("Submit has not come back for 3 s") && idle.contains("cable"), "{idle}");
        assert!(busy.contains("llvmpipe is still drawing") && !busy.contains("cable"), "{busy}");
        assert!([idle, busy].iter().all(|line| line.ends_with("at 30 s this program ends")));
    }

    #[test]
    fn what_is_watched_gives_its_result_and_the_thread_ends() {
        let dog = Watchdog::new().expect("a thread");
        assert_eq!(dog.watch("nothing", Patience::FRAME, || 7), 7);
        assert!(dog.shared.lock().0.is_none());
    }
}
