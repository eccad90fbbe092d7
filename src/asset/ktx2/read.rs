//! KTX 2.0: a file's bytes, which may be hostile, as a texture. The `ktx2` crate decodes header, level index and
//! key/value pairs; the limits, and the one layout that is accepted (as `write.rs` makes it), are checked here.
//!
//! `ktx2::Reader` is not used: version 0.5 panics on a descriptor whose blocks are 256 texels wide.

use std::collections::BTreeMap;
use std::path::Path;

use ktx2::{Header, KeyValueDataIterator, LevelIndex, MAGIC};

use super::{Ktx2, TexelFormat, level_bytes};
use crate::asset::contained::contained;
use crate::asset::file;
use crate::{Error, Result};

/// Texels along a side at most.
const MAX_SIDE: u32 = 16384;
/// Elements of an array at most.
const MAX_LAYERS: u32 = 64;
/// Bytes of all keys and values at most.
const MAX_KEY_VALUES: usize = 1 << 20;

impl Ktx2 {
    /// Reads a file of at most `limit` bytes.
    ///
    /// # Errors
    /// The file cannot be read, is too large, is broken, or is of a kind that [`Ktx2::write`] does not write:
    /// supercompressed, 3D, another order of its sections.
    pub fn read(path: &Path, limit: u64) -> Result<Self> {
        Self::from_bytes(path, &file::read(path, "KTX2 texture", limit)?)
    }

    /// The same from a file's content; `path` names it in the error. Allocates no more than the content's length.
    ///
    /// # Errors
    /// As for [`Ktx2::read`].
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        contained(|| parse(bytes)).and_then(|parsed| parsed).map_err(|problem| Error::Broken {
            path: path.into(),
            what: "KTX2 texture",
            problem,
            remedy: "write it again with `pbr-vr bake`",
        })
    }
}

type Parsed<T> = std::result::Result<T, String>;

fn parse(bytes: &[u8]) -> Parsed<Ktx2> {
    if !bytes.starts_with(&MAGIC) {
        return Err("it does not begin as a KTX 2.0 file does".into());
    }
    let header = bytes.first_chunk().ok_or("its header is cut off")?;
    let header = Header::from_bytes(header).map_err(|error| format!("its header is broken: {error}"))?;
    let format = check_header(&header)?;
    let key_values = check_descriptor(bytes, &header, format)?;
    let key_values_end = key_values + header.index.kvd_byte_length as usize;
    let key_values = parse_key_values(bytes.get(key_values..key_values_end).ok_or("its key/value data are cut off")?)?;
    let places = check_levels(bytes, &header, format, key_values_end)?;
    // All places lie within the file; only now are texels copied.
    let levels = places.into_iter().map(|place| bytes[place].to_vec()).collect();
    let size = [header.pixel_width, header.pixel_height];
    Ok(Ktx2 { format, size, layers: header.layer_count, faces: header.face_count, levels, key_values })
}

fn check_header(header: &Header) -> Parsed<TexelFormat> {
    let number = header.format.map_or(0, |format| format.value());
    let format = TexelFormat::from_vulkan(number).ok_or_else(|| format!("format {number} is not supported"))?;
    let Header { pixel_width: width, pixel_height: height, pixel_depth: depth, layer_count: layers, .. } = *header;
    if depth != 0 || [width, height].iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
        return Err(format!(
            "{width} x {height} x {depth} texels; 1 x 1 x 0 to {MAX_SIDE} x {MAX_SIDE} x 0 are supported"
        ));
    }
    let faces = header.face_count;
    if !(faces == 1 || (faces == 6 && width == height)) {
        return Err(format!("{faces} face(s) of {width} x {height}"));
    }
    if layers > MAX_LAYERS {
        return Err(format!("{layers} layers; at most {MAX_LAYERS} are supported"));
    }
    let (levels, most) = (header.level_count, 32 - width.max(height).leading_zeros());
    if !(1..=most).contains(&levels) {
        return Err(format!("{levels} levels of {width} x {height} texels; there can be 1 to {most}"));
    }
    if header.type_size != format.channel_bytes() {
        return Err(format!("type size {} does not match its format", header.type_size));
    }
    let global_data = (header.index.sgd_byte_offset, header.index.sgd_byte_length);
    if header.supercompression_scheme.is_some() || global_data != (0, 0) {
        return Err("it is supercompressed".into());
    }
    Ok(format)
}

