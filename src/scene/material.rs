//! From MTL materials to metallic–roughness materials with factors and packed maps; constant maps become factors.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::Material;
use super::maps::{ALPHA_CUTOFF, Normals, OneChannel, Pictures, TextureResult, TextureTask};
use crate::asset::mtl::{Map, Mtl};
use crate::asset::texture::Pick;
use crate::asset::{MipChain, Report, TextureOptions, file};

/// Roughness of materials without any key for it.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// The material of submeshes whose material is not defined: grey, dielectric, half rough.
pub fn default_material() -> Material {
    Material::plain("default", Vec3::splat(0.8), 0.0, DEFAULT_ROUGHNESS)
}

impl Material {
    /// A material without maps.
    pub fn plain(name: &str, base_color: Vec3, metallic: f32, roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color_factor: base_color,
            metallic_factor: metallic,
            roughness_factor: roughness,
            base_color_map: None,
            normal_map: None,
            orm_map: None,
            metallic_range: [metallic; 2],
            roughness_range: [roughness; 2],
            occludes: false,
            alpha_cutoff: None,
        }
    }
}

/// One material for each of `mtls`, and the textures they share.
///
/// Metallic and roughness are factor times map, the factor 1 where only the map is given. Where neither is, metallic is
/// 0, and roughness comes from the Phong keys: 1 without a highlight (`Ks` 0), else from `Ns` by alpha² = 2/(Ns + 2)
/// (Walter et al. 2007, section 5.2), else 0.5. In Blender's files `Ns` is 1000 (1 − roughness)², and `Ka` is metalness
/// where `illum` is 3. Occlusion is `map_ao`, else `map_Ka`, unless that repeats `map_Kd`, as
/// the Phong model's ambient colour did. Cutouts come from `map_d`, else from alpha of `map_Kd`. A texture that is
/// absent or broken is left out with a warning that names file and key.
pub fn build(mtls: &[Mtl], options: &TextureOptions, report: &Report) -> (Vec<Material>, Vec<MipChain>) {
    let mut warned = HashSet::new();
    let plans: Vec<Plan> = mtls.iter().map(|mtl| Plan::new(mtl, &mut warned, report)).collect();
    let tasks: BTreeSet<_> = plans.iter().flat_map(Plan::tasks).collect();
    let pictures = Pictures::new(&tasks, options, report);
    let progress = report.progress("textures", tasks.len() as u64);
    let made: Vec<_> = tasks
        .into_par_iter()
        .map(|task| {
            let made = pictures.make(&task);
            progress.inc(1);
            (task, made)
        })
        .collect();
    progress.finish_and_clear();
    let mut textures = Vec::new();
    let results: HashMap<TextureTask, IndexedResult> =
        made.into_iter().map(|(task, made)| (task, IndexedResult::new(made, &mut textures))).collect();
    (plans.iter().map(|plan| plan.material(&results, report)).collect(), textures)
}

/// The result of a task, with its texture moved to the scene's list.
struct IndexedResult {
    texture: Option<usize>,
    result: TextureResult,
}

impl IndexedResult {
    fn new(mut result: TextureResult, textures: &mut Vec<MipChain>) -> Self {
        let texture = result.texture.take().map(|texture| {
            textures.push(texture);
            textures.len() - 1
        });
        Self { texture, result }
    }
}

/// A material with the files of its maps.
struct Plan<'a> {
    mtl: &'a Mtl,
    base_color: Option<MapFile<'a>>,
    mask: Option<MapFile<'a>>,
    norm: Option<MapFile<'a>>,
    bump: Option<MapFile<'a>>,
    orm: [Option<MapFile<'a>>; 3],
}

/// A map and its file.
struct MapFile<'a> {
    map: &'a Map,
    path: PathBuf,
}

impl<'a> Plan<'a> {
    fn new(mtl: &'a Mtl, warned: &mut HashSet<(PathBuf, String)>, report: &Report) -> Self {
        let mut find = |map: &'a Option<Map>| map.as_ref().and_then(|map| find(mtl, map, warned, report));
        let same_file = |a: &Map| mtl.map_kd.as_ref().is_some_and(|kd| kd.file.eq_ignore_ascii_case(&a.file));
        let occlusion = match (&mtl.map_ao, &mtl.map_ka) {
            (None, Some(ambient)) if same_file(ambient) => &None,
            (None, ambient) => ambient,
            (occlusion, _) => occlusion,
        };
        let norm = find(&mtl.norm);
        Self {
            mtl,
            base_color: find(&mtl.map_kd),
            mask: find(&mtl.map_d),
            bump: if norm.is_some() { None } else { find(&mtl.bump) },
            norm,
            orm: [find(occlusion), find(&mtl.map_roughness), find(&mtl.map_metallic)],
        }
    }

