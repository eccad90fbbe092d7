//! A scene's textures on the GPU, within a budget, and the sets that bind a material's.

use std::collections::HashMap;
use std::sync::Arc;

use serde::Serialize;

use crate::asset::ktx2::TexelFormat;
use crate::asset::material::{Sampling, Wrap};
use crate::asset::mips::level_size;
use crate::asset::{MipChain, TextureOptions};
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, DescriptorSet, DescriptorSetLayout, Format, Gpu, Image, ImageDesc, ImageUsageFlags, Sampler,
    Upload, upload_rows,
};
use crate::render::layouts::Layouts;
use crate::render::settings::RenderSettings;
use crate::scene::{MAPS, Material, Scene, SceneFeatures};
use crate::{Error, Result};

/// GPU memory left free for pictures, light maps and other programs if no budget was given.
const MARGIN_BYTES: u64 = 512 << 20;

/// The memory use of a scene's textures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TextureFacts {
    pub count: usize,
    /// On the GPU, all levels.
    pub bytes: u64,
    /// At four bytes per texel with all levels.
    pub raw_bytes: u64,
    pub budget_bytes: u64,
    /// The most top levels that any texture lost.
    pub dropped_levels: u32,
}

/// A scene's textures on the GPU, and the sets that bind them; copies share both.
#[derive(Clone)]
pub struct SceneTextures {
    /// Different combinations of maps.
    pub sets: Arc<[DescriptorSet]>,
    /// For each of the scene's materials, the index of its set.
    pub of_materials: Arc<[u32]>,
    pub facts: TextureFacts,
    /// Bytes with all levels that the settings ask for and the GPU can have, whatever memory is free.
    pub needed_bytes: u64,
}

impl SceneTextures {
    /// Uploads what the settings need of a scene's textures and the GPU has memory for.
    ///
    /// # Errors
    /// Compressed textures on a GPU without them; no memory; a failed Vulkan call.
    pub fn new(context: &Context, layouts: &Layouts, scene: &Scene, settings: &RenderSettings) -> Result<Self> {
        let margin = affordable_bytes(context.gpu.free_memory());
        let limit = settings.textures.options(context).budget_bytes.unwrap_or(margin);
        Self::within(context, layouts, scene, settings, limit)
    }

    /// The same with at most `limit` bytes, as far as textures get smaller.
    ///
    /// # Errors
    /// Those of [`SceneTextures::new`].
    pub fn within(
        context: &Context,
        layouts: &Layouts,
        scene: &Scene,
        settings: &RenderSettings,
        limit: u64,
    ) -> Result<Self> {
        let options = settings.textures.options(context);
        let features = SceneFeatures::of(scene, settings.model, settings.viewpoint);
        let (images, facts, needed_bytes) =
            upload(context, &scene.textures, &features.first_levels, (&options, limit))?;
        let mut sets = TextureSets::new(&context.gpu, &layouts.textures, &images, options.anisotropy)?;
        let of_materials = scene.materials.iter().map(|material| sets.index(material)).collect::<Result<_>>()?;
        Ok(Self { sets: sets.all.into(), of_materials, facts, needed_bytes })
    }
}

/// Of so much free memory, what a scene's textures may take.
pub fn affordable_bytes(free: u64) -> u64 {
    free - free.min(2 * MARGIN_BYTES) / 2
}