/// Compares the descriptor with the only one that its format can have; returns where the key/value data begin.
fn check_descriptor(bytes: &[u8], header: &Header, format: TexelFormat) -> Parsed<usize> {
    let (index, descriptor) = (&header.index, format.descriptor());
    // At most 15 levels, as `check_header` made sure.
    let start = Header::LENGTH + LevelIndex::LENGTH * header.level_count as usize;
    let end = start + descriptor.len();
    let place = (index.dfd_byte_offset as usize, index.dfd_byte_length as usize);
    if place != (start, descriptor.len()) || bytes.get(start..end) != Some(&descriptor) {
        return Err("its data format descriptor does not match its format".into());
    }
    let (at, length) = (index.kvd_byte_offset as usize, index.kvd_byte_length as usize);
    if (at, length) != (0, 0) && (at != end || length > MAX_KEY_VALUES) {
        return Err(format!(
            "{length} bytes of key/value data at {at}; at most {MAX_KEY_VALUES} are supported, at {end}"
        ));
    }
    Ok(end)
}

fn parse_key_values(bytes: &[u8]) -> Parsed<BTreeMap<String, Vec<u8>>> {
    let mut all = BTreeMap::new();
    let mut read = 0;
    for (key, value) in KeyValueDataIterator::new(bytes) {
        read += size_of::<u32>() + (key.len() + 1 + value.len()).next_multiple_of(4);
        if key.is_empty() || all.insert(key.to_owned(), value.to_vec()).is_some() {
            return Err(format!("key `{key}` is there twice, or is empty"));
        }
    }
    // The iterator skips pairs that it cannot decode, and ends early where they are cut off.
    if read == bytes.len() { Ok(all) } else { Err("its key/value data are broken".into()) }
}

