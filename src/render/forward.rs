//! The forward pass: surfaces, with one pipeline per combination of material features, and the sky behind them. It draws
//! the picture, or one frame of the reference's samples.

use bytemuck::{Pod, Zeroable};

use super::baked_light::BakedLight;
use super::bound_scene::BoundScene;
use super::draws::{DrawCall, ProbeUse};
use super::frame_set::FrameSet;
use super::material_code::shader_for;
use super::output::Output;
use super::pipeline_request::PipelineRequest;
use super::ray_scene::RaySet;
use super::scene_resources::{ATTRIBUTES, PackedVertex};
use super::settings::{LightModel, RenderSettings, Shading};
use super::shared::{constant, ray_feature};
use crate::Result;
use crate::gpu::{Blend, Commands, Constant, Cull, DepthState, Format, GraphicsDesc, Pipeline};
use crate::reference::energy::Scattering;
use crate::scene::MaterialFeatures;

/// Push constants of `glsl/draw.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    instance: u32,
    probes: u32,
}

/// The fragment stages and the format and samples of their target.
struct Stages {
    surface: &'static str,
    cutout: &'static str,
    sky: &'static str,
    colour: Format,
    samples: u32,
}

impl Stages {
    /// `probes`: for what some probe reaches; `late_depth`: what [`Gpu::wants_late_depth`](crate::gpu::Gpu::wants_late_depth) says.
    fn new(settings: &RenderSettings, probes: bool, late_depth: bool) -> Self {
        if settings.shading == Shading::Reference {
            return Self {
                surface: "reference.frag",
                cutout: "reference.frag",
                sky: "reference_sky.frag",
                colour: Output::Linear.format(),
                samples: 1,
            };
        }
        let (colour, samples) = (settings.output.format(), settings.samples);
        let [surface, holed] = match (probes, late_depth && samples == 4) {
            (false, false) => ["forward.frag", "cutout.frag"],
            (true, false) => ["forward_probes.frag", "cutout_probes.frag"],
            (false, true) => ["forward_late.frag", "cutout_late.frag"],
            (true, true) => ["forward_probes_late.frag", "cutout_probes_late.frag"],
        };
        let cutout = if samples == 4 { holed } else { surface };
        Self { surface, cutout, sky: "sky.frag", colour, samples }
    }
}

/// Pipelines of one variant.
struct SurfacePipelines {
    /// Without probes, or before they hold light.
    plain: Pipeline,
    /// For the other kinds of [`ProbeUse`], where something is drawn by them.
    with_probes: [Option<Pipeline>; ProbeUse::KINDS - 1],
}

impl SurfacePipelines {
    fn draws(&self, call: &DrawCall, probes_hold_light: bool) -> &Pipeline {
        let kind = if probes_hold_light { call.probes.kind() } else { 0 };
        kind.checked_sub(1).and_then(|kind| self.with_probes[kind].as_ref()).unwrap_or(&self.plain)
    }
}

/// Pipelines for the features of one scene.
pub struct ForwardPass {
    /// In the order of the scene's variants.
    surfaces: Vec<SurfacePipelines>,
    sky: Pipeline,
    eyes: u32,
}

