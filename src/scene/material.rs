//! Materials as MTL files write them, to materials as the renderer draws them: factors, packed maps, nothing constant.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::Material;
use crate::asset::mtl::{Map, Mtl};
use crate::asset::texture::{Channel, Encoding};
use crate::asset::{Report, Texture, file};
use crate::{Error, Result};

/// Fragments with less alpha than this are not there.
const ALPHA_CUTOFF: f32 = 0.5;
/// For materials that say nothing of it: neither mirror nor chalk.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// A normal map whose every x and y is within one step of 128 bends nothing.
const FLAT_NORMAL: std::ops::RangeInclusive<u8> = 127..=129;

/// Of a map that speaks of something else.
const NO_RANGES: [[f32; 2]; 3] = [[1.0; 2]; 3];

/// What stands in for a material that a model names and nothing defines: grey, dielectric, half rough.
pub fn default_material() -> Material {
    Material {
        name: "default".into(),
        albedo_factor: Vec3::splat(0.8),
        metallic_factor: 0.0,
        roughness_factor: DEFAULT_ROUGHNESS,
        albedo_map: None,
        normal_map: None,
        surface_map: None,
        metallic_range: [0.0; 2],
        roughness_range: [DEFAULT_ROUGHNESS; 2],
        occludes: false,
        alpha_cutoff: None,
    }
}

/// One material for each of `mtls`, and the textures they share.
///
/// Metallic and roughness are factor times map, the factor 1 where only the map is given. Where neither is, metallic
/// is 0, and roughness comes from the Phong keys: 1 without a highlight (`Ks` 0), else from `Ns`
/// by alpha² = 2/(Ns + 2) (Walter et al. 2007, section 5.2), else 0.5. Occlusion is `map_ao`, else `map_Ka`, unless that
/// repeats `map_Kd`, as the Phong model's ambient colour did. Cutouts come from `map_d`, else from alpha of `map_Kd`.
/// A texture that is absent or broken is left out with a warning that names file and key.
pub fn build(mtls: &[Mtl], report: &Report) -> (Vec<Material>, Vec<Texture>) {
    let mut told = HashSet::new();
    let plans: Vec<Plan> = mtls.iter().map(|mtl| Plan::new(mtl, &mut told, report)).collect();
    let scalar_files: BTreeSet<_> = plans.iter().flat_map(Plan::scalar_files).collect();
    let jobs: BTreeSet<_> = plans.iter().flat_map(Plan::jobs).collect();
    let progress = report.stage("textures", (scalar_files.len() + jobs.len()) as u64);
    let scalars: Scalars = scalar_files
        .into_par_iter()
        .map(|(path, kind)| {
            let channel = if kind == Kind::Mask { Channel::load_mask(&path) } else { Channel::load(&path) };
            progress.inc(1);
            ((path, kind), channel)
        })
        .collect();
    let made: Vec<_> = jobs
        .into_par_iter()
        .map(|job| {
            let made = job.run(&scalars);
            progress.inc(1);
            (job, made)
        })
        .collect();
    progress.finish_and_clear();
    let mut textures = Vec::new();
    let results: HashMap<Job, Result<Ready>> =
        made.into_iter().map(|(job, made)| (job, made.map(|made| made.store(&mut textures)))).collect();
    (plans.iter().map(|plan| plan.material(&results, &scalars, report)).collect(), textures)
}

/// What a picture of which one channel counts is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Kind {
    Red,
    Mask,
}

type Scalars = HashMap<(PathBuf, Kind), Result<Channel>>;

/// A texture of the scene that is to be made; equal jobs are done once.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Job {
    Albedo {
        colour: Option<PathBuf>,
        mask: Option<PathBuf>,
    },
    /// A certain normal map.
    Normal(PathBuf),
    /// Bits of the strength, so that it can be compared.
    Bump(PathBuf, u32),
    /// Occlusion, roughness, metallic.
    Surface([Option<PathBuf>; 3]),
}

/// What a job comes to: a texture, or what it would say everywhere, or both.
struct Made {
    texture: Option<Texture>,
    /// Albedo (linear), or occlusion, roughness, metallic: 1 where the texture says it.
    factor: Vec3,
    /// Least and most of a surface's occlusion, roughness and metallic, whoever says them.
    ranges: [[f32; 2]; 3],
    cutout: bool,
}

/// The same, with its texture among the scene's.
struct Ready {
    texture: Option<usize>,
    factor: Vec3,
    ranges: [[f32; 2]; 3],
    cutout: bool,
}

