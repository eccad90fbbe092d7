//! How light goes on at the boundary of a body that bends it, in f64; twin of `glsl/refraction.glsl`.
//! Local space: +Z is the normal on the side of v.

use glam::DVec3;

use super::math::MIN_COS;

/// Where a path goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// A unit vector; the zero vector where the path ends.
    pub l: DVec3,
    pub transmitted: bool,
    /// By which light is multiplied, without what the surface absorbs.
    pub weight: f64,
}

/// What a smooth boundary reflects of unpolarized light, by Fresnel's equations. `eta`: the index of refraction on the far side over
/// that on the side of incidence.
pub fn fresnel_dielectric(cosine: f64, eta: f64) -> f64 {
    let square = eta * eta - 1.0 + cosine * cosine;
    if square <= 0.0 {
        return 1.0;
    }
    let far = square.sqrt();
    let across = (cosine - far) / (cosine + far);
    let along = (eta * eta * cosine - far) / (eta * eta * cosine + far);
    0.5 * (across * across + along * along)
}

/// Smith's masking of GGX microfacets towards a direction with this cosine, either side: Walter et al., "Microfacet Models for
/// Refraction through Rough Surfaces" (2007), eq. 34.
pub fn masking_ggx(cosine: f64, alpha: f64) -> f64 {
    let squared = (cosine * cosine).max(MIN_COS * MIN_COS);
    2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 / squared - 1.0)).sqrt())
}

/// The half of microfacets with unit normal h that `which`, in [0, 1), takes by its share: mirrored light, or light that goes
/// through. For h from [`super::sampling::sample_vndf`] the weight is the masking of l: Walter et al. (2007), section 5.3, with
/// visible normals.
pub fn cross_boundary(v: DVec3, h: DVec3, alpha: f64, eta: f64, which: f64) -> Crossing {
    let vh = v.dot(h).max(0.0);
    let transmitted = which >= fresnel_dielectric(vh, eta);
    let l = if transmitted { (-v).refract(h, 1.0 / eta) } else { (-v).reflect(h) };
    if (l.z < 0.0) != transmitted {
        return Crossing { l: DVec3::ZERO, transmitted, weight: 0.0 };
    }
    Crossing { l, transmitted, weight: masking_ggx(l.z, alpha) }
}

/// The way of light through a ball, without light that is mirrored inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallPath {
    /// Unit vector from where v sees the ball to where the path leaves it, and the distance in radii.
    pub inside: DVec3,
    pub chord: f64,
    /// Unit vector along which it goes on.
    pub l: DVec3,
}

/// Through a ball of this index of refraction above 1, seen along −v where its normal is n; any space, unit vectors. It leaves at the
/// angle at which it enters.
pub fn ball_path(n: DVec3, v: DVec3, ior: f64) -> BallPath {
    let nv = n.dot(v).max(0.0);
    let cosine = (1.0 - (1.0 - nv * nv) / (ior * ior)).sqrt();
    let inside = (nv / ior - cosine) * n - v / ior;
    let chord = 2.0 * cosine;
    let exit_n = n + chord * inside;
    BallPath { inside, chord, l: ior * inside + (nv - ior * cosine) * exit_n }
}

/// By which the directions of parallel paths through a ball turn, squared, where these move by a radius towards its rim, and around the
/// axis through its middle: together. `nv`: cosine of a path to the normal.
pub fn ball_spread2(nv: f64, ior: f64) -> f64 {
    let (b2, cosine) = ((1.0 - nv * nv).max(1e-6), nv.max(MIN_COS));
    let (b, inside) = (b2.sqrt(), (ior * ior - b2).sqrt());
    // Of the deviation 2 (asin b − asin (b / ior)).
    let along = 2.0 * (1.0 / cosine - 1.0 / inside);
    let sine = b * (inside - cosine) / ior;
    let across = 2.0 * sine * (1.0 - sine * sine).max(0.0).sqrt() / b;
    along * along + across * across
}

