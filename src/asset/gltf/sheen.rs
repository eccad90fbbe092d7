//! `KHR_materials_sheen`: a layer of fibres over a surface.

use serde::Deserialize;

use super::document::TextureInfo;

pub const NAME: &str = "KHR_materials_sheen";

/// The extension. Factors are linear.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Sheen {
    pub sheen_color_factor: [f32; 3],
    /// sRGB.
    pub sheen_color_texture: Option<TextureInfo>,
    pub sheen_roughness_factor: f32,
    /// In alpha.
    pub sheen_roughness_texture: Option<TextureInfo>,
}