impl ForwardPass {
    /// Creates a pipeline for each variant, and the sky's.
    pub fn new(request: &PipelineRequest) -> Result<Self> {
        let PipelineRequest { gpu, layouts, variants, constant_lights, lightmap_layers, settings, eyes, .. } = request;
        let is_reference = settings.shading == Shading::Reference;
        let stages = |probes| Stages::new(settings, probes, gpu.wants_late_depth());
        let Stages { sky, colour, samples, .. } = stages(false);
        let more_features = if request.sky_relays { ray_feature::SKY_RELAYS } else { 0 };
        let common: [Constant; 14] = [
            (constant::EYES, *eyes),
            (constant::SHADING, settings.shading as u32),
            (constant::GEOMETRY, settings.geometry as u32),
            (constant::LINEAR_OUTPUT, u32::from(settings.output == Output::Linear)),
            (constant::SPLIT_SUM, settings.split_sum as u32),
            (constant::SUN, u32::from(request.shades_sun())),
            // Below 0: the shader reads the count from the frame's block.
            (constant::LIGHTS, constant_lights.unwrap_or(u32::MAX)),
            (constant::SPHERE_LIGHTS, request.shown_spheres()),
            (constant::LAMP_SHADOWS, request.lamp_shadows() as u32),
            (constant::SUN_SHADOW, u32::from(request.sun_shadow())),
            (constant::LIGHTMAP, if is_reference { 0 } else { *lightmap_layers }),
            (constant::TRANSPORT, settings.transport() as u32),
            (constant::PART, settings.part as u32),
            request.ray_scene.features(settings.model, more_features),
        ];
        let drawing = layouts.drawing();
        let desc =
            GraphicsDesc { constants: &common, sets: &drawing, colours: &[colour], samples, ..GraphicsDesc::default() };
        let multiple = settings.scattering == Scattering::Multiple;
        let surface = |features: &MaterialFeatures, kind: usize| {
            // A path that begins on one material goes on to others.
            let features = if is_reference { features.with_any_factors() } else { *features };
            let constants: Vec<Constant> = common
                .into_iter()
                .chain(constants(features, multiple))
                .chain([(constant::REFRACTS, u32::from(features.refracts && settings.light == LightModel::Baked))])
                .chain([(constant::SEVERAL_PROBES, u32::from(kind == ProbeUse::SEVERAL))])
                .collect();
            let stages = stages(kind > 0);
            // The reference covers by chance instead.
            let blends = features.blends && !is_reference;
            let blend = match () {
                () if blends && features.tints && gpu.blends_two_sources() => Blend::TwoSources,
                () if blends => Blend::Over,
                () => Blend::None,
            };
            let fragment = match blend {
                Blend::TwoSources if kind > 0 => "tinted_probes.frag",
                Blend::TwoSources => "tinted.frag",
                _ if features.alpha_mask => stages.cutout,
                _ => stages.surface,
            };
            Pipeline::graphics(
                gpu,
                &GraphicsDesc {
                    name: "forward",
                    vertex: "forward.vert",
                    fragment: Some(&shader_for(fragment, &constants)),
                    constants: &constants,
                    push_bytes: size_of::<Push>() as u32,
                    vertex_stride: size_of::<PackedVertex>() as u32,
                    vertex_attributes: &ATTRIBUTES,
                    depth: Some(if blends { DepthState::TEST } else { DepthState::WRITE }),
                    blend,
                    ..desc
                },
            )
        };
        let surfaces_of = |(features, drawn): (&MaterialFeatures, &[bool; ProbeUse::KINDS])| {
            let with_probes = |kind: usize| (drawn[kind] && !is_reference).then(|| surface(features, kind)).transpose();
            let (plain, some, one) = (surface(features, 0)?, with_probes(1)?, with_probes(2)?);
            Ok(SurfacePipelines { plain, with_probes: [some, one] })
        };
        let sky = GraphicsDesc {
            name: "sky",
            vertex: "sky.vert",
            fragment: Some(sky),
            depth: Some(DepthState::TEST),
            ..desc
        };
        let surfaces = variants.iter().zip(&request.drawn).map(surfaces_of).collect::<Result<_>>()?;
        Ok(Self { surfaces, sky: Pipeline::graphics(gpu, &sky)?, eyes: *eyes })
    }

