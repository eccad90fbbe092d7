//! A scene's lightmap: soft light on its surfaces, gathered by compute passes, a piece with each frame.
//!
//! Iterated gathering: light that comes straight from lamps and sun first, then for each further bounce a few samples of
//! the hemisphere at every texel, whose rays read what the bounce before gave back, at last many samples.

use std::sync::Arc;

use super::bake_sets::BakeSets;
use super::layouts::Layouts;
use super::light_detail::{AT_ONCE, SAMPLES};
use super::pace::Pace;
use super::ray_scene::LazyRayScene;
use crate::Result;
use crate::gpu::{
    AddressMode, Binding, Buffer, BufferKind, Commands, Constant, DescriptorSet, Format, Gpu, Image, ImageAccess,
    ImageDesc, ImageUsageFlags, PassTime, Pipeline, Sampler, Shape, submit_and_wait,
};
use crate::scene::lightmap_texels::{LightmapTexel, LightmapTexels};
use bytemuck::{Pod, Zeroable, bytes_of};

/// Names of the passes, for their times: of light that is bounced, and of what comes before.
const PASS: &str = "lightmap";
const DIRECT_PASS: &str = "lightmap direct";
const OPEN_PASS: &str = "lightmap open";
/// Bounces before the last. In a room whose walls give back two thirds, what is missing then is below 1 %.
const BOUNCES: u32 = 40;
/// Samples of a texel for each of these bounces: their noise is averaged by the gathering that follows.
const BOUNCE_SAMPLES: u32 = 2;
/// Bounces before those whose mean is shown until the last is there, and samples of a texel that make it better than an
/// open sky. What is missing after so few bounces is missing for some seconds only.
const UNKEPT: u32 = 8;
const PRESENTABLE: u32 = 16;
/// Places of a texel, at most 31: of each it is found out whether it is seen, and which lamps and sun reach it.
const DIRECT_SAMPLES: u32 = 16;
/// Places that light from lamps is followed to, where a lamp is near a surface; a power of two.
const RELAYS: u32 = 1 << 14;
/// Part of the scene's radius nearer than which a lamp makes a spot that few rays find.
const NEAR_LAMP: f32 = 0.1;
/// Texels of a workgroup.
const GROUP: u32 = 64;
/// Texels of a dispatch at most: every GPU allows so many workgroups in a row.
const MOST_TEXELS: u32 = 65535 * GROUP;
/// Texels times samples of the least and of the largest piece.
const PIECES: std::ops::RangeInclusive<f64> = 8192.0..=4e8;

/// The compute shaders that make a lightmap what it is.
pub const SHADERS: [&str; 5] = [
    "lightmap_direct.comp",
    "lightmap_relays.comp",
    "lightmap_gather.comp",
    "lightmap_resolve.comp",
    "lightmap_fill.comp",
];

/// The push constants of its passes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Work {
    first: u32,
    count: u32,
    first_sample: u32,
    samples: u32,
    flags: u32,
    relay_count: u32,
}

/// [`Work::flags`]: sums begin with these samples; what is known is shown from now on; their sky is counted; their sums are
/// kept.
const BEGINS: u32 = 1;
const IS_SHOWN: u32 = 2;
const COUNTS: u32 = 4;
const KEEPS: u32 = 8;

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

impl Stage {
    /// What follows, with `most` samples of a texel at last.
    fn next(self, has_relays: bool, most: u32) -> Self {
        match self {
            Self::Open => Self::Direct,
            Self::Direct if has_relays => Self::Relays,
            Self::Direct | Self::Relays => Self::Bounce(0),
            Self::Bounce(bounce) if bounce + 1 < BOUNCES => Self::Bounce(bounce + 1),
            Self::Bounce(_) => Self::Last(0),
            Self::Last(samples) if samples + AT_ONCE < most => Self::Last(samples + AT_ONCE),
            Self::Last(_) | Self::Done => Self::Done,
        }
    }

    /// Whether it gathers light that surfaces give back.
    fn is_soft(self) -> bool {
        matches!(self, Self::Bounce(_) | Self::Last(_))
    }

