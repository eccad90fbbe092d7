//! The images that the compositor reads: one flat image per eye, in as many pairs as there are frames in flight.
//!
//! The compositor copies a submitted image on the program's queue, so the next write into it waits by its
//! barrier. A runtime that reads later still has a frame's time: a pair is written again only after WaitGetPoses has
//! returned twice since its Submit.

use std::sync::Arc;

use super::runtime::EyePicture;
use crate::Result;
use crate::gpu::{Commands, Gpu, Handles, Image, ImageAccess, ImageDesc, ImageUsageFlags, Rect};
use crate::render::{FRAMES_IN_FLIGHT, Output};

/// Left and right, for each frame in flight.
pub struct EyeImages {
    pairs: Vec<[Arc<Image>; 2]>,
    handles: Handles,
}

impl EyeImages {
    /// Creates images of `size` pixels.
    pub fn new(gpu: &Arc<Gpu>, size: [u32; 2]) -> Result<Self> {
        // A compositor may copy, sample or resolve them.
        let usage = ImageUsageFlags::TRANSFER_SRC
            | ImageUsageFlags::TRANSFER_DST
            | ImageUsageFlags::SAMPLED
            | ImageUsageFlags::COLOR_ATTACHMENT;
        let desc = ImageDesc::flat(Output::Display.format(), size, usage);
        let pair = |_| Ok([Image::new(gpu, "left eye", desc)?, Image::new(gpu, "right eye", desc)?]);
        Ok(Self { pairs: (0..FRAMES_IN_FLIGHT).map(pair).collect::<Result<_>>()?, handles: gpu.handles() })
    }

    /// Copies the upper left `area` of both layers of a picture and leaves the pair in layout TRANSFER_SRC_OPTIMAL, as
    /// OpenVR requires. The last column and row are repeated once beyond the area: filtering at its edge reads them.
    pub fn fill(&self, commands: &mut Commands<'_>, slot: usize, picture: &Image, area: [u32; 2]) {
        commands.pass("eyes", |commands| {
            let (areas, count) = with_border(area, picture.desc().size);
            commands.prepare(picture, ImageAccess::CopyFrom);
            for (layer, image) in (0u32..).zip(&self.pairs[slot]) {
                commands.prepare_fresh(image, ImageAccess::CopyTo);
                commands.copy_layer(picture, layer, image, &areas[..count]);
                commands.prepare(image, ImageAccess::CopyFrom);
            }
        });
    }

    /// The description of a pair for the runtime.
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

/// The copies, each to a corner, that put an area in place and repeat its last column, row and texel beyond it, as far as an
/// image of `size` has room there; and how many there are.
fn with_border([width, height]: [u32; 2], size: [u32; 2]) -> ([(Rect, [u32; 2]); 4], usize) {
    let whole = (Rect::of([width, height]), [0, 0]);
    let column = (Rect { corner: [width - 1, 0], size: [1, height] }, [width, 0]);
    let row = (Rect { corner: [0, height - 1], size: [width, 1] }, [0, height]);
    let corner = (Rect { corner: [width - 1, height - 1], size: [1, 1] }, [width, height]);
    match (width < size[0], height < size[1]) {
        (true, true) => ([whole, column, row, corner], 4),
        (true, false) => ([whole, column, whole, whole], 2),
        (false, true) => ([whole, row, whole, whole], 2),
        (false, false) => ([whole; 4], 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The source texel of each texel that is written.
    fn sources(area: [u32; 2], size: [u32; 2]) -> std::collections::BTreeMap<[u32; 2], [u32; 2]> {
        let mut sources = std::collections::BTreeMap::new();
        let (copies, count) = with_border(area, size);
        for (from, to) in &copies[..count] {
            for (x, y) in (0..from.size[1]).flat_map(|y| (0..from.size[0]).map(move |x| (x, y))) {
                let at = [to[0] + x, to[1] + y];
                assert!(at[0] < size[0] && at[1] < size[1], "{at:?} lies outside of {size:?}");
                let before = sources.insert(at, [from.corner[0] + x, from.corner[1] + y]);
                assert_eq!(before, None, "{at:?} is written twice");
            }
        }
        sources
    }

    #[test]
    fn the_border_repeats_the_areas_edge_where_there_is_room() {
        for (area, written) in [([4, 3], 20), ([8, 3], 32), ([4, 6], 30), ([8, 6], 48), ([1, 1], 4)] {
            let sources = sources(area, [8, 6]);
            assert_eq!(sources.len(), written, "{area:?}");
            for (at, from) in sources {
                assert_eq!(from, [at[0].min(area[0] - 1), at[1].min(area[1] - 1)]);
            }
        }
    }
}
