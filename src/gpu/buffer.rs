//! GPU buffers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::deferred::Deferred;
use super::device::Gpu;
use crate::{Error, Result};

/// The purpose of a buffer; decides its usage flags and memory type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferKind {
    /// Vertices, in GPU memory; shaders may also read them as a storage buffer.
    Vertex,
    /// Indices, in GPU memory; shaders may also read them as a storage buffer.
    Index,
    /// Read and written by shaders, in GPU memory.
    Storage,
    /// Data the CPU writes and shaders read, as uniform and as storage buffers; copies may change it between frames.
    FromCpu,
    /// Per-frame data the CPU writes and shaders read, as uniform and as storage buffers.
    Arena,
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
            Self::Vertex => (Usage::VERTEX_BUFFER | Usage::STORAGE_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::Index => (Usage::INDEX_BUFFER | Usage::STORAGE_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::Storage => (Usage::STORAGE_BUFFER | copies, MemoryLocation::GpuOnly),
            Self::FromCpu => {
                (Usage::UNIFORM_BUFFER | Usage::STORAGE_BUFFER | Usage::TRANSFER_DST, MemoryLocation::CpuToGpu)
            }
            Self::Arena => (Usage::UNIFORM_BUFFER | Usage::STORAGE_BUFFER, MemoryLocation::CpuToGpu),
            Self::Upload => (Usage::TRANSFER_SRC, MemoryLocation::CpuToGpu),
            Self::Readback => (Usage::TRANSFER_DST, MemoryLocation::GpuToCpu),
        }
    }
}

/// A buffer and its memory. Shared by reference count: descriptor sets hold the buffers they bind.
pub struct Buffer {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::Buffer,
    /// `None` only while it is dropped. The lock makes writes through a shared buffer sound.
    memory: Mutex<Option<Allocation>>,
    size: u64,
}

impl Buffer {
    /// Creates a buffer of `size` bytes (at least 1); its content is undefined.
    pub fn new(gpu: &Arc<Gpu>, name: &str, kind: BufferKind, size: u64) -> Result<Arc<Self>> {
        let (usage, location) = kind.usage();
        let size = size.max(1);
        gpu.limits.check_buffer(name, size)?;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive, `info` is complete.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.map_err(Error::vulkan("creating a buffer"))?;
        // SAFETY: `raw` was just created by this device.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let allocation = gpu.allocate(name, requirements, location, true).inspect_err(|_| {
            // SAFETY: the GPU has never seen the buffer.
            unsafe { gpu.device.destroy_buffer(raw, None) }
        })?;
        // SAFETY: the memory outlives the object bound to it: both are freed together, the memory last.
        let (memory, offset) = (unsafe { allocation.memory() }, allocation.offset());
        // From here on, Drop releases both handles if a later step fails.
        let buffer = Self { gpu: Arc::clone(gpu), raw, memory: Mutex::new(Some(allocation)), size };
        // SAFETY: the memory was allocated for this buffer's requirements and is not bound elsewhere.
        unsafe { gpu.device.bind_buffer_memory(raw, memory, offset) }
            .map_err(Error::vulkan("binding buffer memory"))?;
        gpu.name(raw, name);
        Ok(Arc::new(buffer))
    }

    /// Creates a buffer the CPU can write (`FromCpu`, `Arena`, `Upload`) and fills it.
    pub fn with_bytes(gpu: &Arc<Gpu>, name: &str, kind: BufferKind, bytes: &[u8]) -> Result<Arc<Self>> {
        let buffer = Self::new(gpu, name, kind, bytes.len() as u64)?;
        buffer.write(0, bytes);
        Ok(buffer)
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Writes through the CPU mapping. The caller makes sure that no submission in flight reads these bytes.
    ///
    /// # Panics
    /// If the buffer is not CPU-visible or too short: a defect of the caller.
    pub fn write(&self, offset: usize, bytes: &[u8]) {
        let mut memory = self.memory();
        let mapped = memory.as_mut().and_then(Allocation::mapped_slice_mut);
        let target = mapped.and_then(|m| m.get_mut(offset..offset + bytes.len()));
        match target {
            Some(target) => target.copy_from_slice(bytes),
            None => panic!("write of {} bytes at {offset} into a buffer of {} bytes", bytes.len(), self.size),
        }
    }

    /// Calls `view` with the CPU mapping of a `Readback` buffer, after the copy into it has finished; empty for buffers
    /// that are not CPU-visible. `view` must not use the same buffer.
    pub fn read<R>(&self, view: impl FnOnce(&[u8]) -> R) -> R {
        let memory = self.memory();
        let mapped = memory.as_ref().and_then(Allocation::mapped_slice).unwrap_or(&[]);
        let size = usize::try_from(self.size).unwrap_or(usize::MAX);
        view(&mapped[..size.min(mapped.len())])
    }

    fn memory(&self) -> MutexGuard<'_, Option<Allocation>> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let allocation = self.memory().take();
        if let Some(allocation) = allocation {
            self.gpu.defer_destruction(Deferred::Buffer(self.raw, allocation));
        }
    }
}
