//! KTX 2.0: a file's bytes, which may be hostile, as a texture.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use super::{HEADER_BYTES, IDENTIFIER, Ktx2, LEVEL_BYTES, TexelFormat, level_bytes};
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
    /// It cannot be read, is too large, is broken, or is of a kind that is not written here: supercompressed, 3D.
    pub fn read(path: &Path, limit: u64) -> Result<Self> {
        Self::from_bytes(path, &file::read(path, "KTX2 texture", limit)?)
    }

    /// The same from a file's content; `path` names it in the error. It takes no more memory than the content has.
    ///
    /// # Errors
    /// As for [`Ktx2::read`].
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        parse(bytes).map_err(|problem| Error::Broken {
            path: path.into(),
            what: "KTX2 texture",
            problem,
            remedy: "write it again with `pbr-vr bake`",
        })
    }
}

type Parsed<T> = std::result::Result<T, String>;

fn parse(bytes: &[u8]) -> Parsed<Ktx2> {
    if !bytes.starts_with(&IDENTIFIER) {
        return Err("it does not begin as a KTX 2.0 file does".into());
    }
    if bytes.len() < HEADER_BYTES {
        return Err("its header is cut off".into());
    }
    let word = |i: usize| word_at(bytes, IDENTIFIER.len() + 4 * i);
    let (size, layers, faces) = ([word(2), word(3)], word(5), word(6));
    let levels = word(7);
    let format = TexelFormat::from_vulkan(word(0)).ok_or_else(|| format!("format {} is not known here", word(0)))?;
    check_shape(size, word(4), layers, faces, levels)?;
    if word(1) != format.channel_bytes() {
        return Err(format!("type size {} does not go with its format", word(1)));
    }
    if word(8) != 0 || bytes[64..80].iter().any(|b| *b != 0) {
        return Err("it is supercompressed".into());
    }
    // At most 15 levels, as checked above.
    let index_end = HEADER_BYTES + LEVEL_BYTES * levels as usize;
    let descriptor = section(bytes, word(9), word(10), index_end, "data format descriptor")?;
    if bytes[descriptor.clone()] != format.descriptor() {
        return Err("its data format descriptor does not go with its format".into());
    }
    let key_values = match (word(11), word(12)) {
        (0, 0) => descriptor.end..descriptor.end,
        (start, length) => section(bytes, start, length, descriptor.end, "key/value data")?,
    };
    let mut texture = Ktx2 { format, size, layers, faces, levels: Vec::new(), key_values: BTreeMap::new() };
    texture.key_values = parse_key_values(&bytes[key_values.clone()])?;
    texture.levels = parse_levels(bytes, &texture, levels, key_values.end)?;
    Ok(texture)
}

fn check_shape(size: [u32; 2], depth: u32, layers: u32, faces: u32, levels: u32) -> Parsed<()> {
    let [width, height] = size;
    if depth != 0 || size.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
        return Err(format!(
            "{width} x {height} x {depth} texels; 1 x 1 x 0 to {MAX_SIDE} x {MAX_SIDE} x 0 can be read"
        ));
    }
    if !(faces == 1 || (faces == 6 && width == height)) {
        return Err(format!("{faces} face(s) of {width} x {height}"));
    }
    if layers > MAX_LAYERS {
        return Err(format!("{layers} layers; {MAX_LAYERS} can be read"));
    }
    let most = 32 - width.max(height).leading_zeros();
    if !(1..=most).contains(&levels) {
        return Err(format!("{levels} levels of {width} x {height} texels; 1 to {most} can be"));
    }
    Ok(())
}

/// A stretch of the file that must begin where the one before ended.
fn section(bytes: &[u8], start: u32, length: u32, expected: usize, what: &str) -> Parsed<Range<usize>> {
    let (start, length) = (start as usize, length as usize);
    let end = start.checked_add(length).filter(|end| *end <= bytes.len());
    match end {
        Some(end) if start == expected => Ok(start..end),
        _ => Err(format!("its {what} ({length} bytes at {start}) lies where it cannot")),
    }
}

