//! Textures with all their mips as the GPU takes them: plain or block-compressed.

use clap::ValueEnum;

use super::compress::{Block, compress, decompress};
use super::ktx2::{Ktx2, TexelFormat};
use super::mips::{self, NormalLoss, level_size};
use super::{Cache, Report, Texture};

/// How textures store their texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Storage {
    /// Four bytes per texel.
    Raw,
    /// BC7 and BC5, one byte per texel.
    #[default]
    Bc,
}

/// How a scene's textures are made, cached and sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureOptions {
    pub storage: Storage,
    /// For compressed ones; with `None` they are compressed at each start.
    pub cache: Option<Cache>,
    /// GPU memory that all of them may take, in bytes; `None` for what the GPU has free, less a margin.
    pub budget_bytes: Option<u64>,
    /// Finest levels left out of every texture.
    pub dropped_levels: u32,
    /// Maximum of anisotropic filtering, 1 to 16.
    pub anisotropy: u32,
}

impl Default for TextureOptions {
    fn default() -> Self {
        Self { storage: Storage::default(), cache: None, budget_bytes: None, dropped_levels: 0, anisotropy: 8 }
    }
}

/// What alpha of a base color map is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coverage {
    /// 1.
    Whole,
    /// A mask with a cutoff, whose share of texels above it each level keeps.
    Tested(f32),
    /// The share of what is behind that is hidden.
    Blended,
}

/// A texture with all its levels, down to 1×1.
#[derive(Clone, Debug, PartialEq)]
pub struct MipChain {
    /// For messages and GPU debug names.
    pub name: String,
    /// Texels of level 0.
    pub width: u32,
    pub height: u32,
    pub format: TexelFormat,
    /// Level 0 first; bytes as in a KTX2 file.
    pub levels: Vec<Vec<u8>>,
}

impl MipChain {
    /// A base color map.
    pub fn base_color(texture: Texture, coverage: Coverage, storage: Storage, report: &Report) -> Self {
        let plain = Self::without_levels(&texture, TexelFormat::Rgba8Srgb);
        let (block, cutoff) = match coverage {
            Coverage::Whole => (Block::Opaque, None),
            Coverage::Tested(cutoff) => (Block::Alpha, Some(cutoff)),
            Coverage::Blended => (Block::Alpha, None),
        };
        let levels = report.time("mips", || mips::base_color_levels(texture, cutoff));
        Self { levels, ..plain }.stored(storage, block, report)
    }

    /// A normal map: x and y; shaders reconstruct z.
    pub fn normal(texture: &Texture, storage: Storage, report: &Report) -> Self {
        let levels = report.time("mips", || mips::normal_levels(texture));
        let plain = Self::without_levels(texture, TexelFormat::Rgba8);
        Self { levels, ..plain }.stored(storage, Block::TwoChannels, report)
    }

    /// Vectors of two channels, of which the levels hold the means.
    pub fn anisotropy(texture: Texture, storage: Storage, report: &Report) -> Self {
        let plain = Self::without_levels(&texture, TexelFormat::Rgba8);
        let levels = report.time("mips", || mips::linear_levels(texture));
        Self { levels, ..plain }.stored(storage, Block::TwoChannels, report)
    }

    /// An ORM map; roughness is raised where `normals` lose detail.
    pub fn orm(texture: Texture, normals: Option<&NormalLoss>, storage: Storage, report: &Report) -> Self {
        let plain = Self::without_levels(&texture, TexelFormat::Rgba8);
        let block = if texture.texels().all(|texel| texel[3] == 255) { Block::Opaque } else { Block::Alpha };
        let levels = report.time("mips", || mips::orm_levels(texture, normals));
        Self { levels, ..plain }.stored(storage, block, report)
    }

    /// Bytes of the levels from `first` on.
    pub fn bytes_from(&self, first: u32) -> u64 {
        self.levels.iter().skip(first as usize).map(|level| level.len() as u64).sum()
    }

    /// Bytes that it would take uncompressed.
    pub fn raw_bytes(&self) -> u64 {
        let texels = |level| level_size([self.width, self.height], level).map(u64::from).iter().product::<u64>();
        (0..self.levels.len() as u32).map(|level| 4 * texels(level)).sum()
    }

    /// The texels decompressed, as a GPU reads them.
    pub fn decompressed(&self) -> Self {
        let (block, format) = match self.format {
            TexelFormat::Bc5 => (Block::TwoChannels, TexelFormat::Rgba8),
            TexelFormat::Bc7 => (Block::Alpha, TexelFormat::Rgba8),
            TexelFormat::Bc7Srgb => (Block::Alpha, TexelFormat::Rgba8Srgb),
            _ => return self.clone(),
        };
        let size = |level| level_size([self.width, self.height], level);
        let levels = (0u32..).zip(&self.levels).map(|(level, blocks)| decompress(block, size(level), blocks)).collect();
        Self { name: self.name.clone(), format, levels, ..*self }
    }

