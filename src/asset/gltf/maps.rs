//! Maps of materials: which picture, how it is sampled, and with which texture coordinates.

use glam::Vec2;
use serde::Deserialize;

use super::document::TextureInfo;
use super::images::Images;
use super::source::Source;
use crate::Result;
use crate::asset::material::{MapDesc, Sampling, Wrap};
use crate::asset::texture::Pick;
use crate::error::{MAX_QUOTED, shortened};

/// Beyond this, f32 cannot resolve texels.
const MAX_UV: f32 = 1e6;

/// Texture coordinates as a map takes them: a set of the vertices', transformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinates {
    pub set: usize,
    offset: [f32; 2],
    /// Radians, counter-clockwise where v runs down.
    rotation: f32,
    scale: [f32; 2],
}

impl Coordinates {
    /// A set as it is.
    pub fn plain(set: usize) -> Self {
        Self { set, offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] }
    }

    /// Coordinates of a vertex, v downwards, as ours: v upwards.
    pub fn apply(&self, uv: [f32; 2]) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let scaled = Vec2::from(uv) * Vec2::from(self.scale);
        let turned = Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
        let uv = turned + Vec2::from(self.offset);
        if uv.abs().max_element() <= MAX_UV { Vec2::new(uv.x, 1.0 - uv.y) } else { Vec2::ZERO }
    }
}

/// What `KHR_texture_transform` says.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Transform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<usize>,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

/// The extensions of textures whose picture is WebP, or KTX2 of Basis Universal.
pub const OTHER_PICTURES: [&str; 2] = ["EXT_texture_webp", "KHR_texture_basisu"];

/// What they say.
#[derive(Deserialize)]
struct OtherPicture {
    source: usize,
}

/// A map and its texture coordinates.
pub struct Map {
    pub desc: MapDesc,
    pub coordinates: Coordinates,
}

/// A map of a material, whose name begins messages; `key` is what it is for. `None`: it cannot be used, which is warned
/// of.
///
/// # Errors
/// Its texture or its sampler does not exist; its transform is not one.
pub fn map(
    source: &Source<'_>,
    images: &mut Images,
    (material, key): (&str, &str),
    info: &TextureInfo,
    pick: Pick,
) -> Result<Option<Map>> {
    let of = format!("{material}: {key}");
    let Some(texture) = source.document.textures.get(info.index) else {
        return Err(source.broken(format!("{of}: there is no texture {}", info.index)));
    };
    let coordinates = coordinates(source, &of, info)?;
    let mut image = texture.source;
    for name in OTHER_PICTURES {
        let other: Option<OtherPicture> = source.extension(&of, &texture.extensions, name)?;
        image = image.or(other.map(|other| other.source));
    }
    let Some(image) = image else {
        let other = texture.extensions.keys().next().map_or("nothing", |name| name.as_str());
        let other = shortened(other, MAX_QUOTED);
        let key = format!("texture {}", info.index);
        source.warn_once(key, &format!("{of}: it has no PNG, JPEG, WebP or KTX2 picture, only {other}; drawn without"));
        return Ok(None);
    };
    let sampling = sampling(source, &of, texture.sampler)?;
    let origin = format!("{}: {of}", source.short);
    let image = images.get(source, image);
    Ok(image.map(|image| Map { desc: MapDesc { image, pick, second_uv: false, sampling, origin }, coordinates }))
}

fn coordinates(source: &Source<'_>, of: &str, info: &TextureInfo) -> Result<Coordinates> {
    let transform: Option<Transform> = source.extension(of, &info.extensions, "KHR_texture_transform")?;
    let Transform { offset, rotation, scale, tex_coord } = transform.unwrap_or_default();
    let set = tex_coord.unwrap_or(info.tex_coord);
    let within = |number: &f32| number.abs() <= MAX_UV;
    if offset.iter().chain(&scale).chain([&rotation]).all(within) {
        return Ok(Coordinates { set, offset, rotation, scale });
    }
    source.warn_once(of, &format!("{of}: its texture transform goes beyond {MAX_UV:e}; drawn without"));
    Ok(Coordinates::plain(set))
}

fn sampling(source: &Source<'_>, of: &str, sampler: Option<usize>) -> Result<Sampling> {
    let Some(index) = sampler else { return Ok(Sampling::default()) };
    let Some(sampler) = source.document.samplers.get(index) else {
        return Err(source.broken(format!("{of}: there is no sampler {index}")));
    };
    let wrap = |code| match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    Ok(Sampling { wrap: [wrap(sampler.wrap_s), wrap(sampler.wrap_t)], nearest: sampler.mag_filter == Some(9728) })
}
