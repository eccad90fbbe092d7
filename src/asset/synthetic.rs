//! A panorama that is hard on every method: sky gradient, noise, checkers, bright windows and, if wanted, a small sun.

use glam::{Vec2, Vec3};

use super::Panorama;

const SUN_RADIANCE: f32 = 2000.0;
const SUN_RADIUS_DEGREES: f32 = 1.0;
/// Radiance of the windows.
const WINDOW_NITS: f32 = 22.0;

/// A panorama of `width` by `width / 2` texels. The sun has a radius of 1° and a radiance of 2000, 40° above the horizon;
/// texels on its edge hold their share, so that it carries the same light at any size.
pub fn synthetic_panorama(width: u32, sun: bool) -> Panorama {
    let height = (width / 2).max(1);
    let mut panorama = Panorama::from_fn(width, height, ground_and_sky);
    panorama.name = if sun { "synthetic-sun" } else { "synthetic" }.into();
    if sun {
        add_sun(&mut panorama);
    }
    panorama
}

fn ground_and_sky(d: Vec3) -> Vec3 {
    let uv = Panorama::uv(d);
    let degrees = Vec2::new(uv.x * 360.0, (0.5 - uv.y) * 180.0);
    let noise = 0.75 + 0.5 * noise(uv);
    if (5.0..25.0).contains(&degrees.y) && degrees.x.rem_euclid(45.0) < 12.0 {
        return Vec3::splat(WINDOW_NITS);
    }
    if degrees.y >= 0.0 {
        let height = degrees.y / 90.0;
        return noise * Vec3::new(0.9, 0.95, 1.0).lerp(Vec3::new(0.15, 0.35, 0.9), height);
    }
    let squares = (degrees / 15.0).floor();
    let light = (squares.x + squares.y).rem_euclid(2.0) < 1.0;
    noise * if light { Vec3::new(0.6, 0.55, 0.5) } else { Vec3::splat(0.05) }
}

/// A value in [0, 1) for each cell of a grid of 4096 by 2048: bits mixed by multiplication, alike at every run.
fn noise(uv: Vec2) -> f32 {
    let cell = (uv * Vec2::new(4096.0, 2048.0)).as_uvec2();
    let mut bits = cell.x.wrapping_mul(0x9e37_79b1) ^ cell.y.wrapping_mul(0x85eb_ca6b);
    for _ in 0..2 {
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    }
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

fn add_sun(panorama: &mut Panorama) {
    /// Points along a texel's side.
    const POINTS: u32 = 16;
    let (width, height) = (panorama.width, panorama.height);
    let middle = direction(Vec2::new(0.7, 0.5 - 40.0 / 180.0));
    let radius = SUN_RADIUS_DEGREES.to_radians();
    let chord = 2.0 * (0.5 * radius).sin();
    let margin = radius + 2.0 * std::f32::consts::TAU / width as f32;
    for y in 0..height {
        for x in 0..width {
            if panorama.direction(x, y).distance(middle) > margin {
                continue;
            }
            let inside = (0..POINTS * POINTS).filter(|i| {
                let at = |i: u32, n: u32| ((i as f32 + 0.5) / POINTS as f32) / n as f32;
                let corner = Vec2::new(x as f32 / width as f32, y as f32 / height as f32);
                let uv = corner + Vec2::new(at(i % POINTS, width), at(i / POINTS, height));
                direction(uv).distance(middle) < chord
            });
            let share = inside.count() as f32 / (POINTS * POINTS) as f32;
            let texel = &mut panorama.texels[(y * width + x) as usize];
            *texel = texel.map(|v| v + share * (SUN_RADIANCE - v));
        }
    }
}

fn direction(uv: Vec2) -> Vec3 {
    let (azimuth, elevation) = ((uv.x - 0.5) * std::f32::consts::TAU, (0.5 - uv.y) * std::f32::consts::PI);
    Vec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::cube::panorama_texel_solid_angle;

    #[test]
    fn the_sun_carries_the_same_light_at_any_size() {
        let expected = f64::from(SUN_RADIANCE) * std::f64::consts::TAU * (1.0 - 1f64.to_radians().cos());
        for width in [64, 256, 1024] {
            let (with, without) = (synthetic_panorama(width, true), synthetic_panorama(width, false));
            let size = [width, width / 2];
            let light: f64 = (0..with.texels.len())
                .map(|i| {
                    let row = i as u32 / width;
                    f64::from(with.texels[i][1] - without.texels[i][1]) * panorama_texel_solid_angle(row, size)
                })
                .sum();
            assert!((light / expected - 1.0).abs() < 0.06, "{width}: {light} against {expected}");
        }
    }

    #[test]
    fn it_has_what_it_promises() {
        let texels = synthetic_panorama(512, true).texels;
        let peak = texels.iter().flatten().copied().fold(0.0, f32::max);
        assert_eq!(peak, SUN_RADIANCE);
        assert!(texels.contains(&[WINDOW_NITS; 3]));
        assert!(texels.iter().flatten().all(|v| v.is_finite() && *v > 0.0));
        assert_eq!(synthetic_panorama(256, true), synthetic_panorama(256, true));
    }
}
