//! Mips of textures. Colour is averaged in linear light, normals as vectors, roughness as α². Twin of `reference::mip`.

use super::Texture;
use super::texture::{linear_of_srgb_bytes, normal_byte};

/// Weight of a fully transparent texel: its colour counts only where all texels are transparent.
const TRANSPARENT_WEIGHT: f32 = 1.0 / 4096.0;

/// Number of mips down to 1×1.
pub fn level_count(size: [u32; 2]) -> u32 {
    32 - size[0].max(size[1]).max(1).leading_zeros()
}

/// Size of a level: halved for each, rounded down, at least 1.
pub fn level_size(size: [u32; 2], level: u32) -> [u32; 2] {
    size.map(|side| side.checked_shr(level).unwrap_or(0).max(1))
}

/// One level as floats, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Level<const N: usize> {
    pub size: [u32; 2],
    pub texels: Vec<[f32; N]>,
}

/// All levels of a base color map as RGBA bytes, level 0 unchanged. RGB is averaged in linear light. With a `cutoff` of
/// alpha (0 to 1), RGB is weighted by alpha, and alpha is scaled so that each level covers as much as level 0 (Castaño,
/// "Computing Alpha Mipmaps", 2010).
pub fn base_color_levels(texture: Texture, cutoff: Option<f32>) -> Vec<Vec<u8>> {
    let linear = linear_of_srgb_bytes();
    let weighted = cutoff.is_some();
    let read = |[r, g, b, a]: [u8; 4]| {
        let alpha = f32::from(a) / 255.0;
        let weight = if weighted { alpha + TRANSPARENT_WEIGHT } else { 1.0 };
        [
            linear[r as usize] * weight,
            linear[g as usize] * weight,
            linear[b as usize] * weight,
            if weighted { weight } else { alpha },
        ]
    };
    let chain = smaller_levels(&texture, read);
    let coverage = cutoff.map(|cutoff| coverage(texture.pixels.iter().skip(3).step_by(4).copied(), cutoff));
    let bytes = |level: &Level<4>| -> Vec<u8> {
        let alphas = || level.texels.iter().map(|t| if weighted { t[3] - TRANSPARENT_WEIGHT } else { t[3] });
        let scale =
            cutoff.zip(coverage).map_or(1.0, |(cutoff, coverage)| alpha_scale(alphas().collect(), cutoff, coverage));
        let write = |(texel, alpha): (&[f32; 4], f32)| {
            let weight = if weighted { texel[3] } else { 1.0 };
            let colour = |c: usize| byte(linear_to_srgb(texel[c] / weight));
            [colour(0), colour(1), colour(2), byte(alpha * scale)]
        };
        bytes_of(level.texels.iter().zip(alphas()).map(write))
    };
    std::iter::once(texture.pixels).chain(chain.iter().map(bytes)).collect()
}

/// All levels of what is linear in all its channels, as RGBA bytes.
pub fn linear_levels(texture: Texture) -> Vec<Vec<u8>> {
    let chain = smaller_levels(&texture, |texel| texel.map(|value| f32::from(value) / 255.0));
    let bytes = |level: &Level<4>| bytes_of(level.texels.iter().map(|texel| texel.map(byte)));
    std::iter::once(texture.pixels).chain(chain.iter().map(bytes)).collect()
}

/// The mean vectors of a normal map for levels 1 and on, not normalised: the shorter, the more the normals vary.
pub fn mean_normals(texture: &Texture) -> Vec<Level<3>> {
    smaller_levels(texture, unit_normal)
}

/// All levels of a normal map as RGBA bytes, normalised (level 0 too): shaders reconstruct z from x and y.
pub fn normal_levels(texture: &Texture) -> Vec<Vec<u8>> {
    let means = mean_normals(texture);
    let write = |n: [f32; 3]| {
        let [x, y, z] = normalised(n);
        [normal_byte(x), normal_byte(y), normal_byte(z), 255]
    };
    let first = bytes_of(texture.texels().map(|texel| write(unit_normal(*texel))));
    std::iter::once(first).chain(means.iter().map(|l| bytes_of(l.texels.iter().map(|n| write(*n))))).collect()
}

