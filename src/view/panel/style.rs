//! Colours and sizes of the panel: light text on a dark ground that covers the picture, so that it can be read over any.

use egui::{Color32, Context, RichText, Theme, Visuals};

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

/// Text of an error.
pub fn error(text: &str) -> RichText {
    RichText::new(text).color(ERROR)
}

#[cfg(test)]
mod tests {
    use super::*;

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
