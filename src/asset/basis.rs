//! Pictures in KTX 2.0 files as glTF's `KHR_texture_basisu` has them: Basis Universal, ETC1S or UASTC. The `basisu`
//! crate decodes them; what it would allocate is checked here before.

use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use ktx2::{Header, LevelIndex, MAGIC, SupercompressionScheme};

/// Bytes of one block of 4×4 texels in UASTC.
const UASTC_BLOCK_BYTES: u64 = 16;

/// A file whose header is read.
pub struct BasisPicture<'a> {
    bytes: &'a [u8],
    /// Texels of level 0: width and height.
    pub size: [u32; 2],
}

impl<'a> BasisPicture<'a> {
    /// Whether these are the bytes of a KTX 2.0 file.
    pub fn is_it(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    /// Reads the header. Panics of the library are the caller's.
    ///
    /// # Errors
    /// The file is broken, or holds no single picture of at most the bytes that its size needs; the problem in words.
    pub fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let header = bytes.first_chunk().ok_or("it ends too early")?;
        let header = Header::from_bytes(header).map_err(|error| format!("its header is broken: {error}"))?;
        if let Some(format) = header.format {
            return Err(format!("it is a KTX2 file of format {}, not of Basis Universal", format.value()));
        }
        let Header { pixel_width: width, pixel_height: height, pixel_depth: depth, .. } = header;
        if (depth, header.face_count) != (0, 1) || header.layer_count > 1 {
            return Err("it is a volume, a cube map or an array".into());
        }
        let level = bytes.get(Header::LENGTH..).and_then(<[u8]>::first_chunk).ok_or("it ends too early")?;
        let whole = LevelIndex::from_bytes(level).uncompressed_byte_length;
        let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
        let needed = blocks.saturating_mul(UASTC_BLOCK_BYTES);
        // The library allocates what is said here.
        if header.supercompression_scheme == Some(SupercompressionScheme::Zstandard) && whole != needed {
            return Err(format!("its largest level has {whole} bytes and should have {needed}"));
        }
        Ok(Self { bytes, size: [width, height] })
    }

    /// Decodes level 0: RGBA, a byte each, rows from the top. Panics of the library are the caller's.
    ///
    /// # Errors
    /// The file is broken or of another kind; the problem in words.
    pub fn decode(&self) -> Result<Vec<u8>, String> {
        let picture = Transcoder::new(self.bytes).map_err(|_| "it is no whole file of Basis Universal")?;
        if !matches!(picture.source_format(), SourceFormat::Etc1s | SourceFormat::UastcLdr) || picture.is_video() {
            return Err("it is neither an ETC1S nor a UASTC picture".into());
        }
        let texels = picture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE);
        texels.map_err(|_| "its texels are broken".into())
    }
}

#[cfg(test)]
pub mod tests {
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;

    use super::*;
    use crate::asset::contained::contained;

