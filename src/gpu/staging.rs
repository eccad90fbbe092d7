//! Uploads through a ring of staging blocks of fixed size: while the GPU copies from one, the next is filled.

use std::ops::Range;
use std::sync::Arc;

use super::buffer::{Buffer, BufferKind};
use super::command_buffer::CommandBuffer;
use super::commands::Commands;
use super::device::Gpu;
use super::image::{Image, ImageAccess};
use super::submit::submit_and_wait;
use crate::Result;

/// Bytes of one staging block where there is memory, and the part of the GPU's that it may take; the least holds a row of any
/// image.
const BLOCK_BYTES: u64 = 16 << 20;
const MEMORY_PART: u64 = 32;
const LEAST_BYTES: u64 = 1 << 20;
/// Blocks of the ring; each is created when it is first needed.
const BLOCKS: usize = 4;
/// An offset that copies of every texel and block format allow.
const ALIGNMENT: u64 = 16;

/// One block of the ring, and the copies from it that have not been submitted.
struct StagingBlock<'a> {
    commands: CommandBuffer,
    buffer: Arc<Buffer>,
    used: u64,
    copies: Vec<Copy<'a>>,
}

enum Copy<'a> {
    Buffer {
        from: u64,
        to: &'a Buffer,
        offset: u64,
        bytes: u64,
    },
    Rows {
        from: u64,
        to: &'a Image,
        mip: u32,
        rows: Range<u32>,
    },
    /// All mips of an image have been copied.
    Done {
        image: &'a Image,
    },
}

/// Collects uploads and submits them block by block; `finish` waits for the last.
pub struct Upload<'a> {
    gpu: &'a Arc<Gpu>,
    blocks: Vec<StagingBlock<'a>>,
    current: usize,
    /// Blocks at most.
    most: usize,
    block_bytes: u64,
}

impl<'a> Upload<'a> {
    /// An empty ring; blocks are allocated by the first uploads.
    pub fn new(gpu: &'a Arc<Gpu>) -> Self {
        let block_bytes = (gpu.info().memory / MEMORY_PART).clamp(LEAST_BYTES, BLOCK_BYTES);
        Self { gpu, blocks: Vec::new(), current: 0, most: BLOCKS, block_bytes }
    }

    /// Fills a buffer from its start.
    pub fn buffer(&mut self, to: &'a Buffer, bytes: &[u8]) -> Result<()> {
        let mut offset = 0;
        for chunk in bytes.chunks(usize::try_from(self.block_bytes).unwrap_or(usize::MAX)) {
            let size = chunk.len() as u64;
            let (block, from) = self.room(size)?;
            block.buffer.write(usize::try_from(from).unwrap_or(usize::MAX), chunk);
            block.copies.push(Copy::Buffer { from, to, offset, bytes: size });
            offset += size;
        }
        Ok(())
    }

    /// Fills one mip of a one-layer image with tightly packed texels, or blocks with `block_side` texels along a side. Large
    /// ones go in bands. The other mips of the image are filled by other calls, then comes [`Upload::image_done`].
    ///
    /// # Panics
    /// If the bytes are not those of the mip, or one row of them is larger than a block of the ring: a defect of the caller.
    pub fn mip(&mut self, to: &'a Image, mip: u32, block_side: u32, bytes: &[u8]) -> Result<()> {
        let height = to.mip_size(mip)[1];
        let block_rows = height.div_ceil(block_side);
        let row_bytes = bytes.len() as u64 / u64::from(block_rows);
        let in_band = u32::try_from(self.block_bytes / row_bytes.max(1)).unwrap_or(u32::MAX);
        assert!(in_band > 0 && row_bytes * u64::from(block_rows) == bytes.len() as u64, "not a mip of this image");
        for first in (0..block_rows).step_by(in_band as usize) {
            let end = block_rows.min(first.saturating_add(in_band));
            let band = row_bytes * u64::from(first)..row_bytes * u64::from(end);
            let (block, from) = self.room(band.end - band.start)?;
            // The band is within the bytes, whose length is a usize.
            block.buffer.write(from as usize, &bytes[band.start as usize..band.end as usize]);
            let rows = first * block_side..height.min(end * block_side);
            block.copies.push(Copy::Rows { from, to, mip, rows });
        }
        Ok(())
    }

    /// Ends an image's upload after its last mip; shaders may sample it once `finish` has returned.
    pub fn image_done(&mut self, image: &'a Image) -> Result<()> {
        self.room(0)?.0.copies.push(Copy::Done { image });
        Ok(())
    }

    /// Submits the remaining copies and waits for all of them.
    pub fn finish(mut self) -> Result<()> {
        self.send()?;
        self.blocks.iter_mut().try_for_each(|block| block.commands.finish().map(drop))
    }

    /// A block with `bytes` free, at most a block's size, and their offset in it.
    fn room(&mut self, bytes: u64) -> Result<(&mut StagingBlock<'a>, u64)> {
        let full = self.blocks.get(self.current).is_some_and(|block| block.used + bytes > self.block_bytes);
        if full {
            self.send()?;
            self.current = (self.current + 1) % self.most;
        }
        if self.current == self.blocks.len() {
            match self.block() {
                Ok(block) => self.blocks.push(block),
                // The ring does with those that it has.
                Err(error) if error.is_out_of_memory() && full => (self.most, self.current) = (self.blocks.len(), 0),
                Err(error) => return Err(error),
            }
        }
        if full {
            // The GPU may still be copying from it.
            self.blocks[self.current].commands.finish()?;
        }
        let block = &mut self.blocks[self.current];
        let from = block.used;
        block.used = (block.used + bytes).next_multiple_of(ALIGNMENT);
        Ok((block, from))
    }

