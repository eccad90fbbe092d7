//! Decoded material textures: finding constants, packing channels, height maps to normal maps.

use std::io::Cursor;
use std::path::Path;

use glam::{DVec4, Vec4};
use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, ImageError, ImageFormat, ImageReader, Limits, RgbaImage};

use super::basis::BasisPicture;
use super::contained::contained;
use super::image_source::ImageSource;
use super::{file, jpeg};
use crate::error::{MAX_QUOTED, one_line};
use crate::{Error, Result};

/// Largest accepted side, in texels: what every Vulkan 1.3 desktop GPU supports.
pub const MAX_SIDE: u32 = 16384;
/// Limit of the decoder's own buffers: the largest picture at 16 bits per channel.
const MAX_DECODER_BYTES: u64 = 2 << 30;

/// Values that differ by no more than this count as equal: JPEG makes such a difference in a constant picture.
const CONSTANT_SPREAD: u8 = 1;

/// Height between black and white of a height map at `-bm 1`, as a part of its width.
const BUMP_DEPTH: f32 = 0.01;

/// The meaning of a texture's eight-bit values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// RGB is sRGB-encoded colour; alpha is linear coverage.
    Srgb,
    /// Plain numbers: occlusion in red, roughness in green, metallic in blue.
    Linear,
    /// A tangent-space unit vector, n = 2·rgb − 1, +Y up (OpenGL).
    Normal,
}

/// A picture in memory: RGBA, 8 bits per channel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// For messages and GPU debug names.
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub encoding: Encoding,
    /// `width * height * 4` bytes.
    pub pixels: Vec<u8>,
}

impl Texture {
    /// Decodes a PNG, JPEG, WebP, TGA or KTX2 picture (recognised by content) of any bit depth, grey or colour, palette or
    /// not; KTX2 of Basis Universal.
    ///
    /// # Errors
    /// The file cannot be read, is broken or of another format, or is larger than [`MAX_SIDE`] on a side.
    pub fn load(image: &ImageSource, encoding: Encoding) -> Result<Self> {
        let picture = decode(image.place(), &image.read()?)?;
        let (width, height) = (picture.width(), picture.height());
        Ok(Self { name: file::short_name(image.place()), width, height, encoding, pixels: rgba(picture) })
    }

    /// The value of all texels, if no channel varies by more than JPEG's rounding.
    pub fn constant(&self) -> Option<[u8; 4]> {
        self.constant_channels(4)
    }

    /// Red, green and blue of all texels, if they do not vary; alpha may.
    pub fn constant_colour(&self) -> Option<[u8; 3]> {
        self.constant_channels(3).map(|[r, g, b, _]| [r, g, b])
    }

    /// The greatest values of all channels, if the first `count` of them do not vary.
    fn constant_channels(&self, count: usize) -> Option<[u8; 4]> {
        let (mut min, mut max) = ([255; 4], [0; 4]);
        // Most pictures vary within the first few texels.
        for texels in self.pixels.as_chunks::<4>().0.chunks(1024) {
            for texel in texels {
                for c in 0..4 {
                    min[c] = texel[c].min(min[c]);
                    max[c] = texel[c].max(max[c]);
                }
            }
            if (0..count).any(|c| max[c] - min[c] > CONSTANT_SPREAD) {
                return None;
            }
        }
        (!self.pixels.is_empty()).then_some(max)
    }

    /// One channel of it: 0 red … 3 alpha.
    pub fn channel(&self, index: usize) -> Channel {
        let values = self.texels().map(|texel| texel[index]).collect();
        Channel { width: self.width, height: self.height, values }
    }

    fn luminance(&self) -> Channel {
        let of = |[r, g, b, _]: &[u8; 4]| 0.2126 * f32::from(*r) + 0.7152 * f32::from(*g) + 0.0722 * f32::from(*b);
        let values = self.texels().map(|texel| of(texel).round() as u8).collect();
        Channel { width: self.width, height: self.height, values }
    }

    /// Replaces alpha by `mask`, resized to this picture.
    pub fn set_alpha(&mut self, mask: &Channel) {
        let mask = mask.resized(self.width, self.height);
        for (texel, alpha) in self.pixels.chunks_exact_mut(4).zip(mask.values) {
            texel[3] = alpha;
        }
    }

