//! Probes and the maps that pictures read of them, arrays of a cube for each.

use std::sync::Arc;

use super::shared::ProbeBlock;
use crate::Result;
use crate::gpu::{
    Buffer, BufferKind, Format, Gpu, Image, ImageAccess, ImageDesc, ImageUsageFlags, Shape, submit_and_wait,
};
use crate::reference::levels::LEVELS;
use crate::scene::Probe;
use crate::scene::probes::MOST_PROBES;

/// Probes, at least one, and their maps: radiance of surfaces, W/(m² sr), no more than halves hold, and
/// the share of the panorama behind them.
pub struct ProbeMaps {
    /// [`ProbeBlock`]s.
    pub blocks: Arc<Buffer>,
    placed: Vec<Probe>,
    /// Even and odd levels.
    pub specular: [Arc<Image>; 2],
}

impl ProbeMaps {
    /// Makes maps with `face` texels along a face; they hold nothing.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(gpu: &Arc<Gpu>, probes: &[Probe], face: u32) -> Result<Self> {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE;
        let usage = usage | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
        let count = probes.len() as u32;
        let cubes = |name| {
            let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [face; 2], usage);
            let mips = (LEVELS / 2) as u32;
            Image::new(gpu, name, ImageDesc { shape: Shape::CubeArray(count), mips, ..flat })
        };
        let mut all = [ProbeBlock::default(); MOST_PROBES];
        all.iter_mut().zip(probes).for_each(|(to, probe)| *to = block(probe));
        let maps = Self {
            blocks: Buffer::with_bytes(gpu, "probes", BufferKind::FromCpu, bytemuck::cast_slice(&all))?,
            placed: probes.to_vec(),
            specular: [cubes("even levels of probes")?, cubes("odd levels of probes")?],
        };
        submit_and_wait(gpu, |commands| {
            maps.specular.iter().for_each(|map| commands.prepare_fresh(map, ImageAccess::Sampled)); // bound, not read
            Ok(())
        })?;
        Ok(maps)
    }

    /// Where they stand.
    pub fn placed(&self) -> &[Probe] {
        &self.placed
    }

    /// Their maps with names.
    pub fn named(&self) -> [(&'static str, &Image); 2] {
        let [even, odd] = &self.specular;
        [("even", even), ("odd", odd)]
    }
}

fn block(probe: &Probe) -> ProbeBlock {
    let Probe { position, bounds, .. } = probe;
    let reach = probe.reach();
    ProbeBlock {
        position: (*position).into(),
        low: bounds.min.into(),
        high: bounds.max.into(),
        reach_low: reach.min.into(),
        reach_high: reach.max.into(),
        border: probe.border().max(f32::MIN_POSITIVE),
    }
}
