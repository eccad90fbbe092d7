//! From scene radiance to display values in f64: twins of `glsl/tone.glsl`.

use glam::DVec3;

/// Factor of radiance for an exposure in stops.
pub fn exposure_scale(ev: f64) -> f64 {
    ev.exp2()
}

/// Relative luminance of linear RGB with Rec. 709 / sRGB primaries: ITU-R BT.709-6, item 3.2.
pub fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Khronos PBR Neutral Tone Mapper (Khronos Group, 2024, its specification's equations): linear RGB in, linear display
/// RGB in [0, 1] out. Colours up to 0.8 − 0.04 are mapped to the base color, without the 4 % that a dielectric's
/// surface adds.
pub fn tone_neutral(rgb: DVec3) -> DVec3 {
    /// Specular reflection of a dielectric, which is subtracted.
    const FRESNEL: f64 = 0.04;
    /// Peak where compression starts.
    const START: f64 = 0.8 - FRESNEL;
    /// Strength of the desaturation towards white.
    const DESATURATION: f64 = 0.15;
    const ROOM: f64 = 1.0 - START;

    let rgb = rgb.clamp(DVec3::ZERO, DVec3::splat(1e30)); // avoids infinity · 0
    let low = rgb.min_element();
    let rgb = rgb - if low < 2.0 * FRESNEL { low - low * low / (4.0 * FRESNEL) } else { FRESNEL };
    let peak = rgb.max_element();
    if peak <= START {
        return rgb;
    }
    let compressed = 1.0 - ROOM * ROOM / (peak + ROOM - START);
    let whiten = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    (rgb * (compressed / peak)).lerp(DVec3::splat(compressed), whiten)
}

/// sRGB's transfer function, linear [0, 1] to encoded [0, 1]: IEC 61966-2-1, section 5.2.
pub fn srgb_encode(linear: DVec3) -> DVec3 {
    linear.map(|c| if c <= 0.0031308 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 })
}

/// Its inverse.
pub fn srgb_decode(encoded: DVec3) -> DVec3 {
    encoded.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) })
}

/// A display's linear light of linear radiance: exposed and tone-mapped.
pub fn display_light(radiance: DVec3, ev: f64) -> DVec3 {
    tone_neutral(radiance * exposure_scale(ev))
}

/// Bytes of a display's linear light: sRGB-encoded, rounded.
pub fn srgb_bytes(light: DVec3) -> [u8; 3] {
    srgb_encode(light).to_array().map(|c| (c * 255.0).round() as u8) // `as` saturates
}

/// Display bytes of linear radiance.
pub fn display_bytes(radiance: DVec3, ev: f64) -> [u8; 3] {
    srgb_bytes(display_light(radiance, ev))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_rises_and_stays_below_one() {
        let mut last = -1e-12;
        for i in 0..2000 {
            let grey = 1e-3 * (f64::from(i) * 0.01).exp() - 1e-3;
            let out = tone_neutral(DVec3::splat(grey));
            assert!(out.x > last, "not rising at {grey}: {} after {last}", out.x);
            assert!(out.x <= 1.0 && out.x == out.y && out.y == out.z, "{out} at {grey}");
            last = out.x;
        }
        assert!(last > 0.999);
    }

    #[test]
    fn the_curve_is_smooth_where_its_pieces_meet() {
        for at in [0.08, 0.8] {
            let value = |d: f64| tone_neutral(DVec3::splat(at + d)).x;
            let (before, after) = ((value(0.0) - value(-1e-6)) / 1e-6, (value(1e-6) - value(0.0)) / 1e-6);
            assert!((before - after).abs() < 1e-4, "slopes {before} and {after} at {at}");
        }
        assert!((tone_neutral(DVec3::splat(0.5)).x - 0.46).abs() < 1e-15);
    }

    #[test]
    fn colours_stay_in_range_and_keep_their_order() {
        for rgb in [[1e30, 0.0, 0.0], [f64::INFINITY, 1.0, 0.0], [5.0, 2.0, 0.1], [-1.0, 0.2, 0.9], [7e4, 7e4, 1.0]] {
            let out = tone_neutral(rgb.into());
            assert!(out.min_element() >= 0.0 && out.max_element() <= 1.0 && out.is_finite(), "{out} for {rgb:?}");
            assert!(out.x >= out.y || rgb[0] < rgb[1], "{out} for {rgb:?}");
        }
        // Very bright colours whiten.
        assert!(tone_neutral(DVec3::new(1e4, 0.0, 0.0)).y > 0.99);
    }

    #[test]
    fn srgb_known_values_and_back() {
        assert!(srgb_encode(DVec3::splat(0.214_041_140)).abs_diff_eq(DVec3::splat(0.5), 1e-7));
        assert_eq!(srgb_encode(DVec3::ZERO), DVec3::ZERO);
        assert!(srgb_encode(DVec3::ONE).abs_diff_eq(DVec3::ONE, 1e-15));
        for i in 0..=255 {
            let byte = DVec3::splat(f64::from(i) / 255.0);
            assert!(srgb_encode(srgb_decode(byte)).abs_diff_eq(byte, 1e-6), "{i}");
        }
    }

    #[test]
    fn exposure_and_luminance() {
        assert_eq!(exposure_scale(-2.0), 0.25);
        assert!((luminance(DVec3::ONE) - 1.0).abs() < 1e-15);
        assert_eq!(display_bytes(DVec3::splat(0.125), 2.0), display_bytes(DVec3::splat(0.5), 0.0));
        assert_eq!(display_bytes(DVec3::splat(1e9), 0.0), [255; 3]);
        assert_eq!(display_bytes(DVec3::ZERO, 0.0), [0; 3]);
    }
}
