//! `KHR_materials_pbrSpecularGlossiness`: surfaces of diffuse color, specular color and glossiness as ones of metalness and roughness.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use image::ExtendedColorType;
use image::codecs::tga::TgaEncoder;
use rayon::prelude::*;
use serde::Deserialize;

use super::document::{MetallicRoughness, TextureInfo};
use crate::asset::image_source::ImageSource;
use crate::asset::material::DIELECTRIC_F0;
use crate::asset::mtl_material::DEFAULT_ROUGHNESS;
use crate::asset::texture::{Encoding, Texture, linear_of_srgb_bytes};
use crate::reference::tone::{luminance, srgb_encode};
use crate::{Error, Result};

pub const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

/// Above it no dielectric mirrors; a diamond's is 0.17.
const MOST_DIELECTRIC_F0: f32 = 0.2;

/// Most texels along a side of the pictures that are made.
const MAX_SIDE: u32 = 8192;

/// The extension. All factors are linear.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Glossy {
    pub diffuse_factor: [f32; 4],
    pub diffuse_texture: Option<TextureInfo>,
    pub specular_factor: [f32; 3],
    pub glossiness_factor: f32,
    pub specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for Glossy {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// A surface without maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plain {
    pub base_color: Vec3,
    pub metallic: f32,
    pub roughness: f32,
    pub dielectric_f0: f32,
}

impl Glossy {
    /// With its own textures in place of those that they become.
    pub fn as_metallic_roughness(&self) -> MetallicRoughness {
        MetallicRoughness {
            base_color_factor: Some(self.diffuse_factor),
            base_color_texture: self.diffuse_texture.clone(),
            metallic_factor: Some(1.0),
            roughness_factor: Some(1.0 - self.glossiness_factor),
            metallic_roughness_texture: self.specular_glossiness_texture.clone(),
        }
    }

    /// Without a specular texture: the surface by its factors, for a diffuse color of them or with a texture. Factors of a texture that
    /// cannot be used say nothing: then it is an ordinary dielectric.
    pub fn plain(&self) -> Plain {
        let [r, g, b, _] = self.diffuse_factor;
        match self.specular_glossiness_texture {
            Some(_) => plain(Vec3::new(r, g, b), Vec3::splat(DIELECTRIC_F0), DEFAULT_ROUGHNESS),
            None => plain(Vec3::new(r, g, b), self.specular_factor.into(), 1.0 - self.glossiness_factor),
        }
    }

    /// Whether a diffuse texture alone may have texels of metal.
    pub fn may_be_metal(&self) -> bool {
        let most = Vec3::from(self.specular_factor).max_element();
        self.specular_glossiness_texture.is_none() && most > MOST_DIELECTRIC_F0
    }

    /// Base color with alpha, and roughness (green) with metalness (blue), as pictures that include all factors but alpha's.
    /// `place` begins what they are called; of two textures the larger one's size is theirs, up to 8192 texels a side.
    ///
    /// # Errors
    /// A texture cannot be read.
    pub fn pictures(
        &self,
        place: &Path,
        diffuse: Option<&ImageSource>,
        specular: Option<&ImageSource>,
    ) -> Result<[ImageSource; 2]> {
        let load = |image: Option<&ImageSource>| match image {
            Some(image) => Texture::load(image, Encoding::Srgb).map(Some),
            None => Ok(None),
        };
        let textures = [load(diffuse)?, load(specular)?];
        let largest = |side: fn(&Texture) -> u32| textures.iter().flatten().map(side).max().unwrap_or(1).min(MAX_SIDE);
        let size = [largest(|t| t.width), largest(|t| t.height)];
        let [mut diffuse, mut specular] = textures.map(|texture| texels(texture, size));
        let linear = linear_of_srgb_bytes();
        let color = |texel: &[u8]| Vec3::from_array([0, 1, 2].map(|c| linear[usize::from(texel[c])]));
        let [r, g, b, _] = self.diffuse_factor;
        let factors = [Vec3::new(r, g, b), self.specular_factor.into()];
        // In place: large pictures are several times in memory as it is.
        let convert = |(d, s): (&mut [u8], &mut [u8])| {
            let (base_color, metallic) = metallic(color(d) * factors[0], color(s) * factors[1]);
            let glossiness = f32::from(s[3]) / 255.0 * self.glossiness_factor;
            d[..3].copy_from_slice(&srgb_encode(base_color.as_dvec3()).to_array().map(|v| byte(v as f32)));
            s.copy_from_slice(&[255, byte(1.0 - glossiness), byte(metallic), 255]);
        };
        diffuse.par_chunks_mut(4).zip(specular.par_chunks_mut(4)).for_each(convert);
        let picture = |rgba: &[u8], name: &str| {
            let mut named = place.as_os_str().to_owned();
            named.push(name);
            embedded(named.into(), rgba, size)
        };
        Ok([picture(&diffuse, " base color")?, picture(&specular, " roughness and metalness")?])
    }
}

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// White where there is no texture.
fn texels(texture: Option<Texture>, [width, height]: [u32; 2]) -> Vec<u8> {
    let size = width as usize * height as usize * 4;
    texture.map_or_else(|| vec![255; size], |texture| texture.resized(width, height).pixels)
}

