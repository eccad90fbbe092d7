//! What a lightmap knows of mirror images, in f64: how much of one a surface sees, by a linear fit, and the most light it can be; twin
//! of `glsl/openness.glsl`.

use glam::DVec3;

use super::math::smoothstep;

/// Visibility along a unit direction d before it is made steeper: `even` + `slope` · d.
#[derive(Clone, Copy, Debug)]
pub struct Openness {
    pub slope: DVec3,
    pub even: f64,
}

/// From the mean of directions drawn by the cosine around n, with 0 for all that met something.
///
/// Let b be that mean of v(d) d. For v = e + s·d the cosine's moments E\[d dᵀ\] are 1/4 across n and 1/2 along it, and
/// E\[d\] = 2/3 n: s is 4b across n, and along it b·n = 2/3 e + 1/2 s·n. Of the two numbers, e + s·n = 1 as long as both
/// are positive: what blocks stands at the horizon first.
pub fn openness_from_mean(n: DVec3, mean: DVec3) -> Openness {
    let along = mean.dot(n);
    let even = (6.0 * along - 3.0).clamp(0.0, 1.0);
    let slope_along = if along > 0.5 { 1.0 - even } else { 2.0 * along };
    Openness { slope: 4.0 * mean + (slope_along - 4.0 * along) * n, even }
}

/// Share of the sky that is seen along a unit direction d, 0 to 1.
pub fn visibility(open: Openness, d: DVec3) -> f64 {
    let steeper = 1.0 + 2.0 * smoothstep(0.4, 0.85, open.slope.length());
    (0.5 + steeper * (open.even + open.slope.dot(d) - 0.5)).clamp(0.0, 1.0)
}

/// The most radiance that a lobe can come to, in units of all irradiance over π: as if it were even over a cap with the lobe's mean
/// vector, 1 − spread long and at this cosine to the normal, and nothing came from elsewhere.
///
/// A cap of half angle φ has a mean vector of length (1 + cos φ) / 2, hence spread (1 − cos φ) / 2, and above the horizon brings
/// the irradiance π sin² φ · cosine = 4π spread (1 − spread) cosine for unit radiance.
pub fn most_radiance(spread: f64, cosine: f64) -> f64 {
    1.0 / (4.0 * spread * (1.0 - spread) * cosine).max(1e-30)
}

/// A GGX lobe's peak over the mean of a cap with the same mean vector: 4 at a roughness of 0.4, and more for smoother ones.
const LOBE_PEAK: f64 = 4.0;

