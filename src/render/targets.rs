//! The images that one frame is drawn into: colour and depth, multisampled, and the resolved picture.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{
    Commands, DEPTH_FORMAT, Format, Gpu, Image, ImageDesc, ImageUsageFlags, Shape, Targets as Rendering, Use,
};

/// What pictures hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Output {
    /// What a viewer sees: exposed, tone-mapped, 8-bit sRGB.
    Display,
    /// Scene radiance as it is, 32-bit float.
    Linear,
}

impl Output {
    /// The picture's format: RGBA.
    pub fn format(self) -> Format {
        match self {
            Self::Display => Format::R8G8B8A8_SRGB,
            Self::Linear => Format::R32G32B32A32_SFLOAT,
        }
    }

    /// Bytes per pixel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Display => 4,
            Self::Linear => 16,
        }
    }
}

/// One layer per eye in each image.
pub struct Targets {
    samples: Option<Image>,
    depth: Image,
    pub picture: Image,
    /// The part that is drawn, pixels from the upper left corner.
    pub area: [u32; 2],
}

impl Targets {
    /// Makes targets of `size` pixels for `eyes` eyes with 1 or 4 samples per pixel.
    pub fn new(gpu: &Arc<Gpu>, size: [u32; 2], eyes: u32, output: Output, samples: u32) -> Result<Self> {
        let colour = ImageUsageFlags::COLOR_ATTACHMENT;
        let make = |name: &str, format, usage, samples| {
            let flat = ImageDesc::flat(format, size, usage);
            Image::new(gpu, name, ImageDesc { shape: Shape::Layers(eyes), samples, ..flat })
        };
        let picture_usage = colour | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::SAMPLED;
        let multisampled = (samples > 1).then(|| make("samples", output.format(), colour, samples)).transpose()?;
        Ok(Self {
            samples: multisampled,
            depth: make("depth", DEPTH_FORMAT, ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT, samples)?,
            picture: make("picture", output.format(), picture_usage, 1)?,
            area: size,
        })
    }

    /// GPU memory that such targets take, about.
    pub fn bytes(size: [u32; 2], eyes: u32, output: Output, samples: u32) -> u64 {
        let depth_bytes = 4;
        let multisampled = if samples > 1 { u64::from(samples) * output.bytes() } else { 0 };
        let per_pixel = multisampled + u64::from(samples) * depth_bytes + output.bytes();
        size.map(u64::from).iter().product::<u64>() * u64::from(eyes) * per_pixel
    }

    /// Clears and draws all eyes at once.
    pub fn render(&self, commands: &mut Commands<'_>, record: impl FnOnce(&mut Commands<'_>)) {
        commands.prepare_fresh(&self.depth, Use::Depth);
        commands.prepare_fresh(&self.picture, Use::Colour);
        let (clear, area, depth) = (Some([0.0; 4]), self.area, Some(&self.depth));
        match &self.samples {
            Some(samples) => {
                commands.prepare_fresh(samples, Use::Colour);
                let resolve = Some(&self.picture);
                commands.render(&Rendering { colour: samples, resolve, depth, clear, area }, record);
            }
            None => {
                let colour = &self.picture;
                commands.render(&Rendering { colour, resolve: None, depth, clear, area }, record);
            }
        }
    }

    /// Draws over the finished picture, without depth or multisampling.
    pub fn draw_over(&self, commands: &mut Commands<'_>, record: impl FnOnce(&mut Commands<'_>)) {
        commands.prepare(&self.picture, Use::Colour);
        let area = self.area;
        commands.render(&Rendering { colour: &self.picture, resolve: None, depth: None, clear: None, area }, record);
    }
}