    /// As a cache entry.
    pub fn into_ktx2(self) -> Ktx2 {
        let (size, levels) = ([self.width, self.height], self.levels);
        let mut texture =
            Ktx2 { format: self.format, size, layers: 0, faces: 1, levels, key_values: Default::default() };
        texture.set_text(NAME, &self.name);
        texture
    }

    /// The inverse of [`MipChain::into_ktx2`]; `None` for a texture of another shape.
    pub fn from_ktx2(texture: Ktx2) -> Option<Self> {
        let whole = texture.levels.len() == mips::level_count(texture.size) as usize;
        if !whole || texture.faces != 1 || texture.layers != 0 {
            return None;
        }
        let ([width, height], name) = (texture.size, texture.text(NAME)?.to_owned());
        Some(Self { name, width, height, format: texture.format, levels: texture.levels })
    }

    fn without_levels(texture: &Texture, format: TexelFormat) -> Self {
        let Texture { name, width, height, .. } = texture;
        Self { name: name.clone(), width: *width, height: *height, format, levels: Vec::new() }
    }

    /// Plain texels, compressed if `storage` says so.
    fn stored(mut self, storage: Storage, block: Block, report: &Report) -> Self {
        if storage == Storage::Raw {
            return self;
        }
        let size = [self.width, self.height];
        // Level by level, so that only one is in memory twice.
        for (level, bytes) in (0u32..).zip(&mut self.levels) {
            *bytes = compress(block, level_size(size, level), bytes, report);
        }
        self.format = match (block, self.format) {
            (Block::TwoChannels, _) => TexelFormat::Bc5,
            (_, TexelFormat::Rgba8Srgb) => TexelFormat::Bc7Srgb,
            _ => TexelFormat::Bc7,
        };
        self
    }
}

/// Metadata key of the texture's name.
const NAME: &str = "pbrvrName";

#[cfg(test)]
mod tests {
    use super::super::texture::Encoding;
    use super::*;

    fn texture(width: u32, height: u32) -> Texture {
        let texel = |i: u32| [(i * 37 % 251) as u8, (i * 11 % 241) as u8, 128, 255];
        let pixels = (0..width * height).flat_map(texel).collect();
        Texture { name: "t".into(), width, height, encoding: Encoding::Srgb, pixels }
    }

    #[test]
    fn chains_of_any_size_are_complete_and_a_quarter_of_their_raw_size() {
        for (width, height) in [(64, 64), (37, 50), (1, 9), (5, 1), (2, 2)] {
            let chains = [Storage::Raw, Storage::Bc].map(|storage| {
                let report = Report::silent();
                [
                    MipChain::base_color(texture(width, height), Coverage::Whole, storage, &report),
                    MipChain::normal(&texture(width, height), storage, &report),
                    MipChain::orm(texture(width, height), None, storage, &report),
                ]
            });
            for chain in chains.iter().flatten() {
                assert_eq!(chain.levels.len() as u32, mips::level_count([width, height]));
                let ktx2 = chain.clone().into_ktx2();
                for (level, bytes) in (0u32..).zip(&chain.levels) {
                    assert_eq!(bytes.len() as u64, ktx2.level_bytes(level), "{:?} level {level}", chain.format);
                }
                assert_eq!(MipChain::from_ktx2(ktx2).as_ref(), Some(chain));
            }
            for (raw, compressed) in chains[0].iter().zip(&chains[1]) {
                assert_eq!(raw.bytes_from(0), raw.raw_bytes());
                assert_eq!(compressed.raw_bytes(), raw.raw_bytes());
                let (back, same) = (compressed.decompressed(), raw.decompressed());
                assert_eq!((back.format, back.bytes_from(0)), (raw.format, raw.raw_bytes()));
                assert_eq!(same, *raw, "nothing to do");
                if width == 64 {
                    let ratio = raw.bytes_from(0) as f64 / compressed.bytes_from(0) as f64;
                    assert!(ratio > 3.98, "{:?}: {ratio}", compressed.format);
                }
            }
        }
    }

    #[test]
    fn a_chain_that_lacks_levels_is_rejected() {
        let mut ktx2 =
            MipChain::base_color(texture(8, 8), Coverage::Whole, Storage::Raw, &Report::silent()).into_ktx2();
        ktx2.levels.pop();
        assert_eq!(MipChain::from_ktx2(ktx2), None);
    }
}
