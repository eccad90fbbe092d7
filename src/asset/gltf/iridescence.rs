//! `KHR_materials_iridescence`: a thin film of one index of refraction, whose thickness a texture may say.

use serde::Deserialize;

use super::document::TextureInfo;

pub const NAME: &str = "KHR_materials_iridescence";
/// Thickness in nanometres above which colours have long averaged out.
pub const MAX_THICKNESS: f32 = 1e5;

/// The extension.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Iridescence {
    pub iridescence_factor: f32,
    /// Multiplies the factor, in red.
    pub iridescence_texture: Option<TextureInfo>,
    pub iridescence_ior: f32,
    /// Nanometres, where the texture is 0 and 1; without one the latter.
    pub iridescence_thickness_minimum: f32,
    pub iridescence_thickness_maximum: f32,
    /// In green.
    pub iridescence_thickness_texture: Option<TextureInfo>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}