    fn block(&self) -> Result<StagingBlock<'a>> {
        let buffer = Buffer::new(self.gpu, "staging", BufferKind::Upload, self.block_bytes)?;
        Ok(StagingBlock { commands: CommandBuffer::new(self.gpu)?, buffer, used: 0, copies: Vec::new() })
    }

    /// Submits the current block's copies.
    fn send(&mut self) -> Result<()> {
        let Some(block) = self.blocks.get_mut(self.current) else { return Ok(()) };
        let StagingBlock { commands: command_buffer, buffer, copies, used } = block;
        let (mut commands, _) = command_buffer.begin()?;
        copies.iter().for_each(|copy| record(&mut commands, buffer, copy));
        commands.buffers_written();
        commands.submit(None)?;
        copies.clear();
        *used = 0;
        Ok(())
    }
}

fn record(commands: &mut Commands<'_>, staging: &Buffer, copy: &Copy<'_>) {
    match copy {
        Copy::Buffer { from, to, offset, bytes } => commands.copy_buffer(staging, *from, to, *offset, *bytes),
        Copy::Rows { from, to, mip, rows } => {
            if to.access(*mip, 0) != ImageAccess::CopyTo {
                commands.prepare(to, ImageAccess::CopyTo);
            }
            commands.copy_rows_to_image(staging, *from, to, *mip, rows.clone());
        }
        Copy::Done { image } => commands.prepare(image, ImageAccess::Sampled),
    }
}

/// Fills mip 0 of a one-layer image band by band, and the other mips by halving: a large picture is never held twice.
/// `texels` returns the tightly packed texels, `bytes_per_texel` each, of a range of rows.
pub fn upload_rows(
    gpu: &Arc<Gpu>,
    to: &Image,
    bytes_per_texel: u64,
    texels: impl Fn(Range<u32>) -> Vec<u8>,
) -> Result<()> {
    let [width, height] = to.desc().size;
    let mut upload = Upload::new(gpu);
    let band = u32::try_from(upload.block_bytes / (u64::from(width) * bytes_per_texel)).unwrap_or(u32::MAX).max(1);
    for first in (0..height).step_by(band as usize) {
        let rows = first..height.min(first.saturating_add(band));
        let bytes = texels(rows.clone());
        let (block, from) = upload.room(bytes.len() as u64)?;
        block.buffer.write(usize::try_from(from).unwrap_or(usize::MAX), &bytes);
        block.copies.push(Copy::Rows { from, to, mip: 0, rows });
    }
    upload.finish()?;
    submit_and_wait(gpu, |commands| {
        commands.generate_mips(to);
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod gpu_tests {
    use super::super::{Format, GpuOptions, ImageDesc, ImageUsageFlags, read_buffer, read_mips};
    use super::*;

    fn validated() -> Arc<Gpu> {
        Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap()
    }

    fn bytes(count: u64, seed: u64) -> Vec<u8> {
        (0..count).map(|i| (i.wrapping_mul(0x9e37_79b9).wrapping_add(seed) >> 13) as u8).collect()
    }

    fn small_ring<'a>(gpu: &'a Arc<Gpu>) -> Upload<'a> {
        Upload { block_bytes: 1 << 12, ..Upload::new(gpu) }
    }

    #[test]
    fn images_and_buffers_larger_than_the_ring_arrive_whole() {
        let gpu = validated();
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST | ImageUsageFlags::TRANSFER_SRC;
        let size = [300, 211];
        let desc = ImageDesc { mips: 9, ..ImageDesc::flat(Format::R8G8B8A8_UNORM, size, usage) };
        let images = [(); 3].map(|()| Image::new(&gpu, "large", desc).unwrap());
        let mips = |seed: u64| -> Vec<Vec<u8>> {
            let texels = |mip| images[0].mip_size(mip).map(u64::from).iter().product::<u64>();
            (0..9).map(|mip| bytes(4 * texels(mip), seed + u64::from(mip))).collect()
        };
        let buffer = Buffer::new(&gpu, "large", BufferKind::Storage, 100_003).unwrap();
        let contents = bytes(buffer.size(), 7);
        let mut upload = small_ring(&gpu);
        for (seed, image) in (0..).zip(&images) {
            for (mip, texels) in (0..).zip(mips(100 * seed)) {
                upload.mip(image, mip, 1, &texels).unwrap();
            }
            upload.image_done(image).unwrap();
            if seed == 1 {
                upload.buffer(&buffer, &contents).unwrap();
            }
        }
        assert_eq!(upload.blocks.len(), BLOCKS);
        upload.finish().unwrap();
        for (seed, image) in (0..).zip(&images) {
            assert!(read_mips(&gpu, image, 4).unwrap() == mips(100 * seed), "image {seed}");
        }
        assert!(read_buffer(&gpu, &buffer).unwrap() == contents);
        gpu.messages().check().unwrap();
    }

    #[test]
    fn one_small_upload_takes_one_block_and_none_takes_nothing() {
        let gpu = validated();
        let buffer = Buffer::new(&gpu, "small", BufferKind::Storage, 100).unwrap();
        let mut upload = small_ring(&gpu);
        upload.buffer(&buffer, &[]).unwrap();
        assert!(upload.blocks.is_empty());
        upload.buffer(&buffer, &bytes(100, 1)).unwrap();
        assert_eq!(upload.blocks.len(), 1);
        upload.finish().unwrap();
        Upload::new(&gpu).finish().unwrap();
        assert_eq!(read_buffer(&gpu, &buffer).unwrap(), bytes(100, 1));
        gpu.messages().check().unwrap();
    }
}
