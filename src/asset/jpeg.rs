//! Truncated JPEG files: the `image` crate's decoder fills the missing part with grey without an error.

/// Whether a JPEG file has its end marker; true for files that are no JPEG.
pub fn is_whole(bytes: &[u8]) -> bool {
    !bytes.starts_with(&[0xff, 0xd8]) || find_end(bytes).is_some()
}

/// Position of the end marker. Segments are skipped by their lengths: an embedded thumbnail has an end marker, too.
fn find_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    loop {
        // After a segment comes a marker, or a scan's data, in which 0xff is followed by 0 or by restarts (0xd0 to
        // 0xd7).
        at += bytes.get(at..)?.iter().position(|byte| *byte == 0xff)?;
        match bytes.get(at + 1)? {
            0xd9 => return Some(at),
            0xff => at += 1,
            0x00 | 0x01 | 0xd0..=0xd8 => at += 2,
            _ => at += 2 + usize::from(u16::from_be_bytes(*bytes.get(at + 2..)?.first_chunk()?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cut_is_seen_and_an_end_within_a_segment_is_none() {
        let with_thumbnail = [0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9];
        let scan = [0xff, 0xda, 0, 3, 0, 1, 0xff, 0, 2, 0xff, 0xd0, 3];
        let whole = [&[0xff, 0xd8][..], &with_thumbnail, &scan, &[0xff, 0xff, 0xd9]].concat();
        assert!(is_whole(&whole) && is_whole(&[&whole[..], b"more"].concat()));
        for length in 2..whole.len() {
            assert!(!is_whole(&whole[..length]), "{length}");
        }
        assert!(is_whole(b"GIF89a") && is_whole(b""));
    }
}
