//! A scene's lightmap: soft light on its surfaces, gathered by compute passes, a piece with each frame.
//!
//! Iterated gathering: light that comes straight from lamps and sun first, then for each further bounce a few samples of
//! the hemisphere at every texel, whose rays read what the bounce before gave back, at last many samples, whose noise a filter
//! takes out. How many bounces depends on how much of the light surfaces give back.

use std::sync::Arc;

use super::bake_sets::BakeSets;
use super::layouts::Layouts;
use super::lightmap_stages::{DIRECT_PASS, Length, PASS, Stage};
use super::material_code::shader_for;
use super::pace::Pace;
use crate::Result;
use crate::gpu::{
    AddressMode, Binding, Buffer, BufferKind, Commands, Constant, DescriptorSet, Format, Gpu, Image, ImageAccess,
    ImageDesc, ImageUsageFlags, PassTime, Pipeline, Sampler, Shape, submit_and_wait,
};
use crate::scene::lightmap_texels::{LightmapTexel, LightmapTexels};
use bytemuck::{Pod, Zeroable, bytes_of};

/// Workgroups that sum up what surfaces give back, at most.
const WEIGHING_GROUPS: u32 = 64;
/// Places that light from lamps and from what shines is followed to, where some is near a surface; a power of two.
const RELAYS: u32 = 1 << 14;
/// What a texel's samples add up to, as shaders have it; a workgroup's sums are the first of it.
type Sums = [f32; 22];
/// Texels of a workgroup.
const GROUP: u32 = 64;
/// Texels of a dispatch at most: every GPU allows so many workgroups in a row.
const MOST_TEXELS: u32 = 65535 * GROUP;
/// Texels times samples of the least and of the largest piece.
const PIECES: std::ops::RangeInclusive<f64> = 8192.0..=4e8;

/// The only shader that knows smooth metal.
const GATHER: &str = "lightmap_gather.comp";

/// The compute shaders that make a lightmap what it is.
pub const SHADERS: [&str; 10] = [
    "lightmap_direct.comp",
    "lightmap_relays.comp",
    GATHER,
    "lightmap_resolve.comp",
    "lightmap_fill.comp",
    "lightmap_balance.comp",
    "lightmap_sky.comp",
    "lightmap_guide.comp",
    "lightmap_filter.comp",
    "lightmap_smooth.comp",
];

/// The push constants of its passes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Work {
    first: u32,
    count: u32,
    sequence: u32,
    first_sample: u32,
    samples: u32,
    flags: u32,
    relay_count: u32,
    spot_density: f32,
    probe_count: u32,
    half_of_samples: u32,
}

/// What the computation goes by.
pub struct Facts {
    /// The scene's, metres.
    pub radius: f32,
    /// Whether light is followed from lamps and from what shines: the constants of shaders say the same.
    pub has_relays: bool,
}

/// A lightmap that is being computed.
pub struct LightmapBake {
    pipelines: Pipelines,
    set: DescriptorSet,
    /// What is shown: see [`KINDS`].
    light: Arc<Image>,
    soft: Arc<Image>,
    direct: Arc<Image>,
    /// All, and those that are seen, which come first.
    all_texels: u32,
    texels: u32,
    relays: u32,
    /// Relays per square metre from which a place is near what they begin at.
    spot_density: f32,
    probes: u32,
    /// The most bounces, until it is known how many it takes.
    length: Length,
    /// Sums that tell; the second copy for the CPU.
    sums: Arc<Buffer>,
    weighed: Arc<Buffer>,
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
    balance: Pipeline,
    sky: Pipeline,
    guide: Pipeline,
    filter: Pipeline,
    smooth: Pipeline,
}

fn pipeline(gpu: &Arc<Gpu>, layouts: &Layouts, shader: &str, constants: &[Constant]) -> Result<Pipeline> {
    Pipeline::compute(gpu, &shader_for(shader, constants), constants, &layouts.baking(), size_of::<Work>() as u32)
}

impl Pipelines {
    fn new(gpu: &Arc<Gpu>, layouts: &Layouts, constants: &[Constant]) -> Result<Self> {
        let pipeline = |shader| pipeline(gpu, layouts, shader, constants);
        Ok(Self {
            open: pipeline("lightmap_open.comp")?,
            direct: pipeline("lightmap_direct.comp")?,
            relays: pipeline("lightmap_relays.comp")?,
            gather: pipeline(GATHER)?,
            resolve: pipeline("lightmap_resolve.comp")?,
            fill: pipeline("lightmap_fill.comp")?,
            balance: pipeline("lightmap_balance.comp")?,
            sky: pipeline("lightmap_sky.comp")?,
            guide: pipeline("lightmap_guide.comp")?,
            filter: pipeline("lightmap_filter.comp")?,
            smooth: pipeline("lightmap_smooth.comp")?,
        })
    }

