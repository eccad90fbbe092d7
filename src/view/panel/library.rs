//! Small pictures of panoramas, made in the background as they come into view, and kept on disk.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

use egui::{Color32, ColorImage, Context, TextureHandle, TextureOptions};
use glam::DVec3;

use crate::Result;
use crate::asset::cache::Key;
use crate::asset::picture::Picture;
use crate::asset::{Panorama, Report, folders};
use crate::reference::tone::{display_bytes, luminance};

/// Texels.
pub const SIZE: [usize; 2] = [128, 64];
/// The display luminance that a panorama's mean is brought to, before tone mapping.
const MEAN: f64 = 0.3;
/// Raised whenever the same panorama gives another picture.
const VERSION: u32 = 1;

/// The picture of one panorama.
pub enum Thumbnail {
    /// It is being made.
    Awaited,
    /// The file cannot be read: the reason.
    Broken(String),
    Ready(TextureHandle),
}

type Made = (PathBuf, std::result::Result<ColorImage, String>);

/// Pictures of panoramas by file.
pub struct Library {
    thumbnails: HashMap<PathBuf, Thumbnail>,
    requests: Sender<PathBuf>,
    made: Receiver<Made>,
}

impl Library {
    /// Starts the thread that makes them; it calls `wake` after each. It ends with the library.
    pub fn new(wake: impl Fn() + Send + 'static) -> Self {
        let (requests, to_do) = channel::<PathBuf>();
        let (sender, made) = channel();
        let work = move || {
            for file in to_do {
                let picture = thumbnail(&file).map_err(|error| error.to_string());
                if sender.send((file, picture)).is_err() {
                    return;
                }
                wake();
            }
        };
        // Without a thread the names alone are shown.
        if let Err(error) = std::thread::Builder::new().name("thumbnails".into()).spawn(work) {
            tracing::warn!("no thread for pictures of panoramas can be started: {error}");
        }
        Self { thumbnails: HashMap::new(), requests, made }
    }

    /// The picture of a panorama, which is made if it is not there.
    pub fn get(&mut self, context: &Context, file: &Path) -> &Thumbnail {
        for (file, picture) in self.made.try_iter() {
            let thumbnail = match picture {
                Ok(image) => {
                    let name = file.to_string_lossy().into_owned();
                    Thumbnail::Ready(context.load_texture(name, image, TextureOptions::LINEAR))
                }
                Err(problem) => Thumbnail::Broken(problem),
            };
            self.thumbnails.insert(file, thumbnail);
        }
        self.thumbnails.entry(file.to_owned()).or_insert_with(|| {
            // This fails only if the thread has panicked, which has been printed.
            let _ = self.requests.send(file.to_owned());
            Thumbnail::Awaited
        })
    }
}

/// Makes or reads a panorama's picture.
fn thumbnail(file: &Path) -> Result<ColorImage> {
    let kept = kept_file(file);
    if let Some(image) = kept.as_ref().filter(|kept| kept.is_file()).and_then(|kept| read_kept(kept)) {
        return Ok(image);
    }
    let panorama = Panorama::load(file, &Report::silent())?;
    let small = shrink(&panorama);
    let mean = small.iter().map(|rgb| luminance(*rgb)).sum::<f64>() / small.len() as f64;
    let ev = if mean > 0.0 && mean.is_finite() { (MEAN / mean).log2() } else { 0.0 };
    let bytes: Vec<[u8; 3]> = small.iter().map(|rgb| display_bytes(*rgb, ev)).collect();
    if let Some(kept) = kept {
        keep(&kept, &bytes);
    }
    Ok(image(bytes.into_iter()))
}

/// A picture that was kept; `None` where there is none that can be used.
fn read_kept(file: &Path) -> Option<ColorImage> {
    let picture = Picture::read(file).ok()?;
    let fits = [picture.width, picture.height].map(|side| side as usize) == SIZE;
    fits.then(|| image(picture.pixels.iter().map(|rgb| rgb.map(|c| (255.0 * c).round() as u8))))
}

