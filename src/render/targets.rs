//! The images that one frame is drawn into: colour and depth, multisampled and maybe smaller, and the resolved picture.

use std::sync::Arc;

use super::output::Output;
use super::settings::RenderSettings;
use crate::context::Context;
use crate::gpu::{
    Attachments, ColourAttachment, Commands, DEPTH_FORMAT, DepthAttachment, Gpu, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, Rect, Shape,
};
use crate::{Error, Result};

/// The sides of a draft relative to the drawn image's.
const DRAFT_SCALE: f32 = 0.5;

/// The kind and size of a frame's images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    pub output: Output,
    /// Per pixel: 1 or 4.
    pub samples: u32,
    /// The sides of the drawn image relative to the picture's, at most 1.
    pub scale: f32,
}

impl Detail {
    /// The kind that settings ask for.
    pub fn of(&RenderSettings { output, samples, scale, .. }: &RenderSettings) -> Self {
        Self { output, samples, scale }
    }

    /// The drawn size for a picture's size, pixels.
    fn drawn(self, picture: [u32; 2]) -> [u32; 2] {
        picture.map(|side| ((side as f32 * self.scale).round() as u32).clamp(1, side.max(1)))
    }
}

/// One layer per eye in each image.
pub struct ViewTargets {
    detail: Detail,
    samples: Option<Arc<Image>>,
    depth: Arc<Image>,
    /// The drawn image, if it is smaller than the picture.
    small: Option<Arc<Image>>,
    /// The drawn image of drafts, from the first one on.
    draft: Option<Arc<Image>>,
    is_draft: bool,
    pub picture: Arc<Image>,
    /// The part of the picture that is drawn, pixels from the upper left corner.
    pub area: [u32; 2],
}

impl ViewTargets {
    /// Makes targets for pictures of `size` pixels for `eyes` eyes.
    pub fn new(gpu: &Arc<Gpu>, size: [u32; 2], eyes: u32, detail: Detail) -> Result<Self> {
        Self::check(gpu, size, eyes, detail)?;
        let Detail { output, samples, .. } = detail;
        let (colour, drawn) = (ImageUsageFlags::COLOR_ATTACHMENT, detail.drawn(size));
        let make = |name: &str, size, format, usage, samples| {
            let flat = ImageDesc::flat(format, size, usage);
            Image::new(gpu, name, ImageDesc { shape: Shape::Layers(eyes), samples, ..flat })
        };
        let copied = colour | ImageUsageFlags::TRANSFER_SRC;
        let picture_usage = copied | ImageUsageFlags::TRANSFER_DST | ImageUsageFlags::SAMPLED;
        let multisampled = (samples > 1).then(|| make("samples", drawn, output.format(), colour, samples));
        let small = (drawn != size).then(|| make("small picture", drawn, output.format(), copied, 1));
        Ok(Self {
            detail,
            samples: multisampled.transpose()?,
            depth: make("depth", drawn, DEPTH_FORMAT, ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT, samples)?,
            small: small.transpose()?,
            draft: None,
            is_draft: false,
            picture: make("picture", size, output.format(), picture_usage, 1)?,
            area: size,
        })
    }

    /// What they were made for.
    pub fn detail(&self) -> Detail {
        self.detail
    }

    /// Checks that such targets can be made.
    pub fn check(gpu: &Gpu, size: [u32; 2], eyes: u32, detail: Detail) -> Result<()> {
        let most = gpu.max_image_size();
        if size.iter().any(|s| !(1..=most).contains(s)) {
            let message = format!("a picture of {}x{} cannot be made; 1x1 to {most}x{most} can", size[0], size[1]);
            return Err(Error::Usage(message));
        }
        let (bytes, there) = (Self::bytes(size, eyes, detail), gpu.info().memory);
        if bytes > there {
            let what = format!("a picture of {}x{}", size[0], size[1]);
            let problem = format!("{} MiB against {} MiB there are", bytes >> 20, there >> 20);
            return Err(Error::GpuMemory { what, problem });
        }
        Ok(())
    }