    fn base_color_task(&self) -> Option<TextureTask> {
        let colour = path(&self.base_color);
        // A picture that is a mask, too, is so by its alpha alone.
        let pick = if colour == path(&self.mask) { Pick::Alpha } else { Pick::Coverage };
        let mask = one_channel(&self.mask, pick);
        (colour.is_some() || mask.is_some()).then_some(TextureTask::BaseColor { colour, mask })
    }

    fn normals(&self) -> Option<Normals> {
        let bump = |file: &MapFile| Normals::Bump(file.path.clone(), file.map.bump_strength.to_bits());
        let norm = self.norm.as_ref().map(|file| Normals::Map(file.path.clone()));
        norm.or_else(|| self.bump.as_ref().map(bump))
    }

    /// Includes the roughness factor with the map, and the one for when the map is absent or broken.
    fn orm_task(&self) -> Option<TextureTask> {
        let maps = self.orm.each_ref().map(|file| one_channel(file, Pick::Red));
        let normals = self.normals();
        let unheard = Report::silent();
        let roughness = [true, false].map(|has_map| roughness_factor(self.mtl, has_map, &unheard).to_bits());
        (maps.iter().any(Option::is_some) || normals.is_some()).then_some(TextureTask::Orm { maps, normals, roughness })
    }

    fn tasks(&self) -> impl Iterator<Item = TextureTask> {
        [self.base_color_task(), self.normals().map(TextureTask::Normal), self.orm_task()].into_iter().flatten()
    }

    fn material(&self, results: &HashMap<TextureTask, IndexedResult>, report: &Report) -> Material {
        let result_of = |task: Option<TextureTask>| results.get(&task?);
        let base_color = result_of(self.base_color_task());
        let normal = result_of(self.normals().map(TextureTask::Normal));
        let orm = result_of(self.orm_task());
        let normal_file = if self.norm.is_some() { &self.norm } else { &self.bump };
        for (result, files) in [(base_color, [&self.base_color, &self.mask].as_slice()), (normal, &[normal_file])] {
            warn_unusable(self.mtl, result, files, report);
        }
        warn_unusable(self.mtl, orm, &self.orm.each_ref(), report);
        warn_of_unsupported(self.mtl, report);
        let is_read = |i: usize| orm.is_some_and(|o| o.result.read[i]);
        let has_colour = base_color.is_some_and(|b| b.result.read[0]);
        let factor = |result: Option<&IndexedResult>| result.map_or(Vec3::ONE, |result| result.result.factor);
        let ranges = orm.map_or([[1.0; 2]; 3], |o| o.result.ranges.map(|r| r.map(|v| f32::from(v) / 255.0)));
        let own_roughness = roughness_factor(self.mtl, is_read(1), report);
        let roughness = own_roughness * factor(orm).y;
        let metallic = metallic_factor(self.mtl, is_read(2), report);
        Material {
            name: self.mtl.name.clone(),
            base_color_factor: base_color_factor(self.mtl, has_colour, report) * factor(base_color),
            metallic_factor: metallic * factor(orm).z,
            // A map that is widened where normals lose detail includes the factor.
            roughness_factor: if orm.is_some_and(|o| o.result.holds_roughness) { 1.0 } else { roughness },
            base_color_map: base_color.and_then(|b| b.texture),
            normal_map: normal.and_then(|normal| normal.texture),
            orm_map: orm.and_then(|o| o.texture),
            metallic_range: ranges[2].map(|value| value * metallic),
            roughness_range: ranges[1].map(|value| value * own_roughness),
            occludes: ranges[0][0] < 1.0,
            alpha_cutoff: base_color.is_some_and(|b| b.result.cutout).then_some(ALPHA_CUTOFF),
        }
    }
}

fn path(file: &Option<MapFile>) -> Option<PathBuf> {
    file.as_ref().map(|file| file.path.clone())
}

/// The channel that a map names, or else `pick`.
fn one_channel(file: &Option<MapFile>, pick: Pick) -> Option<OneChannel> {
    file.as_ref().map(|file| OneChannel { path: file.path.clone(), pick: file.map.pick.unwrap_or(pick) })
}

