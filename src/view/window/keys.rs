//! Key bindings: commands by the key's character, movement by its place on the keyboard.

use std::collections::HashSet;

use glam::Vec3;
use winit::event::KeyEvent;
use winit::keyboard::{Key, KeyCode, NamedKey, PhysicalKey};

use crate::view::action::Action;

/// The command of a pressed key; while it is held, only some commands repeat.
pub fn action(event: &KeyEvent, alt: bool) -> Option<Action> {
    let action = of_key(&event.logical_key, alt)?;
    (!event.repeat || matches!(action, Action::AddExposure(_) | Action::AddRotation(_))).then_some(action)
}

fn of_key(key: &Key, alt: bool) -> Option<Action> {
    match key {
        Key::Named(named) => match named {
            NamedKey::Escape => Some(Action::Quit),
            NamedKey::Tab if !alt => Some(Action::SwitchMode),
            NamedKey::F11 => Some(Action::Fullscreen),
            NamedKey::Enter if alt => Some(Action::Fullscreen),
            NamedKey::F12 => Some(Action::Screenshot),
            NamedKey::F1 => Some(Action::Panel),
            NamedKey::PageDown => Some(Action::NextScene),
            NamedKey::PageUp => Some(Action::PreviousScene),
            _ => None,
        },
        Key::Character(text) => match text.to_lowercase().as_str() {
            "c" => Some(Action::NextCamera),
            "r" => Some(Action::Reset),
            "v" => Some(Action::NextPresentMode),
            "h" => Some(Action::Panel),
            "p" => Some(Action::Screenshot),
            "m" => Some(Action::NextShading),
            "n" => Some(Action::PreviousShading),
            "l" => Some(Action::NextPanorama),
            "k" => Some(Action::PreviousPanorama),
            "[" => Some(Action::AddExposure(-1)),
            "]" => Some(Action::AddExposure(1)),
            "," => Some(Action::AddRotation(-1)),
            "." => Some(Action::AddRotation(1)),
            other => match other.as_bytes() {
                [digit @ b'1'..=b'9'] => Some(Action::Camera(usize::from(digit - b'1'))),
                _ => None,
            },
        },
        _ => None,
    }
}

/// The keys that are down.
#[derive(Default)]
pub struct PressedKeys(HashSet<KeyCode>);

impl PressedKeys {
    /// Notes that a key was pressed or released.
    pub fn follow(&mut self, event: &KeyEvent) {
        if let PhysicalKey::Code(code) = event.physical_key {
            if event.state.is_pressed() {
                self.0.insert(code)
            } else {
                self.0.remove(&code)
            };
        }
    }

    /// Notes that the focus was lost: another window will receive the releases.
    pub fn release_all(&mut self) {
        self.0.clear();
    }

    /// Movement right, up and forward, each −1 to 1.
    pub fn movement(&self) -> Vec3 {
        let axis = |plus, minus| f32::from(i8::from(self.0.contains(&plus)) - i8::from(self.0.contains(&minus)));
        Vec3::new(
            axis(KeyCode::KeyD, KeyCode::KeyA),
            axis(KeyCode::KeyE, KeyCode::KeyQ),
            axis(KeyCode::KeyW, KeyCode::KeyS),
        )
    }

    /// Whether Shift is down.
    pub fn fast(&self) -> bool {
        self.0.contains(&KeyCode::ShiftLeft) || self.0.contains(&KeyCode::ShiftRight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn character(text: &str) -> Option<Action> {
        of_key(&Key::Character(text.into()), false)
    }

    #[test]
    fn letters_work_in_both_cases_and_digits_choose_cameras() {
        assert_eq!(character("m"), Some(Action::NextShading));
        assert_eq!(character("M"), Some(Action::NextShading));
        assert_eq!((character("1"), character("9")), (Some(Action::Camera(0)), Some(Action::Camera(8))));
        assert_eq!((character("0"), character("+1"), character("z")), (None, None, None));
    }

    #[test]
    fn enter_needs_alt() {
        let enter = Key::Named(NamedKey::Enter);
        assert_eq!((of_key(&enter, false), of_key(&enter, true)), (None, Some(Action::Fullscreen)));
    }

    #[test]
    fn commands_do_not_sit_on_movement_keys() {
        for key in ["w", "a", "s", "d", "q", "e"] {
            assert_eq!(character(key), None);
        }
    }

    #[test]
    fn pressed_keys_add_up_and_opposites_cancel() {
        let mut keys = PressedKeys::default();
        keys.0.extend([KeyCode::KeyW, KeyCode::KeyD, KeyCode::KeyA, KeyCode::KeyE, KeyCode::ShiftRight]);
        assert_eq!((keys.movement(), keys.fast()), (Vec3::new(0.0, 1.0, 1.0), true));
        keys.release_all();
        assert_eq!((keys.movement(), keys.fast()), (Vec3::ZERO, false));
    }
}
