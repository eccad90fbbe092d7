//! Block compression of textures: 16 bytes for 4×4 texels, BC7 for base color and ORM maps, BC5 for normal maps.

use block_compression::decode::decompress_blocks_as_rgba8;
use block_compression::encode::compress_rgba8;
use block_compression::{BC7Settings, CompressionVariant};
use rayon::prelude::*;

use super::Report;

/// Texels along a side of a block.
const SIDE: usize = 4;
/// Bytes of a block.
const BLOCK_BYTES: usize = 16;
/// Rows of blocks that one task compresses.
const ROWS: usize = 8;

/// Sum of squared errors over a block's 48 values, 2² each, up to which a block is not compressed again. With a quarter
/// of it, compression takes five times as long and FLIP improves by 2 %.
const TOLERATED: u32 = 4 * 48;

/// What a block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    /// BC7, three channels; alpha decodes to 1.
    Opaque,
    /// BC7, four channels.
    Alpha,
    /// BC5: the first two channels.
    TwoChannels,
}

/// Compresses RGBA bytes, rows from the top. Sizes that are not multiples of 4 are padded with their last row and
/// column. The time is reported as `compress`.
pub fn compress(block: Block, [width, height]: [u32; 2], rgba: &[u8], report: &Report) -> Vec<u8> {
    let variant = match block {
        Block::Opaque => CompressionVariant::BC7(BC7Settings::opaque_ultra_fast()),
        Block::Alpha => CompressionVariant::BC7(BC7Settings::alpha_ultrafast()),
        Block::TwoChannels => CompressionVariant::BC5,
    };
    let (width, height) = (width as usize, height as usize);
    let across = width.div_ceil(SIDE);
    let mut blocks = vec![0; across * height.div_ceil(SIDE) * BLOCK_BYTES];
    blocks.par_chunks_mut(across * BLOCK_BYTES * ROWS).enumerate().for_each(|(chunk, out)| {
        report.time("compress", || {
            let padded = across * SIDE;
            let rows = out.len() / (across * BLOCK_BYTES) * SIDE;
            let mut strip = Vec::with_capacity(padded * rows * 4);
            for y in (0..rows).map(|y| (chunk * ROWS * SIDE + y).min(height - 1)) {
                let row = &rgba[y * width * 4..(y + 1) * width * 4];
                strip.extend_from_slice(row);
                (width..padded).for_each(|_| strip.extend_from_slice(&row[row.len() - 4..]));
            }
            compress_rgba8(variant, &strip, out, padded as u32, rows as u32, padded as u32 * 4);
            if block == Block::Opaque {
                improve(&strip, padded, out);
            }
        });
    });
    blocks
}

/// Compresses the blocks with an error above [`TOLERATED`] again, with a search that takes 15 times as long. The fast
/// search tries one line of colours per block only: mostly enough for photographs, but not for occlusion, roughness and
/// metallic, which do not correlate.
fn improve(rgba: &[u8], width: usize, blocks: &mut [u8]) {
    let across = width / SIDE;
    let texels = |i: usize| {
        let first = (i / across * SIDE * width + i % across * SIDE) * 4;
        (0..SIDE).flat_map(move |y| &rgba[first + y * width * 4..][..SIDE * 4]).copied().collect::<Vec<u8>>()
    };
    let seen = |block: &[u8]| decompress(Block::Opaque, [SIDE as u32; 2], block);
    let square = |a: u8, b: u8| u32::from(a.abs_diff(b)).pow(2);
    let error = |i: usize, block: &[u8]| -> u32 {
        texels(i).iter().zip(seen(block)).map(|(wanted, got)| square(*wanted, got)).sum()
    };
    let better = CompressionVariant::BC7(BC7Settings::opaque_very_fast());
    for (i, block) in blocks.chunks_exact_mut(BLOCK_BYTES).enumerate() {
        let fast = error(i, block);
        if fast > TOLERATED {
            let mut again = [0; BLOCK_BYTES];
            compress_rgba8(better, &texels(i), &mut again, SIDE as u32, SIDE as u32, SIDE as u32 * 4);
            if error(i, &again) < fast {
                block.copy_from_slice(&again);
            }
        }
    }
}

