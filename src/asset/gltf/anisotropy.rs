//! `KHR_materials_anisotropy`: highlights stretched in one direction.

use glam::{Vec2, Vec4};
use serde::Deserialize;

use super::document::TextureInfo;

pub const NAME: &str = "KHR_materials_anisotropy";

/// The extension.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Anisotropy {
    pub anisotropy_strength: f32,
    /// Radians from the tangent, counter-clockwise.
    pub anisotropy_rotation: f32,
    /// A direction in red and green, from −1 to 1, and what multiplies the strength in blue.
    pub anisotropy_texture: Option<TextureInfo>,
}

impl Anisotropy {
    /// The direction along tangent and bitangent, as long as the strength, which is from 0 to 1. `texel`: the mean of the texture, whose
    /// directions may cancel out.
    pub fn along(&self, strength: f32, texel: Option<Vec4>) -> Vec2 {
        let own = texel.map_or(Vec2::X, |texel| 2.0 * texel.truncate().truncate() - Vec2::ONE);
        let strength = strength * texel.map_or(1.0, |texel| texel.z);
        let rotation = if self.anisotropy_rotation.is_finite() { self.anisotropy_rotation } else { 0.0 };
        strength * Vec2::from_angle(rotation).rotate(own.clamp_length_max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn directions_are_turned_and_shortened() {
        let of =
            |rotation, texel| Anisotropy { anisotropy_rotation: rotation, ..Anisotropy::default() }.along(0.5, texel);
        let is_near = |a: Vec2, b: Vec2| a.abs_diff_eq(b, 1e-6);
        assert!(is_near(of(0.0, None), Vec2::new(0.5, 0.0)) && is_near(of(FRAC_PI_2, None), Vec2::new(0.0, 0.5)));
        assert_eq!(of(f32::NAN, None), Vec2::new(0.5, 0.0));
        let along_bitangent = Some(Vec4::new(0.5, 1.0, 0.4, 1.0));
        assert!(is_near(of(0.0, along_bitangent), Vec2::new(0.0, 0.2)));
        assert!(is_near(of(FRAC_PI_2, along_bitangent), Vec2::new(-0.2, 0.0)));
        assert!(is_near(of(0.0, Some(Vec4::new(0.5, 0.5, 1.0, 1.0))), Vec2::ZERO), "all directions together");
    }
}
