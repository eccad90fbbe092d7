//! One frame for N eyes: what no eye sees, forward pass or the exact picture's samples, sky, resolve, text on top.

mod culling;
mod draws;
mod reference_accumulator;
mod eye;
mod forward;
mod gizmos;
mod hidden_area;
mod kept_pipelines;
mod overlay;
#[cfg(test)]
mod random_gpu_tests;
#[cfg(test)]
mod seam_gpu_tests;
mod shared;
#[cfg(test)]
mod shared_gpu_tests;
mod targets;
mod scene_resources;

use std::sync::Arc;

use clap::ValueEnum;
use glam::Mat4;

pub use draws::{CullOptions, Order};
pub use eye::{Eye, IPD_METRES, NEAR_METRES};
pub use gizmos::{ControllerGizmos, GizmoVertex, MAX_GIZMO_VERTICES};
pub use hidden_area::HiddenArea;
pub use kept_pipelines::KeptPipelines;
pub use overlay::Overlay;
pub use reference_accumulator::StandardError;
pub use scene_resources::TextureFacts;
pub use shared::MAX_EYES;
pub use targets::Output;

pub use crate::gpu::FRAMES_IN_FLIGHT;

use crate::Result;
use crate::asset::{Report, TextureOptions};
use crate::gpu::{
    AddressMode, Binding, BindingType, Buffer, BufferKind, Commands, DescriptorSet, DescriptorSetLayout, Gpu, Image,
    PassTime, Sampler,
};
use crate::precompute::{self, BrdfTable, LightMaps};
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::reference::table::SplitSum;
use crate::scene::needs::resolution::Viewpoint;
use crate::scene::{Model, Scene, SceneFeatures};
use draws::DrawList;
use forward::Forward;
use gizmos::GizmosPass;
use reference_accumulator::{ReferenceAccumulator, Shown};
use scene_resources::SceneResources;
use shared::{EyeBlock, FrameBlock};
use targets::{Detail, ViewTargets};

/// What fragments show; the same order as in `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Shading {
    /// Physically based.
    #[default]
    Pbr,
    /// Phong: ambient light and lamps only.
    Phong,
    /// Base colour.
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
    /// Normal distribution D / (1 + D), for the first light or else a lamp at the eye.
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
    /// Physically based without approximation: the panorama sampled, frame after frame, until it is stopped.
    Reference,
}

impl Shading {
    /// Frames that a still picture takes if nobody says how many.
    pub fn default_frames(self) -> u64 {
        if self == Self::Reference { reference_accumulator::DEFAULT_FRAMES } else { 1 }
    }
}

/// How pictures are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub geometry: Geometry,
    pub scattering: Scattering,
    pub split_sum: SplitSum,
    pub model: Model,
    /// Where all pictures will be taken from; `None` for anywhere.
    pub viewpoint: Option<Viewpoint>,
    pub output: Output,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// Sides of what is drawn over those of the picture, to which it is then enlarged: more than 0, at most 1. The exact
    /// picture is always drawn whole.
    pub scale: f32,
    pub precompute: precompute::Options,
    /// The scene's textures are loaded with the same ones.
    pub textures: TextureOptions,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            geometry: Geometry::Smith,
            scattering: Scattering::Multiple,
            split_sum: SplitSum::Moment,
            model: Model::Needed,
            viewpoint: None,
            output: Output::Display,
            samples: 4,
            scale: 1.0,
            precompute: precompute::Options::default(),
            textures: TextureOptions::default(),
        }
    }
}

/// A scene on the GPU and all that draws it.
pub struct Renderer {
    gpu: Arc<Gpu>,
    settings: Settings,
    shading: Shading,
    eyes: u32,
    exposure_ev: f32,
    environment_rotation: f32,
    world: SceneResources,
    culling: CullOptions,
    draws: DrawList,
    light: LightMaps,
    table: BrdfTable,
    samplers: [Arc<Sampler>; 2],
    frame_layout: DescriptorSetLayout,
    frames: Vec<(Arc<Buffer>, DescriptorSet)>,
    forward: Forward,
    /// Only where shading is [`Shading::Reference`].
    exact: Option<ReferenceAccumulator>,
    importance: Arc<Buffer>,
    hidden_area: Option<HiddenArea>,
    /// Made for the first gizmos.
    gizmos: Option<GizmosPass>,
    targets: ViewTargets,
    /// Where the scene's models stand, as a whole.
    world_from_models: Mat4,
    /// 0: as it is, 1: all dark.
    fade: f32,
}

