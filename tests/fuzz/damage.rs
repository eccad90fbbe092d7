//! Damage done to files: to any bytes, and to the lines of a text.

/// Numbers that look random and are the same in every run (Steele et al., "Fast Splittable Pseudorandom Number
/// Generators", 2014).
pub struct Random(u64);

impl Random {
    /// Numbers of their own for each list of parts.
    pub fn of(parts: [u64; 3]) -> Self {
        let mut random = Self(0x2545_f491_4f6c_dd1d);
        for part in parts {
            random.0 ^= part.wrapping_mul(0xd6e8_feb8_6659_fd93);
            random.next();
        }
        random
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `end`; 0 where that is 0.
    pub fn below(&mut self, end: usize) -> usize {
        if end == 0 { 0 } else { (self.next() % end as u64) as usize }
    }

    /// Once in `times`.
    pub fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }

    pub fn of_list<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

/// Values at the ends of ranges, and near them.
const WORDS: [u64; 24] = [
    0,
    1,
    2,
    3,
    4,
    7,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x00ff_ffff,
    0x7f80_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX - 1,
    u64::MAX,
];

/// The longest text, in bytes, that is made of one word.
pub const MOST_REPEATED: usize = 20_000;

/// What stands in texts where numbers are expected.
pub const NUMBERS: [&str; 34] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "3",
    "7",
    "0.5",
    "1e38",
    "-1e39",
    "1e309",
    "-1e-46",
    "1e-300",
    "nan",
    "inf",
    "-inf",
    "255",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483648",
    "-2147483649",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "99999999999999999999999999999999999999",
    "0.000000000000000000000000000000000000000000000000000001",
    "+5",
    "1e",
    "0x10",
    "1_0",
];

/// Puts an odd word of one to eight bytes, in either order, or one near the old one, at a place.
pub fn put_word(random: &mut Random, bytes: &mut [u8], at: usize) {
    let length = random.of_list(&[1, 2, 4, 4, 8]).min(bytes.len().saturating_sub(at));
    let Some(place) = bytes.get_mut(at..at + length).filter(|place| !place.is_empty()) else { return };
    let little = random.once_in(2);
    let mut word = [0; 8];
    word[..length].copy_from_slice(place);
    if !little {
        word[..length].reverse();
    }
    let old = u64::from_le_bytes(word);
    let new = match random.below(4) {
        0 => old.wrapping_add(random.below(17) as u64).wrapping_sub(8),
        1 => old ^ (1 << random.below(8 * length)),
        _ => random.of_list(&WORDS),
    };
    place.copy_from_slice(&new.to_le_bytes()[..length]);
    if !little {
        place.reverse();
    }
}

/// Damages any bytes in one way; `other` is a file of the same kind.
pub fn bytes(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let at = random.below(bytes.len());
    let length = random.length(bytes.len() - at);
    let end = (at + length).min(bytes.len());
    match random.below(9) {
        0 | 1 => put_word(random, bytes, at),
        2 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = random.next() as u8),
        3 => bytes.truncate(at),
        4 => drop(bytes.drain(at..end)),
        5 => {
            let copy = bytes[at..end].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, copy);
        }
        6 => {
            let from = random.below(other.len());
            let copy: Vec<u8> = other[from..].iter().take(length).copied().collect();
            bytes.splice(at..end, copy);
        }
        7 => {
            let value = random.of_list(&[0, 0xff, b' ', b'\n', 0x80]);
            bytes[at..end].fill(value);
        }
        _ => bytes.iter_mut().skip(at).take(length).for_each(|byte| *byte = random.next() as u8),
    }
}

impl Random {
    /// Of 1 to so many bytes, mostly few and seldom all.
    fn length(&mut self, most: usize) -> usize {
        let limit = self.of_list(&[4, 16, 64, usize::MAX]);
        1 + self.below(most.min(limit))
    }
}

/// Damages one line of a text, or the order of its lines; `words` belong to the format.
pub fn lines(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8], words: &[&str]) {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let mut lines: Vec<String> = text.split_inclusive('\n').map(str::to_owned).collect();
    if lines.is_empty() {
        lines.push(String::new());
    }
    let at = random.below(lines.len());
    match random.below(12) {
        0 => drop(lines.remove(at)),
        1 => {
            let copies = random.of_list(&[1, 2, 300]);
            let line = lines[at].clone();
            lines.splice(at..at, std::iter::repeat_n(line, copies));
        }
        2 => {
            let to = random.below(lines.len());
            lines.swap(at, to);
        }
        3 => {
            let other = String::from_utf8_lossy(other);
            let others: Vec<&str> = other.split_inclusive('\n').collect();
            let line = if others.is_empty() { "" } else { random.of_list(&others) };
            lines.insert(at, line.to_owned());
        }
        4 => lines[at] = lines[at].trim_end().to_owned() + random.of_list(&["", " ", "\\", "\\\n", "\r", " #"]),
        _ => lines[at] = changed_line(random, &lines[at], words),
    }
    *bytes = lines.concat().into_bytes();
}

/// A line with a word less, more, or another one.
fn changed_line(random: &mut Random, line: &str, words: &[&str]) -> String {
    let is_part = |c: char| c.is_alphanumeric() || "._+-".contains(c);
    let mut parts: Vec<String> = Vec::new();
    let mut in_word = false;
    for c in line.chars() {
        match parts.last_mut().filter(|_| in_word && is_part(c)) {
            Some(word) => word.push(c),
            None => parts.push(c.to_string()),
        }
        in_word = is_part(c);
    }
    let at = random.below(parts.len());
    let new = match random.below(5) {
        0 | 1 => random.of_list(&NUMBERS).to_owned(),
        2 if !words.is_empty() => random.of_list(words).to_owned(),
        3 if !parts.is_empty() => parts[random.below(parts.len())].clone(),
        _ => random
            .of_list(&["", " ", "/", "//", "\"", "'", "[", "]", "{", "=", "\\", "\t", "\0", "é", "\u{feff}"])
            .into(),
    };
    match random.below(4) {
        0 if !parts.is_empty() => drop(parts.remove(at)),
        1 => parts.insert(at, format!(" {new} ")),
        2 => parts.insert(at, new.repeat(random.of_list(&[1, 3, MOST_REPEATED / new.len().max(1)]))),
        _ if !parts.is_empty() => parts[at] = new,
        _ => parts.push(new),
    }
    parts.concat()
}