/// Uploads the levels of the scene's textures that are needed and fit into the limit, bytes; returns their memory use, too, and
/// that of all that are needed.
fn upload(
    context: &Context,
    textures: &[MipChain],
    first_levels: &[u32],
    (options, budget): (&TextureOptions, u64),
) -> Result<(Vec<Arc<Image>>, TextureFacts, u64)> {
    let Context { gpu, report, .. } = context;
    if !gpu.compresses_textures()
        && let Some(texture) = textures.iter().find(|texture| texture.format.is_compressed())
    {
        let what = format!("{}: this GPU has no compressed textures; use --textures raw", texture.name);
        return Err(Error::Usage(what));
    }
    let wanted: Vec<u32> = first_levels.iter().map(|first| (*first).max(options.dropped_levels)).collect();
    let needed = small_enough(textures, &wanted, gpu.max_image_size());
    let smaller = needed.iter().zip(&wanted).filter(|(needed, wanted)| needed > wanted).count();
    if smaller > 0 {
        let (name, most, count) = (&gpu.info().name, gpu.max_image_size(), textures.len());
        report.warn(format!("{name} allows {most} texels a side: {smaller} of {count} textures drawn with less"));
    }
    let needed_bytes = total(textures, &fit(textures, &needed, options.budget_bytes.unwrap_or(u64::MAX)));
    let firsts = fit(textures, &needed, budget);
    let facts = facts(textures, &firsts, budget);
    if firsts.iter().zip(&needed).any(|(first, needed)| first > needed) || facts.bytes > budget {
        report.warn(told(textures, &firsts, &facts));
    }
    let all: Vec<(&MipChain, u32)> = textures.iter().zip(firsts).collect();
    let images: Vec<Arc<Image>> =
        all.iter().map(|(texture, first)| image(gpu, texture, *first)).collect::<Result<_>>()?;
    let progress = report.progress("upload", images.len() as u64);
    report.time("upload", || -> Result<()> {
        let mut upload = Upload::new(gpu);
        for (image, (texture, first)) in images.iter().zip(&all) {
            for (mip, level) in (0..).zip(&texture.levels[*first as usize..]) {
                upload.mip(image, mip, texture.format.block_side(), level)?;
            }
            upload.image_done(image)?;
            progress.inc(1);
        }
        upload.finish()
    })?;
    progress.finish_and_clear();
    Ok((images, facts, needed_bytes))
}

/// Descriptor sets of a base color, a normal, an ORM, an emissive and an extension map, one for each combination in use.
struct TextureSets<'a> {
    all: Vec<DescriptorSet>,
    known: HashMap<[Option<(usize, Sampling)>; MAPS], u32>,
    gpu: &'a Arc<Gpu>,
    layout: &'a DescriptorSetLayout,
    images: &'a [Arc<Image>],
    samplers: HashMap<Sampling, Arc<Sampler>>,
    anisotropy: u32,
    /// One texel for maps that are absent: 1 in every channel.
    white: Arc<Image>,
    /// One texel for absent normal maps: in half float, because no eight-bit number is one half.
    flat: Arc<Image>,
}

impl<'a> TextureSets<'a> {
    /// No sets yet.
    fn new(
        gpu: &'a Arc<Gpu>,
        layout: &'a DescriptorSetLayout,
        images: &'a [Arc<Image>],
        anisotropy: u32,
    ) -> Result<Self> {
        let texel = |name, value: [f32; 4]| {
            let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
            let image = Image::new(gpu, name, ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [1, 1], usage))?;
            let halves = value.map(half::f16::from_f32);
            upload_rows(gpu, &image, size_of_val(&halves) as u64, |_| bytemuck::cast_slice(&halves).to_vec())?;
            Ok::<_, Error>(image)
        };
        Ok(Self {
            all: Vec::new(),
            known: HashMap::new(),
            gpu,
            layout,
            images,
            samplers: HashMap::new(),
            anisotropy,
            white: texel("white", [1.0; 4])?,
            flat: texel("flat normal", [0.5, 0.5, 1.0, 1.0])?,
        })
    }

    /// The index of a material's set; creates it if there is none yet.
    fn index(&mut self, material: &Material) -> Result<u32> {
        let maps = material.maps();
        let looked_up = |i: usize| maps[i].map(|map| (map, material.lookups[i].sampling));
        let maps: [_; MAPS] = std::array::from_fn(looked_up);
        if let Some(index) = self.known.get(&maps) {
            return Ok(*index);
        }
        let mut samplers = Vec::new();
        for map in maps {
            samplers.push(self.sampler(map.map_or(Sampling::default(), |(_, sampling)| sampling))?);
        }
        let absent = [&self.white, &self.flat, &self.white, &self.white, &self.white];
        let image = |i: usize| maps[i].map_or(absent[i], |(map, _)| &self.images[map]);
        let bindings: [_; MAPS] = std::array::from_fn(|i| Binding::Sampled(image(i), &samplers[i]));
        let set = DescriptorSet::new(self.gpu, &material.name, self.layout, &bindings)?;
        self.all.push(set);
        let index = self.all.len() as u32 - 1;
        self.known.insert(maps, index);
        Ok(index)
    }

    fn sampler(&mut self, sampling: Sampling) -> Result<Arc<Sampler>> {
        if let Some(known) = self.samplers.get(&sampling) {
            return Ok(Arc::clone(known));
        }
        let mode = |wrap| match wrap {
            Wrap::Repeat => AddressMode::Repeat,
            Wrap::Mirror => AddressMode::Mirror,
            Wrap::Clamp => AddressMode::Clamp,
        };
        let [u, v] = sampling.wrap.map(mode);
        let sampler = Sampler::of_material(self.gpu, [u, v], sampling.nearest, self.anisotropy)?;
        self.samplers.insert(sampling, Arc::clone(&sampler));
        Ok(sampler)
    }
}

