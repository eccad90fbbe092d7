//! GPU buffers.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Deferred, Gpu};
use crate::{Error, Result};

/// What a buffer is for; decides its usage and where it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferKind {
    /// Vertices, on the GPU.
    Vertex,
    /// Indices, on the GPU.
    Index,
    /// Read and written by shaders, on the GPU.
    Storage,
    /// Small data the CPU writes and shaders read.
    Uniform,
    /// Larger data the CPU writes and shaders read.
    StorageFromCpu,
    /// CPU to GPU copies.
    Upload,
    /// GPU to CPU copies.
    Readback,
}

impl BufferKind {
    fn usage(self) -> (vk::BufferUsageFlags, MemoryLocation) {
        use vk::BufferUsageFlags as Usage;
        let copies = Usage::TRANSFER_DST | Usage::TRANSFER_SRC;
        match self {
            Self::Vertex => (Usage::VERTEX_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::Index => (Usage::INDEX_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::Storage => (Usage::STORAGE_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::Uniform => (Usage::UNIFORM_BUFFER, MemoryLocation::CpuToGpu),
            Self::StorageFromCpu => (Usage::STORAGE_BUFFER, MemoryLocation::CpuToGpu),
            Self::Upload => (Usage::TRANSFER_SRC, MemoryLocation::CpuToGpu),
            Self::Readback => (Usage::TRANSFER_DST, MemoryLocation::GpuToCpu),
        }
    }
}

/// A buffer and its memory.
pub struct Buffer {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::Buffer,
    allocation: Option<Allocation>,
    size: u64,
}

impl Buffer {
    /// Makes a buffer of `size` bytes (at least 1); its content is undefined.
    pub fn new(gpu: &Arc<Gpu>, name: &str, kind: BufferKind, size: u64) -> Result<Self> {
        let (usage, location) = kind.usage();
        let size = size.max(1);
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive, `info` is complete.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.map_err(Error::vulkan("making a buffer"))?;
        // SAFETY: `raw` was just made by this device.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let allocation = gpu.allocate(name, requirements, location, true).inspect_err(|_| {
            // SAFETY: the GPU has never seen the buffer.
            unsafe { gpu.device.destroy_buffer(raw, None) }
        })?;
        // SAFETY: the memory was allocated for this buffer's requirements and is not bound elsewhere.
        unsafe { gpu.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
            .map_err(Error::vulkan("binding buffer memory"))?;
        gpu.name(raw, name);
        Ok(Self { gpu: Arc::clone(gpu), raw, allocation: Some(allocation), size })
    }

    /// Makes a buffer the CPU can write (`Uniform`, `StorageFromCpu`, `Upload`) and fills it.
    pub fn with_bytes(gpu: &Arc<Gpu>, name: &str, kind: BufferKind, bytes: &[u8]) -> Result<Self> {
        let mut buffer = Self::new(gpu, name, kind, bytes.len() as u64)?;
        buffer.write(0, bytes);
        Ok(buffer)
    }

    /// Bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Writes through the CPU's mapping; the caller has seen to it that no running submission reads there.
    ///
    /// # Panics
    /// If the buffer is not CPU-visible or too short: a defect of the caller.
    pub fn write(&mut self, offset: usize, bytes: &[u8]) {
        let mapped = self.allocation.as_mut().and_then(Allocation::mapped_slice_mut);
        let target = mapped.and_then(|m| m.get_mut(offset..offset + bytes.len()));
        match target {
            Some(target) => target.copy_from_slice(bytes),
            None => panic!("write of {} bytes at {offset} into a buffer of {} bytes", bytes.len(), self.size),
        }
    }

    /// The CPU's view of a `Readback` buffer, after the copy has finished.
    pub fn read(&self) -> &[u8] {
        let mapped = self.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or(&[]);
        let size = usize::try_from(self.size).unwrap_or(usize::MAX);
        &mapped[..size.min(mapped.len())]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(allocation) = self.allocation.take() {
            self.gpu.defer_destruction(Deferred::Buffer(self.raw, allocation));
        }
    }
}
