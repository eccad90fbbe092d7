//! The device: one GPU, its queue, its memory, its clock, and the objects waiting to be destroyed.

use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char};
use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk::Handle as _;
use ash::{ext, khr, vk};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use raw_window_handle::{DisplayHandle, WindowHandle};

use super::choice::{self, Goal, GpuInfo, Surface};
use super::instance::{Instance, Messages, drop_repeated, listed, names, split};
use crate::{Error, Result};

/// What to open.
#[derive(Clone, Copy, Default)]
pub struct GpuOptions<'a> {
    /// Part of the GPU's name, any case; the best one if `None`.
    pub name: Option<&'a str>,
    /// Core and synchronization validation.
    pub validate: bool,
    /// The display to present to, if any.
    pub display: Option<DisplayHandle<'a>>,
    /// The window on it that a GPU of our own choice must be able to present to.
    pub window: Option<WindowHandle<'a>>,
}

/// One opened GPU. Every buffer, image and pipeline keeps it alive; when the last goes, the device is destroyed.
pub struct Gpu {
    pub(super) device: ash::Device,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) family: u32,
    pub(super) max_anisotropy: Option<f32>,
    options: choice::Options,
    pub(super) limits: vk::PhysicalDeviceLimits,
    /// Signalled with the number of each finished submission.
    pub(super) timeline: vk::Semaphore,
    pub(super) queue: Mutex<Queue>,
    debug: Option<ext::debug_utils::Device>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    deferred: Mutex<VecDeque<(u64, Deferred)>>,
    info: GpuInfo,
    /// What a headset's runtime asked for in vain.
    missing: Vec<CString>,
    // Last: the instance goes after the device.
    pub(super) instance: Arc<Instance>,
}

/// Vulkan's own handles, for a headset's runtime.
#[derive(Clone, Copy, Debug)]
pub struct Handles {
    pub instance: u64,
    pub physical: u64,
    pub device: u64,
    pub queue: u64,
    /// The queue's family.
    pub family: u32,
}

/// The only queue, and how many submissions it has had.
pub(super) struct Queue {
    pub(super) raw: vk::Queue,
    pub(super) submitted: u64,
}

/// A Vulkan object whose owner is gone but that the GPU may still use.
pub(super) enum Deferred {
    Buffer(vk::Buffer, Allocation),
    Image(vk::Image, Vec<vk::ImageView>, Allocation),
    Sampler(vk::Sampler),
    DescriptorSetLayout(vk::DescriptorSetLayout),
    DescriptorPool(vk::DescriptorPool),
    Pipeline(vk::Pipeline, vk::PipelineLayout),
    CommandPool(vk::CommandPool, vk::QueryPool),
}

impl Gpu {
    /// Opens a GPU.
    ///
    /// # Errors
    /// No Vulkan, no fit GPU, an unknown `name`, or a driver that fails.
    pub fn open(options: GpuOptions<'_>) -> Result<Arc<Self>> {
        let display = options.display.map(|display| display.as_raw());
        let instance = Arc::new(Instance::new(options.validate, display, &[])?);
        let window = options.display.zip(options.window);
        let surface = window.map(|(display, window)| Surface::new(&instance, display, window)).transpose()?;
        let to_window = surface.as_ref().map_or_else(|| goal(options), Goal::Window);
        // If none presents to the window, the swapchain says so, and there may be another way to show things.
        let chosen = choice::choose(&instance, options.name, to_window)
            .or_else(|_| choice::choose(&instance, options.name, goal(options)))?;
        drop(surface);
        Self::on(instance, chosen, options.display.is_some(), &[])
    }

    /// Opens the GPU that a headset hangs on, `physical` as its runtime names it, with the device extensions that this
    /// asks for, as far as they are there; where it names none (0) or one that nobody knows, the one that `open` would
    /// take. `instance` was made for `options.display`.
    ///
    /// # Errors
    /// A GPU that will not do, or a driver that fails.
    pub fn open_for_headset(
        options: GpuOptions<'_>,
        instance: &Arc<Instance>,
        physical: u64,
        asked: impl FnOnce(u64) -> Result<Vec<CString>>,
    ) -> Result<Arc<Self>> {
        let present = options.display.is_some();
        let named = match physical {
            0 => None,
            named => choice::named_by_runtime(instance, named, goal(options))?,
        };
        let chosen = named.map_or_else(|| choice::choose(instance, options.name, goal(options)), Ok)?;
        let asked = asked(chosen.physical.as_raw())?;
        Self::on(Arc::clone(instance), chosen, present, &asked)
    }

