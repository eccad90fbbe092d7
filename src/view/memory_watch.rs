//! When textures get smaller because other programs take the GPU's memory, and when they get larger again.
//!
//! Of all that a scene has in memory, the largest levels of its textures cost the picture least for each byte: they alone are
//! dropped. Light, shadows, geometry and pictures stay.

use std::time::{Duration, Instant};

use crate::gpu::MemoryUse;
use crate::render::affordable_bytes;

/// How often memory is looked at, by a thread that no frame waits for.
pub const LOOK: Duration = Duration::from_secs(1);
/// The least time between two changes.
const REST: Duration = Duration::from_secs(5);
/// Textures do not get smaller than this part of all that is needed of them: three levels less.
const LEAST_PART: u64 = 64;
/// Textures of fewer bytes are not worth a change.
const LEAST_BYTES: u64 = 1 << 20;

/// The textures of the scene that is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureUse {
    /// Of the request that the scene was loaded for.
    pub scene: u64,
    /// On the GPU.
    pub bytes: u64,
    /// Those of all levels that the settings ask for.
    pub needed: u64,
}

/// Other textures than those that are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// Of the request that the scene was loaded for.
    pub scene: u64,
    /// Bytes that they may take.
    pub limit: u64,
    /// How full memory is.
    pub memory: MemoryUse,
}

/// Follows how full memory is.
#[derive(Default)]
pub struct MemoryWatch {
    /// `None` while there is nothing to change, or a change is under way.
    textures: Option<TextureUse>,
    changed: Option<Instant>,
    /// Whether memory was too full when it was looked at last.
    was_over: bool,
}

impl MemoryWatch {
    /// These textures are shown from now on.
    pub fn show(&mut self, textures: TextureUse) {
        (self.textures, self.was_over) = (Some(textures), false);
    }

    /// Looks at memory, every [`LOOK`]; returns what is to be changed, once. What a program has only for a moment, as while a scene
    /// is loaded, changes nothing.
    pub fn look(&mut self, memory: MemoryUse, now: Instant) -> Option<Advice> {
        let TextureUse { scene, bytes, needed } = self.textures.filter(|textures| textures.needed >= LEAST_BYTES)?;
        let is_over = memory.used > memory.budget;
        let stays_over = std::mem::replace(&mut self.was_over, is_over) && is_over;
        if self.changed.is_some_and(|changed| now.duration_since(changed) < REST) {
            return None;
        }
        // Not to the brim: a picture more, and it would be too full again.
        let goal = memory.budget / 10 * 9;
        let less = bytes.saturating_sub(memory.used.saturating_sub(goal)).max(needed / LEAST_PART);
        // As with a scene that is loaded now, and some more, so that it stays so.
        let roomy = affordable_bytes(memory.budget.saturating_sub(memory.used)) / 10 * 8;
        let limit = if stays_over && less < bytes {
            less
        } else if bytes < needed && needed <= roomy {
            needed
        } else {
            return None;
        };
        (self.textures, self.changed) = (None, Some(now));
        Some(Advice { scene, limit, memory })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;
    const SIZE: u64 = 8192 * MIB;

    fn shown(mib: u64) -> TextureUse {
        TextureUse { scene: 7, bytes: mib * MIB, needed: 1024 * MIB }
    }

    fn memory(budget: u64, used: u64) -> MemoryUse {
        MemoryUse { size: SIZE, budget: budget * MIB, used: used * MIB }
    }

    /// A watch that looks every second; limits in MiB.
    struct Watched(MemoryWatch, Instant);

    impl Watched {
        fn new(textures: TextureUse) -> Self {
            let mut watch = MemoryWatch::default();
            watch.show(textures);
            Self(watch, Instant::now())
        }

        fn look(&mut self, budget: u64, used: u64) -> Option<u64> {
            self.1 += LOOK;
            let advice = self.0.look(memory(budget, used), self.1)?;
            assert_eq!((advice.scene, advice.memory), (7, memory(budget, used)));
            Some(advice.limit / MIB)
        }
    }

    #[test]
    fn textures_get_smaller_when_memory_stays_too_full() {
        let mut watched = Watched::new(shown(1024));
        assert_eq!([watched.look(4000, 2000), watched.look(4000, 4000)], [None; 2]);
        // For a moment only.
        assert_eq!([watched.look(1900, 2000), watched.look(4000, 2000), watched.look(1900, 2000)], [None; 3]);
        assert_eq!(watched.look(1900, 2000), Some(1024 - 290), "a tenth of the budget stays free");
        assert_eq!([watched.look(1900, 2000), watched.look(1900, 2000)], [None; 2], "a change is under way");
    }

    #[test]
    fn they_stay_what_can_be_looked_at() {
        let mut watched = Watched::new(shown(1024));
        assert_eq!([watched.look(10, 2000), watched.look(10, 2000)], [None, Some(16)]);
        watched.0.show(shown(16));
        assert!((0..20).all(|_| watched.look(10, 1000).is_none()), "there is no more to drop");
        let mut tiny = Watched::new(TextureUse { scene: 7, bytes: MIB - 1, needed: MIB - 1 });
        assert!((0..20).all(|_| tiny.look(10, 1000).is_none()));
    }

    #[test]
    fn they_come_back_only_where_all_of_them_fit_well() {
        let mut watched = Watched::new(shown(256));
        // Of 2304 free, 512 are for pictures, and four fifths of the rest is more than enough.
        assert_eq!(watched.look(1000 + 1791, 1000), None);
        assert_eq!(watched.look(1000 + 1793, 1000), Some(1024));
        watched.0.show(shown(1024));
        assert!((0..20).all(|_| watched.look(3304, 1768).is_none()));
    }

    #[test]
    fn nothing_changes_all_the_time() {
        let mut watched = Watched::new(shown(1024));
        let mut changes = Vec::new();
        for second in 0..60 {
            // Taken and given back in turns.
            let (budget, used) = if second / 2 % 2 == 0 { (1500, 2000) } else { (8000, 2000) };
            if let Some(limit) = watched.look(budget, used) {
                changes.push(second);
                watched.0.show(shown(limit));
            }
        }
        assert!(changes.windows(2).all(|pair| pair[1] - pair[0] >= REST.as_secs()), "{changes:?}");
        assert!(changes.len() > 4, "{changes:?}");
    }
}
