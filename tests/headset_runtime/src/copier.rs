//! Copies images into memory on the program's device and queue, two frames deep, and writes them as PNG.

use std::path::{Path, PathBuf};
use std::process;

use ash::vk::{self, Handle as _};
use openvr_sys as sys;

/// Both eyes, the dashboard's overlay and the held one.
pub const KINDS: [&str; 4] = ["left", "right", "overlay", "held"];
/// Copies under way at most per kind.
const DEPTH: u64 = 2;
/// After so long a copy is taken to hang: the program broke the device or its queue.
const PATIENCE_NS: u64 = 60_000_000_000;

/// What to copy and what becomes of it.
pub struct Copy {
    pub image: vk::Image,
    /// Four bytes per pixel.
    pub format: vk::Format,
    pub part: vk::Rect2D,
    /// Whether the picture's first row is the part's last.
    pub is_flipped: bool,
    pub frame: u64,
    pub file: Option<PathBuf>,
}

/// Memory of one copy with what is under way in it.
struct BindingType {
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: u64,
    under_way: Option<Copy>,
}

/// The program's device, as its first image named it.
pub struct Copier {
    device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    memory: vk::PhysicalDeviceMemoryProperties,
    /// `eye · DEPTH + frame % DEPTH`.
    slots: Vec<BindingType>,
}

/// What cannot go on without a result: the runtime dies like any other whose Vulkan calls fail.
fn must<T>(what: &str, result: ash::prelude::VkResult<T>) -> T {
    result.unwrap_or_else(|error| {
        eprintln!("headset runtime: {what}: {error}");
        process::abort()
    })
}

impl Copier {
    /// Uses the device and queue of a submitted image.
    pub fn new(entry: &ash::Entry, data: &sys::VRVulkanTextureData_t) -> Self {
        let instance = vk::Instance::from_raw(data.m_pInstance as u64);
        // SAFETY: Submit's contract: these are the program's living instance and devices.
        let (device, memory) = unsafe {
            let instance = ash::Instance::load(entry.static_fn(), instance);
            let device = ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(data.m_pDevice as u64));
            let physical = vk::PhysicalDevice::from_raw(data.m_pPhysicalDevice as u64);
            (device, instance.get_physical_device_memory_properties(physical))
        };
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(data.m_nQueueFamilyIndex)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device lives until Cleanup, where all of this is destroyed first.
        let pool = must("a command pool", unsafe { device.create_command_pool(&pool_info, None) });
        let count = (KINDS.len() as u64 * DEPTH) as u32;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(count);
        // SAFETY: as above.
        let all = must("command buffers", unsafe { device.allocate_command_buffers(&info) });
        let slot = |commands| BindingType {
            commands,
            // SAFETY: as above.
            fence: must("a fence", unsafe { device.create_fence(&vk::FenceCreateInfo::default(), None) }),
            buffer: vk::Buffer::null(),
            memory: vk::DeviceMemory::null(),
            bytes: 0,
            under_way: None,
        };
        let slots = all.into_iter().map(slot).collect();
        Self { queue: vk::Queue::from_raw(data.m_pQueue as u64), device, pool, memory, slots }
    }

    /// Whether an image comes from the same device and queue.
    pub fn is_on(&self, data: &sys::VRVulkanTextureData_t) -> bool {
        self.device.handle().as_raw() == data.m_pDevice as u64 && self.queue.as_raw() == data.m_pQueue as u64
    }

    /// Starts a copy on the program's queue, which is ours for the length of Submit.
    pub fn copy(&mut self, eye: usize, copy: Copy) {
        let n = eye * DEPTH as usize + (copy.frame % DEPTH) as usize;
        self.finish(n);
        let extent = copy.part.extent;
        self.make_room(n, u64::from(extent.width) * u64::from(extent.height) * 4);
        let slot = &mut self.slots[n];
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_offset(vk::Offset3D { x: copy.part.offset.x, y: copy.part.offset.y, z: 0 })
            .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 });
        let to_host = vk::BufferMemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .buffer(slot.buffer)
            .size(vk::WHOLE_SIZE);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let commands = [slot.commands];
        let submit = vk::SubmitInfo::default().command_buffers(&commands);
        // SAFETY: the slot's last copy has finished; the image is the program's and in the layout that Submit asks for;
        // no other thread uses the queue during Submit.
        unsafe {
            must("recording", self.device.begin_command_buffer(slot.commands, &begin));
            let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
            self.device.cmd_copy_image_to_buffer(slot.commands, copy.image, layout, slot.buffer, &[region]);
            let (from, to) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
            let none = vk::DependencyFlags::empty();
            self.device.cmd_pipeline_barrier(slot.commands, from, to, none, &[], &[to_host], &[]);
            must("recording", self.device.end_command_buffer(slot.commands));
            must("the queue", self.device.queue_submit(self.queue, &[submit], slot.fence));
        }
        slot.under_way = Some(copy);
    }

    /// Asks for a buffer of no bytes, which no driver minds.
    pub fn misbehave(&self) {
        let info = vk::BufferCreateInfo::default().size(0).usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: the device lives; drivers make such a buffer or refuse.
        if let Ok(buffer) = unsafe { self.device.create_buffer(&info, None) } {
            // SAFETY: nothing has used it.
            unsafe { self.device.destroy_buffer(buffer, None) };
        }
    }

    /// Finishes the copies of frames before `frame`.
    pub fn collect(&mut self, frame: u64) {
        for n in 0..self.slots.len() {
            if self.slots[n].under_way.as_ref().is_some_and(|copy| copy.frame < frame) {
                self.finish(n);
            }
        }
    }

    /// Waits for a slot's copy and writes its picture.
    fn finish(&mut self, n: usize) {
        let Some(copy) = self.slots[n].under_way.take() else { return };
        let slot = &self.slots[n];
        // SAFETY: the fence was given to the queue with this copy.
        unsafe {
            let waited = self.device.wait_for_fences(&[slot.fence], true, PATIENCE_NS);
            if waited == Err(vk::Result::ERROR_DEVICE_LOST) {
                // The program's device, and the copy with it.
                return;
            }
            must("waiting for a copy", waited);
            must("a fence", self.device.reset_fences(&[slot.fence]));
        }
        let Some(file) = &copy.file else { return };
        let extent = copy.part.extent;
        let length = (extent.width * extent.height * 4) as usize;
        let flags = vk::MemoryMapFlags::empty();
        // SAFETY: the memory is host-visible, coherent, at least this long, and no longer written.
        let bytes = unsafe {
            let at = must("memory", self.device.map_memory(slot.memory, 0, vk::WHOLE_SIZE, flags)).cast::<u8>();
            let bytes = std::slice::from_raw_parts(at, length).to_vec();
            self.device.unmap_memory(slot.memory);
            bytes
        };
        write_png(file, &copy, &bytes);
    }

    /// Gives a slot at least so many bytes.
    fn make_room(&mut self, n: usize, bytes: u64) {
        if self.slots[n].bytes >= bytes {
            return;
        }
        self.free_memory(n);
        let info = vk::BufferCreateInfo::default().size(bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // SAFETY: the device lives; the slot is idle.
        unsafe {
            let buffer = must("a buffer", self.device.create_buffer(&info, None));
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let fits = |(i, kind): &(u32, &vk::MemoryType)| {
                needs.memory_type_bits & (1 << i) != 0 && kind.property_flags.contains(wanted)
            };
            let kind = (0..).zip(self.memory.memory_types_as_slice()).find(fits).map(|(i, _)| i);
            let kind = must("memory that the host sees", kind.ok_or(vk::Result::ERROR_OUT_OF_HOST_MEMORY));
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            let memory = must("memory", self.device.allocate_memory(&info, None));
            must("memory", self.device.bind_buffer_memory(buffer, memory, 0));
            let slot = &mut self.slots[n];
            (slot.buffer, slot.memory, slot.bytes) = (buffer, memory, bytes);
        }
    }

    fn free_memory(&mut self, n: usize) {
        let slot = &mut self.slots[n];
        // SAFETY: the slot is idle; null handles are ignored.
        unsafe {
            self.device.destroy_buffer(slot.buffer, None);
            self.device.free_memory(slot.memory, None);
        }
        (slot.buffer, slot.memory, slot.bytes) = (vk::Buffer::null(), vk::DeviceMemory::null(), 0);
    }

    /// Waits for the program's device, as runtimes do at the end, and frees all.
    pub fn close(mut self) {
        // SAFETY: VR_Shutdown's contract: the device still lives.
        match unsafe { self.device.device_wait_idle() } {
            // A program may leave a headset because its GPU is lost.
            Err(vk::Result::ERROR_DEVICE_LOST) => {}
            waited => must("waiting for the device", waited),
        }
        for n in 0..self.slots.len() {
            self.finish(n);
            self.free_memory(n);
            // SAFETY: the device is idle.
            unsafe { self.device.destroy_fence(self.slots[n].fence, None) };
        }
        // SAFETY: as above; its command buffers go with it.
        unsafe { self.device.destroy_command_pool(self.pool, None) };
    }
}

