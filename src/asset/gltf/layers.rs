//! Layers and other extensions of a glTF material's surface: specular factors, stretched highlights, a thin film, sheen, a clear
//! coat.

use glam::{Vec3, Vec4};
use serde::Deserialize;

use super::anisotropy::{self, Anisotropy};
use super::diffuse_transmission::{self, DiffuseTransmission};
use super::document::TextureInfo;
use super::images::Images;
use super::iridescence::{self, Iridescence};
use super::material_reader::MaterialReader;
use super::sheen::{self, Sheen};
use super::specular::{self, Specular};
use super::transmission::{self, Volume};
use crate::Result;
use crate::asset::material::{self, Extension, MAX_IOR, MIN_SHEEN_ROUGHNESS, MaterialDesc, ThinFilm, f0_from_ior};
use crate::asset::texture::Encoding;

/// `KHR_materials_clearcoat`.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Clearcoat {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<TextureInfo>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<TextureInfo>,
    pub clearcoat_normal_texture: Option<TextureInfo>,
}

/// Textures of one extension that are looked up texel by texel: of color and of a number in alpha, with their keys.
pub struct ExtensionTextures {
    pub of: Extension,
    pub textures: [Option<(&'static str, TextureInfo)>; 2],
}

/// All of these fail only where an extension is not of its form, or names a texture that does not exist.
impl MaterialReader<'_> {
    /// Those of the first extension that has any and does anything, in the order of how much of a picture it changes.
    pub fn extension_textures(&self) -> Result<Option<ExtensionTextures>> {
        let anisotropy = self.extension::<Anisotropy>(anisotropy::NAME)?.unwrap_or_default();
        let sheen = self.extension::<Sheen>(sheen::NAME)?.unwrap_or_default();
        let specular = self.extension::<Specular>(specular::NAME)?.unwrap_or_default();
        let diffuse = self.extension::<DiffuseTransmission>(diffuse_transmission::NAME)?.unwrap_or_default();
        let texture = |key, info: Option<TextureInfo>| info.map(|info| (key, info));
        let all = [
            (
                Extension::DiffuseTransmission,
                diffuse.diffuse_transmission_factor > 0.0,
                [
                    texture("diffuseTransmissionColorTexture", diffuse.diffuse_transmission_color_texture),
                    texture("diffuseTransmissionTexture", diffuse.diffuse_transmission_texture),
                ],
            ),
            (
                Extension::Anisotropy,
                anisotropy.anisotropy_strength > 0.0,
                [texture("anisotropyTexture", anisotropy.anisotropy_texture), None],
            ),
            (
                Extension::Sheen,
                sheen.sheen_color_factor != [0.0; 3],
                [
                    texture("sheenColorTexture", sheen.sheen_color_texture),
                    texture("sheenRoughnessTexture", sheen.sheen_roughness_texture),
                ],
            ),
            (
                Extension::Specular,
                specular.specular_factor > 0.0,
                [
                    texture("specularColorTexture", specular.specular_color_texture),
                    texture("specularTexture", specular.specular_texture),
                ],
            ),
        ];
        let first = all.into_iter().find(|(_, acts, textures)| *acts && textures.iter().any(Option::is_some));
        Ok(first.map(|(of, _, textures)| ExtensionTextures { of, textures }))
    }

    /// The means of an extension's textures of color and of a number, each with its key; white where there is none or it is one of the
    /// material's maps.
    fn means_without_maps(
        &self,
        desc: &MaterialDesc,
        (of, name): (Extension, &str),
        textures: [(&str, &Option<TextureInfo>); 2],
        images: &mut Images,
    ) -> Result<[Vec4; 2]> {
        let maps = desc.extension_maps.as_ref().filter(|maps| maps.of == of);
        let is_map = maps.map_or([false; 2], |maps| [maps.color.is_some(), maps.number.is_some()]);
        let mut mean = |i: usize| {
            let (key, info) = textures[i];
            self.mean(name, key, info.as_ref().filter(|_| !is_map[i]), images)
        };
        Ok([mean(0)?, mean(1)?])
    }

    /// What is no metal reflects by its index and `KHR_materials_specular`.
    pub fn set_specular(&self, desc: &mut MaterialDesc, images: &mut Images) -> Result<()> {
        desc.dielectric_f0 = Vec3::splat(f0_from_ior(self.ior()?));
        let Some(specular) = self.extension::<Specular>(specular::NAME)? else { return Ok(()) };
        let textures = [
            ("specularColorTexture", &specular.specular_color_texture),
            ("specularTexture", &specular.specular_texture),
        ];
        let of = (Extension::Specular, specular::NAME);
        let [of_color, of_factor] = self.means_without_maps(desc, of, textures, images)?;
        let factor = self.clamped("specularFactor", specular.specular_factor, 1.0) * of_factor.w;
        // Infinity times nothing is no number.
        let color = Vec3::from(specular.specular_color_factor).clamp(Vec3::ZERO, Vec3::splat(f32::MAX));
        let color = color * of_color.truncate();
        desc.dielectric_f0 = factor * (desc.dielectric_f0 * color).min(Vec3::ONE);
        desc.dielectric_f90 = factor;
        Ok(())
    }

    /// Highlights stretched in one direction.
    pub fn set_anisotropy(&self, desc: &mut MaterialDesc, images: &mut Images) -> Result<()> {
        let Some(anisotropy) = self.extension::<Anisotropy>(anisotropy::NAME)? else { return Ok(()) };
        let strength = self.clamped("anisotropyStrength", anisotropy.anisotropy_strength, 1.0);
        let is_map = desc.extension_maps.as_ref().is_some_and(|maps| maps.of == Extension::Anisotropy);
        let texture = anisotropy.anisotropy_texture.as_ref().filter(|_| strength > 0.0 && !is_map);
        let texel = self.texture_mean((anisotropy::NAME, "anisotropyTexture"), texture, Encoding::Linear, images)?;
        desc.anisotropy = anisotropy.along(strength, texel);
        Ok(())
    }

    /// With a factor in 0 to 1, and without a map that does nothing.
    pub fn iridescence(&self) -> Result<Iridescence> {
        let mut film: Iridescence = self.extension(iridescence::NAME)?.unwrap_or_default();
        film.iridescence_factor = self.clamped("iridescenceFactor", film.iridescence_factor, 1.0);
        Ok(if film.iridescence_factor == 0.0 { Iridescence::default() } else { film })
    }

    /// A film of one share: the mean of its texture. Of a thickness texture that is no map the mean is used, too.
    pub fn set_film(&self, desc: &mut MaterialDesc, film: &Iridescence, images: &mut Images) -> Result<()> {
        let texture = film.iridescence_texture.as_ref();
        let of_share =
            self.texture_mean((iridescence::NAME, "iridescenceTexture"), texture, Encoding::Linear, images)?;
        let share = film.iridescence_factor * of_share.map_or(1.0, |mean| mean.x);
        if share <= 0.0 {
            return Ok(());
        }
        let texture = film.iridescence_thickness_texture.as_ref().filter(|_| desc.film_map.is_none());
        let key = (iridescence::NAME, "iridescenceThicknessTexture");
        let part = self.texture_mean(key, texture, Encoding::Linear, images)?;
        let thickness = [
            ("iridescenceThicknessMinimum", film.iridescence_thickness_minimum),
            ("iridescenceThicknessMaximum", film.iridescence_thickness_maximum),
        ];
        let [least, most] = thickness.map(|(key, value)| self.clamped(key, value, iridescence::MAX_THICKNESS));
        let ior = self.clamped_between("iridescenceIor", film.iridescence_ior, 1.0, MAX_IOR);
        let thickness = match part {
            Some(mean) => [least + mean.y * (most - least); 2],
            None if desc.film_map.is_none() => [most; 2],
            None => [least, most],
        };
        desc.film = Some(ThinFilm { share, ior, thickness });
        Ok(())
    }

    /// Sheen of cloth.
    pub fn set_sheen(&self, desc: &mut MaterialDesc, images: &mut Images) -> Result<()> {
        let Some(sheen) = self.extension::<Sheen>(sheen::NAME)? else { return Ok(()) };
        let color = sheen.sheen_color_factor.map(|value| self.clamped("sheenColorFactor", value, 1.0));
        if color == [0.0; 3] {
            return Ok(());
        }
        let textures = [
            ("sheenColorTexture", &sheen.sheen_color_texture),
            ("sheenRoughnessTexture", &sheen.sheen_roughness_texture),
        ];
        let [of_color, of_roughness] =
            self.means_without_maps(desc, (Extension::Sheen, sheen::NAME), textures, images)?;
        desc.sheen = Vec3::from(color) * of_color.truncate();
        let roughness = sheen.sheen_roughness_factor * of_roughness.w;
        desc.sheen_roughness = self.clamped_between("sheenRoughnessFactor", roughness, MIN_SHEEN_ROUGHNESS, 1.0);
        Ok(())
    }

    /// Light that diffuses through it.
    pub fn set_diffuse_transmission(&self, desc: &mut MaterialDesc, images: &mut Images) -> Result<()> {
        let of = (Extension::DiffuseTransmission, diffuse_transmission::NAME);
        let Some(diffuse) = self.extension::<DiffuseTransmission>(of.1)? else { return Ok(()) };
        let share = self.clamped("diffuseTransmissionFactor", diffuse.diffuse_transmission_factor, 1.0);
        if share == 0.0 {
            return Ok(());
        }
        let factor = diffuse
            .diffuse_transmission_color_factor
            .map(|value| self.clamped("diffuseTransmissionColorFactor", value, 1.0));
        let textures = [
            ("diffuseTransmissionColorTexture", &diffuse.diffuse_transmission_color_texture),
            ("diffuseTransmissionTexture", &diffuse.diffuse_transmission_texture),
        ];
        let [of_color, of_share] = self.means_without_maps(desc, of, textures, images)?;
        let color = Vec3::from(factor) * of_color.truncate();
        desc.diffuse_transmission = Some(material::DiffuseTransmission { share: share * of_share.w, color });
        if self.extension::<Volume>(transmission::VOLUME)?.is_some_and(|volume| volume.thickness_factor > 0.0) {
            let what = format!("{}: {}: drawn as a thin sheet, whose volume does nothing", self.of, of.1);
            self.source.warn_once(of.1, &what);
        }
        Ok(())
    }

    /// With factors in 0 to 1, and without a map that does nothing. Of its texture of roughness the mean is used.
    pub fn clearcoat(&self, images: &mut Images) -> Result<Clearcoat> {
        let key = "KHR_materials_clearcoat";
        let mut coat: Clearcoat = self.extension(key)?.unwrap_or_default();
        coat.clearcoat_factor = self.clamped("clearcoatFactor", coat.clearcoat_factor, 1.0);
        coat.clearcoat_roughness_factor =
            self.clamped("clearcoatRoughnessFactor", coat.clearcoat_roughness_factor, 1.0);
        if coat.clearcoat_factor == 0.0 {
            return Ok(Clearcoat::default());
        }
        let texture = coat.clearcoat_roughness_texture.as_ref();
        let mean = self.texture_mean((key, "clearcoatRoughnessTexture"), texture, Encoding::Linear, images)?;
        coat.clearcoat_roughness_factor *= mean.map_or(1.0, |mean| mean.y);
        if coat.clearcoat_normal_texture.is_some() && !self.has_bumps(&coat) {
            self.warn(&format!("{key}: a clearcoatNormalTexture that is not the normalTexture is not supported; the coat is drawn without bumps"));
        }
        Ok(coat)
    }

    /// Whether a coat has the surface's own bumps.
    pub fn has_bumps(&self, coat: &Clearcoat) -> bool {
        let [own, of_coat] =
            [&self.material.normal_texture, &coat.clearcoat_normal_texture].map(|info| info.as_ref().map(|t| t.index));
        own.is_some() && own == of_coat
    }
}
