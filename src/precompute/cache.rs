//! Precomputed maps from the cache on disk, or else computed and kept there.

use super::texture::{fits, read_texture};
use crate::Result;
use crate::asset::cache::{Cache, Key};
use crate::asset::ktx2::Ktx2;
use crate::context::Context;
use crate::gpu::{Image, PassTime, compute_shaders, stage_file, write_mips};

/// Limit of an entry's header, key and values, in bytes.
const HEAD_BYTES: u64 = 1 << 16;

/// A kind of cached maps.
pub struct CacheKind {
    /// Name of the pass that copies them from the cache, for reports.
    pub copying: &'static str,
    /// Raise it whenever the same input gives other texels for another reason than its shaders, which are part of the
    /// key: other quadrature nodes, interaction lists or push constants.
    pub version: u32,
    /// The compute shaders that make them, in groups.
    pub shaders: &'static [&'static [&'static str]],
}

/// Fills `images` from the cache, or else by `compute`, and then stores them. `source` is everything that they depend
/// on in addition to their kind, names, formats and sizes, and the GPU. Returns the GPU times of `compute`, or that of
/// copying.
pub(super) fn cached(
    context: &Context,
    kind: &CacheKind,
    source: &[&[u8]],
    images: &[(&str, &Image)],
    compute: impl FnOnce() -> Result<Vec<PassTime>>,
) -> Result<Vec<PassTime>> {
    if let Some(times) = load_cached(context, kind, source, images)? {
        return Ok(times);
    }
    let times = compute()?;
    keep_cached(context, kind, source, images)?;
    Ok(times)
}

/// Fills `images` from the cache, if all are there; returns the GPU time of copying. `source` is as for [`keep_cached`].
///
/// # Errors
/// A failed Vulkan call.
pub fn load_cached(
    context: &Context,
    kind: &CacheKind,
    source: &[&[u8]],
    images: &[(&str, &Image)],
) -> Result<Option<Vec<PassTime>>> {
    let Some(cache) = &context.cache else { return Ok(None) };
    let keys = keys(context, kind, source, images)?;
    let found: Option<Vec<Ktx2>> = keys.iter().zip(images).map(|(key, (_, image))| load(cache, key, image)).collect();
    let Some(textures) = found else { return Ok(None) };
    let copies: Vec<_> = images.iter().zip(&textures).map(|((_, image), t)| (*image, &t.levels[..])).collect();
    write_mips(&context.gpu, kind.copying, &copies).map(Some)
}

/// Stores images in the cache. `source` is everything that they depend on in addition to their kind, names, formats and
/// sizes, and the GPU.
///
/// # Errors
/// A failed Vulkan call.
pub fn keep_cached(context: &Context, kind: &CacheKind, source: &[&[u8]], images: &[(&str, &Image)]) -> Result<()> {
    let Some(cache) = &context.cache else { return Ok(()) };
    for (key, (_, image)) in keys(context, kind, source, images)?.iter().zip(images) {
        match read_texture(&context.gpu, &[image]) {
            Ok(texture) => cache.keep(key, texture),
            // The cache saves time only.
            Err(error) => tracing::debug!("cache: {error}"),
        }
    }
    Ok(())
}

/// The key of each image.
fn keys(context: &Context, kind: &CacheKind, source: &[&[u8]], images: &[(&str, &Image)]) -> Result<Vec<String>> {
    // Other GPUs or drivers may round differently.
    let info = context.gpu.info();
    let common = common_key(kind, &compute_shaders()?, [info.name.as_str(), info.driver.as_str()], source);
    Ok(images.iter().map(|(name, image)| image_key(&common, name, image)).collect())
}

fn load(cache: &Cache, key: &str, image: &Image) -> Option<Ktx2> {
    let [width, height] = image.desc().size.map(u64::from);
    // A chain of mips is shorter than twice its first; no texel has more than 16 bytes.
    let limit = HEAD_BYTES + width * height * u64::from(image.desc().shape.layers()) * 2 * 16;
    cache.load(key, limit, |texture| fits(texture, image))
}

/// The part of the key that all maps of one kind and source share. Of `shaders` (names and SPIR-V words) only those of
/// the kind count. In debug builds their words include the GLSL source, so that even a comment in it invalidates
/// entries.
fn common_key(kind: &CacheKind, shaders: &[(&str, Vec<u32>)], machine: [&str; 2], source: &[&[u8]]) -> Key {
    let mut key = Key::new(kind.copying, kind.version);
    machine.iter().for_each(|text| key.add(text.as_bytes()));
    let is_of_kind = |name: &str| kind.shaders.iter().any(|group| group.contains(&stage_file(name)));
    for (name, words) in shaders.iter().filter(|(name, _)| is_of_kind(name)) {
        key.add(name.as_bytes());
        key.add(bytemuck::cast_slice(words));
    }
    source.iter().for_each(|bytes| key.add(bytes));
    key
}

fn image_key(common: &Key, name: &str, image: &Image) -> String {
    let (mut key, desc) = (common.clone(), image.desc());
    key.add(name.as_bytes());
    key.add(format!("{:?} {:?} {:?} {}", desc.format, desc.size, desc.shape, desc.mips).as_bytes());
    key.text()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precompute::{brdf_table, light_maps};

    const KIND: CacheKind = CacheKind { copying: "maps", version: 1, shaders: &[&["a.comp"], &["b.comp"]] };

    fn shaders(c: u32) -> [(&'static str, Vec<u32>); 3] {
        [("a.comp", vec![1]), ("b.comp", vec![2, 3]), ("other.comp", vec![c])]
    }

    fn key(kind: &CacheKind, shaders: &[(&str, Vec<u32>)], source: &[&[u8]]) -> String {
        common_key(kind, shaders, ["gpu", "driver"], source).text()
    }

    #[test]
    fn a_changed_version_shader_or_source_misses_the_cache_and_an_unused_shader_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().into());
        let format = crate::asset::ktx2::TexelFormat::Rg16Float;
        let levels = vec![vec![7; 64]];
        let texture = Ktx2 { format, size: [4, 4], layers: 0, faces: 1, levels, key_values: [].into() };
        cache.store(&key(&KIND, &shaders(4), &[b"sky"]), texture).unwrap();
        let is_found = |key: String| cache.load(&key, 1 << 20, |_| true).is_some();
        assert!(is_found(key(&KIND, &shaders(4), &[b"sky"])));
        assert!(is_found(key(&KIND, &shaders(5), &[b"sky"])), "no pipeline uses the changed shader");
        assert!(!is_found(key(&CacheKind { version: 2, ..KIND }, &shaders(4), &[b"sky"])));
        assert!(!is_found(key(&CacheKind { copying: "table", ..KIND }, &shaders(4), &[b"sky"])));
        assert!(!is_found(key(&KIND, &[("a.comp", vec![9]), ("b.comp", vec![2, 3])], &[b"sky"])));
        assert!(!is_found(key(&KIND, &[shaders(4).as_slice(), &[("core/a.comp", vec![1])]].concat(), &[b"sky"])));
        assert!(!is_found(key(&KIND, &shaders(4), &[b"sk", b"y"])));
    }

    #[test]
    fn the_shaders_of_every_kind_exist() {
        let all = compute_shaders().unwrap();
        for name in [light_maps::CACHE_KIND, brdf_table::CACHE_KIND].iter().flat_map(|kind| kind.shaders.concat()) {
            assert!(all.iter().any(|(known, _)| *known == name), "{name}");
        }
    }
}
