//! The reference: samples of the whole BRDF over the panorama, a few per pixel and frame, averaged over frames.

use std::fmt;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable, bytes_of};
use glam::UVec4;
use serde::Serialize;

use super::eye::Eye;
use super::frame_set::FrameSet;
use super::importance::importance;
use super::light_plan::DARK_SCENE;
use super::output::Output;
use super::pipeline_request::PipelineRequest;
use super::ray_scene::RaySet;
use super::settings::Transport;
use super::shared::{FrameBlock, constant};
use super::targets::ViewTargets;
use super::visible_sky::{VisibleSky, most_places};
use crate::Result;
use crate::gpu::{
    AddressMode, Attachments, Binding, Buffer, BufferKind, ColourAttachment, Commands, DEPTH_FORMAT, DepthAttachment,
    DescriptorSet, FRAMES_IN_FLIGHT, Format, FrameContext, GraphicsDesc, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, Pipeline, Sampler, Shape,
};
use crate::scene::places::Places;

/// The format of samples and means: `Output::Linear`'s, which `glsl/reference.frag` writes.
const FORMAT: Format = Format::R32G32B32A32_SFLOAT;
/// Pixels along a side of `glsl/reference_accumulate.comp`'s workgroups.
const GROUP: u32 = 8;

/// The standard errors of a picture's pixels, relative to each pixel's radiance, R + G + B.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StandardError {
    /// Frames averaged so far.
    pub frames: u32,
    /// The mean over all pixels that are not black.
    pub mean_relative: f64,
    pub max_relative: f64,
}

impl fmt::Display for StandardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [mean, max] = [self.mean_relative, self.max_relative].map(|e| 100.0 * e);
        if !(mean.is_finite() && max.is_finite()) {
            return write!(f, "standard error unknown, because some values are too large ({} frames)", self.frames);
        }
        write!(f, "standard error {mean:.3} %, at worst {max:.1} % ({} frames)", self.frames)
    }
}

/// The inputs that all averaged frames share.
#[derive(Clone, Copy)]
struct Shown {
    /// Without jitter.
    block: FrameBlock,
    /// The part of the picture that is drawn, pixels.
    area: [u32; 2],
}

impl Shown {
    /// Whether frames of both can be averaged: exposure may differ, as it is applied after averaging.
    fn is_like(&self, other: &Self) -> bool {
        let bare = |shown: &Self| FrameBlock { exposure: 0.0, sample_index: 0, ..shown.block };
        bytes_of(&bare(self)) == bytes_of(&bare(other)) && self.area == other.area
    }
}

/// The push constants of `glsl/reference_accumulate.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Count {
    area: [u32; 2],
    frames: u32,
}

/// The passes that follow the forward pass, and what its rays meet.
pub struct ReferencePasses {
    accumulate: Pipeline,
    show: Pipeline,
    pub rays: RaySet,
    /// Only where surfaces block light of the panorama.
    visible_sky: Option<VisibleSky>,
}

impl ReferencePasses {
    /// Creates the pipelines and builds what rays meet.
    pub fn new(request: &PipelineRequest) -> Result<Self> {
        let PipelineRequest { gpu, layouts, ray_scene, panorama, sun, settings, eyes, .. } = request;
        let push_bytes = size_of::<Count>() as u32;
        let accumulate = Pipeline::compute(gpu, "reference_accumulate.comp", &[], &[&layouts.accumulate], push_bytes)?;
        let show = GraphicsDesc {
            name: "show",
            vertex: "reference_show.vert",
            fragment: Some("reference_show.frag"),
            constants: &[
                (constant::EYES, *eyes),
                (constant::LINEAR_OUTPUT, u32::from(settings.output == Output::Linear)),
            ],
            sets: &[&layouts.frame, &layouts.show],
            colours: &[settings.output.format()],
            ..GraphicsDesc::default()
        };
        let traced = (settings.transport() != Transport::None).then_some(&**ray_scene);
        let places = match settings.transport() {
            Transport::All => {
                let rays = ray_scene.get(gpu, layouts)?;
                if ray_scene.is_dark(&rays) {
                    tracing::warn!("{DARK_SCENE}");
                }
                rays.places(most_places(gpu))
            }
            Transport::None | Transport::Direct => Places::default(),
        };
        let table = importance(gpu, panorama, sun.as_ref(), &places)?;
        let learned_sky = || VisibleSky::new(request, &table, places.count);
        let visible_sky = (places.count > 0).then(learned_sky).transpose()?;
        let rays = RaySet::new(gpu, layouts, traced, Some(&table))?;
        Ok(Self { accumulate, show: Pipeline::graphics(gpu, &show)?, rays, visible_sky })
    }
}

