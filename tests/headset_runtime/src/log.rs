//! The log: a JSON object per line for every call, in order.

use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};

/// Appends to `calls.jsonl`; several processes may do so one after another.
pub struct Log {
    file: Option<File>,
    started: Instant,
}

impl Log {
    /// Logs into `folder`; nowhere for `None`.
    ///
    /// # Errors
    /// A line that names the file and what is wrong.
    pub fn open(folder: Option<&Path>) -> Result<Self, String> {
        let open = |folder: &Path| {
            let path = folder.join("calls.jsonl");
            let file = OpenOptions::new().create(true).append(true).open(&path);
            file.map_err(|e| format!("{}: {e}", path.display()))
        };
        Ok(Self { file: folder.map(open).transpose()?, started: Instant::now() })
    }

    /// Writes one call with its details: an object, or null for none.
    pub fn call(&mut self, frame: u64, name: &str, details: &Value) {
        let Some(file) = &mut self.file else { return };
        let ms = self.started.elapsed().as_secs_f64() * 1e3;
        let mut line = json!({ "process": std::process::id(), "ms": ms, "frame": frame, "call": name });
        if let (Some(line), Some(details)) = (line.as_object_mut(), details.as_object()) {
            line.extend(details.clone());
        }
        // One write per line: nothing is lost when the process dies.
        if let Err(error) = file.write_all(format!("{line}\n").as_bytes()) {
            eprintln!("headset runtime: the log cannot be written: {error}");
        }
    }
}
