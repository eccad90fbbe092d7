//! Watches the shaders' sources for changes; editors' intermediate steps are skipped.

use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher};

use crate::{Error, Result};

/// Editors write a file in several steps; it counts as complete this long after the last one.
const REST: Duration = Duration::from_millis(200);

/// A watched folder.
pub struct ShaderWatch {
    // Watching ends when it is dropped.
    _watcher: RecommendedWatcher,
    changes: Receiver<()>,
    due: Option<Instant>,
}

impl ShaderWatch {
    /// Watches a folder.
    pub fn new(folder: &Path) -> Result<Self> {
        let failed = |e: notify::Error| Error::read(folder)(std::io::Error::other(e));
        let (sender, changes) = channel();
        let on_event = move |event: notify::Result<notify::Event>| {
            // Reading is an event, too; compiling would trigger itself.
            let changed = |kind| matches!(kind, EventKind::Create(_) | EventKind::Modify(_) | EventKind::Remove(_));
            if event.is_ok_and(|event| changed(event.kind)) {
                // The receiver is gone only while the window closes.
                let _ = sender.send(());
            }
        };
        let mut watcher = notify::recommended_watcher(on_event).map_err(failed)?;
        watcher.watch(folder, RecursiveMode::NonRecursive).map_err(failed)?;
        Ok(Self { _watcher: watcher, changes, due: None })
    }

    /// Whether files have changed and the changes are complete; true once per change.
    pub fn is_due(&mut self, now: Instant) -> bool {
        self.look_at(now);
        self.due.take_if(|due| *due <= now).is_some()
    }

    /// When to look again: when a change will be complete, or after a while.
    pub fn look_at(&mut self, now: Instant) -> Instant {
        if self.changes.try_iter().count() > 0 {
            self.due = Some(now + REST);
        }
        self.due.unwrap_or(now + REST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_reported_once_and_only_after_a_rest() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("a.frag");
        std::fs::write(&file, "1").expect("a test file");
        let mut watch = ShaderWatch::new(folder.path()).expect("a watch");
        assert!(!watch.is_due(Instant::now()));
        std::fs::write(&file, "2").expect("a test file");
        let started = Instant::now();
        while watch.due.is_none() && started.elapsed() < Duration::from_secs(10) {
            assert!(!watch.is_due(Instant::now()), "reported at once");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(watch.is_due(Instant::now() + 2 * REST));
        std::fs::read(&file).expect("as written");
        std::thread::sleep(Duration::from_millis(50));
        assert!(!watch.is_due(Instant::now() + 4 * REST), "reading counts as a change");
    }
}