    /// Each of 12×8 texels of red 20·x, green 30·y, blue 64, and alpha 255, or 40 from the ninth column on. By Binomial's
    /// encoder: ETC1S, ETC1S with alpha, UASTC with alpha and supercompressed by Zstandard.
    const FILES: [&str; 3] = [
        "q0tUWCAyMLsNChoKAAAAAAEAAAAMAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAAAAAAkwAAAAAA\
         AABLAQAAAAAAAAMAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQEAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA/////x8AAABLVFh3\
         cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuNTAAAAYAAwAyAAAADQAAACwAAAAAAAAAAAAAAAAAAAADAAAAAAAAAAAAAAAPwBQAAAAAQBDE\
         rWEGEAVAAAAAEOStHaEDMBEAAAAAAIAUEAAmAAAAAAAAENx1BGJQAASiTPcHoizXB4Is1wcAwUQAAAAAAADyX00AmAAAAAAAAEAoASIG\
         DAAAAEJWTiEAmAAAAAAAAEAAAbxuCQ==",
        "q0tUWCAyMLsNChoKAAAAAAEAAAAMAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAApgAAAAAA\
         AABuAQAAAAAAAAgAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQEAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAA\
         AAAAAP////8fAAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjUwAAAIAAUANwAAABUAAAAyAAAAAAAAAAAAAAAAAAAABAAAAAQA\
         AAAEAAAAGMAUAAAAACAA1GW4MoAoAAMAAECwV1QzDsAMAAAAAAAQhC0jAFMAAAAAAEEQdbTuCuERMCo/AKyqqqoCoizXB4Is1weiTPdX\
         VVVVBQDBRAAAAAAAEASxP9soHQBTAAAAAAAgkA4U4G0DAQAAkfshFCoBAcAEAAAAAAAAAggAWmbEKf0eRAA=",
        "q0tUWCAyMLsNChoKAAAAAAEAAAAMAAAACAAAAAAAAAAAAAAAAQAAAAEAAAACAAAAaAAAACwAAACUAAAAJAAAAAAAAAAAAAAAAAAAAAAA\
         AAC4AAAAAAAAAFMAAAAAAAAAYAAAAAAAAAAsAAAAAAAAAAIAKACmAQEAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3\
         cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuNTAAACi1L/0gYFUCAMQDm5LWIwAcsBASMlR2mLrc/puSkyJAOyjpKId1gSISEduSxoMAnF8Q\
         QshR2WLqc/vbkoOCQLso6UiIdXkhBABTFQPsBvIx22wC",
    ];

    /// Whole files of all kinds.
    pub fn files() -> [Vec<u8>; 3] {
        FILES.map(|file| STANDARD.decode(file).unwrap())
    }

    /// What a file without its first bytes, or with others there, is.
    fn problem(bytes: &[u8]) -> String {
        contained(|| BasisPicture::open(bytes).and_then(|picture| picture.decode()))
            .and_then(|texels| texels)
            .unwrap_err()
    }

    #[test]
    fn the_encoder_s_pictures_are_as_they_were() {
        // ETC1S has one colour and steps of grey for 4×4 texels.
        for (file, [colour_error, alpha]) in files().iter().zip([[50, 255], [50, 40], [3, 40]]) {
            assert!(BasisPicture::is_it(file));
            let picture = BasisPicture::open(file).unwrap();
            assert_eq!(picture.size, [12, 8]);
            let texels = picture.decode().unwrap();
            assert_eq!(texels.len(), 12 * 8 * 4);
            let mut sums = [[0; 3]; 2];
            for (i, texel) in texels.as_chunks::<4>().0.iter().enumerate() {
                let [x, y] = [i % 12, i / 12];
                let wanted = [20 * x as u8, 30 * y as u8, 64];
                (0..3).for_each(|k| {
                    sums[0][k] += u32::from(texel[k]);
                    sums[1][k] += u32::from(wanted[k]);
                });
                let error = (0..3).map(|k| texel[k].abs_diff(wanted[k])).max().unwrap();
                assert!(error <= colour_error, "{x} {y}: {texel:?}, not {wanted:?}");
                assert!(texel[3].abs_diff(if x < 8 { 255 } else { alpha }) <= 2, "{x} {y}: {texel:?}");
            }
            assert!((0..3).all(|k| sums[0][k].abs_diff(sums[1][k]) < 12 * 8 * 2), "{sums:?}");
        }
    }

    #[test]
    fn what_is_cut_off_or_of_another_kind_is_a_problem() {
        for file in files() {
            for length in 0..file.len() {
                problem(&file[..length]);
            }
            let with = |at: usize, value: u32| {
                let mut bytes = file.clone();
                bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
                problem(&bytes)
            };
            assert!(with(12, 37).contains("format 37"));
            assert!(with(28, 2).contains("volume"));
            assert!(with(32, 5).contains("array"));
        }
        let mut huge = files()[2].clone();
        huge[80 + 16..80 + 24].fill(0x7f);
        assert!(problem(&huge).contains("should have 96"));
    }
}