    /// The approximate GPU memory of such targets.
    fn bytes(size: [u32; 2], eyes: u32, detail: Detail) -> u64 {
        let Detail { output, samples, .. } = detail;
        let depth_bytes = 4;
        let multisampled = if samples > 1 { u64::from(samples) * output.bytes() } else { 0 };
        let drawn = detail.drawn(size);
        let small = if drawn == size { 0 } else { output.bytes() };
        let pixels = |size: [u32; 2]| size.map(u64::from).iter().product::<u64>() * u64::from(eyes);
        pixels(drawn) * (multisampled + u64::from(samples) * depth_bytes + small) + pixels(size) * output.bytes()
    }

    /// Draws coarse pictures from now on, with a quarter of the pixels, or whole ones again. The picture's size stays.
    pub fn set_draft(&mut self, gpu: &Arc<Gpu>, draft: bool) -> Result<()> {
        if draft && self.draft.is_none() {
            let desc = *self.depth.desc();
            let size = drafted(desc.size);
            let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC;
            let flat = ImageDesc::flat(self.detail.output.format(), size, usage);
            self.draft = Some(Image::new(gpu, "draft", ImageDesc { shape: desc.shape, ..flat })?);
        }
        self.is_draft = draft;
        Ok(())
    }

    /// Whether coarse pictures are drawn.
    pub fn is_draft(&self) -> bool {
        self.is_draft
    }

    /// Clears and draws all eyes at once.
    pub fn render(&self, commands: &mut Commands<'_>, record: impl FnOnce(&mut Commands<'_>)) {
        let draft = self.draft.as_ref().filter(|_| self.is_draft);
        let small = draft.or(self.small.as_ref());
        let drawn = small.unwrap_or(&self.picture);
        commands.prepare_fresh(&self.depth, ImageAccess::Depth);
        commands.prepare_fresh(drawn, ImageAccess::Colour);
        let area = self.detail.drawn(self.area);
        let area = if draft.is_some() { drafted(area) } else { area };
        let colour = match &self.samples {
            Some(samples) => {
                commands.prepare_fresh(samples, ImageAccess::Colour);
                ColourAttachment::cleared(samples.attachment(), [0.0; 4]).resolved_to(drawn.attachment())
            }
            None => ColourAttachment::cleared(drawn.attachment(), [0.0; 4]),
        };
        let depth = Some(DepthAttachment::transient(self.depth.attachment()));
        commands.render(&Attachments { colours: &[colour], depth, area }, record);
        if let Some(small) = small {
            commands.prepare(small, ImageAccess::CopyFrom);
            commands.prepare_fresh(&self.picture, ImageAccess::CopyTo);
            commands.scale(small, &self.picture, [Rect::of(area), Rect::of(self.area)]);
        }
    }

    /// Draws over the finished picture, without depth or multisampling.
    pub fn draw_over(&self, commands: &mut Commands<'_>, record: impl FnOnce(&mut Commands<'_>)) {
        commands.prepare(&self.picture, ImageAccess::Colour);
        let colours = &[ColourAttachment::loaded(self.picture.attachment())];
        commands.render(&Attachments { colours, depth: None, area: self.area }, record);
    }
}

/// The size of a draft of an image.
fn drafted(size: [u32; 2]) -> [u32; 2] {
    size.map(|side| ((side as f32 * DRAFT_SCALE).round() as u32).max(1))
}

/// Whether pictures of this size can be made here.
///
/// # Errors
/// Sides beyond what images may have; more bytes than the GPU's memory has.
pub fn check_size(context: &Context, size: [u32; 2], eyes: u32, settings: &RenderSettings) -> Result<()> {
    ViewTargets::check(&context.gpu, size, eyes, Detail::of(settings))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smaller_frames_have_a_pixel_at_least_and_take_less_memory() {
        let detail = |scale| Detail { output: Output::Display, samples: 4, scale };
        assert_eq!(detail(1.0).drawn([1281, 721]), [1281, 721]);
        assert_eq!(detail(0.5).drawn([1281, 721]), [641, 361]);
        assert_eq!(detail(0.25).drawn([1, 2]), [1, 1]);
        let bytes = |scale| ViewTargets::bytes([1000, 1000], 2, detail(scale));
        assert_eq!(bytes(1.0), 2_000_000 * (4 * 4 + 4 * 4 + 4));
        assert_eq!(bytes(0.5), 500_000 * (4 * 4 + 4 * 4 + 4) + 2_000_000 * 4);
    }
}
