//! Adaptive quality: how many pixels the next frame is drawn with, from the GPU times of earlier ones.
//!
//! After A. Vlachos, "Advanced VR Rendering Performance" (GDC 2016), section "Adaptive Quality": lower above 90 % of the
//! frame, predict from 85 %, raise under 70 %. Pure: the same times give the same levels. Multisampling stays as it is;
//! changing it would need other images and pipelines.

/// Thresholds, as parts of the frame's budget.
const RAISE_UNDER: f32 = 0.70;
const PREDICT_FROM: f32 = 0.85;
const LOWER_ABOVE: f32 = 0.90;
/// The target after a frame that was too slow, between the thresholds for raising and predicting.
const AIM: f32 = 0.75;
/// The part of a frame's time that does not depend on pixels (vertices, shadows), assumed when the area shrinks; 0 is
/// assumed when it grows, so that both estimates err towards slow.
const FIXED_SHARE: f32 = 0.2;
/// Levels per halving of the area. A step of 2^(1/4) = 1.19 takes a frame from under 70 % to no more than 84 %: raising
/// never leads straight back.
const LEVELS_PER_HALF: i32 = 4;
/// The smallest area is a quarter of the largest: half the width, half the height.
const LEVELS: i32 = 2 * LEVELS_PER_HALF + 1;
/// Sizes are multiples of this many pixels, except the largest.
const MULTIPLE: u32 = 8;
/// The most levels to drop after a single slow frame, which may be an outlier.
const FIRST_STEP: usize = 2;
/// Frames between the newest result and the frame whose level is chosen.
const LATENCY: f32 = 2.0;
/// The budget if the display's rate is unknown: 90 Hz.
const USUAL_BUDGET_MS: f32 = 1000.0 / 90.0;

/// A level of quality: the size of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// 0 is the largest.
    pub index: usize,
    /// Pixels of the sub-rectangle in the image's upper left corner, per eye.
    pub size: [u32; 2],
    /// The greatest texture coordinates u and v, for the compositor; the least are 0.
    pub bounds: [f32; 2],
}

/// A frame whose GPU time has arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finished {
    /// Milliseconds; zero, negative and non-finite ones are ignored.
    pub gpu_ms: f32,
    /// [`Level::index`] that it was drawn with.
    pub level: usize,
    /// Whether the compositor had to show an older frame again because the GPU was late.
    pub reprojected_for_gpu: bool,
}

/// Chooses the level of each frame.
#[derive(Clone, Debug)]
pub struct Quality {
    budget_ms: f32,
    levels: Vec<Level>,
    level: usize,
    /// The previous result, as a part of the budget at the current level.
    before: Option<f32>,
    /// Results in a row that were well under the budget.
    calm: u32,
    /// Results until a reprojection without a slow frame may lower the level again.
    pause: u32,
}

impl Quality {
    /// Starts at the largest level. `full` is the size of the image of one eye, pixels; `budget_ms` the display's frame
    /// (one that is no positive number counts as 90 Hz).
    pub fn new(budget_ms: f32, full: [u32; 2]) -> Self {
        let usable = budget_ms.is_finite() && budget_ms > 0.0;
        let budget_ms = if usable { budget_ms } else { USUAL_BUDGET_MS };
        let levels = (0..LEVELS).map(|i| level(i, full)).collect();
        Self { budget_ms, levels, level: 0, before: None, calm: 0, pause: 0 }
    }

    /// The level for the next frame. `finished` is the newest result if one arrived since the last call; results are
    /// expected two frames late.
    ///
    /// A load step is thus seen two frames after it began. The first slow result takes off at most two levels, the second
    /// as many as are needed: from the fourth frame on, frames are in time if 80 % of the load goes with the area.
    pub fn next(&mut self, finished: Option<Finished>) -> Level {
        if let Some(finished) = finished.filter(|f| f.gpu_ms.is_finite() && f.gpu_ms > 0.0) {
            self.learn(finished);
        }
        self.level()
    }

    /// The level chosen last.
    pub fn level(&self) -> Level {
        self.levels[self.level]
    }

    /// All levels, largest first.
    #[cfg(test)]
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    fn learn(&mut self, finished: Finished) {
        let drawn = finished.level.min(self.levels.len() - 1);
        let now = self.estimate(finished.gpu_ms / self.budget_ms, drawn, self.level);
        let before = self.before.replace(now).unwrap_or(now);
        let coming = now + LATENCY * (now - before);
        self.pause = self.pause.saturating_sub(1);
        if now > LOWER_ABOVE {
            let enough = self.enough(now);
            let most = if before > LOWER_ABOVE { enough } else { enough.min(self.level + FIRST_STEP) };
            self.change(most);
        } else if now > PREDICT_FROM && coming > LOWER_ABOVE {
            self.change(self.level + FIRST_STEP);
        } else if finished.reprojected_for_gpu {
            // Other programs use the GPU, too, so the program's own time is not enough.
            self.calm = 0;
            if now > RAISE_UNDER && self.pause == 0 {
                self.change(self.level + 1);
                self.pause = self.second();
            }
        } else {
            self.stay_or_raise(now);
        }
    }

    fn stay_or_raise(&mut self, now: f32) {
        self.calm = if now < RAISE_UNDER { self.calm + 1 } else { 0 };
        let larger = self.level.saturating_sub(1);
        // Rounding makes the steps of very small images coarse.
        let fits = self.estimate(now, self.level, larger) <= PREDICT_FROM;
        if self.calm >= self.second() && fits {
            self.change(larger);
        }
    }

    /// The largest level, no larger than the current one, that brings a time to [`AIM`]; the smallest if none does.
    fn enough(&self, now: f32) -> usize {
        let fits = |i: &usize| self.estimate(now, self.level, *i) <= AIM;
        (self.level..self.levels.len()).find(fits).unwrap_or(self.levels.len() - 1)
    }

    fn change(&mut self, level: usize) {
        let level = level.min(self.levels.len() - 1);
        self.before = self.before.map(|part| self.estimate(part, self.level, level));
        self.level = level;
        self.calm = 0;
    }

    /// Converts a time measured at one level to another level.
    fn estimate(&self, time: f32, from: usize, to: usize) -> f32 {
        let area = |i: usize| self.levels[i].size.map(f64::from).iter().product::<f64>();
        let ratio = (area(to) / area(from)) as f32;
        if ratio < 1.0 { time * (FIXED_SHARE + (1.0 - FIXED_SHARE) * ratio) } else { time * ratio }
    }

    /// Frames in a second.
    fn second(&self) -> u32 {
        (1000.0 / self.budget_ms).ceil() as u32
    }
}

fn level(index: i32, full: [u32; 2]) -> Level {
    let full = full.map(|pixels| pixels.max(1));
    let scale = 0.5 * -f64::from(index) / f64::from(LEVELS_PER_HALF);
    let shrink = |pixels: u32| {
        let multiples = (f64::from(pixels) * scale.exp2() / f64::from(MULTIPLE)).round() as u32;
        (multiples * MULTIPLE).clamp(MULTIPLE.min(pixels), pixels)
    };
    let size = if index == 0 { full } else { full.map(shrink) };
    let bounds = [0, 1].map(|i| size[i] as f32 / full[i] as f32);
    Level { index: index as usize, size, bounds }
}

#[cfg(test)]
#[path = "quality_tests.rs"]
mod tests;
