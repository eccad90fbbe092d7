//! Colours and sizes of the panel: light text on a dark ground that covers the picture, so that it can be read over any.

use egui::scroll_area::ScrollSource;
use egui::{Color32, Context, RichText, ScrollArea, Theme, Visuals};

/// Behind text over the picture: opaque enough for a contrast of 7:1 over white (WCAG 2.1, 1.4.6).
pub const GROUND: Color32 = Color32::from_black_alpha(245);
const PANEL: Color32 = Color32::from_gray(24);
const TEXT: Color32 = Color32::from_gray(235);
const WEAK: Color32 = Color32::from_gray(180);
const ERROR: Color32 = Color32::from_rgb(255, 170, 150);

/// Sets the style of a context.
pub fn apply(context: &Context) {
    let mut visuals = Visuals::dark();
    visuals.panel_fill = PANEL;
    visuals.window_fill = PANEL;
    visuals.override_text_color = Some(TEXT);
    visuals.weak_text_color = Some(WEAK);
    context.set_theme(Theme::Dark);
    context.set_visuals_of(Theme::Dark, visuals);
    context.style_mut_of(Theme::Dark, |style| {
        // Nothing moves by itself: a window at rest is not drawn.
        style.animation_time = 0.0;
        style.interaction.tooltip_delay = 0.3;
        style.spacing.slider_width = 140.0;
        style.spacing.item_spacing = egui::vec2(6.0, 5.0);
    });
}

/// An area that wheel and scroll bar move. A drag does not: a click of a hand that still moves would throw away what it
/// was meant for, by the hand's speed.
pub fn scrolled() -> ScrollArea {
    ScrollArea::vertical().scroll_source(ScrollSource::MOUSE_WHEEL | ScrollSource::SCROLL_BAR)
}

/// Text of an error.
pub fn error(text: &str) -> RichText {
    RichText::new(text).color(ERROR)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far a list has moved half a second after some frames of 1/60 s, each with its events.
    fn moved_by(frames: &[&[egui::Event]]) -> f32 {
        let context = Context::default();
        let mut offset = 0.0;
        for (frame, events) in frames.iter().chain(&[&[][..]; 30]).enumerate() {
            let input = egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(300.0, 200.0))),
                time: Some(frame as f64 / 60.0),
                events: events.to_vec(),
                ..egui::RawInput::default()
            };
            let _ = context.run(input, |context| {
                egui::CentralPanel::default().show(context, |ui| {
                    let area = scrolled().show(ui, |ui| (0..100).map(|i| ui.button(format!("{i}"))).count());
                    offset = area.state.offset.y;
                });
            });
        }
        offset
    }

    #[test]
    fn a_click_of_a_moving_hand_does_not_move_a_list_but_a_wheel_does() {
        let at = |y| egui::Event::PointerMoved(egui::pos2(20.0, y));
        let button = |pressed| egui::Event::PointerButton {
            pos: egui::pos2(20.0, 80.0),
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        let click: [&[egui::Event]; 6] =
            [&[at(190.0)], &[at(150.0)], &[at(110.0)], &[at(80.0), button(true)], &[at(78.0)], &[button(false)]];
        assert_eq!(moved_by(&click), 0.0);
        let wheel = egui::Event::MouseWheel {
            unit: egui::MouseWheelUnit::Line,
            delta: egui::vec2(0.0, -3.0),
            modifiers: egui::Modifiers::NONE,
        };
        assert!(moved_by(&[&[at(80.0)], &[wheel]]) > 20.0);
    }

    /// Relative luminance, WCAG 2.1.
    fn luminance(colour: [f32; 3]) -> f32 {
        let linear = colour.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    fn contrast(a: f32, b: f32) -> f32 {
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn text_has_contrast_over_the_panel_and_over_a_white_picture() {
        let of = |c: Color32| luminance([c.r(), c.g(), c.b()].map(|c| f32::from(c) / 255.0));
        // The ground lets a little of the picture's linear light through.
        let over_white = 1.0 - f32::from(GROUND.a()) / 255.0;
        for text in [TEXT, WEAK, ERROR] {
            for ground in [of(PANEL), over_white, 0.0] {
                assert!(contrast(of(text), ground) >= 4.5, "{text:?} over {ground}: {}", contrast(of(text), ground));
            }
        }
        assert!(contrast(of(TEXT), over_white) >= 4.5);
    }
}
