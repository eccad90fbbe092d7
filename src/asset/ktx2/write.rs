//! KTX 2.0: writing.

use std::path::Path;

use ktx2::{Header, LevelIndex, MAGIC};

use super::{Ktx2, ORIENTATION_KEY, WRITER_KEY};
use crate::asset::file::write_atomically;
use crate::{Error, Result};

impl Ktx2 {
    /// Writes a file atomically.
    ///
    /// # Errors
    /// The file cannot be written, or the texture is invalid (see [`Ktx2::to_bytes`]).
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_bytes(path)?)
    }

    /// The file's content; `path` names it in the error.
    ///
    /// # Errors
    /// Levels whose lengths do not follow from format, size, layers and faces: a defect of the caller.
    pub fn to_bytes(&self, path: &Path) -> Result<Vec<u8>> {
        self.check(path)?;
        let descriptor = self.format.descriptor();
        let key_values = self.key_value_bytes();
        let descriptor_at = Header::LENGTH + LevelIndex::LENGTH * self.levels.len();
        let key_values_at = descriptor_at + descriptor.len();
        let (places, size) = self.places(key_values_at + key_values.len());
        let mut bytes = Vec::with_capacity(size);
        bytes.extend(MAGIC);
        let [width, height] = self.size;
        let levels = self.levels.len() as u32;
        let no_depth = 0;
        let not_compressed = 0;
        let channel = self.format.channel_bytes();
        let layers = self.layers;
        let format = self.format.vulkan();
        let header = [format, channel, width, height, no_depth, layers, self.faces, levels, not_compressed];
        let index = [descriptor_at, descriptor.len(), key_values_at, key_values.len()].map(|n| n as u32);
        header.into_iter().chain(index).for_each(|word| bytes.extend(word.to_le_bytes()));
        // Supercompression global data: none.
        bytes.extend([0; 16]);
        for (level, place) in self.levels.iter().zip(&places) {
            [*place, level.len(), level.len()].iter().for_each(|word| bytes.extend((*word as u64).to_le_bytes()));
        }
        bytes.extend(descriptor);
        bytes.extend(key_values);
        for (level, place) in self.levels.iter().zip(&places).rev() {
            bytes.resize(*place, 0);
            bytes.extend(level);
        }
        Ok(bytes)
    }

    /// Offset of each level (in the file the smallest comes first), and the length of the file.
    fn places(&self, start: usize) -> (Vec<usize>, usize) {
        let mut end = start;
        let mut places: Vec<usize> = Vec::with_capacity(self.levels.len());
        for level in self.levels.iter().rev() {
            let place = end.next_multiple_of(self.format.bytes() as usize);
            places.push(place);
            end = place + level.len();
        }
        places.reverse();
        (places, end)
    }

    /// Length, key, NUL, value and padding to four bytes, for each; sorted by key.
    fn key_value_bytes(&self) -> Vec<u8> {
        let mut all = self.key_values.clone();
        all.insert(WRITER_KEY.into(), concat!("pbr-vr ", env!("CARGO_PKG_VERSION"), "\0").into());
        // x to the right and y down, for faces of cubes as for pictures.
        all.insert(ORIENTATION_KEY.into(), b"rd\0".to_vec());
        let mut bytes = Vec::new();
        for (key, value) in all {
            bytes.extend(((key.len() + 1 + value.len()) as u32).to_le_bytes());
            bytes.extend(key.as_bytes());
            bytes.push(0);
            bytes.extend(value);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        bytes
    }

    fn check(&self, path: &Path) -> Result<()> {
        let sizes_fit = (0u32..).zip(&self.levels).all(|(i, level)| level.len() as u64 == self.level_bytes(i));
        let most = 32 - self.size[0].max(self.size[1]).leading_zeros();
        let count_fits = (1..=most as usize).contains(&self.levels.len());
        let keys_fit = self.key_values.keys().all(|key| !key.is_empty() && !key.contains('\0'));
        let problem = match () {
            () if !sizes_fit || !count_fits => "its levels have wrong sizes",
            () if !keys_fit => "a key is empty or holds a NUL",
            () => return Ok(()),
        };
        let remedy = "this is a defect of pbr-vr, please report it";
        Err(Error::Broken { path: path.into(), what: "KTX2 texture", problem: problem.into(), remedy })
    }
}

#[cfg(test)]
mod tests {
    use super::super::TexelFormat;
    use super::*;

    #[test]
    fn levels_that_do_not_fit_are_refused() {
        let format = TexelFormat::Rg32Float;
        let mut texture =
            Ktx2 { format, size: [2, 1], layers: 0, faces: 1, levels: vec![vec![0; 16]], key_values: [].into() };
        assert!(texture.to_bytes(Path::new("a")).is_ok());
        texture.levels[0].pop();
        assert!(matches!(texture.to_bytes(Path::new("a")), Err(Error::Broken { .. })));
        texture.levels = vec![vec![0; 16], vec![0; 8], vec![0; 8]];
        assert!(texture.to_bytes(Path::new("a")).is_err(), "a level beyond the last");
        texture.levels = vec![];
        assert!(texture.to_bytes(Path::new("a")).is_err());
    }

    #[test]
    fn levels_lie_aligned_and_smallest_first() {
        let format = TexelFormat::Rgba32Float;
        let levels = vec![vec![1; 6 * 64], vec![2; 6 * 16]];
        let texture = Ktx2 { format, size: [2, 2], layers: 0, faces: 6, levels, key_values: [].into() };
        let bytes = texture.to_bytes(Path::new("a")).unwrap();
        let at = |i: usize| u64::from_le_bytes(bytes[i..i + 8].try_into().unwrap()) as usize;
        let (large, small) = (at(80), at(104));
        assert!(small.is_multiple_of(16) && large == small + 96 && bytes.len() == large + 384, "{small} {large}");
        assert_eq!((bytes[small], bytes[large]), (2, 1));
    }
}