impl ReferencePasses {
    /// Whether paths should follow light from the panorama, as far as the finished frame knew that had `slot`.
    pub fn wants_sky_relays(&self, slot: usize) -> bool {
        self.visible_sky.as_ref().is_some_and(|sky| sky.follows_light(slot))
    }
}

/// The mean of all frames so far and its standard error, in images that outlive a frame.
pub struct ReferenceAccumulator {
    latest: Arc<Image>,
    depth: Arc<Image>,
    mean: Arc<Image>,
    deviations: Arc<Image>,
    errors: Arc<Buffer>,
    /// For each frame slot: the errors, and the number of frames they belong to.
    readbacks: Vec<(Arc<Buffer>, u32)>,
    accumulate: DescriptorSet,
    show: DescriptorSet,
    groups: [u32; 3],
    frames: u32,
    /// The inputs of the accumulated frames.
    shown: Option<Shown>,
}

impl ReferenceAccumulator {
    /// Creates the images for pictures of `size` pixels, one layer per eye of the request.
    pub fn new(PipelineRequest { gpu, layouts, eyes, .. }: &PipelineRequest, size: [u32; 2]) -> Result<Self> {
        let make = |name: &str, format, usage| {
            let flat = ImageDesc::flat(format, size, usage);
            Image::new(gpu, name, ImageDesc { shape: Shape::Layers(*eyes), ..flat })
        };
        let kept = ImageUsageFlags::STORAGE | ImageUsageFlags::SAMPLED;
        let latest = make("latest", FORMAT, ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::SAMPLED)?;
        let depth = make("reference depth", DEPTH_FORMAT, ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?;
        let (mean, deviations) = (make("mean", FORMAT, kept)?, make("deviations", FORMAT, kept)?);
        let groups = [size[0].div_ceil(GROUP), size[1].div_ceil(GROUP), *eyes];
        let bytes = groups.map(u64::from).iter().product::<u64>() * size_of::<[f32; 3]>() as u64;
        let errors = Buffer::new(gpu, "errors", BufferKind::Storage, bytes)?;
        let readback = |_| Ok((Buffer::new(gpu, "errors", BufferKind::Readback, bytes)?, 0));
        let sampler = Sampler::new(gpu, "reference", AddressMode::Clamp, 1)?;
        let bindings = [
            Binding::Sampled(&latest, &sampler),
            Binding::StorageImage(&mean, 0),
            Binding::StorageImage(&deviations, 0),
            Binding::Storage(&errors),
        ];
        Ok(Self {
            accumulate: DescriptorSet::new(gpu, "accumulate", &layouts.accumulate, &bindings)?,
            show: DescriptorSet::new(gpu, "show", &layouts.show, &[Binding::Sampled(&mean, &sampler)])?,
            latest,
            depth,
            mean,
            deviations,
            errors,
            readbacks: (0..FRAMES_IN_FLIGHT).map(readback).collect::<Result<_>>()?,
            groups,
            frames: 0,
            shown: None,
        })
    }

    /// The index of the next frame among those averaged: 0 whenever its inputs differ from the last frame's.
    /// `block` is without jitter, `area` the part of the picture that is drawn.
    pub fn next_index(&mut self, block: FrameBlock, area: [u32; 2]) -> u32 {
        let shown = Shown { block, area };
        if self.shown.is_none_or(|last| !last.is_like(&shown)) || self.frames == u32::MAX {
            self.frames = 0;
        }
        self.shown = Some(shown);
        self.frames
    }

    /// Averages from the next frame on anew.
    pub fn restart(&mut self) {
        self.shown = None;
    }

    /// Records one frame: `draw` draws its samples, which are accumulated; the mean is shown in the picture of `targets`. `block` is the
    /// offset of the frame's block, `scene` set 1.
    pub fn record(
        &mut self,
        frame: &mut FrameContext<'_>,
        block: u32,
        passes: &mut ReferencePasses,
        targets: &ViewTargets,
        scene: &DescriptorSet,
        draw: impl FnOnce(&mut Commands<'_>, FrameSet<'_>, &RaySet),
    ) {
        let FrameContext { commands, set, slot, .. } = frame;
        let set = FrameSet { set, block };
        self.frames += 1;
        if let Some(sky) = &mut passes.visible_sky {
            sky.record(commands, set, scene, &passes.rays, (self.frames, targets.area, *slot));
        }
        commands.pass("samples", |commands| {
            commands.prepare_fresh(&self.depth, ImageAccess::Depth);
            commands.prepare_fresh(&self.latest, ImageAccess::Colour);
            let colours = &[ColourAttachment::cleared(self.latest.attachment(), [0.0; 4])];
            let depth = Some(DepthAttachment::transient(self.depth.attachment()));
            commands.render(&Attachments { colours, depth, area: targets.area }, |commands| {
                draw(commands, set, &passes.rays)
            });
        });
        commands.pass("accumulate", |commands| {
            commands.prepare(&self.latest, ImageAccess::Sampled);
            commands.prepare(&self.mean, ImageAccess::Storage);
            commands.prepare(&self.deviations, ImageAccess::Storage);
            // The last frame's errors are copied before they are overwritten.
            commands.buffers_written();
            commands.bind(&passes.accumulate, &[&self.accumulate]);
            commands.push(&passes.accumulate, bytes_of(&Count { area: targets.area, frames: self.frames }));
            commands.dispatch(self.groups);
            commands.buffers_written();
            let (readback, frames) = &mut self.readbacks[*slot];
            commands.copy_buffer(&self.errors, 0, readback, 0, self.errors.size());
            commands.copies_to_host();
            *frames = self.frames;
        });
        commands.pass("show", |commands| {
            commands.prepare(&self.mean, ImageAccess::Sampled);
            commands.prepare_fresh(&targets.picture, ImageAccess::Colour);
            targets.draw_over(commands, |commands| {
                set.bind(commands, &passes.show, 0);
                commands.bind_set(&passes.show, 1, &self.show, &[]);
                commands.draw(3, self.groups[2]);
            });
        });
    }

    /// The standard error after the finished frame that had `slot`; `None` before the second frame.
    pub fn standard_error(&self, slot: usize) -> Option<StandardError> {
        let (readback, frames) = &self.readbacks[slot];
        let groups: Vec<[f32; 3]> = readback.read(bytemuck::pod_collect_to_vec);
        if *frames < 2 {
            return None;
        }
        let sum = |i: usize| groups.iter().map(|g| f64::from(g[i])).sum::<f64>();
        let max_relative = groups.iter().map(|g| f64::from(g[1])).fold(0.0, f64::max);
        Some(StandardError { frames: *frames, mean_relative: sum(0) / sum(2).max(1.0), max_relative })
    }
}

/// The eye with the subpixel jitter of frame `index`: uniform, and independent between frames, as the standard error
/// assumes.
pub fn jittered(eye: &Eye, index: u32, size: [u32; 2]) -> Eye {
    let bits = pcg4d(UVec4::new(index, 0x9e37, 0x79b9, 0x7f4a));
    let unit = |bits: u32| (bits >> 8) as f32 / 16_777_216.0 - 0.5;
    let dx = unit(bits.x) * (eye.right - eye.left) / size[0] as f32;
    let dy = unit(bits.y) * (eye.up - eye.down) / size[1] as f32;
    Eye { left: eye.left + dx, right: eye.right + dx, down: eye.down + dy, up: eye.up + dy, ..*eye }
}

/// As in `glsl/importance.glsl`: Jarzynski and Olano (2020).
fn pcg4d(v: UVec4) -> UVec4 {
    let mut v = v.to_array().map(|c| c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for round in 0..2 {
        for (to, a, b) in [(0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)] {
            v[to] = v[to].wrapping_add(v[a].wrapping_mul(v[b]));
        }
        if round == 0 {
            v = v.map(|c| c ^ (c >> 16));
        }
    }
    UVec4::from_array(v)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn averaging_goes_on_through_exposure_and_ends_with_everything_else() {
        let shown = Shown { block: FrameBlock::default(), area: [8, 8] };
        let with = |change: fn(&mut Shown)| {
            let mut other = shown;
            change(&mut other);
            shown.is_like(&other)
        };
        assert!(with(|s| s.block.exposure = 3.0));
        assert!(!with(|s| s.block.environment_rotation[0] = 0.5));
        assert!(!with(|s| s.block.eyes[0].world_from_view[3][0] = 1e-3));
        assert!(!with(|s| s.block.light_count = 1));
        assert!(!with(|s| s.block.world_from_models[3][0] = 1.0));
        assert!(!with(|s| s.area = [8, 7]));
    }

    /// Jitter fills the pixel evenly and never leaves it; case 15: also where f32 cannot count frames any more.
    #[test]
    fn jitter_stays_in_the_pixel_and_does_not_repeat() {
        let eye = Eye::looking(Vec3::Z, Vec3::ZERO, 60.0, 1.0);
        let pixel = (eye.right - eye.left) / 100.0;
        for first in [0, 1 << 24] {
            let offset = |i: u32| (jittered(&eye, first + i, [100, 100]).left - eye.left) / pixel;
            let mut offsets: Vec<f32> = (0..1000).map(offset).collect();
            assert!(offsets.iter().all(|o| o.abs() <= 0.5 + 1e-4));
            let mean = offsets.iter().sum::<f32>() / 1000.0;
            assert!(mean.abs() < 4.0 * 0.2887 / 1000f32.sqrt(), "{mean}");
            offsets.sort_by(f32::total_cmp);
            offsets.dedup();
            assert!(offsets.len() > 990, "{} of 1000", offsets.len());
        }
    }
}