impl Renderer {
    /// Uploads a scene, precomputes its light and makes targets of `size` pixels for `eyes` eyes (1 to [`MAX_EYES`]).
    pub fn new(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        settings: Settings,
        shading: Shading,
        size: [u32; 2],
        eyes: u32,
        report: &Report,
    ) -> Result<Self> {
        let mut pipelines = KeptPipelines::load(gpu, settings.precompute.cache.as_ref());
        let world = SceneResources::new(
            gpu,
            scene,
            &SceneFeatures::of(scene, settings.model, settings.viewpoint),
            &settings.textures,
            report,
        )?;
        let panorama = &scene.environment.panorama;
        let light = report.time("precompute", || LightMaps::new(gpu, panorama, &settings.precompute))?;
        let cache = settings.precompute.cache.as_ref();
        let table = BrdfTable::new(gpu, settings.geometry, settings.split_sum, cache)?;
        let [uniform, storage, sampled] = [BindingType::Uniform, BindingType::Storage, BindingType::Sampled];
        let slots = [uniform, storage, sampled, sampled, sampled, sampled, sampled, storage];
        let frame_layout = DescriptorSetLayout::new(gpu, "frame", &slots)?;
        let samplers = [
            Sampler::new(gpu, "panorama", AddressMode::Panorama, 1)?,
            Sampler::new(gpu, "clamped", AddressMode::Clamp, 1)?,
        ];
        let importance = reference_accumulator::importance_buffer(gpu, &light.panorama, shading)?;
        let frames = make_frames(gpu, &frame_layout, &world, &light, &table, &samplers, &importance)?;
        let forward = Forward::new(gpu, &frame_layout, &world, &settings, shading, eyes)?;
        let targets = ViewTargets::new(gpu, size, eyes, Detail::of(&settings))?;
        let exact = ReferenceAccumulator::of_shading(shading, gpu, &frame_layout, size, eyes, settings.output)?;
        pipelines.save();
        Ok(Self {
            gpu: Arc::clone(gpu),
            settings,
            shading,
            eyes,
            exposure_ev: scene.exposure_ev,
            environment_rotation: scene.environment.rotation_degrees.to_radians(),
            world,
            culling: CullOptions::default(),
            draws: DrawList::default(),
            light,
            table,
            samplers,
            frame_layout,
            frames,
            forward,
            exact,
            importance,
            hidden_area: None,
            gizmos: None,
            targets,
            world_from_models: Mat4::IDENTITY,
            fade: 0.0,
        })
    }

