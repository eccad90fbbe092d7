//! What stands for the specular lobe: a share of the irradiance, and round lobes; twin of `glsl/split_sum.glsl`. Derivation and fits:
//! src/precompute/README.md.

use clap::ValueEnum;
use glam::FloatExt;

use super::math::smoothstep;
use super::table::{Lobe, sine};

/// The environment lookup for the specular term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum SplitSum {
    /// Along r, at the level of the roughness: Karis (2013), section "Environment Map Lighting" with n = v = r.
    Classic,
    /// Along the mean vector of the BRDF's lobe, at the level whose lobe has a mean vector of the same length: exact
    /// for radiance that is linear in direction.
    Moment,
    /// The same, with a share of the irradiance for the lobe's tails. No more texels of the panorama's maps than `Moment` takes.
    OneLobe,
    /// And with two round lobes side by side in the plane of incidence, where the BRDF's lobe is long at grazing angles.
    #[default]
    TwoLobes,
}

/// What stands for a lobe: irradiance / π with the weight `even`, and with the rest two round lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    pub even: f64,
    /// The direction of the round lobes' mean, along r and across it, towards n, of any length.
    pub towards: [f64; 2],
    /// 1 − length of their mean vector.
    pub spread: f64,
    /// They lie along `towards` + `apart` and `towards` − `apart`: the same where this is 0.
    pub apart: [f64; 2],
    /// The spread of each (`reference::lobe`).
    pub each_spread: f64,
}

impl Match {
    /// The mean vector of all that is looked up, along r and across it, where no lobe is wider than `widest`.
    pub fn mean(&self, nv: f64, widest: f64) -> [f64; 2] {
        let third = 2.0 / 3.0 * self.even;
        let length = (1.0 - self.even) * (1.0 - self.each_spread.min(widest));
        let [first, second] = self.lobes().map(|[x, y]| [x, y].map(|part| part / x.hypot(y)));
        let round: [f64; 2] = std::array::from_fn(|i| 0.5 * length * (first[i] + second[i]));
        [round[0] + third * nv, round[1] + third * sine(nv)]
    }

    /// The directions of the round lobes, of any length.
    pub fn lobes(&self) -> [[f64; 2]; 2] {
        [1.0, -1.0].map(|side| std::array::from_fn(|i| self.towards[i] + side * self.apart[i]))
    }
}

impl Lobe {
    /// What the shaders look up for a grey F0; twin of `specular_lobe` in `glsl/environment.glsl`. `Classic` is not matched.
    pub fn matched(&self, f0: f64, nv: f64, roughness: f64, split_sum: SplitSum) -> Match {
        let even = match split_sum {
            SplitSum::Classic | SplitSum::Moment => 0.0,
            SplitSum::OneLobe | SplitSum::TwoLobes => {
                self.share_of_base(f0) * self.base.along * even_over_along(nv, roughness)
            }
        };
        let share = if split_sum == SplitSum::TwoLobes { apart_over_sin2(roughness) } else { 0.0 };
        let [mean_along, across] = self.mean(f0, nv);
        match_lobe(even, 1.0 - mean_along, across, nv, share)
    }
}

/// The round lobes have what 2/3 n, the cosine lobe's mean vector, leaves of a lobe's own, (1 − along) r + across t. With the cosine
/// 1 − s between `towards` and each of two, these have the same mean if (1 − s) (1 − spread of each) = 1 − spread.
fn match_lobe(even: f64, along: f64, across: f64, nv: f64, share_apart: f64) -> Match {
    let (third, weight, sv) = (2.0 / 3.0 * even, 1.0 - even, sine(nv));
    let (along, across) = (along + third * nv - even, across - third * sv);
    let towards = [weight - along, across];
    let length = towards[0].hypot(towards[1]);
    // weight² − length², without its loss of digits near a mirror.
    let squares = 2.0 * weight * along - along.powi(2) - across.powi(2);
    let spread = squares / (weight * (weight + length));
    let s = share_apart * sv * sv * spread;
    let tangent = (s * (2.0 - s)).sqrt() / (1.0 - s);
    let apart = [-tangent * towards[1], tangent * towards[0]];
    Match { even, towards, spread, apart, each_spread: (spread - s) / (1.0 - s) }
}

/// The weight of irradiance / π, over `along` of the part of the lobe that it is for.
pub fn even_over_along(nv: f64, roughness: f64) -> f64 {
    let wide = 0.76_f64.lerp(0.92 / (1.0 - 2.0 / 3.0 * nv), smoothstep(0.35, 0.95, roughness));
    wide.lerp(nv, smoothstep(0.85, 1.0, roughness))
}

/// How much of a match's spread is the angle between two lobes, over sin² of that from n to v.
pub fn apart_over_sin2(roughness: f64) -> f64 {
    2.2 * roughness * (0.8 - roughness).max(0.0)
}

