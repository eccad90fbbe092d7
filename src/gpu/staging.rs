//! Uploads through a ring of staging memory of fixed size, whatever is uploaded; while the GPU copies from one part of it,
//! the next is filled.

use std::ops::Range;
use std::sync::Arc;

use super::buffer::{Buffer, BufferKind};
use super::command_buffer::CommandBuffer;
use super::commands::Commands;
use super::device::Gpu;
use super::image::{Image, ImageAccess};
use super::submit::submit_and_wait;
use crate::Result;

/// Bytes of one part of the ring.
const PART_BYTES: u64 = 16 << 20;
/// Parts of the ring; each is made when it is first needed.
const PARTS: usize = 4;
/// What every kind of texel and block may be copied from.
const ALIGNMENT: u64 = 16;

/// One part of the ring, and the copies from it that have not been sent.
struct StagingBlock<'a> {
    recorder: CommandBuffer,
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
    /// All of an image has been copied.
    Done {
        image: &'a Image,
    },
}

/// Takes uploads and sends them part by part; `finish` waits for the last.
pub struct Upload<'a> {
    gpu: &'a Arc<Gpu>,
    parts: Vec<StagingBlock<'a>>,
    current: usize,
    part_bytes: u64,
}

impl<'a> Upload<'a> {
    /// A ring that takes no memory yet.
    pub fn new(gpu: &'a Arc<Gpu>) -> Self {
        Self { gpu, parts: Vec::new(), current: 0, part_bytes: PART_BYTES }
    }

    /// Fills a buffer from its start.
    pub fn buffer(&mut self, to: &'a Buffer, bytes: &[u8]) -> Result<()> {
        let mut offset = 0;
        for chunk in bytes.chunks(usize::try_from(self.part_bytes).unwrap_or(usize::MAX)) {
            let size = chunk.len() as u64;
            let (part, from) = self.room(size)?;
            // What was asked for is there.
            part.buffer.write(usize::try_from(from).unwrap_or(usize::MAX), chunk);
            part.copies.push(Copy::Buffer { from, to, offset, bytes: size });
            offset += size;
        }
        Ok(())
    }

    /// Fills one mip of a one-layer image with tightly packed texels, or blocks with `block_side` texels along a side. Large
    /// ones go in bands. The other mips of the image are filled by other calls, then comes [`Upload::image_done`].
    ///
    /// # Panics
    /// If the bytes are not those of the mip, or one row of them is larger than a part of the ring: a defect of the caller.
    pub fn mip(&mut self, to: &'a Image, mip: u32, block_side: u32, bytes: &[u8]) -> Result<()> {
        let height = to.mip_size(mip)[1];
        let block_rows = height.div_ceil(block_side);
        let row_bytes = bytes.len() as u64 / u64::from(block_rows);
        let in_band = u32::try_from(self.part_bytes / row_bytes.max(1)).unwrap_or(u32::MAX);
        assert!(in_band > 0 && row_bytes * u64::from(block_rows) == bytes.len() as u64, "no mip of this image");
        for first in (0..block_rows).step_by(in_band as usize) {
            let end = block_rows.min(first.saturating_add(in_band));
            let band = row_bytes * u64::from(first)..row_bytes * u64::from(end);
            let (part, from) = self.room(band.end - band.start)?;
            // The band is within the bytes, whose length is a usize.
            part.buffer.write(from as usize, &bytes[band.start as usize..band.end as usize]);
            let rows = first * block_side..height.min(end * block_side);
            part.copies.push(Copy::Rows { from, to, mip, rows });
        }
        Ok(())
    }

    /// Says that all mips of an image have been given; shaders may then read it.
    pub fn image_done(&mut self, image: &'a Image) -> Result<()> {
        self.room(0)?.0.copies.push(Copy::Done { image });
        Ok(())
    }

    /// Sends what is left and waits for all of it.
    pub fn finish(mut self) -> Result<()> {
        self.send()?;
        self.parts.iter_mut().try_for_each(|part| part.recorder.finish().map(drop))
    }

