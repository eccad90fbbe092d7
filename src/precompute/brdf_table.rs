//! The split sum's table of directional albedo, over n·v and roughness.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{
    Bind, Format, Gpu, Image, ImageDesc, ImageUsageFlags, PassTime, Pipeline, Set, SetLayout, Shape, Slot, Use, run,
};
use crate::reference::brdf::Geometry;

/// Texels along n·v and along roughness.
const SIZE: u32 = 128;
/// Its samples are well spread; 1024 leave an error below that of storing halves.
const LOG2_SAMPLES: u32 = 10;

/// R scales F0, G is added to it: Karis, "Real Shading in Unreal Engine 4" (2013), eq. 8. x = n·v, y = roughness.
pub struct BrdfTable {
    pub image: Image,
    pub times: Vec<PassTime>,
}

impl BrdfTable {
    /// Computes the table for one geometry term.
    pub fn new(gpu: &Arc<Gpu>, geometry: Geometry) -> Result<Self> {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::TRANSFER_SRC;
        let desc = ImageDesc { shape: Shape::Flat, ..ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [SIZE; 2], usage) };
        let image = Image::new(gpu, "BRDF table", desc)?;
        let layout = SetLayout::new(gpu, "BRDF table", &[Slot::StorageImage])?;
        let set = Set::new(gpu, "BRDF table", &layout, &[Bind::StorageImage(&image, 0)])?;
        let constants = [(0, geometry as u32), (1, LOG2_SAMPLES)];
        let pipeline = Pipeline::compute(gpu, "brdf_table.comp", &constants, &[&layout], 0)?;
        let times = run(gpu, |commands| {
            commands.prepare(&image, Use::Storage);
            commands.pass("BRDF table", |commands| {
                commands.bind(&pipeline, &[&set]);
                commands.dispatch([SIZE.div_ceil(8), SIZE.div_ceil(8), 1]);
            });
            commands.prepare(&image, Use::Sampled);
            Ok(())
        })?;
        Ok(Self { image, times })
    }
}

#[cfg(test)]
#[path = "brdf_table_tests.rs"]
mod tests;
