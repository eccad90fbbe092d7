//! Probes: what smooth surfaces mirror of the rooms around them, captured by rays once the lightmap is done, and filtered
//! like a panorama; a piece with each frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};

use super::bake_sets::BakeSets;
use super::layouts::Layouts;
use super::pace::Pace;
use super::settings::RenderSettings;
use super::shared::ProbeBlock;
use crate::Result;
use crate::context::Context;
use crate::gpu::{
    AddressMode, Binding, Buffer, BufferKind, Commands, DescriptorSet, Format, Gpu, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, PassTime, Pipeline, Sampler, Shape, submit_and_wait,
};
use crate::precompute::HierarchicalConvolution;
use crate::reference::levels::LEVELS;
use crate::scene::bvh::Bvh;
use crate::scene::needs::mirrors::ProbePlan;
use crate::scene::{Probe, Scene};

/// Names of the passes, for their times.
pub const CAPTURE: &str = "probe capture";
pub const FILTER: &str = "probe filter";
/// Texels along a face of the irradiance.
const IRRADIANCE_FACE: u32 = 16;
/// Texels along a workgroup's side.
const GROUP: u32 = 8;

/// The shader that captures what is filtered then.
pub const SHADER: &str = "probe_capture.comp";

/// The push constants of `glsl/probe_capture.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Work {
    position: [f32; 3],
    first_row: u32,
    rows: u32,
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The captured panorama of a probe, from a row on.
    Capture(usize, u32),
    Filter(usize),
    Done,
}

/// Probes and their maps.
pub struct LocalProbes {
    /// [`ProbeBlock`]s.
    pub blocks: Arc<Buffer>,
    placed: Vec<ProbeBlock>,
    filter: HierarchicalConvolution,
    /// Of direct and of soft light.
    given_back: [Arc<Image>; 2],
    captured: Arc<Image>,
    capture: Pipeline,
    set: DescriptorSet,
    stage: Stage,
    /// Rows of a piece.
    pace: Pace,
    /// What the maps' values are multiplied by; 0 before all are there.
    scale: f32,
}