/// What bounds the image around a lobe, of which `panorama` is the panorama's part, in units of radiance, by the irradiance that there
/// is and by what it would be if nothing blocked the panorama, both over π. All of `over_pi` comes from the cap of
/// [`most_radiance`], `most`; or else what is blocked was at the lobe's peak, and the rest of the panorama is there.
pub fn image_bound(panorama: f64, over_pi: f64, open_over_pi: f64, most: f64) -> f64 {
    (over_pi * most).max(panorama - (open_over_pi - over_pi).max(0.0) * (LOBE_PEAK * most))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sampling::basis;

    /// The mean that rays would find where `sees` says what they meet.
    fn mean_of(n: DVec3, sees: impl Fn(DVec3) -> f64) -> DVec3 {
        let frame = basis(n);
        const SIDE: usize = 400;
        let middle = |i: usize| (i as f64 + 0.5) / SIDE as f64;
        let places = (0..SIDE * SIDE).map(|i| (middle(i % SIDE), std::f64::consts::TAU * middle(i / SIDE)));
        let sum: DVec3 = places
            .map(|(u, angle)| {
                let across = u.sqrt();
                let d = frame * DVec3::new(across * angle.cos(), across * angle.sin(), (1.0 - u).sqrt());
                d * sees(d)
            })
            .sum();
        sum / (SIDE * SIDE) as f64
    }

    #[test]
    fn an_open_sky_is_seen_everywhere_and_a_closed_one_nowhere() {
        let n = DVec3::new(0.48, 0.6, 0.64);
        for d in [n, DVec3::X, DVec3::NEG_Y, -n] {
            assert!((visibility(openness_from_mean(n, mean_of(n, |_| 1.0)), d) - 1.0).abs() < 1e-4, "{d}");
            assert_eq!(visibility(openness_from_mean(n, DVec3::ZERO), d), 0.0, "{d}");
        }
    }

    #[test]
    fn a_cap_brings_as_much_light_as_its_most_radiance_allows() {
        let (n, towards, cos_edge) = (DVec3::Z, DVec3::new(0.6, 0.0, 0.8), 0.85);
        // Of directions drawn by the cosine around n those in the cap, over the share that is in it.
        let in_cap = |d: DVec3| f64::from(u8::from(d.dot(towards) > cos_edge));
        let over_pi = mean_of(n, |d| in_cap(d) / d.z).z;
        let most = over_pi * most_radiance(0.5 * (1.0 - cos_edge), towards.dot(n));
        assert!((most - 1.0).abs() < 1e-3, "{most}");
    }

    #[test]
    fn a_small_light_is_mirrored_where_it_is_seen_and_bound_where_it_is_not() {
        // A lobe of GGX at a normal's own direction: h by D cos θ, light at 2 θ, the peak 1 / (4 π α²).
        let alpha2 = 0.4_f64.powi(4);
        const STEPS: u32 = 100_000;
        let slope2 = |u: f64| alpha2 * u / (1.0 - u);
        let cosines = (0..STEPS).map(|i| 2.0 / (1.0 + slope2((f64::from(i) + 0.5) / f64::from(STEPS))) - 1.0);
        let above: Vec<f64> = cosines.filter(|cos| *cos > 0.0).collect();
        let most = most_radiance(1.0 - above.iter().sum::<f64>() / above.len() as f64, 1.0);
        let peak = 1.0 / (4.0 * alpha2);
        assert!((peak / (LOBE_PEAK * most) - 1.0).abs() < 0.03, "{peak} {most}");
        // The light brings 1, of which half is blocked, or all; other light 0.1.
        assert!(image_bound(peak, 1.1, 1.1, most) >= peak);
        let [half, none] = [0.6, 0.1].map(|over_pi| image_bound(peak, over_pi, 1.1, most));
        assert!((half / peak - 0.5).abs() < 0.03 && (none - 0.1 * most).abs() < 1e-9, "{half} {none}");
    }

    /// A wall above a floor that reaches to the horizon.
    #[test]
    fn a_floor_is_seen_below_and_the_sky_above() {
        let n = DVec3::Z;
        let open = openness_from_mean(n, mean_of(n, |d| if d.y > 0.0 { 1.0 } else { 0.0 }));
        assert!((open.slope.y - 16.0 / (6.0 * std::f64::consts::PI)).abs() < 1e-3, "{open:?}");
        for degrees in [-80, -40, -20, 20, 40, 80] {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let seen = visibility(open, DVec3::new(0.3 * cos, sin, (1.0 - 0.09_f64).sqrt() * cos));
            assert!((seen - if degrees > 0 { 1.0 } else { 0.0 }).abs() < 0.15, "{degrees}: {seen}");
        }
    }

    /// Houses around a square: the sky is open above and blocked at the horizon.
    #[test]
    fn what_blocks_stands_at_the_horizon_first() {
        let n = DVec3::Y;
        let open = openness_from_mean(n, mean_of(n, |d| if d.y > 0.4 { 1.0 } else { 0.0 }));
        let [up, low] = [DVec3::Y, DVec3::X].map(|d| visibility(open, d));
        // 6 · 2/3 (1 − 0.4³) − 3.
        assert!((up - 1.0).abs() < 1e-3 && (low - 0.744).abs() < 1e-3, "{up} {low}");
    }
}
