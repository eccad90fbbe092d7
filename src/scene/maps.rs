//! From picture files to the textures of materials: finds constants, packs channels, makes mips, compresses; or takes
//! the result from the cache.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::Vec3;
use rayon::prelude::*;

use crate::asset::cache::Key;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::asset::mips::{NormalLoss, srgb_to_linear};
use crate::asset::texture::{Channel, Encoding, MAX_FILE_BYTES, Pick};
use crate::asset::{Cache, MipChain, Report, Storage, Texture, TextureOptions, file};

/// Version of the textures in the cache. Raise it whenever the same pictures give other texels or other facts: after a
/// change of decoding, packing, mips or compression, or of a crate that does one of them.
pub const TEXTURES_VERSION: u32 = 1;
/// Fragments with less alpha than this are discarded.
pub const ALPHA_CUTOFF: f32 = 0.5;
/// A normal map with all x and y within one step of 128 is flat.
const FLAT_NORMAL: std::ops::RangeInclusive<u8> = 127..=129;
/// The largest texture, compressed, is smaller.
const MAX_ENTRY_BYTES: u64 = 512 << 20;
/// Metadata key of the result's other values: 12 bytes of factor, a byte for each of `cutout`, `holds_roughness` and
/// whether there is a texture, and 6 bytes of ranges.
const FACTS: &str = "pbrvrFacts";

/// Source of a normal map.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Normals {
    /// A file that is a normal map.
    Map(PathBuf),
    /// A file that is a height map or a normal map, and the bits of the strength (`f32` has no `Ord`).
    Bump(PathBuf, u32),
}

/// A texture to be made; equal tasks are done once.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TextureTask {
    BaseColor {
        colour: Option<PathBuf>,
        mask: Option<OneChannel>,
    },
    Normal(Normals),
    /// Occlusion, roughness, metallic; the bits of the roughness factor with its map, and without it.
    Orm {
        maps: [Option<OneChannel>; 3],
        normals: Option<Normals>,
        roughness: [u32; 2],
    },
}

/// The result of a task: a texture, a constant factor instead, or both.
pub struct TextureResult {
    pub texture: Option<MipChain>,
    /// Linear base color, or occlusion, roughness, metallic; 1 where the texture holds the value.
    pub factor: Vec3,
    /// Minimum and maximum of the occlusion, roughness and metallic maps; 255 where there is none.
    pub ranges: [[u8; 2]; 3],
    pub cutout: bool,
    /// Whether the texture's roughness includes the material's factor.
    pub holds_roughness: bool,
    /// Which of the task's pictures could be read: the colour, or occlusion, roughness, metallic.
    pub read: [bool; 3],
    /// Files that could not be read, with the error.
    pub problems: Vec<(PathBuf, String)>,
}

impl TextureResult {
    fn nothing() -> Self {
        Self {
            texture: None,
            factor: Vec3::ONE,
            ranges: [[255; 2]; 3],
            cutout: false,
            holds_roughness: false,
            read: [false; 3],
            problems: Vec::new(),
        }
    }
}

/// A picture of which one channel is used.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OneChannel {
    pub path: PathBuf,
    pub pick: Pick,
}

type Digest = Result<[u8; 32], String>;

