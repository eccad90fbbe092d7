//! One frame for N eyes: forward pass or the exact picture's samples, sky, resolve, text on top.

mod exact;
mod eye;
mod forward;
mod overlay;
mod shared;
#[cfg(test)]
mod shared_tests;
mod targets;
mod world;

use std::sync::Arc;

use clap::ValueEnum;

pub use exact::StandardError;
pub use eye::{Eye, IPD_METRES, NEAR_METRES};
pub use overlay::Overlay;
pub use shared::MAX_EYES;
pub use targets::Output;

use crate::asset::Report;
use crate::gpu::{Bind, Buffer, BufferKind, Commands, Edge, Gpu, Image, PassTime, Sampler, Set, SetLayout, Slot};
use crate::precompute::{self, BrdfTable, LightMaps};
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
use crate::scene::Scene;
use crate::{Error, Result};
use exact::Exact;
use forward::Forward;
use shared::{EyeBlock, FrameBlock};
use targets::Targets;
use world::World;

/// Frames that the CPU may be ahead of the GPU.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// What fragments show; the same order as in `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, ValueEnum)]
pub enum Shading {
    /// Physically based.
    Pbr,
    /// Phong: ambient light and lamps only.
    Phong,
    /// Base colour.
    Albedo,
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
        if self == Self::Reference { exact::DEFAULT_FRAMES } else { 1 }
    }
}

