//! An opened GPU: its queue, memory, timeline and pipeline cache, shared by all its objects.

use std::ffi::{CStr, CString};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ash::vk::Handle as _;
use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, MemoryLocation};
use raw_window_handle::{DisplayHandle, WindowHandle};

use super::choice::{self, Goal, GpuInfo, Surface};
use super::deferred::{Deferred, DeferredQueue};
use super::instance::{Instance, Messages, listed, names, split};
use super::limits::Limits;
use super::logical_device::LogicalDevice;
use super::pipeline_cache::PipelineCache;
use super::pipeline_store::PipelineStore;
use crate::{Error, Result};

/// How to open a GPU.
#[derive(Clone, Copy, Default)]
pub struct GpuOptions<'a> {
    /// Part of the GPU's name in any case; `None` for the best one.
    pub name: Option<&'a str>,
    /// Core and synchronization validation.
    pub validate: bool,
    /// The display to present to, if any.
    pub display: Option<DisplayHandle<'a>>,
    /// A window on that display; GPUs that can present to it are preferred.
    pub window: Option<WindowHandle<'a>>,
}

/// One opened GPU. Every buffer, image and pipeline keeps it alive; the device is destroyed after the last of them.
pub struct Gpu {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) family: u32,
    pub(super) max_anisotropy: Option<f32>,
    options: choice::Options,
    pub(super) limits: Limits,
    /// The only queue.
    queue: Mutex<vk::Queue>,
    /// Submissions so far; only the holder of the queue adds to it.
    pub(super) submitted: AtomicU64,
    debug: Option<ext::debug_utils::Device>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    deferred: DeferredQueue,
    pub(super) pipelines: PipelineStore,
    info: GpuInfo,
    /// Extensions that a headset's runtime requests and the driver lacks.
    missing: Vec<CString>,
    // Drop order: the cache before the device, the device before the instance.
    pub(super) pipeline_cache: PipelineCache,
    pub(super) device: LogicalDevice,
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

/// How full a heap is, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    pub size: u64,
    /// What other programs leave of it to this process.
    pub budget: u64,
    /// What this process has.
    pub used: u64,
}

/// Time that one wait for the GPU may spend on destroying objects: a replaced scene is destroyed over several frames.
const DESTRUCTION_BUDGET: Duration = Duration::from_micros(250);

impl Gpu {
    /// Opens a GPU.
    ///
    /// # Errors
    /// No Vulkan, no GPU that meets the requirements, an unknown `name`, or a driver that fails.
    pub fn open(options: GpuOptions<'_>) -> Result<Arc<Self>> {
        let display = options.display.map(|display| display.as_raw());
        let instance = Arc::new(Instance::new(options.validate, display, &[])?);
        let window = options.display.zip(options.window);
        let surface = window.map(|(display, window)| Surface::new(&instance, display, window)).transpose()?;
        let to_window = surface.as_ref().map_or_else(|| goal(options), Goal::Window);
        // If no GPU can present to the window, creating the swapchain reports it, and the caller may show things elsewhere.
        let chosen = choice::choose(&instance, options.name, to_window)
            .or_else(|_| choice::choose(&instance, options.name, goal(options)))?;
        drop(surface);
        Self::on(instance, chosen, options.display.is_some(), &[])
    }

    /// Opens the GPU that a headset is connected to: `physical` is the VkPhysicalDevice that its runtime names. With 0 or
    /// a handle that Vulkan does not list, opens the same GPU as `open`. `requested` returns the device extensions that
    /// the runtime requests for a VkPhysicalDevice; those that the driver lacks are left out with a warning. `instance`
    /// was created for `options.display`.
    ///
    /// # Errors
    /// A GPU that does not meet the requirements, or a driver that fails.
    pub fn open_for_headset(
        options: GpuOptions<'_>,
        instance: &Arc<Instance>,
        physical: u64,
        requested: impl FnOnce(u64) -> Result<Vec<CString>>,
    ) -> Result<Arc<Self>> {
        let present = options.display.is_some();
        let named = match physical {
            0 => None,
            named => choice::named_by_runtime(instance, named, goal(options))?,
        };
        let chosen = named.map_or_else(|| choice::choose(instance, options.name, goal(options)), Ok)?;
        let requested = requested(chosen.physical.as_raw())?;
        Self::on(Arc::clone(instance), chosen, present, &requested)
    }

