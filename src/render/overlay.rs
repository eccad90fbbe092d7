//! Lines of text over the picture, in an 8×8 pixel font.

use std::sync::Arc;

use font8x8::legacy::BASIC_LEGACY;

use super::{FRAMES_IN_FLIGHT, Output};
use crate::Result;
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, Commands, DescriptorSet, DescriptorSetLayout, Gpu, GraphicsDesc, Pipeline,
};

/// Characters that fit on the screen's grid at most; more are cut.
const MAX_CHARACTERS: usize = 4096;
/// Font pixels: a cell's size, with a little room between lines, and the distance from the picture's corner.
const CELL: [f32; 2] = [8.0, 10.0];
const MARGIN: f32 = 6.0;

/// Text in the picture's upper left corner.
pub struct Overlay {
    pipeline: Pipeline,
    frames: Vec<(Arc<Buffer>, DescriptorSet)>,
    eyes: u32,
    count: u32,
    cell_ndc: [f32; 2],
    origin_ndc: [f32; 2],
}

impl Overlay {
    /// Makes an empty overlay for display pictures with `eyes` eyes.
    pub fn new(gpu: &Arc<Gpu>, eyes: u32) -> Result<Self> {
        let layout = DescriptorSetLayout::new(gpu, "text", &[BindingType::Storage, BindingType::Storage])?;
        let glyphs: Vec<u8> = BASIC_LEGACY.iter().flatten().copied().collect();
        let font = Buffer::with_bytes(gpu, "font", BufferKind::StorageFromCpu, &glyphs)?;
        let frame = |_| {
            let cells = Buffer::new(gpu, "text", BufferKind::StorageFromCpu, 4 * MAX_CHARACTERS as u64)?;
            let set = DescriptorSet::new(gpu, "text", &layout, &[Binding::Storage(&cells), Binding::Storage(&font)])?;
            Ok((cells, set))
        };
        let frames = (0..FRAMES_IN_FLIGHT).map(frame).collect::<Result<_>>()?;
        let pipeline = Pipeline::graphics(
            gpu,
            &GraphicsDesc {
                name: "text",
                vertex: "text.vert",
                fragment: Some("text.frag"),
                constants: &[(0, eyes)],
                sets: &[&layout],
                push_bytes: 16,
                vertex_stride: 0,
                vertex_attributes: &[],
                colours: &[Output::Display.format()],
                depth: None,
                samples: 1,
                blend: true,
            },
        )?;
        Ok(Self { pipeline, frames, eyes, count: 0, cell_ndc: [0.0; 2], origin_ndc: [0.0; 2] })
    }

    /// Sets the text for the frame in `slot`; characters outside ASCII show as `?`. `scale` is pixels per font pixel.
    pub fn set_text(&mut self, slot: usize, lines: &[String], picture: [u32; 2], scale: u32) {
        let cells: Vec<u32> = (0u32..)
            .zip(lines.iter().take(256))
            .flat_map(|(row, line)| (0u32..256).zip(line.chars()).map(move |(column, c)| cell(column, row, c)))
            .take(MAX_CHARACTERS)
            .collect();
        self.frames[slot].0.write(0, bytemuck::cast_slice(&cells));
        self.count = cells.len() as u32;
        let pixel = picture.map(|s| 2.0 / s as f32);
        let scale = scale as f32;
        self.cell_ndc = [pixel[0] * CELL[0] * scale, pixel[1] * CELL[1] * scale];
        self.origin_ndc = pixel.map(|p| p * MARGIN * scale - 1.0);
    }

    /// How many columns and rows of text fit.
    pub fn grid(picture: [u32; 2], scale: u32) -> [usize; 2] {
        let fits = |i: usize| ((picture[i] as f32 / scale as f32 - 2.0 * MARGIN) / CELL[i]).max(0.0) as usize;
        [fits(0), fits(1)]
    }

    /// Draws the text set for `slot`; called while rendering.
    pub(super) fn draw(&self, commands: &mut Commands<'_>, slot: usize) {
        commands.bind(&self.pipeline, &[&self.frames[slot].1]);
        commands.push(&self.pipeline, bytemuck::cast_slice(&[self.cell_ndc, self.origin_ndc]));
        commands.draw(6, self.count * self.eyes);
    }
}

fn cell(column: u32, row: u32, character: char) -> u32 {
    let code = u32::from(character);
    column | row << 8 | (if code < 128 { code } else { u32::from('?') }) << 16
}
