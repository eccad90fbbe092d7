//! What outlasts the loss of a GPU: everything that is shown again once a GPU is open again.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::playlist::Playlist;
use super::shown_scene::SceneChanges;
use super::stagings::Stagings;
use crate::Error;
use crate::render::RenderSettings;

/// After this time without a loss, a GPU may be lost once more. One that is lost again and again is broken.
const PERIOD: Duration = Duration::from_secs(60);

/// What is printed when a GPU is opened again.
pub const OPENED_AGAIN: &str =
    "the GPU was lost; it is opened again, and the scene loaded again. If that happens again, update the GPU's driver";

/// What an app shows.
pub struct Kept {
    pub playlist: Playlist,
    pub stagings: Stagings,
    /// The scene that is shown, or is the first to be.
    pub scene: Option<PathBuf>,
    /// What was changed of it.
    pub changes: Option<SceneChanges>,
    pub settings: RenderSettings,
    /// Those of the start.
    pub first_settings: RenderSettings,
}

/// When GPUs were lost.
#[derive(Default)]
pub struct Losses {
    last: Option<Instant>,
}

impl Losses {
    /// Whether an error is the loss of a GPU after which another one is to be opened.
    pub fn may_go_on_after(&mut self, error: &Error, now: Instant) -> bool {
        if !error.is_device_lost() {
            return false;
        }
        let before = self.last.replace(now);
        before.is_none_or(|before| now.duration_since(before) >= PERIOD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_loss_a_minute_is_survived() {
        let (mut losses, start) = (Losses::default(), Instant::now());
        let lost = Error::vulkan("submitting work")(ash::vk::Result::ERROR_DEVICE_LOST);
        let other = Error::Usage("no".into());
        let mut after = |error, seconds| losses.may_go_on_after(error, start + Duration::from_secs(seconds));
        assert_eq!([after(&other, 0), after(&lost, 1), after(&lost, 30)], [false, true, false]);
        assert_eq!([after(&lost, 89), after(&lost, 149)], [false, true]);
    }
}