/// All levels of an ORM map (occlusion, roughness, metallic, clear coat) as RGBA bytes, level 0 unchanged. Roughness is averaged as
/// α² = roughness⁴, and widened by the variance that the material's normal map loses at that size
/// (`reference::mip::widened`).
pub fn orm_levels(texture: Texture, normals: Option<&NormalLoss>) -> Vec<Vec<u8>> {
    let unit = |v: u8| f32::from(v) / 255.0;
    let read = |[o, r, m, c]: [u8; 4]| [unit(o), unit(r).powi(4), unit(m), unit(c)];
    let chain = smaller_levels(&texture, read);
    let bytes = |level: &Level<4>| -> Vec<u8> {
        let widths = normals.and_then(|normals| normals.widths(level.size));
        let write = |(i, [o, alpha_squared, m, c]): (usize, &[f32; 4])| {
            let added = widths.as_ref().map_or(0.0, |widths| widths[i]);
            let roughness = (alpha_squared + added).min(1.0).powf(0.25);
            [byte(*o), byte(roughness), byte(*m), byte(*c)]
        };
        bytes_of(level.texels.iter().enumerate().map(write))
    };
    std::iter::once(texture.pixels).chain(chain.iter().map(bytes)).collect()
}

/// The variance of normals that a normal map loses in its mips, for ORM maps of any size.
pub struct NormalLoss {
    size: [u32; 2],
    means: Vec<Level<3>>,
}

impl NormalLoss {
    /// From a normal map.
    pub fn new(texture: &Texture) -> Self {
        Self { size: [texture.width, texture.height], means: mean_normals(texture) }
    }

    /// What is added to α² in a level of `size`; `None` where the normal map has no more texels than that.
    fn widths(&self, size: [u32; 2]) -> Option<Vec<f32>> {
        if size[0] >= self.size[0] && size[1] >= self.size[1] {
            return None;
        }
        // The coarsest level that is at least as fine; with different aspect ratios there may be none.
        let fine = |level: &&Level<3>| level.size[0] >= size[0] && level.size[1] >= size[1];
        let from = self.means.iter().rev().find(fine).or(self.means.first())?;
        let resized;
        let means = if from.size == size {
            from
        } else {
            resized = shrink(from.size, size, |y, row| row.copy_from_slice(row_of(from, y)));
            &resized
        };
        Some(means.texels.iter().map(|n| fisher_width(length(*n))).collect())
    }
}

/// `reference::mip::fisher_width` in f32.
fn fisher_width(r: f32) -> f32 {
    let r = r.clamp(1e-3, 1.0);
    2.0 * (1.0 - r * r) / (r * (3.0 - r * r))
}

/// Levels 1 and on of a texture whose texels `read` decodes.
fn smaller_levels<const N: usize>(texture: &Texture, read: impl Fn([u8; 4]) -> [f32; N]) -> Vec<Level<N>> {
    let size = [texture.width, texture.height];
    let width = texture.width as usize;
    let mut levels: Vec<Level<N>> = Vec::new();
    for level in 1..level_count(size) {
        let to = level_size(size, level);
        let next = match levels.last() {
            None => {
                let (texels, _) = texture.pixels.as_chunks::<4>();
                shrink(size, to, |y, row| {
                    row.iter_mut().zip(&texels[y * width..]).for_each(|(out, texel)| *out = read(*texel));
                })
            }
            Some(last) => shrink(last.size, to, |y, row| row.copy_from_slice(row_of(last, y))),
        };
        levels.push(next);
    }
    levels
}

fn bytes_of(texels: impl Iterator<Item = [u8; 4]>) -> Vec<u8> {
    texels.collect::<Vec<_>>().into_flattened()
}