    /// Each texel as `of` makes it of itself.
    pub fn map_texels(&mut self, of: impl Fn([u8; 4]) -> [u8; 4]) {
        self.pixels.as_chunks_mut().0.iter_mut().for_each(|texel| *texel = of(*texel));
    }

    /// Multiplies one channel by a factor of at most 1.
    pub fn scale_channel(&mut self, index: usize, factor: f32) {
        for texel in self.pixels.chunks_exact_mut(4).filter(|_| factor < 1.0) {
            texel[index] = (f32::from(texel[index]) * factor + 0.5) as u8;
        }
    }

    /// Multiplies x and y of a normal map's vectors by a factor, and makes them unit vectors again.
    pub fn scale_slopes(&mut self, factor: f32) {
        for texel in self.pixels.chunks_exact_mut(4).filter(|_| factor != 1.0) {
            let n = glam::Vec3::from_array([texel[0], texel[1], texel[2]].map(|v| f32::from(v) / 127.5 - 1.0));
            let scaled = glam::Vec3::new(n.x * factor, n.y * factor, n.z).normalize_or(glam::Vec3::Z);
            texel[..3].copy_from_slice(&scaled.to_array().map(normal_byte));
        }
    }

    /// Makes every texel opaque.
    pub fn clear_alpha(&mut self) {
        self.pixels.chunks_exact_mut(4).for_each(|texel| texel[3] = 255);
    }

    /// Packs channels into red, green, blue and alpha, resized to the largest of them; absent ones become 255. `None` if
    /// all are absent.
    pub fn packed(name: String, channels: [Option<&Channel>; 4]) -> Option<Self> {
        let width = channels.iter().flatten().map(|c| c.width).max()?;
        let height = channels.iter().flatten().map(|c| c.height).max()?;
        let mut pixels = vec![255; width as usize * height as usize * 4];
        for (index, channel) in channels.into_iter().enumerate() {
            let Some(channel) = channel.map(|c| c.resized(width, height)) else { continue };
            for (texel, value) in pixels.chunks_exact_mut(4).zip(channel.values) {
                texel[index] = value;
            }
        }
        Some(Self { name, width, height, encoding: Encoding::Linear, pixels })
    }

    /// The same in another size, with its bytes interpolated.
    pub fn resized(self, width: u32, height: u32) -> Self {
        let Self { name, encoding, .. } = self;
        if (self.width, self.height) == (width, height) {
            return Self { name, width, height, encoding, pixels: self.pixels };
        }
        let picture = RgbaImage::from_raw(self.width, self.height, self.pixels).unwrap_or_else(|| RgbaImage::new(1, 1));
        let pixels = imageops::resize(&picture, width, height, FilterType::Triangle).into_raw();
        Self { name, width, height, encoding, pixels }
    }

    /// Mean of the texels of an sRGB picture: linear RGB, and alpha.
    pub fn mean(&self) -> Vec4 {
        let linear = linear_of_srgb_bytes();
        let sum = self.texels().fold(DVec4::ZERO, |sum, [r, g, b, a]| {
            let [r, g, b] = [r, g, b].map(|value| f64::from(linear[usize::from(*value)]));
            sum + DVec4::new(r, g, b, f64::from(*a) / 255.0)
        });
        (sum / self.texels().count().max(1) as f64).as_vec4()
    }

