//! KTX 2.0 textures in memory: flat pictures and cube maps with mips, of floats, bytes or compressed blocks.
//! Written and read without supercompression.
//!
//! After the "KTX File Format Specification", version 2.0 (Khronos, 2022), and the "Khronos Data Format
//! Specification", version 1.3 (2019).

mod read;
mod write;

use std::collections::BTreeMap;

/// Key of the program that wrote a file; the writer sets it.
pub const WRITER_KEY: &str = "KTXwriter";
/// Key of the directions of x and y; the writer sets it.
pub const ORIENTATION_KEY: &str = "KTXorientation";

/// Storage of texels; numbers are little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// R, G, B, A: bytes, 0 to 1.
    Rgba8,
    /// The same, RGB sRGB-encoded.
    Rgba8Srgb,
    /// R, G: f16.
    Rg16Float,
    /// R, G, B, A: f16.
    Rgba16Float,
    /// R, G: f32.
    Rg32Float,
    /// R, G, B, A: f32.
    Rgba32Float,
    /// R, G, 0 to 1: 16 bytes for 4×4 texels.
    Bc5,
    /// R, G, B, A, 0 to 1: 16 bytes for 4×4 texels.
    Bc7,
    /// The same, RGB sRGB-encoded.
    Bc7Srgb,
}

impl TexelFormat {
    const ALL: [Self; 9] = [
        Self::Rgba8,
        Self::Rgba8Srgb,
        Self::Rg16Float,
        Self::Rgba16Float,
        Self::Rg32Float,
        Self::Rgba32Float,
        Self::Bc5,
        Self::Bc7,
        Self::Bc7Srgb,
    ];

    /// Number and name of its `VkFormat`.
    fn vulkan_entry(self) -> (u32, &'static str) {
        match self {
            Self::Rgba8 => (37, "R8G8B8A8_UNORM"),
            Self::Rgba8Srgb => (43, "R8G8B8A8_SRGB"),
            Self::Rg16Float => (83, "R16G16_SFLOAT"),
            Self::Rgba16Float => (97, "R16G16B16A16_SFLOAT"),
            Self::Rg32Float => (103, "R32G32_SFLOAT"),
            Self::Rgba32Float => (109, "R32G32B32A32_SFLOAT"),
            Self::Bc5 => (141, "BC5_UNORM_BLOCK"),
            Self::Bc7 => (145, "BC7_UNORM_BLOCK"),
            Self::Bc7Srgb => (146, "BC7_SRGB_BLOCK"),
        }
    }

    /// Number of its `VkFormat`.
    pub fn vulkan(self) -> u32 {
        self.vulkan_entry().0
    }