    fn on(instance: Arc<Instance>, chosen: choice::Candidate, present: bool, asked: &[CString]) -> Result<Arc<Self>> {
        // SAFETY: the physical device comes from this instance; the call only reads.
        let there = unsafe { instance.raw.enumerate_device_extension_properties(chosen.physical) }.unwrap_or_default();
        let (have, missing) = split(asked, &names(&there));
        if !missing.is_empty() {
            // Runtimes list more than they use: what old drivers had, debug markers. Their first Submit tells.
            let name = &chosen.info.name;
            tracing::warn!("the headset's runtime asks for {}, which {name} lacks: going on without", listed(&missing));
        }
        let device = make_device(&instance, &chosen, present, &have)?;
        // SAFETY: the family and its queue 0 were asked for in `make_device`.
        let queue = unsafe { device.get_device_queue(chosen.family, 0) };
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive and has the timelineSemaphore feature.
        let timeline = unsafe { device.create_semaphore(&info, None) }.map_err(Error::vulkan("making a semaphore"))?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: device.clone(),
            physical_device: chosen.physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        })
        .map_err(|e| Error::GpuMemory { what: "the allocator".into(), problem: e.to_string() })?;
        let debug = instance.has_debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let gpu = Self {
            debug,
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            physical: chosen.physical,
            family: chosen.family,
            options: chosen.options,
            max_anisotropy: chosen.options.anisotropy.then_some(chosen.properties.limits.max_sampler_anisotropy),
            limits: chosen.properties.limits,
            timeline,
            queue: Mutex::new(Queue { raw: queue, submitted: 0 }),
            deferred: Mutex::default(),
            info: chosen.info,
            missing,
            device,
            instance,
        };
        gpu.name(timeline, "timeline");
        Ok(Arc::new(gpu))
    }

    /// The GPU as `doctor` would list it.
    pub fn info(&self) -> &GpuInfo {
        &self.info
    }

    /// What the validation layer has said; keeps what is said while the device is destroyed, too.
    pub fn messages(&self) -> Arc<Messages> {
        Arc::clone(self.instance.messages())
    }

    /// Device extensions that a headset's runtime asked for and the driver lacks, in one line; `None` if it lacks none.
    pub fn missing_extensions(&self) -> Option<String> {
        (!self.missing.is_empty()).then(|| listed(&self.missing))
    }

    /// The widest 2D image the GPU takes, in texels.
    pub fn max_image_size(&self) -> u32 {
        self.limits.max_image_dimension2_d
    }

    /// Calls something that uses the queue itself: a headset's runtime.
    pub fn with_queue_locked<R>(&self, call: impl FnOnce() -> R) -> R {
        let _queue = self.queue();
        call()
    }

    /// What a headset's runtime must know to read our images.
    pub fn handles(&self) -> Handles {
        Handles {
            instance: self.instance.handle(),
            physical: self.physical.as_raw(),
            device: self.device.handle().as_raw(),
            queue: self.queue().raw.as_raw(),
            family: self.family,
        }
    }

    /// Whether images may be of block-compressed formats.
    pub fn compresses_textures(&self) -> bool {
        self.options.compressed_textures
    }

    /// Bytes of its own memory that this process may still take; all of it, less an eighth, where the driver does not
    /// tell what others have taken.
    pub fn free_memory(&self) -> u64 {
        if !self.options.memory_budget {
            return self.info.memory - self.info.memory / 8;
        }
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut memory = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: the extension is enabled; the call only writes into the structures.
        unsafe { self.instance.raw.get_physical_device_memory_properties2(self.physical, &mut memory) };
        let heaps = memory.memory_properties;
        let own = |i: &usize| heaps.memory_heaps[*i].flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
        let free = |i: usize| budget.heap_budget[i].saturating_sub(budget.heap_usage[i]);
        (0..heaps.memory_heap_count as usize).filter(own).map(free).sum()
    }

    /// Bytes that this process's buffers and images take, wherever they are.
    pub fn taken_memory(&self) -> u64 {
        self.allocator().generate_report().total_allocated_bytes
    }

    /// Waits until the GPU has nothing left to do.
    pub fn wait_idle(&self) -> Result<()> {
        let submitted = self.queue().submitted;
        self.wait_for(submitted)
    }

    /// Waits for one submission, by its number.
    pub fn wait_for(&self, submission: u64) -> Result<()> {
        let (semaphores, values) = ([self.timeline], [submission]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is this device's and alive.
        unsafe { self.device.wait_semaphores(&info, u64::MAX) }.map_err(Error::vulkan("waiting for the GPU"))?;
        self.destroy_finished(submission);
        Ok(())
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a Vulkan object its debug name.
    pub(super) fn name<T: vk::Handle>(&self, object: T, name: &str) {
        let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object is this device's and alive. A name that cannot be set harms nothing.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Begins a named part of a recording, without allocating; names longer than 63 bytes lose their ends.
    pub(super) fn begin_label(&self, commands: vk::CommandBuffer, name: &str) {
        let mut text = [0; 64];
        text.iter_mut().zip(name.bytes().take(63)).for_each(|(to, from)| *to = from);
        if let (Some(debug), Ok(name)) = (&self.debug, CStr::from_bytes_until_nul(&text)) {
            let label = vk::DebugUtilsLabelEXT::default().label_name(name);
            // SAFETY: the command buffer is being recorded by the caller.
            unsafe { debug.cmd_begin_debug_utils_label(commands, &label) };
        }
    }

    pub(super) fn end_label(&self, commands: vk::CommandBuffer) {
        if let Some(debug) = &self.debug {
            // SAFETY: the command buffer is being recorded by the caller, who has begun a label.
            unsafe { debug.cmd_end_debug_utils_label(commands) };
        }
    }

    /// Takes GPU memory for a new object.
    pub(super) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let scheme = AllocationScheme::GpuAllocatorManaged;
        self.allocator()
            .allocate(&AllocationCreateDesc { name, requirements, location, linear, allocation_scheme: scheme })
            .map_err(|e| Error::GpuMemory {
                what: format!("{name} ({:.1} MiB)", requirements.size as f64 / f64::from(1 << 20)),
                problem: e.to_string(),
            })
    }

    /// Gives memory back at once: only for an object the GPU has never seen.
    pub(super) fn free(&self, allocation: Allocation) {
        // Freeing fails only for an allocation of another allocator, and there is one.
        let _ = self.allocator().free(allocation);
    }

    /// Takes over an object; it is destroyed once everything submitted up to the next submission has finished. A recording
    /// that uses it must have been submitted by now: the next submission may be another thread's.
    pub(super) fn defer_destruction(&self, object: Deferred) {
        let after = self.queue().submitted + 1;
        self.deferred.lock().unwrap_or_else(PoisonError::into_inner).push_back((after, object));
    }

    /// Destroys what was retired for submissions up to `finished`.
    pub(super) fn destroy_finished(&self, finished: u64) {
        loop {
            let mut deferred = self.deferred.lock().unwrap_or_else(PoisonError::into_inner);
            let due = deferred.front().is_some_and(|(after, _)| *after <= finished);
            let Some((_, object)) = due.then(|| deferred.pop_front()).flatten() else { return };
            drop(deferred);
            self.destroy(object);
        }
    }

    fn destroy(&self, object: Deferred) {
        // SAFETY: the owner is gone and every submission that could use the object has finished.
        unsafe {
            match object {
                Deferred::Buffer(buffer, allocation) => {
                    self.device.destroy_buffer(buffer, None);
                    self.free(allocation);
                }
                Deferred::Image(image, views, allocation) => {
                    views.into_iter().for_each(|view| self.device.destroy_image_view(view, None));
                    self.device.destroy_image(image, None);
                    self.free(allocation);
                }
                Deferred::Sampler(sampler) => self.device.destroy_sampler(sampler, None),
                Deferred::DescriptorSetLayout(layout) => self.device.destroy_descriptor_set_layout(layout, None),
                Deferred::DescriptorPool(pool) => self.device.destroy_descriptor_pool(pool, None),
                Deferred::Pipeline(pipeline, layout) => {
                    self.device.destroy_pipeline(pipeline, None);
                    self.device.destroy_pipeline_layout(layout, None);
                }
                Deferred::CommandPool(pool, queries) => {
                    self.device.destroy_command_pool(pool, None);
                    self.device.destroy_query_pool(queries, None);
                }
            }
        }
    }

    fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: nothing else refers to the device: every object holds an Arc of it. A lost device still waits.
        unsafe {
            let _ = self.device.device_wait_idle();
            self.destroy_finished(u64::MAX);
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_device(None);
        }
    }
}

