//! The sun of a panorama: found as one small, bright region and taken out, so that it can be shaded as a disc of its own.
//!
//! Texels as elsewhere: linear RGB radiance, rows from the top, finite and not negative. "Power" is the sum of channels.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cube::{panorama_direction, panorama_texel_solid_angle};

/// Share of all light from which on a source casts a visible shadow. Facing a source of share s under an otherwise even
/// sky, a surface gets s · 4π from it and (1 − s) π from the sky: at 1 %, 4 % more light outside of the shadow than in it.
pub const VISIBLE_SHARE: f64 = 0.01;
/// The sun's mean angular radius as seen from the earth, degrees; no panorama shows it sharper.
pub const LEAST_RADIUS_DEGREES: f64 = 0.2665;
/// Largest radius, degrees: clipped and hazy suns are smaller, and of what is larger (lamps, windows) the shape is seen.
const MOST_RADIUS_DEGREES: f64 = 2.0;
/// The region of a sun, with its glare, lies this near to its brightest texel, degrees.
const REGION_DEGREES: f64 = 5.0;
/// The annulus around the brightest texel, the median of which counts as its surroundings, degrees.
const SURROUNDINGS_DEGREES: [f64; 2] = [3.0, 10.0];
/// The region's texels are this many times as bright as the surroundings …
const CONTRAST: f64 = 10.0;
/// … and have at least this part of the peak: glare below adds next to nothing.
const LEAST_OF_PEAK: f64 = 1e-3;
/// Where the region is too large (a sun in a bright window), the threshold rises by this factor, up to a part of the peak.
const RISE: f64 = 2.0;
const MOST_OF_PEAK: f64 = 0.1;
/// A sun has at least this many times the light of all else that has this part of the peak: two lamps are not a sun.
const DOMINANCE: f64 = 2.0;
/// Gaps of this many texels, such as branches and the ringing of resampling, do not end a region.
const REACH: i64 = 2;
/// Light (the integral of power over the sphere) that shading in f32 can still multiply by any BRDF.
const USABLE_LIGHT: std::ops::Range<f64> = 1e-30..1e30;

/// A disc of even radiance, infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector to the disc's centre, in the panorama's frame.
    pub direction: DVec3,
    /// Irradiance of a surface that faces it, W/m² per channel.
    pub irradiance: DVec3,
    /// Radians.
    pub angular_radius: f64,
    /// Its part of the panorama's light, 0 to 1.
    pub share: f64,
}

/// A panorama's sun, and what is left of the panorama.
#[derive(Clone, Debug, PartialEq)]
pub struct SunSplit {
    pub sun: Sun,
    /// Indices of the texels that change, and what they are without the sun.
    pub changed: Vec<(usize, [f32; 3])>,
}

impl Sun {
    /// The disc's radiance, W/(m² sr): a disc of radiance L has the irradiance π L sin² of its angular radius.
    pub fn radiance(&self) -> DVec3 {
        self.irradiance / (PI * self.angular_radius.sin().powi(2))
    }

    /// The integral of its radiance over the sphere, W/m²: exactly what was taken out of the panorama.
    pub fn light(&self) -> DVec3 {
        self.radiance() * cone_solid_angle(self.angular_radius)
    }
}

/// Solid angle of a cone of this half angle in radians: 2π (1 − cos a), without its cancellation.
pub fn cone_solid_angle(half_angle: f64) -> f64 {
    4.0 * PI * (0.5 * half_angle).sin().powi(2)
}

/// The sun of a panorama of `size` texels, or `None` if it has no small source that dominates all others and gives
/// [`VISIBLE_SHARE`] or more of all light.
///
/// The sun is one connected region around the brightest texel, of texels above a threshold relative to the surroundings.
/// What exceeds the level of the ring around the region is taken out, so that the sky closes over it; the disc has that
/// light, the direction of its mean, and the size of the disc that is as bright as that light is on average.
///
/// # Panics
/// If the number of texels does not match the size: a defect of the caller.
pub fn find_sun(size: [u32; 2], texels: &[[f32; 3]]) -> Option<SunSplit> {
    assert_eq!(texels.len(), size[0] as usize * size[1] as usize, "texels of another panorama");
    let view = View { size, texels };
    let total: f64 = view.sum_of_rows(|_, texel| power(texel)).filter(|total| USABLE_LIGHT.contains(total))?;
    let peak = view.brightest()?;
    let most = power(&texels[peak]);
    let mut threshold = (CONTRAST * view.surroundings(peak)).max(LEAST_OF_PEAK * most);
    while threshold <= MOST_OF_PEAK * most {
        if let Some(region) = view.region(peak, threshold) {
            return view.split(&region, MOST_OF_PEAK * most, total);
        }
        threshold *= RISE;
    }
    None
}

fn power(texel: &[f32; 3]) -> f64 {
    texel.iter().map(|c| f64::from(*c)).sum()
}

/// The angle between unit vectors, radians; exact where it is small.
fn angle(a: DVec3, b: DVec3) -> f64 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

#[derive(Clone, Copy)]
struct View<'a> {
    size: [u32; 2],
    texels: &'a [[f32; 3]],
}

