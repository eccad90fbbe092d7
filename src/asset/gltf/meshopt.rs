//! Compressed buffer views: `EXT_meshopt_compression`.

use serde::Deserialize;

use crate::asset::contained::contained;

/// The extension's name.
pub const NAME: &str = "EXT_meshopt_compression";

/// By how much a view can grow at most: a block of 256 elements takes a quarter of a byte for each byte of an element, its
/// control bits (specification of the extension, attributes, version 1); other modes take more.
pub const MOST_TIMES: usize = 1024;

/// A compressed view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Packed {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    pub byte_stride: usize,
    pub count: usize,
    mode: String,
    filter: Option<String>,
}

impl Packed {
    /// The size of what is in it.
    pub fn unpacked_bytes(&self) -> Option<usize> {
        self.count.checked_mul(self.byte_stride)
    }
}

/// Four bytes, N times.
#[derive(Clone, Copy)]
struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

/// Decompresses a view.
///
/// # Errors
/// It is not as the extension has it.
pub fn unpack(bytes: &[u8], packed: &Packed) -> Result<Vec<u8>, String> {
    contained(|| unpacked(bytes, packed))?
}

fn unpacked(bytes: &[u8], packed: &Packed) -> Result<Vec<u8>, String> {
    let count = packed.count;
    let bad = |_| "its compressed data cannot be read".to_owned();
    let mut words: Vec<u32> = match (packed.mode.as_str(), packed.byte_stride) {
        ("ATTRIBUTES", stride) => attributes(bytes, count, stride)?,
        ("TRIANGLES", 2 | 4) if !count.is_multiple_of(3) => {
            return Err("its compressed triangles have not three corners".into());
        }
        ("TRIANGLES", 2 | 4) => ::meshopt::decode_index_buffer::<u32>(bytes, count).map_err(bad)?,
        ("INDICES", 2 | 4) => ::meshopt::decode_index_sequence::<u32>(bytes, count).map_err(bad)?,
        _ => return Err("its compression is of no known kind".into()),
    };
    if packed.mode != "ATTRIBUTES" && packed.byte_stride == 2 {
        return Ok(words.iter().flat_map(|index| (*index as u16).to_le_bytes()).collect());
    }
    filter(&mut words, packed)?;
    Ok(words.into_iter().flat_map(u32::to_le_bytes).collect())
}

fn attributes(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u32>, String> {
    fn decode<const N: usize>(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
        let decoded = ::meshopt::decode_vertex_buffer::<Words<N>>(bytes, count);
        let decoded = decoded.map_err(|_| "its compressed data cannot be read".to_owned())?;
        Ok(decoded.into_iter().flat_map(|words| words.0).collect())
    }
    match stride {
        4 => decode::<1>(bytes, count),
        8 => decode::<2>(bytes, count),
        12 => decode::<3>(bytes, count),
        16 => decode::<4>(bytes, count),
        20 => decode::<5>(bytes, count),
        24 => decode::<6>(bytes, count),
        28 => decode::<7>(bytes, count),
        32 => decode::<8>(bytes, count),
        36 => decode::<9>(bytes, count),
        40 => decode::<10>(bytes, count),
        44 => decode::<11>(bytes, count),
        48 => decode::<12>(bytes, count),
        52 => decode::<13>(bytes, count),
        56 => decode::<14>(bytes, count),
        60 => decode::<15>(bytes, count),
        64 => decode::<16>(bytes, count),
        _ => Err(format!("its compressed elements of {stride} bytes are not supported")),
    }
}

fn filter(words: &mut [u32], packed: &Packed) -> Result<(), String> {
    match (packed.filter.as_deref().unwrap_or("NONE"), packed.byte_stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => ::meshopt::decode_filter_oct::<i8>(bytemuck::cast_slice_mut(words)),
        ("OCTAHEDRAL", 8) => ::meshopt::decode_filter_oct::<i16>(bytemuck::cast_slice_mut(words)),
        ("QUATERNION", 8) => ::meshopt::decode_filter_quat(bytemuck::cast_slice_mut(words)),
        ("EXPONENTIAL", _) => ::meshopt::decode_filter_exp::<1>(bytemuck::cast_slice_mut(words)),
        _ => return Err("its compression has no known filter".into()),
    }
    Ok(())
}
