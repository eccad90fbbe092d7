//! `KHR_materials_specular`: how much of which color is reflected by what is no metal.

use serde::Deserialize;

use super::document::TextureInfo;

pub const NAME: &str = "KHR_materials_specular";

/// The extension. Factors are linear.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Specular {
    pub specular_factor: f32,
    pub specular_texture: Option<TextureInfo>,
    pub specular_color_factor: [f32; 3],
    pub specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}
