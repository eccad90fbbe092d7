//! Radiance pictures (.hdr, .pic): RGBE texels, flat or with either run-length coding.
//!
//! The `image` crate's decoder is not used: it overflows on chains of empty runs and misreads narrow pictures.
//! Format: Ward, "Real Pixels", Graphics Gems II (1991), and the file format notes of Radiance.

use std::path::Path;

use super::radiance_image::{RadianceImage, SizeCheck};
use crate::error::{MAX_QUOTED, one_line};
use crate::{Error, Result};

/// Whether the content begins like a Radiance picture.
pub fn is_radiance(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

/// Decodes a file; the header's exposure and colour correction are divided out.
///
/// # Errors
/// The file is broken or of another colour format, or `check_size` rejects its size.
pub fn decode(path: &Path, bytes: &[u8], check_size: SizeCheck) -> Result<RadianceImage> {
    let mut bytes = Bytes { rest: bytes, path };
    let header = read_header(&mut bytes)?;
    check_size(path, header.width as u64, header.height as u64)?;
    let width = header.width as usize;
    // 2^(e − 136) for every exponent byte e; e = 0 means black.
    let powers: Vec<f64> = (0..256).map(|e| if e == 0 { 0.0 } else { 2f64.powi(e - 136) }).collect();
    let mut line = vec![[0; 4]; width];
    // Grows with the data that the file holds, not with the size that it declares.
    let mut texels = Vec::new();
    for _ in 0..header.height {
        read_line(&mut bytes, &mut line)?;
        texels.extend(line.iter().map(|&[r, g, b, e]| {
            let power = powers[usize::from(e)];
            [0, 1, 2].map(|c| (f64::from([r, g, b][c]) * power * header.scale[c]) as f32)
        }));
    }
    Ok(RadianceImage { width: header.width, height: header.height, texels })
}

struct Header {
    width: u32,
    height: u32,
    /// Factor from stored values to radiance, per channel.
    scale: [f64; 3],
}

fn read_header(bytes: &mut Bytes) -> Result<Header> {
    let mut scale = [1.0; 3];
    loop {
        let line = bytes.text_line()?;
        if line.is_empty() {
            break;
        }
        let Some((key, value)) = line.split_once('=') else { continue };
        match key.trim() {
            "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                return Err(
                    bytes.broken(format!("its colours are {}, not 32-bit_rle_rgbe", one_line(value, MAX_QUOTED)))
                );
            }
            "EXPOSURE" => {
                let [e] = numbers(bytes, "EXPOSURE", value)?;
                scale = scale.map(|s| s / e);
            }
            "COLORCORR" => {
                let [r, g, b] = numbers(bytes, "COLORCORR", value)?;
                scale = [scale[0] / r, scale[1] / g, scale[2] / b];
            }
            _ => {}
        }
    }
    let line = bytes.text_line()?;
    let words: Vec<_> = line.split_whitespace().collect();
    let size = match words[..] {
        ["-Y", height, "+X", width] => width.parse().ok().zip(height.parse().ok()),
        _ => None,
    };
    let (width, height) = size.ok_or_else(|| {
        bytes.broken(format!("its size reads `{}`, not `-Y height +X width`", one_line(&line, MAX_QUOTED)))
    })?;
    Ok(Header { width, height, scale })
}

/// Exactly N positive, finite numbers.
fn numbers<const N: usize>(bytes: &Bytes, key: &str, text: &str) -> Result<[f64; N]> {
    let values: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let usable = values.iter().all(|v| v.is_normal() && *v > 0.0);
    <[f64; N]>::try_from(values)
        .ok()
        .filter(|_| usable)
        .ok_or_else(|| bytes.broken(format!("{key} reads `{}`", one_line(text, MAX_QUOTED))))
}

fn read_line(bytes: &mut Bytes, line: &mut [[u8; 4]]) -> Result<()> {
    let first = bytes.texel()?;
    // The new coding marks its lines by a texel that no normalised colour has, and exists for these widths only.
    let new_coding = first[0] == 2 && first[1] == 2 && first[2] < 128 && (8..32768).contains(&line.len());
    if !new_coding {
        return read_old_line(bytes, first, line);
    }
    if usize::from(first[2]) << 8 | usize::from(first[3]) != line.len() {
        return Err(bytes.broken("a line's length is not the picture's width".into()));
    }
    (0..4).try_for_each(|channel| read_new_channel(bytes, channel, line))
}

fn read_new_channel(bytes: &mut Bytes, channel: usize, line: &mut [[u8; 4]]) -> Result<()> {
    let mut x = 0;
    while x < line.len() {
        let code = usize::from(bytes.byte()?);
        let (count, run) = if code > 128 { (code - 128, Some(bytes.byte()?)) } else { (code, None) };
        if count == 0 || count > line.len() - x {
            return Err(bytes.broken("a run leaves its line".into()));
        }
        for texel in &mut line[x..x + count] {
            texel[channel] = match run {
                Some(value) => value,
                None => bytes.byte()?,
            };
        }
        x += count;
    }
    Ok(())
}

/// RadianceImage one after another, with (1, 1, 1, n) meaning n more of the last one; n grows by a byte per repetition.
fn read_old_line(bytes: &mut Bytes, first: [u8; 4], line: &mut [[u8; 4]]) -> Result<()> {
    let (mut texel, mut x, mut shift) = (first, 0, 0);
    loop {
        if texel[..3] == [1, 1, 1] {
            let count = usize::from(texel[3]) << shift;
            if x == 0 || shift > 16 || count > line.len() - x {
                return Err(bytes.broken("a run leaves its line".into()));
            }
            let last = line[x - 1];
            line[x..x + count].fill(last);
            x += count;
            shift += 8;
        } else {
            line[x] = texel;
            x += 1;
            shift = 0;
        }
        if x == line.len() {
            return Ok(());
        }
        texel = bytes.texel()?;
    }
}