    /// The part of the ring with so much room, at most a part's size, and where in it that begins.
    fn room(&mut self, bytes: u64) -> Result<(&mut StagingBlock<'a>, u64)> {
        let full = self.parts.get(self.current).is_some_and(|part| part.used + bytes > self.part_bytes);
        if full {
            self.send()?;
            self.current = (self.current + 1) % PARTS;
        }
        if self.current == self.parts.len() {
            let buffer = Buffer::new(self.gpu, "staging", BufferKind::Upload, self.part_bytes)?;
            self.parts.push(StagingBlock {
                recorder: CommandBuffer::new(self.gpu)?,
                buffer,
                used: 0,
                copies: Vec::new(),
            });
        } else if full {
            // The GPU may still be copying from it.
            self.parts[self.current].recorder.finish()?;
        }
        let part = &mut self.parts[self.current];
        let from = part.used;
        part.used = (part.used + bytes).next_multiple_of(ALIGNMENT);
        Ok((part, from))
    }

    /// Sends the current part's copies.
    fn send(&mut self) -> Result<()> {
        let Some(part) = self.parts.get_mut(self.current) else { return Ok(()) };
        let StagingBlock { recorder, buffer, copies, used } = part;
        let (mut commands, _) = recorder.begin()?;
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
/// `texels` makes the tightly packed texels, `bytes_per_texel` each, of a range of rows.
pub fn upload_rows(
    gpu: &Arc<Gpu>,
    to: &Image,
    bytes_per_texel: u64,
    texels: impl Fn(Range<u32>) -> Vec<u8>,
) -> Result<()> {
    let [width, height] = to.desc().size;
    let mut upload = Upload::new(gpu);
    let band = u32::try_from(upload.part_bytes / (u64::from(width) * bytes_per_texel)).unwrap_or(u32::MAX).max(1);
    for first in (0..height).step_by(band as usize) {
        let rows = first..height.min(first.saturating_add(band));
        let bytes = texels(rows.clone());
        let (part, from) = upload.room(bytes.len() as u64)?;
        part.buffer.write(usize::try_from(from).unwrap_or(usize::MAX), &bytes);
        part.copies.push(Copy::Rows { from, to, mip: 0, rows });
    }
    upload.finish()?;
    submit_and_wait(gpu, |commands| {
        commands.generate_mips(to);
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Format, GpuOptions, ImageDesc, ImageUsageFlags, read_buffer, read_mips};
    use super::*;

    fn validated() -> Arc<Gpu> {
        Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap()
    }

    fn bytes(count: u64, seed: u64) -> Vec<u8> {
        (0..count).map(|i| (i.wrapping_mul(0x9e37_79b9).wrapping_add(seed) >> 13) as u8).collect()
    }

    fn small_ring<'a>(gpu: &'a Arc<Gpu>) -> Upload<'a> {
        Upload { part_bytes: 1 << 12, ..Upload::new(gpu) }
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
        assert_eq!(upload.parts.len(), PARTS);
        upload.finish().unwrap();
        for (seed, image) in (0..).zip(&images) {
            assert!(read_mips(&gpu, image, 4).unwrap() == mips(100 * seed), "image {seed}");
        }
        assert!(read_buffer(&gpu, &buffer).unwrap() == contents);
        gpu.messages().check().unwrap();
    }

    #[test]
    fn one_small_upload_takes_one_part_and_none_takes_nothing() {
        let gpu = validated();
        let buffer = Buffer::new(&gpu, "small", BufferKind::Storage, 100).unwrap();
        let mut upload = small_ring(&gpu);
        upload.buffer(&buffer, &[]).unwrap();
        assert!(upload.parts.is_empty());
        upload.buffer(&buffer, &bytes(100, 1)).unwrap();
        assert_eq!(upload.parts.len(), 1);
        upload.finish().unwrap();
        Upload::new(&gpu).finish().unwrap();
        assert_eq!(read_buffer(&gpu, &buffer).unwrap(), bytes(100, 1));
        gpu.messages().check().unwrap();
    }
}
