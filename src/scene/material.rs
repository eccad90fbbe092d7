//! Materials as MTL files write them, to materials as the renderer draws them: factors, packed maps, nothing constant.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::Material;
use super::maps::{ALPHA_CUTOFF, Made, Normals, Pictures, TextureTask};
use crate::asset::mtl::{Map, Mtl};
use crate::asset::{MipChain, Report, TextureOptions, file};

/// For materials that say nothing of it: neither mirror nor chalk.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// What stands in for a material that a model names and nothing defines: grey, dielectric, half rough.
pub fn default_material() -> Material {
    Material::plain("default", Vec3::splat(0.8), 0.0, DEFAULT_ROUGHNESS)
}

impl Material {
    /// The same all over.
    pub fn plain(name: &str, albedo: Vec3, metallic: f32, roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color_factor: albedo,
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
/// Metallic and roughness are factor times map, the factor 1 where only the map is given. Where neither is, metallic
/// is 0, and roughness comes from the Phong keys: 1 without a highlight (`Ks` 0), else from `Ns`
/// by alpha² = 2/(Ns + 2) (Walter et al. 2007, section 5.2), else 0.5. Occlusion is `map_ao`, else `map_Ka`, unless that
/// repeats `map_Kd`, as the Phong model's ambient colour did. Cutouts come from `map_d`, else from alpha of `map_Kd`.
/// A texture that is absent or broken is left out with a warning that names file and key.
pub fn build(mtls: &[Mtl], options: &TextureOptions, report: &Report) -> (Vec<Material>, Vec<MipChain>) {
    let mut told = HashSet::new();
    let plans: Vec<Plan> = mtls.iter().map(|mtl| Plan::new(mtl, &mut told, report)).collect();
    let jobs: BTreeSet<_> = plans.iter().flat_map(Plan::jobs).collect();
    let pictures = Pictures::new(&jobs, options, report);
    let progress = report.stage("textures", jobs.len() as u64);
    let made: Vec<_> = jobs
        .into_par_iter()
        .map(|job| {
            let made = pictures.make(&job);
            progress.inc(1);
            (job, made)
        })
        .collect();
    progress.finish_and_clear();
    let mut textures = Vec::new();
    let results: HashMap<TextureTask, Ready> =
        made.into_iter().map(|(job, made)| (job, Ready::new(made, &mut textures))).collect();
    (plans.iter().map(|plan| plan.material(&results, report)).collect(), textures)
}

/// What a job came to, with its texture among the scene's.
struct Ready {
    texture: Option<usize>,
    made: Made,
}

impl Ready {
    fn new(mut made: Made, textures: &mut Vec<MipChain>) -> Self {
        let texture = made.texture.take().map(|texture| {
            textures.push(texture);
            textures.len() - 1
        });
        Self { texture, made }
    }
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

    fn albedo_job(&self) -> Option<TextureTask> {
        let (colour, mask) = (path(&self.albedo), path(&self.mask));
        (colour.is_some() || mask.is_some()).then_some(TextureTask::Albedo { colour, mask })
    }

    fn normals(&self) -> Option<Normals> {
        let bump = |source: &Source| Normals::Bump(source.path.clone(), source.map.bump_strength.to_bits());
        let norm = self.norm.as_ref().map(|source| Normals::Map(source.path.clone()));
        norm.or_else(|| self.bump.as_ref().map(bump))
    }

    /// The roughness that the map is multiplied by, and what stands for it where it is absent or broken, are a part of it.
    fn surface_job(&self) -> Option<TextureTask> {
        let maps = self.surface.each_ref().map(path);
        let normals = self.normals();
        let roughness = [true, false].map(|has_map| roughness_factor(self.mtl, has_map).to_bits());
        (maps.iter().any(Option::is_some) || normals.is_some()).then_some(TextureTask::Surface {
            maps,
            normals,
            roughness,
        })
    }

    fn jobs(&self) -> impl Iterator<Item = TextureTask> {
        [self.albedo_job(), self.normals().map(TextureTask::Normal), self.surface_job()].into_iter().flatten()
    }

    fn material(&self, results: &HashMap<TextureTask, Ready>, report: &Report) -> Material {
        let ready = |job: Option<TextureTask>| results.get(&job?);
        let albedo = ready(self.albedo_job());
        let normal = ready(self.normals().map(TextureTask::Normal));
        let surface = ready(self.surface_job());
        let normal_source = if self.norm.is_some() { &self.norm } else { &self.bump };
        for (ready, sources) in [(albedo, [&self.albedo, &self.mask].as_slice()), (normal, &[normal_source])] {
            warn_unusable(self.mtl, ready, sources, report);
        }
        warn_unusable(self.mtl, surface, &self.surface.each_ref(), report);
        warn_of_the_unmodelled(self.mtl, report);
        let is_read = |i: usize| surface.is_some_and(|surface| surface.made.read[i]);
        let has_colour = albedo.is_some_and(|albedo| albedo.made.read[0]);
        let factor = |ready: Option<&Ready>| ready.map_or(Vec3::ONE, |ready| ready.made.factor);
        let ranges =
            surface.map_or([[1.0; 2]; 3], |surface| surface.made.ranges.map(|r| r.map(|v| f32::from(v) / 255.0)));
        let own_roughness = roughness_factor(self.mtl, is_read(1));
        let roughness = own_roughness * factor(surface).y;
        let metallic = metallic_factor(self.mtl, is_read(2));
        Material {
            name: self.mtl.name.clone(),
            base_color_factor: base_color_factor(self.mtl, has_colour, report) * factor(albedo),
            metallic_factor: metallic * factor(surface).z,
            // A map that is widened where normals lose detail holds all of the roughness.
            roughness_factor: if surface.is_some_and(|s| s.made.holds_roughness) { 1.0 } else { roughness },
            base_color_map: albedo.and_then(|albedo| albedo.texture),
            normal_map: normal.and_then(|normal| normal.texture),
            orm_map: surface.and_then(|surface| surface.texture),
            metallic_range: ranges[2].map(|value| value * metallic),
            roughness_range: ranges[1].map(|value| value * own_roughness),
            occludes: ranges[0][0] < 1.0,
            alpha_cutoff: albedo.is_some_and(|albedo| albedo.made.cutout).then_some(ALPHA_CUTOFF),
        }
    }
}

fn path(source: &Option<Source>) -> Option<PathBuf> {
    source.as_ref().map(|source| source.path.clone())
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

/// Tells of each of a job's files that could not be read.
fn warn_unusable(mtl: &Mtl, ready: Option<&Ready>, sources: &[&Option<Source>], report: &Report) {
    for source in sources.iter().copied().flatten() {
        let problems = ready.iter().flat_map(|ready| &ready.made.problems);
        if let Some((_, problem)) = problems.into_iter().find(|(path, _)| *path == source.path) {
            report.warn(format!("{}: {problem}; using the factor alone", place(mtl, source.map)));
        }
    }
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

fn base_color_factor(mtl: &Mtl, has_map: bool, report: &Report) -> Vec3 {
    let Some(kd) = mtl.kd.map(Vec3::from_array) else {
        return if has_map { Vec3::ONE } else { default_material().base_color_factor };
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
