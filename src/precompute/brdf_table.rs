//! The split sum's table of directional albedo, over n·v and roughness.

use std::sync::Arc;

use super::cache::{Cache, cached};
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
    /// What a texel says, for other programs.
    pub const MEANING: &str = "specular albedo = R * F0 + G; x: n.v, y: roughness";

    /// Computes the table for one geometry term, or takes it from the cache.
    pub fn new(gpu: &Arc<Gpu>, geometry: Geometry, cache: Option<&Cache>) -> Result<Self> {
        let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | copies;
        let desc = ImageDesc { shape: Shape::Flat, ..ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [SIZE; 2], usage) };
        let image = Image::new(gpu, "BRDF table", desc)?;
        let compute = || {
            let layout = SetLayout::new(gpu, "BRDF table", &[Slot::StorageImage])?;
            let set = Set::new(gpu, "BRDF table", &layout, &[Bind::StorageImage(&image, 0)])?;
            let constants = [(0, geometry as u32), (1, LOG2_SAMPLES)];
            let pipeline = Pipeline::compute(gpu, "brdf_table.comp", &constants, &[&layout], 0)?;
            run(gpu, |commands| {
                commands.prepare(&image, Use::Storage);
                commands.pass("BRDF table", |commands| {
                    commands.bind(&pipeline, &[&set]);
                    commands.dispatch([SIZE.div_ceil(8), SIZE.div_ceil(8), 1]);
                });
                commands.prepare(&image, Use::Sampled);
                Ok(())
            })
        };
        let source = [&(geometry as u32).to_le_bytes()[..]];
        let times = cached(gpu, cache, "BRDF table from the cache", &source, &[("BRDF table", &image)], compute)?;
        Ok(Self { image, times })
    }
}
