//! From picture files to the textures of materials: finds constants, packs channels, makes mips, compresses; or takes
//! the result from the cache.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::asset::cache::Key;
use crate::asset::image_source::ImageSource;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::asset::mip_chain::Coverage;
use crate::asset::mips::NormalLoss;
use crate::asset::texture::{Channel, Encoding, Pick, srgb_to_linear};
use crate::asset::{Cache, MipChain, Report, Storage, Texture, TextureOptions, file};

/// Version of the textures in the cache. Raise it whenever the same pictures give other texels or other facts: after a
/// change of decoding, packing, mips or compression, or of a crate that does one of them.
pub const TEXTURES_VERSION: u32 = 1;
/// The cutoff where a file names none.
pub const ALPHA_CUTOFF: f32 = 0.5;
/// A normal map with all x and y within one step of 128 is flat.
const FLAT_NORMAL: std::ops::RangeInclusive<u8> = 127..=129;
/// The largest texture, compressed, is smaller.
const MAX_ENTRY_BYTES: u64 = 512 << 20;
/// Metadata key of the result's other values: 12 bytes of factor, a byte for each of `uses_alpha`, `holds_roughness` and
/// whether there is a texture, and 6 bytes of ranges.
const FACTS: &str = "pbrvrFacts";

/// Source of a normal map.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Normals {
    /// A normal map, and the bits of the factor of its x and y (`f32` has no `Ord`).
    Map(ImageSource, u32),
    /// A height map or a normal map, and the bits of the strength.
    Bump(ImageSource, u32),
}

/// What alpha of a base color map is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Alpha {
    /// A mask with a cutoff of one half if some texels are below it and some above, else nothing.
    Guessed,
    Opaque,
    /// A mask, with the bits of its cutoff.
    Mask(u32),
    /// Coverage, or any other number that leaves the color what it is.
    Blend,
}

/// A texture to be made; equal tasks are done once.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TextureTask {
    BaseColor {
        colour: Option<ImageSource>,
        mask: Option<OneChannel>,
        alpha: Alpha,
    },
    Normal(Normals),
    /// Direction and strength of stretched highlights.
    Anisotropy(ImageSource),
    /// Occlusion, roughness, metallic, clear coat; the bits of the roughness factor with its map, and without it, and of the
    /// occlusion's strength.
    Orm {
        maps: [Option<OneChannel>; 4],
        normals: Option<Normals>,
        roughness: [u32; 2],
        strength: u32,
    },
}

/// The result of a task: a texture, a constant factor instead, or both.
pub struct TextureResult {
    pub texture: Option<MipChain>,
    /// Linear base color, or occlusion, roughness, metallic; 1 where the texture holds the value.
    pub factor: Vec3,
    /// Minimum and maximum of the occlusion, roughness and metallic maps; 255 where there is none.
    pub ranges: [[u8; 2]; 3],
    /// Whether alpha of the texture means anything.
    pub uses_alpha: bool,
    /// Whether the texture's roughness includes the material's factor.
    pub holds_roughness: bool,
    /// Which of the task's pictures could be read: the colour, or occlusion, roughness, metallic, clear coat.
    pub read: [bool; 4],
    /// Those that could not be read, with the error.
    pub problems: Vec<(ImageSource, String)>,
}

impl TextureResult {
    fn nothing() -> Self {
        Self {
            texture: None,
            factor: Vec3::ONE,
            ranges: [[255; 2]; 3],
            uses_alpha: false,
            holds_roughness: false,
            read: [false; 4],
            problems: Vec::new(),
        }
    }
}

/// A picture of which one channel is used.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OneChannel {
    pub image: ImageSource,
    pub pick: Pick,
}

type Digest = Result<[u8; 32], String>;

/// Makes textures from the files of all tasks.
pub struct Pictures<'a> {
    options: &'a TextureOptions,
    report: &'a Report,
    cache: Option<&'a Cache>,
    /// Only where there is a cache.
    digests: BTreeMap<ImageSource, Digest>,
    /// Channels that several tasks use, decoded once.
    shared: BTreeMap<OneChannel, OnceLock<Result<Channel, String>>>,
}

