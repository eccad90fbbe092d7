//! Damage that keeps enough of a format for readers to go on: JSON, and files made of chunks, segments or attributes.

use serde_json::{Map, Value, json};

use super::damage::{self, MOST_REPEATED, NUMBERS, Random};

/// Bytes that damage may add to a file: copies of copies would be hundreds of megabytes.
const MOST_MORE: usize = 1 << 20;

/// What a format is made of.
#[derive(Clone, Copy)]
pub enum Format {
    /// Lines, with words that mean something.
    Lines(&'static [&'static str]),
    Json,
    Glb,
    Png,
    Jpeg,
    Exr,
    /// Lines, and bytes behind an empty one.
    Hdr,
    /// A head of so many bytes, in which every one counts.
    Head(usize),
}

impl Format {
    /// A seed with one to five damages.
    pub fn damaged(self, random: &mut Random, seed: &[u8], other: &[u8]) -> Vec<u8> {
        let mut bytes = seed.to_vec();
        let times = 1 + random.below(3) + random.below(3);
        for _ in 0..times {
            if random.once_in(4) {
                damage::bytes(random, &mut bytes, other)
            } else {
                self.damage(random, &mut bytes, other)
            }
            bytes.truncate(seed.len() + MOST_MORE);
        }
        bytes
    }

    fn damage(self, random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
        match self {
            Self::Lines(words) => damage::lines(random, bytes, other, words),
            Self::Json => json_text(random, bytes),
            Self::Glb => glb(random, bytes, other),
            Self::Png => png(random, bytes, other),
            Self::Jpeg => jpeg(random, bytes, other),
            Self::Exr => exr(random, bytes, other),
            Self::Hdr => hdr(random, bytes, other),
            Self::Head(length) => {
                let at = random.below(length.min(bytes.len()));
                damage::put_word(random, bytes, at);
            }
        }
    }
}

fn json_text(random: &mut Random, bytes: &mut Vec<u8>) {
    match serde_json::from_slice::<Value>(bytes) {
        Ok(mut value) => {
            change_json(random, &mut value);
            *bytes = value.to_string().into_bytes();
        }
        Err(_) => damage::lines(random, bytes, &[], &["null", "{", "}", "[", "]", ":", ","]),
    }
}

/// Calls `visit` with every value inside of a value, itself included, until it returns true.
fn walk(value: &mut Value, visit: &mut dyn FnMut(&mut Value) -> bool) -> bool {
    visit(value)
        || match value {
            Value::Array(list) => list.iter_mut().any(|value| walk(value, visit)),
            Value::Object(map) => map.values_mut().any(|value| walk(value, visit)),
            _ => false,
        }
}

fn change_json(random: &mut Random, document: &mut Value) {
    let mut count = 0;
    walk(document, &mut |_| {
        count += 1;
        false
    });
    let nth = |document: &mut Value, number: usize| {
        let (mut left, mut found) = (number, Value::Null);
        walk(document, &mut |value| {
            if left == 0 {
                found = value.clone();
            }
            left = left.wrapping_sub(1);
            left == usize::MAX
        });
        found
    };
    let another = nth(document, random.below(count));
    let mut left = random.below(count);
    walk(document, &mut |value| {
        if left == 0 {
            change_value(random, value, &another);
        }
        left = left.wrapping_sub(1);
        left == usize::MAX
    });
}

fn change_value(random: &mut Random, value: &mut Value, another: &Value) {
    if random.once_in(8) {
        *value = another.clone();
        return;
    }
    match value {
        Value::Number(number) => {
            let near = number.as_i64().map(|n| n.wrapping_add(random.below(5) as i64 - 2));
            *value = match (random.below(4), near) {
                (0, Some(near)) => json!(near),
                (1, _) => json!(random.next() >> (24 + random.below(40))),
                // What is no number in JSON becomes text.
                _ => {
                    let text = random.of_list(&NUMBERS);
                    serde_json::from_str(text).unwrap_or_else(|_| json!(text))
                }
            };
        }
        Value::String(text) => {
            let others =
                ["", "VEC4", "SCALAR", "MAT4", "data:,", "data:;base64,AAAA", "../a", "\n", "MASK", "BLEND", "spot"];
            *text = match random.below(3) {
                0 => text.repeat(random.of_list(&[1, MOST_REPEATED / text.len().max(1)])),
                1 => text.chars().take(random.below(text.len())).collect(),
                _ => random.of_list(&others).to_owned(),
            };
        }
        Value::Array(list) => match random.below(4) {
            0 => drop(list.pop()),
            1 => list.clear(),
            2 => list.push(another.clone()),
            _ => {
                let copies = random.of_list(&[1, 100]);
                list.extend(std::iter::repeat_n(list.last().cloned().unwrap_or(Value::Null), copies));
            }
        },
        Value::Object(map) => change_object(random, map, another),
        Value::Bool(on) => *on = !*on,
        Value::Null => *value = another.clone(),
    }
}

