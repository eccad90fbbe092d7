//! Bakes of probes: what smooth surfaces mirror of the rooms around them, captured by rays once the lightmap is done, and
//! filtered like a panorama; a piece with each frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};

use super::bake_sets::BakeSets;
use super::layouts::Layouts;
use super::material_code::shader_for;
use super::pace::Pace;
use super::probe_maps::ProbeMaps;
use crate::Result;
use crate::gpu::{
    AddressMode, Binding, Commands, Constant, DescriptorSet, Format, Gpu, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, PassTime, Pipeline, Sampler, submit_and_wait,
};
use crate::precompute::{Alpha, HierarchicalConvolution};
use crate::scene::{Bounds, Probe};

/// Names of the passes, for their times.
pub const CAPTURE: &str = "probe capture";
pub const FILTER: &str = "probe filter";
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
    /// Rays begin where they leave this box.
    low: [f32; 3],
    high: [f32; 3],
    /// What they see is taken to lie on this box.
    walls_low: [f32; 3],
    walls_high: [f32; 3],
}

impl Work {
    fn new(probe: &Probe, first_row: u32, rows: u32) -> Self {
        // Around a thing all is seen from near its probe, and nothing is in a wrong place.
        let walls = if probe.thing.is_some() { Bounds::of([probe.position]) } else { probe.bounds };
        let [hidden, walls] = [probe.hidden(), walls].map(|b| [b.min.into(), b.max.into()]);
        let ([low, high], [walls_low, walls_high]) = (hidden, walls);
        Self { position: probe.position.into(), first_row, rows, low, high, walls_low, walls_high }
    }
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The captured panorama of a probe, from a row on.
    Capture(usize, u32),
    Filter(usize),
    Done,
}

/// Probes whose maps are being computed.
pub struct ProbeBake {
    probes: Arc<ProbeMaps>,
    filter: HierarchicalConvolution,
    /// Whether the filter knows its norms.
    has_norms: bool,
    /// Of direct and of soft light.
    given_back: [Arc<Image>; 2],
    captured: Arc<Image>,
    capture: Pipeline,
    set: DescriptorSet,
    stage: Stage,
    /// Rows of a piece.
    pace: Pace,
}

impl ProbeBake {
    /// Prepares the capture of probes that see surfaces give back this radiance of direct and of soft light. The maps are
    /// not touched.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        probes: &Arc<ProbeMaps>,
        [direct, soft]: [&Arc<Image>; 2],
        constants: &[Constant],
    ) -> Result<Self> {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE;
        // As wide as four faces, at the equator.
        let face = probes.specular[0].desc().size[0];
        let size = [4 * face, 2 * face];
        let captured = Image::new(gpu, "captured", ImageDesc::flat(Format::R32G32B32A32_SFLOAT, size, usage))?;
        let filter = HierarchicalConvolution::new(gpu, (&captured, Alpha::Share), &probes.specular, None)?;
        submit_and_wait(gpu, |commands| {
            commands.prepare_fresh(&captured, ImageAccess::Sampled); // bound, not read
            Ok(())
        })?;
        let sampler = Sampler::new(gpu, "given back", AddressMode::Clamp, 1)?;
        let bindings =
            [Binding::Sampled(direct, &sampler), Binding::Sampled(soft, &sampler), Binding::StorageImage(&captured, 0)];
        Ok(Self {
            probes: Arc::clone(probes),
            filter,
            has_norms: false,
            given_back: [Arc::clone(direct), Arc::clone(soft)],
            capture: {
                let shader = shader_for(SHADER, constants);
                Pipeline::compute(gpu, &shader, constants, &layouts.capturing(), size_of::<Work>() as u32)?
            },
            set: DescriptorSet::new(gpu, "probe", &layouts.probe, &bindings)?,
            captured,
            stage: Stage::Capture(0, 0),
            pace: Pace::new(CAPTURE, f64::from(GROUP)..=f64::from(size[1])),
        })
    }

    /// Whether all is captured.
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Captures all again, for other light.
    pub fn restart(&mut self) {
        self.stage = Stage::Capture(0, 0);
    }

    /// Makes the next piece of a capture take about `target_ms`, from the times of a frame that a piece was part of.
    pub fn pace(&mut self, times: &[PassTime], target_ms: f64) {
        self.pace.follow(times, target_ms);
    }

    /// Records the next piece of work.
    pub fn record(&mut self, commands: &mut Commands<'_>, sets: &BakeSets<'_>) {
        match self.stage {
            Stage::Capture(probe, first_row) => {
                let [_, height] = self.captured.desc().size;
                let rows = (self.pace.size() as u32 / GROUP * GROUP).clamp(GROUP, height - first_row);
                self.pace.issue(f64::from(rows));
                let work = Work::new(&self.probes.placed()[probe], first_row, rows);
                commands.pass(CAPTURE, |commands| self.capture(commands, sets, work));
                let next = first_row + rows;
                self.stage = if next < height { Stage::Capture(probe, next) } else { Stage::Filter(probe) };
            }
            Stage::Filter(probe) => {
                commands.pass(FILTER, |commands| {
                    self.probes.specular.iter().for_each(|map| commands.prepare(map, ImageAccess::Storage));
                    commands.prepare(&self.captured, ImageAccess::Sampled);
                    if !self.has_norms {
                        self.filter.record_norms(commands);
                    }
                    self.filter.record_light(commands, 1.0, probe as u32);
                    self.probes.specular.iter().for_each(|map| commands.prepare(map, ImageAccess::Sampled));
                });
                self.has_norms = true;
                let count = self.probes.placed().len();
                let is_last = probe + 1 == count;
                self.stage = if is_last { Stage::Done } else { Stage::Capture(probe + 1, 0) };
                if is_last {
                    tracing::debug!("probes: all {count} captured");
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
