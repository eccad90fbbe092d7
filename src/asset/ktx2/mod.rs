//! KTX 2.0 textures in memory: flat pictures and cube maps of floats, with mips. Written and read here, uncompressed.
//!
//! Facts are those of the "KTX File Format Specification", version 2.0 (Khronos, 2022), and of the "Khronos Data Format
//! Specification", version 1.3 (2019).

mod read;
mod write;

use std::collections::BTreeMap;

/// What a file begins with.
const IDENTIFIER: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";
/// Identifier, header and index, in bytes; the level index follows.
const HEADER_BYTES: usize = 80;
/// One entry of the level index: offset, length, length before compression, as u64.
const LEVEL_BYTES: usize = 24;
/// The key that names the program that wrote a file; the writer sets it.
pub const WRITER_KEY: &str = "KTXwriter";
/// The key that says where x and y point; the writer sets it.
pub const ORIENTATION_KEY: &str = "KTXorientation";

/// How a texel is stored; linear, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// R, G: f16.
    Rg16Float,
    /// R, G, B, A: f16.
    Rgba16Float,
    /// R, G: f32.
    Rg32Float,
    /// R, G, B, A: f32.
    Rgba32Float,
}

impl TexelFormat {
    const ALL: [Self; 4] = [Self::Rg16Float, Self::Rgba16Float, Self::Rg32Float, Self::Rgba32Float];

    /// Its number among Vulkan's formats.
    pub fn vulkan(self) -> u32 {
        match self {
            Self::Rg16Float => 83,
            Self::Rgba16Float => 97,
            Self::Rg32Float => 103,
            Self::Rgba32Float => 109,
        }
    }

    /// Its name among Vulkan's formats.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rg16Float => "R16G16_SFLOAT",
            Self::Rgba16Float => "R16G16B16A16_SFLOAT",
            Self::Rg32Float => "R32G32_SFLOAT",
            Self::Rgba32Float => "R32G32B32A32_SFLOAT",
        }
    }

    /// The format with this number among Vulkan's, if it is one of ours.
    pub fn from_vulkan(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.vulkan() == number)
    }

    /// Bytes of one number.
    fn channel_bytes(self) -> u32 {
        match self {
            Self::Rg16Float | Self::Rgba16Float => 2,
            Self::Rg32Float | Self::Rgba32Float => 4,
        }
    }

    fn channels(self) -> u32 {
        match self {
            Self::Rg16Float | Self::Rg32Float => 2,
            Self::Rgba16Float | Self::Rgba32Float => 4,
        }
    }

    /// Bytes of one texel: a power of two of at least 4, so it is also what levels are aligned to.
    pub fn bytes(self) -> u32 {
        self.channel_bytes() * self.channels()
    }

    /// The basic data format descriptor with its length before it: KTX 2.0, section 3.10; Data Format 1.3, chapter 5.
    fn descriptor(self) -> Vec<u8> {
        // Channel numbers of the model RGBSDA; alpha is 15.
        let ids = &[0u32, 1, 2, 15][..self.channels() as usize];
        let block = 24 + 16 * self.channels();
        // Model RGBSDA with BT.709 primaries, linear, alpha not premultiplied; one texel per block, in one plane.
        let mut words = vec![4 + block, 0, 2 | (block << 16), 1 | (1 << 8) | (1 << 16), 0, self.bytes(), 0];
        let bits = 8 * self.channel_bytes();
        for (i, id) in (0u32..).zip(ids) {
            // Signed floats, where −1 and 1 are themselves.
            let kind = id | 0x80 | 0x40;
            words.extend([(i * bits) | ((bits - 1) << 16) | (kind << 24), 0, (-1f32).to_bits(), 1f32.to_bits()]);
        }
        words.into_iter().flat_map(u32::to_le_bytes).collect()
    }
}

/// A texture in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Ktx2 {
    pub format: TexelFormat,
    /// Texels of level 0, width and height; a cube's faces are square.
    pub size: [u32; 2],
    /// Elements of an array; 0 if it is none.
    pub layers: u32,
    /// 6 for a cube, in the order +X −X +Y −Y +Z −Z, else 1.
    pub faces: u32,
    /// Level 0 first. Each holds layer after layer, face after face, rows from the top, tightly packed.
    pub levels: Vec<Vec<u8>>,
    /// What is said about it, by key. Text ends with a NUL. Writer and orientation are added when it is written.
    pub key_values: BTreeMap<String, Vec<u8>>,
}

impl Ktx2 {
    /// Bytes of one level, as its header demands.
    pub fn level_bytes(&self, level: u32) -> u64 {
        level_bytes(self.format, self.size, self.layers, self.faces, level)
    }

    /// Says something in words.
    pub fn set_text(&mut self, key: &str, value: &str) {
        self.key_values.insert(key.to_owned(), [value.as_bytes(), b"\0"].concat());
    }

    /// What a key says in words.
    pub fn text(&self, key: &str) -> Option<&str> {
        let value = self.key_values.get(key)?;
        std::str::from_utf8(value.strip_suffix(b"\0").unwrap_or(value)).ok()
    }
}

/// Saturates: no file is that long.
fn level_bytes(format: TexelFormat, size: [u32; 2], layers: u32, faces: u32, level: u32) -> u64 {
    let side = |i: usize| u64::from(size[i].checked_shr(level).unwrap_or(0).max(1));
    [side(1), u64::from(layers.max(1)), u64::from(faces), u64::from(format.bytes())]
        .into_iter()
        .fold(side(0), u64::saturating_mul)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_levels() {
        assert_eq!(level_bytes(TexelFormat::Rgba16Float, [256, 256], 0, 6, 0), 256 * 256 * 6 * 8);
        assert_eq!(level_bytes(TexelFormat::Rgba32Float, [256, 4], 2, 1, 3), 32 * 2 * 16);
        assert_eq!(level_bytes(TexelFormat::Rgba32Float, [u32::MAX; 2], u32::MAX, 6, 0), u64::MAX);
        assert_eq!(level_bytes(TexelFormat::Rg32Float, [1; 2], 0, 1, 40), 8);
    }

    #[test]
    fn formats_have_vulkan_numbers() {
        for format in TexelFormat::ALL {
            assert_eq!(TexelFormat::from_vulkan(format.vulkan()), Some(format));
            assert!(format.bytes().is_power_of_two() && format.bytes() >= 4);
        }
        assert_eq!(TexelFormat::from_vulkan(37), None);
    }

    #[test]
    fn the_half_float_descriptor_is_what_the_standard_says() {
        let descriptor = TexelFormat::Rgba16Float.descriptor();
        assert_eq!(descriptor.len(), 4 + 24 + 4 * 16);
        let head = [92, 0, 0, 0, 0, 0, 0, 0, 2, 0, 88, 0, 1, 1, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(descriptor[..28], head);
        // Alpha: at bit 48, 16 bits, channel 15, signed float, from −1 to 1.
        assert_eq!(descriptor[76..], [48, 0, 15, 0xcf, 0, 0, 0, 0, 0, 0, 0x80, 0xbf, 0, 0, 0x80, 0x3f]);
    }
}
