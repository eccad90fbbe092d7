//! Which widening of roughness comes closest to all of a footprint's normals together, and flickers least.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use crate::Result;
use crate::asset::Texture;
use crate::asset::texture::Encoding;
use crate::reference::brdf::d_ggx;
use crate::reference::mip::Widening;

/// Footprints along a side that are judged; each half a footprint from the last.
const FOOTPRINTS: usize = 12;

/// One way on one normal map.
#[derive(Clone, Debug, Serialize)]
pub struct WideningRow {
    pub map: &'static str,
    /// Along a footprint's side.
    pub texels: usize,
    pub roughness: f64,
    pub method: &'static str,
    /// Mean over footprints and half vectors of |D of the one widened lobe − mean of all normals' D|, over the mean of the
    /// latter.
    pub error: f64,
    /// The same of the change from one footprint to the next, half of it further: what is seen to twinkle.
    pub flicker: f64,
}

/// Measures every way on shipped normal maps.
pub fn measure(textures: &Path, full: bool) -> Result<Vec<WideningRow>> {
    let sizes: &[usize] = if full { &[4, 8, 16, 32] } else { &[4, 16] };
    let mut rows = Vec::new();
    for map in ["floor-tiles", "old-bricks", "oxidised-gold"] {
        let texture = Texture::load(&textures.join(map).join("normal.jpg"), Encoding::Normal)?;
        for texels in sizes {
            for roughness in [0.2, 0.4, 0.6] {
                let lobes = lobes(&texture, *texels, roughness);
                rows.extend(Widening::ALL.map(|widening| {
                    let [error, flicker] = judge(&lobes, widening, roughness);
                    WideningRow { map, texels: *texels, roughness, method: widening.name(), error, flicker }
                }));
            }
        }
    }
    Ok(rows)
}

/// One footprint: its mean normal, not normalised, and for each half vector the mean of D.
struct Footprint {
    mean: DVec3,
    truth: Vec<f64>,
}

/// Half vectors up to 40° from straight up, evenly over the cap.
fn half_vectors() -> Vec<DVec3> {
    let most = 1.0 - 40f64.to_radians().cos();
    let at = |i: u32| {
        let (z, around) = (1.0 - most * (f64::from(i) + 0.5) / 48.0, f64::from(i) * 2.399_963);
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * around.cos(), across * around.sin(), z)
    };
    (0..48).map(at).collect()
}

/// Rows of footprints; the next in a row overlaps the last by half.
fn lobes(texture: &Texture, texels: usize, roughness: f64) -> Vec<Vec<Footprint>> {
    let (width, pixels): (usize, Vec<&[u8; 4]>) = (texture.width as usize, texture.texels().collect());
    let normal = |x: usize, y: usize| {
        let [a, b, c, _] = pixels[y % texture.height as usize * width + x % width];
        let n = DVec3::new(f64::from(*a), f64::from(*b), f64::from(*c)) / 127.5 - 1.0;
        n.normalize_or(DVec3::Z)
    };
    let (alpha, halves) = (roughness * roughness, half_vectors());
    let footprint = |x: usize, y: usize| {
        let normals: Vec<DVec3> =
            (0..texels).flat_map(|v| (0..texels).map(move |u| (u, v))).map(|(u, v)| normal(x + u, y + v)).collect();
        let count = normals.len() as f64;
        let truth = halves.iter().map(|h| normals.iter().map(|n| d_ggx(*n, *h, alpha)).sum::<f64>() / count).collect();
        Footprint { mean: normals.iter().sum::<DVec3>() / count, truth }
    };
    // Spread over the map, so that every part of its pattern counts.
    let row = |i: usize| (0..FOOTPRINTS).map(|k| footprint(i * 83 + k * texels / 2, i * 61)).collect();
    (0..FOOTPRINTS).into_par_iter().map(row).collect()
}

fn judge(lobes: &[Vec<Footprint>], widening: Widening, roughness: f64) -> [f64; 2] {
    let (alpha_squared, halves) = (roughness.powi(4), half_vectors());
    let (mut wrong, mut restless, mut all) = (0.0, 0.0, 0.0);
    for row in lobes {
        let mut last: Option<Vec<f64>> = None;
        for footprint in row {
            let alpha = widening.alpha_squared(alpha_squared, footprint.mean.length()).sqrt();
            let n = footprint.mean.normalize_or(DVec3::Z);
            let difference: Vec<f64> =
                halves.iter().zip(&footprint.truth).map(|(h, truth)| d_ggx(n, *h, alpha) - truth).collect();
            wrong += difference.iter().map(|d| d.abs()).sum::<f64>();
            all += footprint.truth.iter().sum::<f64>();
            if let Some(last) = last {
                restless += difference.iter().zip(last).map(|(now, before)| (now - before).abs()).sum::<f64>();
            }
            last = Some(difference);
        }
    }
    let steps = (FOOTPRINTS - 1) as f64 / FOOTPRINTS as f64;
    [wrong / all, restless / (steps * all)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(texel: impl Fn(u32) -> [u8; 4]) -> Texture {
        let pixels = (0..64 * 64).flat_map(texel).collect();
        Texture { name: "t".into(), width: 64, height: 64, encoding: Encoding::Normal, pixels }
    }

    #[test]
    fn flat_maps_need_no_widening_and_bumpy_ones_do() {
        let flat = lobes(&texture(|_| [128, 128, 255, 255]), 4, 0.4);
        for widening in Widening::ALL {
            let [error, flicker] = judge(&flat, widening, 0.4);
            assert!(error < 1e-6 && flicker < 1e-6, "{widening:?}: {error}");
        }
        let bumpy = lobes(&texture(|i| [(90 + (i * 37) % 77) as u8, (90 + (i * 91) % 77) as u8, 240, 255]), 4, 0.3);
        let [none, fisher] = [Widening::None, Widening::Fisher].map(|widening| judge(&bumpy, widening, 0.3));
        assert!(fisher[0] < 0.7 * none[0] && fisher[1] < none[1], "{fisher:?} against {none:?}");
    }
}
