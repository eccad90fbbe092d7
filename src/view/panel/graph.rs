//! The last frames' times as a small graph.

use egui::{Color32, Sense, Stroke, Ui, pos2, vec2};

use crate::view::frame_clock::{FrameClock, RECENT};

/// Points.
const HEIGHT: f32 = 40.0;
/// The times of these rates are marked, frames a second.
const MARKS: [f32; 2] = [90.0, 30.0];

/// Draws them, the newest on the right, from 0 to the longest.
pub fn show(ui: &mut Ui, clock: &FrameClock) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, Color32::from_gray(10));
    let Some(longest) = clock.recent().reduce(f32::max) else { return };
    let top = (1.1 * longest).max(1e3 / MARKS[0] * 1.2);
    let y = |ms: f32| area.max.y - (ms / top).clamp(0.0, 1.0) * area.height();
    for rate in MARKS {
        painter.hline(area.x_range(), y(1e3 / rate), Stroke::new(1.0, Color32::from_gray(70)));
    }
    let step = area.width() / (RECENT - 1) as f32;
    let points = clock.recent().enumerate().map(|(i, ms)| pos2(area.max.x - i as f32 * step, y(ms)));
    painter.line(points.collect(), Stroke::new(1.5, Color32::from_rgb(120, 200, 255)));
    response.on_hover_text(format!("milliseconds a frame; longest {longest:.1}; lines at 90 and 30 frames a second"));
}
