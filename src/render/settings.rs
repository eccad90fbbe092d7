//! Render settings: given on the command line, changed while the program runs; and which resources have to be made again
//! after a change.

use clap::{Args, ValueEnum};

use super::light_detail::LightDetail;
use super::output::Output;
use super::shared::constant;
use crate::asset::{Storage, TextureOptions};
use crate::context::Context;
use crate::gpu::Constant;
use crate::precompute::{Options, check_face_size, check_irradiance_size};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::split_sum::SplitSum;
use crate::scene::Model;
use crate::scene::needs::resolution::Viewpoint;

/// The smallest scale; below it, pictures are unrecognisable.
const SMALLEST_SCALE: f32 = 0.25;
/// The default number of frames that a still reference averages.
const REFERENCE_FRAMES: u64 = 256;

/// Shading modes, in the order of `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Shading {
    /// Physically based.
    #[default]
    Pbr,
    /// Phong: ambient light and point lights only.
    Phong,
    /// Base color.
    #[value(alias = "albedo")]
    BaseColor,
    /// Shading normal in world space, n/2 + 1/2.
    Normal,
    Metallic,
    Roughness,
    Occlusion,
    /// Texture coordinates, v downwards.
    Uv,
    /// Tangent in world space, t/2 + 1/2.
    Tangent,
    /// Normal distribution D / (1 + D), for the first point light or else one at the eye.
    D,
    /// Fresnel reflectance, likewise.
    F,
    /// Masking and shadowing, likewise.
    G,
    /// The environment's diffuse light.
    Diffuse,
    /// The environment's specular light.
    Specular,
    /// Irradiance / pi.
    Irradiance,
    /// The reference: the shading integral without approximation, sampled and averaged over frames.
    Reference,
}

impl Shading {
    /// The default number of frames of a still picture.
    pub fn default_frames(self) -> u64 {
        if self == Self::Reference { REFERENCE_FRAMES } else { 1 }
    }

    /// The mode `steps` further in the list of all, which wraps around. If the view does not hold still, as in a headset,
    /// [`Shading::Reference`] is skipped: it would be noisy and far too slow.
    pub fn step(self, steps: usize, holds_still: bool) -> Self {
        let all = Self::value_variants();
        let next = |at: usize| (at + steps) % all.len();
        let at = next(all.iter().position(|shading| *shading == self).unwrap_or(0));
        if holds_still || all[at] != Self::Reference { all[at] } else { all[next(at)] }
    }
}

/// Which paths of light are modelled; each value includes those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum LightModel {
    /// The panorama as a whole, its sun in it, and lamps: nothing blocks their light.
    Open,
    /// The panorama's sun is a light of its own, a disc; the rest of the panorama is open.
    Direct,
    /// All light, that which surfaces give back included.
    #[default]
    Baked,
}

/// What the reference traces, the order of `glsl/path.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Nothing blocks light or gives it back.
    None,
    /// Lamps and the sun cast shadows.
    Direct,
    /// All light, along all paths.
    All,
}

/// What of surfaces' light the reference shows, for finding out what an approximation of one part loses; the order of
/// `glsl/importance.glsl`. All but the first are without the sky.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightPart {
    #[default]
    All,
    /// What comes straight from lamps and the sun.
    Direct,
    /// All other light, as far as it comes back diffuse.
    SoftDiffuse,
    /// And as far as it comes back mirrored, by one bounce between microfacets or several.
    SoftSpecular,
}

/// How a scene is drawn.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct RenderSettings {
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
    /// Which paths of light are modelled.
    #[arg(long, value_enum, default_value_t)]
    pub light: LightModel,
    #[command(flatten)]
    pub light_detail: LightDetail,
    /// Model what the scene needs, or everything: the same picture, slower.
    #[arg(long, value_enum, default_value_t)]
    pub model: Model,
    /// Samples of each pixel at the edges of triangles: 1 (quick, jagged) or 4.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = parse_samples)]
    pub samples: u32,
    /// Draw pictures smaller by this factor, 0.25 to 1, and enlarge them; `--shading reference` is always drawn whole.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = parse_scale)]
    pub scale: f32,
    /// Texels along a face of the sharpest mirrored light: a power of two from 16 to 1024.
    #[arg(long, value_name = "N", default_value_t = Options::default().face_size,
        value_parser = |text: &str| parse_side(text, check_face_size))]
    pub cube_size: u32,
    /// Texels along a face of the diffuse light: a power of two from 4 to 128.
    #[arg(long, value_name = "N", default_value_t = Options::default().irradiance_size,
        value_parser = |text: &str| parse_side(text, check_irradiance_size))]
    pub irradiance_size: u32,
    #[command(flatten)]
    pub textures: TextureSettings,
    /// What of the light the reference shows.
    #[arg(skip)]
    pub part: LightPart,
    /// What pictures hold.
    #[arg(skip)]
    pub output: Output,
    /// The only viewpoint of all pictures, if it is known; otherwise they may be taken from anywhere.
    #[arg(skip)]
    pub viewpoint: Option<Viewpoint>,
}

