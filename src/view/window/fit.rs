//! When to recreate a swapchain: at once if it is out of date, once per size if it is only suboptimal, and not too often.

use std::time::{Duration, Instant};

use crate::gpu::Presented;

/// Whether a swapchain fits its window.
#[derive(Debug)]
pub struct Fit {
    stale: bool,
    /// The size at which the swapchain was last reported as suboptimal, with no good picture since. Some surfaces always
    /// report it, and recreating the swapchain, which waits for the GPU twice, changes nothing.
    suboptimal: Option<[u32; 2]>,
    made_at: Option<Instant>,
}

impl Fit {
    /// There is no swapchain yet.
    pub fn none() -> Self {
        Self { stale: true, suboptimal: None, made_at: None }
    }

    /// Notes that the window or the present mode has changed.
    pub fn changed(&mut self) {
        (self.stale, self.suboptimal) = (true, None);
    }

    /// Notes that the swapchain has been recreated.
    pub fn made(&mut self, now: Instant) {
        (self.stale, self.made_at) = (false, Some(now));
    }

    /// Notes the result of presenting with a swapchain of this size.
    pub fn judge(&mut self, presented: Presented, size: [u32; 2]) {
        match presented {
            Presented::Good => self.suboptimal = None,
            // Once for each size.
            Presented::Suboptimal => self.stale |= self.suboptimal.replace(size) != Some(size),
            Presented::Stale => self.changed(),
        }
    }

    /// Whether it must be recreated before the next picture.
    pub fn is_stale(&self) -> bool {
        self.stale
    }

    /// The earliest time to recreate it that leaves a pause since the last time.
    pub fn due_at(&self, now: Instant, pause: Duration) -> Instant {
        self.made_at.map_or(now, |made| made + pause)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [640, 480];

    /// Shows pictures, recreating the swapchain where needed; returns how often that was.
    fn show(fit: &mut Fit, pictures: &[(Presented, [u32; 2])]) -> usize {
        let mut made = 0;
        for (presented, size) in pictures {
            if fit.is_stale() {
                fit.made(Instant::now());
                made += 1;
            }
            fit.judge(*presented, *size);
        }
        made
    }

    fn shown() -> Fit {
        let mut fit = Fit::none();
        assert_eq!(show(&mut fit, &[(Presented::Good, SIZE); 3]), 1);
        fit
    }

    #[test]
    fn a_surface_that_is_never_content_costs_one_swapchain_and_no_more() {
        assert_eq!(show(&mut shown(), &[(Presented::Suboptimal, SIZE); 100]), 1);
        // From its first picture on, too.
        assert_eq!(show(&mut Fit::none(), &[(Presented::Suboptimal, SIZE); 100]), 2);
    }

    #[test]
    fn one_that_is_content_again_or_has_another_size_gets_another_try() {
        let mut fit = shown();
        let (good, bad) = ((Presented::Good, SIZE), (Presented::Suboptimal, SIZE));
        assert_eq!(show(&mut fit, &[bad, bad, bad, good, bad, bad, bad]), 2);
        let other = (Presented::Suboptimal, [320, 200]);
        assert_eq!(show(&mut fit, &[other, other, other, other]), 1);
    }

    #[test]
    fn a_stale_swapchain_is_recreated_each_time() {
        assert_eq!(show(&mut shown(), &[(Presented::Stale, SIZE); 5]), 4);
        let mut fit = shown();
        show(&mut fit, &[(Presented::Suboptimal, SIZE); 3]);
        fit.changed();
        assert!(fit.is_stale());
        assert_eq!(show(&mut fit, &[(Presented::Suboptimal, SIZE); 9]), 2);
    }

    #[test]
    fn a_pause_is_kept_between_two_swapchains_but_not_before_the_first() {
        let (now, pause) = (Instant::now(), Duration::from_millis(250));
        let mut fit = Fit::none();
        assert_eq!(fit.due_at(now, pause), now);
        fit.made(now);
        fit.changed();
        assert_eq!(fit.due_at(now + Duration::from_millis(20), pause), now + pause);
    }
}
