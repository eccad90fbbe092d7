//! A scene's lightmap: soft light on its surfaces, gathered by compute passes, a piece with each frame.
//!
//! Iterated gathering: light that comes straight from lamps and sun first, then for each further bounce a few samples of
//! the hemisphere at every texel, whose rays read what the bounce before gave back, at last many samples.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};
use glam::{Mat4, Vec3};

use super::frame_set::FrameSet;
use super::layouts::Layouts;
use super::ray_scene::{LazyRayScene, RaySet};
use super::shared::constant;
use crate::Result;
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, Buffer, BufferKind, Commands, Constant, DescriptorSet, Format, Gpu, Image, ImageAccess,
    ImageDesc, ImageUsageFlags, PassTime, Pipeline, Sampler, Shape, submit_and_wait,
};
use crate::precompute::{CacheKind, keep_cached, load_cached};
use crate::scene::lightmap_texels::{BACK, LightmapTexel, LightmapTexels};

/// Name of the pass, for its times.
pub const PASS: &str = "lightmap";
/// Bounces before the last. In a room whose walls give back two thirds, what is missing then is below 1 %.
const BOUNCES: u32 = 12;
/// Samples of a texel for each of these bounces: their noise is averaged by the gathering that follows.
const BOUNCE_SAMPLES: u32 = 4;
/// Samples of a texel at last, and how many of them are taken at once.
const SAMPLES: u32 = 64;
const AT_ONCE: u32 = 8;
/// Of them, as many as it takes until the lightmap is better than an open sky.
const PRESENTABLE: u32 = 16;
/// Places of a texel, at most 31: of each it is found out whether it is seen, and which lamps and sun reach it.
const DIRECT_SAMPLES: u32 = 16;
/// Places that light from lamps is followed to, where a lamp is near a surface.
const RELAYS: u32 = 1 << 14;
/// Part of the scene's radius nearer than which a lamp makes a spot that few rays find.
const NEAR_LAMP: f32 = 0.1;
/// Texels of a workgroup.
const GROUP: u32 = 64;
/// Texels times samples of the first piece, and of the least and the largest.
const FIRST_PIECE: f64 = 16_384.0;
const PIECES: std::ops::RangeInclusive<f64> = 4096.0..=4e8;

/// Lightmaps in the cache: raise the version when samples, seeds or the list of texels change.
const CACHE_KIND: CacheKind = CacheKind {
    copying: "lightmap from the cache",
    version: 1,
    shaders: &[
        "lightmap_direct.comp",
        "lightmap_relays.comp",
        "lightmap_gather.comp",
        "lightmap_resolve.comp",
        "lightmap_fill.comp",
    ],
};

/// The push constants of its passes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Work {
    first: u32,
    count: u32,
    first_sample: u32,
    samples: u32,
    seed: u32,
    relay_count: u32,
}

/// What light on a scene changes with while it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Of the panorama about +Y, radians.
    pub rotation: f32,
    pub world_from_models: Mat4,
}

/// Frames in which nothing moves before light is computed again.
const REST: u32 = 10;

/// What is being computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Light of an open sky, for as long as there is no other.
    Open,
    Direct,
    Relays,
    /// Samples of one bounce, the first of which is 0.
    Bounce(u32),
    /// Samples after this many of the last one.
    Last(u32),
    Done,
}

/// A lightmap that is being computed.
pub struct LightmapBake {
    pipelines: Arc<Pipelines>,
    set: DescriptorSet,
    rays: RaySet,
    /// Irradiance of soft light, a layer for fronts and one for backs where there are any.
    light: Arc<Image>,
    soft: Arc<Image>,
    direct: Arc<Image>,
    /// All, and those that are seen, which come first.
    all_texels: u32,
    texels: u32,
    relays: u32,
    stage: Stage,
    /// Texels of this stage that are done.
    cursor: u32,
    /// Texels times samples of a piece.
    piece: f64,
    /// What it is computed for; `None` before the first frame.
    computed_for: Option<LightState>,
    /// The last frame's state, and for how many frames it has been the same.
    last: Option<LightState>,
    still: u32,
}