impl Made {
    fn store(self, textures: &mut Vec<Texture>) -> Ready {
        let texture = self.texture.map(|texture| {
            textures.push(texture);
            textures.len() - 1
        });
        Ready { texture, factor: self.factor, ranges: self.ranges, cutout: self.cutout }
    }
}

impl Job {
    fn run(&self, scalars: &Scalars) -> Result<Made> {
        match self {
            Self::Albedo { colour, mask } => {
                let mask = mask.as_ref().and_then(|path| scalar(scalars, path, Kind::Mask));
                albedo(colour.as_deref(), mask.filter(|mask| mask.cuts_out()))
            }
            Self::Normal(path) => normal(Texture::load(path, Encoding::Normal)?),
            Self::Bump(path, strength) => {
                normal(Texture::load(path, Encoding::Linear)?.into_normal_map(f32::from_bits(*strength)))
            }
            Self::Surface(paths) => Ok(surface(
                paths.each_ref().map(|path| path.as_ref().and_then(|p| Some((p, scalar(scalars, p, Kind::Red)?)))),
            )),
        }
    }
}

fn scalar<'a>(scalars: &'a Scalars, path: &Path, kind: Kind) -> Option<&'a Channel> {
    scalars.get(&(path.to_owned(), kind))?.as_ref().ok()
}

fn albedo(path: Option<&Path>, mask: Option<&Channel>) -> Result<Made> {
    let Some(path) = path else {
        return Ok(Made { texture: mask.map(white), factor: Vec3::ONE, ranges: NO_RANGES, cutout: mask.is_some() });
    };
    let mut texture = Texture::load(path, Encoding::Srgb)?;
    let own_alpha = texture.channel(3);
    let cutout = mask.is_some() || own_alpha.cuts_out();
    if !cutout {
        texture.clear_alpha();
    }
    if let Some(colour) = texture.constant_colour() {
        let factor = Vec3::from_array(colour.map(srgb_to_linear));
        let mask = mask.or(cutout.then_some(&own_alpha));
        return Ok(Made { texture: mask.map(white), factor, ranges: NO_RANGES, cutout });
    }
    if let Some(mask) = mask {
        texture.set_alpha(mask);
    }
    Ok(Made { texture: Some(texture), factor: Vec3::ONE, ranges: NO_RANGES, cutout })
}

/// White where `mask` lets it be.
fn white(mask: &Channel) -> Texture {
    let pixels = mask.values.iter().flat_map(|alpha| [255, 255, 255, *alpha]).collect();
    Texture { name: "mask".into(), width: mask.width, height: mask.height, encoding: Encoding::Srgb, pixels }
}

fn normal(mut texture: Texture) -> Result<Made> {
    texture.clear_alpha();
    let flat = texture.constant().is_some_and(|[x, y, ..]| FLAT_NORMAL.contains(&x) && FLAT_NORMAL.contains(&y));
    Ok(Made { texture: (!flat).then_some(texture), factor: Vec3::ONE, ranges: NO_RANGES, cutout: false })
}

/// Packs what varies. Constant roughness and metallic become factors; occlusion has none, so if it darkens, it stays.
fn surface(maps: [Option<(&PathBuf, &Channel)>; 3]) -> Made {
    let constants = maps.map(|map| map.and_then(|(_, channel)| channel.constant()));
    let darkens = constants[0].is_some_and(|occlusion| occlusion < 255);
    let varies = |i: usize| maps[i].filter(|_| constants[i].is_none() || (i == 0 && darkens));
    let varying = [varies(0), varies(1), varies(2)];
    let names: Vec<_> = varying.iter().flatten().map(|(path, _)| file::short_name(path)).collect();
    let texture = Texture::packed(names.join("+"), varying.map(|map| map.map(|(_, channel)| channel)));
    let factor = |i: usize| constants[i].map_or(1.0, |value| f32::from(value) / 255.0);
    let range = |map: Option<(&PathBuf, &Channel)>| {
        let (least, most) = map.and_then(|(_, channel)| channel.range()).unwrap_or((255, 255));
        [least, most].map(|value| f32::from(value) / 255.0)
    };
    // A constant is taken for its factor, which may lie a rounding above some texels.
    let ranges = std::array::from_fn(|i| constants[i].map_or(range(maps[i]), |value| [f32::from(value) / 255.0; 2]));
    Made { texture, factor: Vec3::new(1.0, factor(1), factor(2)), ranges, cutout: false }
}