    /// What computes a stage's pieces.
    fn of(&self, stage: Stage) -> &Pipeline {
        match stage {
            Stage::Open => &self.open,
            Stage::Direct => &self.direct,
            Stage::Relays => &self.relays,
            Stage::Bounce(_) | Stage::Last(_) | Stage::Done => &self.gather,
            Stage::Sky => &self.sky,
            Stage::Guide => &self.guide,
            Stage::Filter => &self.filter,
            Stage::Smooth => &self.smooth,
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

/// Kinds of a lightmap's layers, each for fronts, and for backs where some can be seen: irradiance of soft light; openness, the mean
/// of directions drawn by the cosine that nothing blocks (`share_in_image` in `glsl/lightmap_gather.comp`), with 0 for all others; and
/// the mean radiance of what those others meet.
pub const KINDS: u32 = 3;

/// A lightmap's layers of each kind: 1 for fronts, or 2 for both sides.
pub fn sides(lightmap: &Image) -> u32 {
    lightmap.desc().shape.layers() / KINDS
}

/// A lightmap of `side` × `side` texels with no light yet, for so many sides.
///
/// # Errors
/// No memory; a failed Vulkan call.
pub fn dark_lightmap(gpu: &Arc<Gpu>, side: u32, sides: u32) -> Result<Arc<Image>> {
    cleared(gpu, "lightmap", side, KINDS * sides)
}

impl LightmapBake {
    /// Prepares the computation of a [`dark_lightmap`], or of one that is there, which is not touched; `list`: makes the list of
    /// its texels, for their number along a side. `constants` of shaders say what rays may meet and by which BRDF light is given back.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        light: &Arc<Image>,
        (list, facts): (impl FnOnce(u32) -> LightmapTexels + Send, Facts),
        constants: &[Constant],
    ) -> Result<Self> {
        let [side, _] = light.desc().size;
        let (pipelines, texels) = rayon::join(|| Pipelines::new(gpu, layouts, constants), || list(side));
        let pipelines = pipelines?;
        let layers = sides(light);
        let indices = texels.indices(side, layers);
        let LightmapTexels { all, seen } = texels;
        tracing::debug!("lightmap: {side}x{side}, {} texels, {seen} of them seen", all.len());
        let (soft, direct) =
            (cleared(gpu, "lightmap soft", side, layers)?, cleared(gpu, "lightmap direct", side, layers)?);
        let count = all.len().max(1) as u64;
        let storage = |name, bytes| Buffer::new(gpu, name, BufferKind::Storage, bytes);
        let list = if all.is_empty() { &[LightmapTexel::default()] } else { &all[..] };
        let list = Buffer::with_bytes(gpu, "lightmap texels", BufferKind::FromCpu, bytemuck::cast_slice(list))?;
        let weighing = u64::from((seen as u32).div_ceil(GROUP).clamp(1, WEIGHING_GROUPS));
        let sums = storage("lightmap sums", count.max(weighing) * size_of::<Sums>() as u64)?;
        let weighed = Buffer::new(gpu, "lightmap weighed", BufferKind::Readback, weighing * size_of::<Sums>() as u64)?;
        let surfaces = storage("lightmap surfaces", count * size_of::<[f32; 23]>() as u64)?;
        let indices = Buffer::with_bytes(gpu, "lightmap indices", BufferKind::FromCpu, bytemuck::cast_slice(&indices))?;
        let relays = storage("lightmap relays", u64::from(RELAYS) * size_of::<[f32; 17]>() as u64)?;
        let sampler = Sampler::new(gpu, "lightmap", AddressMode::Clamp, 1)?;
        let bindings = [
            Binding::Storage(&list),
            Binding::Storage(&sums),
            Binding::Storage(&surfaces),
            Binding::Storage(&relays),
            Binding::Storage(&indices),
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
            relays: if facts.has_relays { RELAYS } else { 0 },
            spot_density: facts.radius.powi(-2),
            probes: 0,
            length: Length::default(),
            sums,
            weighed,
            stage: Stage::Open,
            cursor: 0,
            pace: Pace::new(PASS, PIECES),
            direct_pace: Pace::new(DIRECT_PASS, PIECES),
        })
    }

    /// With this many samples of a texel at last, a power of two and at least [`AT_ONCE`].
    pub fn with_samples(self, samples: u32) -> Self {
        Self { length: Length { samples, ..self.length }, ..self }
    }

    /// Whether light is followed from lamps and from what shines.
    pub fn has_relays(&self) -> bool {
        self.relays > 0
    }

    /// Gathers with other constants from now on, which differ by smooth metal alone.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn see_smooth_metal(&mut self, gpu: &Arc<Gpu>, layouts: &Layouts, constants: &[Constant]) -> Result<()> {
        self.pipelines.gather = pipeline(gpu, layouts, GATHER, constants)?;
        Ok(())
    }

