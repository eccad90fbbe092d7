//! Prefiltered radiance around many directions at once, by sums over all texels of a panorama: the truth for whole
//! levels. The same integral as `integrals::prefiltered`, about ten times as fast.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cube::{panorama_direction, panorama_texel_solid_angle};
use super::lobe::kernel;

/// Largest cell as a part of the lobe's scale: the error of sums is about 1e-4.
const CELL: f64 = 0.15;

/// ∫ L K(r·l) dl / ∫ K dl around each r, for a panorama of constant texels (`width · height`, rows from the top) and a
/// lobe of `alpha` > 0. Divided by the sum of its own weights; rows are added in order, so that the result is
/// deterministic.
pub fn prefiltered_around(
    directions: &[DVec3],
    alpha: f64,
    [width, height]: [u32; 2],
    texels: &[[f32; 3]],
) -> Vec<DVec3> {
    // sum of light and of weights for each direction
    type Sums = Vec<(DVec3, f64)>;
    let radians = (std::f64::consts::TAU / f64::from(width)).max(std::f64::consts::PI / f64::from(height));
    let row = |y: u32| -> Sums {
        let mut sums = vec![(DVec3::ZERO, 0.0); directions.len()];
        let solid_angle = panorama_texel_solid_angle(y, [width, height]);
        for x in 0..width {
            let at = |dx: f64, dy: f64| {
                let uv = DVec2::new((f64::from(x) + dx) / f64::from(width), (f64::from(y) + dy) / f64::from(height));
                panorama_direction(uv)
            };
            let l = at(0.5, 0.5);
            let [r, g, b] = texels[(y * width + x) as usize].map(f64::from);
            let light = DVec3::new(r, g, b) * solid_angle;
            for (direction, sum) in directions.iter().zip(&mut sums) {
                let c = direction.dot(l);
                if c < -radians {
                    continue;
                }
                // The lobe's scale is alpha at its centre and grows with the distance; (1 - c) / 2 is that, squared,
                // halved.
                let scale = (alpha * alpha + 0.5 * (1.0 - c)).sqrt();
                let kernel = if radians <= CELL * scale {
                    kernel(c, alpha)
                } else {
                    cells_mean(*direction, alpha, y, height, (radians / (CELL * scale)).ceil().min(64.0) as u32, at)
                };
                sum.0 += light * kernel;
                sum.1 += solid_angle * kernel;
            }
        }
        sums
    };
    let rows: Vec<Sums> = (0..height).into_par_iter().map(row).collect();
    let mut totals = vec![(DVec3::ZERO, 0.0); directions.len()];
    for row in rows {
        for (total, sum) in totals.iter_mut().zip(row) {
            *total = (total.0 + sum.0, total.1 + sum.1);
        }
    }
    totals.into_iter().map(|(light, weight)| light / weight).collect()
}

/// Mean of the lobe over a texel, by cells² points weighted by solid angle.
fn cells_mean(r: DVec3, alpha: f64, y: u32, height: u32, cells: u32, at: impl Fn(f64, f64) -> DVec3) -> f64 {
    let offset = |k: u32| (f64::from(k) + 0.5) / f64::from(cells);
    let (mut sum, mut weights) = (0.0, 0.0);
    for j in 0..cells {
        let weight = panorama_texel_solid_angle(y * cells + j, [1, height * cells]);
        for i in 0..cells {
            sum += weight * kernel(r.dot(at(offset(i), offset(j))), alpha);
            weights += weight;
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::integrals::{PanoramaView, irradiance, prefiltered};

    #[test]
    fn agrees_with_the_sums_for_one_direction() {
        let size = [64, 32];
        let texels: Vec<[f32; 3]> =
            (0..64 * 32).map(|i| [0.1 + (i % 7) as f32, (i % 64) as f32, if i == 700 { 1e4 } else { 1.0 }]).collect();
        let view = PanoramaView::new(64, 32, &texels).unwrap();
        let directions = [DVec3::X, DVec3::Y, DVec3::new(0.6, -0.8, 0.0), DVec3::new(0.48, 0.6, -0.64)];
        for alpha in [1.0 / 64.0, 0.1, 1.0f64] {
            for (r, ours) in directions.iter().zip(prefiltered_around(&directions, alpha, size, &texels)) {
                let want = prefiltered(view, *r, alpha.sqrt());
                assert!((ours - want).abs().max_element() < 2e-3 * want.max_element(), "{ours} against {want}");
                if alpha == 1.0 {
                    let want = irradiance(view, *r) / std::f64::consts::PI;
                    assert!((ours - want).abs().max_element() < 1e-3 * want.max_element(), "{ours} against {want}");
                }
            }
        }
    }
}
