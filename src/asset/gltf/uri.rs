//! What a glTF file names: bytes inside the name itself, or a file beside it.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::{percent_decode, percent_decode_str};

use crate::asset::file::{self, Found};

/// Programs disagree on what ends such text.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_allow_trailing_bits(true)
        .with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes of a `data:` URI; `None` if it is not one.
///
/// # Errors
/// They cannot be decoded, or are more than `limit`.
pub fn data(uri: &str, limit: u64) -> Option<Result<Vec<u8>, String>> {
    let rest = uri.get(..5).filter(|start| start.eq_ignore_ascii_case("data:")).map(|_| &uri[5..])?;
    let Some((header, text)) = rest.split_once(',') else { return Some(Err("its data URI has no comma".into())) };
    Some(decoded(header, text, limit))
}

fn decoded(header: &str, text: &str, limit: u64) -> Result<Vec<u8>, String> {
    // No fewer than the bytes that come of it.
    if text.len() as u64 / 4 * 3 > limit {
        return Err(format!("its data URI holds more than {limit} bytes"));
    }
    let plain = Cow::from(percent_decode_str(text));
    if !header.to_ascii_lowercase().ends_with(";base64") {
        return if plain.len() as u64 > limit {
            Err("its data URI is too long".into())
        } else {
            Ok(plain.into_owned())
        };
    }
    BASE64.decode(plain.trim_ascii()).map_err(|error| format!("its data URI is not base64: {error}"))
}

/// Why a URI cannot be a file's.
pub fn foreign_scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    // A single letter is a drive of Windows.
    let is_scheme = scheme.len() > 1
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

/// The file that a URI means, in the model's folder; many programs write names that are not percent-encoded.
pub fn find(folder: &Path, uri: &str) -> Option<Found> {
    let plain = percent_decode(uri.as_bytes()).decode_utf8().ok().filter(|name| *name != uri);
    let plain = plain.and_then(|name| file::find(folder, &name));
    plain.or_else(|| file::find(folder, uri))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_are_decoded() {
        let bytes = |uri| data(uri, 100);
        assert_eq!(bytes("data:application/octet-stream;base64,AQID"), Some(Ok(vec![1, 2, 3])));
        assert_eq!(bytes("data:;base64,AQ"), Some(Ok(vec![1])), "no padding");
        assert_eq!(bytes("data:;base64,AQ%3D%3D"), Some(Ok(vec![1])), "escaped padding");
        assert_eq!(bytes("DATA:,a%20b"), Some(Ok(b"a b".to_vec())));
        assert_eq!(bytes("data.bin"), None);
        assert_eq!(bytes("dat\u{e9}:x"), None);
        for bad in ["data:;base64,A", "data:;base64,A*==", "data:nothing"] {
            assert!(bytes(bad).unwrap().is_err(), "{bad}");
        }
        assert!(data(&format!("data:;base64,{}", "A".repeat(1000)), 100).unwrap().is_err());
    }

    #[test]
    fn schemes_are_not_drives() {
        assert_eq!(foreign_scheme("https://a.b/c.png"), Some("https"));
        for file in ["a.png", "C:/a.png", "a b:c.png", "a/b:c"] {
            assert_eq!(foreign_scheme(file), None, "{file}");
        }
    }

    #[test]
    fn escaped_and_raw_names_are_found() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a b.png", "c%20d.png"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        for uri in ["a%20b.png", "a b.png", "c%20d.png", "c%2520d.png", "x/../a%20b.png", "%2e/a%20b.png"] {
            assert!(find(folder.path(), uri).is_some(), "{uri}");
        }
        for uri in ["", "%", "%FF", "..", "%00"] {
            assert!(find(folder.path(), uri).is_none(), "{uri}");
        }
    }
}
