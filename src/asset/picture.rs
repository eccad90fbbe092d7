//! Rendered pictures: reading and writing.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    Encoding, Image, ImageAttributes, Layer, LayerAttributes, ReadChannels, ReadLayers, SpecificChannels, Vec2,
    WritableImage,
};
use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageEncoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;
use serde::Serialize;

use super::contained::contained;
use super::file::{self, write_atomically};
use super::radiance_image::RadianceImage;
use super::texture::decoder_problem;
use super::{jpeg, openexr, radiance};
use crate::reference::tone;
use crate::{Error, Result};

/// Largest picture that is read, in pixels: a little more than 8K (7680 × 4320).
const MAX_PIXELS: u64 = 1 << 25;

/// Largest file that is read, in bytes: twice the largest picture as an uncompressed EXR of four floats.
const MAX_FILE: u64 = MAX_PIXELS * 32;

/// The unit of a picture's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Display values: sRGB-encoded, 0 to 1. PNG, JPEG, WebP, TGA.
    Display,
    /// Linear RGB scene radiance, without exposure or tone curve. EXR, HDR.
    Radiance,
}

/// A picture in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Its file or content, for messages.
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub kind: Kind,
    /// Rows from the top; `width * height` pixels of RGB.
    pub pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A display picture from sRGB-encoded RGBA bytes, rows from the top; alpha is dropped.
    pub fn from_srgb8(name: impl Into<String>, width: u32, height: u32, rgba: &[u8]) -> Self {
        let pixels = rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]].map(|c| f32::from(c) / 255.0)).collect();
        Self { name: name.into(), width, height, kind: Kind::Display, pixels }
    }

    /// A radiance picture from linear RGBA, rows from the top; alpha is dropped.
    pub fn from_radiance(name: impl Into<String>, width: u32, height: u32, rgba: &[[f32; 4]]) -> Self {
        let pixels = rgba.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
        Self { name: name.into(), width, height, kind: Kind::Radiance, pixels }
    }

    /// Reads a PNG, JPEG, WebP, TGA, HDR or EXR file, recognised by content (TGA by name). Alpha and colour profiles are
    /// ignored; of an EXR the first layer with R, G and B is read.
    ///
    /// # Errors
    /// The file cannot be read, is broken or of another format, or is larger than 8K.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = file::read(path, "the picture", MAX_FILE)?;
        if openexr::is_openexr(&bytes) {
            read_exr(path, &bytes)
        } else if radiance::is_radiance(&bytes) {
            // The `image` crate's decoder ignores the header's exposure.
            let RadianceImage { width, height, texels } = radiance::decode(path, &bytes, check_size)?;
            Ok(Self { name: path.display().to_string(), width, height, kind: Kind::Radiance, pixels: texels })
        } else {
            read_image(path, &bytes)
        }
    }

    /// Writes a display picture as .png (RGB, 8 bits) or a radiance picture as .exr (RGB, f32, ZIP), atomically. The
    /// same picture always gives the same bytes.
    ///
    /// # Errors
    /// The file cannot be written, or its extension does not fit the kind of picture.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_bytes(path)?)
    }

    /// What [`Self::write`] writes into a file of this name.
    ///
    /// # Errors
    /// The extension does not fit the kind of picture.
    pub fn to_bytes(&self, path: &Path) -> Result<Vec<u8>> {
        if self.pixels.len() as u64 != u64::from(self.width) * u64::from(self.height) || self.pixels.is_empty() {
            let problem = format!("{} pixels for {} × {}", self.pixels.len(), self.width, self.height);
            let remedy = "this is a defect of pbr-vr, please report it";
            return Err(Error::Broken { path: path.into(), what: "picture", problem, remedy });
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let bytes = match (extension.as_str(), self.kind) {
            ("png", Kind::Display) => self.png(),
            ("exr", Kind::Radiance) => self.exr(),
            ("png" | "exr", _) => {
                let problem = format!("{}: display values go into .png, radiance into .exr", path.display());
                return Err(Error::Usage(problem));
            }
            _ => return Err(Error::Usage(format!("{}: pictures are written as .png or .exr", path.display()))),
        };
        bytes.map_err(|e| Error::write(path)(std::io::Error::other(e)))
    }

    /// As a display picture: radiance is exposed by `ev` stops and tone-mapped; display pictures are unchanged.
    pub fn to_display(&self, ev: f32) -> Self {
        let pixels = match self.kind {
            Kind::Display => self.pixels.clone(),
            Kind::Radiance => self.srgb8(ev).into_iter().map(|p| p.map(|c| f32::from(c) / 255.0)).collect(),
        };
        Self { name: self.name.clone(), width: self.width, height: self.height, kind: Kind::Display, pixels }
    }

    /// Its eight-bit sRGB pixels.
    pub(super) fn srgb8(&self, ev: f32) -> Vec<[u8; 3]> {
        let byte = |c: f32| (c * 255.0).round() as u8; // `as` saturates
        match self.kind {
            Kind::Display => self.pixels.iter().map(|p| p.map(byte)).collect(),
            Kind::Radiance => {
                let see = |p: &[f32; 3]| tone::display_bytes(Vec3::from(*p).as_dvec3(), f64::from(ev));
                self.pixels.par_iter().map(see).collect()
            }
        }
    }

    fn png(&self) -> std::result::Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
        use image::codecs::png::{CompressionType, FilterType, PngEncoder};
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive).write_image(
            self.srgb8(0.0).as_flattened(),
            self.width,
            self.height,
            image::ExtendedColorType::Rgb8,
        )?;
        Ok(bytes)
    }

    fn exr(&self) -> std::result::Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
        let size = Vec2(self.width as usize, self.height as usize);
        let pixel = |at: Vec2<usize>| {
            let [r, g, b] = self.pixels[at.y() * size.0 + at.x()];
            (r, g, b)
        };
        let channels = SpecificChannels::rgb(pixel);
        let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
        let attributes = ImageAttributes::with_size(size);
        let mut bytes = Cursor::new(Vec::new());
        Image::new(attributes, layer).write().non_parallel().to_buffered(&mut bytes)?;
        Ok(bytes.into_inner())
    }
}

