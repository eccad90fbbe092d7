//! Precomputed maps from the cache on disk, or else computed and kept there.

use std::sync::Arc;

use super::texture::{fits, read_texture};
use crate::Result;
use crate::asset::cache::{Cache, Key};
use crate::asset::ktx2::Ktx2;
use crate::gpu::{Gpu, Image, PassTime, compute_shaders, write_mips};

/// What an entry's header, key and values may take beside its texels.
const HEAD_BYTES: u64 = 1 << 16;

/// Fills `images` from the cache, or else by `compute`, and then keeps them. `source` is all that they depend on beside
/// their names, formats and sizes, the program and the GPU. Returns the GPU times of `compute`, or that of copying,
/// named `copying`.
pub(super) fn cached(
    gpu: &Arc<Gpu>,
    cache: Option<&Cache>,
    copying: &'static str,
    source: &[&[u8]],
    images: &[(&str, &Image)],
    compute: impl FnOnce() -> Result<Vec<PassTime>>,
) -> Result<Vec<PassTime>> {
    let Some(cache) = cache else { return compute() };
    let keys = keys(gpu, source, images)?;
    let found: Option<Vec<Ktx2>> = keys.iter().zip(images).map(|(key, (_, image))| load(cache, key, image)).collect();
    if let Some(textures) = found {
        let copies: Vec<_> = images.iter().zip(&textures).map(|((_, image), t)| (*image, &t.levels[..])).collect();
        return write_mips(gpu, copying, &copies);
    }
    let times = compute()?;
    for (key, (_, image)) in keys.iter().zip(images) {
        match read_texture(gpu, &[image]) {
            Ok(texture) => cache.keep(key, texture),
            // Without a cache everything works, only later.
            Err(error) => tracing::debug!("cache: {error}"),
        }
    }
    Ok(times)
}

fn load(cache: &Cache, key: &str, image: &Image) -> Option<Ktx2> {
    let [width, height] = image.desc().size.map(u64::from);
    // A chain of mips is shorter than twice its first; no texel has more than 16 bytes.
    let limit = HEAD_BYTES + width * height * u64::from(image.desc().shape.layers()) * 2 * 16;
    cache.load(key, limit, |texture| fits(texture, image))
}

/// Each image's key.
fn keys(gpu: &Arc<Gpu>, source: &[&[u8]], images: &[(&str, &Image)]) -> Result<Vec<String>> {
    let mut common = Key::default();
    let program = [env!("CARGO_PKG_VERSION"), env!("PBR_VR_PRECOMPUTE_CODE")];
    // Two GPUs, or two drivers, need not round alike.
    let machine = [gpu.info().name.as_str(), gpu.info().driver.as_str()];
    program.iter().chain(&machine).for_each(|text| common.add(text.as_bytes()));
    for (name, words) in compute_shaders()? {
        common.add(name.as_bytes());
        common.add(bytemuck::cast_slice(&words));
    }
    source.iter().for_each(|bytes| common.add(bytes));
    let key = |(name, image): &(&str, &Image)| {
        let mut key = common.clone();
        let desc = image.desc();
        key.add(name.as_bytes());
        key.add(format!("{:?} {:?} {:?} {}", desc.format, desc.size, desc.shape, desc.mips).as_bytes());
        key.text()
    };
    Ok(images.iter().map(key).collect())
}
