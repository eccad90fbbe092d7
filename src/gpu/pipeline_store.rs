//! All pipelines of a GPU by a hash of what they were created from, so that each is created once however often it is asked for:
//! by the next scene, or by settings that come back.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

/// Pipelines without users that are kept: more than the twenty or so of one scene. On a CPU's Vulkan driver each takes some 5 MB.
const MOST_UNUSED: usize = 32;

/// A pipeline and its layout.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct RawPipeline {
    pub(super) pipeline: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
}

struct Entry {
    key: blake3::Hash,
    raw: RawPipeline,
    users: usize,
}

/// The pipelines, those released last at the end. It destroys none itself.
pub(super) struct PipelineStore {
    entries: Mutex<Vec<Entry>>,
    most_unused: AtomicUsize,
}

impl Default for PipelineStore {
    fn default() -> Self {
        Self { entries: Mutex::default(), most_unused: AtomicUsize::new(MOST_UNUSED) }
    }
}

impl PipelineStore {
    /// How many without users are kept from now on.
    pub(super) fn keep_unused(&self, most: usize) {
        self.most_unused.store(most, Ordering::Relaxed);
    }

    /// The pipeline that was created from the same, with one more user.
    pub(super) fn take(&self, key: blake3::Hash) -> Option<RawPipeline> {
        let mut entries = self.entries();
        let entry = entries.iter_mut().find(|entry| entry.key == key)?;
        entry.users += 1;
        Some(entry.raw)
    }

    /// Adds a pipeline with one user. Another thread may have added its like meanwhile: both are kept until they are released.
    pub(super) fn add(&self, key: blake3::Hash, raw: RawPipeline) {
        self.entries().push(Entry { key, raw, users: 1 });
    }

    /// Takes a user from a pipeline. Returns one to destroy if too many have none.
    pub(super) fn release(&self, raw: RawPipeline) -> Option<RawPipeline> {
        let most = self.most_unused.load(Ordering::Relaxed);
        let mut entries = self.entries();
        let at = entries.iter().position(|entry| entry.raw == raw)?;
        let mut entry = entries.remove(at);
        entry.users -= 1;
        entries.push(entry);
        let unused = entries.iter().filter(|entry| entry.users == 0).count();
        let oldest = entries.iter().position(|entry| entry.users == 0).filter(|_| unused > most)?;
        Some(entries.remove(oldest).raw)
    }

    /// Removes all, when the device goes.
    pub(super) fn drain(&self) -> Vec<RawPipeline> {
        self.entries().drain(..).map(|entry| entry.raw).collect()
    }

    fn entries(&self) -> MutexGuard<'_, Vec<Entry>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use vk::Handle as _;

    use super::*;

    fn key(number: u64) -> blake3::Hash {
        blake3::hash(&number.to_le_bytes())
    }

    fn raw(number: u64) -> RawPipeline {
        RawPipeline { pipeline: vk::Pipeline::from_raw(number), layout: vk::PipelineLayout::from_raw(number) }
    }

    #[test]
    fn the_longest_unused_go_first_and_no_used_one_goes() {
        let store = PipelineStore::default();
        let most = MOST_UNUSED as u64;
        (0..most + 2).for_each(|i| store.add(key(i), raw(i)));
        assert!(store.take(key(0)) == Some(raw(0)), "a second user of the first");
        assert!((0..=most).all(|i| store.release(raw(i)).is_none()), "of the first, one user is left");
        assert!(store.take(key(1)) == Some(raw(1)) && store.release(raw(1)).is_none(), "used anew");
        assert!(store.release(raw(most + 1)) == Some(raw(2)));
        assert!(store.take(key(2)).is_none() && store.take(key(0)) == Some(raw(0)));
        assert_eq!(store.drain().len(), MOST_UNUSED + 1);
    }
}