fn row_of<const N: usize>(level: &Level<N>, y: usize) -> &[[f32; N]] {
    let width = level.size[0] as usize;
    &level.texels[y * width..(y + 1) * width]
}

/// Box average of a picture whose rows `fill` writes.
fn shrink<const N: usize>(from: [u32; 2], to: [u32; 2], fill: impl Fn(usize, &mut [[f32; N]])) -> Level<N> {
    let (across, down) = (Taps::new(from[0], to[0]), Taps::new(from[1], to[1]));
    let width = to[0] as usize;
    let mut texels = vec![[0.0; N]; width * to[1] as usize];
    let mut source = vec![[0.0; N]; from[0] as usize];
    let mut summed = source.clone();
    for (k, row) in texels.chunks_exact_mut(width).enumerate() {
        summed.fill([0.0; N]);
        let (first, shares) = down.of(k);
        for (y, share) in (first..).zip(shares) {
            fill(y, &mut source);
            summed.iter_mut().zip(&source).for_each(|(sum, texel)| add(sum, texel, *share));
        }
        for (x, out) in row.iter_mut().enumerate() {
            let (first, shares) = across.of(x);
            summed[first..].iter().zip(shares).for_each(|(texel, share)| add(out, texel, *share));
        }
    }
    Level { size: to, texels }
}

fn add<const N: usize>(sum: &mut [f32; N], texel: &[f32; N], share: f32) {
    for c in 0..N {
        sum[c] += texel[c] * share;
    }
}

/// For each texel along an axis, the first source texel that it covers, and the shares of all.
struct Taps(Vec<(usize, Vec<f32>)>);

impl Taps {
    fn new(from: u32, to: u32) -> Self {
        let tap = |i| {
            let (first, shares) = crate::reference::mip::box_weights(from, to, i);
            (first as usize, shares.into_iter().map(|share| share as f32).collect())
        };
        Self((0..to).map(tap).collect())
    }

    fn of(&self, i: usize) -> (usize, &[f32]) {
        (self.0[i].0, &self.0[i].1)
    }
}

/// Share of texels with at least `cutoff` of alpha.
fn coverage(alphas: impl ExactSizeIterator<Item = u8>, cutoff: f32) -> f32 {
    let count = alphas.len();
    alphas.filter(|a| f32::from(*a) >= cutoff * 255.0).count() as f32 / count.max(1) as f32
}

/// The factor of alpha with which a share as near as possible to `coverage` of the texels has at least `cutoff`; 1
/// where all or none should.
fn alpha_scale(mut alphas: Vec<f32>, cutoff: f32, coverage: f32) -> f32 {
    let stay = (coverage * alphas.len() as f32).round() as usize;
    if stay == 0 || stay >= alphas.len() {
        return 1.0;
    }
    alphas.sort_unstable_by(|a, b| b.total_cmp(a));
    // Equal alphas are on the same side of the cutoff.
    let edge = alphas[stay - 1];
    let (first, end) = (alphas.partition_point(|a| *a > edge), alphas.partition_point(|a| *a >= edge));
    let stay = if first > 0 && stay - first < end - stay { first } else { end };
    let middle = 0.5 * (alphas[stay - 1] + alphas.get(stay).copied().unwrap_or(0.0));
    if middle > 0.0 { cutoff / middle } else { 1.0 }
}

fn unit_normal([x, y, z, _]: [u8; 4]) -> [f32; 3] {
    let signed = |v: u8| f32::from(v) / 127.5 - 1.0;
    normalised([signed(x), signed(y), signed(z)])
}

fn normalised([x, y, z]: [f32; 3]) -> [f32; 3] {
    let length = length([x, y, z]);
    // Zero vectors, and normals that point behind the surface, become (0, 0, 1).
    if length < 1e-6 || z <= 0.0 { [0.0, 0.0, 1.0] } else { [x / length, y / length, z / length] }
}

fn length([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

fn byte(unit: f32) -> u8 {
    (unit * 255.0 + 0.5) as u8
}

fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
#[path = "mips_tests.rs"]
mod tests;