    /// Draws surfaces for all eyes, setting only what changes from call to call. `rays` is for the reference's
    /// samples.
    pub fn draw_surfaces(
        &self,
        commands: &mut Commands<'_>,
        frame: FrameSet<'_>,
        scene: &BoundScene,
        calls: &[DrawCall],
        rays: Option<&RaySet>,
    ) {
        let resources = &scene.resources;
        let probes_hold_light = scene.baked.as_ref().is_some_and(BakedLight::probes_hold_light);
        commands.bind_mesh(&resources.geometry.vertices, &resources.geometry.indices);
        let mut last: Option<&DrawCall> = None;
        for call in calls {
            let changes = |part: fn(&DrawCall) -> u32| last.is_none_or(|last| part(last) != part(call));
            let pipeline = self.surfaces[call.variant as usize].draws(call, probes_hold_light);
            if last.is_none() {
                // All variants have the same pipeline layout, so that sets and push constants stay bound.
                frame.bind(commands, pipeline, 0);
                commands.bind_set(pipeline, 1, &scene.set, &[]);
                rays.iter().for_each(|rays| commands.bind_set(pipeline, 3, &rays.set, &[]));
            } else if changes(|call| call.variant) || changes(|call| call.probes.kind() as u32) {
                commands.bind_pipeline(pipeline);
            }
            if changes(|call| call.textures) {
                commands.bind_set(pipeline, 2, &resources.textures.sets[call.textures as usize], &[]);
            }
            if changes(|call| call.instance) || changes(|call| call.probes.bits()) {
                let push = Push { instance: call.instance, probes: call.probes.bits() };
                commands.push(pipeline, bytemuck::bytes_of(&push));
            }
            if last.is_none_or(|last| last.seen_faces() != call.seen_faces()) {
                commands.cull(call.seen_faces());
            }
            commands.draw_indexed(call.indices.clone(), self.eyes);
            last = Some(call);
        }
        commands.cull(Cull::Nothing);
    }

    /// Draws the panorama wherever nothing else is.
    pub fn draw_sky(
        &self,
        commands: &mut Commands<'_>,
        frame: FrameSet<'_>,
        scene: &BoundScene,
        rays: Option<&RaySet>,
    ) {
        frame.bind(commands, &self.sky, 0);
        commands.bind_set(&self.sky, 1, &scene.set, &[]);
        rays.iter().for_each(|rays| commands.bind_set(&self.sky, 3, &rays.set, &[]));
        commands.draw(3, self.eyes);
    }
}

fn constants(features: MaterialFeatures, multiple: bool) -> [Constant; 19] {
    [
        (constant::HAS_BASE_COLOR_MAP, u32::from(features.base_color_map)),
        (constant::HAS_NORMAL_MAP, u32::from(features.normal_map)),
        (constant::HAS_ORM_MAP, u32::from(features.orm_map)),
        (constant::ALPHA_MASK, u32::from(features.alpha_mask)),
        (constant::METALNESS, features.metalness as u32),
        (constant::MULTI_SCATTER, u32::from(multiple && features.multi_scatter)),
        (constant::EMITS, u32::from(features.emits)),
        (constant::VERTEX_COLOURS, features.vertex_colours as u32),
        (constant::SECOND_UV, features.second_uv),
        (constant::BLENDS, u32::from(features.blends)),
        (constant::TINTS, u32::from(features.tints)),
        (constant::CLEARCOAT, u32::from(features.clearcoat)),
        (constant::SHEEN, u32::from(features.sheen)),
        (constant::ANISOTROPY, u32::from(features.anisotropy)),
        (constant::FILM, u32::from(features.film)),
        (constant::SPECULAR, u32::from(features.specular)),
        (constant::DIFFUSE_TRANSMISSION, u32::from(features.diffuse_transmission)),
        (constant::DISPERSES, u32::from(features.disperses)),
        (constant::EXTENSION_MAP_OF, features.extension_map.map_or(0, |of| of as u32)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_comes_late_only_where_it_is_asked_for_and_with_several_samples() {
        let names = |samples, probes, late| {
            let Stages { surface, cutout, .. } =
                Stages::new(&RenderSettings { samples, ..RenderSettings::default() }, probes, late);
            [surface, cutout]
        };
        assert_eq!(names(4, false, false), ["forward.frag", "cutout.frag"]);
        assert_eq!(names(4, true, true), ["forward_probes_late.frag", "cutout_probes_late.frag"]);
        assert_eq!(names(4, false, true), ["forward_late.frag", "cutout_late.frag"]);
        assert_eq!(names(1, false, true), ["forward.frag", "forward.frag"]);
    }
}
