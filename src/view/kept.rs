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

/// What is printed when a GPU is opened again after an error.
pub fn opened_again(error: &Error) -> String {
    const AGAIN: &str = "it is opened again, and the scene loaded again";
    if error.is_device_lost() {
        return format!("the GPU was lost; {AGAIN}. If that happens again, update the GPU's driver");
    }
    format!("{error}; now {AGAIN}")
}

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

/// When GPUs were lost, or failed.
#[derive(Default)]
pub struct Losses {
    last: Option<Instant>,
}

impl Losses {
    /// Whether an error is one after which a GPU is to be opened again: the loss of it; where a scene is shown, any other of its
    /// failures, too, as a frame of which half was made cannot be followed by another on the same device.
    pub fn may_go_on_after(&mut self, error: &Error, shows_scene: bool, now: Instant) -> bool {
        if !(error.is_device_lost() || shows_scene && error.is_of_gpu()) {
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
        let mut after = |error, seconds| losses.may_go_on_after(error, true, start + Duration::from_secs(seconds));
        assert_eq!([after(&other, 0), after(&lost, 1), after(&lost, 30)], [false, true, false]);
        assert_eq!([after(&lost, 89), after(&lost, 149)], [false, true]);
    }

    #[test]
    fn other_failures_of_the_gpu_are_survived_by_a_scene_that_is_shown() {
        let full = || Error::vulkan("submitting work")(ash::vk::Result::ERROR_OUT_OF_HOST_MEMORY);
        let memory = Error::GpuMemory { what: "a target".into(), problem: "there is none".into() };
        for error in [full(), memory] {
            for shows_scene in [false, true] {
                let goes_on = Losses::default().may_go_on_after(&error, shows_scene, Instant::now());
                assert_eq!(goes_on, shows_scene, "{error}");
            }
        }
        assert!(opened_again(&full()).contains("submitting work"));
    }
}