impl<'a> Pictures<'a> {
    /// Hashes every file, if there is a cache.
    pub fn new(tasks: &BTreeSet<TextureTask>, options: &'a TextureOptions, report: &'a Report) -> Self {
        // Uncompressed textures are made as fast as they are read from the cache.
        let cache = options.cache.as_ref().filter(|_| options.storage == Storage::Bc);
        let mut uses: BTreeMap<OneChannel, u32> = BTreeMap::new();
        for scalar in tasks.iter().flat_map(scalars) {
            *uses.entry(scalar).or_default() += 1;
        }
        let shared = uses.into_iter().filter(|(_, uses)| *uses > 1).map(|(key, _)| (key, OnceLock::new())).collect();
        let images: BTreeSet<ImageSource> =
            tasks.iter().filter(|_| cache.is_some()).flat_map(images).cloned().collect();
        let digest = |image: ImageSource| {
            let digest = report.time("hash", || image.read().map(|bytes| *blake3::hash(&bytes).as_bytes()));
            let digest = digest.map_err(|error| error.to_string());
            (image, digest)
        };
        Self { options, report, cache, digests: images.into_par_iter().map(digest).collect(), shared }
    }

    /// Does a task, or takes its result from the cache.
    pub fn make(&self, task: &TextureTask) -> TextureResult {
        let key = self.cache.and_then(|_| self.key(task));
        let Some((cache, key)) = self.cache.zip(key) else { return self.work(task) };
        let found = self.report.time("cache", || cache.load(&key, MAX_ENTRY_BYTES, |texture| facts(texture).is_some()));
        if let Some(made) = found.and_then(|texture| from_entry(texture, task)) {
            return made;
        }
        let made = self.work(task);
        // Results with problems are not cached, so that their warnings come at each start.
        if made.problems.is_empty() {
            self.report.time("cache", || cache.keep(&key, to_entry(&made)));
        }
        made
    }

    /// The hash of everything that a task depends on; `None` if a file cannot be read.
    fn key(&self, task: &TextureTask) -> Option<String> {
        let mut key = Key::new("texture", TEXTURES_VERSION);
        let mut add = |image: Option<&ImageSource>| -> Option<()> {
            match image {
                None => key.add(b""),
                Some(image) => key.add(self.digests.get(image)?.as_ref().ok()?),
            }
            Some(())
        };
        let kind = match task {
            TextureTask::BaseColor { colour, mask, alpha } => {
                add(colour.as_ref())?;
                add(mask.as_ref().map(|mask| &mask.image))?;
                format!("base color {:?} {alpha:?}", mask.as_ref().map(|mask| mask.pick))
            }
            TextureTask::Normal(normals) => {
                add(Some(normals.image()))?;
                format!("normal {:?}", normals.numbers())
            }
            TextureTask::Anisotropy(image) => {
                add(Some(image))?;
                "anisotropy".into()
            }
            TextureTask::Orm { maps, normals, roughness, strength } => {
                maps.iter().try_for_each(|map| add(map.as_ref().map(|map| &map.image)))?;
                add(normals.as_ref().map(Normals::image))?;
                let picks = maps.each_ref().map(|map| map.as_ref().map(|map| map.pick));
                format!("orm {picks:?} {:?} {roughness:?} {strength}", normals.as_ref().map(Normals::numbers))
            }
        };
        key.add(kind.as_bytes());
        Some(key.text())
    }