struct Pipelines {
    open: Pipeline,
    direct: Pipeline,
    relays: Pipeline,
    gather: Pipeline,
    resolve: Pipeline,
    fill: Pipeline,
}

impl Pipelines {
    fn new(gpu: &Arc<Gpu>, layouts: &Layouts, multiple: bool) -> Result<Self> {
        let constants: [Constant; 1] = [(constant::MULTI_SCATTER, u32::from(multiple))];
        let pipeline = |shader| Pipeline::compute(gpu, shader, &constants, &layouts.baking(), size_of::<Work>() as u32);
        Ok(Self {
            open: pipeline("lightmap_open.comp")?,
            direct: pipeline("lightmap_direct.comp")?,
            relays: pipeline("lightmap_relays.comp")?,
            gather: pipeline("lightmap_gather.comp")?,
            resolve: pipeline("lightmap_resolve.comp")?,
            fill: pipeline("lightmap_fill.comp")?,
        })
    }
}

/// Whether a texel is of a triangle's back.
fn is_back(texel: &LightmapTexel) -> bool {
    texel.triangle & BACK != 0
}

impl LightmapBake {
    /// Prepares a lightmap of `side` × `side` texels.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(gpu: &Arc<Gpu>, layouts: &Layouts, ray_scene: &LazyRayScene, side: u32, lamps: &[Vec3]) -> Result<Self> {
        let scene = ray_scene.get(gpu, layouts)?;
        let texels = ray_scene.lightmap_texels(&scene, side);
        let LightmapTexels { all, seen } = texels;
        tracing::debug!("lightmap: {side}x{side}, {} texels, {seen} of them seen", all.len());
        let layers = if all.iter().any(is_back) { 2 } else { 1 };
        let image = |name| {
            let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::TRANSFER_SRC;
            let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [side; 2], usage | ImageUsageFlags::TRANSFER_DST);
            Image::new(gpu, name, ImageDesc { shape: Shape::Layers(layers), ..flat })
        };
        let (light, soft, direct) = (image("lightmap")?, image("lightmap soft")?, image("lightmap direct")?);
        // Texels between charts are filled from, and read with no weight, which would keep NaN.
        submit_and_wait(gpu, |commands| {
            [&light, &soft, &direct].iter().for_each(|image| commands.clear(image));
            Ok(())
        })?;
        let count = all.len().max(1) as u64;
        let storage = |name, bytes| Buffer::new(gpu, name, BufferKind::Storage, bytes);
        let list = if all.is_empty() { &[LightmapTexel::default()] } else { &all[..] };
        let list = Buffer::with_bytes(gpu, "lightmap texels", BufferKind::StorageFromCpu, bytemuck::cast_slice(list))?;
        let sums = storage("lightmap sums", count * size_of::<[f32; 4]>() as u64)?;
        let surfaces = storage("lightmap surfaces", count * size_of::<[f32; 5]>() as u64)?;
        let relays = storage("lightmap relays", u64::from(RELAYS) * size_of::<[f32; 14]>() as u64)?;
        let sampler = Sampler::new(gpu, "lightmap", AddressMode::Clamp, 1)?;
        let bindings = [
            Binding::Storage(&list),
            Binding::Storage(&sums),
            Binding::Storage(&surfaces),
            Binding::Storage(&relays),
            Binding::Sampled(&direct, &sampler),
            Binding::Sampled(&soft, &sampler),
            Binding::StorageImage(&direct, 0),
            Binding::StorageImage(&soft, 0),
            Binding::StorageImage(&light, 0),
        ];
        Ok(Self {
            pipelines: Arc::new(Pipelines::new(gpu, layouts, true)?),
            set: DescriptorSet::new(gpu, "lightmap", &layouts.lightmap, &bindings)?,
            rays: RaySet::new(gpu, layouts, Some(ray_scene), None)?,
            light,
            soft,
            direct,
            all_texels: all.len() as u32,
            texels: seen as u32,
            relays: if scene.is_near(lamps, NEAR_LAMP) { RELAYS } else { 0 },
            stage: Stage::Open,
            cursor: 0,
            piece: FIRST_PIECE,
            computed_for: None,
            last: None,
            still: 0,
        })
    }

    /// The lightmap: first an open sky's light, later that which is computed.
    pub fn image(&self) -> &Arc<Image> {
        &self.light
    }

    /// Takes it from the cache, where it was computed for the same `source`: everything that light depends on.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn load(&mut self, context: &Context, source: blake3::Hash) -> Result<()> {
        let images: [(&str, &Image); 1] = [("lightmap", &self.light)];
        if load_cached(context, &CACHE_KIND, &[source.as_bytes()], &images)?.is_some() {
            self.stage = Stage::Done;
        }
        Ok(())
    }

    /// Stores it in the cache.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn keep(&self, context: &Context, source: blake3::Hash) -> Result<()> {
        keep_cached(context, &CACHE_KIND, &[source.as_bytes()], &[("lightmap", &self.light)])
    }

    /// Computes it again, for other light; until it is better, the old one stays.
    pub fn restart(&mut self) {
        (self.stage, self.cursor) = (Stage::Direct, 0);
    }

    /// Computes all of it, where what was computed before does not tell what surfaces give back.
    pub fn start_over(&mut self) {
        (self.stage, self.cursor) = (Stage::Open, 0);
    }

    /// What each texel gives back of direct and of soft light, radiance; only once it is computed, not from the cache.
    pub fn given_back(&self) -> [&Arc<Image>; 2] {
        [&self.direct, &self.soft]
    }

    /// Follows a frame's state: once that has rested, light is computed again for it. Returns whether there is a piece to
    /// record.
    pub fn follow(&mut self, now: LightState) -> bool {
        self.still = if self.last == Some(now) { self.still + 1 } else { 0 };
        self.last = Some(now);
        if *self.computed_for.get_or_insert(now) != now && self.still >= REST {
            self.computed_for = Some(now);
            self.restart();
        }
        self.computed_for == Some(now) && !self.is_done()
    }

    /// Layers: fronts, and backs where some can be seen.
    pub fn layers(&self) -> u32 {
        self.light.desc().shape.layers()
    }

    /// Whether all is computed.
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// The part that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        let samples = |stage| match stage {
            Stage::Open | Stage::Direct | Stage::Relays => 0,
            Stage::Bounce(bounce) => DIRECT_SAMPLES + bounce * BOUNCE_SAMPLES,
            Stage::Last(samples) => DIRECT_SAMPLES + BOUNCES * BOUNCE_SAMPLES + samples,
            Stage::Done => DIRECT_SAMPLES + BOUNCES * BOUNCE_SAMPLES + SAMPLES,
        };
        let now = samples(self.stage) as f32 + self.samples() as f32 * self.cursor as f32 / self.texels.max(1) as f32;
        (now / samples(Stage::Done) as f32).min(1.0)
    }

    /// Makes the next piece take about `target_ms`, from the times of a frame that a piece was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        if let Some(time) = times.iter().find(|time| time.name == PASS).filter(|time| time.ms > 0.0) {
            let scale = (target_ms / time.ms).clamp(0.25, 2.0);
            self.piece = (self.piece * scale).clamp(*PIECES.start(), *PIECES.end());
        }
    }

    /// Samples of a texel in this stage.
    fn samples(&self) -> u32 {
        match self.stage {
            Stage::Direct => DIRECT_SAMPLES,
            Stage::Bounce(_) => BOUNCE_SAMPLES,
            Stage::Last(_) => AT_ONCE,
            Stage::Open | Stage::Relays | Stage::Done => 1,
        }
    }

    /// Records the next piece of work.
    pub fn record(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet) {
        if self.stage == Stage::Done {
            return;
        }
        commands.pass(PASS, |commands| {
            commands.buffers_written();
            commands.prepare(&self.light, ImageAccess::Storage);
            match self.stage {
                Stage::Open | Stage::Direct => {
                    commands.prepare(&self.direct, ImageAccess::Storage);
                    commands.prepare(&self.soft, ImageAccess::Storage);
                }
                _ => {
                    commands.prepare(&self.direct, ImageAccess::Sampled);
                    commands.prepare(&self.soft, ImageAccess::Sampled);
                }
            }
            self.piece(commands, frame, scene);
            commands.prepare(&self.light, ImageAccess::Sampled);
        });
    }

    fn piece(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet) {
        let all = match self.stage {
            Stage::Open => self.all_texels,
            Stage::Relays => self.relays,
            _ => self.texels,
        };
        let count = ((self.piece / f64::from(self.samples())) as u32).clamp(1, all - self.cursor.min(all)).max(1);
        let mut work = Work {
            first: self.cursor,
            count: count.min(all - self.cursor.min(all)),
            samples: self.samples(),
            relay_count: self.relays,
            ..Work::default()
        };
        let pipelines = Arc::clone(&self.pipelines);
        let pipeline = match self.stage {
            Stage::Open => &pipelines.open,
            Stage::Direct => &pipelines.direct,
            Stage::Relays => &pipelines.relays,
            Stage::Bounce(bounce) => {
                work.seed = 1 + bounce;
                &pipelines.gather
            }
            Stage::Last(samples) => {
                (work.seed, work.first_sample) = (1 + BOUNCES, samples);
                &pipelines.gather
            }
            Stage::Done => return,
        };
        self.dispatch(commands, pipeline, (frame, scene), work);
        self.cursor += work.count;
        if self.cursor >= all {
            self.next_stage(commands, frame, scene);
        }
    }

    fn next_stage(&mut self, commands: &mut Commands<'_>, frame: FrameSet<'_>, scene: &DescriptorSet) {
        self.cursor = 0;
        if matches!(self.stage, Stage::Bounce(_) | Stage::Last(_)) {
            let is_shown = matches!(self.stage, Stage::Last(samples) if samples + AT_ONCE >= PRESENTABLE);
            let all = Work { count: self.texels, samples: u32::from(is_shown), ..Work::default() };
            commands.buffers_written();
            commands.prepare(&self.soft, ImageAccess::Storage);
            let pipelines = Arc::clone(&self.pipelines);
            self.dispatch(commands, &pipelines.resolve, (frame, scene), all);
            commands.prepare(&self.light, ImageAccess::Storage);
            commands.prepare(&self.soft, ImageAccess::Storage);
            self.dispatch(commands, &pipelines.fill, (frame, scene), all);
        }
        self.stage = match self.stage {
            Stage::Open => Stage::Direct,
            Stage::Direct if self.relays > 0 => Stage::Relays,
            Stage::Direct | Stage::Relays => Stage::Bounce(0),
            Stage::Bounce(bounce) if bounce + 1 < BOUNCES => Stage::Bounce(bounce + 1),
            Stage::Bounce(_) => Stage::Last(0),
            Stage::Last(samples) if samples + AT_ONCE < SAMPLES => Stage::Last(samples + AT_ONCE),
            Stage::Last(_) | Stage::Done => Stage::Done,
        };
    }

    fn dispatch(
        &self,
        commands: &mut Commands<'_>,
        pipeline: &Pipeline,
        (frame, scene): (FrameSet<'_>, &DescriptorSet),
        work: Work,
    ) {
        frame.bind(commands, pipeline, 0);
        commands.bind_set(pipeline, 1, scene, &[]);
        commands.bind_set(pipeline, 2, &self.set, &[]);
        commands.bind_set(pipeline, 3, &self.rays.set, &[]);
        commands.push(pipeline, bytes_of(&work));
        commands.dispatch([work.count.div_ceil(GROUP), 1, 1]);
    }
}
