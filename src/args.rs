//! Command-line values that several commands share, and their JSON output.

use std::path::Path;

use crate::asset::file::write_atomically;
use crate::reference::metrics::PIXELS_PER_DEGREE_RANGE;
use crate::{Error, Result};

/// `WIDTHxHEIGHT` in pixels.
///
/// # Errors
/// A description of the expected value.
pub fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let problem = || format!("`{text}` is not WIDTHxHEIGHT in pixels, such as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(problem)?;
    let side = |s: &str| s.parse().ok().filter(|n| *n > 0).ok_or_else(problem);
    Ok([side(width)?, side(height)?])
}

/// A finite number above 0.
///
/// # Errors
/// A description of the expected value.
pub fn parse_positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0".into())
}

/// Pixels per degree of visual angle, in the range that FLIP can use.
///
/// # Errors
/// A description of the expected value.
pub fn parse_pixels_per_degree(text: &str) -> std::result::Result<f32, String> {
    let (least, most) = (PIXELS_PER_DEGREE_RANGE.start(), PIXELS_PER_DEGREE_RANGE.end());
    let number = text.parse().ok().filter(|number| PIXELS_PER_DEGREE_RANGE.contains(number));
    number.ok_or_else(|| format!("a number from {least} to {most}"))
}

/// Writes a command's results as JSON if `--json` names a file.
///
/// # Errors
/// [`Error::Write`].
pub fn write_json(path: Option<&Path>, facts: &impl serde::Serialize) -> Result<()> {
    let Some(path) = path else { return Ok(()) };
    let text = serde_json::to_string_pretty(facts).map_err(|e| Error::write(path)(e.into()))?;
    write_atomically(path, (text + "\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_numbers_out_of_range_are_refused() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert_eq!(parse_size("640X480"), Ok([640, 480]));
        for text in ["0x5", "5", "x", "-1x1", "1x2x3", "1e3x1"] {
            assert!(parse_size(text).is_err_and(|e| e.contains("1280x720")), "{text}");
        }
        assert_eq!(parse_positive("0.25"), Ok(0.25));
        assert!(["0", "-1", "NaN", "inf", ""].iter().all(|text| parse_positive(text).is_err()));
        assert_eq!(parse_pixels_per_degree("67"), Ok(67.0));
        assert!(["0", "NaN", "inf", "1e9"].iter().all(|text| parse_pixels_per_degree(text).is_err()));
    }
}