    /// New targets; the old ones are given back once the GPU is done with them.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if self.targets.picture.desc().size != size {
            let targets = ViewTargets::new(&self.gpu, size, self.eyes, Detail::of(&self.settings))?;
            self.exact = self.make_exact(self.shading, size)?;
            self.targets = targets;
        }
        Ok(())
    }

    /// Draws for another number of eyes from now on; scene and light stay as they are.
    pub fn set_eyes(&mut self, eyes: u32) -> Result<()> {
        if self.eyes != eyes {
            let (before, size) = (std::mem::replace(&mut self.eyes, eyes), self.targets.picture.desc().size);
            let made = self.make_forward(self.shading).and_then(|forward| {
                let targets = ViewTargets::new(&self.gpu, size, eyes, Detail::of(&self.settings))?;
                Ok((forward, self.make_exact(self.shading, size)?, targets))
            });
            if made.is_err() {
                self.eyes = before;
            }
            (self.forward, self.exact, self.targets) = made?;
            (self.hidden_area, self.gizmos) = (None, None);
        }
        Ok(())
    }

    /// Draws only the upper left `area` pixels of the picture from now on, at most all of them.
    pub fn set_area(&mut self, area: [u32; 2]) {
        let size = self.targets.picture.desc().size;
        self.targets.area = [0, 1].map(|i| area[i].clamp(1, size[i]));
    }

    /// What no eye can see and is not drawn from now on.
    pub fn set_hidden_area(&mut self, area: Option<HiddenArea>) {
        self.hidden_area = area;
    }

    /// Shows something else.
    pub fn set_shading(&mut self, shading: Shading) -> Result<()> {
        let (forward, exact) = (self.make_forward(shading)?, self.make_exact(shading, self.size())?);
        if exact.is_some() != self.exact.is_some() {
            let importance = reference_accumulator::importance_buffer(&self.gpu, &self.light.panorama, shading)?;
            self.frames = self.make_frames(&self.light, &importance)?;
            self.importance = importance;
        }
        (self.forward, self.exact, self.shading) = (forward, exact, shading);
        Ok(())
    }

    /// Makes all pipelines anew from the shaders as they are now; on an error the old ones stay.
    pub fn reload_shaders(&mut self) -> Result<()> {
        let (forward, exact) = (self.make_forward(self.shading)?, self.make_exact(self.shading, self.size())?);
        (self.forward, self.exact, self.gizmos) = (forward, exact, None);
        Ok(())
    }

    /// Puts the scene under another panorama's light, unturned.
    pub fn set_light(&mut self, light: LightMaps) -> Result<()> {
        let importance = reference_accumulator::importance_buffer(&self.gpu, &light.panorama, self.shading)?;
        let exact = self.make_exact(self.shading, self.size())?;
        self.frames = self.make_frames(&light, &importance)?;
        (self.light, self.importance, self.exact) = (light, importance, exact);
        self.environment_rotation = 0.0;
        Ok(())
    }

    /// Moves all models of the scene together, rigidly; at first they stand as the scene says.
    pub fn world_from_models(&mut self) -> &mut Mat4 {
        &mut self.world_from_models
    }

    /// Darkens scene and sky: 0 not at all, 1 to black.
    pub fn set_fade(&mut self, fade: f32) {
        self.fade = fade.clamp(0.0, 1.0);
    }

    /// Stops of exposure; the picture's radiance is multiplied by 2^ev.
    pub fn exposure_ev(&mut self) -> &mut f32 {
        &mut self.exposure_ev
    }

    /// The panorama's turn about +Y, radians.
    pub fn environment_rotation(&mut self) -> &mut f32 {
        &mut self.environment_rotation
    }

    /// What is done so that a frame costs less.
    pub fn culling(&mut self) -> &mut CullOptions {
        &mut self.culling
    }

    /// How many draws the last recorded frame has, of how many there are.
    pub fn draw_counts(&self) -> [usize; 2] {
        [self.draws.iter().count(), self.world.draws.len()]
    }

    /// What is shown.
    pub fn shading(&self) -> Shading {
        self.shading
    }

    /// The resolved picture, one layer per eye, as the last recorded frame leaves it.
    pub fn picture(&self) -> &Arc<Image> {
        &self.targets.picture
    }

    /// What the scene's textures take.
    pub fn texture_facts(&self) -> &TextureFacts {
        &self.world.texture_facts
    }

    /// GPU time of precomputation, pass by pass.
    pub fn precompute_times(&self) -> impl Iterator<Item = &PassTime> {
        self.light.times.iter().chain(&self.table.times)
    }

    /// Sets the gizmos that the next frame recorded in `slot` shows; an empty list shows none. They stay until set anew.
    /// Called when the frame that used the slot before has finished.
    pub fn set_gizmos(&mut self, slot: usize, gizmos: &ControllerGizmos) -> Result<()> {
        let pass = match &mut self.gizmos {
            Some(pass) => pass,
            None => self.gizmos.insert(GizmosPass::new(&self.gpu, &self.frame_layout, &self.settings, self.eyes)?),
        };
        pass.set(slot, gizmos);
        Ok(())
    }

    /// Records one frame. `slot` counts frames modulo [`FRAMES_IN_FLIGHT`]; the frame that used it before has finished.
    pub fn record(&mut self, commands: &mut Commands<'_>, slot: usize, eyes: &[Eye], overlay: Option<&Overlay>) {
        self.record_scene(commands, slot, eyes);
        if let Some(overlay) = overlay {
            self.record_text(commands, slot, overlay);
        }
    }

    /// The same without text.
    pub fn record_scene(&mut self, commands: &mut Commands<'_>, slot: usize, eyes: &[Eye]) {
        let mut block = self.frame_block(eyes);
        if let Some(exact) = &mut self.exact {
            let area = self.targets.area;
            let index = exact.next_index(Shown { block, models: self.world_from_models, area });
            let jittered = each(eyes, |eye| reference_accumulator::jittered(eye, index, area));
            block = FrameBlock { sample_index: index, ..self.frame_block(&jittered[..eyes.len()]) };
        }
        let (buffer, set) = &self.frames[slot];
        buffer.write(0, bytemuck::bytes_of(&block));
        let models = self.world_from_models;
        let models_from_world = models.inverse();
        // As they stand to models that were moved: what is culled is listed where it was before.
        let moved = each(eyes, |eye| Eye { world_from_view: models_from_world * eye.world_from_view, ..*eye });
        self.draws.fill(&self.world.draws, &moved[..eyes.len()], self.culling);
        let (forward, world, draws, gizmos, targets) =
            (&self.forward, &self.world, &self.draws, &self.gizmos, &self.targets);
        if let Some(exact) = &mut self.exact {
            let draw = |commands: &mut Commands<'_>| {
                forward.draw(commands, world, models, draws, set);
                forward.draw_sky(commands, set);
            };
            return exact.record(commands, slot, draw, set, targets);
        }
        commands.pass("scene", |commands| {
            targets.render(commands, |commands| {
                if let Some(hidden) = &self.hidden_area {
                    hidden.draw(commands);
                }
                forward.draw(commands, world, models, draws, set);
                if let Some(gizmos) = gizmos {
                    gizmos.draw(commands, slot, set);
                }
                forward.draw_sky(commands, set);
            });
        });
    }

    /// Writes text over the picture as it is.
    pub fn record_text(&self, commands: &mut Commands<'_>, slot: usize, overlay: &Overlay) {
        commands.pass("text", |commands| self.targets.draw_over(commands, |commands| overlay.draw(commands, slot)));
    }

    fn frame_block(&self, eyes: &[Eye]) -> FrameBlock {
        let mut block = FrameBlock {
            environment_rotation: [self.environment_rotation.cos(), self.environment_rotation.sin()],
            exposure: self.exposure_ev.exp2() * (1.0 - self.fade),
            environment_scale: self.light.scale,
            light_count: self.world.light_count,
            ..Default::default()
        };
        for (block, eye) in block.eyes.iter_mut().zip(eyes) {
            *block = EyeBlock {
                clip_from_world: eye.clip_from_world().to_cols_array_2d(),
                world_from_view: eye.world_from_view.to_cols_array_2d(),
                tangents: [eye.left, eye.right, eye.down, eye.up],
            };
        }
        block
    }

    /// How settled the exact picture was after the finished frame that had `slot`; `None` for other shading, and before
    /// two frames.
    pub fn standard_error(&self, slot: usize) -> Option<StandardError> {
        self.exact.as_ref()?.standard_error(slot)
    }

    fn size(&self) -> [u32; 2] {
        self.targets.picture.desc().size
    }

    fn make_exact(&self, shading: Shading, size: [u32; 2]) -> Result<Option<ReferenceAccumulator>> {
        ReferenceAccumulator::of_shading(shading, &self.gpu, &self.frame_layout, size, self.eyes, self.settings.output)
    }

    fn make_frames(&self, light: &LightMaps, importance: &Arc<Buffer>) -> Result<Vec<(Arc<Buffer>, DescriptorSet)>> {
        make_frames(&self.gpu, &self.frame_layout, &self.world, light, &self.table, &self.samplers, importance)
    }

    fn make_forward(&self, shading: Shading) -> Result<Forward> {
        Forward::new(&self.gpu, &self.frame_layout, &self.world, &self.settings, shading, self.eyes)
    }
}