/// Makes textures from the files of all tasks.
pub struct Pictures<'a> {
    options: &'a TextureOptions,
    report: &'a Report,
    cache: Option<&'a Cache>,
    /// Only where there is a cache.
    digests: BTreeMap<PathBuf, Digest>,
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
        let files: BTreeSet<PathBuf> = tasks.iter().filter(|_| cache.is_some()).flat_map(files).cloned().collect();
        let digest = |path: PathBuf| {
            let digest = report.time("hash", || {
                file::read(&path, "texture", MAX_FILE_BYTES).map(|bytes| *blake3::hash(&bytes).as_bytes())
            });
            (path, digest.map_err(|error| error.to_string()))
        };
        Self { options, report, cache, digests: files.into_par_iter().map(digest).collect(), shared }
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
        let mut add = |path: Option<&PathBuf>| -> Option<()> {
            match path {
                None => key.add(b""),
                Some(path) => key.add(self.digests.get(path)?.as_ref().ok()?),
            }
            Some(())
        };
        let kind = match task {
            TextureTask::BaseColor { colour, mask } => {
                add(colour.as_ref())?;
                add(mask.as_ref().map(|mask| &mask.path))?;
                format!("base color {:?}", mask.as_ref().map(|mask| mask.pick))
            }
            TextureTask::Normal(normals) => {
                add(Some(normals.path()))?;
                format!("normal {:?}", normals.strength())
            }
            TextureTask::Orm { maps, normals, roughness } => {
                maps.iter().try_for_each(|map| add(map.as_ref().map(|map| &map.path)))?;
                add(normals.as_ref().map(Normals::path))?;
                let picks = maps.each_ref().map(|map| map.as_ref().map(|map| map.pick));
                format!("orm {picks:?} {:?} {roughness:?}", normals.as_ref().map(Normals::strength))
            }
        };
        key.add(kind.as_bytes());
        Some(key.text())
    }

    fn work(&self, task: &TextureTask) -> TextureResult {
        match task {
            TextureTask::BaseColor { colour, mask } => self.base_color(colour.as_deref(), mask.as_ref()),
            TextureTask::Normal(normals) => match self.normal_map(normals) {
                Ok(texture) => {
                    let texture = texture.map(|t| MipChain::normal(&t, self.options.storage, self.report));
                    TextureResult { texture, read: [true; 3], ..TextureResult::nothing() }
                }
                Err(problem) => {
                    TextureResult { problems: vec![(normals.path().clone(), problem)], ..TextureResult::nothing() }
                }
            },
            TextureTask::Orm { maps, normals, roughness } => {
                self.orm(maps, normals.as_ref(), roughness.map(f32::from_bits))
            }
        }
    }

    fn base_color(&self, colour: Option<&Path>, mask: Option<&OneChannel>) -> TextureResult {
        let mut made = TextureResult::nothing();
        let mask = mask.and_then(|mask| self.channel(mask, &mut made.problems));
        let mask = mask.as_deref().filter(|mask| mask.cuts_out());
        let mut texture = None;
        if let Some(path) = colour {
            match self.load(path, Encoding::Srgb) {
                Ok(loaded) => texture = Some(loaded),
                Err(problem) => {
                    made.problems.push((path.to_owned(), problem));
                    return made;
                }
            }
            made.read[0] = true;
        }
        let Some(mut texture) = texture else {
            made.cutout = mask.is_some();
            made.texture = mask.map(|mask| self.masked(white(mask)));
            return made;
        };
        let own_alpha = texture.channel(3);
        made.cutout = mask.is_some() || own_alpha.cuts_out();
        if !made.cutout {
            texture.clear_alpha();
        }
        if let Some(colour) = texture.constant_colour() {
            made.factor = Vec3::from_array(colour.map(|v| srgb_to_linear(f32::from(v) / 255.0)));
            let mask = mask.or(made.cutout.then_some(&own_alpha));
            made.texture = mask.map(|mask| self.masked(white(mask)));
            return made;
        }
        if let Some(mask) = mask {
            texture.set_alpha(mask);
        }
        let cutoff = made.cutout.then_some(ALPHA_CUTOFF);
        made.texture = Some(MipChain::base_color(texture, cutoff, self.options.storage, self.report));
        made
    }

    fn masked(&self, texture: Texture) -> MipChain {
        MipChain::base_color(texture, Some(ALPHA_CUTOFF), self.options.storage, self.report)
    }

    /// The decoded normal map; `None` if it is flat.
    fn normal_map(&self, normals: &Normals) -> Result<Option<Texture>, String> {
        let mut texture = match normals {
            Normals::Map(path) => self.load(path, Encoding::Normal)?,
            Normals::Bump(path, strength) => {
                self.load(path, Encoding::Linear)?.into_normal_map(f32::from_bits(*strength))
            }
        };
        texture.clear_alpha();
        let flat = texture.constant().is_some_and(|[x, y, ..]| FLAT_NORMAL.contains(&x) && FLAT_NORMAL.contains(&y));
        Ok((!flat).then_some(texture))
    }

    /// Packs the channels that vary. Constant roughness and metallic become factors; occlusion has no factor, so it
    /// stays in
    /// the texture if it is below 1. With a normal map roughness varies between levels, so the texture holds all of it.
    fn orm(&self, maps: &[Option<OneChannel>; 3], normals: Option<&Normals>, roughness: [f32; 2]) -> TextureResult {
        let mut made = TextureResult::nothing();
        let channels: [Option<Cow<'_, Channel>>; 3] =
            maps.each_ref().map(|map| map.as_ref().and_then(|map| self.channel(map, &mut made.problems)));
        let channels = channels.each_ref().map(Option::as_deref);
        made.read = channels.map(|channel| channel.is_some());
        let constants = channels.map(|channel| channel.and_then(Channel::constant));
        let darkens = constants[0].is_some_and(|occlusion| occlusion < 255);
        let varies = |i: usize| channels[i].filter(|_| constants[i].is_none() || (i == 0 && darkens));
        let varying = [varies(0), varies(1), varies(2)];
        let names = maps.iter().zip(&varying).filter_map(|(map, varies)| map.as_ref().filter(|_| varies.is_some()));
        let name = names.map(|map| file::short_name(&map.path)).collect::<Vec<_>>().join("+");
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

    fn load(&self, path: &Path, encoding: Encoding) -> Result<Texture, String> {
        self.report.time("decode", || Texture::load(path, encoding)).map_err(|error| error.to_string())
    }

    fn channel(&self, map: &OneChannel, problems: &mut Vec<(PathBuf, String)>) -> Option<Cow<'_, Channel>> {
        let load = || {
            let loaded = self.report.time("decode", || Channel::load(&map.path, map.pick));
            loaded.map_err(|error| error.to_string())
        };
        let loaded = match self.shared.get(map) {
            Some(once) => once.get_or_init(load).as_ref().map(Cow::Borrowed).map_err(String::clone),
            None => load().map(Cow::Owned),
        };
        loaded.map_err(|problem| problems.push((map.path.clone(), problem))).ok()
    }
}