/// Writes RGB; the values are display values already.
fn write_png(file: &Path, copy: &Copy, bytes: &[u8]) {
    if let Err(error) = picture(copy, bytes).save(file) {
        eprintln!("headset runtime: {}: {error}", file.display());
    }
}

fn picture(copy: &Copy, bytes: &[u8]) -> image::RgbImage {
    let is_bgra = matches!(copy.format, vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB);
    let [width, height] = [copy.part.extent.width, copy.part.extent.height];
    image::RgbImage::from_fn(width, height, |x, y| {
        let row = if copy.is_flipped { height - 1 - y } else { y };
        let at = ((row * width + x) * 4) as usize;
        let [a, g, b] = [bytes[at], bytes[at + 1], bytes[at + 2]];
        image::Rgb(if is_bgra { [b, g, a] } else { [a, g, b] })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_upright_and_red_is_red() {
        let bytes = [1, 2, 3, 255, 4, 5, 6, 255];
        let rows = |format, is_flipped| {
            let extent = vk::Extent2D { width: 1, height: 2 };
            let part = vk::Rect2D { offset: vk::Offset2D::default(), extent };
            let copy = Copy { image: vk::Image::null(), format, part, is_flipped, frame: 1, file: None };
            let made = picture(&copy, &bytes);
            [made.get_pixel(0, 0).0, made.get_pixel(0, 1).0]
        };
        assert_eq!(rows(vk::Format::R8G8B8A8_SRGB, false), [[1, 2, 3], [4, 5, 6]]);
        assert_eq!(rows(vk::Format::R8G8B8A8_SRGB, true), [[4, 5, 6], [1, 2, 3]]);
        assert_eq!(rows(vk::Format::B8G8R8A8_UNORM, false), [[3, 2, 1], [6, 5, 4]]);
    }
}
