//! The split sum's table: directional albedo and mean vector of the lobe, by quadrature, with a relative error of 1e-7.

use std::{
    f64::consts::{FRAC_PI_2, PI},
    sync::LazyLock,
};

use glam::DVec3;

use super::{
    brdf::{Geometry, schlick_weight, v_environment},
    math::{MIN_COS, TINY},
};

/// Directional albedo of the specular BRDF as a linear function of F0: F0 · scale + bias. Karis (2013), eq. 8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// A: the red channel of the table.
    pub scale: f64,
    /// B: the green channel.
    pub bias: f64,
}

/// Nodes for exact values, and for estimates in a hundredth of the time.
static NODES: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| tanh_sinh(60));
static FEW_NODES: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| tanh_sinh(7));

/// Nodes in (0, 1) and weights of the tanh-sinh rule, one in the middle and `half` to each side: Takahasi and Mori,
/// "Double Exponential Formulas for Numerical Integration" (1974). Its nodes are dense at the ends, where the integrand
/// below changes rapidly.
fn tanh_sinh(half: i32) -> Vec<[f64; 2]> {
    let step = 3.2 / f64::from(half); // beyond 3.2 the weights are below 1e-15
    let node = |i: i32| {
        let t = f64::from(i) * step;
        let s = FRAC_PI_2 * t.sinh();
        // (1 + tanh s) / 2, accurate near 0.
        [1.0 / (1.0 + (-2.0 * s).exp()), step * PI / 4.0 * t.cosh() / s.cosh().powi(2)]
    };
    (-half..=half).map(node).collect()
}

/// One part of the lobe BRDF · n·l over the light's directions l. With r = reflect(−v, n), and t the unit vector
/// perpendicular to r in the plane of incidence on n's side, its mean vector is (1 − along) r + across t.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobePart {
    /// The part's integral.
    pub weight: f64,
    pub along: f64,
    /// across / sin(θv), which has a limit at n = v.
    pub across_over_sine: f64,
}

/// The specular lobe at n·v and a roughness for F0: its part without Schlick's weight times F0, and its part with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lobe {
    pub base: LobePart,
    pub fresnel: LobePart,
}

impl Lobe {
    /// The mean vector for a grey F0, as (1 − along, across): along r, and across it towards n.
    pub fn mean(&self, f0: f64, nv: f64) -> [f64; 2] {
        let share = self.share_of_base(f0);
        let mix = |base: f64, fresnel: f64| share * base + (1.0 - share) * fresnel;
        let across_over_sine = mix(self.base.across_over_sine, self.fresnel.across_over_sine);
        [1.0 - mix(self.base.along, self.fresnel.along), across_over_sine * sine(nv)]
    }

    /// How much of the lobe is its part without Schlick's weight.
    pub(super) fn share_of_base(&self, f0: f64) -> f64 {
        let base = f0 * self.base.weight;
        base / (base + self.fresnel.weight)
    }
}

pub(super) fn sine(nv: f64) -> f64 {
    (1.0 - nv * nv).max(0.0).sqrt()
}

/// Ratio of the resolution at n·v = 0 to that at 1; the same in `glsl/table.glsl`.
const STEEPNESS: f64 = 1024.0;

/// n·v and roughness of a texel of a table of this size; twin of `table_arguments` in `glsl/table.glsl`.
pub fn table_arguments(texel: [u32; 2], size: [u32; 2]) -> [f64; 2] {
    let [x, y] = std::array::from_fn(|i| f64::from(texel[i]) / f64::from(size[i] - 1));
    [((1.0 + STEEPNESS).powf(x) - 1.0) / STEEPNESS, y.powi(3)]
}

/// Position of n·v and a roughness in the table, 0 and 1 at the centres of the first and last texels; the inverse of
/// [`table_arguments`]. `table_coordinate` in `glsl/table.glsl` converts it to texture coordinates.
pub fn table_place(nv: f64, roughness: f64) -> [f64; 2] {
    [(STEEPNESS * nv).ln_1p() / STEEPNESS.ln_1p(), roughness.cbrt()]
}

/// The table's entry at n·v = nv in [0, 1] and a roughness in [0, 1]; relative error 1e-7.
pub fn table_entry(nv: f64, roughness: f64, geometry: Geometry) -> Entry {
    LobeSums::new(&NODES, nv, roughness, geometry).entry()
}

