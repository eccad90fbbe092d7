//! The two forms of glTF files: JSON alone, or JSON and bytes in one binary file.

use std::ops::Range;
use std::path::Path;

use super::document::Document;
use crate::asset::contained::from_json;
use crate::asset::file;
use crate::error::{MAX_QUOTED, shortened, shown};
use crate::{Error, Result};

/// The most bytes of a file, and of each buffer.
pub const MAX_FILE_BYTES: u64 = 1 << 30;
/// JSON takes several times its size in memory.
const MAX_JSON_BYTES: usize = 256 << 20;

const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
const REMEDY: &str = "export it again";

/// A file's JSON, and its bytes behind that.
pub struct Container {
    pub document: Document,
    /// The first buffer of a binary file.
    pub binary: Option<Vec<u8>>,
}

/// Reads a file; what it is, is told from its content.
///
/// # Errors
/// It cannot be read, is too large, cut off, not glTF, or of another version.
pub fn read(path: &Path) -> Result<Container> {
    let mut bytes = file::read(path, "model", MAX_FILE_BYTES)?;
    if !bytes.starts_with(b"glTF") {
        return Ok(Container { document: parse(path, &bytes)?, binary: None });
    }
    let (json, binary) = chunks(&bytes).map_err(|problem| broken(path, problem, REMEDY))?;
    let document = parse(path, &bytes[json])?;
    let binary = binary.map(|range| {
        bytes.truncate(range.end);
        bytes.drain(..range.start);
        bytes
    });
    Ok(Container { document, binary })
}

/// The error of a file that is not as it should be; `problem` may quote the file.
pub fn broken(path: &Path, problem: String, remedy: &'static str) -> Error {
    Error::Broken { path: path.into(), what: "glTF model", problem: shown(&problem, false), remedy }
}

/// Where the chunks of JSON and of bytes are.
fn chunks(bytes: &[u8]) -> std::result::Result<(Range<usize>, Option<Range<usize>>), String> {
    let word = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let (Some(version), Some(length)) = (word(4), word(8)) else { return Err("it ends in its header".into()) };
    if version != 2 {
        return Err(format!("it is binary glTF of version {version}, not 2"));
    }
    let end = length as usize;
    if end > bytes.len() {
        return Err(format!("it is cut off: {} of {end} bytes are there", bytes.len()));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER_BYTES;
    while at + CHUNK_HEADER_BYTES <= end {
        let (Some(length), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else { break };
        let start = at + CHUNK_HEADER_BYTES;
        let Some(behind) = start.checked_add(length as usize).filter(|behind| *behind <= end) else {
            return Err(format!("a part of {length} bytes goes beyond its end"));
        };
        match kind {
            b"JSON" if json.is_none() => json = Some(start..behind),
            b"BIN\0" if binary.is_none() => binary = Some(start..behind),
            // Others are for extensions.
            _ => {}
        }
        // Some programs leave out the bytes that round up to four.
        at = behind.next_multiple_of(4);
    }
    json.map(|json| (json, binary)).ok_or_else(|| "it has no part of JSON".into())
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Document> {
    if file::is_utf16(bytes) {
        return Err(broken(path, "it is UTF-16 text".into(), "save it again as UTF-8"));
    }
    if bytes.len() > MAX_JSON_BYTES {
        let (size, limit) = (format!("{} bytes of JSON", bytes.len()), format!("{MAX_JSON_BYTES} bytes"));
        return Err(Error::TooLarge { path: path.into(), what: "model", size, limit });
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let document: Document = from_json(text).map_err(|problem| broken(path, problem, REMEDY))?;
    match &document.asset.version {
        Some(version) if version.starts_with("2.") || version == "2" => Ok(document),
        Some(version) => {
            let problem = format!("it is of version {}, not 2.0", shortened(version, MAX_QUOTED));
            Err(broken(path, problem, "export it again as glTF 2.0"))
        }
        None => Err(broken(path, "it does not say its version of glTF".into(), "export it again as glTF 2.0")),
    }
}