/// IEC 61966-2-1.
fn srgb_to_linear(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// One material's maps, found on disk.
struct Plan<'a> {
    mtl: &'a Mtl,
    albedo: Option<Source<'a>>,
    mask: Option<Source<'a>>,
    norm: Option<Source<'a>>,
    bump: Option<Source<'a>>,
    surface: [Option<Source<'a>>; 3],
}

/// A map and its file.
struct Source<'a> {
    map: &'a Map,
    path: PathBuf,
}

impl<'a> Plan<'a> {
    fn new(mtl: &'a Mtl, told: &mut HashSet<(PathBuf, String)>, report: &Report) -> Self {
        let mut find = |map: &'a Option<Map>| map.as_ref().and_then(|map| find(mtl, map, told, report));
        let same_file = |a: &Map| mtl.map_kd.as_ref().is_some_and(|kd| kd.file.eq_ignore_ascii_case(&a.file));
        let occlusion = match (&mtl.map_ao, &mtl.map_ka) {
            (None, Some(ambient)) if same_file(ambient) => &None,
            (None, ambient) => ambient,
            (occlusion, _) => occlusion,
        };
        let norm = find(&mtl.norm);
        Self {
            mtl,
            albedo: find(&mtl.map_kd),
            mask: find(&mtl.map_d),
            bump: if norm.is_some() { None } else { find(&mtl.bump) },
            norm,
            surface: [find(occlusion), find(&mtl.map_roughness), find(&mtl.map_metallic)],
        }
    }

    fn scalar_files(&self) -> impl Iterator<Item = (PathBuf, Kind)> {
        let red = self.surface.iter().flatten().map(|source| (source.path.clone(), Kind::Red));
        red.chain(self.mask.iter().map(|source| (source.path.clone(), Kind::Mask)))
    }

    fn albedo_job(&self) -> Option<Job> {
        let path = |source: &Option<Source>| source.as_ref().map(|source| source.path.clone());
        let (colour, mask) = (path(&self.albedo), path(&self.mask));
        (colour.is_some() || mask.is_some()).then_some(Job::Albedo { colour, mask })
    }

    fn normal_job(&self) -> Option<Job> {
        let bump = |source: &Source| Job::Bump(source.path.clone(), source.map.bump_strength.to_bits());
        let norm = self.norm.as_ref().map(|source| Job::Normal(source.path.clone()));
        norm.or_else(|| self.bump.as_ref().map(bump))
    }

    fn surface_job(&self) -> Option<Job> {
        let paths = self.surface.each_ref().map(|source| source.as_ref().map(|source| source.path.clone()));
        paths.iter().any(Option::is_some).then_some(Job::Surface(paths))
    }

    fn jobs(&self) -> impl Iterator<Item = Job> {
        [self.albedo_job(), self.normal_job(), self.surface_job()].into_iter().flatten()
    }

    fn material(&self, results: &HashMap<Job, Result<Ready>>, scalars: &Scalars, report: &Report) -> Material {
        let name = &self.mtl.name;
        let ready = |job: Option<Job>, source: &Option<Source>| match results.get(&job?)? {
            Ok(ready) => Some(ready),
            Err(error) => {
                if let Some(source) = source {
                    warn_unusable(self.mtl, source.map, error, report);
                }
                None
            }
        };
        let albedo = ready(self.albedo_job(), &self.albedo);
        let normal_source = if self.norm.is_some() { &self.norm } else { &self.bump };
        let normal = ready(self.normal_job(), normal_source);
        let surface = ready(self.surface_job(), &None);
        let scalar_sources = self.surface.iter().flatten().map(|s| (s, Kind::Red));
        for (source, kind) in scalar_sources.chain(self.mask.iter().map(|s| (s, Kind::Mask))) {
            if let Some(Err(error)) = scalars.get(&(source.path.clone(), kind)) {
                warn_unusable(self.mtl, source.map, error, report);
            }
        }
        warn_of_the_unmodelled(self.mtl, report);
        let is_read = |source: &Option<Source>| {
            source.as_ref().is_some_and(|source| scalar(scalars, &source.path, Kind::Red).is_some())
        };
        let surface_factor = surface.map_or(Vec3::ONE, |surface| surface.factor);
        let [occlusion_range, roughness_range, metallic_range] = surface.map_or(NO_RANGES, |surface| surface.ranges);
        let roughness = roughness_factor(self.mtl, is_read(&self.surface[1]));
        let metallic = metallic_factor(self.mtl, is_read(&self.surface[2]));
        Material {
            name: name.clone(),
            albedo_factor: albedo_factor(self.mtl, albedo.is_some(), report) * albedo.map_or(Vec3::ONE, |a| a.factor),
            metallic_factor: metallic * surface_factor.z,
            roughness_factor: roughness * surface_factor.y,
            albedo_map: albedo.and_then(|albedo| albedo.texture),
            normal_map: normal.and_then(|normal| normal.texture),
            surface_map: surface.and_then(|surface| surface.texture),
            metallic_range: metallic_range.map(|value| value * metallic),
            roughness_range: roughness_range.map(|value| value * roughness),
            occludes: occlusion_range[0] < 1.0,
            alpha_cutoff: albedo.is_some_and(|albedo| albedo.cutout).then_some(ALPHA_CUTOFF),
        }
    }
}