    /// For mirror images of so many probes, which the scene's descriptor set holds.
    pub fn with_probes(self, probes: u32) -> Self {
        Self { probes, ..self }
    }

    /// Computes it again, for other light; until it is better, the old one stays.
    pub fn restart(&mut self) {
        (self.stage, self.cursor) = (Stage::Direct, 0);
        self.length = Length { samples: self.length.samples, ..Length::default() };
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
        let [before, all] = [self.stage, Stage::Done].map(|stage| stage.samples_before(self.length) as f32);
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
                Stage::Open | Stage::Direct | Stage::Filter => ImageAccess::Storage,
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
        // In whole groups: on llvmpipe an invocation's roundings may depend on those beside it, and a bake is to give the same light
        // again whatever time its pieces take.
        let most = most.next_multiple_of(GROUP);
        let work = Work {
            first: self.cursor,
            count: most.min(all - self.cursor),
            sequence: self.stage.sequence(),
            first_sample: self.stage.first_sample(),
            samples,
            flags: self.stage.flags(self.length),
            relay_count: self.relays,
            spot_density: self.spot_density,
            probe_count: self.probes,
            half_of_samples: self.length.samples / 2,
        };
        (work, all)
    }

    /// What the stage's pieces follow.
    fn paced(&mut self) -> &mut Pace {
        if self.stage.pass() == PASS { &mut self.pace } else { &mut self.direct_pace }
    }

    fn end_stage(&mut self, commands: &mut Commands<'_>, sets: &BakeSets<'_>) {
        let all = Work { count: self.texels, flags: self.stage.flags(self.length), ..Work::default() };
        if self.stage.is_soft() {
            commands.buffers_written();
            commands.prepare(&self.soft, ImageAccess::Storage);
            self.dispatch(commands, &self.pipelines.resolve, sets, all);
        }
        if self.stage.is_soft() || self.stage == Stage::Smooth {
            commands.buffers_written();
            commands.prepare(&self.light, ImageAccess::Storage);
            commands.prepare(&self.soft, ImageAccess::Storage);
            self.dispatch(commands, &self.pipelines.fill, sets, all);
        }
        if self.stage.is_weighed() {
            self.weigh(commands, sets);
        } else if self.stage.decides() {
            self.length = self.length.with_share(self.given_back_again());
            tracing::debug!("lightmap: {} bounces before the last", self.length.bounces);
        }
        (self.stage, self.cursor) = (self.stage.next(self.relays > 0, self.length), 0);
    }

    /// Sums up what surfaces give back, and what of that they give back again.
    fn weigh(&self, commands: &mut Commands<'_>, sets: &BakeSets<'_>) {
        commands.buffers_written();
        commands.prepare(&self.soft, ImageAccess::Storage);
        sets.bind(commands, &self.pipelines.balance, &self.set);
        commands.push(&self.pipelines.balance, bytes_of(&Work { count: self.texels, ..Work::default() }));
        commands.dispatch([(self.weighed.size() / size_of::<Sums>() as u64) as u32, 1, 1]);
        commands.buffers_written();
        commands.copy_buffer(&self.sums, 0, &self.weighed, 0, self.weighed.size());
        commands.copies_to_host();
        commands.buffers_written();
    }

    /// The share of light that surfaces give back of which they have given back already, once that frame has finished: where
    /// much is given back, most light is. NaN where there is none.
    fn given_back_again(&self) -> f64 {
        let groups: Vec<Sums> = self.weighed.read(bytemuck::pod_collect_to_vec);
        let sum = |i: usize| groups.iter().map(|group| f64::from(group[i])).sum::<f64>();
        sum(1) / sum(0)
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