fn change_object(random: &mut Random, map: &mut Map<String, Value>, another: &Value) {
    let keys: Vec<String> = map.keys().cloned().collect();
    let added = another.as_object().and_then(|other| {
        let entries: Vec<_> = other.iter().collect();
        (!entries.is_empty()).then(|| entries[random.below(entries.len())])
    });
    match added.filter(|_| random.once_in(2)) {
        Some((key, value)) => drop(map.insert(key.clone(), value.clone())),
        None if keys.is_empty() => drop(map.insert("sparse".into(), another.clone())),
        None => {
            let key = &keys[random.below(keys.len())];
            let old = map.remove(key);
            if random.once_in(3) {
                let to = &keys[random.below(keys.len())];
                map.insert(to.clone(), old.unwrap_or(Value::Null));
            }
        }
    }
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(|word| u32::from_le_bytes(word) as usize)
}

/// Changes the JSON of a binary file and mends the lengths, or else the first words.
fn glb(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let json = word(bytes, 12).and_then(|length| Some((length, bytes.get(20..20 + length)?.to_vec())));
    let Some((length, mut json)) = json.filter(|_| !random.once_in(6)) else {
        let at = random.below(bytes.len().min(28));
        return damage::put_word(random, bytes, at);
    };
    if random.once_in(8) {
        damage::bytes(random, &mut json, other)
    } else {
        json_text(random, &mut json)
    }
    json.resize(json.len().next_multiple_of(4), b' ');
    let new = json.len() as u32;
    bytes.splice(20..20 + length, json);
    bytes[12..16].copy_from_slice(&new.to_le_bytes());
    let whole = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&whole.to_le_bytes());
}

/// The types and contents of a PNG's chunks, without their lengths and checksums.
pub fn png_chunks(bytes: &[u8]) -> Vec<([u8; 4], Vec<u8>)> {
    let (mut chunks, mut rest) = (Vec::new(), bytes.get(8..).unwrap_or_default());
    while let Some((head, behind)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(content) = behind.get(..length) else { break };
        chunks.push(([head[4], head[5], head[6], head[7]], content.to_vec()));
        rest = behind.get(length + 4..).unwrap_or_default();
    }
    chunks
}

/// A PNG of chunks, with the lengths and checksums (ISO 3309, polynomial 0xedb88320) that they need.
pub fn png_of(chunks: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let bit = |c: u32, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, content) in chunks {
        let checked = [&kind[..], content].concat();
        let sum = !checked.iter().fold(!0u32, |c, b| (0..8).fold(c ^ u32::from(*b), bit));
        bytes.extend((content.len() as u32).to_be_bytes());
        bytes.extend(checked);
        bytes.extend(sum.to_be_bytes());
    }
    bytes
}

fn png(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    const KINDS: [&[u8; 4]; 16] = [
        b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"tEXt", b"zTXt", b"iTXt",
        b"pHYs", b"acTL", b"fcTL", b"fdAT",
    ];
    let mut chunks = png_chunks(bytes);
    if chunks.is_empty() {
        return damage::bytes(random, bytes, other);
    }
    let at = random.below(chunks.len());
    match random.below(10) {
        0 => drop(chunks.remove(at)),
        1 => chunks.insert(at, chunks[at].clone()),
        2 => {
            let to = random.below(chunks.len());
            chunks.swap(at, to);
        }
        3 => chunks[at].0 = *random.of_list(&KINDS),
        4 => {
            let content = (0..random.below(40)).map(|_| random.next() as u8).collect();
            chunks.insert(at, (*random.of_list(&KINDS), content));
        }
        // The first one holds sizes, depth, colour type and interlacing.
        5 | 6 => {
            let place = random.below(chunks[0].1.len());
            damage::put_word(random, &mut chunks[0].1, place);
        }
        7 if chunks[0].1.len() > 12 => {
            let (depths, kinds) = ([1, 2, 4, 8, 16], [0, 2, 3, 4, 6]);
            chunks[0].1[8] = random.of_list(&depths);
            chunks[0].1[9] = random.of_list(&kinds);
            chunks[0].1[12] = random.below(2) as u8;
        }
        _ => damage::bytes(random, &mut chunks[at].1, other),
    }
    *bytes = png_of(&chunks);
}

