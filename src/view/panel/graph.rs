//! The last frames' times as a small graph.

use std::collections::VecDeque;

use egui::{Color32, Sense, Stroke, Ui, pos2, vec2};

/// Frames that are shown.
const FRAMES: usize = 120;
/// Points.
const HEIGHT: f32 = 40.0;
/// The times of these rates are marked, frames a second.
const MARKS: [f32; 2] = [90.0, 30.0];

/// The last frames' times, milliseconds.
#[derive(Default)]
pub struct History(VecDeque<f32>);

impl History {
    /// Adds a frame's time, milliseconds.
    pub fn add(&mut self, ms: f32) {
        self.0.push_back(ms);
        while self.0.len() > FRAMES {
            self.0.pop_front();
        }
    }

    /// Draws them, the newest on the right, from 0 to the longest.
    pub fn show(&self, ui: &mut Ui) {
        let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
        let painter = ui.painter_at(area);
        painter.rect_filled(area, 2.0, Color32::from_gray(10));
        let Some(longest) = self.0.iter().copied().reduce(f32::max) else { return };
        let top = (1.1 * longest).max(1e3 / MARKS[0] * 1.2);
        let y = |ms: f32| area.max.y - (ms / top).clamp(0.0, 1.0) * area.height();
        for rate in MARKS {
            let y = y(1e3 / rate);
            painter.hline(area.x_range(), y, Stroke::new(1.0, Color32::from_gray(70)));
        }
        let step = area.width() / (FRAMES - 1) as f32;
        let first = FRAMES - self.0.len();
        let points = self.0.iter().enumerate().map(|(i, ms)| pos2(area.min.x + (first + i) as f32 * step, y(*ms)));
        painter.line(points.collect(), Stroke::new(1.5, Color32::from_rgb(120, 200, 255)));
        response
            .on_hover_text(format!("milliseconds a frame; longest {longest:.1}; lines at 90 and 30 frames a second"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_frames_are_kept() {
        let mut history = History::default();
        (0..500).for_each(|i| history.add(i as f32));
        assert_eq!((history.0.len(), history.0[0]), (FRAMES, 380.0));
    }
}
