//! From a model's materials to those of a scene, with factors and packed textures; constant maps become factors.

use std::collections::{BTreeSet, HashMap};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::Material;
use super::contents::{Lookup, MAPS};
use super::maps::{ALPHA_CUTOFF, Alpha, Normals, OneChannel, Pictures, TextureResult, TextureTask};
use crate::asset::image_source::ImageSource;
use crate::asset::material::{
    AlphaUse, DIELECTRIC_F0, DiffuseTransmission, Extension, ExtensionMaps, MapDesc, MaterialDesc, NormalsKind,
    Refraction,
};
use crate::asset::mtl_material::{DEFAULT_GREY, DEFAULT_ROUGHNESS};
use crate::asset::{MipChain, Report, TextureOptions};

/// The material of submeshes whose material is not defined: grey, dielectric, half rough.
pub fn default_material() -> Material {
    Material::plain("default", Vec3::splat(DEFAULT_GREY), 0.0, DEFAULT_ROUGHNESS)
}

impl Material {
    /// A material without maps.
    pub fn plain(name: &str, base_color: Vec3, metallic: f32, roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color_factor: base_color,
            opacity: 1.0,
            metallic_factor: metallic,
            roughness_factor: roughness,
            dielectric_f0: Vec3::splat(DIELECTRIC_F0),
            dielectric_f90: 1.0,
            clearcoat_factor: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_bumps: false,
            film: None,
            anisotropy: Vec2::ZERO,
            sheen_color: Vec3::ZERO,
            sheen_roughness: 1.0,
            diffuse_transmission: None,
            emissive_factor: Vec3::ZERO,
            base_color_map: None,
            normal_map: None,
            orm_map: None,
            emissive_map: None,
            extension_map: None,
            lookups: [Lookup::default(); MAPS],
            metallic_range: [metallic; 2],
            roughness_range: [roughness; 2],
            occludes: false,
            alpha_cutoff: None,
            blends: false,
            culls_backs: false,
            vertex_colours: false,
            transmission: None,
            refraction: None,
            unlit: false,
        }
    }
}

/// One material for each of `descs`, and the textures they share. A texture that is broken is left out with a warning that
/// names file and key.
pub fn build(descs: &[MaterialDesc], options: &TextureOptions, report: &Report) -> (Vec<Material>, Vec<MipChain>) {
    let plans: Vec<Plan> = descs.iter().map(|desc| Plan { desc }).collect();
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

/// The textures of a material.
struct Plan<'a> {
    desc: &'a MaterialDesc,
}