fn place(mtl: &Mtl, map: &Map) -> String {
    format!("{}:{}: {} {}", file::short_name(&mtl.path), map.line, map.key, map.file)
}

/// The map's file. Each name is warned of once: `warned` holds those of before.
fn find<'a>(mtl: &Mtl, map: &'a Map, warned: &mut HashSet<(PathBuf, String)>, report: &Report) -> Option<MapFile<'a>> {
    let folder = mtl.path.parent().unwrap_or(Path::new(""));
    let found = file::find(folder, &map.file);
    let mut warn = |message: String| {
        if warned.insert((mtl.path.clone(), map.file.clone())) {
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
    Some(MapFile { map, path: found.path })
}

/// Warns of each of a task's files that could not be read.
fn warn_unusable(mtl: &Mtl, result: Option<&IndexedResult>, files: &[&Option<MapFile>], report: &Report) {
    for file in files.iter().copied().flatten() {
        let problems = result.iter().flat_map(|result| &result.result.problems);
        if let Some((_, problem)) = problems.into_iter().find(|(path, _)| *path == file.path) {
            report.warn(format!("{}: {problem}; using the factor alone", place(mtl, file.map)));
        }
    }
}

fn warn_of_unsupported(mtl: &Mtl, report: &Report) {
    if let Some(dissolve) = mtl.dissolve.filter(|d| *d < 1.0 && mtl.map_d.is_none()) {
        warn_of(mtl, &format!("d {dissolve}: transparency is not supported; drawn opaque"), report);
    }
    if mtl.ke.is_some_and(|ke| ke != [0.0; 3]) {
        warn_of(mtl, "Ke: emission is not supported; ignored", report);
    }
}

fn base_color_factor(mtl: &Mtl, has_map: bool, report: &Report) -> Vec3 {
    let Some(kd) = mtl.kd.map(Vec3::from_array) else {
        return if has_map { Vec3::ONE } else { default_material().base_color_factor };
    };
    // Some exporters write 0 with a map; the product would be black.
    if has_map && kd == Vec3::ZERO {
        warn_of(mtl, "Kd 0 with map_Kd; taken as 1", report);
        return Vec3::ONE;
    }
    let clamped = kd.clamp(Vec3::ZERO, Vec3::ONE);
    if clamped != kd {
        warn_of(mtl, &format!("Kd {} {} {} is not between 0 and 1; clamped", kd.x, kd.y, kd.z), report);
    }
    clamped
}

fn metallic_factor(mtl: &Mtl, has_map: bool, report: &Report) -> f32 {
    // Of Blender's illumination models this one mirrors.
    let blenders = mtl.ka.filter(|_| mtl.by_blender && mtl.illum == Some(3)).map(|[r, ..]| r);
    factor(mtl, ("Pm", mtl.metallic), has_map, blenders.unwrap_or(0.0), report)
}

fn roughness_factor(mtl: &Mtl, has_map: bool, report: &Report) -> f32 {
    let phong = match (mtl.ks, mtl.ns) {
        (_, Some(ns)) if mtl.by_blender => 1.0 - (ns / 1000.0).max(0.0).sqrt(),
        (Some(ks), _) if ks == [0.0; 3] => 1.0,
        (_, Some(ns)) => (2.0 / (ns.max(0.0) + 2.0)).powf(0.25),
        _ => DEFAULT_ROUGHNESS,
    };
    factor(mtl, ("Pr", mtl.roughness), has_map, phong, report)
}

/// What a key says, in 0 to 1; where it is absent `otherwise`, or with a map 1.
fn factor(mtl: &Mtl, (key, value): (&str, Option<f32>), has_map: bool, otherwise: f32, report: &Report) -> f32 {
    match value {
        // Some exporters write 0 with a map; the product would be 0 everywhere.
        Some(0.0) if has_map => {
            warn_of(mtl, &format!("{key} 0 with map_{key}; taken as 1"), report);
            1.0
        }
        Some(value) if !(0.0..=1.0).contains(&value) => {
            warn_of(mtl, &format!("{key} {value} is not between 0 and 1; clamped"), report);
            value.clamp(0.0, 1.0)
        }
        Some(value) => value,
        None if has_map => 1.0,
        None => otherwise.clamp(0.0, 1.0),
    }
}

fn warn_of(mtl: &Mtl, problem: &str, report: &Report) {
    report.warn(format!("{}: material {}: {problem}", file::short_name(&mtl.path), mtl.name));
}

#[cfg(test)]
#[path = "material_tests.rs"]
mod tests;