/// The same with an error of 1e-3, in a hundredth of the time.
pub fn coarse_table_entry(nv: f64, roughness: f64, geometry: Geometry) -> Entry {
    LobeSums::new(&FEW_NODES, nv, roughness, geometry).entry()
}

/// The lobe at n·v = nv in [0, 1] and a roughness in [0, 1]; relative error 1e-7.
///
/// Integrates V · 4 nl · vh / nh over half vectors drawn from D (Walter et al. 2007, eqs. 14 and 35), with weights (1 −
/// v·h)⁵ separately. h is (θ, φ); l is above the surface exactly for θ < (ψ + π/2) / 2 with tan ψ = tan(θv) cos φ, and
/// there nl = R sin(2 (θmax − θ)), so the integrand is smooth inside and the horizon costs no accuracy.
pub fn table_lobe(nv: f64, roughness: f64, geometry: Geometry) -> Lobe {
    LobeSums::new(&NODES, nv, roughness, geometry).lobe(nv)
}

/// Sums over a part of the lobe: of 1, of 1 − l·r and of l·t.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    along: f64,
    across: f64,
}

impl Sums {
    fn add(&mut self, value: f64, along: f64, across: f64) {
        self.weight += value;
        self.along += value * along;
        self.across += value * across;
    }

    fn part(&self, sv: f64) -> LobePart {
        let Self { weight, along, across } = *self;
        let over = 1.0 / weight.max(TINY);
        LobePart { weight, along: along * over, across_over_sine: across * over / sv }
    }
}

/// Sums over the lobe's parts.
#[derive(Default)]
struct LobeSums {
    base: Sums,
    fresnel: Sums,
}

impl LobeSums {
    fn new(nodes: &[[f64; 2]], nv: f64, roughness: f64, geometry: Geometry) -> Self {
        let nv = inner(nv);
        let alpha = roughness * roughness;
        let mut sums = Self::default();
        if alpha < MIRROR {
            // D is a point, G is 1.
            sums.fresnel.weight = schlick_weight(nv);
            sums.base.weight = 1.0 - sums.fresnel.weight;
            return sums;
        }
        let sv = sine(nv);
        for ([x, wx], quarter) in nodes.iter().flat_map(|node| [(node, 0.0), (node, 1.0)]) {
            let cos_phi = ((quarter + x) * FRAC_PI_2).cos();
            let psi = (sv * cos_phi).atan2(nv);
            let radius = nv.hypot(sv * cos_phi);
            let theta_max = 0.5 * (psi + FRAC_PI_2);
            // tan θ = α tan s makes D nh dω = 2 sin s cos s ds dφ / 2π.
            let (sin_max, cos_max) = theta_max.sin_cos();
            let s_max = sin_max.atan2(alpha * cos_max);
            for [y, wy] in nodes {
                let (sin_s, cos_s) = (y * s_max).sin_cos();
                let theta = (alpha * sin_s).atan2(cos_s);
                let (sin_theta, nh) = theta.sin_cos();
                let nl = radius * (2.0 * (theta_max - theta)).sin();
                let vh = sv * sin_theta * cos_phi + nv * nh;
                if nl <= 0.0 || vh <= 0.0 || nh <= 0.0 {
                    continue; // only by rounding, at the ends
                }
                let brdf = v_environment(nl, nv, roughness, geometry) * 4.0 * nl * vh / nh;
                // φ and −φ are alike: twice a quarter turn over 2π is ½.
                let value = wx * wy * 0.5 * brdf * s_max * 2.0 * sin_s * cos_s;
                let weight = schlick_weight(vh);
                // (l − r) / 2 = (v·h) h − (n·v) n in the plane of incidence, where t is (nv, sv).
                let (x, z) = (vh * sin_theta * cos_phi, sv * sin_theta * cos_phi * nh - nv * sin_theta * sin_theta);
                let along = 2.0 * ((vh * sin_theta).powi(2) + z * z);
                let across = 2.0 * (nv * x + sv * z);
                sums.base.add(value * (1.0 - weight), along, across);
                sums.fresnel.add(value * weight, along, across);
            }
        }
        sums
    }

    fn entry(&self) -> Entry {
        Entry { scale: self.base.weight, bias: self.fresnel.weight }
    }

    fn lobe(&self, nv: f64) -> Lobe {
        let sv = sine(inner(nv));
        Lobe { base: self.base.part(sv), fresnel: self.fresnel.part(sv) }
    }
}

/// Inside the interval: at 1 there is no plane of incidence, but limits.
fn inner(nv: f64) -> f64 {
    nv.clamp(MIN_COS, 1.0 - 1e-9)
}