    fn work(&self, task: &TextureTask) -> TextureResult {
        match task {
            TextureTask::BaseColor { colour, mask, alpha } => self.base_color(colour.as_ref(), mask.as_ref(), *alpha),
            TextureTask::Normal(normals) => match self.normal_map(normals) {
                Ok(texture) => {
                    let texture = texture.map(|t| MipChain::normal(&t, self.options.storage, self.report));
                    TextureResult { texture, read: [true; 4], ..TextureResult::nothing() }
                }
                Err(problem) => {
                    TextureResult { problems: vec![(normals.image().clone(), problem)], ..TextureResult::nothing() }
                }
            },
            TextureTask::Anisotropy(image) => match self.load(image, Encoding::Linear) {
                Ok(mut texture) => {
                    texture.map_texels(along_by_strength);
                    let texture = Some(MipChain::anisotropy(texture, self.options.storage, self.report));
                    TextureResult { texture, read: [true; 4], ..TextureResult::nothing() }
                }
                Err(problem) => TextureResult { problems: vec![(image.clone(), problem)], ..TextureResult::nothing() },
            },
            TextureTask::Orm { maps, normals, roughness, strength } => {
                let strength = f32::from_bits(*strength);
                self.orm(maps, normals.as_ref(), roughness.map(f32::from_bits), strength)
            }
        }
    }

    fn base_color(&self, colour: Option<&ImageSource>, mask: Option<&OneChannel>, alpha: Alpha) -> TextureResult {
        let mut made = TextureResult::nothing();
        let mask = mask.and_then(|mask| self.channel(mask, &mut made.problems));
        let mask = mask.as_deref().filter(|mask| alpha.is_used(mask));
        let mut texture = None;
        if let Some(image) = colour {
            match self.load(image, Encoding::Srgb) {
                Ok(loaded) => texture = Some(loaded),
                Err(problem) => {
                    made.problems.push((image.clone(), problem));
                    return made;
                }
            }
            made.read[0] = true;
        }
        let Some(mut texture) = texture else {
            made.uses_alpha = mask.is_some();
            made.texture = mask.map(|mask| self.masked(white(mask), alpha));
            return made;
        };
        let own_alpha = texture.channel(3);
        made.uses_alpha = mask.is_some() || alpha.is_used(&own_alpha);
        if !made.uses_alpha {
            texture.clear_alpha();
        }
        if let Some(colour) = texture.constant_colour() {
            made.factor = Vec3::from_array(colour.map(|v| srgb_to_linear(f32::from(v) / 255.0)));
            let mask = mask.or(made.uses_alpha.then_some(&own_alpha));
            made.texture = mask.map(|mask| self.masked(white(mask), alpha));
            return made;
        }
        if let Some(mask) = mask {
            texture.set_alpha(mask);
        }
        let coverage = if made.uses_alpha { alpha.coverage() } else { Coverage::Whole };
        made.texture = Some(MipChain::base_color(texture, coverage, self.options.storage, self.report));
        made
    }

    fn masked(&self, texture: Texture, alpha: Alpha) -> MipChain {
        MipChain::base_color(texture, alpha.coverage(), self.options.storage, self.report)
    }

    /// The decoded normal map; `None` if it is flat.
    fn normal_map(&self, normals: &Normals) -> Result<Option<Texture>, String> {
        let mut texture = match normals {
            Normals::Map(image, scale) => {
                let mut texture = self.load(image, Encoding::Normal)?;
                texture.scale_slopes(f32::from_bits(*scale));
                texture
            }
            Normals::Bump(image, strength) => {
                self.load(image, Encoding::Linear)?.into_normal_map(f32::from_bits(*strength))
            }
        };
        texture.clear_alpha();
        let flat = texture.constant().is_some_and(|[x, y, ..]| FLAT_NORMAL.contains(&x) && FLAT_NORMAL.contains(&y));
        Ok((!flat).then_some(texture))
    }

