//! Bytes between CPU and GPU: uploads in batches of bounded size, and readback.

use std::sync::Arc;

use super::buffer::{Buffer, BufferKind};
use super::commands::{Commands, Part};
use super::device::Gpu;
use super::image::{Image, Use};
use super::recorder::run;
use crate::Result;

/// Staging memory a batch may take before it is sent.
const BATCH_BYTES: u64 = 64 << 20;

enum Copy<'a> {
    Buffer {
        staging: Buffer,
        to: &'a Buffer,
    },
    /// Mip 0 of a one-layer image; the other mips are made by halving.
    Texture {
        staging: Buffer,
        to: &'a Image,
    },
}

/// Gathers uploads and sends them together; `finish` waits for the last.
pub struct Upload<'a> {
    gpu: &'a Arc<Gpu>,
    copies: Vec<Copy<'a>>,
    bytes: u64,
}

impl<'a> Upload<'a> {
    /// An empty batch.
    pub fn new(gpu: &'a Arc<Gpu>) -> Self {
        Self { gpu, copies: Vec::new(), bytes: 0 }
    }

    /// Fills a buffer from its start.
    pub fn buffer(&mut self, to: &'a Buffer, bytes: &[u8]) -> Result<()> {
        let staging = self.stage(bytes)?;
        self.copies.push(Copy::Buffer { staging, to });
        self.flush_if_full()
    }

    /// Fills mip 0 of a one-layer image with tightly packed texels, and the other mips by halving.
    pub fn texture(&mut self, to: &'a Image, bytes: &[u8]) -> Result<()> {
        let staging = self.stage(bytes)?;
        self.copies.push(Copy::Texture { staging, to });
        self.flush_if_full()
    }

    /// Sends what is left and waits for it.
    pub fn finish(mut self) -> Result<()> {
        self.flush()
    }

    fn stage(&mut self, bytes: &[u8]) -> Result<Buffer> {
        self.bytes += bytes.len() as u64;
        Buffer::with_bytes(self.gpu, "staging", BufferKind::Upload, bytes)
    }

    fn flush_if_full(&mut self) -> Result<()> {
        if self.bytes >= BATCH_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        let copies = std::mem::take(&mut self.copies);
        self.bytes = 0;
        if copies.is_empty() {
            return Ok(());
        }
        run(self.gpu, |commands| {
            copies.iter().for_each(|copy| record(commands, copy));
            commands.buffers_written();
            Ok(())
        })?;
        Ok(())
    }
}

fn record(commands: &mut Commands<'_>, copy: &Copy<'_>) {
    match copy {
        Copy::Buffer { staging, to } => commands.copy_buffer(staging, 0, to, 0, staging.size().min(to.size())),
        Copy::Texture { staging, to } => {
            commands.prepare_fresh(to, Use::CopyTo);
            commands.copy_to_image(staging, 0, to, Part { mip: 0, layer: 0 });
            commands.halve_mips(to);
        }
    }
}

/// Copies a buffer back to the CPU.
pub fn read_buffer(gpu: &Arc<Gpu>, from: &Buffer) -> Result<Vec<u8>> {
    let to = Buffer::new(gpu, "readback", BufferKind::Readback, from.size())?;
    run(gpu, |commands| {
        commands.buffers_written();
        commands.copy_buffer(from, 0, &to, 0, from.size());
        commands.copies_to_host();
        Ok(())
    })?;
    Ok(to.read().to_vec())
}

/// Copies one layer of one mip back to the CPU, tightly packed rows from the top.
pub fn read_image(gpu: &Arc<Gpu>, from: &Image, part: Part, bytes_per_texel: u64) -> Result<Vec<u8>> {
    let [width, height] = from.mip_size(part.mip);
    let size = u64::from(width) * u64::from(height) * bytes_per_texel;
    let to = Buffer::new(gpu, "readback", BufferKind::Readback, size)?;
    let before = from.state.get();
    run(gpu, |commands| {
        commands.prepare(from, Use::CopyFrom);
        commands.copy_from_image(from, part, &to, 0);
        commands.copies_to_host();
        commands.prepare(from, before);
        Ok(())
    })?;
    Ok(to.read().to_vec())
}