/// The unread part of a file.
struct Bytes<'a> {
    rest: &'a [u8],
    path: &'a Path,
}

impl Bytes<'_> {
    fn byte(&mut self) -> Result<u8> {
        let (&first, rest) = self.rest.split_first().ok_or_else(|| self.broken("it ends too early".into()))?;
        self.rest = rest;
        Ok(first)
    }

    fn texel(&mut self) -> Result<[u8; 4]> {
        let (&first, rest) = self.rest.split_first_chunk().ok_or_else(|| self.broken("it ends too early".into()))?;
        self.rest = rest;
        Ok(first)
    }

    fn text_line(&mut self) -> Result<String> {
        let end =
            self.rest.iter().position(|&b| b == b'\n').ok_or_else(|| self.broken("its header has no end".into()))?;
        let line = String::from_utf8_lossy(&self.rest[..end]).trim_end().to_owned();
        self.rest = &self.rest[end + 1..];
        Ok(line)
    }

    fn broken(&self, problem: String) -> Error {
        let remedy = "save it again as Radiance RGBE (.hdr) or OpenEXR";
        Error::Broken { path: self.path.into(), what: "Radiance picture", problem, remedy }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n";

    fn file(head: &str, size: &str, data: &[u8]) -> Vec<u8> {
        [head.as_bytes(), b"\n", size.as_bytes(), b"\n", data].concat()
    }

    fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
        let (size, limit) = (format!("{width}x{height}"), "1x1 to 512x512".into());
        let fits = (1..=512).contains(&width) && (1..=512).contains(&height);
        if fits { Ok(()) } else { Err(Error::TooLarge { path: path.into(), what: "picture", size, limit }) }
    }

    fn texels(bytes: &[u8]) -> Result<Vec<[f32; 3]>> {
        decode(Path::new("a.hdr"), bytes, check_size).map(|t| t.texels)
    }

    #[test]
    fn flat_texels() {
        let bytes = file(HEAD, "-Y 1 +X 3", &[128, 64, 32, 129, 0, 0, 0, 0, 255, 0, 1, 145]);
        assert_eq!(texels(&bytes).unwrap(), [[1.0, 0.5, 0.25], [0.0; 3], [255.0 * 512.0, 0.0, 512.0]]);
    }

    #[test]
    fn old_runs_may_be_longer_than_a_byte() {
        // 1 + 2 + 1·256 texels.
        let bytes = file(HEAD, "-Y 1 +X 259", &[128, 128, 128, 129, 1, 1, 1, 2, 1, 1, 1, 1]);
        assert_eq!(texels(&bytes).unwrap(), [[1.0; 3]; 259]);
    }

    #[test]
    fn new_runs_and_literals() {
        let run = |value| [128 + 8, value];
        let data = [&[2, 2, 0, 8][..], &run(128), &[3, 0, 64, 128, 128 + 5, 64], &run(0), &run(129)].concat();
        let line = texels(&file(HEAD, "-Y 1 +X 8", &data)).unwrap();
        assert_eq!(line[..4], [[1.0, 0.0, 0.0], [1.0, 0.5, 0.0], [1.0, 1.0, 0.0], [1.0, 0.5, 0.0]]);
    }

    #[test]
    fn narrow_pictures_have_no_new_coding() {
        let bytes = file(HEAD, "-Y 1 +X 2", &[2, 2, 0, 136, 4, 4, 4, 136]);
        assert_eq!(texels(&bytes).unwrap(), [[2.0, 2.0, 0.0], [4.0; 3]]);
    }

    #[test]
    fn exposure_and_colour_correction_are_divided_out() {
        let head = "#?RGBE\n# a comment\nEXPOSURE=2\r\nEXPOSURE= 0.25\nCOLORCORR=1 2 4\n";
        let bytes = file(head, "-Y 1 +X 1", &[128, 128, 128, 129]);
        assert_eq!(texels(&bytes).unwrap(), [[2.0, 1.0, 0.5]]);
    }

    #[test]
    fn broken_files_are_refused() {
        let flat = [128, 128, 128, 129];
        let endless_runs = [&flat[..], &[1, 1, 1, 0].repeat(40)].concat();
        for (head, size, data) in [
            (HEAD, "-Y 1 +X 2", &flat[..]),
            (HEAD, "+Y 1 +X 1", &flat),
            (HEAD, "-Y 1 +X 99999999999", &flat),
            (HEAD, "-Y 1 +X 1", &[1, 1, 1, 3]),
            (HEAD, "-Y 1 +X 9", &endless_runs),
            (HEAD, "-Y 1 +X 8", &[2, 2, 0, 9, 136, 0, 136, 0, 136, 0, 136, 0]),
            (HEAD, "-Y 1 +X 8", &[2, 2, 0, 8, 137, 0]),
            ("#?RADIANCE\nEXPOSURE=0\n", "-Y 1 +X 1", &flat),
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n", "-Y 1 +X 1", &flat),
        ] {
            assert!(matches!(texels(&file(head, size, data)), Err(Error::Broken { .. })), "{size} {data:?}");
        }
        for size in ["-Y 4000000000 +X 4000000000", "-Y 0 +X 1"] {
            assert!(matches!(texels(&file(HEAD, size, &flat)), Err(Error::TooLarge { .. })), "{size}");
        }
    }
}