/// Not compressed: it is decoded in a moment.
fn embedded(place: PathBuf, rgba: &[u8], [width, height]: [u32; 2]) -> Result<ImageSource> {
    let mut bytes = Vec::new();
    let encoder = TgaEncoder::new(&mut bytes).disable_rle();
    encoder.encode(rgba, width, height, ExtendedColorType::Rgba8).map_err(|error| Error::Broken {
        path: place.clone(),
        what: "texture",
        problem: error.to_string(),
        remedy: "export the model again with metalness and roughness",
    })?;
    Ok(ImageSource::embedded(place, Arc::from(bytes)))
}

/// A dielectric of its own reflectance, or a metal.
fn plain(diffuse: Vec3, specular: Vec3, roughness: f32) -> Plain {
    let f0 = luminance(specular.as_dvec3()) as f32;
    if specular.max_element() > MOST_DIELECTRIC_F0 {
        let (base_color, metallic) = metallic(diffuse, specular);
        return Plain { base_color, metallic, roughness, dielectric_f0: DIELECTRIC_F0 };
    }
    let base_color = diffuse * (1.0 - specular.max_element()) / (1.0 - f0);
    Plain { base_color: base_color.min(Vec3::ONE), metallic: 0.0, roughness, dielectric_f0: f0 }
}

/// Base color b and metalness m with which as much is diffuse and as much mirrored head on, at F0 = 0.04 of what is no metal:
///
/// d (1 − max s) = b (1 − m) (1 − F0) and s = F0 (1 − m) + b m,
///
/// which the luminances of d and s are solved for. Colors are those of the diffuse part where there is little metal, and of
/// the mirrored part where there is much.
fn metallic(diffuse: Vec3, specular: Vec3) -> (Vec3, f32) {
    let scattered = diffuse * (1.0 - specular.max_element().min(1.0)) / (1.0 - DIELECTRIC_F0);
    let [d, s] = [scattered, specular].map(|color| luminance(color.as_dvec3()));
    let f0 = f64::from(DIELECTRIC_F0);
    // With b = d / (1 − m): F0 m² + (d + s − 2 F0) m + F0 − s = 0.
    let half = 0.5 * (d + s - 2.0 * f0);
    let root = (half * half - f0 * (f0 - s)).max(0.0).sqrt();
    let metallic = if s <= f0 { 0.0 } else { ((root - half) / f0).clamp(0.0, 1.0) as f32 };
    let of_diffuse = scattered / (1.0 - metallic).max(1e-6);
    let of_specular = (specular - DIELECTRIC_F0 * (1.0 - metallic)) / metallic.max(1e-6);
    let base_color = of_diffuse.lerp(of_specular, metallic * metallic).clamp(Vec3::ZERO, Vec3::ONE);
    (base_color, metallic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_of_metalness_and_roughness_come_back() {
        for (base_color, wanted) in [
            (Vec3::new(0.9, 0.6, 0.2), 1.0),
            (Vec3::new(0.1, 0.4, 0.3), 0.0),
            (Vec3::splat(0.5), 0.5),
            (Vec3::splat(0.9), 0.25),
            (Vec3::ZERO, 0.0),
        ] {
            let specular = Vec3::splat(DIELECTRIC_F0).lerp(base_color, wanted);
            let scattered = base_color * (1.0 - wanted) * (1.0 - DIELECTRIC_F0);
            let (found, metalness) = metallic(scattered / (1.0 - specular.max_element()), specular);
            assert!((metalness - wanted).abs() < 1e-4, "{base_color} {wanted}: {metalness}");
            assert!((found - base_color).abs().max_element() < 1e-4, "{base_color} {wanted}: {found}");
        }
    }

    #[test]
    fn dielectrics_keep_their_reflectance() {
        let Plain { base_color, metallic, dielectric_f0, .. } = plain(Vec3::splat(0.5), Vec3::splat(0.08), 0.5);
        assert!(metallic == 0.0 && (dielectric_f0 - 0.08).abs() < 1e-6);
        assert!((base_color - Vec3::splat(0.5)).abs().max_element() < 1e-6);
        assert_eq!(plain(Vec3::ZERO, Vec3::new(1.0, 0.8, 0.3), 0.5).metallic, 1.0);
    }
}