    /// Packs the channels that vary. Constant roughness and metallic become factors; occlusion and clear coat stay in the
    /// texture if they are below 1. With a normal map roughness varies between levels, so the texture holds all of it.
    fn orm(
        &self,
        maps: &[Option<OneChannel>; 4],
        normals: Option<&Normals>,
        roughness: [f32; 2],
        strength: f32,
    ) -> TextureResult {
        let mut made = TextureResult::nothing();
        let mut channels: [Option<Cow<'_, Channel>>; 4] =
            maps.each_ref().map(|map| map.as_ref().and_then(|map| self.channel(map, &mut made.problems)));
        if let Some(occlusion) = channels[0].as_mut().filter(|_| strength < 1.0) {
            occlusion.to_mut().weaken(strength);
        }
        let channels = channels.each_ref().map(Option::as_deref);
        made.read = channels.map(|channel| channel.is_some());
        let constants = channels.map(|channel| channel.and_then(Channel::constant));
        let is_factor = |i: usize| constants[i].is_some_and(|value| value == 255 || i == 1 || i == 2);
        let varying = [0, 1, 2, 3].map(|i| channels[i].filter(|_| !is_factor(i)));
        let names = maps.iter().zip(&varying).filter_map(|(map, varies)| map.as_ref().filter(|_| varies.is_some()));
        let name = names.map(|map| file::short_name(map.image.place())).collect::<Vec<_>>().join("+");
        let factor = |i: usize| constants[i].map_or(1.0, |value| f32::from(value) / 255.0);
        made.factor = Vec3::new(1.0, factor(1), factor(2));
        // For a constant, the value of its factor.
        let range = |i: usize| constants[i].map(|c| (c, c)).or(channels[i]?.range());
        made.ranges = [0, 1, 2].map(|i| range(i).map_or([255; 2], |(least, most)| [least, most]));
        let mut texture = Texture::packed(name, varying);
        // A broken normal map is reported by its own task.
        let normals = normals.and_then(|normals| self.normal_map(normals).ok().flatten());
        let loss = normals.as_ref().map(|normals| self.report.time("mips", || NormalLoss::new(normals)));
        if let Some(normals) = normals {
            let own = roughness[usize::from(!made.read[1])] * factor(1);
            let texture = texture.get_or_insert_with(|| plain(&normals));
            texture.scale_channel(1, own);
            made.holds_roughness = true;
        }
        made.texture = texture.map(|t| MipChain::orm(t, loss.as_ref(), self.options.storage, self.report));
        made
    }

    fn load(&self, image: &ImageSource, encoding: Encoding) -> Result<Texture, String> {
        self.report.time("decode", || Texture::load(image, encoding)).map_err(|error| error.to_string())
    }

    fn channel(&self, map: &OneChannel, problems: &mut Vec<(ImageSource, String)>) -> Option<Cow<'_, Channel>> {
        let load = || {
            let loaded = self.report.time("decode", || Channel::load(&map.image, map.pick));
            loaded.map_err(|error| error.to_string())
        };
        let loaded = match self.shared.get(map) {
            Some(once) => once.get_or_init(load).as_ref().map(Cow::Borrowed).map_err(String::clone),
            None => load().map(Cow::Owned),
        };
        loaded.map_err(|problem| problems.push((map.image.clone(), problem))).ok()
    }
}

impl Alpha {
    /// Whether it makes any texel other than opaque.
    fn is_used(self, alpha: &Channel) -> bool {
        match self {
            Self::Guessed => alpha.cuts_out(),
            Self::Opaque => false,
            Self::Mask(cutoff) => alpha.values.iter().any(|v| f32::from(*v) / 255.0 < f32::from_bits(cutoff)),
            Self::Blend => alpha.values.iter().any(|v| *v < 255),
        }
    }

    fn coverage(self) -> Coverage {
        match self {
            Self::Guessed => Coverage::Tested(ALPHA_CUTOFF),
            Self::Opaque => Coverage::Whole,
            Self::Mask(cutoff) => Coverage::Tested(f32::from_bits(cutoff).min(1.0)),
            Self::Blend => Coverage::Blended,
        }
    }
}

impl Normals {
    fn image(&self) -> &ImageSource {
        match self {
            Self::Map(image, _) | Self::Bump(image, _) => image,
        }
    }

    /// The bits of the vectors' factor and of heights' strength.
    fn numbers(&self) -> [Option<u32>; 2] {
        match self {
            Self::Map(_, scale) => [Some(*scale), None],
            Self::Bump(_, strength) => [None, Some(*strength)],
        }
    }
}

/// A white texture with `mask` as alpha.
fn white(mask: &Channel) -> Texture {
    let pixels = mask.values.iter().flat_map(|alpha| [255, 255, 255, *alpha]).collect();
    Texture { name: "mask".into(), width: mask.width, height: mask.height, encoding: Encoding::Srgb, pixels }
}

