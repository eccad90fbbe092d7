//! What of the panorama is seen from which places of a scene, and where its light comes in, learned by rays beside the
//! reference's frames: paths draw their samples of the panorama by it, and follow light from there. Few samples of all of the sky
//! go through a room's small window.
//!
//! Vévoda, Kondapaneni and Křivánek, "Bayesian Online Regression for Adaptive Direct Illumination Sampling" (2018), learn lights'
//! chances by place, too; here a light is a tile of the panorama.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};

use super::frame_set::FrameSet;
use super::importance::{PLACE_BYTES, RELAY_BYTES, RELAY_CELLS};
use super::pipeline_request::PipelineRequest;
use super::ray_scene::RaySet;
use super::shared::constant;
use crate::Result;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, DescriptorSet, FRAMES_IN_FLIGHT, Gpu, Pipeline};
use crate::reference::importance::{TILES, Tried};

/// The most places that are told apart, and the part of the GPU's memory that they may take.
const MOST_PLACES: u64 = 1024;
const MEMORY_PART: u64 = 16;
/// Bytes of the rays that one place has tried.
const TRIED_BYTES: u64 = (TILES * size_of::<Tried>()) as u64;
/// Frames of an average that learn; later ones draw by what these have found.
const LEARNING_FRAMES: u32 = 256;
/// Pixels of a frame for each path that learns; the fewest paths and the most, so that 32 bits count them all.
const PIXELS_PER_PATH: u32 = 4;
const FEWEST_PATHS: u32 = 2048;
const MOST_PATHS: u32 = 16384;
/// Bytes of a number that says whether something is so.
const WORD: u64 = size_of::<u32>() as u64;
/// Invocations of the stages' workgroups.
const GROUP: u32 = 64;

/// How many places this GPU has room for.
pub fn most_places(gpu: &Gpu) -> u32 {
    (gpu.info().memory / MEMORY_PART / (PLACE_BYTES + TRIED_BYTES)).min(MOST_PLACES) as u32
}

/// The push constants of `glsl/sky_chances.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ChancesWork {
    /// The panorama's own included.
    places: u32,
    forgets: u32,
}

/// The rays that were tried, and the stages that try them and make chances of what they met.
pub struct VisibleSky {
    visibility: Pipeline,
    chances: Pipeline,
    relay_chances: Pipeline,
    set: DescriptorSet,
    /// Without the panorama's own.
    places: u32,
    /// Holds at its end whether light is followed from the panorama.
    importance: Arc<Buffer>,
    /// The same for the CPU, for each frame slot that has learned.
    follows: Vec<(Arc<Buffer>, bool)>,
}

impl VisibleSky {
    /// Prepares learning for a table with so many places.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(request: &PipelineRequest, importance: &Arc<Buffer>, places: u32) -> Result<Self> {
        let PipelineRequest { gpu, layouts, eyes, .. } = request;
        let tried = Buffer::new(gpu, "sky rays", BufferKind::Storage, u64::from(places + 1) * TRIED_BYTES)?;
        let comes =
            Buffer::new(gpu, "sky light", BufferKind::Storage, (TILES * RELAY_CELLS * size_of::<u32>()) as u64)?;
        let shares_bytes = u64::from(MOST_PATHS / GROUP) * size_of::<[f32; 2]>() as u64;
        let shares = Buffer::new(gpu, "sky shares", BufferKind::Storage, shares_bytes)?;
        let bindings = [&tried, importance, &comes, &shares].map(Binding::Storage);
        let word = |_| Ok((Buffer::new(gpu, "sky relays", BufferKind::Readback, WORD)?, false));
        let sets = layouts.learning_sky();
        let constants = [(constant::EYES, *eyes), (constant::SUN, request.shades_sun().into())];
        Ok(Self {
            visibility: Pipeline::compute(gpu, "sky_visibility.comp", &constants, &sets, size_of::<u32>() as u32)?,
            chances: Pipeline::compute(gpu, "sky_chances.comp", &[], &sets, size_of::<ChancesWork>() as u32)?,
            relay_chances: Pipeline::compute(gpu, "sky_relay_chances.comp", &[], &sets, size_of::<u32>() as u32)?,
            set: DescriptorSet::new(gpu, "sky", &layouts.sky, &bindings)?,
            places,
            importance: Arc::clone(importance),
            follows: (0..FRAMES_IN_FLIGHT).map(word).collect::<Result<_>>()?,
        })
    }

    /// Whether light is worth following from the panorama, as far as the finished frame knew that had `slot`.
    pub fn follows_light(&self, slot: usize) -> bool {
        let (word, is_written) = &self.follows[slot];
        *is_written && word.read(|bytes| bytes.iter().any(|byte| *byte != 0))
    }

    /// Records what the frame of this number, from 1 on, of an average learns before its samples are drawn: the first one forgets
    /// all that was learned before.
    pub fn record(
        &mut self,
        commands: &mut Commands<'_>,
        frame: FrameSet<'_>,
        scene: &DescriptorSet,
        rays: &RaySet,
        (number, area, slot): (u32, [u32; 2], usize),
    ) {
        if number > LEARNING_FRAMES {
            return;
        }
        let bind = |commands: &mut Commands<'_>, pipeline: &Pipeline| {
            frame.bind(commands, pipeline, 0);
            for (i, set) in (1..).zip([scene, &self.set, &rays.set]) {
                commands.bind_set(pipeline, i, set, &[]);
            }
        };
        let chances = |commands: &mut Commands<'_>, forgets: bool| {
            bind(commands, &self.chances);
            let work = ChancesWork { places: self.places + 1, forgets: forgets.into() };
            commands.push(&self.chances, bytes_of(&work));
            commands.dispatch([self.places.div_ceil(GROUP), 1, 1]);
            // It reads and writes other parts of the same buffer.
            commands.buffers_written();
            bind(commands, &self.relay_chances);
            commands.push(&self.relay_chances, bytes_of(&u32::from(forgets)));
            commands.dispatch([1; 3]);
            commands.buffers_written();
        };
        commands.pass("visible sky", |commands| {
            // The last frame's paths read the chances; its accumulation waited for them, and this waits for that.
            commands.buffers_written();
            if number == 1 {
                chances(commands, true);
            }
            let paths = (area[0] * area[1] / PIXELS_PER_PATH).clamp(FEWEST_PATHS, MOST_PATHS);
            bind(commands, &self.visibility);
            commands.push(&self.visibility, bytes_of(&paths));
            commands.dispatch([paths.div_ceil(GROUP), 1, 1]);
            commands.buffers_written();
            if number.is_power_of_two() {
                chances(commands, false);
            }
            let (word, is_written) = &mut self.follows[slot];
            commands.copy_buffer(&self.importance, self.importance.size() - RELAY_BYTES as u64, word, 0, WORD);
            commands.copies_to_host();
            commands.buffers_written();
            *is_written = true;
        });
    }
}