impl Default for RenderSettings {
    fn default() -> Self {
        let Options { face_size, irradiance_size } = Options::default();
        Self {
            shading: Shading::default(),
            geometry: Geometry::default(),
            scattering: Scattering::default(),
            split_sum: SplitSum::default(),
            light: LightModel::default(),
            light_detail: LightDetail::default(),
            model: Model::default(),
            samples: 4,
            scale: 1.0,
            cube_size: face_size,
            irradiance_size,
            textures: TextureSettings::default(),
            part: LightPart::default(),
            output: Output::default(),
            viewpoint: None,
        }
    }
}

/// How textures are stored and sampled; whatever is left out is chosen for the GPU.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub struct TextureSettings {
    /// How textures are stored: four bytes a texel, or compressed to one. What suits the GPU if left out.
    // A processor takes ten times as long for each texel of a block (measured on lavapipe), and has no memory to save.
    #[arg(long = "textures", value_enum, value_name = "TEXTURES")]
    pub storage: Option<Storage>,
    /// GPU memory for textures; the largest lose levels until all fit. What is free, less a margin, if left out.
    #[arg(long = "texture-budget", value_name = "MIB")]
    pub budget_mib: Option<u32>,
    /// Samples of a texture seen at a slant, at most: 1 (quick, blurred) to 16. 8 if left out, or 1 on a software renderer.
    // lavapipe 22.3 takes 160 s for a frame of Dabrovic Sponza with any but 1, and under 1 s with that (640×360).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub anisotropy: Option<u32>,
    /// Leave out the N largest levels of each texture.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=16))]
    pub drop_levels: u32,
}

impl TextureSettings {
    /// The options for loading textures for this context's GPU.
    pub fn options(&self, context: &Context) -> TextureOptions {
        let gpu = &context.gpu;
        let (storage, anisotropy) = if gpu.info().is_software() {
            (Storage::Raw, 1)
        } else {
            (Storage::Bc, TextureOptions::default().anisotropy)
        };
        let storage = self.storage.unwrap_or(storage);
        TextureOptions {
            storage: if gpu.compresses_textures() { storage } else { Storage::Raw },
            cache: context.cache.clone(),
            budget_bytes: self.budget_mib.map(|mib| u64::from(mib) << 20),
            dropped_levels: self.drop_levels,
            anisotropy: self.anisotropy.unwrap_or(anisotropy),
        }
    }

    /// The same, with defaults for this context's GPU filled in.
    pub fn resolved(&self, context: &Context) -> Self {
        let TextureOptions { storage, anisotropy, .. } = self.options(context);
        Self { storage: Some(storage), anisotropy: Some(anisotropy), ..*self }
    }

    /// Warns if textures should be compressed but the GPU does not support that.
    pub(super) fn warn_if_raw(&self, context: &Context) {
        let gpu = &context.gpu;
        if self.storage != Some(Storage::Raw) && !gpu.info().is_software() && !gpu.compresses_textures() {
            let name = &gpu.info().name;
            context.report.warn(format!("{name}: no block-compressed textures; they take four times the memory"));
        }
    }
}

/// The resources that have to be made again when settings change; each variant includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Change {
    Nothing,
    /// Render targets.
    Targets,
    /// Pipelines.
    Pipelines,
    /// Light maps and the BRDF table.
    Light,
    /// The scene, with its textures.
    Scene,
}

impl RenderSettings {
    fn is_baked(&self) -> bool {
        self.light == LightModel::Baked
    }

    /// The constants of shaders that say which BRDF surfaces have.
    pub(super) fn brdf_constants(&self) -> [Constant; 2] {
        let multiple = u32::from(self.scattering == Scattering::Multiple);
        [(constant::GEOMETRY, self.geometry as u32), (constant::MULTI_SCATTER, multiple)]
    }

    /// What the reference traces: the exact counterpart of the light model.
    pub fn transport(&self) -> Transport {
        match self.light {
            LightModel::Open => Transport::None,
            LightModel::Direct if !self.light_detail.has_shadow_maps() => Transport::None,
            LightModel::Direct => Transport::Direct,
            LightModel::Baked => Transport::All,
        }
    }

    /// The options for precomputing light.
    pub fn precompute(&self) -> Options {
        Options { face_size: self.cube_size, irradiance_size: self.irradiance_size }
    }