/// A texture of 1 in all channels, with the size of another.
fn plain(like: &Texture) -> Texture {
    let pixels = vec![255; like.pixels.len()];
    Texture { name: "roughness".into(), encoding: Encoding::Linear, pixels, ..*like }
}

/// A texel of direction and strength as the direction times the strength, from −1 to 1.
fn along_by_strength([x, y, strength, _]: [u8; 4]) -> [u8; 4] {
    let unit = |value: u8| f32::from(value) / 255.0;
    let along = (2.0 * Vec2::new(unit(x), unit(y)) - Vec2::ONE).clamp_length_max(1.0) * unit(strength);
    let [x, y] = along.to_array().map(|value| (255.0 * (0.5 + 0.5 * value)).round() as u8);
    [x, y, 0, 255]
}

fn images(task: &TextureTask) -> Vec<&ImageSource> {
    match task {
        TextureTask::BaseColor { colour, mask, .. } => {
            colour.iter().chain(mask.iter().map(|mask| &mask.image)).collect()
        }
        TextureTask::Normal(normals) => vec![normals.image()],
        TextureTask::Anisotropy(image) => vec![image],
        TextureTask::Orm { maps, normals, .. } => {
            maps.iter().flatten().map(|map| &map.image).chain(normals.as_ref().map(Normals::image)).collect()
        }
    }
}

fn scalars(task: &TextureTask) -> Vec<OneChannel> {
    match task {
        TextureTask::BaseColor { mask, .. } => mask.iter().cloned().collect(),
        TextureTask::Normal(_) | TextureTask::Anisotropy(_) => Vec::new(),
        TextureTask::Orm { maps, .. } => maps.iter().flatten().cloned().collect(),
    }
}

fn to_entry(made: &TextureResult) -> Ktx2 {
    let mut entry = match &made.texture {
        Some(texture) => texture.clone().into_ktx2(),
        None => {
            let levels = vec![vec![0; 4]];
            Ktx2 { format: TexelFormat::Rgba8, size: [1, 1], layers: 0, faces: 1, levels, key_values: [].into() }
        }
    };
    let mut facts: Vec<u8> = made.factor.to_array().into_iter().flat_map(f32::to_le_bytes).collect();
    facts.extend([made.uses_alpha, made.holds_roughness, made.texture.is_some()].map(u8::from));
    facts.extend(made.ranges.as_flattened());
    entry.key_values.insert(FACTS.into(), facts);
    entry
}

/// Factor; uses alpha, holds roughness, has a texture; ranges.
type Facts = ([f32; 3], [bool; 3], [[u8; 2]; 3]);

fn facts(entry: &Ktx2) -> Option<Facts> {
    let facts: &[u8; 21] = entry.key_values.get(FACTS)?.as_slice().try_into().ok()?;
    let factor = [0, 4, 8].map(|at| f32::from_le_bytes([facts[at], facts[at + 1], facts[at + 2], facts[at + 3]]));
    let ranges = [15, 17, 19].map(|at| [facts[at], facts[at + 1]]);
    Some((factor, [12, 13, 14].map(|at| facts[at] == 1), ranges))
}

/// The result that [`to_entry`] stored; only tasks without problems are stored.
fn from_entry(entry: Ktx2, task: &TextureTask) -> Option<TextureResult> {
    let (factor, [uses_alpha, holds_roughness, has_texture], ranges) = facts(&entry)?;
    let texture = if has_texture { Some(MipChain::from_ktx2(entry)?) } else { None };
    let read = match task {
        TextureTask::BaseColor { colour, .. } => [colour.is_some(); 4],
        TextureTask::Normal(_) | TextureTask::Anisotropy(_) => [true; 4],
        TextureTask::Orm { maps, .. } => maps.each_ref().map(Option::is_some),
    };
    Some(TextureResult {
        texture,
        factor: factor.into(),
        ranges,
        uses_alpha,
        holds_roughness,
        read,
        problems: Vec::new(),
    })
}
