//! The lobes of the specular levels, and the level for a lobe: twin of `glsl/levels.glsl`.
//! Levels are found by a lobe's spread, 1 − |mean vector|, linearly between neighbours. Derivation:
//! src/precompute/README.md.

use super::lobe::kernel_spread;

/// Specular levels: a mirror and nine lobes. Even levels are the mips of one cube map, odd levels those of another, so
/// that the number of texels a side is halved every two levels.
pub const LEVELS: usize = 10;
/// Fourth root of the spread: `FIRST_ROOT` + `ROOT_STEP` · level. The last level's spread is 0.4, more than the
/// cosine's 1/3 (α = 1): at grazing angles rough surfaces have wider lobes.
const FIRST_ROOT: f64 = 0.165;
const ROOT_STEP: f64 = 0.07;

/// Spread of a stored level's lobe; 0 at level 0, the panorama itself.
pub fn spread_from_level(level: usize) -> f64 {
    if level == 0 { 0.0 } else { (FIRST_ROOT + ROOT_STEP * level as f64).powi(4) }
}

/// alpha of a stored level's lobe.
pub fn alpha_from_level(level: usize) -> f64 {
    alpha_from_spread(spread_from_level(level))
}

/// alpha of the lobe of this spread, by bisection; 0 for a mirror, the widest lobe for spreads above 0.41.
pub fn alpha_from_spread(spread: f64) -> f64 {
    if spread <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (1e-4f64.ln(), 1e2f64.ln());
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if kernel_spread(middle.exp()) < spread { low = middle } else { high = middle }
    }
    low.exp()
}

/// The fractional level for a lobe of this spread, at most the last level. Between the mirror and the first lobe it is
/// proportional to the root of the spread (about α), which halves the error measured on noise.
pub fn level_from_spread(spread: f64) -> f64 {
    let first = spread_from_level(1);
    if spread < first {
        return (spread / first).sqrt();
    }
    let low = (((spread.powf(0.25) - FIRST_ROOT) / ROOT_STEP) as usize).clamp(1, LEVELS - 2);
    let (below, above) = (spread_from_level(low), spread_from_level(low + 1));
    low as f64 + ((spread - below) / (above - below)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_have_the_spread_by_which_they_are_found() {
        assert_eq!((level_from_spread(0.0), level_from_spread(0.6)), (0.0, 9.0));
        for level in 0..LEVELS {
            let spread = kernel_spread(alpha_from_level(level));
            assert!((spread - spread_from_level(level)).abs() <= 1e-9 * spread, "{level}: {spread}");
            let back = level_from_spread(spread_from_level(level) * (1.0 + 1e-9));
            assert!((back - level as f64).abs() < 1e-6, "{level} came back as {back}");
        }
        assert!((0.01..0.02).contains(&alpha_from_level(1)), "{}", alpha_from_level(1));
    }

    #[test]
    fn a_mix_of_lobes_has_the_requested_spread() {
        for i in 4..=390 {
            let spread = f64::from(i) / 1000.0;
            let level = level_from_spread(spread);
            let low = (level as usize).min(LEVELS - 2);
            let share = level - low as f64;
            let mixed = (1.0 - share) * spread_from_level(low) + share * spread_from_level(low + 1);
            assert!((mixed - spread).abs() < 1e-12, "{spread} became {mixed}");
        }
    }
}
