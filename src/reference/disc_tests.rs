//! The disc light against integrals over the disc, and its samples against their density.

use super::*;
use crate::reference::brdf::{Geometry, d_ggx, specular};
use crate::reference::sampling::hammersley;

fn direction(polar: f64, azimuth: f64) -> DVec3 {
    DVec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
}

/// The mean over the disc, by points that are even over its solid angle.
fn over_disc(l: DVec3, sine: f64, value: impl Fn(DVec3) -> f64) -> f64 {
    const STEPS: [u32; 2] = [48, 48];
    let at = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    let points = (0..STEPS[0]).flat_map(|i| (0..STEPS[1]).map(move |j| DVec2::new(at(i, STEPS[0]), at(j, STEPS[1]))));
    points.map(|u| value(sample_disc(u, l, sine))).sum::<f64>() / f64::from(STEPS[0] * STEPS[1])
}

fn smith(n: DVec3, v: DVec3, l: DVec3, alpha: f64) -> f64 {
    let f0 = DVec3::splat(0.04);
    f_schlick(f0, 0.5 * (v + l).length()).x
        * d_ggx(n, v + l, alpha)
        * v_smith_height_correlated(n.dot(l), n.dot(v), alpha)
}

/// Karis (2013), section "Representative point": the disc's point nearest to the mirror direction, the lobe normalised.
fn representative(n: DVec3, v: DVec3, l: DVec3, alpha: f64, sine: f64) -> f64 {
    let r = 2.0 * n.dot(v) * n - v;
    let to_ray = r.dot(l) * r - l;
    let nearest = (l + to_ray * (sine / to_ray.length().max(1e-12)).min(1.0)).normalize();
    let wider = (alpha + 0.5 * sine).min(1.0);
    smith(n, v, nearest, alpha) * (alpha / wider).powi(2)
}

#[test]
fn probe() {
    let n = DVec3::Z;
    for degrees in [0.2665, 1.0, 2.0f64] {
        let sine = degrees.to_radians().sin();
        for roughness in [0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0f64] {
            let alpha = (roughness * roughness).max(DISC_MIN_ALPHA);
            let mut line = String::new();
            for view in [45.0, 70.0, 85.0f64] {
                let v = direction(view.to_radians(), 0.0);
                let mirror = 2.0 * v.z * n - v;
                let frame = basis(mirror);
                let width = 2.0 * alpha + sine;
                let (mut off, mut sum, mut peak, mut worst) = ([0.0; 3], 0.0, 0.0f64, [0.0f64; 3]);
                for ring in 0..12 {
                    for step in 0..8 {
                        let away = width * 3.0 * ((f64::from(ring) + 0.5) / 12.0).powi(2);
                        let (s, c) = (f64::from(step) * TAU / 8.0).sin_cos();
                        let l = (frame * DVec3::new(away * c, away * s, 1.0)).normalize();
                        let exact = over_disc(l, sine, |l| if l.z > 0.0 { smith(n, v, l, alpha) * l.z } else { 0.0 });
                        let cosine = disc_cosine(l.z, sine);
                        let ours = disc_specular(n, v, l, DVec3::splat(0.04), alpha, sine).x * cosine;
                        let point =
                            specular(n, v, l, DVec3::splat(0.04), alpha.sqrt(), Geometry::Smith).x * l.z.max(0.0);
                        let karis = representative(n, v, l, alpha, sine) * l.z.max(0.0);
                        let weight = away * (f64::from(ring) + 0.5);
                        sum += weight * exact;
                        peak = peak.max(exact);
                        for (i, value) in [ours, karis, point].into_iter().enumerate() {
                            off[i] += weight * (value - exact).abs();
                            worst[i] = worst[i].max((value - exact).abs());
                        }
                    }
                }
                line += &format!("  {view:2}°: {:.3} | {:.3}", off[0] / sum, worst[0] / peak);
            }
            println!("a {degrees:.3} r {roughness:.2}{line}");
        }
    }
}