/// Changes a segment of a JPEG, or what is behind the last one.
fn jpeg(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let (mut segments, mut at) = (Vec::new(), 2);
    while let Some(&[0xff, kind, high, low]) = bytes.get(at..at + 4) {
        let end = at + 2 + usize::from(u16::from_be_bytes([high, low]));
        if end > bytes.len() {
            break;
        }
        segments.push(at..end);
        at = end;
        if kind == 0xda {
            break;
        }
    }
    let Some(segment) = (!segments.is_empty()).then(|| segments[random.below(segments.len())].clone()) else {
        return damage::bytes(random, bytes, other);
    };
    match random.below(8) {
        // Kinds of frames and of tables.
        0 => {
            bytes[segment.start + 1] =
                random.of_list(&[0xc0, 0xc1, 0xc2, 0xc3, 0xc4, 0xc9, 0xca, 0xda, 0xdb, 0xdd, 0xee, 0xfe])
        }
        1 => drop(bytes.drain(segment)),
        2 => {
            let copy = bytes[segment.clone()].to_vec();
            let to = segments[random.below(segments.len())].start;
            bytes.splice(to..to, copy);
        }
        3 => damage::put_word(random, bytes, segment.start + 2),
        4 => {
            let place = at + random.below(bytes.len().saturating_sub(at));
            damage::put_word(random, bytes, place);
        }
        5 => {
            let marker = [0xff, 0xd0 + random.below(10) as u8];
            let place = at + random.below(bytes.len().saturating_sub(at));
            bytes.splice(place..place, marker);
        }
        _ => {
            let place = segment.start + 4 + random.below(segment.len().saturating_sub(4));
            damage::put_word(random, bytes, place);
        }
    }
}

/// Changes an attribute of an EXR's first header, its flags, or what is behind its first header.
fn exr(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let text_end =
        |from: usize| bytes.get(from..).and_then(|rest| rest.iter().position(|b| *b == 0)).map(|n| from + n + 1);
    // Where name, type, size and value begin, and where the value ends.
    let (mut attributes, mut at) = (Vec::new(), 8);
    while bytes.get(at).is_some_and(|byte| *byte != 0) {
        let Some(kind) = text_end(at) else { break };
        let Some(size) = text_end(kind) else { break };
        let Some(end) = word(bytes, size).map(|length| size + 4 + length).filter(|end| *end <= bytes.len()) else {
            break;
        };
        attributes.push([at, kind, size, size + 4, end]);
        at = end;
    }
    if attributes.is_empty() || random.once_in(8) {
        let place = at + random.below(bytes.len().saturating_sub(at));
        return if random.once_in(2) {
            damage::put_word(random, bytes, place)
        } else {
            damage::bytes(random, bytes, other)
        };
    }
    let [name, kind, size, value, end] = random.of_list(&attributes);
    match random.below(10) {
        0 => drop(bytes.drain(name..end)),
        1 => {
            let copy = bytes[name..end].to_vec();
            bytes.splice(name..name, copy);
        }
        2 => damage::put_word(random, bytes, size),
        3 => {
            let other_kind =
                random.of_list(&["box2i", "chlist", "compression", "float", "int", "string", "tiledesc", "v2f", "x"]);
            bytes.splice(kind..size - 1, other_kind.bytes());
        }
        // Tiles, long names, deep data, several parts.
        4 => bytes[5] ^= 1 << random.below(6),
        5 => {
            let place = value + random.below(end - value);
            bytes[place] = random.below(12) as u8;
        }
        _ => {
            let place = value + random.below(end - value);
            damage::put_word(random, bytes, place);
        }
    }
}

fn hdr(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let head = bytes.windows(2).position(|pair| pair == b"\n\n").map_or(bytes.len(), |at| at + 2);
    let size = bytes[head..].iter().position(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let texels = bytes.split_off(head + size);
    let words = ["EXPOSURE=", "COLORCORR=", "FORMAT=", "32-bit_rle_rgbe", "-Y", "+X", "+Y", "-X", "#?"];
    if random.once_in(2) {
        damage::lines(random, bytes, other, &words);
        bytes.extend(texels);
    } else {
        let mut texels = texels;
        damage::bytes(random, &mut texels, other);
        bytes.extend(texels);
    }
}
