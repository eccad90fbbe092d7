//! For how many frames something has been the same.

/// A value of each frame.
#[derive(Clone, Copy, Debug)]
pub struct Rest<T> {
    last: Option<T>,
    frames: u32,
}

impl<T> Default for Rest<T> {
    fn default() -> Self {
        Self { last: None, frames: 0 }
    }
}

impl<T: PartialEq> Rest<T> {
    /// Takes a frame's value; returns for how many frames before it that was the same.
    pub fn follow(&mut self, now: T) -> u32 {
        self.frames = if self.last.as_ref() == Some(&now) { self.frames + 1 } else { 0 };
        self.last = Some(now);
        self.frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_count_from_the_last_change() {
        let mut rest = Rest::default();
        assert_eq!([1, 1, 1, 2, 2, 1].map(|value| rest.follow(value)), [0, 1, 2, 0, 1, 0]);
    }
}
