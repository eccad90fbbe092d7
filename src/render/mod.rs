//! One frame for N eyes: forward pass, sky, resolve, text on top.

mod culling;
mod draws;
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

pub use draws::{Order, Savings};
pub use eye::{Eye, IPD_METRES, NEAR_METRES};
pub use overlay::Overlay;
pub use shared::MAX_EYES;
pub use targets::Output;
pub use world::TextureFacts;

use crate::asset::{Report, TextureOptions};
use crate::gpu::{Bind, Buffer, BufferKind, Commands, Edge, Gpu, Image, PassTime, Sampler, Set, SetLayout, Slot};
use crate::precompute::{self, BrdfTable, LightMaps};
use crate::reference::brdf::Geometry;
use crate::reference::table::SplitSum;
use crate::scene::needs::resolution::Viewpoint;
use crate::scene::{Model, Needs, Scene};
use crate::{Error, Result};
use draws::DrawList;
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
}

/// How pictures are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub geometry: Geometry,
    pub split_sum: SplitSum,
    pub model: Model,
    /// Where all pictures will be taken from; `None` for anywhere.
    pub viewpoint: Option<Viewpoint>,
    pub output: Output,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    pub precompute: precompute::Options,
    /// The scene's textures are loaded with the same ones.
    pub textures: TextureOptions,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            geometry: Geometry::Smith,
            split_sum: SplitSum::Moment,
            model: Model::Needed,
            viewpoint: None,
            output: Output::Display,
            samples: 4,
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
    environment_turn: f32,
    world: World,
    savings: Savings,
    draws: DrawList,
    light: LightMaps,
    table: BrdfTable,
    samplers: [Sampler; 2],
    frame_layout: SetLayout,
    frames: Vec<(Buffer, Set)>,
    forward: Forward,
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
        let world =
            World::new(gpu, scene, &Needs::of(scene, settings.model, settings.viewpoint), &settings.textures, report)?;
        let panorama = &scene.environment.panorama;
        let light = report.time("precompute", || LightMaps::new(gpu, panorama, &settings.precompute))?;
        let cache = settings.precompute.cache.as_ref();
        let table = BrdfTable::new(gpu, settings.geometry, settings.split_sum, cache)?;
        let slots =
            [Slot::Uniform, Slot::Storage, Slot::Sampled, Slot::Sampled, Slot::Sampled, Slot::Sampled, Slot::Sampled];
        let frame_layout = SetLayout::new(gpu, "frame", &slots)?;
        let samplers =
            [Sampler::new(gpu, "panorama", Edge::Panorama, 1)?, Sampler::new(gpu, "clamped", Edge::Clamp, 1)?];
        let frames = make_frames(gpu, &frame_layout, &world, &light, &table, &samplers)?;
        let forward = Forward::new(gpu, &frame_layout, &world, &settings, shading, eyes)?;
        let targets = make_targets(gpu, size, eyes, &settings)?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            settings,
            shading,
            eyes,
            exposure_ev: scene.exposure_ev,
            environment_turn: scene.environment.rotation_degrees.to_radians(),
            world,
            savings: Savings::default(),
            draws: DrawList::default(),
            light,
            table,
            samplers,
            frame_layout,
            frames,
            forward,
            targets,
        })
    }

    /// New targets; the old ones are given back once the GPU is done with them.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if self.targets.picture.desc().size != size {
            self.targets = make_targets(&self.gpu, size, self.eyes, &self.settings)?;
        }
        Ok(())
    }

    /// Shows something else.
    pub fn set_shading(&mut self, shading: Shading) -> Result<()> {
        self.forward = self.make_forward(shading)?;
        self.shading = shading;
        Ok(())
    }

    /// Makes all pipelines anew from the shaders as they are now; on an error the old ones stay.
    pub fn reload_shaders(&mut self) -> Result<()> {
        self.forward = self.make_forward(self.shading)?;
        Ok(())
    }

    /// Puts the scene under another panorama's light, unturned.
    pub fn set_light(&mut self, light: LightMaps) -> Result<()> {
        self.frames = make_frames(&self.gpu, &self.frame_layout, &self.world, &light, &self.table, &self.samplers)?;
        self.light = light;
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

    /// What is done so that a frame costs less.
    pub fn savings(&mut self) -> &mut Savings {
        &mut self.savings
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
    pub fn picture(&self) -> &Image {
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

    /// Records one frame. `slot` counts frames modulo [`FRAMES_IN_FLIGHT`]; the frame that used it before has finished.
    pub fn record(&mut self, commands: &mut Commands<'_>, slot: usize, eyes: &[Eye], overlay: Option<&Overlay>) {
        let block = self.frame_block(eyes);
        let (buffer, set) = &mut self.frames[slot];
        buffer.write(0, bytemuck::bytes_of(&block));
        self.draws.fill(&self.world.draws, eyes, self.savings);
        let (forward, world, draws, targets) = (&self.forward, &self.world, &self.draws, &self.targets);
        commands.pass("scene", |commands| {
            targets.render(commands, |commands| {
                forward.draw(commands, world, draws, set);
                forward.draw_sky(commands, set);
            });
        });
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

    fn make_forward(&self, shading: Shading) -> Result<Forward> {
        Forward::new(&self.gpu, &self.frame_layout, &self.world, &self.settings, shading, self.eyes)
    }
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
        ];
        let set = Set::new(gpu, "frame", layout, &binds)?;
        Ok((buffer, set))
    };
    (0..FRAMES_IN_FLIGHT).map(frame).collect()
}
