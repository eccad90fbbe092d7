//! Video files of picture sequences, by ffmpeg.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::asset::temporary;
use crate::error::shortened;
use crate::{Error, Result};

/// Characters of ffmpeg's last line that an error shows.
const LONGEST_REASON: usize = 200;

/// The program that makes videos.
pub struct Ffmpeg(PathBuf);

/// Pictures named `folder/stem-0001.png` and so on.
pub struct Pictures<'a> {
    pub folder: &'a Path,
    pub stem: &'a str,
    pub digits: usize,
    pub count: u32,
    pub per_second: u32,
}

impl Ffmpeg {
    /// Looks along the PATH.
    ///
    /// # Errors
    /// [`Error::Usage`], with how to get it.
    pub fn find() -> Result<Self> {
        let name = format!("ffmpeg{}", std::env::consts::EXE_SUFFIX);
        let path = std::env::var_os("PATH").unwrap_or_default();
        let found = std::env::split_paths(&path).map(|folder| folder.join(&name)).find(|file| file.is_file());
        found.map(Self).ok_or_else(|| {
            Error::Usage(
                "ffmpeg, which makes videos, is not on the PATH; install it (Debian: ffmpeg; Windows: winget install \
                 ffmpeg), or write pictures with -o FILE.png"
                    .into(),
            )
        })
    }

    /// Makes an H.264 video that players everywhere show; the file is there when it is whole.
    ///
    /// # Errors
    /// [`Error::Write`] with ffmpeg's own reason.
    pub fn write(&self, pictures: &Pictures<'_>, video: &Path) -> Result<()> {
        let video_beside = temporary::create(video, "mp4").map_err(Error::write(video))?.0;
        let beside = std::path::absolute(video_beside).map_err(Error::write(video))?;
        let run = Command::new(&self.0).args(arguments(pictures, &beside)).stdin(Stdio::null()).output();
        let made = run.and_then(|output| {
            let text = String::from_utf8_lossy(&output.stderr);
            let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gives no reason");
            let failed = || io::Error::other(format!("ffmpeg fails: {}", shortened(last.trim(), LONGEST_REASON)));
            if output.status.success() { std::fs::rename(&beside, video) } else { Err(failed()) }
        });
        made.inspect_err(|_| {
            // It may not exist; the error says what went wrong.
            let _ = std::fs::remove_file(&beside);
        })
        .map_err(Error::write(video))
    }
}

/// 8-bit 4:2:0 is what all players take; it needs even sides. Without dates and versions the bytes are the same each time.
fn arguments(pictures: &Pictures<'_>, video: &Path) -> Vec<OsString> {
    let Pictures { folder, stem, digits, count, per_second } = pictures;
    // In a pattern, % stands for a number.
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    let escaped = |text: &str| text.replace('%', "%%");
    let pattern = folder.join(format!("{stem}-")).to_string_lossy().into_owned();
    let pattern = format!("file:{}%0{digits}d.png", escaped(&pattern));
    let words =
        ["-y", "-loglevel", "error", "-framerate", &per_second.to_string(), "-start_number", "1", "-i", &pattern]
            .map(OsString::from);
    let coded = [
        "-frames:v",
        &count.to_string(),
        "-vf",
        "pad=ceil(iw/2)*2:ceil(ih/2)*2",
        "-c:v",
        "libx264",
        "-crf",
        "16",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        "-map_metadata",
        "-1",
        "-fflags",
        "+bitexact",
        "-flags:v",
        "+bitexact",
    ]
    .map(OsString::from);
    let mut to = OsString::from("file:");
    to.push(video);
    words.into_iter().chain(coded).chain([to]).collect()
}