/// The first level of each texture, from the wanted one on, whose sides have at most so many texels.
fn small_enough(textures: &[MipChain], wanted: &[u32], most: u32) -> Vec<u32> {
    let fits =
        |texture: &MipChain, first: u32| level_size([texture.width, texture.height], first).iter().all(|s| *s <= most);
    let first =
        |(texture, wanted): (&MipChain, &u32)| (*wanted..32).find(|first| fits(texture, *first)).unwrap_or(*wanted);
    textures.iter().zip(wanted).map(first).collect()
}

/// The first level that is kept of each texture. The textures with the longest side lose a level, all of them at once,
/// until everything fits; the last level always stays.
fn fit(textures: &[MipChain], needed: &[u32], budget: u64) -> Vec<u32> {
    let last = |texture: &MipChain| texture.levels.len() as u32 - 1;
    let mut firsts: Vec<u32> = textures.iter().zip(needed).map(|(t, first)| (*first).min(last(t))).collect();
    let side =
        |(texture, first): (&MipChain, &u32)| level_size([texture.width, texture.height], *first).into_iter().max();
    while total(textures, &firsts) > budget {
        let longest = textures.iter().zip(&firsts).filter_map(side).max().unwrap_or(1);
        if longest <= 1 {
            break;
        }
        for (texture, first) in textures.iter().zip(&mut firsts) {
            *first += u32::from(side((texture, first)) == Some(longest));
        }
    }
    firsts
}

fn total(textures: &[MipChain], firsts: &[u32]) -> u64 {
    textures.iter().zip(firsts).map(|(texture, first)| texture.bytes_from(*first)).sum()
}

fn facts(textures: &[MipChain], firsts: &[u32], budget_bytes: u64) -> TextureFacts {
    TextureFacts {
        count: textures.len(),
        bytes: total(textures, firsts),
        raw_bytes: textures.iter().map(MipChain::raw_bytes).sum(),
        budget_bytes,
        dropped_levels: firsts.iter().copied().max().unwrap_or(0),
    }
}

/// A message about the levels left out.
fn told(textures: &[MipChain], firsts: &[u32], facts: &TextureFacts) -> String {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let fewer = firsts.iter().filter(|first| **first > 0).count();
    let whole: u64 = textures.iter().map(|texture| texture.bytes_from(0)).sum();
    let (bytes, budget) = (mib(facts.bytes), mib(facts.budget_bytes));
    let over = if facts.bytes > facts.budget_bytes { "; they do not get smaller" } else { "" };
    format!(
        "textures: {:.1} MiB do not fit {budget:.1}; {fewer} of {} drawn with up to {} top level(s) less, {bytes:.1} MiB{over} \
         (--texture-budget sets the limit)",
        mib(whole),
        textures.len(),
        facts.dropped_levels
    )
}