fn parse_key_values(mut rest: &[u8]) -> Parsed<BTreeMap<String, Vec<u8>>> {
    let cut_off = || String::from("its key/value data are cut off");
    if rest.len() > MAX_KEY_VALUES {
        return Err(format!("{} bytes of key/value data; {MAX_KEY_VALUES} can be read", rest.len()));
    }
    let mut all = BTreeMap::new();
    while !rest.is_empty() {
        if rest.len() < 4 {
            return Err(cut_off());
        }
        let length = word_at(rest, 0) as usize;
        let pair = rest[4..].get(..length).ok_or_else(cut_off)?;
        rest = rest[4 + length..].get(length.next_multiple_of(4) - length..).ok_or_else(cut_off)?;
        let nul = pair.iter().position(|b| *b == 0).ok_or("a key has no end")?;
        let key = std::str::from_utf8(&pair[..nul]).map_err(|_| "a key is not UTF-8")?;
        if key.is_empty() || all.insert(key.to_owned(), pair[nul + 1..].to_vec()).is_some() {
            return Err(format!("key `{key}` is there twice, or is empty"));
        }
    }
    Ok(all)
}

/// The levels lie one after another, aligned, the smallest first, after `from`.
fn parse_levels(bytes: &[u8], texture: &Ktx2, count: u32, from: usize) -> Parsed<Vec<Vec<u8>>> {
    let mut places = Vec::new();
    let mut end = from as u64;
    for level in (0..count).rev() {
        let at = HEADER_BYTES + LEVEL_BYTES * level as usize;
        let [start, length, whole] = [0, 8, 16].map(|i| long_at(bytes, at + i));
        let Ktx2 { format, size, layers, faces, .. } = *texture;
        let expected = level_bytes(format, size, layers, faces, level);
        if length != expected || whole != expected {
            return Err(format!("level {level} has {length} bytes and should have {expected}"));
        }
        let next = start.saturating_add(length);
        if start != end.next_multiple_of(u64::from(format.bytes())) || next > bytes.len() as u64 {
            return Err(format!("level {level} ({length} bytes at {start}) lies where it cannot"));
        }
        // Both are within the file.
        places.push(start as usize..next as usize);
        end = next;
    }
    if end != bytes.len() as u64 {
        return Err(format!("{} bytes follow its last level", bytes.len() as u64 - end));
    }
    // Only now is memory taken, and no more than the file has.
    Ok(places.into_iter().rev().map(|place| bytes[place].to_vec()).collect())
}

/// The caller has checked that it is there.
fn word_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn long_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(word_at(bytes, at)) | (u64::from(word_at(bytes, at + 4)) << 32)
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
    fn no_bent_byte_is_a_panic_and_none_of_the_structure_goes_unseen() {
        let whole = file();
        let texels_at = whole.len() - cube().levels.iter().map(Vec::len).sum::<usize>();
        for at in 0..texels_at {
            for flip in [0x01, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                // What stays readable must differ, but for padding.
                if let Ok(read) = Ktx2::from_bytes(Path::new("a"), &bytes)
                    && at < HEADER_BYTES + 3 * LEVEL_BYTES + 92
                {
                    panic!("byte {at} of header, index or descriptor went unseen: {:?}", read.key_values);
                }
            }
        }
    }

    #[test]
    fn what_is_not_ours_is_told() {
        assert!(problem(b"\xabKTX 11\xbb\r\n\x1a\n").contains("does not begin"));
        for (at, value, part) in [
            (12, 1, "format 1 "),
            (16, 4, "type size"),
            (20, 0, "0 x 4"),
            (20, u32::MAX, "can be read"),
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
    fn a_giant_costs_nothing() {
        let mut bytes = with_word(20, 16384);
        bytes[24..28].copy_from_slice(&16384u32.to_le_bytes());
        assert!(problem(&bytes).contains("level 2"));
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