fn broken(path: &Path, problem: impl ToString) -> Error {
    let remedy = "give a whole PNG, JPEG, WebP, TGA, HDR or EXR file";
    Error::Broken { path: path.into(), what: "picture", problem: problem.to_string(), remedy }
}

fn too_large(path: &Path, size: String, limit: String) -> Error {
    Error::TooLarge { path: path.into(), what: "the picture", size, limit }
}

fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(broken(path, format!("{width} × {height} pixels")));
    }
    if width.saturating_mul(height) > MAX_PIXELS {
        return Err(too_large(path, format!("{width} × {height}"), format!("{MAX_PIXELS} pixels")));
    }
    Ok(())
}

fn read_image(path: &Path, bytes: &[u8]) -> Result<Picture> {
    let mut reader = ImageReader::new(Cursor::new(bytes));
    let format = image::guess_format(bytes).ok().or_else(|| ImageFormat::from_path(path).ok());
    reader.set_format(format.ok_or_else(|| broken(path, "neither its content nor its name is that of a picture"))?);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PIXELS * 16);
    reader.limits(limits);
    let decoder = contained(|| reader.into_decoder()).map_err(|problem| broken(path, problem))?;
    let decoder = decoder.map_err(|e| broken(path, decoder_problem(&e)))?;
    let (width, height) = decoder.dimensions();
    check_size(path, width.into(), height.into())?;
    if !jpeg::is_whole(bytes) {
        return Err(broken(path, "it ends too early"));
    }
    let decoded = contained(|| DynamicImage::from_decoder(decoder)).map_err(|problem| broken(path, problem))?;
    let pixels = decoded.map_err(|e| broken(path, decoder_problem(&e)))?.into_rgb32f();
    let pixels = pixels.pixels().map(|p| p.0).collect();
    Ok(Picture { name: path.display().to_string(), width, height, kind: Kind::Display, pixels })
}

fn read_exr(path: &Path, bytes: &[u8]) -> Result<Picture> {
    let ([width, height], pixels) = openexr::guarded(path, bytes, check_size, read_layer)?;
    Ok(Picture { name: path.display().to_string(), width, height, kind: Kind::Radiance, pixels })
}