/// Decodes blocks to RGBA bytes, as a GPU does.
pub fn decompress(block: Block, [width, height]: [u32; 2], blocks: &[u8]) -> Vec<u8> {
    let variant = match block {
        // The encoder settings do not matter for decoding.
        Block::Opaque | Block::Alpha => CompressionVariant::BC7(BC7Settings::opaque_ultra_fast()),
        Block::TwoChannels => CompressionVariant::BC5,
    };
    let [across, down] = [width, height].map(|side| side.next_multiple_of(SIDE as u32));
    let mut padded = vec![0; across as usize * down as usize * 4];
    decompress_blocks_as_rgba8(variant, across, down, blocks, &mut padded);
    let rows = padded.chunks_exact(across as usize * 4).take(height as usize);
    rows.flat_map(|row| &row[..width as usize * 4]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(block: Block, size: [u32; 2], texel: impl Fn(u32, u32) -> [u8; 4]) -> (Vec<[u8; 4]>, Vec<[u8; 4]>) {
        let texels: Vec<[u8; 4]> =
            (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        let blocks = compress(block, size, texels.as_flattened(), &Report::silent());
        assert_eq!(blocks.len(), (size[0].div_ceil(4) * size[1].div_ceil(4) * 16) as usize);
        (decompress(block, size, &blocks).as_chunks::<4>().0.to_vec(), texels)
    }

    fn psnr(pair: &(Vec<[u8; 4]>, Vec<[u8; 4]>), channels: usize) -> f64 {
        let squares = pair
            .0
            .iter()
            .zip(&pair.1)
            .flat_map(|(a, b)| (0..channels).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)));
        let mean = squares.sum::<f64>() / (pair.0.len() * channels) as f64;
        10.0 * (255.0 * 255.0 / mean.max(1e-9)).log10()
    }

    /// Smooth waves with a little grain, as photographs have.
    fn wave(x: u32, y: u32, phase: f32) -> u8 {
        let grain = (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca6b)) >> 29;
        (128.0 + 90.0 * (x as f32 * 0.11 + phase).sin() * (y as f32 * 0.07 + phase).cos()) as u8 + grain as u8
    }

    #[test]
    fn flat_colours_stay_within_one() {
        for value in [[0, 0, 0, 255], [255, 255, 255, 255], [13, 200, 77, 255], [128, 127, 3, 255]] {
            for block in [Block::Opaque, Block::Alpha, Block::TwoChannels] {
                let channels = if block == Block::TwoChannels { 2 } else { 3 };
                let (got, _) = round_trip(block, [9, 5], |_, _| value);
                let near = |t: &[u8; 4]| (0..channels).all(|c| t[c].abs_diff(value[c]) <= 1);
                assert!(got.len() == 45 && got.iter().all(near), "{block:?} {value:?}: {:?}", got[0]);
            }
        }
    }

    #[test]
    fn each_kind_keeps_its_values() {
        let grey = round_trip(Block::Opaque, [61, 34], |x, y| [wave(x, y, 0.0), wave(x, y, 0.3), wave(x, y, 0.5), 255]);
        assert!(psnr(&grey, 3) > 36.0, "colour: {} dB", psnr(&grey, 3));
        let normals = round_trip(Block::TwoChannels, [64, 64], |x, y| [wave(x, y, 0.0), wave(x, y, 2.0), 0, 255]);
        assert!(psnr(&normals, 2) > 44.0, "normals: {} dB", psnr(&normals, 2));
        let leaf = |x: u32, y: u32| [40, wave(x, y, 1.0), 30, if (x / 7 + y / 5).is_multiple_of(2) { 255 } else { 0 }];
        let masked = round_trip(Block::Alpha, [64, 64], leaf);
        assert!(psnr(&masked, 4) > 33.0, "masked: {} dB", psnr(&masked, 4));
        let same_side = masked.0.iter().zip(&masked.1).filter(|(a, b)| (a[3] >= 128) == (b[3] >= 128)).count();
        assert_eq!(same_side, masked.0.len(), "a mask's edge must not move");
    }

    #[test]
    fn uncorrelated_channels_are_compressed_again() {
        let texel = |x, y| [wave(x, y, 0.0), wave(y * 3, x, 1.0), if x % 16 < 7 { 255 } else { 0 }, 255];
        let better = round_trip(Block::Opaque, [64, 64], texel);
        let texels = better.1.as_flattened();
        let mut fast = vec![0; 16 * 16 * BLOCK_BYTES];
        let variant = CompressionVariant::BC7(BC7Settings::opaque_ultra_fast());
        compress_rgba8(variant, texels, &mut fast, 64, 64, 256);
        let fast = (decompress(Block::Opaque, [64, 64], &fast).as_chunks::<4>().0.to_vec(), better.1.clone());
        assert!(psnr(&better, 3) > psnr(&fast, 3) + 3.0, "{} dB against {}", psnr(&better, 3), psnr(&fast, 3));
    }

    #[test]
    fn the_padding_of_odd_sizes_is_the_edge() {
        // Were the padding black, the only column's colour would suffer.
        let (got, texels) = round_trip(Block::Opaque, [1, 3], |_, _| [250, 240, 230, 255]);
        assert!(got.iter().zip(&texels).all(|(a, b)| (0..3).all(|c| a[c].abs_diff(b[c]) <= 1)), "{got:?}");
    }
}