    /// Converts a picture named by `bump` to a normal map. A picture that is one already (mostly blue, vectors of about
    /// unit length) is unchanged; any other is a height map, white high, with `strength` hundredths of its width
    /// between black and white. The picture repeats at its borders.
    pub fn into_normal_map(mut self, strength: f32) -> Self {
        self.encoding = Encoding::Normal;
        if self.looks_like_normals() {
            return self;
        }
        let heights: Vec<f32> = self
            .texels()
            .map(|[r, g, b, _]| (0.2126 * f32::from(*r) + 0.7152 * f32::from(*g) + 0.0722 * f32::from(*b)) / 255.0)
            .collect();
        let (width, height) = (self.width as usize, self.height as usize);
        // Central differences span two texels.
        let scale = strength * BUMP_DEPTH * self.width as f32 * 0.5;
        for y in 0..height {
            let (above, below) = (
                heights_row(&heights, width, (y + height - 1) % height),
                heights_row(&heights, width, (y + 1) % height),
            );
            let row = heights_row(&heights, width, y);
            for x in 0..width {
                let towards_right = (row[(x + 1) % width] - row[(x + width - 1) % width]) * scale;
                let towards_top = (above[x] - below[x]) * scale;
                let normal = glam::Vec3::new(-towards_right, -towards_top, 1.0).normalize();
                let texel = (y * width + x) * 4;
                self.pixels[texel..texel + 3].copy_from_slice(&normal.to_array().map(normal_byte));
            }
        }
        self.clear_alpha();
        self
    }

    fn looks_like_normals(&self) -> bool {
        let mean = self.texels().fold([0u64; 3], |sum, texel| std::array::from_fn(|c| sum[c] + u64::from(texel[c])));
        let count = self.pixels.len() as f32 / 4.0;
        let normal = glam::Vec3::from_array(mean.map(|sum| sum as f32 / count / 127.5 - 1.0));
        normal.z > 0.5 && (0.6..1.2).contains(&normal.length()) && normal.truncate().length() < 0.5
    }

    /// Its texels, rows from the top.
    pub fn texels(&self) -> impl Iterator<Item = &[u8; 4]> {
        self.pixels.as_chunks().0.iter()
    }
}

fn heights_row(heights: &[f32], width: usize, y: usize) -> &[f32] {
    &heights[y * width..(y + 1) * width]
}

/// What of a picture makes a single channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pick {
    /// Or its grey.
    Red,
    Green,
    Blue,
    /// 255 where the picture has none.
    Alpha,
    /// Weighted as in Rec. 709, of the values as they are stored.
    Luminance,
    /// Alpha if that varies, else red.
    Coverage,
}

impl Pick {
    /// The channel that `-imfchan` of MTL means.
    pub fn from_letter(letter: &str) -> Option<Self> {
        Some(match letter.to_ascii_lowercase().as_str() {
            "r" => Self::Red,
            "g" => Self::Green,
            "b" => Self::Blue,
            "m" => Self::Alpha,
            "l" => Self::Luminance,
            _ => return None,
        })
    }
}

/// One channel of a picture, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub width: u32,
    pub height: u32,
    /// `width * height` values.
    pub values: Vec<u8>,
}

impl Channel {
    /// What is picked of a picture; errors as of [`Texture::load`].
    pub fn load(image: &ImageSource, pick: Pick) -> Result<Self> {
        let texture = Texture::load(image, Encoding::Linear)?;
        Ok(match pick {
            Pick::Red => texture.channel(0),
            Pick::Green => texture.channel(1),
            Pick::Blue => texture.channel(2),
            Pick::Alpha => texture.channel(3),
            Pick::Luminance => texture.luminance(),
            Pick::Coverage => {
                let alpha = texture.channel(3);
                if alpha.constant().is_none() { alpha } else { texture.channel(0) }
            }
        })
    }

    /// The value of all texels, if it varies by no more than JPEG's rounding.
    pub fn constant(&self) -> Option<u8> {
        let (min, max) = self.range()?;
        (max - min <= CONSTANT_SPREAD).then_some(max)
    }

    /// Moves all values towards 255: with a strength of 0 all the way.
    pub fn weaken(&mut self, strength: f32) {
        for value in &mut self.values {
            *value = (255.0 - strength.clamp(0.0, 1.0) * f32::from(255 - *value)).round() as u8;
        }
    }

    /// Its minimum and maximum.
    pub fn range(&self) -> Option<(u8, u8)> {
        let range = self.values.iter().fold((255, 0), |(min, max), v| (*v.min(&min), *v.max(&max)));
        (!self.values.is_empty()).then_some(range)
    }

    /// Whether some texels are below and some above one half, as in a cutout.
    pub fn cuts_out(&self) -> bool {
        self.values.iter().any(|v| *v < 128) && self.values.iter().any(|v| *v >= 128)
    }

