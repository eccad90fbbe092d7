//! Materials of a glTF file, those that are used, as the renderer takes them.

use std::collections::HashMap;

use glam::Vec3;
use serde::Deserialize;

use super::document::{Material, MetallicRoughness, TextureInfo};
use super::extensions;
use super::glossy::{self, Glossy};
use super::images::Images;
use super::iridescence::Iridescence;
use super::layers::{Clearcoat, ExtensionTextures};
use super::maps::{self, Coordinates, Map};
use super::material_reader::MaterialReader;
use super::source::{Source, label};
use super::transmission::{self, Dispersion, SheetMap, Transmission, Volume};
use crate::Result;
use crate::asset::image_source::ImageSource;
use crate::asset::material::{
    AlphaUse, Extension, ExtensionMaps, Factor, MAX_EMISSION, MAX_IOR, MapDesc, MaterialDesc, NormalsDesc, NormalsKind,
};
use crate::asset::mesh::Submesh;
use crate::asset::texture::Pick;
use crate::error::{MAX_QUOTED, shortened};

/// The least opacity by which a mask's cutoff is divided.
const MIN_OPACITY: f32 = 1e-6;

/// Materials in the order of their first use.
#[derive(Default)]
pub struct Materials {
    pub descs: Vec<MaterialDesc>,
    /// Of each: the texture coordinates that vertices need, ours first and second.
    coordinates: Vec<[Option<Coordinates>; 2]>,
    known: HashMap<usize, usize>,
    /// Of materials that are sheets in part: what says where, and the material there.
    sheets: HashMap<usize, (SheetMap, usize)>,
    images: Images,
}

/// A material as it is read.
struct ReadMaterial {
    desc: MaterialDesc,
    /// Of vertices, first and second.
    coordinates: [Option<Coordinates>; 2],
    /// What it is where light goes through, if that is not everywhere.
    sheet: Option<(SheetMap, MaterialDesc)>,
}

impl Materials {
    /// A material by its index in the file: its index in [`Self::descs`], and the texture coordinates that it needs.
    ///
    /// # Errors
    /// It names what does not exist.
    pub fn get(&mut self, source: &Source<'_>, index: usize) -> Result<(usize, [Option<Coordinates>; 2])> {
        if let Some(known) = self.known.get(&index) {
            return Ok((*known, self.coordinates[*known]));
        }
        let Some(material) = source.document.materials.get(index) else {
            return Err(source.broken(format!("there is no material {index}")));
        };
        let reader = MaterialReader { source, of: name_of(index, material), material };
        let ReadMaterial { desc, coordinates, sheet } = reader.read(&mut self.images)?;
        let first = self.descs.len();
        self.known.insert(index, first);
        self.descs.push(desc);
        self.coordinates.push(coordinates);
        if let Some((map, desc)) = sheet {
            self.sheets.insert(first, (map, first + 1));
            self.descs.push(desc);
            self.coordinates.push(coordinates);
        }
        Ok((first, coordinates))
    }

    /// A mesh of one material, or what of it is none, and what is a sheet.
    pub fn split(&self, submesh: Submesh) -> Vec<Submesh> {
        match submesh.material.and_then(|material| self.sheets.get(&material)) {
            Some((map, sheet)) => {
                map.split(submesh, *sheet).into_iter().filter(|part| !part.corners.is_empty()).collect()
            }
            None => vec![submesh],
        }
    }
}

/// A material in words.
fn name_of(index: usize, material: &Material) -> String {
    match material.name.as_deref().filter(|name| !name.is_empty()) {
        Some(name) => format!("material {}", shortened(name, MAX_QUOTED)),
        None => label("material", index, None),
    }
}

/// The maps of a material; without the texture coordinates that each needs, all is as it will be.
#[derive(Default)]
struct Maps {
    base_color: Option<Map>,
    normal: Option<Map>,
    roughness: Option<Map>,
    occlusion: Option<Map>,
    clearcoat: Option<Map>,
    film: Option<Map>,
    transmission: Option<Map>,
    emissive: Option<Map>,
    /// Of one extension, and which.
    extension: Option<Extension>,
    extension_color: Option<Map>,
    extension_number: Option<Map>,
}