/// Size and pixels of the first layer with R, G and B. In one thread: a panic in a worker thread of the decoder would
/// end the process.
fn read_layer(bytes: &[u8]) -> exr::error::Result<([u32; 2], Vec<[f32; 3]>)> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0f32; 3]; size.area()]),
            |(width, pixels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))?;
    let Layer { size, channel_data, .. } = image.layer_data;
    // Both were checked against the size limit.
    Ok(([size.width() as u32, size.height() as u32], channel_data.pixels.1))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::DVec3;

    use super::*;

    fn display() -> Picture {
        let bytes: Vec<u8> = (0..23 * 11).flat_map(|i| [i as u8, (i * 7) as u8, (i * 31) as u8, 255]).collect();
        Picture::from_srgb8("display", 23, 11, &bytes)
    }

    fn radiance() -> Picture {
        let values: Vec<_> = (0..23 * 11).map(|i| [i as f32 * 300.0, 1e-5 * i as f32, 0.3, 1.0]).collect();
        Picture::from_radiance("radiance", 23, 11, &values)
    }

    #[test]
    fn written_pictures_come_back_and_are_always_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        for (picture, file) in [(display(), "a.png"), (radiance(), "a.exr"), (display(), "B.PNG")] {
            let path = folder.path().join(file);
            picture.write(&path).unwrap();
            let first = fs::read(&path).unwrap();
            let back = Picture::read(&path).unwrap();
            assert_eq!(back.name, path.display().to_string());
            assert_eq!(Picture { name: picture.name.clone(), ..back }, picture);
            picture.write(&path).unwrap(); // over the old one
            assert_eq!(first, fs::read(&path).unwrap());
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "a temporary file was left behind");
    }

    #[test]
    fn unwritable_pictures_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (picture, name) in [(display(), "a.exr"), (radiance(), "a.png"), (display(), "a.bmp"), (display(), "a")] {
            let error = picture.write(&at(name)).unwrap_err();
            assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(name), "{error}");
        }
        let error = display().write(&at("no/such/folder/a.png")).unwrap_err();
        assert!(matches!(error, Error::Write { .. }), "{error}");
        let short = Picture { height: 12, ..display() };
        assert!(short.write(&at("a.png")).unwrap_err().to_string().contains("253 pixels for 23 × 12"));
        fs::create_dir(at("folder.png")).unwrap();
        assert!(matches!(display().write(&at("folder.png")).unwrap_err(), Error::Write { .. }));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "a temporary file was left behind");
    }

    #[test]
    fn other_formats_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let rgb = image::RgbImage::from_fn(9, 5, |x, y| image::Rgb([x as u8 * 20, y as u8 * 40, 77]));
        for (name, tolerance) in [("a.tga", 0.0), ("a.jpg", 0.2), ("a.png", 0.0), ("a.webp", 0.0)] {
            let path = folder.path().join(name);
            rgb.save(&path).unwrap();
            let picture = Picture::read(&path).unwrap();
            assert_eq!((picture.width, picture.height, picture.kind), (9, 5, Kind::Display));
            let worst = (picture.pixels[4 * 9 + 8][0] - 160.0 / 255.0).abs();
            assert!(worst <= tolerance, "{name}: {worst}");
        }
        let path = folder.path().join("a.hdr");
        let hdr = [image::Rgb([1.0, 2.0, 4096.0]); 6];
        image::codecs::hdr::HdrEncoder::new(fs::File::create(&path).unwrap()).encode(&hdr, 3, 2).unwrap();
        let picture = Picture::read(&path).unwrap();
        assert_eq!((picture.width, picture.height, picture.kind), (3, 2, Kind::Radiance));
        assert!((picture.pixels[5][2] / 4096.0 - 1.0).abs() < 0.01);
    }

    #[test]
    fn exposure_is_divided_out_as_for_panoramas() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        fs::write(&path, b"#?RADIANCE\nEXPOSURE=4\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x82").unwrap();
        let picture = Picture::read(&path).unwrap();
        assert_eq!((picture.kind, picture.pixels), (Kind::Radiance, vec![[0.25; 3], [0.5; 3]]));
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("broken");
        for (picture, file) in [(display(), "a.png"), (radiance(), "a.exr")] {
            let whole = folder.path().join(file);
            picture.write(&whole).unwrap();
            let bytes = fs::read(&whole).unwrap();
            for keep in 0..bytes.len() - 20 {
                fs::write(&path, &bytes[..keep]).unwrap();
                let error = Picture::read(&path).expect_err(&format!("{file} cut to {keep} bytes"));
                assert!(matches!(error, Error::Broken { .. }) && error.to_string().contains("broken"), "{error}");
            }
            for at in 0..bytes.len().min(1500) {
                let mut corrupted = bytes.clone();
                corrupted[at] ^= 0xff;
                fs::write(&path, &corrupted).unwrap();
                let _ = Picture::read(&path); // may succeed or fail, but not panic
            }
        }
        assert!(matches!(Picture::read(&folder.path().join("none.png")).unwrap_err(), Error::Read { .. }));
    }

    #[test]
    fn a_huge_picture_is_rejected_before_memory_is_allocated() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("giant.png");
        let mut bytes = Vec::new();
        image::codecs::png::PngEncoder::new(&mut bytes)
            .write_image(&[0; 3], 1, 1, image::ExtendedColorType::Rgb8)
            .unwrap();
        // Width and height follow the signature, the chunk's length and its type; a checksum follows the header.
        bytes[16..20].copy_from_slice(&60_000u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&60_000u32.to_be_bytes());
        let checksum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        fs::write(&path, &bytes).unwrap();
        let error = Picture::read(&path).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    }

    /// PNG's checksum: ISO 3309, polynomial 0xedb88320.
    fn crc32(bytes: &[u8]) -> u32 {
        let bit = |c: u32, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
        !bytes.iter().fold(!0, |c, b| (0..8).fold(c ^ u32::from(*b), bit))
    }

    #[test]
    fn display_of_radiance_is_the_tone_curve() {
        let grey = Picture::from_radiance("grey", 1, 1, &[[0.25, 0.25, 0.25, 1.0]]);
        let expected = tone::display_bytes(DVec3::splat(0.5), 0.0)[0];
        assert_eq!(grey.to_display(1.0).pixels, [[f32::from(expected) / 255.0; 3]]);
        assert_eq!(display().to_display(3.0), display());
    }
}