/// One result for each eye; those beyond are the first eye's.
fn each(eyes: &[Eye], change: impl Fn(&Eye) -> Eye) -> [Eye; MAX_EYES] {
    std::array::from_fn(|i| change(eyes.get(i).unwrap_or(&eyes[0])))
}

/// Whether pictures of this size can be made here.
///
/// # Errors
/// Sides beyond what images may have; more bytes than the GPU's memory has.
pub fn check_size(gpu: &Gpu, size: [u32; 2], eyes: u32, settings: &Settings) -> Result<()> {
    ViewTargets::check(gpu, size, eyes, Detail::of(settings))
}

fn make_frames(
    gpu: &Arc<Gpu>,
    layout: &DescriptorSetLayout,
    world: &SceneResources,
    light: &LightMaps,
    table: &BrdfTable,
    [panorama, clamped]: &[Arc<Sampler>; 2],
    importance: &Arc<Buffer>,
) -> Result<Vec<(Arc<Buffer>, DescriptorSet)>> {
    let frame = |_| {
        let buffer = Buffer::new(gpu, "frame", BufferKind::Uniform, size_of::<FrameBlock>() as u64)?;
        let binds = [
            Binding::Uniform(&buffer),
            Binding::Storage(&world.lights),
            Binding::Sampled(&light.panorama, panorama),
            Binding::Sampled(&light.irradiance_over_pi, clamped),
            Binding::Sampled(&light.specular[0], clamped),
            Binding::Sampled(&light.specular[1], clamped),
            Binding::Sampled(&table.image, clamped),
            Binding::Storage(importance),
        ];
        let set = DescriptorSet::new(gpu, "frame", layout, &binds)?;
        Ok((buffer, set))
    };
    (0..FRAMES_IN_FLIGHT).map(frame).collect()
}