/// The variance of directions through a rough ball over that of what its surface mirrors, for a view of its middle and small
/// angles t1 and t2 of the microfacets where light enters and leaves. Inside it turns by (1 − 1/ior) t1, which also moves the place
/// where it leaves: outside by (2 − ior) times that, and by (ior − 1) t2. A mirror turns by 2 t.
pub fn ball_variance(ior: f64) -> f64 {
    let entering = (2.0 - ior) * (1.0 - 1.0 / ior);
    0.25 * (entering * entering + (ior - 1.0) * (ior - 1.0))
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2};

    use super::*;
    use crate::reference::sampling::{basis, hammersley, sample_vndf};

    /// A path from v through a ball of radius 1 whose normal there is n, with half vectors of these points of the unit square.
    fn crossed(n: DVec3, v: DVec3, ior: f64, alpha: f64, points: [DVec2; 2]) -> Option<DVec3> {
        let half = |v: DVec3, u| if alpha > 0.0 { sample_vndf(v, u, DVec2::splat(alpha)) } else { DVec3::Z };
        let through = |world_from_local: DMat3, v: DVec3, eta: f64, u| {
            let v = world_from_local.transpose() * v;
            let crossing = cross_boundary(v, half(v, u), alpha, eta, 0.999_999);
            (crossing.transmitted && crossing.weight > 0.0).then(|| world_from_local * crossing.l)
        };
        let inside = through(basis(n), v, ior, points[0])?;
        let exit_n = (n - 2.0 * n.dot(inside) * inside).normalize();
        through(basis(-exit_n), -inside, 1.0 / ior, points[1])
    }

    #[test]
    fn a_ball_is_two_boundaries() {
        let n = DVec3::new(0.1, 0.7, -0.3).normalize();
        for (i, ior) in [1.1, 1.33, 1.5, 2.4].into_iter().enumerate() {
            for nv in [0.05_f64, 0.4, 0.8, 1.0] {
                let v = basis(n) * DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
                let path = ball_path(n, v, ior);
                let want = crossed(n, v, ior, 0.0, [DVec2::ZERO; 2]).expect("light goes through");
                assert!((path.l - want).length() < 1e-9 && (path.inside.length() - 1.0).abs() < 1e-9, "{i}: {nv}");
                assert!(((n + path.chord * path.inside).length() - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn directions_through_a_ball_turn_as_differences_say() {
        let l = |x: f64, y: f64, ior| ball_path(DVec3::new(x, y, (1.0 - x * x - y * y).sqrt()), DVec3::Z, ior).l;
        let step = 1e-5;
        for (b, ior) in [(0.01, 1.5), (0.3, 1.5), (0.7, 1.33), (0.9, 1.8)] {
            let along = (l(b + step, 0.0, ior) - l(b - step, 0.0, ior)) / (2.0 * step);
            let across = (l(b, step, ior) - l(b, -step, ior)) / (2.0 * step);
            let (want, got) =
                (along.length_squared() + across.length_squared(), ball_spread2((1.0 - b * b).sqrt(), ior));
            assert!((got / want - 1.0).abs() < 1e-4, "{b}, {ior}: {got} against {want}");
        }
    }

    /// Against samples of both boundaries, by the median angle, which long tails do not move.
    #[test]
    fn a_rough_ball_blurs_as_much_less_than_a_mirror() {
        let median = |mut angles: Vec<f64>| {
            angles.sort_by(f64::total_cmp);
            angles[angles.len() / 2]
        };
        let alpha = 0.05;
        let point = |i: u32, turn: u32| hammersley(i.wrapping_mul(turn) % 4096, 12);
        let mirrored: Vec<f64> = (0..4096)
            .map(|i| {
                (-DVec3::Z).reflect(sample_vndf(DVec3::Z, point(i, 1), DVec2::splat(alpha))).z.clamp(-1.0, 1.0).acos()
            })
            .collect();
        for ior in [1.2, 1.5, 1.8] {
            let through =
                (0..4096).filter_map(|i| crossed(DVec3::Z, DVec3::Z, ior, alpha, [point(i, 1), point(i, 1789)]));
            let angles: Vec<f64> = through.map(|l| (-l.z).clamp(-1.0, 1.0).acos()).collect();
            let ratio = (median(angles) / median(mirrored.clone())).powi(2) / ball_variance(ior);
            assert!((ratio - 1.0).abs() < 0.25, "{ior}: {ratio}");
        }
    }

    #[test]
    fn smooth_boundaries_reflect_by_fresnel() {
        // Head on ((n - 1) / (n + 1))^2, from both sides; at Brewster's angle half of what is polarized across.
        for eta in [1.5, 1.0 / 1.5] {
            assert!((fresnel_dielectric(1.0, eta) - 0.04).abs() < 1e-12);
            let brewster = f64::atan(eta);
            let across = (2.0 * brewster).cos().powi(2);
            assert!((fresnel_dielectric(brewster.cos(), eta) - 0.5 * across).abs() < 1e-12);
            assert!((fresnel_dielectric(1e-9, eta) - 1.0).abs() < 1e-7);
        }
        // The same way back: by Snell's law the cosine on the other side gives the same share.
        let inside = (1.0 - (1.0 - 0.36) / 2.25_f64).sqrt();
        assert!((fresnel_dielectric(0.6, 1.5) - fresnel_dielectric(inside, 1.0 / 1.5)).abs() < 1e-12);
        // Beyond the critical angle of 41.8 degrees all of it.
        assert!(fresnel_dielectric(0.74, 1.0 / 1.5) == 1.0 && fresnel_dielectric(0.75, 1.0 / 1.5) < 1.0);
        assert_eq!(fresnel_dielectric(0.5, 1.0), 0.0);
    }

    #[test]
    fn a_smooth_boundary_bends_by_snells_law_and_loses_nothing() {
        let v = DVec3::new(0.6, 0.0, 0.8);
        let through = cross_boundary(v, DVec3::Z, 0.0, 1.5, 0.9);
        assert!(through.transmitted && (through.weight - 1.0).abs() < 1e-12);
        assert!((through.l - DVec3::new(-0.4, 0.0, -0.84_f64.sqrt())).length() < 1e-12, "{through:?}");
        let mirrored = cross_boundary(v, DVec3::Z, 0.0, 1.5, 0.01);
        assert!(!mirrored.transmitted && (mirrored.l - DVec3::new(-0.6, 0.0, 0.8)).length() < 1e-12);
        // From inside at a slant nothing comes out, whatever the chance.
        assert!(!cross_boundary(v, DVec3::Z, 0.0, 0.5, 0.999).transmitted);
    }

    /// Light of the same radiance on both sides comes out with it, but for what microfacets keep between them.
    #[test]
    fn rough_boundaries_lose_little() {
        for (roughness, eta, least) in [(0.1, 1.5, 0.995), (0.3, 1.5, 0.97), (0.5, 1.5, 0.92), (0.5, 1.0 / 1.5, 0.75)] {
            let alpha: f64 = roughness * roughness;
            for nv in [0.3_f64, 0.7, 1.0] {
                let v = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
                let count = 1 << 14;
                let sum: f64 = (0..count)
                    .map(|i| {
                        let u = hammersley(i, 14);
                        // The golden ratio's multiples are even beside the set's points.
                        let which = (f64::from(i) * 0.618_033_988_749_895).fract();
                        let h = sample_vndf(v, DVec2::new(u.x, u.y), DVec2::splat(alpha));
                        cross_boundary(v, h, alpha, eta, which).weight
                    })
                    .sum();
                let albedo = sum / f64::from(count);
                assert!(albedo <= 1.0 + 1e-9 && albedo > least, "{roughness}, {eta}, {nv}: {albedo}");
            }
        }
    }
}