    fn pass(self) -> &'static str {
        match self {
            Self::Open => OPEN_PASS,
            Self::Direct | Self::Relays => DIRECT_PASS,
            Self::Bounce(_) | Self::Last(_) | Self::Done => PASS,
        }
    }

    /// Samples of a texel.
    fn samples(self) -> u32 {
        match self {
            Self::Direct => DIRECT_SAMPLES,
            Self::Bounce(_) => BOUNCE_SAMPLES,
            Self::Last(_) => AT_ONCE,
            Self::Open | Self::Relays | Self::Done => 1,
        }
    }

    /// The first of them in the sequence of all. The last ones begin an aligned run of it, which is spread evenly.
    fn first_sample(self, most: u32) -> u32 {
        match self {
            Self::Bounce(bounce) => bounce * BOUNCE_SAMPLES,
            Self::Last(samples) => (BOUNCES * BOUNCE_SAMPLES).next_multiple_of(most) + samples,
            Self::Open | Self::Direct | Self::Relays | Self::Done => 0,
        }
    }

    fn flags(self, most: u32) -> u32 {
        match self {
            Self::Bounce(bounce) if bounce < UNKEPT => BEGINS | COUNTS,
            Self::Bounce(bounce) => BEGINS | COUNTS | KEEPS | shown_if(kept_by(bounce) >= PRESENTABLE),
            Self::Last(samples) => {
                let begins = if samples == 0 { BEGINS } else { 0 };
                // Not before it is better than what the bounces' mean shows.
                begins | shown_if(samples + AT_ONCE >= kept_by(BOUNCES - 1).min(most))
            }
            Self::Open | Self::Direct | Self::Relays | Self::Done => 0,
        }
    }

    /// Samples of a texel that came before it.
    fn samples_before(self, most: u32) -> u32 {
        match self {
            Self::Open | Self::Direct | Self::Relays => 0,
            Self::Bounce(bounce) => DIRECT_SAMPLES + bounce * BOUNCE_SAMPLES,
            Self::Last(samples) => DIRECT_SAMPLES + BOUNCES * BOUNCE_SAMPLES + samples,
            Self::Done => DIRECT_SAMPLES + BOUNCES * BOUNCE_SAMPLES + most,
        }
    }
}

/// Samples that are kept up to a bounce.
fn kept_by(bounce: u32) -> u32 {
    (bounce + 1 - UNKEPT) * BOUNCE_SAMPLES
}

fn shown_if(shown: bool) -> u32 {
    if shown { IS_SHOWN } else { 0 }
}

/// A lightmap that is being computed.
pub struct LightmapBake {
    pipelines: Pipelines,
    set: DescriptorSet,
    /// Irradiance of soft light, a layer for fronts and one for backs where there are any; then as many layers of openness.
    light: Arc<Image>,
    soft: Arc<Image>,
    direct: Arc<Image>,
    /// All, and those that are seen, which come first.
    all_texels: u32,
    texels: u32,
    relays: u32,
    /// Of a texel, at last.
    samples: u32,
    stage: Stage,
    /// Texels of this stage that are done.
    cursor: u32,
    /// Texels times samples of a piece of soft light, and of what comes before: a sample of the one takes much longer.
    pace: Pace,
    direct_pace: Pace,
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
    fn new(gpu: &Arc<Gpu>, layouts: &Layouts, constants: &[Constant]) -> Result<Self> {
        let pipeline = |shader| Pipeline::compute(gpu, shader, constants, &layouts.baking(), size_of::<Work>() as u32);
        Ok(Self {
            open: pipeline("lightmap_open.comp")?,
            direct: pipeline("lightmap_direct.comp")?,
            relays: pipeline("lightmap_relays.comp")?,
            gather: pipeline("lightmap_gather.comp")?,
            resolve: pipeline("lightmap_resolve.comp")?,
            fill: pipeline("lightmap_fill.comp")?,
        })
    }

