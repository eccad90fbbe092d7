//! The text over the picture: rates, settings, messages that come and go, the list of keys.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::super::frame_clock::Rate;
use super::keys::HELP;

/// How long messages stay.
const NOTE_TIME: Duration = Duration::from_secs(6);
const ERROR_TIME: Duration = Duration::from_secs(20);
/// Messages shown at once; older ones go first.
const MOST_NOTES: usize = 6;
/// Below this many characters a line is cut rather than wrapped.
const NARROWEST: usize = 16;

/// The current state as text.
pub struct Status<'a> {
    pub rate: Option<&'a Rate>,
    /// Shading, exposure, camera …, in order.
    pub settings: &'a [String],
    /// Files being loaded.
    pub loading: &'a VecDeque<String>,
}

/// Text that outlives a frame.
#[derive(Default)]
pub struct Hud {
    notes: VecDeque<(Instant, String)>,
    keys: bool,
}

impl Hud {
    /// Shows a message for a while.
    pub fn note(&mut self, now: Instant, text: impl Into<String>) {
        self.push(now + NOTE_TIME, text.into());
    }

    /// Shows an error message, for longer.
    pub fn error(&mut self, now: Instant, text: impl Into<String>) {
        self.push(now + ERROR_TIME, text.into());
    }

    /// Removes all messages: their cause has been fixed.
    #[cfg(feature = "hot-reload")]
    pub fn forget(&mut self) {
        self.notes.clear();
    }

    /// Shows or hides the list of keys.
    pub fn switch_keys(&mut self) {
        self.keys = !self.keys;
    }

    /// The current lines and the largest scale at which they all fit, or else 1. `grid` gives columns and rows at a scale.
    pub fn fit(
        &mut self,
        now: Instant,
        status: &Status<'_>,
        largest: u32,
        grid: impl Fn(u32) -> [usize; 2],
    ) -> (Vec<String>, u32) {
        let mut scale = largest;
        loop {
            let [columns, rows] = grid(scale);
            let lines = self.lines(now, status, columns);
            if scale <= 1 || lines.len() <= rows {
                return (lines, scale);
            }
            scale -= 1;
        }
    }

    /// The current lines, none longer than `columns`.
    fn lines(&mut self, now: Instant, status: &Status<'_>, columns: usize) -> Vec<String> {
        self.notes.retain(|(until, _)| *until > now);
        let mut lines = Vec::new();
        if let Some(rate) = status.rate {
            lines.push(rate_line(rate));
        }
        lines.push(status.settings.join("  "));
        if self.keys {
            let width = HELP.iter().map(|(key, _)| key.len()).max().unwrap_or(0);
            lines.extend(HELP.iter().map(|(key, what)| format!("{key:<width$}  {what}")));
        } else {
            lines.push("H lists the keys".into());
        }
        lines.extend(status.loading.iter().map(|name| format!("loading {name} ...")));
        lines.extend(self.notes.iter().flat_map(|(_, text)| text.lines().map(str::to_owned)));
        lines.iter().flat_map(|line| wrap(line, columns)).collect()
    }

    fn push(&mut self, until: Instant, text: String) {
        self.notes.push_back((until, text));
        while self.notes.len() > MOST_NOTES {
            self.notes.pop_front();
        }
    }
}

/// The title bar's text.
pub fn title(scene: &str, rate: Option<&Rate>) -> String {
    match rate {
        Some(rate) => {
            let gpu = rate.gpu_ms.map_or(String::new(), |ms| format!(", GPU {ms:.2} ms"));
            format!("{scene} - {:.0} fps{gpu} - pbr-vr", rate.frames_per_second)
        }
        None => format!("{scene} - pbr-vr"),
    }
}

fn rate_line(rate: &Rate) -> String {
    let passes: Vec<String> = rate.passes.iter().map(|pass| format!("{} {:.2}", pass.name, pass.ms)).collect();
    let (fps, ms) = (rate.frames_per_second, rate.frame_ms);
    let gpu = rate.gpu_ms.map_or(String::new(), |gpu| format!("  GPU {gpu:.2} ms ({})", passes.join(", ")));
    format!("{fps:.1} fps  {ms:.2} ms  CPU {:.2} ms{gpu}", rate.record_ms)
}

