//! Quality options of the command line: shading, models and textures, for every output.

use clap::{Args, ValueEnum as _};

use crate::asset::{Report, Storage, TextureOptions};
use crate::gpu::Gpu;
use crate::precompute::{Cache, Options, check_face_size, check_irradiance_size};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::table::SplitSum;
use crate::render::{Settings, Shading};
use crate::scene::Model;

/// Of sides; what is smaller shows nothing.
const SMALLEST_SCALE: f32 = 0.25;

/// The shading `steps` further in the list of all, which goes round. Where nothing `holds_still`, as in a headset,
/// [`Shading::Reference`] is passed over: it would show its noise alone, and far too slowly.
pub fn next_shading(shading: Shading, steps: usize, holds_still: bool) -> Shading {
    let all = Shading::value_variants();
    let next = |at: usize| (at + steps) % all.len();
    let at = next(all.iter().position(|s| *s == shading).unwrap_or(0));
    if holds_still || all[at] != Shading::Reference { all[at] } else { all[next(at)] }
}

/// What windows, headsets and pictures have in common.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub struct QualityOptions {
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
    /// Samples of each pixel at the edges of triangles: 1 (quick, jagged) or 4. 4 if left out.
    #[arg(long, value_name = "N", value_parser = parse_samples)]
    pub samples: Option<u32>,
    /// Draw pictures smaller by this factor, 0.25 to 1, and enlarge them; `--shading reference` stays as it is.
    #[arg(long, value_name = "FACTOR", value_parser = parse_scale)]
    pub scale: Option<f32>,
    /// Texels along a face of the sharpest mirrored light: a power of two from 16 to 1024. 256 if left out.
    #[arg(long, value_name = "N", value_parser = |text: &str| parse_side(text, check_face_size))]
    pub cube_size: Option<u32>,
    /// Texels along a face of the diffuse light: a power of two from 4 to 128. 32 if left out.
    #[arg(long, value_name = "N", value_parser = |text: &str| parse_side(text, check_irradiance_size))]
    pub irradiance_size: Option<u32>,
    #[command(flatten)]
    pub textures: TextureChoice,
}

impl QualityOptions {
    /// The same for a renderer on this GPU, which keeps what it makes in `cache`.
    pub fn settings(&self, gpu: &Gpu, cache: Option<&Cache>, report: &Report) -> Settings {
        let plain = Settings::default();
        Settings {
            geometry: self.geometry,
            scattering: self.scattering,
            split_sum: self.split_sum,
            model: self.model,
            samples: self.samples.unwrap_or(plain.samples),
            scale: self.scale.unwrap_or(plain.scale),
            precompute: Options {
                face_size: self.cube_size.unwrap_or(plain.precompute.face_size),
                irradiance_size: self.irradiance_size.unwrap_or(plain.precompute.irradiance_size),
                cache: cache.cloned(),
            },
            textures: self.textures.options(gpu, cache, report),
            ..plain
        }
    }
}

fn parse_samples(text: &str) -> std::result::Result<u32, String> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        _ => Err("1 or 4".into()),
    }
}

fn parse_scale(text: &str) -> std::result::Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (SMALLEST_SCALE..=1.0).contains(scale));
    scale.ok_or_else(|| format!("a number from {SMALLEST_SCALE} to 1"))
}

fn parse_side(text: &str, check: fn(u32) -> crate::Result<()>) -> std::result::Result<u32, String> {
    let side = text.parse().map_err(|_| "not a number of texels".to_owned())?;
    check(side).map(|()| side).map_err(|error| error.to_string())
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
    /// Leave out the N largest levels of each texture. 0 if left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=16))]
    pub drop_levels: Option<u32>,
}

impl TextureChoice {
    /// As far as this GPU supports it; where it does not, a warning says so.
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
        let dropped_levels = self.drop_levels.unwrap_or(plain.dropped_levels);
        TextureOptions { storage, cache: cache.cloned(), budget_bytes, dropped_levels, anisotropy }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadings_go_round_and_heads_that_move_never_meet_the_reference() {
        let all = Shading::value_variants();
        for (steps, holds_still) in [(1, true), (all.len() - 1, true), (1, false), (all.len() - 1, false)] {
            let mut seen = vec![Shading::Pbr];
            loop {
                let next = next_shading(seen[seen.len() - 1], steps, holds_still);
                if next == Shading::Pbr {
                    break;
                }
                assert!(!seen.contains(&next), "{seen:?}, then {next:?}");
                seen.push(next);
            }
            assert_eq!(seen.len(), all.len() - usize::from(!holds_still));
            assert_eq!(seen.contains(&Shading::Reference), holds_still);
        }
        // Who asked for it on the command line gets on from there.
        assert_eq!(next_shading(Shading::Reference, 1, false), Shading::Pbr);
    }
}