impl View<'_> {
    fn direction(&self, index: usize) -> DVec3 {
        let [width, height] = self.size.map(f64::from);
        let (x, y) = (index % self.size[0] as usize, index / self.size[0] as usize);
        panorama_direction(DVec2::new((x as f64 + 0.5) / width, (y as f64 + 0.5) / height))
    }

    fn solid_angle(&self, index: usize) -> f64 {
        panorama_texel_solid_angle((index / self.size[0] as usize) as u32, self.size)
    }

    /// The integral over the sphere of a function of a texel and its index; rows are added in order, so that it is the same
    /// in every run.
    fn sum_of_rows(&self, value: impl Fn(usize, &[f32; 3]) -> f64 + Sync) -> Option<f64> {
        let width = self.size[0] as usize;
        let row = |(y, row): (usize, &[[f32; 3]])| {
            let sum: f64 = row.iter().enumerate().map(|(x, texel)| value(y * width + x, texel)).sum();
            sum * panorama_texel_solid_angle(y as u32, self.size)
        };
        let rows: Vec<f64> = (width > 0).then(|| self.texels.par_chunks(width).enumerate().map(row).collect())?;
        Some(rows.into_iter().sum())
    }

    /// The first of the brightest texels.
    fn brightest(&self) -> Option<usize> {
        let brighter =
            |a: &usize, b: &usize| power(&self.texels[*a]).total_cmp(&power(&self.texels[*b])).then(b.cmp(a));
        (0..self.texels.len()).into_par_iter().max_by(brighter)
    }

    /// The median power in the annulus around a texel.
    fn surroundings(&self, peak: usize) -> f64 {
        let centre = self.direction(peak);
        let [near, far] = SURROUNDINGS_DEGREES.map(f64::to_radians);
        let rows = self.rows_within(peak, far);
        let width = self.size[0] as usize;
        let around = (rows.start * width..rows.end * width).into_par_iter();
        let inside = around.filter(|i| (near..far).contains(&angle(self.direction(*i), centre)));
        median(inside.map(|i| power(&self.texels[i])).collect())
    }

    /// The rows that an angle around a texel touches.
    fn rows_within(&self, centre: usize, radians: f64) -> std::ops::Range<usize> {
        let (y, rows) = (centre / self.size[0] as usize, self.size[1] as usize);
        let reach = (radians / PI * rows as f64).ceil() as usize + 1;
        y.saturating_sub(reach)..(y + reach + 1).min(rows)
    }

    /// The texels around one, [`REACH`] rows and columns away at most; across the poles and around the seam.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.size.map(i64::from);
        let (x, y) = (index as i64 % width, index as i64 / width);
        (-REACH..=REACH).flat_map(move |dy| {
            let row = y + dy;
            let across_pole = row < 0 || row >= height;
            let row = if row < 0 {
                -1 - row
            } else if row >= height {
                2 * height - 1 - row
            } else {
                row
            };
            let row = row.clamp(0, height - 1);
            let middle = if across_pole { x + width / 2 } else { x };
            (-REACH..=REACH).map(move |dx| (row * width + (middle + dx).rem_euclid(width)) as usize)
        })
    }

    /// The texels above a threshold that are connected with the brightest, in order; `None` if they are not a small region.
    fn region(&self, peak: usize, threshold: f64) -> Option<Vec<usize>> {
        let (centre, reach) = (self.direction(peak), REGION_DEGREES.to_radians());
        let mut found = std::collections::BTreeSet::from([peak]);
        let mut next = vec![peak];
        while let Some(texel) = next.pop() {
            for other in self.neighbours(texel) {
                if power(&self.texels[other]) <= threshold || found.contains(&other) {
                    continue;
                }
                if angle(self.direction(other), centre) > reach {
                    return None;
                }
                found.insert(other);
                next.push(other);
            }
        }
        Some(found.into_iter().collect())
    }

    /// The median of each channel in the ring around a region.
    fn ring_level(&self, region: &[usize]) -> [f32; 3] {
        let ring: std::collections::BTreeSet<usize> = region.iter().flat_map(|i| self.neighbours(*i)).collect();
        let ring: Vec<usize> = ring.into_iter().filter(|i| region.binary_search(i).is_err()).collect();
        // The median of values in f32 is one of them.
        [0, 1, 2].map(|c| median(ring.iter().map(|i| f64::from(self.texels[*i][c])).collect()) as f32)
    }

    /// Takes a region's light out, if it is a sun's; texels elsewhere that are brighter than `rival` count against it.
    fn split(&self, region: &[usize], rival: f64, total: f64) -> Option<SunSplit> {
        let level = self.ring_level(region);
        let (mut light, mut moment, mut squares) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        let mut changed = Vec::with_capacity(region.len());
        for index in region {
            let texel = self.texels[*index];
            let left: [f32; 3] = std::array::from_fn(|c| texel[c].min(level[c]));
            let taken = DVec3::from_array([0, 1, 2].map(|c| f64::from(texel[c]) - f64::from(left[c])));
            let solid_angle = self.solid_angle(*index);
            light += taken * solid_angle;
            moment += self.direction(*index) * (taken.element_sum() * solid_angle);
            squares += taken.element_sum().powi(2) * solid_angle;
            changed.push((*index, left));
        }
        let sum = light.element_sum();
        let elsewhere = |index: usize, texel: &[f32; 3]| {
            let rivals = power(texel) > rival && region.binary_search(&index).is_err();
            if rivals { power(texel) } else { 0.0 }
        };
        // The solid angle that would hold the light at its mean brightness: a disc's own, and hardly more for its glare.
        let solid_angle = sum * sum / squares;
        let angular_radius = (solid_angle / PI).sqrt().max(LEAST_RADIUS_DEGREES.to_radians());
        let is_sun = sum >= VISIBLE_SHARE * total
            && angular_radius <= MOST_RADIUS_DEGREES.to_radians()
            && DOMINANCE * self.sum_of_rows(elsewhere)? <= sum;
        is_sun.then(|| {
            let irradiance = light * (0.5 * angular_radius).cos().powi(2); // π sin² a over 2π (1 − cos a)
            let sun = Sun { direction: moment.normalize(), irradiance, angular_radius, share: sum / total };
            SunSplit { sun, changed }
        })
    }
}

/// The middle one of some values, 0 for none.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
#[path = "sun_tests.rs"]
mod tests;