    fn on(
        instance: Arc<Instance>,
        chosen: choice::Candidate,
        present: bool,
        requested: &[CString],
    ) -> Result<Arc<Self>> {
        // SAFETY: the physical device comes from this instance; the call only reads.
        let supported =
            unsafe { instance.raw.enumerate_device_extension_properties(chosen.physical) }.unwrap_or_default();
        let (have, missing) = split(requested, &names(&supported));
        if !missing.is_empty() {
            // Runtimes request more than they use, such as debug markers and extensions of old drivers.
            let name = &chosen.info.name;
            tracing::warn!(
                "the headset's runtime requests {}, which {name} lacks: continuing without",
                listed(&missing)
            );
        }
        let device = LogicalDevice::new(&instance, &chosen, present, &have)?;
        // SAFETY: the family and its queue 0 were requested when the device was created.
        let queue = unsafe { device.get_device_queue(chosen.family, 0) };
        let pipeline_cache = PipelineCache::new(&device, &chosen.properties)?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: ash::Device::clone(&device),
            physical_device: chosen.physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: block_sizes(chosen.info.memory),
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
            limits: Limits {
                vulkan: chosen.properties.limits,
                max_buffer_bytes: chosen.max_buffer_bytes,
                gpu: chosen.info.name.clone(),
            },
            queue: Mutex::new(queue),
            submitted: AtomicU64::new(0),
            deferred: DeferredQueue::default(),
            pipelines: PipelineStore::default(),
            info: chosen.info,
            missing,
            pipeline_cache,
            device,
            instance,
        };
        gpu.name(gpu.device.timeline, "timeline");
        Ok(Arc::new(gpu))
    }

    /// Name, driver and features of the GPU.
    pub fn info(&self) -> &GpuInfo {
        &self.info
    }

    /// Messages of the validation layer, also those that come while the device is destroyed.
    pub fn messages(&self) -> Arc<Messages> {
        Arc::clone(self.instance.messages())
    }

    /// Device extensions that a headset's runtime requests and the driver lacks, in one line; `None` if it lacks none.
    pub fn missing_extensions(&self) -> Option<String> {
        (!self.missing.is_empty()).then(|| listed(&self.missing))
    }

    /// The greatest width and height of 2D images, in texels.
    pub fn max_image_size(&self) -> u32 {
        self.limits.vulkan.max_image_dimension2_d
    }

    /// Calls a function that uses the queue itself, such as one of a headset's runtime.
    pub fn with_queue_locked<R>(&self, call: impl FnOnce() -> R) -> R {
        let _queue = self.queue();
        call()
    }

    /// The handles with which a headset's runtime reads images.
    pub fn handles(&self) -> Handles {
        Handles {
            instance: self.instance.handle(),
            physical: self.physical.as_raw(),
            device: self.device.handle().as_raw(),
            queue: self.queue().as_raw(),
            family: self.family,
        }
    }

    /// Whether images may be of block-compressed formats.
    pub fn compresses_textures(&self) -> bool {
        self.options.compressed_textures
    }

    /// Whether images may be arrays of cubes.
    pub fn has_cube_arrays(&self) -> bool {
        self.options.cube_arrays
    }

    /// Whether pipelines may have [`super::Blend::TwoSources`].
    pub fn blends_two_sources(&self) -> bool {
        self.options.two_sources
    }

    /// Whether several samples a pixel are drawn sooner where depth is tested after shading, by shaders that write a stencil
    /// reference, used or not (`VK_EXT_shader_stencil_export`).
    ///
    /// llvmpipe shades blocks of eight pixels. With one sample it leaves out those that are hidden; with more it leaves out
    /// none, not even those without a covered sample, unless depth comes last (Mesa 22.3 to 24.3, `generate_fs_loop` in
    /// `lp_state_fs.c`).
    pub fn wants_late_depth(&self) -> bool {
        self.options.late_depth
    }

    /// The content of the pipeline cache, for [`Gpu::merge_pipeline_cache`] in another run.
    pub fn pipeline_cache_bytes(&self) -> Result<Vec<u8>> {
        self.pipeline_cache.bytes()
    }

    /// Adds another run's pipelines, so that they need not be compiled again. Returns whether the bytes are of this GPU
    /// and driver; others are ignored. Only their header can be checked here: a file of them needs a checksum.
    pub fn merge_pipeline_cache(&self, bytes: &[u8]) -> bool {
        self.pipeline_cache.merge(bytes)
    }

    /// A file name for the pipeline cache, another one for each GPU.
    pub fn pipeline_cache_name(&self) -> String {
        self.pipeline_cache.name()
    }

    /// Bytes of device-local memory that this process may still allocate. Where the driver does not report it: 7/8 of
    /// all, less what this process has.
    pub fn free_memory(&self) -> u64 {
        let all = (self.info.memory - self.info.memory / 8).saturating_sub(self.taken_memory());
        self.own_heaps().map_or(all, |heaps| heaps.iter().map(|heap| heap.budget.saturating_sub(heap.used)).sum())
    }

    /// How full the largest device-local heap is. `None` where the driver does not report it. Takes as long as the driver, so that no
    /// frame should wait for it.
    pub fn memory_use(&self) -> Option<MemoryUse> {
        let heaps = self.own_heaps()?;
        heaps.into_iter().max_by_key(|heap| heap.size)
    }

    /// The device-local heaps, if the driver reports how full they are.
    fn own_heaps(&self) -> Option<Vec<MemoryUse>> {
        if !self.options.memory_budget {
            return None;
        }
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut memory = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: the extension is enabled; the call only writes into the structures.
        unsafe { self.instance.raw.get_physical_device_memory_properties2(self.physical, &mut memory) };
        let heaps = memory.memory_properties;
        let own = |i: &usize| heaps.memory_heaps[*i].flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
        let heap = |i: usize| MemoryUse {
            size: heaps.memory_heaps[i].size,
            budget: budget.heap_budget[i],
            used: budget.heap_usage[i],
        };
        Some((0..heaps.memory_heap_count as usize).filter(own).map(heap).collect())
    }

    /// How many pipelines are kept of those that nothing uses: more for a process that draws many scenes in turn.
    pub fn keep_unused_pipelines(&self, most: usize) {
        self.pipelines.keep_unused(most);
    }

    /// Bytes allocated for buffers and images, in any memory.
    pub fn taken_memory(&self) -> u64 {
        self.allocator().generate_report().total_allocated_bytes
    }

    /// Waits until the GPU is idle, and destroys all objects that waited for it.
    pub fn wait_idle(&self) -> Result<()> {
        let submitted = self.submitted.load(Ordering::Acquire);
        self.wait(submitted)?;
        self.destroy_finished(submitted, Duration::MAX);
        Ok(())
    }

    /// Waits for one submission, by its number, and destroys some of the objects that waited for it.
    pub(super) fn wait_for(&self, submission: u64) -> Result<()> {
        self.wait(submission)?;
        self.destroy_finished(submission, DESTRUCTION_BUDGET);
        Ok(())
    }

    fn wait(&self, submission: u64) -> Result<()> {
        let (semaphores, values) = ([self.device.timeline], [submission]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is this device's and alive.
        unsafe { self.device.wait_semaphores(&info, u64::MAX) }.map_err(Error::vulkan("waiting for the GPU"))
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the debug name of a Vulkan object.
    pub(super) fn name<T: vk::Handle>(&self, object: T, name: &str) {
        let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object is this device's and alive. A name that cannot be set harms nothing.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Begins a labelled section of a recording, without allocating; names are cut after 63 bytes.
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

    /// Allocates memory for a new object.
    pub(super) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let allocation_scheme = AllocationScheme::GpuAllocatorManaged;
        let desc = AllocationCreateDesc { name, requirements, location, linear, allocation_scheme };
        let first = self.allocator().allocate(&desc);
        let allocation = first.or_else(|_| {
            // There may be room after objects that were dropped but not destroyed yet. A failing wait leaves things as
            // they are.
            let _ = self.wait_idle();
            self.allocator().allocate(&desc)
        });
        allocation.map_err(|e| Error::GpuMemory {
            what: format!("{name} ({:.1} MiB)", requirements.size as f64 / f64::from(1 << 20)),
            problem: e.to_string(),
        })
    }

    /// Whether the GPU has not finished everything that was submitted.
    pub fn is_busy(&self) -> bool {
        // SAFETY: the device and its timeline are alive.
        let finished = unsafe { self.device.get_semaphore_counter_value(self.device.timeline) };
        finished.is_ok_and(|finished| finished < self.submitted.load(Ordering::Acquire))
    }

    /// Takes over an object; it is destroyed once everything submitted up to the next submission has finished. A recording
    /// that uses it must have been submitted by now: the next submission may be another thread's.
    pub(super) fn defer_destruction(&self, object: Deferred) {
        self.deferred.push(self.submitted.load(Ordering::Acquire) + 1, object);
    }

    /// Destroys deferred objects of submissions up to `finished`; stops early when `budget` is spent.
    fn destroy_finished(&self, finished: u64, budget: Duration) {
        let start = Instant::now();
        loop {
            let batch = self.deferred.take(finished);
            if batch[0].is_none() {
                return;
            }
            // SAFETY: their owners are gone, and every submission that could use them has finished.
            let memory = batch.map(|object| object.and_then(|object| unsafe { object.destroy(&self.device) }));
            let mut allocator = self.allocator();
            // Freeing fails only for an allocation of another allocator, and there is one.
            memory.into_iter().flatten().for_each(|memory| drop(allocator.free(memory)));
            drop(allocator);
            if start.elapsed() >= budget {
                return;
            }
        }
    }

    /// Objects that wait to be destroyed.
    #[cfg(test)]
    pub(super) fn deferred_objects(&self) -> usize {
        self.deferred.len()
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
            self.destroy_finished(u64::MAX, Duration::MAX);
            for raw in self.pipelines.drain() {
                Deferred::Pipeline(raw).destroy(&self.device);
            }
            ManuallyDrop::drop(&mut self.allocator);
        }
    }
}

/// Sizes of the blocks that objects share, for so much device-local memory: an eighth of it, as in AMD's Vulkan Memory Allocator
/// (`VMA_SMALL_HEAP_MAX_SIZE`), where the usual ones would take it all.
fn block_sizes(memory: u64) -> AllocationSizes {
    const MIB: u64 = 1 << 20;
    AllocationSizes::new((memory / 8).min(256 * MIB), (memory / 8).min(64 * MIB))
}

/// The goal without a particular window.
fn goal(options: GpuOptions<'_>) -> Goal<'static> {
    if options.display.is_some() { Goal::Windows } else { Goal::Pictures }
}
