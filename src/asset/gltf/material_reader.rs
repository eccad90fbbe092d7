//! What reading any part of a glTF material needs: its words for messages, its extensions, factors in their range.

use glam::Vec4;
use serde::Deserialize;

use super::document::{Material, TextureInfo};
use super::images::Images;
use super::maps;
use super::source::Source;
use crate::Result;
use crate::asset::material::{MAX_IOR, USUAL_IOR};
use crate::asset::texture::{Encoding, Pick};

#[derive(Deserialize)]
#[serde(default)]
struct Ior {
    ior: f32,
}

impl Default for Ior {
    fn default() -> Self {
        Self { ior: USUAL_IOR }
    }
}

/// A material of a file that is being read.
pub struct MaterialReader<'a> {
    pub source: &'a Source<'a>,
    /// The material in words.
    pub of: String,
    pub material: &'a Material,
}

impl MaterialReader<'_> {
    /// Warns once of this of the material.
    pub fn warn(&self, what: &str) {
        self.source.warn_once(format!("{}: {what}", self.of), &format!("{}: {what}", self.of));
    }

    /// What an extension of the material says, if it has it.
    ///
    /// # Errors
    /// It is not of the form that it should have.
    pub fn extension<T: for<'de> Deserialize<'de>>(&self, name: &str) -> Result<Option<T>> {
        self.source.extension(&self.of, &self.material.extensions, name)
    }

    /// The index of refraction; 0 stands for an infinite one.
    ///
    /// # Errors
    /// As of [`Self::extension`].
    pub fn ior(&self) -> Result<f32> {
        let ior = self.extension::<Ior>("KHR_materials_ior")?.unwrap_or_default().ior;
        Ok(if ior == 0.0 { ior } else { self.clamped_between("ior", ior, 1.0, MAX_IOR) })
    }

    /// A factor within 0 to `most`.
    pub fn clamped(&self, key: &str, value: f32, most: f32) -> f32 {
        self.clamped_between(key, value, 0.0, most)
    }

    /// A factor within a range; one beyond it is warned of.
    pub fn clamped_between(&self, key: &str, value: f32, least: f32, most: f32) -> f32 {
        // NaN, which a file cannot say, would be the least.
        let within = value.max(least).min(most);
        if within != value {
            self.warn(&format!("{key}: {value} is not in {least}..={most}; {within} is used"));
        }
        within
    }

    /// The mean of a color texture that is not looked up texel by texel; white without one.
    ///
    /// # Errors
    /// As of [`maps::map`].
    pub fn mean(&self, extension: &str, key: &str, info: Option<&TextureInfo>, images: &mut Images) -> Result<Vec4> {
        Ok(self.texture_mean((extension, key), info, Encoding::Srgb, images)?.unwrap_or(Vec4::ONE))
    }

    /// The mean of a texture that is not looked up texel by texel, if there is one that can be read.
    ///
    /// # Errors
    /// As of [`maps::map`].
    pub fn texture_mean(
        &self,
        (extension, key): (&str, &str),
        info: Option<&TextureInfo>,
        encoding: Encoding,
        images: &mut Images,
    ) -> Result<Option<Vec4>> {
        let Some(info) = info else { return Ok(None) };
        self.warn(&format!("{extension}: {key}: the mean of its texels is used"));
        let map = maps::map(self.source, images, (&self.of, key), info, Pick::Red)?;
        Ok(map.and_then(|map| images.mean(self.source, &map.desc, encoding)))
    }
}