fn image(gpu: &Arc<Gpu>, texture: &MipChain, first: u32) -> Result<Arc<Image>> {
    let format = match texture.format {
        TexelFormat::Rgba8 => Format::R8G8B8A8_UNORM,
        TexelFormat::Rgba8Srgb => Format::R8G8B8A8_SRGB,
        TexelFormat::Bc5 => Format::BC5_UNORM_BLOCK,
        TexelFormat::Bc7 => Format::BC7_UNORM_BLOCK,
        TexelFormat::Bc7Srgb => Format::BC7_SRGB_BLOCK,
        TexelFormat::Rg16Float => Format::R16G16_SFLOAT,
        TexelFormat::Rgba16Float => Format::R16G16B16A16_SFLOAT,
        TexelFormat::Rg32Float => Format::R32G32_SFLOAT,
        TexelFormat::Rgba32Float => Format::R32G32B32A32_SFLOAT,
    };
    let size = level_size([texture.width, texture.height], first);
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
    let desc = ImageDesc { mips: texture.levels.len() as u32 - first, ..ImageDesc::flat(format, size, usage) };
    Image::new(gpu, &texture.name, desc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::mips::level_count;

    const NONE: [u32; 4] = [0; 4];

    fn chain(width: u32, height: u32) -> MipChain {
        let levels = (0..level_count([width, height])).map(|level| {
            let [w, h] = level_size([width, height], level);
            vec![0; (4 * w * h) as usize]
        });
        MipChain { name: "t".into(), width, height, format: TexelFormat::Rgba8, levels: levels.collect() }
    }

    #[test]
    fn the_largest_lose_levels_first_and_evenly() {
        let textures = [chain(64, 64), chain(16, 16), chain(32, 64), chain(32, 32)];
        let all = total(&textures, &[0; 4]);
        assert_eq!(fit(&textures, &NONE, all), [0; 4]);
        assert_eq!(fit(&textures, &NONE, all - 1), [1, 0, 1, 0], "both with a side of 64");
        assert_eq!(
            fit(&textures, &NONE, total(&textures, &[1, 0, 1, 0]) - 1),
            [2, 0, 2, 1],
            "then all with a side of 32"
        );
        for budget in (0..all).step_by(97) {
            let firsts = fit(&textures, &NONE, budget);
            assert!(total(&textures, &firsts) <= budget || firsts == [6, 4, 6, 5], "{budget}: {firsts:?}");
        }
        assert_eq!(fit(&textures, &NONE, 0), [6, 4, 6, 5], "the last level stays");
        assert_eq!(fit(&textures, &[5; 4], all), [5, 4, 5, 5]);
        assert_eq!(fit(&[], &[], 0), [0; 0]);
    }

    #[test]
    fn textures_that_are_too_wide_lose_their_top_levels() {
        let textures = [chain(64, 64), chain(16, 16), chain(128, 2)];
        assert_eq!(small_enough(&textures, &[0; 3], 128), [0; 3]);
        assert_eq!(small_enough(&textures, &[0; 3], 32), [1, 0, 2]);
        assert_eq!(small_enough(&textures, &[2, 1, 0], 32), [2, 1, 2]);
    }

    #[test]
    fn what_had_to_go_is_told_in_one_line() {
        let textures = [chain(64, 64), chain(16, 16)];
        let firsts = fit(&textures, &NONE, 7000);
        let facts = facts(&textures, &firsts, 7000);
        let line = told(&textures, &firsts, &facts);
        assert!(line.contains("1 of 2 drawn with up to 1 top level(s) less") && !line.contains('\n'), "{line}");
        assert!(facts.bytes <= 7000 && facts.raw_bytes > 20_000 && facts.dropped_levels == 1, "{facts:?}");
        assert!(told(&textures, &firsts, &TextureFacts { budget_bytes: 1, ..facts }).contains("do not get smaller"));
    }
}
