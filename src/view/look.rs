//! How a scene is to look, wherever it is shown: what the command line says of shading, models and textures.

use clap::Args;

use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::Gpu;
use crate::precompute::{Cache, Options};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::table::SplitSum;
use crate::render::{Settings, Shading};
use crate::scene::Model;

/// What windows, headsets and pictures have in common.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Look {
    /// How surfaces are shaded, or which of their inputs and terms is shown.
    #[arg(long, value_enum, default_value_t)]
    pub shading: Shading,
    /// Masking and shadowing term.
    #[arg(long, value_enum, default_value_t)]
    pub geometry: Geometry,
    /// How often light bounces between a surface's microfacets.
    #[arg(long, value_enum, default_value_t)]
    pub scattering: Scattering,
    /// How surfaces mirror the panorama.
    #[arg(long, value_enum, default_value_t)]
    pub split_sum: SplitSum,
    /// Model what the scene needs, or everything: the same picture, slower.
    #[arg(long, value_enum, default_value_t)]
    pub model: Model,
    #[command(flatten)]
    pub textures: TextureChoice,
}

impl Look {
    /// The same for a renderer on this GPU, which keeps what it makes in `cache`.
    pub fn settings(&self, gpu: &Gpu, cache: Option<&Cache>, report: &Report) -> Settings {
        Settings {
            geometry: self.geometry,
            scattering: self.scattering,
            split_sum: self.split_sum,
            model: self.model,
            precompute: Options { cache: cache.cloned(), ..Options::default() },
            textures: self.textures.options(gpu, cache, report),
            ..Settings::default()
        }
    }
}

/// How textures are kept.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub struct TextureChoice {
    /// How textures are stored: four bytes a texel, or compressed to one. What suits the GPU if left out.
    // A processor takes ten times as long for each texel of a block (measured on lavapipe), and has no memory to save.
    #[arg(long = "textures", value_enum, value_name = "TEXTURES")]
    pub storage: Option<Storage>,
    /// GPU memory for textures; what does not fit is drawn with smaller ones. What is free, less a margin, if left out.
    #[arg(long = "texture-budget", value_name = "MIB")]
    pub budget_mib: Option<u32>,
    /// Samples of a texture seen at a slant, at most: 1 (quick, blurred) to 16. 8 if left out, or 1 where the processor draws.
    // lavapipe 22.3 takes 160 s for a frame of Dabrovic Sponza with any but 1, and under 1 s with that (640×360).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub anisotropy: Option<u32>,
}

impl TextureChoice {
    /// What this GPU can do of it; where that is less, it is told.
    pub fn options(self, gpu: &Gpu, cache: Option<&Cache>, report: &Report) -> TextureOptions {
        let plain = TextureOptions::default();
        let (best, slanted) =
            if gpu.info().is_software() { (Storage::Raw, 1) } else { (Storage::Bc, plain.anisotropy) };
        let mut storage = self.storage.unwrap_or(best);
        if storage == Storage::Bc && !gpu.compresses_textures() {
            report.warn(format!("{}: no block-compressed textures; they take four times the memory", gpu.info().name));
            storage = Storage::Raw;
        }
        let budget_bytes = self.budget_mib.map(|mib| u64::from(mib) << 20);
        let anisotropy = self.anisotropy.unwrap_or(slanted);
        TextureOptions { storage, cache: cache.cloned(), budget_bytes, anisotropy, ..plain }
    }
}