    fn resized(&self, width: u32, height: u32) -> Self {
        if (self.width, self.height) == (width, height) {
            return self.clone();
        }
        let Some(picture) = GrayImage::from_raw(self.width, self.height, self.values.clone()) else {
            return self.clone();
        };
        let values = imageops::resize(&picture, width, height, FilterType::Triangle).into_raw();
        Self { width, height, values }
    }
}

/// A component of a unit vector as normal maps store it.
pub(super) fn normal_byte(component: f32) -> u8 {
    (component * 127.5 + 128.0) as u8
}

/// IEC 61966-2-1.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The same of each byte.
pub fn linear_of_srgb_bytes() -> [f32; 256] {
    std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0))
}

/// Four bytes for each pixel.
fn rgba(picture: DynamicImage) -> Vec<u8> {
    match picture {
        // By far the most frequent, for which the library's conversion takes as long as JPEG's decoder.
        DynamicImage::ImageRgb8(picture) => {
            let pixels = picture.as_raw().as_chunks().0.iter().map(|[r, g, b]| [*r, *g, *b, 255]);
            pixels.collect::<Vec<_>>().into_flattened()
        }
        picture => picture.into_rgba8().into_raw(),
    }
}

fn decode(path: &Path, bytes: &[u8]) -> Result<DynamicImage> {
    if BasisPicture::is_it(bytes) {
        return decode_basis(path, bytes).map(DynamicImage::ImageRgba8);
    }
    // TGA has no signature: any other content is tried as TGA.
    let known = image::guess_format(bytes).ok();
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), known.unwrap_or(ImageFormat::Tga));
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(MAX_DECODER_BYTES);
        reader.limits(limits);
        reader
    };
    let given_up = |problem| broken(path, problem);
    let size = contained(|| reader().into_dimensions()).map_err(given_up)?;
    let (width, height) = size.map_err(|error| match (known, &error) {
        (None, ImageError::Unsupported(_) | ImageError::Decoding(_) | ImageError::IoError(_)) => {
            broken(path, "it is neither PNG, JPEG nor WebP, and not a valid TGA either".into())
        }
        _ => picture_error(path, error),
    })?;
    check_size(path, [width, height])?;
    if !jpeg::is_whole(bytes) {
        return Err(broken(path, "it ends too early".into()));
    }
    contained(|| reader().decode()).map_err(given_up)?.map_err(|error| picture_error(path, error))
}

fn decode_basis(path: &Path, bytes: &[u8]) -> Result<RgbaImage> {
    let given_up = |problem| broken(path, problem);
    let picture = contained(|| BasisPicture::open(bytes)).and_then(|picture| picture).map_err(given_up)?;
    let [width, height] = picture.size;
    check_size(path, picture.size)?;
    let texels = contained(|| picture.decode()).and_then(|texels| texels).map_err(given_up)?;
    RgbaImage::from_raw(width, height, texels).ok_or_else(|| broken(path, "it has too few texels".into()))
}

fn check_size(path: &Path, [width, height]: [u32; 2]) -> Result<()> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        let (size, limit) = (format!("{width}x{height}"), format!("1x1 to {MAX_SIDE}x{MAX_SIDE}"));
        return Err(Error::TooLarge { path: path.into(), what: "texture", size, limit });
    }
    Ok(())
}

fn picture_error(path: &Path, error: ImageError) -> Error {
    if let ImageError::Limits(error) = error {
        let limit = format!("{MAX_DECODER_BYTES} bytes");
        return Error::TooLarge { path: path.into(), what: "texture", size: error.to_string(), limit };
    }
    broken(path, decoder_problem(&error))
}

/// The message of a decoder, in plain words where the file ends too early.
pub(super) fn decoder_problem(error: &ImageError) -> String {
    match error {
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => "it ends too early".into(),
        error => one_line(&error.to_string(), 2 * MAX_QUOTED),
    }
}

fn broken(path: &Path, problem: String) -> Error {
    Error::Broken { path: path.into(), what: "texture", problem, remedy: "save it again as PNG, JPEG, WebP or TGA" }
}

#[cfg(test)]
#[path = "texture_tests.rs"]
mod tests;
