//! Which specular level holds which roughness; twin of `glsl/levels.glsl`.

/// alpha of a stored level: 0 at level 0 (the panorama itself), then doubling up to 1 at `last_level`, as texels double
/// in size. Linear in alpha below level 1.
pub fn alpha_from_level(level: f64, last_level: f64) -> f64 {
    if level < 1.0 { level * (1.0 - last_level).exp2() } else { (level - last_level).exp2() }
}

/// The fractional level for a roughness in [0, 1], alpha = roughness²; the inverse of [`alpha_from_level`].
pub fn level_from_roughness(roughness: f64, last_level: f64) -> f64 {
    let alpha = roughness * roughness;
    let first = (1.0 - last_level).exp2();
    if alpha < first { alpha / first } else { last_level + alpha.min(1.0).log2() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_and_roughness_are_inverse_and_meet_their_ends() {
        assert_eq!(level_from_roughness(0.0, 6.0), 0.0);
        assert_eq!(level_from_roughness(1.0, 6.0), 6.0);
        for i in 0..=60 {
            let level = f64::from(i) / 10.0;
            let back = level_from_roughness(alpha_from_level(level, 6.0).sqrt(), 6.0);
            assert!((back - level).abs() < 1e-12, "{level} came back as {back}");
        }
    }
}