    /// The same but for how light is precomputed, which is `other`'s.
    pub fn with_light_of(&self, other: &Self) -> Self {
        let Self { geometry, split_sum, light, cube_size, irradiance_size, .. } = *other;
        Self { geometry, split_sum, light, cube_size, irradiance_size, ..self.clone() }
    }

    /// The resources that have to be made again to change from these settings to others.
    pub fn difference(&self, other: &Self) -> Change {
        // A new field does not compile until it is listed here.
        let Self {
            shading,
            geometry,
            scattering,
            split_sum,
            light,
            light_detail,
            model,
            samples,
            scale,
            cube_size,
            irradiance_size,
            textures,
            part,
            output,
            viewpoint,
        } = other;
        let needs = [
            (self.scale != *scale, Change::Targets),
            (self.samples != *samples || self.output != *output || self.part != *part, Change::Pipelines),
            (self.shading != *shading || self.scattering != *scattering, Change::Pipelines),
            (self.geometry != *geometry || self.split_sum != *split_sum, Change::Light),
            (self.light != *light, Change::Light),
            // A lightmap needs coordinates of its own, and is computed for one BRDF.
            (self.is_baked() != other.is_baked(), Change::Scene),
            (self.is_baked() && self.brdf_constants() != other.brdf_constants(), Change::Scene),
            (self.light_detail != *light_detail, Change::Scene),
            (self.cube_size != *cube_size || self.irradiance_size != *irradiance_size, Change::Light),
            (self.model != *model || self.textures != *textures || self.viewpoint != *viewpoint, Change::Scene),
        ];
        needs.into_iter().filter(|(differs, _)| *differs).map(|(_, change)| change).max().unwrap_or(Change::Nothing)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadings_wrap_around_and_skip_the_reference_where_the_view_moves() {
        let all = Shading::value_variants();
        for (steps, holds_still) in [(1, true), (all.len() - 1, true), (1, false), (all.len() - 1, false)] {
            let mut seen = vec![Shading::Pbr];
            loop {
                let next = seen[seen.len() - 1].step(steps, holds_still);
                if next == Shading::Pbr {
                    break;
                }
                assert!(!seen.contains(&next), "{seen:?}, then {next:?}");
                seen.push(next);
            }
            assert_eq!(seen.len(), all.len() - usize::from(!holds_still));
            assert_eq!(seen.contains(&Shading::Reference), holds_still);
        }
        assert_eq!(Shading::Reference.step(1, false), Shading::Pbr);
    }

    #[test]
    fn arguments_left_out_are_the_defaults() {
        let command = RenderSettings::augment_args(clap::Command::new("settings").no_binary_name(true));
        let matches = command.try_get_matches_from(Vec::<String>::new()).unwrap();
        let parsed = <RenderSettings as clap::FromArgMatches>::from_arg_matches(&matches).unwrap();
        assert_eq!(parsed, RenderSettings::default());
    }

    #[test]
    fn a_change_is_as_large_as_its_largest_part() {
        let direct = || RenderSettings { light: LightModel::Direct, ..RenderSettings::default() };
        let baked = RenderSettings::default;
        let no_shadows = LightDetail { shadow_size: Some(0), ..LightDetail::default() };
        let changes = [
            (direct(), Change::Nothing),
            (RenderSettings { scale: 0.5, ..direct() }, Change::Targets),
            (RenderSettings { shading: Shading::Phong, ..direct() }, Change::Pipelines),
            (RenderSettings { samples: 1, scale: 0.5, ..direct() }, Change::Pipelines),
            (RenderSettings { output: Output::Linear, ..direct() }, Change::Pipelines),
            (RenderSettings { cube_size: 64, ..direct() }, Change::Light),
            (RenderSettings { light: LightModel::Open, ..direct() }, Change::Light),
            (RenderSettings { light_detail: no_shadows, ..direct() }, Change::Scene),
            (RenderSettings { scattering: Scattering::Single, ..direct() }, Change::Pipelines),
            (RenderSettings { geometry: Geometry::Karis2013, shading: Shading::D, ..direct() }, Change::Light),
            (RenderSettings { model: Model::Everything, cube_size: 64, ..direct() }, Change::Scene),
        ];
        for (other, change) in changes {
            assert_eq!(direct().difference(&other), change, "{other:?}");
            assert_eq!(other.difference(&direct()), change, "{other:?}");
        }
        // A lightmap is computed for one BRDF.
        let single = RenderSettings { scattering: Scattering::Single, ..baked() };
        for other in [direct(), single] {
            assert_eq!(baked().difference(&other), Change::Scene, "{other:?}");
            assert_eq!(other.difference(&baked()), Change::Scene, "{other:?}");
        }
    }
}
