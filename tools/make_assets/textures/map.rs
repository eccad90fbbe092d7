//! Square periodic maps: filled in parallel, differentiated, encoded.

use std::error::Error;
use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

/// Steeper slopes (60°) belong to geometry: as normals they mostly face away, and encode badly.
const STEEPEST: f32 = 1.732;

/// `size`² values, rows from the top.
pub struct Map<T> {
    size: usize,
    values: Vec<T>,
}

impl<T: Copy + Send + Sync> Map<T> {
    /// Asks `at` at every pixel's centre.
    pub fn new(size: usize, at: impl Fn(Vec2) -> T + Sync) -> Self {
        let pixel = |i: usize| at((Vec2::new((i % size) as f32, (i / size) as f32) + 0.5) / size as f32);
        Self { size, values: (0..size * size).into_par_iter().map(pixel).collect() }
    }

    /// The map of another quantity.
    pub fn each<U: Copy + Send + Sync>(&self, f: impl Fn(T) -> U + Sync) -> Map<U> {
        Map { size: self.size, values: self.values.par_iter().map(|v| f(*v)).collect() }
    }

    /// The value at a pixel, wrapped around the edges.
    pub fn wrapped(&self, x: isize, y: isize) -> T {
        let size = self.size as isize;
        self.values[(y.rem_euclid(size) * size + x.rem_euclid(size)) as usize]
    }

    fn each_pixel<U: Send>(&self, f: impl Fn(isize, isize) -> U + Sync) -> Vec<U> {
        let size = self.size;
        (0..size * size).into_par_iter().map(|i| f((i % size) as isize, (i / size) as isize)).collect()
    }
}

impl Map<f32> {
    /// Tangent-space normals of a height field in metres: x right, y towards the picture's top.
    pub fn normals(&self, pixel_metres: f32) -> Map<Vec3> {
        let h = |x, y| self.wrapped(x, y);
        let values = self.each_pixel(|x, y| {
            let rise_right = (h(x + 1, y) - h(x - 1, y)) / (2.0 * pixel_metres);
            let rise_down = (h(x, y + 1) - h(x, y - 1)) / (2.0 * pixel_metres);
            let rise = Vec2::new(rise_right, rise_down).clamp_length_max(STEEPEST);
            Vec3::new(-rise.x, rise.y, 1.0).normalize()
        });
        Map { size: self.size, values }
    }

    /// Cosine-weighted visibility of the sky over a height field: for each of 16 directions the highest horizon, after
    /// Max, "Horizon mapping: shadows for bump-mapped surfaces", 1988; visible share 1 − sin² of the horizon's height.
    pub fn occlusion(&self, pixel_metres: f32) -> Map<f32> {
        const DIRECTIONS: usize = 16;
        const STEPS: [f32; 9] = [1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0, 26.0, 38.0];
        let values = self.each_pixel(|x, y| {
            let here = self.wrapped(x, y);
            let seen = |direction: usize| {
                let (sin, cos) = (TAU * direction as f32 / DIRECTIONS as f32).sin_cos();
                let slope = |step: f32| {
                    let there = self.wrapped(x + (step * cos).round() as isize, y + (step * sin).round() as isize);
                    (there - here) / (step * pixel_metres)
                };
                let steepest = STEPS.into_iter().map(slope).fold(0.0, f32::max);
                1.0 / (1.0 + steepest * steepest)
            };
            (0..DIRECTIONS).map(seen).sum::<f32>() / DIRECTIONS as f32
        });
        Map { size: self.size, values }
    }

    /// As a grey JPEG; values 0..1.
    pub fn grey_jpeg(&self, quality: u8) -> Result<Vec<u8>, Box<dyn Error>> {
        let bytes: Vec<u8> = self.values.iter().map(|v| byte(*v)).collect();
        encode(&bytes, self.size, ExtendedColorType::L8, quality)
    }
}

impl Map<Vec3> {
    /// As a colour JPEG; values 0..1.
    pub fn rgb_jpeg(&self, quality: u8) -> Result<Vec<u8>, Box<dyn Error>> {
        let bytes: Vec<u8> = self.values.iter().flat_map(|v| v.to_array().map(byte)).collect();
        encode(&bytes, self.size, ExtendedColorType::Rgb8, quality)
    }
}

fn encode(bytes: &[u8], size: usize, colour: ExtendedColorType, quality: u8) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut jpeg = Vec::new();
    let edge = u32::try_from(size)?;
    JpegEncoder::new_with_quality(&mut jpeg, quality).write_image(bytes, edge, edge, colour)?;
    Ok(jpeg)
}

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// The sRGB transfer function, IEC 61966-2-1.
pub fn srgb(linear: Vec3) -> Vec3 {
    linear
        .clamp(Vec3::ZERO, Vec3::ONE)
        .map(|x| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}

/// A colour as painters pick it, 0xRRGGBB in sRGB, made linear.
pub fn colour(hex: u32) -> Vec3 {
    let channel = |shift: u32| {
        let x = ((hex >> shift) & 0xff) as f32 / 255.0;
        if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    Vec3::new(channel(16), channel(8), channel(0))
}

/// 0 below `low`, 1 above `high`, smooth between; `low` may be the larger.
pub fn step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