/// The spread of lobes around the mirror directions of normals that turn by `variance` along both axes together, to first order: the
/// mirror direction turns by twice as much in the plane of incidence, by 2 n·v as much across it.
pub fn turned_spread(spread: f64, nv: f64, variance: f64) -> f64 {
    1.0 - (1.0 - spread) / (1.0 + variance * (1.0 + nv * nv))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::reference::brdf::Geometry;
    use crate::reference::table::table_lobe;

    /// n·v, roughness, a grey F0 and the lobe.
    fn lobes() -> impl Iterator<Item = (f64, f64, f64, Lobe)> {
        let cosines = [0.001, 0.02, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 0.99, 1.0];
        let roughnesses = [0.05, 0.2, 0.4, 0.6, 0.8, 0.85, 0.9, 0.95, 1.0];
        let surfaces = cosines.into_iter().flat_map(move |nv| roughnesses.map(|roughness| (nv, roughness)));
        let lobes = surfaces.flat_map(|(nv, roughness)| {
            [Geometry::Smith, Geometry::Karis2013].map(|geometry| (nv, roughness, table_lobe(nv, roughness, geometry)))
        });
        lobes.flat_map(|(nv, roughness, lobe)| [0.04, 0.5, 1.0].map(|f0| (nv, roughness, f0, lobe)))
    }

    /// Under light that is linear in direction all that counts is the mean vector.
    #[test]
    fn irradiance_and_round_lobes_have_the_lobes_own_mean() {
        for (nv, roughness, f0, lobe) in lobes() {
            for split_sum in [SplitSum::Moment, SplitSum::OneLobe, SplitSum::TwoLobes] {
                let found = lobe.matched(f0, nv, roughness, split_sum);
                let mean = found.mean(nv, 1.0);
                let own = lobe.mean(f0, nv);
                let off = (mean[0] - own[0]).hypot(mean[1] - own[1]);
                assert!(off < 1e-9, "{split_sum:?} ({nv}, {roughness}), F0 {f0}: {found:?} has {mean:?}, not {own:?}");
                assert_eq!(split_sum == SplitSum::Moment, found.even == 0.0, "{found:?}");
            }
        }
    }

    /// A lobe of no width would be a mirror's, and more than all of irradiance would leave a negative one.
    #[test]
    fn round_lobes_keep_a_width() {
        for (nv, roughness, f0, lobe) in lobes() {
            let single = lobe.matched(f0, nv, roughness, SplitSum::Moment).spread;
            let Match { even, spread, each_spread, apart, .. } = lobe.matched(f0, nv, roughness, SplitSum::TwoLobes);
            let told = format!("({nv}, {roughness}), F0 {f0}: {even}, {spread}, {each_spread} of {single}");
            assert!((0.0..0.99).contains(&even) && each_spread > 0.1 * single && each_spread <= spread, "{told}");
            // None are apart at n = v, nor on rough surfaces.
            assert_eq!(apart == [0.0, 0.0], nv == 1.0 || roughness >= 0.8, "{told}");
        }
    }

    /// At a roughness of 0.3 and n·v = 0.25 the BRDF's lobe is about four times as long in the plane of incidence as across it.
    #[test]
    fn two_lobes_are_narrower_across_than_one() {
        let lobe = table_lobe(0.25, 0.3, Geometry::Smith);
        let [one, two] = [SplitSum::OneLobe, SplitSum::TwoLobes].map(|way| lobe.matched(1.0, 0.25, 0.3, way));
        assert_eq!((one.even, one.towards, one.spread), (two.even, two.towards, two.spread));
        let (least, most) = (0.6 * one.each_spread, 0.8 * one.each_spread);
        assert!(one.each_spread == one.spread && (least..most).contains(&two.each_spread), "{one:?}, {two:?}");
    }

    /// The length of the mean of directions that a lobe of spread 0 is mirrored to, by normals spread evenly over a square.
    #[test]
    fn lobes_are_as_wide_as_turning_normals_make_them() {
        const STEPS: i32 = 40;
        for (nv, side) in [(1.0, 0.05), (0.8, 0.2), (0.5, 0.3), (0.3, 0.1)] {
            let v = DVec3::new(sine(nv), 0.0, nv);
            let mut sum = DVec3::ZERO;
            for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
                let [x, y] = [i, j].map(|i| side * ((f64::from(i) + 0.5) / f64::from(STEPS) - 0.5));
                let n = DVec3::new(x, y, 1.0).normalize();
                sum += 2.0 * n.dot(v) * n - v;
            }
            let own = 1.0 - sum.length() / f64::from(STEPS * STEPS);
            let spread = turned_spread(0.0, nv, 2.0 * side * side / 12.0);
            assert!((spread / own - 1.0).abs() < 0.03, "n·v {nv}, side {side}: {spread}, not {own}");
            let wider = turned_spread(0.3, nv, 2.0 * side * side / 12.0);
            assert!(((1.0 - wider) / (0.7 * (1.0 - spread)) - 1.0).abs() < 1e-12, "n·v {nv}: {wider}");
        }
    }
}
