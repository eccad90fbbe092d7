//! Lines of text over the picture, in an 8×8 pixel font.

use std::sync::Arc;

use font8x8::legacy::BASIC_LEGACY;

use super::frame_set::FrameSet;
use super::layouts;
use super::output::Output;
use crate::Result;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, DescriptorSet, Gpu, GraphicsDesc, Pipeline};

/// The most characters; further ones are cut.
pub const MAX_CHARACTERS: usize = 4096;
/// Font pixels: a cell's size, with a little room between lines, and the distance from the picture's corner.
const CELL: [f32; 2] = [8.0, 10.0];
const MARGIN: f32 = 6.0;

/// Text in the picture's upper left corner.
pub struct Overlay {
    pipeline: Pipeline,
    font: DescriptorSet,
    eyes: u32,
    /// One for each character: column, row << 8, character << 16.
    cells: Vec<u32>,
    cell_ndc: [f32; 2],
    origin_ndc: [f32; 2],
}

impl Overlay {
    /// Makes an empty overlay for display pictures with `eyes` eyes.
    pub fn new(gpu: &Arc<Gpu>, eyes: u32) -> Result<Self> {
        let (frame, layout) = (layouts::frame(gpu)?, layouts::text(gpu)?);
        let glyphs: Vec<u8> = BASIC_LEGACY.iter().flatten().copied().collect();
        let font = Buffer::with_bytes(gpu, "font", BufferKind::StorageFromCpu, &glyphs)?;
        let font = DescriptorSet::new(gpu, "text", &layout, &[Binding::Storage(&font)])?;
        let desc = GraphicsDesc {
            name: "text",
            vertex: "text.vert",
            fragment: Some("text.frag"),
            constants: &[(0, eyes)],
            sets: &[&frame, &layout],
            push_bytes: 16,
            colours: &[Output::Display.format()],
            blend: true,
            ..GraphicsDesc::default()
        };
        let pipeline = Pipeline::graphics(gpu, &desc)?;
        let cells = Vec::with_capacity(MAX_CHARACTERS);
        Ok(Self { pipeline, font, eyes, cells, cell_ndc: [0.0; 2], origin_ndc: [0.0; 2] })
    }

    /// Sets the text; characters outside ASCII show as `?`. `scale` is pixels per font pixel.
    pub fn set_text(&mut self, lines: &[String], picture: [u32; 2], scale: u32) {
        let cells = (0u32..)
            .zip(lines.iter().take(256))
            .flat_map(|(row, line)| (0u32..256).zip(line.chars()).map(move |(column, c)| cell(column, row, c)));
        self.cells.clear();
        self.cells.extend(cells.take(MAX_CHARACTERS));
        let pixel = picture.map(|s| 2.0 / s as f32);
        let scale = scale as f32;
        self.cell_ndc = [pixel[0] * CELL[0] * scale, pixel[1] * CELL[1] * scale];
        self.origin_ndc = pixel.map(|p| p * MARGIN * scale - 1.0);
    }

    /// The number of columns and rows of text that fit.
    pub fn grid(picture: [u32; 2], scale: u32) -> [usize; 2] {
        let fits = |i: usize| ((picture[i] as f32 / scale as f32 - 2.0 * MARGIN) / CELL[i]).max(0.0) as usize;
        [fits(0), fits(1)]
    }

    /// The data that a frame has to push for [`Overlay::draw`].
    pub(super) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.cells)
    }

    /// Draws the text that was pushed at the offset `storage`; to be called while rendering.
    pub(super) fn draw(&self, commands: &mut Commands<'_>, frame: FrameSet<'_>, storage: u32) {
        frame.bind(commands, &self.pipeline, storage);
        commands.bind_set(&self.pipeline, 1, &self.font, &[]);
        commands.push(&self.pipeline, bytemuck::cast_slice(&[self.cell_ndc, self.origin_ndc]));
        commands.draw(6, self.cells.len() as u32 * self.eyes);
    }
}

fn cell(column: u32, row: u32, character: char) -> u32 {
    let code = u32::from(character);
    column | row << 8 | (if code < 128 { code } else { u32::from('?') }) << 16
}