/// Where a panorama's picture is kept: it changes with the file's size and date.
fn kept_file(file: &Path) -> Option<PathBuf> {
    let data = std::fs::metadata(file).ok()?;
    let modified = data.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?;
    let mut key = Key::new("thumbnail", VERSION);
    key.add(std::path::absolute(file).ok()?.as_os_str().as_encoded_bytes());
    key.add(&data.len().to_le_bytes());
    key.add(&modified.as_nanos().to_le_bytes());
    Some(folders::caches()?.join("pbr-vr").join("thumbnails").join(key.text()).with_extension("png"))
}

/// Keeps a picture for the next start, which else makes it again.
fn keep(file: &Path, bytes: &[[u8; 3]]) {
    let rgba: Vec<u8> = bytes.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect();
    let [width, height] = SIZE.map(|side| side as u32);
    let written = file.parent().map_or(Ok(()), std::fs::create_dir_all).map_err(crate::Error::write(file));
    let written = written.and_then(|()| Picture::from_srgb8("thumbnail", width, height, &rgba).write(file));
    if let Err(error) = written {
        tracing::debug!("thumbnails: {error}");
    }
}

/// Mean radiance over each texel of the small picture, row by row.
fn shrink(panorama: &Panorama) -> Vec<DVec3> {
    let [width, height] = [panorama.width as usize, panorama.height as usize];
    let span = |i: usize, small: usize, large: usize| {
        let first = i * large / small;
        first..((i + 1) * large / small).max(first + 1)
    };
    let texel = |i: usize| {
        let (columns, rows) = (span(i % SIZE[0], SIZE[0], width), span(i / SIZE[0], SIZE[1], height));
        let count = (columns.len() * rows.len()) as f64;
        let row = |y: usize| &panorama.texels[y * width + columns.start..y * width + columns.end];
        let sum: DVec3 = rows.flat_map(row).map(|rgb| DVec3::from_array(rgb.map(f64::from))).sum();
        sum / count
    };
    (0..SIZE[0] * SIZE[1]).map(texel).collect()
}

fn image(bytes: impl Iterator<Item = [u8; 3]>) -> ColorImage {
    ColorImage::new(SIZE, bytes.map(|[r, g, b]| Color32::from_rgb(r, g, b)).collect())
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use glam::Vec3;

    use super::*;

    #[test]
    fn a_shrunk_panorama_keeps_its_mean_whatever_its_size() {
        for [width, height] in [[512, 256], [300, 150], [64, 32], [2, 1]] {
            let panorama = Panorama::from_fn(width, height, |d| Vec3::splat(1.0 + 0.5 * d.y));
            let small = shrink(&panorama);
            let mean = small.iter().sum::<DVec3>() / small.len() as f64;
            // Where the sizes do not divide, texels stand for unequal areas.
            assert!((mean.x - 1.0).abs() < 5e-3, "{width}x{height}: {mean}");
        }
    }

    #[test]
    fn a_kept_picture_is_the_same() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("new").join("a.png");
        let bytes: Vec<[u8; 3]> = (0..SIZE[0] * SIZE[1]).map(|i| [i as u8, (i / 256) as u8, 7]).collect();
        keep(&file, &bytes);
        let kept = read_kept(&file).expect("a picture");
        assert!(kept.pixels == image(bytes.into_iter()).pixels);
        std::fs::write(&file, "torn").expect("a test file");
        assert!(read_kept(&file).is_none());
    }

    #[test]
    fn pictures_come_in_the_background_and_broken_files_say_why() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let broken = folder.path().join("broken.hdr");
        std::fs::write(&broken, "not a panorama").expect("a test file");
        let shipped = crate::asset::shipped::folder().expect("assets").join(crate::asset::shipped::PANORAMA);
        let (context, mut library) = (Context::default(), Library::new(|| {}));
        let started = Instant::now();
        let mut wait = |file: &Path, done: fn(&Thumbnail) -> bool| {
            while !done(library.get(&context, file)) {
                assert!(started.elapsed() < Duration::from_secs(60), "nothing comes");
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        wait(&broken, |thumbnail| matches!(thumbnail, Thumbnail::Broken(problem) if problem.contains("broken.hdr")));
        wait(&shipped, |thumbnail| matches!(thumbnail, Thumbnail::Ready(texture) if texture.size() == SIZE));
    }
}