impl LocalProbes {
    /// Prepares the probes that a scene needs; `None` if it needs none, or if the GPU has no arrays of cubes.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn planned(
        context: &Context,
        layouts: &Layouts,
        (scene, bvh): (&Scene, &Bvh),
        given_back: [&Arc<Image>; 2],
        settings: &RenderSettings,
    ) -> Result<Option<Self>> {
        let gpu = &context.gpu;
        let face = settings.light_detail.probe_size;
        if face == 0 {
            return Ok(None);
        }
        let ProbePlan { probes, why } = ProbePlan::new(scene, settings.model, bvh);
        tracing::debug!("mirrored rooms: {why}: {probes:?}");
        if !probes.is_empty() && !gpu.has_cube_arrays() {
            context.report.warn(format!("{}: no arrays of cubes; rooms mirror the panorama alone", gpu.info().name));
            return Ok(None);
        }
        (!probes.is_empty()).then(|| Self::new(gpu, layouts, (probes, face), given_back)).transpose()
    }

    /// Prepares probes, at least one, with `face` texels along a face, that see surfaces give back this radiance of direct
    /// and of soft light.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        (probes, face): (Vec<Probe>, u32),
        [direct, soft]: [&Arc<Image>; 2],
    ) -> Result<Self> {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE;
        let usage = usage | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
        let count = probes.len() as u32;
        let cubes = |name, size, mips| {
            let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [size; 2], usage);
            Image::new(gpu, name, ImageDesc { shape: Shape::CubeArray(count), mips, ..flat })
        };
        let mips = (LEVELS / 2) as u32;
        let specular = [cubes("even levels of probes", face, mips)?, cubes("odd levels of probes", face, mips)?];
        let irradiance = cubes("irradiance of probes", IRRADIANCE_FACE, 1)?;
        // As wide as four faces, at the equator.
        let size = [4 * face, 2 * face];
        let captured = Image::new(gpu, "captured", ImageDesc::flat(Format::R32G32B32A32_SFLOAT, size, usage))?;
        let filter = HierarchicalConvolution::new(gpu, &captured, &specular, &irradiance)?;
        submit_and_wait(gpu, |commands| {
            filter.maps().iter().for_each(|map| commands.prepare_fresh(map, ImageAccess::Storage));
            commands.prepare_fresh(&captured, ImageAccess::Sampled); // bound, not read
            commands.pass(FILTER, |commands| filter.record_norms(commands));
            filter.maps().iter().for_each(|map| commands.prepare(map, ImageAccess::Sampled));
            Ok(())
        })?;
        let sampler = Sampler::new(gpu, "given back", AddressMode::Clamp, 1)?;
        let bindings =
            [Binding::Sampled(direct, &sampler), Binding::Sampled(soft, &sampler), Binding::StorageImage(&captured, 0)];
        let placed: Vec<ProbeBlock> = probes.iter().map(block).collect();
        let bytes = bytemuck::cast_slice(&placed);
        Ok(Self {
            blocks: Buffer::with_bytes(gpu, "probes", BufferKind::StorageFromCpu, bytes)?,
            capture: Pipeline::compute(gpu, SHADER, &[], &layouts.capturing(), size_of::<Work>() as u32)?,
            set: DescriptorSet::new(gpu, "probe", &layouts.probe, &bindings)?,
            placed,
            given_back: [Arc::clone(direct), Arc::clone(soft)],
            filter,
            captured,
            stage: Stage::Capture(0, 0),
            pace: Pace::new(CAPTURE, f64::from(GROUP)..=f64::from(size[1])),
            scale: 0.0,
        })
    }

    /// Takes the maps for the light of the scene, as they were captured before with this `scale`.
    pub fn finish(&mut self, scale: f32) {
        (self.stage, self.scale) = (Stage::Done, scale);
    }

    /// Where they stand, as bytes.
    pub fn placed(&self) -> &[u8] {
        bytemuck::cast_slice(&self.placed)
    }

    /// [`LocalProbes::maps`] with names.
    pub fn named_maps(&self) -> [(&'static str, &Image); 3] {
        let [even, odd, irradiance] = self.maps();
        [("even", even), ("odd", odd), ("irradiance", irradiance)]
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        self.placed.len() as u32
    }

    /// Even and odd specular levels and irradiance over pi, arrays of a cube for each.
    pub fn maps(&self) -> [&Arc<Image>; 3] {
        self.filter.maps()
    }

    /// What the maps' values are to be multiplied by; 0 before they hold any.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Whether all is captured.
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Captures all again, for other light; until then the old maps stay, if the new ones have the same scale.
    pub fn restart(&mut self, scale: f32) {
        self.stage = Stage::Capture(0, 0);
        if scale != self.scale {
            self.scale = 0.0;
        }
    }

    /// Makes the next piece of a capture take about `target_ms`, from the times of a frame that a piece was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        self.pace.follow(times, target_ms);
    }

    /// Records the next piece of work; maps hold radiance / `scale`.
    pub fn record(&mut self, commands: &mut Commands<'_>, sets: &BakeSets<'_>, scale: f32) {
        match self.stage {
            Stage::Capture(probe, first_row) => {
                let [_, height] = self.captured.desc().size;
                let rows = (self.pace.size() as u32 / GROUP * GROUP).clamp(GROUP, height - first_row);
                self.pace.issue(f64::from(rows));
                let work = Work { position: self.placed[probe].position, first_row, rows };
                commands.pass(CAPTURE, |commands| self.capture(commands, sets, work));
                let next = first_row + rows;
                self.stage = if next < height { Stage::Capture(probe, next) } else { Stage::Filter(probe) };
            }
            Stage::Filter(probe) => {
                commands.pass(FILTER, |commands| {
                    self.maps().iter().for_each(|map| commands.prepare(map, ImageAccess::Storage));
                    commands.prepare(&self.captured, ImageAccess::Sampled);
                    self.filter.record_light(commands, scale, probe as u32);
                    self.maps().iter().for_each(|map| commands.prepare(map, ImageAccess::Sampled));
                });
                let is_last = probe + 1 == self.placed.len();
                self.stage = if is_last { Stage::Done } else { Stage::Capture(probe + 1, 0) };
                if is_last {
                    self.scale = scale;
                    tracing::debug!("probes: all {} captured", self.placed.len());
                }
            }
            Stage::Done => {}
        }
    }

    fn capture(&self, commands: &mut Commands<'_>, sets: &BakeSets<'_>, work: Work) {
        commands.prepare(&self.captured, ImageAccess::Storage);
        self.given_back.iter().for_each(|image| commands.prepare(image, ImageAccess::Sampled));
        sets.bind(commands, &self.capture, &self.set);
        commands.push(&self.capture, bytes_of(&work));
        commands.dispatch([self.captured.desc().size[0].div_ceil(GROUP), work.rows.div_ceil(GROUP), 1]);
    }
}

fn block(probe: &Probe) -> ProbeBlock {
    let Probe { position, bounds } = probe;
    ProbeBlock {
        position: (*position).into(),
        low: bounds.min.into(),
        high: bounds.max.into(),
        border: probe.border().max(f32::MIN_POSITIVE),
    }
}