    /// Name of its `VkFormat`, without `VK_FORMAT_`.
    pub fn name(self) -> &'static str {
        self.vulkan_entry().1
    }

    /// The format with this `VkFormat` number, if it is supported.
    pub fn from_vulkan(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.vulkan() == number)
    }

    /// Whether it is block-compressed, in blocks of 4×4 texels.
    pub fn is_compressed(self) -> bool {
        self.block_side() > 1
    }

    /// Texels along the side of a block: 4, or 1 if it is not compressed.
    pub fn block_side(self) -> u32 {
        if matches!(self, Self::Bc5 | Self::Bc7 | Self::Bc7Srgb) { 4 } else { 1 }
    }

    /// Bytes of one channel; 1 for blocks (`typeSize` of KTX 2.0).
    fn channel_bytes(self) -> u32 {
        match self {
            Self::Rgba8 | Self::Rgba8Srgb | Self::Bc5 | Self::Bc7 | Self::Bc7Srgb => 1,
            Self::Rg16Float | Self::Rgba16Float => 2,
            Self::Rg32Float | Self::Rgba32Float => 4,
        }
    }

    /// Bytes of one texel or block: a power of two of at least 4, and thereby also the alignment of levels.
    pub fn bytes(self) -> u32 {
        match self {
            Self::Rg16Float | Self::Rg32Float => 2 * self.channel_bytes(),
            Self::Rgba8 | Self::Rgba8Srgb | Self::Rgba16Float | Self::Rgba32Float => 4 * self.channel_bytes(),
            Self::Bc5 | Self::Bc7 | Self::Bc7Srgb => 16,
        }
    }

    /// The basic data format descriptor, preceded by its length: KTX 2.0, section 3.10; Data Format 1.3, chapter 5.
    fn descriptor(self) -> Vec<u8> {
        /// Numbers of colour models: plain channels, and each block format's own.
        const RGBSDA: u32 = 1;
        const BC5: u32 = 132;
        const BC7: u32 = 134;
        /// Channel number of alpha; qualifiers: float and signed; linear although the colour is not.
        const ALPHA: u32 = 15;
        const FLOAT: u32 = 0x80 | 0x40;
        const LINEAR: u32 = 0x10;
        let srgb = matches!(self, Self::Rgba8Srgb | Self::Bc7Srgb);
        // Channel, bits, least and largest value of each sample.
        let float = |channel: u32| (channel | FLOAT, 8 * self.channel_bytes(), (-1f32).to_bits(), 1f32.to_bits());
        let byte = |channel: u32| (channel, 8, 0, 255);
        let alpha = if srgb { ALPHA | LINEAR } else { ALPHA };
        let (model, samples) = match self {
            Self::Rgba8 | Self::Rgba8Srgb => (RGBSDA, vec![byte(0), byte(1), byte(2), byte(alpha)]),
            Self::Rg16Float | Self::Rg32Float => (RGBSDA, vec![float(0), float(1)]),
            Self::Rgba16Float | Self::Rgba32Float => (RGBSDA, vec![float(0), float(1), float(2), float(ALPHA)]),
            Self::Bc5 => (BC5, vec![(0, 64, 0, u32::MAX), (1, 64, 0, u32::MAX)]),
            Self::Bc7 | Self::Bc7Srgb => (BC7, vec![(0, 128, 0, u32::MAX)]),
        };
        let block = 24 + 16 * samples.len() as u32;
        let transfer = if srgb { 2 } else { 1 };
        // BT.709 primaries, alpha not premultiplied; sides of a block less 1; all bytes in plane 0.
        let side = self.block_side() - 1;
        let mut words = vec![
            4 + block,
            0,
            2 | (block << 16),
            model | (1 << 8) | (transfer << 16),
            side | (side << 8),
            self.bytes(),
            0,
        ];
        let mut bit = 0;
        for (kind, bits, least, largest) in samples {
            words.extend([bit | ((bits - 1) << 16) | (kind << 24), 0, least, largest]);
            bit += bits;
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
    /// Elements of the array; 0 if the texture is no array.
    pub layers: u32,
    /// 6 for a cube, in the order +X −X +Y −Y +Z −Z, else 1.
    pub faces: u32,
    /// Level 0 first. Each holds layer after layer, face after face, rows from the top, tightly packed.
    pub levels: Vec<Vec<u8>>,
    /// Metadata. Text ends with a NUL. Writer and orientation are added by [`Ktx2::write`].
    pub key_values: BTreeMap<String, Vec<u8>>,
}

impl Ktx2 {
    /// Bytes that one level must have.
    pub fn level_bytes(&self, level: u32) -> u64 {
        level_bytes(self.format, self.size, self.layers, self.faces, level)
    }

    /// Sets metadata to a text.
    pub fn set_text(&mut self, key: &str, value: &str) {
        self.key_values.insert(key.to_owned(), [value.as_bytes(), b"\0"].concat());
    }

    /// Metadata as text; `None` if it is absent or not UTF-8.
    pub fn text(&self, key: &str) -> Option<&str> {
        let value = self.key_values.get(key)?;
        std::str::from_utf8(value.strip_suffix(b"\0").unwrap_or(value)).ok()
    }
}

/// Bytes of one level; saturates, which is longer than any file.
fn level_bytes(format: TexelFormat, size: [u32; 2], layers: u32, faces: u32, level: u32) -> u64 {
    let side = |i: usize| u64::from(size[i].checked_shr(level).unwrap_or(0).max(1).div_ceil(format.block_side()));
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
        assert_eq!([0, 1, 2].map(|level| level_bytes(TexelFormat::Bc7, [9, 6], 0, 1, level)), [6 * 16, 16, 16]);
    }

    #[test]
    fn formats_have_vulkan_numbers() {
        for format in TexelFormat::ALL {
            assert_eq!(TexelFormat::from_vulkan(format.vulkan()), Some(format));
            assert!(format.bytes().is_power_of_two() && format.bytes() >= 4);
        }
        assert_eq!(TexelFormat::from_vulkan(1), None);
    }

    #[test]
    fn the_half_float_descriptor_follows_the_standard() {
        let descriptor = TexelFormat::Rgba16Float.descriptor();
        assert_eq!(descriptor.len(), 4 + 24 + 4 * 16);
        let head = [92, 0, 0, 0, 0, 0, 0, 0, 2, 0, 88, 0, 1, 1, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(descriptor[..28], head);
        // Alpha: at bit 48, 16 bits, channel 15, signed float, from −1 to 1.
        assert_eq!(descriptor[76..], [48, 0, 15, 0xcf, 0, 0, 0, 0, 0, 0, 0x80, 0xbf, 0, 0, 0x80, 0x3f]);
    }

    #[test]
    fn the_block_descriptors_follow_the_standard() {
        let descriptor = TexelFormat::Bc7Srgb.descriptor();
        let head = [44, 0, 0, 0, 0, 0, 0, 0, 2, 0, 40, 0, 134, 1, 2, 0, 3, 3, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(descriptor[..28], head);
        assert_eq!(descriptor[28..], [0, 0, 127, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255]);
        let green = TexelFormat::Bc5.descriptor()[44..48].to_vec();
        assert_eq!(green, [64, 0, 63, 1]);
        let alpha = TexelFormat::Rgba8Srgb.descriptor()[76..].to_vec();
        assert_eq!(alpha, [24, 0, 7, 31, 0, 0, 0, 0, 0, 0, 0, 0, 255, 0, 0, 0]);
    }
}