    /// What computes a stage's pieces.
    fn of(&self, stage: Stage) -> &Pipeline {
        match stage {
            Stage::Open => &self.open,
            Stage::Direct => &self.direct,
            Stage::Relays => &self.relays,
            Stage::Bounce(_) | Stage::Last(_) | Stage::Done => &self.gather,
        }
    }
}

/// An image that a lightmap is kept or computed in: all 0, as texels between charts are filled from, and read with no weight,
/// which would keep NaN.
fn cleared(gpu: &Arc<Gpu>, name: &str, side: u32, layers: u32) -> Result<Arc<Image>> {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::TRANSFER_SRC;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [side; 2], usage | ImageUsageFlags::TRANSFER_DST);
    let image = Image::new(gpu, name, ImageDesc { shape: Shape::Layers(layers), ..flat })?;
    submit_and_wait(gpu, |commands| {
        commands.clear(&image);
        Ok(())
    })?;
    Ok(image)
}

/// A lightmap of `side` × `side` texels with no light yet: irradiance of soft light in one layer for fronts or in two for both
/// sides, and as many layers of openness.
///
/// # Errors
/// No memory; a failed Vulkan call.
pub fn dark_lightmap(gpu: &Arc<Gpu>, side: u32, layers: u32) -> Result<Arc<Image>> {
    cleared(gpu, "lightmap", side, 2 * layers)
}