/// The places of all levels, level 0 first. They must follow `from` one after another, aligned, the smallest first, up
/// to the end of the file.
fn check_levels(
    bytes: &[u8],
    header: &Header,
    format: TexelFormat,
    from: usize,
) -> Parsed<Vec<std::ops::Range<usize>>> {
    let size = [header.pixel_width, header.pixel_height];
    let mut places = Vec::new();
    let mut end = from as u64;
    for level in (0..header.level_count).rev() {
        let entry = Header::LENGTH + LevelIndex::LENGTH * level as usize;
        let entry = bytes.get(entry..).and_then(<[u8]>::first_chunk).ok_or("its level index is cut off")?;
        let LevelIndex { byte_offset: start, byte_length: length, uncompressed_byte_length: whole } =
            LevelIndex::from_bytes(entry);
        let expected = level_bytes(format, size, header.layer_count, header.face_count, level);
        if length != expected || whole != expected {
            return Err(format!("level {level} has {length} bytes and should have {expected}"));
        }
        let expected_start = end.next_multiple_of(u64::from(format.bytes()));
        // The limits of `check_header` keep the sum below 2^44.
        end = expected_start + length;
        if start != expected_start || end > bytes.len() as u64 {
            return Err(format!("level {level} ({length} bytes at {start}) lies outside the file or overlaps"));
        }
        // Both are at most the file's length.
        places.push(start as usize..end as usize);
    }
    if end != bytes.len() as u64 {
        return Err(format!("{} bytes follow its last level", bytes.len() as u64 - end));
    }
    places.reverse();
    Ok(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Ktx2 {
        let format = TexelFormat::Rgba16Float;
        let level = |i: u32| -> Vec<u8> {
            let length = level_bytes(format, [4, 4], 2, 6, i) as u32;
            (0..length).map(|b| (b * 7 + i) as u8).collect()
        };
        let levels = (0..3).map(level).collect();
        let mut cube = Ktx2 { format, size: [4, 4], layers: 2, faces: 6, levels, key_values: BTreeMap::new() };
        cube.set_text("pbrvrOne", "1");
        cube.key_values.insert("pbrvrNothing".into(), vec![]);
        cube
    }

    fn file() -> Vec<u8> {
        cube().to_bytes(Path::new("cube.ktx2")).unwrap()
    }

    fn problem(bytes: &[u8]) -> String {
        let error = Ktx2::from_bytes(Path::new("cube.ktx2"), bytes).unwrap_err();
        assert!(matches!(&error, Error::Broken { path, .. } if path == Path::new("cube.ktx2")), "{error}");
        error.to_string()
    }

    /// The file with a word of its header replaced.
    fn with_word(at: usize, value: u32) -> Vec<u8> {
        let mut bytes = file();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    }

    #[test]
    fn what_is_written_is_read() {
        let mut back = Ktx2::from_bytes(Path::new("a"), &file()).unwrap();
        assert_eq!(back.text("KTXorientation"), Some("rd"));
        assert!(back.text("KTXwriter").is_some_and(|w| w.starts_with("pbr-vr ")));
        assert_eq!((back.text("pbrvrOne"), back.text("none")), (Some("1"), None));
        back.key_values.retain(|key, _| key.starts_with("pbrvr"));
        assert_eq!(back, cube());
        let flat = Ktx2 {
            format: TexelFormat::Rg32Float,
            size: [3, 5],
            layers: 0,
            faces: 1,
            levels: vec![vec![9; 120], vec![8; 16]],
            key_values: BTreeMap::new(),
        };
        let back = Ktx2::from_bytes(Path::new("a"), &flat.to_bytes(Path::new("a")).unwrap()).unwrap();
        assert_eq!((back.size, back.faces, &back.levels), (flat.size, 1, &flat.levels));
    }

    #[test]
    fn every_cut_is_an_error() {
        let bytes = file();
        (0..bytes.len()).for_each(|length| drop(problem(&bytes[..length])));
        assert!(problem(&[bytes, vec![0]].concat()).contains("follow"));
    }

    #[test]
    fn no_flipped_byte_panics_and_all_in_the_structure_are_detected() {
        let whole = file();
        let texels_at = whole.len() - cube().levels.iter().map(Vec::len).sum::<usize>();
        for at in 0..texels_at {
            for flip in [0x01, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                // Only a flipped key, value or padding byte may stay readable.
                if let Ok(read) = Ktx2::from_bytes(Path::new("a"), &bytes)
                    && at < Header::LENGTH + 3 * LevelIndex::LENGTH + 92
                {
                    panic!("byte {at} of header, index or descriptor was not detected: {:?}", read.key_values);
                }
            }
        }
    }

    #[test]
    fn foreign_and_broken_headers_are_named() {
        assert!(problem(b"\xabKTX 11\xbb\r\n\x1a\n").contains("does not begin"));
        for (at, value, part) in [
            (12, 1, "format 1 "),
            (16, 4, "type size"),
            (20, 0, "zero pixel width"),
            (20, u32::MAX, "are supported"),
            (28, 1, "4 x 4 x 1"),
            (32, 1 << 20, "layers"),
            (36, 5, "5 face(s)"),
            (40, 0, "0 levels"),
            (40, 4, "4 levels"),
            (44, 2, "compressed"),
            (48, 4, "descriptor"),
            (52, u32::MAX, "descriptor"),
            (60, u32::MAX, "key/value"),
            (64, 8, "compressed"),
            (80, 0, "level 0"),
            (92, 1, "level 0"),
        ] {
            let problem = problem(&with_word(at, value));
            assert!(problem.contains(part), "word at {at}: {problem}");
        }
    }

    #[test]
    fn a_huge_size_allocates_nothing() {
        let mut bytes = with_word(20, 16384);
        bytes[24..28].copy_from_slice(&16384u32.to_le_bytes());
        assert!(problem(&bytes).contains("level 2"));
    }

    /// `ktx2::Reader` panics on this one.
    #[test]
    fn a_descriptor_of_huge_blocks_is_an_error() {
        let mut bytes = file();
        let sides = Header::LENGTH + 3 * LevelIndex::LENGTH + 16;
        bytes[sides..sides + 4].fill(255);
        assert!(problem(&bytes).contains("descriptor"));
    }

    #[test]
    fn key_value_data_are_checked() {
        let one = |pair: &[u8]| [&(pair.len() as u32).to_le_bytes(), pair].concat();
        assert_eq!(parse_key_values(&one(b"a\0\x01\x02")).unwrap(), [("a".into(), vec![1, 2])].into());
        for bad in
            [&one(b"abcd"), &one(b"\0abc"), &one(b"a\xff\0b"), &one(b"a\0b"), &[one(b"a\0bc"), one(b"a\0bc")].concat()]
        {
            assert!(parse_key_values(bad).is_err(), "{bad:?}");
        }
        assert!(parse_key_values(&[9, 0, 0, 0, b'a', 0]).is_err());
        assert!(parse_key_values(&[9, 0]).is_err());
    }
}
