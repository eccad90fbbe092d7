//! `KHR_materials_transmission` and `KHR_materials_volume`: light that goes through surfaces, and what bodies absorb of it.

use glam::Vec3;
use serde::Deserialize;

use super::document::TextureInfo;

/// What stands for an attenuation color of 0.
pub(super) const MIN_ATTENUATION: f32 = 1e-6;
/// Of a body that nothing is seen through, 1/m.
const MAX_ABSORPTION: f32 = 1e6;

/// What a surface lets through.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Transmission {
    pub transmission_factor: f32,
    pub transmission_texture: Option<TextureInfo>,
}

/// What a closed body of it does to light on its way through.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Volume {
    pub thickness_factor: f32,
    pub attenuation_distance: f32,
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: f32::INFINITY, attenuation_color: [1.0; 3] }
    }
}

impl Volume {
    /// By which light is multiplied at each of the two surfaces that it goes through, by Beer and Lambert's law.
    pub fn per_surface(&self) -> Vec3 {
        let distances = self.thickness_factor.max(0.0) / self.attenuation_distance.max(f32::MIN_POSITIVE);
        let color = Vec3::from(self.attenuation_color).clamp(Vec3::ZERO, Vec3::ONE);
        color.powf(0.5 * distances.min(f32::MAX))
    }

    /// The same law's coefficient, 1/m.
    pub fn absorption(&self) -> Vec3 {
        let color = Vec3::from(self.attenuation_color).clamp(Vec3::splat(MIN_ATTENUATION), Vec3::ONE);
        (-color.map(f32::ln) / self.attenuation_distance.max(f32::MIN_POSITIVE)).min(Vec3::splat(MAX_ABSORPTION))
    }
}