impl LightmapBake {
    /// Prepares the computation of a [`dark_lightmap`], or of one that is there, which is not touched; `listed`: its texels, if
    /// they are known. `constants` of shaders say by which BRDF light is given back.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        ray_scene: &LazyRayScene,
        (light, listed): (&Arc<Image>, Option<LightmapTexels>),
        constants: &[Constant],
    ) -> Result<Self> {
        let [side, _] = light.desc().size;
        let list = || {
            let scene = ray_scene.get(gpu, layouts)?;
            let texels = listed.unwrap_or_else(|| ray_scene.lightmap_texels(&scene, side));
            Ok((scene, texels))
        };
        let (pipelines, listed) = rayon::join(|| Pipelines::new(gpu, layouts, constants), list);
        let (pipelines, (scene, texels)) = (pipelines?, listed?);
        let LightmapTexels { all, seen } = texels;
        tracing::debug!("lightmap: {side}x{side}, {} texels, {seen} of them seen", all.len());
        let layers = light.desc().shape.layers() / 2;
        let (soft, direct) =
            (cleared(gpu, "lightmap soft", side, layers)?, cleared(gpu, "lightmap direct", side, layers)?);
        let count = all.len().max(1) as u64;
        let storage = |name, bytes| Buffer::new(gpu, name, BufferKind::Storage, bytes);
        let list = if all.is_empty() { &[LightmapTexel::default()] } else { &all[..] };
        let list = Buffer::with_bytes(gpu, "lightmap texels", BufferKind::StorageFromCpu, bytemuck::cast_slice(list))?;
        let sums = storage("lightmap sums", count * size_of::<[f32; 4]>() as u64)?;
        let surfaces = storage("lightmap surfaces", count * size_of::<[f32; 18]>() as u64)?;
        let relays = storage("lightmap relays", u64::from(RELAYS) * size_of::<[f32; 17]>() as u64)?;
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
            Binding::StorageImage(light, 0),
        ];
        Ok(Self {
            pipelines,
            set: DescriptorSet::new(gpu, "lightmap", &layouts.lightmap, &bindings)?,
            light: Arc::clone(light),
            soft,
            direct,
            all_texels: all.len() as u32,
            texels: seen as u32,
            relays: if scene.is_near(ray_scene.lamps(), NEAR_LAMP) { RELAYS } else { 0 },
            samples: SAMPLES,
            stage: Stage::Open,
            cursor: 0,
            pace: Pace::new(PASS, PIECES),
            direct_pace: Pace::new(DIRECT_PASS, PIECES),
        })
    }

    /// With this many samples of a texel at last, a power of two and at least [`AT_ONCE`].
    pub fn with_samples(self, samples: u32) -> Self {
        Self { samples, ..self }
    }

    /// Computes it again, for other light; until it is better, the old one stays.
    pub fn restart(&mut self) {
        (self.stage, self.cursor) = (Stage::Direct, 0);
    }

    /// What each texel gives back of direct and of soft light, radiance; only once it is computed, not from the cache.
    pub fn given_back(&self) -> [&Arc<Image>; 2] {
        [&self.direct, &self.soft]
    }

    /// Whether all is computed.
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// The part that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        let of_stage = self.stage.samples() as f32 * self.cursor as f32 / self.texels.max(1) as f32;
        let [before, all] = [self.stage, Stage::Done].map(|stage| stage.samples_before(self.samples) as f32);
        ((before + of_stage) / all).min(1.0)
    }

    /// Makes the next piece take about `target_ms`, from the times of a frame that a piece was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        self.pace.follow(times, target_ms);
        self.direct_pace.follow(times, target_ms);
    }

    /// Records the next piece of work, if there is any.
    pub fn record(&mut self, commands: &mut Commands<'_>, sets: &BakeSets<'_>) {
        if self.is_done() {
            return;
        }
        commands.pass(self.stage.pass(), |commands| {
            commands.buffers_written();
            commands.prepare(&self.light, ImageAccess::Storage);
            let access = match self.stage {
                Stage::Open | Stage::Direct => ImageAccess::Storage,
                _ => ImageAccess::Sampled,
            };
            [&self.direct, &self.soft].iter().for_each(|image| commands.prepare(image, access));
            let (work, all) = self.next_piece();
            self.dispatch(commands, self.pipelines.of(self.stage), sets, work);
            self.cursor += work.count;
            if self.stage != Stage::Open {
                self.paced().issue(f64::from(work.count) * f64::from(work.samples));
            }
            if self.cursor >= all {
                self.end_stage(commands, sets);
            }
            commands.prepare(&self.light, ImageAccess::Sampled);
        });
    }

    /// The next piece of this stage, and the elements of the whole stage.
    fn next_piece(&mut self) -> (Work, u32) {
        let all = match self.stage {
            Stage::Open => self.all_texels,
            Stage::Relays => self.relays,
            _ => self.texels,
        };
        let samples = self.stage.samples();
        // An open sky's light takes hardly longer than to clear the image, which would be seen otherwise.
        let most =
            if self.stage == Stage::Open { all } else { ((self.paced().size() / f64::from(samples)) as u32).max(1) };
        let work = Work {
            first: self.cursor,
            count: most.min(all - self.cursor),
            first_sample: self.stage.first_sample(self.samples),
            samples,
            flags: self.stage.flags(self.samples),
            relay_count: self.relays,
        };
        (work, all)
    }

    /// What the stage's pieces follow.
    fn paced(&mut self) -> &mut Pace {
        if self.stage.is_soft() { &mut self.pace } else { &mut self.direct_pace }
    }

    fn end_stage(&mut self, commands: &mut Commands<'_>, sets: &BakeSets<'_>) {
        if self.stage.is_soft() {
            let all = Work { count: self.texels, flags: self.stage.flags(self.samples), ..Work::default() };
            commands.buffers_written();
            commands.prepare(&self.soft, ImageAccess::Storage);
            self.dispatch(commands, &self.pipelines.resolve, sets, all);
            commands.buffers_written();
            commands.prepare(&self.light, ImageAccess::Storage);
            commands.prepare(&self.soft, ImageAccess::Storage);
            self.dispatch(commands, &self.pipelines.fill, sets, all);
        }
        (self.stage, self.cursor) = (self.stage.next(self.relays > 0, self.samples), 0);
    }

    fn dispatch(&self, commands: &mut Commands<'_>, pipeline: &Pipeline, sets: &BakeSets<'_>, work: Work) {
        sets.bind(commands, pipeline, &self.set);
        let end = work.first + work.count;
        for first in (work.first..end).step_by(MOST_TEXELS as usize) {
            let part = Work { first, count: MOST_TEXELS.min(end - first), ..work };
            commands.push(pipeline, bytes_of(&part));
            commands.dispatch([part.count.div_ceil(GROUP), 1, 1]);
        }
    }
}
