//! Equirectangular HDR panoramas: the light of a scene.

/// Linear RGB radiance over the sphere; every value is finite and not negative.
///
/// Direction d of texel centre (u, v), v from the top: u = atan2(d.z, d.x)/2π + 0.5, v = 0.5 − asin(d.y)/π.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    /// For messages and GPU debug names.
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// Rows from the top; `width * height` texels, in f32 and not clamped.
    pub texels: Vec<[f32; 3]>,
}