/// Wraps a line at spaces, and words that are longer than a line.
fn wrap(line: &str, columns: usize) -> Vec<String> {
    let columns = columns.max(NARROWEST);
    let mut rest: Vec<char> = line.chars().collect();
    let mut lines = Vec::new();
    while rest.len() > columns {
        let space = rest[..=columns].iter().rposition(|c| *c == ' ').filter(|at| *at > 0);
        let tail = rest.split_off(space.unwrap_or(columns));
        lines.push(rest.into_iter().collect());
        rest = tail.into_iter().skip(usize::from(space.is_some())).collect();
    }
    lines.push(rest.into_iter().collect());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::PassTime;

    fn status<'a>(settings: &'a [String], loading: &'a VecDeque<String>) -> Status<'a> {
        Status { rate: None, settings, loading }
    }

    #[test]
    fn wrapping_loses_nothing_and_keeps_to_the_width() {
        let path = "x".repeat(50);
        let text = format!("cannot read {path}: not there; check that the path is right");
        let lines = wrap(&text, 20);
        assert!(lines.iter().all(|line| line.chars().count() <= 20), "{lines:?}");
        assert_eq!(lines.concat().replace(' ', ""), text.replace(' ', ""));
        assert_eq!(wrap("short", 20), ["short"]);
        assert_eq!(wrap("", 20), [""]);
        assert_eq!(wrap("exactly twenty chars", 20), ["exactly twenty chars"]);
    }

    #[test]
    fn notes_go_and_errors_stay_longer() {
        let (mut hud, now, loading) = (Hud::default(), Instant::now(), VecDeque::from(["a.obj".to_owned()]));
        hud.note(now, "written");
        hud.error(now, "broken\nin line 2");
        let mut lines = |seconds| hud.lines(now + Duration::from_secs(seconds), &status(&[], &loading), 80);
        assert_eq!(lines(1)[2..], ["loading a.obj ...", "written", "broken", "in line 2"]);
        assert_eq!(lines(10)[3..], ["broken", "in line 2"]);
        assert_eq!(lines(30).len(), 3);
    }

    #[test]
    fn notes_do_not_pile_up() {
        let (mut hud, now) = (Hud::default(), Instant::now());
        (0..20).for_each(|i| hud.note(now, i.to_string()));
        let lines = hud.lines(now, &status(&[], &VecDeque::new()), 80);
        assert_eq!(lines[2..], ["14", "15", "16", "17", "18", "19"]);
    }

    #[test]
    fn the_list_of_keys_names_every_key_once_asked_for() {
        let (mut hud, now) = (Hud::default(), Instant::now());
        hud.switch_keys();
        let lines = hud.lines(now, &status(&["pbr".into()], &VecDeque::new()), 80);
        assert_eq!(lines.len(), 1 + HELP.len());
        assert!(lines.iter().any(|line| line.starts_with("F11") && line.contains("fullscreen")));
    }

    #[test]
    fn text_shrinks_until_it_fits_and_no_further() {
        let (mut hud, now, none) = (Hud::default(), Instant::now(), VecDeque::new());
        hud.switch_keys();
        let mut scale_in = |[width, height]: [usize; 2]| {
            let grid = |scale: u32| [width / (8 * scale as usize), height / (10 * scale as usize)];
            hud.fit(now, &status(&[], &none), 4, grid).1
        };
        assert_eq!([[4000, 2000], [1280, 500], [640, 400], [10, 10]].map(&mut scale_in), [4, 3, 1, 1]);
    }

    #[test]
    fn rates_show_the_gpu_pass_by_pass() {
        let passes = vec![PassTime { name: "scene", ms: 3.0 }, PassTime { name: "text", ms: 0.25 }];
        let rate = Rate { frames_per_second: 59.94, frame_ms: 16.68, record_ms: 0.4, gpu_ms: Some(3.25), passes };
        assert_eq!(rate_line(&rate), "59.9 fps  16.68 ms  CPU 0.40 ms  GPU 3.25 ms (scene 3.00, text 0.25)");
        assert_eq!(title("demo.toml", Some(&rate)), "demo.toml - 60 fps, GPU 3.25 ms - pbr-vr");
    }
}
