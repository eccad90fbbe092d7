//! The images that the compositor reads: one flat image per eye, in as many pairs as there are frames in flight.
//!
//! The compositor copies a submitted image on our queue, so our next write into it waits by its barrier. A runtime that reads
//! later still has a frame's time: a pair is written again only after WaitGetPoses has come back twice since its Submit.

use std::sync::Arc;

use super::runtime::EyePicture;
use crate::Result;
use crate::gpu::{Commands, Gpu, Handles, Image, ImageAccess, ImageDesc, ImageUsageFlags};
use crate::render::{FRAMES_IN_FLIGHT, Output};

/// Left and right, for each frame in flight.
pub struct EyeImages {
    pairs: Vec<[Arc<Image>; 2]>,
    handles: Handles,
}

impl EyeImages {
    /// Of `size` pixels each.
    pub fn new(gpu: &Arc<Gpu>, size: [u32; 2]) -> Result<Self> {
        // What a compositor may do with them: copy, sample, resolve.
        let usage = ImageUsageFlags::TRANSFER_SRC
            | ImageUsageFlags::TRANSFER_DST
            | ImageUsageFlags::SAMPLED
            | ImageUsageFlags::COLOR_ATTACHMENT;
        let desc = ImageDesc::flat(Output::Display.format(), size, usage);
        let pair = |_| Ok([Image::new(gpu, "left eye", desc)?, Image::new(gpu, "right eye", desc)?]);
        Ok(Self { pairs: (0..FRAMES_IN_FLIGHT).map(pair).collect::<Result<_>>()?, handles: gpu.handles() })
    }

    /// Copies both layers of a picture, its upper left `area`, and leaves the pair ready to be read by copies: layout
    /// TRANSFER_SRC_OPTIMAL, as OpenVR demands.
    pub fn fill(&self, commands: &mut Commands<'_>, slot: usize, picture: &Image, area: [u32; 2]) {
        commands.pass("eyes", |commands| {
            commands.prepare(picture, ImageAccess::CopyFrom);
            for (layer, image) in (0u32..).zip(&self.pairs[slot]) {
                commands.prepare_fresh(image, ImageAccess::CopyTo);
                commands.copy_layer(picture, layer, image, area);
                commands.prepare(image, ImageAccess::CopyFrom);
            }
        });
    }

    /// What the runtime has to know of a pair.
    pub fn pictures(&self, slot: usize) -> [EyePicture; 2] {
        self.pairs[slot].each_ref().map(|image| EyePicture {
            handles: self.handles,
            image: image.handle(),
            size: image.desc().size,
            // Vulkan's formats are small positive numbers.
            format: image.desc().format.as_raw() as u32,
        })
    }
}