/// What any GPU must do.
fn goal(options: GpuOptions<'_>) -> Goal<'static> {
    if options.display.is_some() { Goal::Windows } else { Goal::Pictures }
}

fn make_device(
    instance: &Instance,
    chosen: &choice::Candidate,
    present: bool,
    asked: &[CString],
) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(chosen.family).queue_priorities(&priorities)];
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(true)
        .host_query_reset(true)
        .scalar_block_layout(true)
        .shader_output_layer(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
        .maintenance4(true)
        .dynamic_rendering(true)
        .synchronization2(true)
        .shader_demote_to_helper_invocation(true);
    let core = vk::PhysicalDeviceFeatures::default()
        .sampler_anisotropy(chosen.options.anisotropy)
        .texture_compression_bc(chosen.options.compressed_textures);
    let mut extensions: Vec<*const c_char> = asked.iter().map(|name| name.as_ptr()).collect();
    if chosen.options.memory_budget {
        extensions.push(ext::memory_budget::NAME.as_ptr());
    }
    if present {
        extensions.push(khr::swapchain::NAME.as_ptr());
    }
    drop_repeated(&mut extensions);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&core)
        .enabled_extension_names(&extensions)
        .push_next(&mut v12)
        .push_next(&mut v13);
    // SAFETY: all that `info` points to lives until the call returns; features and extensions were found in `choice`.
    unsafe { instance.raw.create_device(chosen.physical, &info, None) }.map_err(Error::vulkan("opening the device"))
}