/// An alpha below this is a mirror's.
const MIRROR: f64 = 1e-9;

/// Directional albedo of the specular BRDF: by reciprocity, the share of uniform light that it reflects towards v.
pub fn specular_albedo(f0: DVec3, nv: f64, roughness: f64, geometry: Geometry) -> DVec3 {
    let entry = table_entry(nv, roughness, geometry);
    f0 * entry.scale + DVec3::splat(entry.bias)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_nodes_have_an_error_below_a_thousandth() {
        for nv in [0.05, 0.2, 0.4, 0.7, 1.0] {
            for roughness in [0.03, 0.1, 0.3, 0.6, 1.0] {
                let [few, all] = [coarse_table_entry, table_entry].map(|entry| entry(nv, roughness, Geometry::Smith));
                let off = (few.scale - all.scale).abs().max((few.bias - all.bias).abs());
                assert!(off < 1e-3, "{few:?} is not {all:?}: {nv}, {roughness}");
            }
        }
    }

    #[test]
    fn karis_spot_values() {
        for (nv, roughness, scale, bias) in [
            (0.001, 0.5, 0.698602, 0.137815),
            (0.001, 1.0, 0.593434, 0.019658),
            (0.01, 0.1, 0.092704, 0.536113),
            (0.01, 0.01, 0.048560, 0.941608),
            (0.1, 0.5, 0.590177, 0.098367),
            (0.5, 0.5, 0.728534, 0.018546),
        ] {
            let entry = table_entry(nv, roughness, Geometry::Karis2013);
            let error = (entry.scale - scale).abs().max((entry.bias - bias).abs());
            assert!(error <= 1e-6, "({nv}, {roughness}): {entry:?} against ({scale}, {bias})");
        }
    }

    /// The same integral over l by plain midpoints: slow and rough, but without any of the steps above.
    fn by_midpoints(nv: f64, roughness: f64, geometry: Geometry) -> Entry {
        const STEPS: u32 = 1000;
        let v = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
        let mut entry = Entry { scale: 0.0, bias: 0.0 };
        for i in 0..STEPS {
            let nl = (f64::from(i) + 0.5) / f64::from(STEPS);
            let across = (1.0 - nl * nl).sqrt();
            for j in 0..STEPS {
                let phi = PI * (f64::from(j) + 0.5) / f64::from(STEPS);
                let h = v + DVec3::new(across * phi.cos(), across * phi.sin(), nl);
                let d = crate::reference::brdf::d_ggx(DVec3::Z, h, roughness * roughness);
                let value = d * v_environment(nl, nv, roughness, geometry) * nl * 2.0 * PI / f64::from(STEPS * STEPS);
                let weight = schlick_weight(0.5 * h.length());
                entry.scale += value * (1.0 - weight);
                entry.bias += value * weight;
            }
        }
        entry
    }

    #[test]
    fn agrees_with_plain_midpoints() {
        for geometry in [Geometry::Smith, Geometry::Karis2013] {
            for (nv, roughness) in [(0.1, 0.6), (0.5, 0.5), (0.9, 1.0)] {
                let (ours, plain) = (table_entry(nv, roughness, geometry), by_midpoints(nv, roughness, geometry));
                let error = (ours.scale - plain.scale).abs().max((ours.bias - plain.bias).abs());
                assert!(error < 1e-5, "{ours:?} against {plain:?} at n·v {nv}, roughness {roughness}");
            }
        }
    }

    #[test]
    fn the_albedo_conserves_energy() {
        for i in 0..=10 {
            for j in 0..=10 {
                let (nv, roughness) = (f64::from(i) / 10.0, f64::from(j) / 10.0);
                for geometry in [Geometry::Smith, Geometry::Karis2013] {
                    let Entry { scale, bias } = table_entry(nv, roughness, geometry);
                    assert!(
                        scale >= 0.0 && bias >= 0.0 && scale + bias < 1.0 + 1e-9,
                        "{scale} {bias}: {nv}, {roughness}"
                    );
                }
            }
        }
        // The mirror is the limit.
        let (smooth, mirror) = (table_entry(0.3, 1e-3, Geometry::Smith), table_entry(0.3, 0.0, Geometry::Smith));
        assert!((smooth.scale - mirror.scale).abs() < 1e-5 && (smooth.bias - mirror.bias).abs() < 1e-5, "{smooth:?}");
    }
}
