//! The flags and files of a sequence of pictures: `render --turntable` and `render --path`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::video::Ffmpeg;
use crate::asset::Outputs;
use crate::render::{Output, Shading};
use crate::{Error, Result};

/// The most pictures of a sequence.
const MOST: u64 = 100_000;
/// Digits of a number, or more where there are more pictures.
const DIGITS: usize = 4;

/// What makes a sequence of a picture.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct SequenceArgs {
    /// Write N pictures, FILE-0001 and so on, while the camera goes once around its target.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST),
        conflicts_with_all = ["path", "frames", "stereo"])]
    pub turntable: Option<u64>,
    /// Write as many pictures as `--frames` says on a smooth way along these cameras of the scene.
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',', requires = "frames",
        conflicts_with_all = ["camera", "stereo"])]
    pub path: Vec<String>,
    /// With `--shading reference`, average this many frames for each picture of a sequence; 256 if left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub average: Option<u64>,
    /// Pictures per second of an .mp4; 30 if left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub fps: Option<u32>,
}

impl SequenceArgs {
    /// The number of pictures; `None` for a single picture. `frames` is that flag.
    fn count(&self, frames: Option<u64>) -> Option<u64> {
        self.turntable.or(if self.path.is_empty() { None } else { frames })
    }
}

/// The files of a sequence.
pub struct SequenceFiles {
    pub folder: PathBuf,
    pub stem: String,
    extension: &'static str,
    pub digits: usize,
    pub count: u32,
    pub video: Option<PathBuf>,
}

impl SequenceFiles {
    /// `None` for a single picture. `output`, `frames` and `shading` are those flags.
    ///
    /// # Errors
    /// [`Error::Usage`] for flags that do not fit together.
    pub fn of(arguments: &SequenceArgs, output: &Path, frames: Option<u64>, shading: Shading) -> Result<Option<Self>> {
        let SequenceArgs { average, fps, .. } = *arguments;
        let extension = output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let usage = |problem: &str| Err(Error::Usage(problem.into()));
        let Some(count) = arguments.count(frames) else {
            return match (extension.as_str(), average, fps) {
                ("mp4", ..) => usage("an .mp4 needs --turntable N or --path NAME,NAME --frames N"),
                (_, Some(_), _) => usage("--average needs --turntable or --path; for one picture use --frames N"),
                (.., Some(_)) => usage("--fps needs -o FILE.mp4"),
                _ => Ok(None),
            };
        };
        let average_counts = average.is_none() || shading == Shading::Reference;
        let (extension, is_video) = match extension.as_str() {
            _ if count > MOST => return usage(&format!("a sequence has at most {MOST} pictures")),
            _ if !average_counts => return usage("--average needs --shading reference"),
            "png" | "exr" if fps.is_some() => return usage("--fps needs -o FILE.mp4"),
            "png" => ("png", false),
            "exr" => ("exr", false),
            "mp4" => ("png", true),
            _ => return usage(&format!("{}: sequences are written as .png, .exr or .mp4", output.display())),
        };
        Ok(Some(Self {
            folder: output.parent().unwrap_or(Path::new("")).to_owned(),
            stem: output.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            extension,
            digits: DIGITS.max(count.to_string().len()),
            count: count as u32,
            video: is_video.then(|| output.to_owned()),
        }))
    }

    /// The name of a picture, from 1.
    pub fn name(&self, number: u32) -> String {
        format!("{}-{number:0digits$}.{}", self.stem, self.extension, digits = self.digits)
    }

    /// The file that records settings and pictures.
    pub fn record(&self) -> PathBuf {
        self.folder.join(format!("{}-sequence.json", self.stem))
    }

    /// What the pictures hold.
    pub fn content(&self) -> Output {
        if self.extension == "exr" { Output::Linear } else { Output::Display }
    }

    /// Adds the files to a command's outputs.
    ///
    /// # Errors
    /// Files that cannot be written; a video without ffmpeg.
    pub fn check(&self, outputs: &mut Outputs) -> Result<()> {
        let mut numbers = vec![1, self.count];
        numbers.dedup();
        numbers.into_iter().try_for_each(|number| outputs.file(&self.folder.join(self.name(number))))?;
        outputs.file(&self.record())?;
        outputs.file_if(self.video.as_deref())?;
        if self.video.is_some() { Ffmpeg::find().map(drop) } else { Ok(()) }
    }
}