/// How pictures are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub geometry: Geometry,
    pub split_sum: SplitSum,
    pub output: Output,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    pub precompute: precompute::Options,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            geometry: Geometry::Smith,
            split_sum: SplitSum::Moment,
            output: Output::Display,
            samples: 4,
            precompute: precompute::Options::default(),
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
    environment_turn: f32,
    world: World,
    light: LightMaps,
    table: BrdfTable,
    samplers: [Sampler; 2],
    frame_layout: SetLayout,
    frames: Vec<(Buffer, Set)>,
    forward: Forward,
    /// Only where shading is [`Shading::Reference`].
    exact: Option<Exact>,
    importance: Buffer,
    targets: Targets,
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
        let world = World::new(gpu, scene, report)?;
        let light = LightMaps::new(gpu, &scene.environment.panorama, &settings.precompute)?;
        let cache = settings.precompute.cache.as_ref();
        let table = BrdfTable::new(gpu, settings.geometry, settings.split_sum, cache)?;
        let [uniform, storage, sampled] = [Slot::Uniform, Slot::Storage, Slot::Sampled];
        let slots = [uniform, storage, sampled, sampled, sampled, sampled, sampled, storage];
        let frame_layout = SetLayout::new(gpu, "frame", &slots)?;
        let samplers =
            [Sampler::new(gpu, "panorama", Edge::Panorama, false)?, Sampler::new(gpu, "clamped", Edge::Clamp, false)?];
        let importance = importance(gpu, &light, shading)?;
        let frames = make_frames(gpu, &frame_layout, &world, &light, &table, &samplers, &importance)?;
        let forward = Forward::new(gpu, &frame_layout, &world, &settings, shading, eyes)?;
        let targets = make_targets(gpu, size, eyes, &settings)?;
        let exact = make_exact(gpu, &frame_layout, &targets, eyes, settings.output, shading)?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            settings,
            shading,
            eyes,
            exposure_ev: scene.exposure_ev,
            environment_turn: scene.environment.rotation_degrees.to_radians(),
            world,
            light,
            table,
            samplers,
            frame_layout,
            frames,
            forward,
            exact,
            importance,
            targets,
        })
    }

    /// New targets; the old ones are given back once the GPU is done with them.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if self.targets.picture.desc().size != size {
            self.targets = make_targets(&self.gpu, size, self.eyes, &self.settings)?;
            self.exact = self.make_exact(self.shading)?;
        }
        Ok(())
    }

    /// Shows something else.
    pub fn set_shading(&mut self, shading: Shading) -> Result<()> {
        let (forward, exact) = (self.make_forward(shading)?, self.make_exact(shading)?);
        if exact.is_some() != self.exact.is_some() {
            let importance = importance(&self.gpu, &self.light, shading)?;
            self.frames = self.make_frames(&self.light, &importance)?;
            self.importance = importance;
        }
        (self.forward, self.exact, self.shading) = (forward, exact, shading);
        Ok(())
    }

    /// Makes all pipelines anew from the shaders as they are now; on an error the old ones stay.
    pub fn reload_shaders(&mut self) -> Result<()> {
        let (forward, exact) = (self.make_forward(self.shading)?, self.make_exact(self.shading)?);
        (self.forward, self.exact) = (forward, exact);
        Ok(())
    }

    /// Puts the scene under another panorama's light, unturned.
    pub fn set_light(&mut self, light: LightMaps) -> Result<()> {
        let importance = importance(&self.gpu, &light, self.shading)?;
        self.frames = self.make_frames(&light, &importance)?;
        self.exact = self.make_exact(self.shading)?;
        (self.light, self.importance) = (light, importance);
        self.environment_turn = 0.0;
        Ok(())
    }

    /// Stops of exposure; the picture's radiance is multiplied by 2^ev.
    pub fn exposure_ev(&mut self) -> &mut f32 {
        &mut self.exposure_ev
    }

    /// The panorama's turn about +Y, radians.
    pub fn environment_turn(&mut self) -> &mut f32 {
        &mut self.environment_turn
    }

    /// What is shown.
    pub fn shading(&self) -> Shading {
        self.shading
    }

    /// The resolved picture, one layer per eye, as the last recorded frame leaves it.
    pub fn picture(&self) -> &Image {
        &self.targets.picture
    }

    /// GPU time of precomputation, pass by pass.
    pub fn precompute_times(&self) -> impl Iterator<Item = &PassTime> {
        self.light.times.iter().chain(&self.table.times)
    }

    /// Records one frame. `slot` counts frames modulo [`FRAMES_IN_FLIGHT`]; the frame that used it before has finished.
    pub fn record(&mut self, commands: &mut Commands<'_>, slot: usize, eyes: &[Eye], overlay: Option<&Overlay>) {
        let mut block = self.frame_block(eyes);
        if let Some(exact) = &mut self.exact {
            let index = exact.next_index(&block);
            let size = self.targets.picture.desc().size;
            let jittered: Vec<Eye> = eyes.iter().map(|eye| exact::jittered(eye, index, size)).collect();
            block = FrameBlock { sample_index: index, ..self.frame_block(&jittered) };
        }
        let (buffer, set) = &mut self.frames[slot];
        buffer.write(0, bytemuck::bytes_of(&block));
        let (forward, world, targets) = (&self.forward, &self.world, &self.targets);
        match &mut self.exact {
            Some(exact) => exact.record(commands, slot, (forward, world, set), targets),
            None => commands.pass("scene", |commands| {
                targets.render(commands, |commands| {
                    forward.draw(commands, world, set);
                    forward.draw_sky(commands, set);
                });
            }),
        }
        if let Some(overlay) = overlay {
            commands.pass("text", |commands| targets.draw_over(commands, |commands| overlay.draw(commands, slot)));
        }
    }

    fn frame_block(&self, eyes: &[Eye]) -> FrameBlock {
        let mut block = FrameBlock {
            environment_turn: [self.environment_turn.cos(), self.environment_turn.sin()],
            exposure: self.exposure_ev.exp2(),
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

    fn make_exact(&self, shading: Shading) -> Result<Option<Exact>> {
        make_exact(&self.gpu, &self.frame_layout, &self.targets, self.eyes, self.settings.output, shading)
    }

    fn make_frames(&self, light: &LightMaps, importance: &Buffer) -> Result<Vec<(Buffer, Set)>> {
        make_frames(&self.gpu, &self.frame_layout, &self.world, light, &self.table, &self.samplers, importance)
    }

    fn make_forward(&self, shading: Shading) -> Result<Forward> {
        Forward::new(&self.gpu, &self.frame_layout, &self.world, &self.settings, shading, self.eyes)
    }
}

fn make_exact(
    gpu: &Arc<Gpu>,
    frame_layout: &SetLayout,
    targets: &Targets,
    eyes: u32,
    output: Output,
    shading: Shading,
) -> Result<Option<Exact>> {
    let make = || Exact::new(gpu, frame_layout, targets.picture.desc().size, eyes, output);
    (shading == Shading::Reference).then(make).transpose()
}

fn importance(gpu: &Arc<Gpu>, light: &LightMaps, shading: Shading) -> Result<Buffer> {
    exact::importance_buffer(gpu, (shading == Shading::Reference).then_some(&light.panorama))
}

fn make_targets(gpu: &Arc<Gpu>, size: [u32; 2], eyes: u32, settings: &Settings) -> Result<Targets> {
    let most = gpu.max_image_size();
    if size.iter().any(|s| !(1..=most).contains(s)) {
        let message = format!("a picture of {}x{} cannot be made; 1x1 to {most}x{most} can", size[0], size[1]);
        return Err(Error::Usage(message));
    }
    let bytes = Targets::bytes(size, eyes, settings.output, settings.samples);
    let there = gpu.info().memory;
    if bytes > there {
        let what = format!("a picture of {}x{}", size[0], size[1]);
        let mib = |bytes: u64| bytes >> 20;
        return Err(Error::GpuMemory {
            what,
            problem: format!("{} MiB against {} MiB there are", mib(bytes), mib(there)),
        });
    }
    Targets::new(gpu, size, eyes, settings.output, settings.samples)
}

fn make_frames(
    gpu: &Arc<Gpu>,
    layout: &SetLayout,
    world: &World,
    light: &LightMaps,
    table: &BrdfTable,
    [panorama, clamped]: &[Sampler; 2],
    importance: &Buffer,
) -> Result<Vec<(Buffer, Set)>> {
    let frame = |_| {
        let buffer = Buffer::new(gpu, "frame", BufferKind::Uniform, size_of::<FrameBlock>() as u64)?;
        let binds = [
            Bind::Uniform(&buffer),
            Bind::Storage(&world.lights),
            Bind::Sampled(&light.panorama, panorama),
            Bind::Sampled(&light.irradiance_over_pi, clamped),
            Bind::Sampled(&light.specular[0], clamped),
            Bind::Sampled(&light.specular[1], clamped),
            Bind::Sampled(&table.image, clamped),
            Bind::Storage(importance),
        ];
        let set = Set::new(gpu, "frame", layout, &binds)?;
        Ok((buffer, set))
    };
    (0..FRAMES_IN_FLIGHT).map(frame).collect()
}
