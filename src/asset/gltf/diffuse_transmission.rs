//! `KHR_materials_diffuse_transmission`: light that diffuses through a thin sheet.

use serde::Deserialize;

use super::document::TextureInfo;

pub const NAME: &str = "KHR_materials_diffuse_transmission";

/// The extension. Factors are linear.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct DiffuseTransmission {
    pub diffuse_transmission_factor: f32,
    /// In alpha.
    pub diffuse_transmission_texture: Option<TextureInfo>,
    pub diffuse_transmission_color_factor: [f32; 3],
    /// sRGB.
    pub diffuse_transmission_color_texture: Option<TextureInfo>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture: None,
        }
    }
}
