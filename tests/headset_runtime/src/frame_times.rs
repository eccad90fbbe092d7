//! Frame times as seen from the runtime: a line of `frames.csv` per frame.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

/// The columns: milliseconds, but for the first and the last.
const HEAD: &str = "frame,interval_ms,wait_ms,until_submit_ms,submit_ms,missed";

/// Times of the frame under way, and the file for those before.
pub struct FrameTimes {
    file: Option<BufWriter<File>>,
    frame: u64,
    missed: u32,
    wait_began: Option<Instant>,
    wait: Duration,
    began: Instant,
    submit_began: Option<Instant>,
    until_submit: Option<Duration>,
    submit: Duration,
}

impl FrameTimes {
    /// Writes into `folder`; nowhere for `None`.
    ///
    /// # Errors
    /// A line that names the file and what is wrong.
    pub fn open(folder: Option<&Path>) -> Result<Self, String> {
        let open = |folder: &Path| -> Result<BufWriter<File>, String> {
            let path = folder.join("frames.csv");
            let say = |e: std::io::Error| format!("{}: {e}", path.display());
            let mut file = BufWriter::new(File::create(&path).map_err(say)?);
            writeln!(file, "{HEAD}").map_err(say)?;
            Ok(file)
        };
        Ok(Self {
            file: folder.map(open).transpose()?,
            frame: 0,
            missed: 0,
            wait_began: None,
            wait: Duration::ZERO,
            began: Instant::now(),
            submit_began: None,
            until_submit: None,
            submit: Duration::ZERO,
        })
    }

    /// WaitGetPoses is called.
    pub fn wait_begins(&mut self) {
        self.wait_began = Some(Instant::now());
    }

    /// WaitGetPoses returns: the frame before is done.
    pub fn frame_begins(&mut self, frame: u64, missed: u32) {
        let now = Instant::now();
        self.write(now);
        self.wait = self.wait_began.take().map_or(Duration::ZERO, |began| now - began);
        (self.frame, self.missed, self.began) = (frame, missed, now);
        (self.until_submit, self.submit) = (None, Duration::ZERO);
    }

    /// Submit is called.
    pub fn submit_begins(&mut self) {
        self.submit_began = Some(Instant::now());
        self.until_submit.get_or_insert(self.began.elapsed());
    }

    /// Submit returns.
    pub fn submit_ends(&mut self) {
        self.submit += self.submit_began.take().map_or(Duration::ZERO, |began| began.elapsed());
    }

    /// After the last frame.
    pub fn end(&mut self) {
        self.write(Instant::now());
        if let Some(Err(error)) = self.file.as_mut().map(BufWriter::flush) {
            eprintln!("headset runtime: frames.csv: {error}");
        }
    }

    fn write(&mut self, now: Instant) {
        let (Some(file), true) = (&mut self.file, self.frame > 0) else { return };
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let interval = ms(now - self.began);
        let (wait, until, submit) = (ms(self.wait), self.until_submit.map_or(0.0, ms), ms(self.submit));
        let row = format!("{},{interval:.3},{wait:.3},{until:.3},{submit:.3},{}", self.frame, self.missed);
        if let Err(error) = writeln!(file, "{row}") {
            eprintln!("headset runtime: frames.csv: {error}");
        }
    }
}