impl Plan<'_> {
    fn base_color_task(&self) -> Option<TextureTask> {
        let colour = image(&self.desc.base_color_map);
        let mask = one_channel(&self.desc.mask_map);
        let alpha = match self.desc.alpha {
            AlphaUse::Guessed => Alpha::Guessed,
            AlphaUse::Opaque | AlphaUse::Opacity => Alpha::Opaque,
            // What is cut out depends on all of the map's alpha.
            AlphaUse::Mask(_) if self.desc.vertex_alpha => Alpha::Blend,
            AlphaUse::Mask(cutoff) => Alpha::Mask(cutoff.to_bits()),
            AlphaUse::Blend => Alpha::Blend,
        };
        (colour.is_some() || mask.is_some()).then_some(TextureTask::BaseColor { colour, mask, alpha })
    }

    fn emissive_task(&self) -> Option<TextureTask> {
        let emits = self.desc.emissive.with_map != Vec3::ZERO;
        let colour = image(&self.desc.emissive_map).filter(|_| emits)?;
        Some(TextureTask::BaseColor { colour: Some(colour), mask: None, alpha: Alpha::Opaque })
    }

    fn extension_task(&self) -> Option<TextureTask> {
        let maps = self.desc.extension_maps.as_ref()?;
        let (colour, mask) = (image(&maps.color), one_channel(&maps.number));
        match maps.of {
            Extension::Anisotropy => colour.map(TextureTask::Anisotropy),
            _ => (colour.is_some() || mask.is_some()).then_some(TextureTask::BaseColor {
                colour,
                // Alpha of the color map is that of its own picture alone where it is the map of the number.
                alpha: if mask.is_some() { Alpha::Blend } else { Alpha::Opaque },
                mask,
            }),
        }
    }

    fn normals(&self) -> Option<Normals> {
        let normals = self.desc.normals.as_ref()?;
        let image = normals.map.image.clone();
        Some(match normals.kind {
            NormalsKind::Vectors(scale) => Normals::Map(image, scale.to_bits()),
            NormalsKind::Bump(strength) => Normals::Bump(image, strength.to_bits()),
        })
    }

    fn orm_maps(&self) -> [&Option<MapDesc>; 4] {
        let desc = self.desc;
        let layer = if desc.clearcoat_map.is_some() { &desc.clearcoat_map } else { &desc.film_map };
        [&desc.occlusion_map, &desc.roughness_map, &desc.metallic_map, layer]
    }

    /// Includes the roughness factor with the map, and the one for when the map is absent or broken.
    fn orm_task(&self) -> Option<TextureTask> {
        let maps = self.orm_maps().map(one_channel);
        let normals = self.normals();
        if maps.iter().all(Option::is_none) && normals.is_none() {
            return None;
        }
        let roughness = [true, false].map(|has_map| self.desc.roughness.of(has_map).to_bits());
        Some(TextureTask::Orm { maps, normals, roughness, strength: self.desc.occlusion_strength.to_bits() })
    }

    fn tasks(&self) -> impl Iterator<Item = TextureTask> {
        let normal = self.normals().map(TextureTask::Normal);
        [self.base_color_task(), normal, self.orm_task(), self.emissive_task(), self.extension_task()]
            .into_iter()
            .flatten()
    }

    fn material(&self, results: &HashMap<TextureTask, IndexedResult>, report: &Report) -> Material {
        let desc = self.desc;
        let result_of = |task: Option<TextureTask>| results.get(&task?);
        let base_color = result_of(self.base_color_task());
        let normal = result_of(self.normals().map(TextureTask::Normal));
        let orm = result_of(self.orm_task());
        let emissive = result_of(self.emissive_task());
        warn_unusable(base_color, [&desc.base_color_map, &desc.mask_map].into_iter().flatten(), report);
        warn_unusable(normal, desc.normals.iter().map(|normals| &normals.map), report);
        warn_unusable(orm, self.orm_maps().into_iter().flatten(), report);
        warn_unusable(emissive, desc.emissive_map.iter(), report);
        let extension = result_of(self.extension_task());
        let extension_of = desc.extension_maps.as_ref().map(|maps| maps.of);
        warn_unusable(extension, desc.extension_maps.iter().flat_map(ExtensionMaps::all), report);
        let factor = |result: Option<&IndexedResult>| result.map_or(Vec3::ONE, |result| result.result.factor);
        // Of a color map that does not vary.
        let extension_factor = |of| if extension_of == Some(of) { factor(extension) } else { Vec3::ONE };
        let is_read = |i: usize| orm.is_some_and(|o| o.result.read[i]);
        let has_colour = |result: Option<&IndexedResult>| result.is_some_and(|r| r.result.read[0]);
        let ranges = orm.map_or([[1.0; 2]; 3], |o| o.result.ranges.map(|r| r.map(|v| f32::from(v) / 255.0)));
        let own_roughness = desc.roughness.of(is_read(1));
        let metallic = desc.metallic.of(is_read(2));
        let uses_alpha = base_color.is_some_and(|b| b.result.uses_alpha);
        // A sheet's map colours what goes through it.
        let map_factor = factor(base_color);
        let map_covers = if desc.transmission.is_some() { Vec3::ONE } else { map_factor };
        Material {
            name: desc.name.clone(),
            base_color_factor: desc.base_color.of(has_colour(base_color)) * map_covers,
            opacity: if desc.alpha.blends() { desc.opacity } else { 1.0 },
            metallic_factor: metallic * factor(orm).z,
            // A map that is widened where normals lose detail includes the factor.
            roughness_factor: match orm {
                Some(orm) if orm.result.holds_roughness => 1.0,
                _ => own_roughness * factor(orm).y,
            },
            dielectric_f0: desc.dielectric_f0 * extension_factor(Extension::Specular),
            dielectric_f90: desc.dielectric_f90,
            clearcoat_factor: desc.clearcoat,
            clearcoat_roughness: desc.clearcoat_roughness,
            clearcoat_bumps: desc.clearcoat_bumps,
            film: desc.film,
            anisotropy: desc.anisotropy,
            sheen_color: desc.sheen * extension_factor(Extension::Sheen),
            sheen_roughness: desc.sheen_roughness,
            diffuse_transmission: desc.diffuse_transmission.map(|through| DiffuseTransmission {
                color: through.color * extension_factor(Extension::DiffuseTransmission),
                ..through
            }),
            emissive_factor: desc.emissive.of(has_colour(emissive)) * factor(emissive),
            base_color_map: base_color.and_then(|b| b.texture),
            normal_map: normal.and_then(|normal| normal.texture),
            orm_map: orm.and_then(|o| o.texture),
            emissive_map: emissive.and_then(|e| e.texture),
            extension_map: extension_of.zip(extension.and_then(|e| e.texture)),
            lookups: self.lookups(),
            metallic_range: ranges[2].map(|value| value * metallic),
            roughness_range: with_clearcoat(desc, ranges[1].map(|value| value * own_roughness)),
            occludes: ranges[0][0] < 1.0,
            // Above 1 all of it is a hole.
            alpha_cutoff: self.alpha_cutoff().filter(|cutoff| uses_alpha || desc.vertex_alpha || *cutoff > 1.0),
            blends: desc.alpha.blends() && (uses_alpha || desc.vertex_alpha || desc.opacity < 1.0),
            culls_backs: desc.culls_backs,
            vertex_colours: false,
            transmission: desc.transmission.map(|color| color * map_factor),
            refraction: desc.refraction.map(|refraction| Refraction {
                surface_transmission: refraction.surface_transmission * map_factor,
                ..refraction
            }),
            unlit: desc.unlit,
        }
    }

    fn alpha_cutoff(&self) -> Option<f32> {
        match self.desc.alpha {
            AlphaUse::Guessed => Some(ALPHA_CUTOFF),
            AlphaUse::Mask(cutoff) => Some(cutoff),
            AlphaUse::Opaque | AlphaUse::Blend | AlphaUse::Opacity => None,
        }
    }

    /// Maps that share a texture are looked up as the first of them.
    fn lookups(&self) -> [Lookup; MAPS] {
        let desc = self.desc;
        let normal = desc.normals.as_ref().map(|normals| &normals.map);
        let [occlusion, roughness, metallic, layer] = self.orm_maps();
        let orm = [roughness, metallic, occlusion, layer].into_iter().flatten().next();
        let colour = desc.base_color_map.as_ref().or(desc.mask_map.as_ref());
        let lookup = |map: &MapDesc| Lookup { sampling: map.sampling, second_uv: map.second_uv };
        // Roughness that normals lose has their place.
        let extension = desc.extension_maps.as_ref().and_then(|maps| maps.all().next());
        let maps = [colour, normal, orm.or(normal), desc.emissive_map.as_ref(), extension];
        maps.map(|map| map.map_or(Lookup::default(), lookup))
    }
}

/// The roughness of all layers.
fn with_clearcoat(desc: &MaterialDesc, [least, most]: [f32; 2]) -> [f32; 2] {
    match desc.clearcoat {
        0.0 => [least, most],
        _ => [least.min(desc.clearcoat_roughness), most.max(desc.clearcoat_roughness)],
    }
}

fn image(map: &Option<MapDesc>) -> Option<ImageSource> {
    map.as_ref().map(|map| map.image.clone())
}

fn one_channel(map: &Option<MapDesc>) -> Option<OneChannel> {
    map.as_ref().map(|map| OneChannel { image: map.image.clone(), pick: map.pick })
}

/// Warns of each of a task's pictures that could not be read.
fn warn_unusable<'a>(result: Option<&IndexedResult>, maps: impl Iterator<Item = &'a MapDesc>, report: &Report) {
    for map in maps {
        let problems = result.iter().flat_map(|result| &result.result.problems);
        if let Some((_, problem)) = problems.into_iter().find(|(image, _)| *image == map.image) {
            report.warn(format!("{}: {problem}; using the factor alone", map.origin));
        }
    }
}

#[cfg(test)]
#[path = "material_tests.rs"]
mod tests;
