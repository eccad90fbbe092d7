//! Messages over the picture that come and go.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How long messages stay.
const NOTE_TIME: Duration = Duration::from_secs(6);
const ERROR_TIME: Duration = Duration::from_secs(20);
/// Messages shown at once; older ones go first.
const MOST: usize = 6;
/// Characters of a message; the terminal has the rest.
const LONGEST: usize = 600;

/// A message and how it looks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    until: Instant,
    pub text: String,
    pub is_error: bool,
}

/// The messages, oldest first.
#[derive(Default)]
pub struct Messages(VecDeque<Message>);

impl Messages {
    /// Shows a message for a while.
    pub fn note(&mut self, now: Instant, text: impl Into<String>) {
        self.push(Message { until: now + NOTE_TIME, text: text.into(), is_error: false });
    }

    /// Shows an error message, for longer.
    pub fn error(&mut self, now: Instant, text: impl Into<String>) {
        self.push(Message { until: now + ERROR_TIME, text: text.into(), is_error: true });
    }

    /// Removes all.
    #[cfg(feature = "hot-reload")]
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Those that are shown now.
    pub fn current(&mut self, now: Instant) -> Vec<Message> {
        self.0.retain(|message| message.until > now);
        self.0.iter().cloned().collect()
    }

    /// When the next one goes.
    pub fn next_end(&self) -> Option<Instant> {
        self.0.iter().map(|message| message.until).min()
    }

    fn push(&mut self, mut message: Message) {
        if let Some((cut, _)) = message.text.char_indices().nth(LONGEST) {
            message.text.truncate(cut);
            message.text.push_str(" …");
        }
        self.0.push_back(message);
        while self.0.len() > MOST {
            self.0.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_go_and_errors_stay_longer() {
        let (mut messages, now) = (Messages::default(), Instant::now());
        messages.note(now, "written");
        messages.error(now, "broken");
        let mut texts = |seconds| -> Vec<String> {
            let shown = messages.current(now + Duration::from_secs(seconds));
            shown.into_iter().map(|message| message.text).collect()
        };
        assert_eq!(texts(1), ["written", "broken"]);
        assert_eq!(texts(10), ["broken"]);
        assert!(texts(30).is_empty());
    }

    #[test]
    fn messages_neither_pile_up_nor_fill_the_window() {
        let (mut messages, now) = (Messages::default(), Instant::now());
        (0..20).for_each(|i| messages.note(now, i.to_string()));
        let shown = messages.current(now);
        assert_eq!(shown.iter().map(|m| m.text.as_str()).collect::<Vec<_>>(), ["14", "15", "16", "17", "18", "19"]);
        assert_eq!(messages.next_end(), Some(now + NOTE_TIME));
        messages.note(now, "é".repeat(5000));
        assert_eq!(messages.current(now)[5].text.chars().count(), LONGEST + 2);
    }
}