impl Normals {
    fn path(&self) -> &PathBuf {
        match self {
            Self::Map(path) | Self::Bump(path, _) => path,
        }
    }

    fn strength(&self) -> Option<u32> {
        match self {
            Self::Map(_) => None,
            Self::Bump(_, strength) => Some(*strength),
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

fn files(task: &TextureTask) -> Vec<&PathBuf> {
    match task {
        TextureTask::BaseColor { colour, mask } => colour.iter().chain(mask.iter().map(|mask| &mask.path)).collect(),
        TextureTask::Normal(normals) => vec![normals.path()],
        TextureTask::Orm { maps, normals, .. } => {
            maps.iter().flatten().map(|map| &map.path).chain(normals.as_ref().map(Normals::path)).collect()
        }
    }
}

fn scalars(task: &TextureTask) -> Vec<OneChannel> {
    match task {
        TextureTask::BaseColor { mask, .. } => mask.iter().cloned().collect(),
        TextureTask::Normal(_) => Vec::new(),
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
    facts.extend([made.cutout, made.holds_roughness, made.texture.is_some()].map(u8::from));
    facts.extend(made.ranges.as_flattened());
    entry.key_values.insert(FACTS.into(), facts);
    entry
}

/// Factor; cutout, holds roughness, has a texture; ranges.
type Facts = ([f32; 3], [bool; 3], [[u8; 2]; 3]);

fn facts(entry: &Ktx2) -> Option<Facts> {
    let facts: &[u8; 21] = entry.key_values.get(FACTS)?.as_slice().try_into().ok()?;
    let factor = [0, 4, 8].map(|at| f32::from_le_bytes([facts[at], facts[at + 1], facts[at + 2], facts[at + 3]]));
    let ranges = [15, 17, 19].map(|at| [facts[at], facts[at + 1]]);
    Some((factor, [12, 13, 14].map(|at| facts[at] == 1), ranges))
}

/// The result that [`to_entry`] stored; only tasks without problems are stored.
fn from_entry(entry: Ktx2, task: &TextureTask) -> Option<TextureResult> {
    let (factor, [cutout, holds_roughness, has_texture], ranges) = facts(&entry)?;
    let texture = if has_texture { Some(MipChain::from_ktx2(entry)?) } else { None };
    let read = match task {
        TextureTask::BaseColor { colour, .. } => [colour.is_some(); 3],
        TextureTask::Normal(_) => [true; 3],
        TextureTask::Orm { maps, .. } => maps.each_ref().map(Option::is_some),
    };
    Some(TextureResult { texture, factor: factor.into(), ranges, cutout, holds_roughness, read, problems: Vec::new() })
}