fn place(mtl: &Mtl, map: &Map) -> String {
    format!("{}:{}: {} {}", file::short_name(&mtl.path), map.line, map.key, map.file)
}

/// The map's file. What was said of a name is put into `told` and not said again.
fn find<'a>(mtl: &Mtl, map: &'a Map, told: &mut HashSet<(PathBuf, String)>, report: &Report) -> Option<Source<'a>> {
    let folder = mtl.path.parent().unwrap_or(Path::new(""));
    let found = file::find(folder, &map.file);
    let mut warn = |message: String| {
        if told.insert((mtl.path.clone(), map.file.clone())) {
            report.warn(message);
        }
    };
    let Some(found) = found else {
        warn(format!("{}: file not found; using the factor alone", place(mtl, map)));
        return None;
    };
    if let Some(real) = found.real_name {
        warn(format!("{}: found as {real}", place(mtl, map)));
    }
    Some(Source { map, path: found.path })
}

fn warn_unusable(mtl: &Mtl, map: &Map, error: &Error, report: &Report) {
    report.warn(format!("{}: {error}; using the factor alone", place(mtl, map)));
}

fn warn_of_the_unmodelled(mtl: &Mtl, report: &Report) {
    let place = format!("{}: material {}", file::short_name(&mtl.path), mtl.name);
    if mtl.dissolve.is_some_and(|d| d < 1.0) && mtl.map_d.is_none() {
        report.warn(format!("{place}: d {}: transparency is not modelled; drawn opaque", mtl.dissolve.unwrap_or(1.0)));
    }
    if mtl.ke.is_some_and(|ke| ke != [0.0; 3]) {
        report.warn(format!("{place}: Ke: emission is not modelled; left out"));
    }
}

fn albedo_factor(mtl: &Mtl, has_map: bool, report: &Report) -> Vec3 {
    let Some(kd) = mtl.kd.map(Vec3::from_array) else {
        return if has_map { Vec3::ONE } else { default_material().albedo_factor };
    };
    let place = format!("{}: material {}", file::short_name(&mtl.path), mtl.name);
    // Some exporters write 0 beside a map, meaning "the map"; a product would be black.
    if has_map && kd == Vec3::ZERO {
        report.warn(format!("{place}: Kd 0 beside map_Kd; taken as 1"));
        return Vec3::ONE;
    }
    let clamped = kd.clamp(Vec3::ZERO, Vec3::ONE);
    if clamped != kd {
        report.warn(format!("{place}: Kd {} {} {} is not between 0 and 1; clamped", kd.x, kd.y, kd.z));
    }
    clamped
}

fn metallic_factor(mtl: &Mtl, has_map: bool) -> f32 {
    mtl.metallic.unwrap_or(if has_map { 1.0 } else { 0.0 }).clamp(0.0, 1.0)
}

fn roughness_factor(mtl: &Mtl, has_map: bool) -> f32 {
    let phong = || match (mtl.ks, mtl.ns) {
        (Some(ks), _) if ks == [0.0; 3] => 1.0,
        (_, Some(ns)) => (2.0 / (ns.max(0.0) + 2.0)).powf(0.25),
        _ => DEFAULT_ROUGHNESS,
    };
    mtl.roughness.unwrap_or_else(|| if has_map { 1.0 } else { phong() }).clamp(0.0, 1.0)
}

#[cfg(test)]
#[path = "material_tests.rs"]
mod tests;
