//! Clicks shorter than a frame, in parts that egui can take.

use egui::{Event, RawInput};

/// The input of one layout as that of several, each with one press or release of a button at most: of a press and its release
/// in one layout, egui's sliders notice nothing, and on a slow GPU a click is shorter than a frame.
pub fn apart(mut input: RawInput) -> Vec<RawInput> {
    let mut parts = vec![RawInput { events: Vec::new(), ..input.clone() }];
    let mut presses = 0;
    for event in std::mem::take(&mut input.events) {
        let is_button = matches!(event, Event::PointerButton { .. });
        if is_button && presses > 0 {
            parts.push(RawInput { events: Vec::new(), ..input.clone() });
        }
        presses += usize::from(is_button);
        if let Some(part) = parts.last_mut() {
            part.events.push(event);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_click_within_a_frame_moves_a_slider_and_pushes_a_button_once() {
        let context = egui::Context::default();
        let (mut value, mut clicks, mut places) = (0.0, 0, [egui::Rect::NOTHING; 2]);
        let mut lay_out = |events: Vec<Event>| {
            let input = RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(300.0, 200.0))),
                events,
                ..RawInput::default()
            };
            for part in apart(input) {
                let _ = context.run(part, |context| {
                    egui::CentralPanel::default().show(context, |ui| {
                        let slider = ui.add(egui::Slider::new(&mut value, 0.0..=1.0));
                        let button = ui.button("button");
                        clicks += usize::from(button.clicked());
                        places = [slider.rect, button.rect];
                    });
                });
            }
            (value, clicks, places)
        };
        let (_, _, places) = lay_out(Vec::new());
        let click = |pos| {
            let button = |pressed| {
                let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
                Event::PointerButton { pos, button, pressed, modifiers }
            };
            vec![Event::PointerMoved(pos), button(true), button(false)]
        };
        let (value, clicks, _) = lay_out(click(places[0].left_center() + egui::vec2(50.0, 0.0)));
        assert!((0.2..0.8).contains(&value) && clicks == 0, "{value}, {clicks}");
        let (same, clicks, _) = lay_out(click(places[1].center()));
        assert_eq!((same, clicks), (value, 1));
        let twice = [click(places[1].center()), click(places[1].center())].concat();
        assert_eq!(lay_out(twice).1, 3);
    }
}