impl Maps {
    /// All there are, in the order in which they choose texture coordinates: tangents belong to those of the normals.
    fn all(&mut self) -> impl Iterator<Item = &mut Map> {
        let first = [&mut self.normal, &mut self.base_color, &mut self.roughness];
        first
            .into_iter()
            .chain([
                &mut self.emissive,
                &mut self.occlusion,
                &mut self.clearcoat,
                &mut self.film,
                &mut self.transmission,
                &mut self.extension_color,
                &mut self.extension_number,
            ])
            .flatten()
    }
}

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Strength {
    emissive_strength: f32,
}

impl Default for Strength {
    fn default() -> Self {
        Self { emissive_strength: 1.0 }
    }
}

impl MaterialReader<'_> {
    fn read(&self, images: &mut Images) -> Result<ReadMaterial> {
        extensions::warn_of_material(self.source, &self.of, self.material);
        let own = self.material.pbr_metallic_roughness.as_ref();
        let glossy = if own.is_none() { self.glossy()? } else { None };
        let as_own = glossy.as_ref().map(Glossy::as_metallic_roughness);
        let surface = own.or(as_own.as_ref());
        let clearcoat = self.clearcoat(images)?;
        let iridescence = self.iridescence()?;
        let transmission: Transmission = self.extension(transmission::NAME)?.unwrap_or_default();
        let mut maps = self.maps(surface, (&clearcoat, &iridescence, &transmission), images)?;
        // Sheets cover by what they reflect, and are one color.
        if transmission.transmission_factor <= 0.0 {
            self.set_extension_maps(&mut maps, images)?;
        }
        self.drop_unpackable(&mut maps);
        let coordinates = self.choose_coordinates(&mut maps);
        let mut desc = self.factors(surface)?;
        (desc.clearcoat, desc.clearcoat_roughness) = (clearcoat.clearcoat_factor, clearcoat.clearcoat_roughness_factor);
        desc.clearcoat_bumps = self.has_bumps(&clearcoat);
        self.set_alpha(&mut desc);
        let sheet_map = maps.transmission.take().map(|map| map.desc);
        self.set_maps(&mut desc, maps);
        self.set_specular(&mut desc, images)?;
        self.set_anisotropy(&mut desc, images)?;
        self.set_sheen(&mut desc, images)?;
        self.set_diffuse_transmission(&mut desc, images)?;
        self.set_film(&mut desc, &iridescence, images)?;
        if let Some(glossy) = &glossy {
            self.set_glossy(&mut desc, glossy, images)?;
        }
        let mut sheet = None;
        if self.material.extensions.contains_key("KHR_materials_unlit") {
            self.shine(&mut desc);
        } else if transmission.transmission_texture.is_some() {
            sheet = self.sheet_in_part(&desc, &transmission, sheet_map, images)?;
        } else {
            self.set_transmission(&mut desc, transmission.transmission_factor)?;
        }
        Ok(ReadMaterial { desc, coordinates, sheet })
    }

    /// Of the model before metalness and roughness, with factors in 0 to 1.
    fn glossy(&self) -> Result<Option<Glossy>> {
        let Some(mut glossy) = self.extension::<Glossy>(glossy::NAME)? else { return Ok(None) };
        glossy.diffuse_factor = glossy.diffuse_factor.map(|value| self.clamped("diffuseFactor", value, 1.0));
        glossy.specular_factor = glossy.specular_factor.map(|value| self.clamped("specularFactor", value, 1.0));
        glossy.glossiness_factor = self.clamped("glossinessFactor", glossy.glossiness_factor, 1.0);
        Ok(Some(glossy))
    }

    fn maps(
        &self,
        surface: Option<&MetallicRoughness>,
        (coat, film, transmission): (&Clearcoat, &Iridescence, &Transmission),
        images: &mut Images,
    ) -> Result<Maps> {
        let mut map = |key, info: Option<&TextureInfo>, pick| match info {
            Some(info) => maps::map(self.source, images, (&self.of, key), info, pick),
            None => Ok(None),
        };
        let keys = match self.material.pbr_metallic_roughness {
            Some(_) => ["baseColorTexture", "metallicRoughnessTexture"],
            None => ["diffuseTexture", "specularGlossinessTexture"],
        };
        let base_color = surface.and_then(|surface| surface.base_color_texture.as_ref());
        let roughness = surface.and_then(|surface| surface.metallic_roughness_texture.as_ref());
        Ok(Maps {
            base_color: map(keys[0], base_color, Pick::Red)?,
            normal: map("normalTexture", self.material.normal_texture.as_ref(), Pick::Red)?,
            roughness: map(keys[1], roughness, Pick::Green)?,
            occlusion: map("occlusionTexture", self.material.occlusion_texture.as_ref(), Pick::Red)?,
            emissive: map("emissiveTexture", self.material.emissive_texture.as_ref(), Pick::Red)?,
            clearcoat: map("clearcoatTexture", coat.clearcoat_texture.as_ref(), Pick::Red)?,
            transmission: map("transmissionTexture", transmission.transmission_texture.as_ref(), Pick::Red)?,
            film: map("iridescenceThicknessTexture", film.iridescence_thickness_texture.as_ref(), Pick::Green)?,
            ..Maps::default()
        })
    }

    /// The maps of the first extension that has any; of the others the means are used.
    fn set_extension_maps(&self, maps: &mut Maps, images: &mut Images) -> Result<()> {
        let Some(ExtensionTextures { of, textures: [color, number] }) = self.extension_textures()? else {
            return Ok(());
        };
        let mut map = |texture: Option<(&str, TextureInfo)>, pick| match texture {
            Some((key, info)) => maps::map(self.source, images, (&self.of, key), &info, pick),
            None => Ok(None),
        };
        maps.extension = Some(of);
        maps.extension_color = map(color, Pick::Red)?;
        maps.extension_number = map(number, Pick::Alpha)?;
        Ok(())
    }

    /// Occlusion, roughness, metalness and clear coat become one picture, so that they must be sampled alike.
    fn drop_unpackable(&self, maps: &mut Maps) {
        let differ = |a: &Option<Map>, b: &Option<Map>| match (a, b) {
            (Some(a), Some(b)) => a.coordinates != b.coordinates || a.desc.sampling != b.desc.sampling,
            _ => false,
        };
        let is_glossy = self.material.pbr_metallic_roughness.is_none();
        if is_glossy && differ(&maps.base_color, &maps.roughness) {
            self.warn("specularGlossinessTexture: it is not sampled as diffuseTexture; drawn without");
            maps.roughness = None;
        }
        if differ(&maps.occlusion, &maps.roughness) {
            self.warn("occlusionTexture: it is not sampled as metallicRoughnessTexture; drawn without occlusion");
            maps.occlusion = None;
        }
        if differ(&maps.clearcoat, &maps.roughness) || differ(&maps.clearcoat, &maps.occlusion) {
            self.warn("clearcoatTexture: it is not sampled as metallicRoughnessTexture; its factor is used alone");
            maps.clearcoat = None;
        }
        let is_apart = [&maps.roughness, &maps.occlusion].into_iter().any(|other| differ(&maps.film, other));
        if differ(&maps.extension_color, &maps.extension_number) {
            maps.extension_number = None;
        }
        // The coat's map has its place; then its mean is used.
        if is_apart || maps.clearcoat.is_some() {
            maps.film = None;
        }
    }

    /// The first two different texture coordinates of the maps. Maps with others take the first.
    fn choose_coordinates(&self, maps: &mut Maps) -> [Option<Coordinates>; 2] {
        let mut chosen = [None; 2];
        for map in maps.all() {
            let own = Some(map.coordinates);
            if let Some(number) = chosen.iter().position(|known| *known == own || known.is_none()) {
                chosen[number] = own;
                map.desc.second_uv = number == 1;
            } else {
                self.warn("its maps need more than two texture coordinates; others are those of its first map");
            }
        }
        chosen
    }

    fn factors(&self, surface: Option<&MetallicRoughness>) -> Result<MaterialDesc> {
        let material = self.material;
        let base = surface.and_then(|surface| surface.base_color_factor).unwrap_or([1.0; 4]);
        let [r, g, b, a] = base.map(|value| self.clamped("baseColorFactor", value, 1.0));
        let scalar = |key, value: Option<f32>| self.clamped(key, value.unwrap_or(1.0), 1.0);
        let metallic = scalar("metallicFactor", surface.and_then(|surface| surface.metallic_factor));
        let roughness = scalar("roughnessFactor", surface.and_then(|surface| surface.roughness_factor));
        let strength: Option<Strength> = self.extension("KHR_materials_emissive_strength")?;
        let strength = strength.unwrap_or_default().emissive_strength;
        let emissive = material.emissive_factor.unwrap_or_default();
        let emissive = emissive.map(|value| self.clamped("emissiveFactor", value * strength, MAX_EMISSION));
        let occlusion = material.occlusion_texture.as_ref().and_then(|info| info.strength);
        let is_named = material.name.as_deref().is_some_and(|name| !name.is_empty());
        let name = self.of.strip_prefix("material ").filter(|_| is_named).unwrap_or(&self.of);
        Ok(MaterialDesc {
            opacity: a,
            emissive: Factor::same(emissive.into()),
            occlusion_strength: scalar("occlusionTexture.strength", occlusion),
            culls_backs: !material.double_sided,
            ..MaterialDesc::plain(name, Vec3::new(r, g, b), metallic, roughness)
        })
    }

    fn set_alpha(&self, desc: &mut MaterialDesc) {
        let cutoff = self.material.alpha_cutoff.unwrap_or(0.5);
        match self.material.alpha_mode.as_deref().unwrap_or("OPAQUE") {
            "MASK" if cutoff <= 0.0 => desc.alpha = AlphaUse::Opaque,
            "MASK" => {
                desc.alpha = AlphaUse::Mask((cutoff / desc.opacity.max(MIN_OPACITY)).min(1.0 / MIN_OPACITY));
                desc.opacity = 1.0;
            }
            "BLEND" => desc.alpha = AlphaUse::Blend,
            "OPAQUE" => desc.alpha = AlphaUse::Opaque,
            other => {
                self.warn(&format!("alphaMode: {} is unknown; drawn opaque", shortened(other, MAX_QUOTED)));
            }
        }
    }

    fn set_maps(&self, desc: &mut MaterialDesc, maps: Maps) {
        let desc_of = |map: Option<Map>| map.map(|map| map.desc);
        let scale = self.material.normal_texture.as_ref().and_then(|info| info.scale).unwrap_or(1.0);
        let scale = if scale.is_finite() { scale } else { 1.0 };
        desc.base_color_map = desc_of(maps.base_color);
        desc.normals = maps.normal.map(|map| NormalsDesc { map: map.desc, kind: NormalsKind::Vectors(scale) });
        desc.roughness_map = desc_of(maps.roughness);
        desc.metallic_map = desc.roughness_map.clone().map(|map| MapDesc { pick: Pick::Blue, ..map });
        desc.occlusion_map = desc_of(maps.occlusion);
        desc.emissive_map = desc_of(maps.emissive);
        desc.clearcoat_map = desc_of(maps.clearcoat);
        desc.film_map = desc_of(maps.film);
        let [color, number] = [maps.extension_color, maps.extension_number].map(desc_of);
        desc.extension_maps = maps.extension.map(|of| ExtensionMaps { of, color, number });
    }

    /// Makes metalness and roughness of what the material has as maps and factors.
    fn set_glossy(&self, desc: &mut MaterialDesc, glossy: &Glossy, images: &mut Images) -> Result<()> {
        let maps = [desc.base_color_map.take(), desc.roughness_map.take()];
        desc.metallic_map = None;
        let [diffuse, specular] = maps.each_ref().map(|map| map.as_ref().map(|map| &map.image));
        let is_mapped = specular.is_some() || (diffuse.is_some() && glossy.may_be_metal());
        if is_mapped && let Some(converted) = images.converted(self.source, &self.of, glossy, [diffuse, specular])? {
            let map = |own: &Option<MapDesc>, other: &Option<MapDesc>, image: &ImageSource, pick| {
                let own = own.as_ref().or(other.as_ref())?;
                Some(MapDesc { image: image.clone(), pick, ..own.clone() })
            };
            let ([diffuse, specular], [base_color, roughness]) = (&maps, &converted);
            desc.base_color_map = map(diffuse, specular, base_color, Pick::Red);
            desc.roughness_map = map(specular, diffuse, roughness, Pick::Green);
            desc.metallic_map = map(specular, diffuse, roughness, Pick::Blue);
            (desc.base_color, desc.metallic, desc.roughness) =
                (Factor::same(Vec3::ONE), Factor::same(1.0), Factor::same(1.0));
            return Ok(());
        }
        let plain = glossy.plain();
        [desc.base_color_map, _] = maps;
        desc.base_color = Factor::same(plain.base_color);
        (desc.metallic, desc.dielectric_f0) = (Factor::same(plain.metallic), Vec3::splat(plain.dielectric_f0));
        desc.roughness = Factor::same(plain.roughness);
        Ok(())
    }

    /// Makes a thin sheet of what light goes through, which is the surface of a solid body where it has a volume.
    fn set_transmission(&self, desc: &mut MaterialDesc, factor: f32) -> Result<()> {
        let key = transmission::NAME;
        let dielectric = if desc.metallic_map.is_some() { 1.0 } else { 1.0 - desc.metallic.alone };
        let share = dielectric * self.clamped("transmissionFactor", factor, 1.0);
        if share <= 0.0 {
            return Ok(());
        }
        if matches!(desc.alpha, AlphaUse::Mask(_)) {
            self.warn(&format!("{key}: not supported with a mask; drawn as if it were not transparent"));
            return Ok(());
        }
        let volume = self.extension::<Volume>(transmission::VOLUME)?.unwrap_or_default();
        let surface_transmission = desc.base_color.of(desc.base_color_map.is_some());
        desc.transmit(share, volume.per_surface());
        // What covers a part of what is behind stays a sheet: light would be bent in a part of it only.
        if volume.thickness_factor > 0.0 && share == 1.0 && desc.alpha == AlphaUse::Opacity {
            let ior = Some(self.ior()?).filter(|ior| *ior > 0.0).unwrap_or(MAX_IOR);
            let ior_spread = self.ior_spread(ior)?;
            desc.refract([ior, ior_spread], surface_transmission, volume.absorption());
        }
        self.warn_of_sheets(desc);
        Ok(())
    }

    /// `KHR_materials_dispersion`: of the index of blue and red light, from Abbe's number, which is 20 over what is said.
    fn ior_spread(&self, ior: f32) -> Result<f32> {
        let key = transmission::DISPERSION;
        let said = self.extension::<Dispersion>(key)?.unwrap_or_default().dispersion;
        let dispersion = self.clamped("dispersion", said, transmission::MAX_DISPERSION);
        if dispersion > 0.0 {
            self.source.warn_once(
                key,
                &format!(
                    "{}: {key}: colours part in balls and convex bodies alone, and in exact pictures in all bodies",
                    self.of
                ),
            );
        }
        Ok(0.5 * (ior - 1.0) * dispersion / 20.0)
    }

    /// What the material is where a texture lets light through; `None` where that is nowhere.
    fn sheet_in_part(
        &self,
        desc: &MaterialDesc,
        transmission: &Transmission,
        map: Option<MapDesc>,
        images: &mut Images,
    ) -> Result<Option<(SheetMap, MaterialDesc)>> {
        let channel = map.as_ref().and_then(|map| images.channel(self.source, map));
        let Some((map, share)) = map.zip(channel).and_then(|(map, channel)| SheetMap::new(channel, &map)) else {
            return Ok(None);
        };
        let mut sheet = desc.clone();
        self.set_transmission(&mut sheet, transmission.transmission_factor * share)?;
        if sheet.transmission.is_none() {
            return Ok(None);
        }
        self.warn("transmissionTexture: triangles of which more than half lets light through are drawn as sheets of its mean there, all others as if they were not transparent");
        Ok(Some((map, sheet)))
    }

    /// Says once for each kind of surface what is not drawn of the light that goes through.
    fn warn_of_sheets(&self, desc: &MaterialDesc) {
        let (key, left_out) = match desc.refraction {
            Some(_) => (
                transmission::VOLUME,
                "balls and convex bodies alone bend light that goes through them, and in exact pictures all bodies",
            ),
            None => (transmission::NAME, "light goes straight through it, neither bent nor blurred"),
        };
        self.source.warn_once(key, &format!("{}: {key}: {left_out}", self.of));
    }

    /// A surface whose color is seen whatever the light: it reflects nothing and emits its color.
    fn shine(&self, desc: &mut MaterialDesc) {
        let key = "KHR_materials_unlit";
        self.source.warn_once(key, &format!("{}: {key}: drawn as a light source of its color", self.of));
        desc.unlit = true;
        desc.emissive = desc.base_color;
        desc.emissive_map = desc.base_color_map.clone();
        desc.base_color = Factor::same(Vec3::ZERO);
        desc.metallic = Factor::same(1.0);
        desc.roughness = Factor::same(1.0);
        (desc.normals, desc.occlusion_map, desc.roughness_map, desc.metallic_map) = (None, None, None, None);
        (desc.clearcoat, desc.clearcoat_map, desc.sheen) = (0.0, None, Vec3::ZERO);
        (desc.film, desc.film_map, desc.extension_maps) = (None, None, None);
        desc.diffuse_transmission = None;
    }
}
