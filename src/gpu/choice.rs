//! Physical devices: listing them, checking what the program needs of them, choosing one.

use std::ffi::CStr;

use ash::vk::Handle as _;
use ash::{ext, khr, vk};
use raw_window_handle::{DisplayHandle, WindowHandle};

use super::instance::Instance;
use super::limits::too_low;
use crate::{Error, Result};

/// The requirement that most old GPUs do not meet, for messages.
const NEEDS: &str = "Vulkan 1.3 with layered output from the vertex shader";

/// The `kind` of software implementations.
const SOFTWARE: &str = "CPU";

/// One GPU as the system lists it.
#[derive(Clone, Debug)]
pub struct GpuInfo {
    pub name: String,
    pub kind: &'static str,
    /// Driver name and version as the driver writes them.
    pub driver: String,
    /// Vulkan version, major.minor.patch.
    pub vulkan: String,
    /// Device-local memory in bytes.
    pub memory: u64,
    /// Optional features by name, and whether they are supported.
    pub options: Vec<(&'static str, bool)>,
    /// Why it cannot be used; `None` if it can.
    pub unfit: Option<String>,
}

impl GpuInfo {
    /// Whether it is a software implementation on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == SOFTWARE
    }
}

/// Where a GPU's pictures go.
#[derive(Clone, Copy)]
pub(super) enum Goal<'a> {
    /// Read back to the CPU.
    Pictures,
    /// Also presented, to any window of the display.
    Windows,
    /// Also presented to this window.
    Window(&'a Surface<'a>),
}

/// A window's surface while GPUs are asked whether they can present to it; the swapchain creates its own.
pub(super) struct Surface<'a> {
    /// The instance outlives the surface.
    _instance: &'a Instance,
    api: khr::surface::Instance,
    raw: vk::SurfaceKHR,
}

impl<'a> Surface<'a> {
    pub(super) fn new(instance: &'a Instance, display: DisplayHandle<'a>, window: WindowHandle<'a>) -> Result<Self> {
        // SAFETY: both handles live as long as the surface; the instance was created for this display.
        let raw = unsafe {
            ash_window::create_surface(&instance.entry, &instance.raw, display.as_raw(), window.as_raw(), None)
        };
        let raw = raw.map_err(Error::vulkan("creating a window surface"))?;
        Ok(Self { _instance: instance, api: khr::surface::Instance::new(&instance.entry, &instance.raw), raw })
    }

    /// Whether a queue family of a GPU can present to it; a failing query counts as no.
    fn takes_from(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: the GPU has this family; all are of the same instance.
        unsafe { self.api.get_physical_device_surface_support(physical, family, self.raw) }.unwrap_or(false)
    }

    fn has_formats(&self, physical: vk::PhysicalDevice) -> bool {
        // SAFETY: both are of the same instance; the call only reads.
        let formats = unsafe { self.api.get_physical_device_surface_formats(physical, self.raw) };
        formats.is_ok_and(|formats| !formats.is_empty())
    }
}

impl Drop for Surface<'_> {
    fn drop(&mut self) {
        // SAFETY: the instance is alive; nothing else knows of the surface.
        unsafe { self.api.destroy_surface(self.raw, None) };
    }
}

pub(super) struct Candidate {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) info: GpuInfo,
    pub(super) family: u32,
    pub(super) properties: vk::PhysicalDeviceProperties,
    /// The largest buffer, and the largest piece of memory.
    pub(super) max_buffer_bytes: u64,
    pub(super) options: Options,
    rank: u32,
}

/// Optional features, used where they are supported.
#[derive(Clone, Copy, Default)]
pub(super) struct Options {
    pub(super) anisotropy: bool,
    /// BC1 to BC7.
    pub(super) compressed_textures: bool,
    /// Arrays of cubes.
    pub(super) cube_arrays: bool,
    /// Blending with two colours of a fragment.
    pub(super) two_sources: bool,
    /// VK_EXT_memory_budget.
    pub(super) memory_budget: bool,
    /// What is asked of [`super::Gpu::wants_late_depth`].
    pub(super) late_depth: bool,
}

/// All GPUs, the preferred one first, those that cannot be used last.
pub fn survey() -> Result<Vec<GpuInfo>> {
    let instance = Instance::new(false, None, &[])?;
    let mut all = candidates(&instance, Goal::Pictures)?;
    all.sort_by_key(|c| (c.info.unfit.is_some(), c.rank));
    Ok(all.into_iter().map(|c| c.info).collect())
}

/// Chooses the GPU whose name contains `name` (any case), or else the best: discrete, integrated, other, CPU.
pub(super) fn choose(instance: &Instance, name: Option<&str>, goal: Goal<'_>) -> Result<Candidate> {
    let all = candidates(instance, goal)?;
    let known: Vec<String> = all.iter().map(|c| c.info.name.clone()).collect();
    let unfit: Vec<String> =
        all.iter().filter_map(|c| Some(format!("{}: {}", c.info.name, c.info.unfit.as_ref()?))).collect();
    let wanted = |c: &Candidate| name.is_none_or(|n| c.info.name.to_lowercase().contains(&n.to_lowercase()));
    if let Some(name) = name
        && !all.iter().any(wanted)
    {
        return Err(Error::UnknownName { what: "GPU", name: name.into(), known });
    }
    all.into_iter().filter(|c| wanted(c) && c.info.unfit.is_none()).min_by_key(|c| c.rank).ok_or_else(|| {
        Error::NoVulkan {
            problem: if unfit.is_empty() { "no GPU or driver found".into() } else { unfit.join("; ") },
            remedy: "update the graphics driver, or install Mesa's software one (Debian: mesa-vulkan-drivers)",
        }
    })
}

/// The GPU that a headset's runtime names by its handle; `None` if Vulkan does not list it.
pub(super) fn named_by_runtime(instance: &Instance, handle: u64, goal: Goal<'_>) -> Result<Option<Candidate>> {
    let Some(named) = candidates(instance, goal)?.into_iter().find(|c| c.physical.as_raw() == handle) else {
        tracing::warn!("the headset's runtime names a GPU that Vulkan does not list: using the best one");
        return Ok(None);
    };
    match &named.info.unfit {
        None => Ok(Some(named)),
        Some(reason) => {
            Err(Error::Headset { problem: format!("it is connected to the GPU {}, which {reason}", named.info.name) })
        }
    }
}

fn candidates(instance: &Instance, goal: Goal<'_>) -> Result<Vec<Candidate>> {
    // SAFETY: the instance is alive; the call only reads.
    let all = unsafe { instance.raw.enumerate_physical_devices() }.map_err(Error::vulkan("listing GPUs"))?;
    Ok(all.into_iter().map(|physical| examine(instance, physical, goal)).collect())
}

fn examine(instance: &Instance, physical: vk::PhysicalDevice, goal: Goal<'_>) -> Candidate {
    // SAFETY: `physical` comes from this instance; the call only reads.
    let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
    let version = properties.api_version;
    let (rank, kind) = rank(properties.device_type);
    let mut info = GpuInfo {
        name: properties.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned(),
        kind,
        driver: String::new(),
        vulkan: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        memory: device_memory(instance, physical),
        options: Vec::new(),
        unfit: None,
    };
    if version < vk::API_VERSION_1_3 {
        info.unfit = Some(format!("has Vulkan {} only, {NEEDS} is needed", info.vulkan));
        let options = Options::default();
        return Candidate { physical, info, family: 0, properties, max_buffer_bytes: 0, options, rank };
    }
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let (mut v11, mut v13) = Default::default();
    let mut properties2: vk::PhysicalDeviceProperties2<'_> = Default::default();
    properties2 = properties2.push_next(&mut driver).push_next::<vk::PhysicalDeviceVulkan11Properties<'_>>(&mut v11);
    properties2 = properties2.push_next::<vk::PhysicalDeviceVulkan13Properties<'_>>(&mut v13);
    // SAFETY: a structure chain of Vulkan 1.3 on a 1.3 device; the call only writes into it.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties2) };
    let text = |s: std::result::Result<&CStr, _>| s.unwrap_or(c"?").to_string_lossy().into_owned();
    info.driver = format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str()));
    let features = Features::of(instance, physical, driver.driver_id);
    let has_swapchain = has_extension(instance, physical, khr::swapchain::NAME);
    info.options = vec![
        ("anisotropic filtering", features.options.anisotropy),
        ("block-compressed textures (BC5, BC7)", features.options.compressed_textures),
        ("arrays of cubes, for probes", features.options.cube_arrays),
        ("two-source blending, for coloured glass", features.options.two_sources),
        ("reporting free memory", features.options.memory_budget),
        ("presenting to windows", has_swapchain),
    ];
    let family = graphics_family(instance, physical, goal);
    let presents = matches!(goal, Goal::Pictures) || has_swapchain;
    let shows = |surface: &Surface<'_>| surface.has_formats(physical);
    info.unfit = features.missing(&properties.limits).or_else(|| {
        let sampled =
            properties.limits.framebuffer_color_sample_counts & properties.limits.framebuffer_depth_sample_counts;
        let problem = match () {
            () if !presents => "cannot present to a window",
            () if family.is_none() && matches!(goal, Goal::Window(_)) => {
                "has no queue for graphics, compute and timestamps that presents to this window"
            }
            () if family.is_none() => "has no queue for graphics, compute and timestamps",
            () if matches!(goal, Goal::Window(surface) if !shows(surface)) => "has no format for this window",
            () if !sampled.contains(vk::SampleCountFlags::TYPE_4) => "cannot do 4x MSAA",
            () if !filters_floats(instance, physical) => "cannot filter 32-bit float textures, which panoramas are",
            () => return None,
        };
        Some(problem.into())
    });
    let max_buffer_bytes = v13.max_buffer_size.min(v11.max_memory_allocation_size);
    let (family, options) = (family.unwrap_or(0), features.options);
    Candidate { physical, info, family, properties, max_buffer_bytes, options, rank }
}

struct Features {
    needed: [(&'static str, vk::Bool32); 9],
    options: Options,
}

impl Features {
    fn of(instance: &Instance, physical: vk::PhysicalDevice, driver: vk::DriverId) -> Self {
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12).push_next(&mut v13);
        // SAFETY: Vulkan 1.2/1.3 structures on a 1.3 device; the call only writes into them.
        unsafe { instance.raw.get_physical_device_features2(physical, &mut all) };
        let core = all.features;
        let options = Options {
            anisotropy: core.sampler_anisotropy == vk::TRUE,
            compressed_textures: core.texture_compression_bc == vk::TRUE,
            cube_arrays: core.image_cube_array == vk::TRUE,
            two_sources: core.dual_src_blend == vk::TRUE,
            memory_budget: has_extension(instance, physical, ext::memory_budget::NAME),
            late_depth: driver == vk::DriverId::MESA_LLVMPIPE
                && has_extension(instance, physical, ext::shader_stencil_export::NAME),
        };
        let needed = [
            ("dynamicRendering", v13.dynamic_rendering),
            ("synchronization2", v13.synchronization2),
            ("maintenance4", v13.maintenance4),
            ("shaderDemoteToHelperInvocation", v13.shader_demote_to_helper_invocation),
            ("timelineSemaphore", v12.timeline_semaphore),
            ("hostQueryReset", v12.host_query_reset),
            ("shaderOutputLayer", v12.shader_output_layer),
            ("scalarBlockLayout", v12.scalar_block_layout),
            ("fullDrawIndexUint32", core.full_draw_index_uint32),
        ];
        Self { needed, options }
    }

    /// The features and limits that are needed and missing, in one line.
    fn missing(&self, limits: &vk::PhysicalDeviceLimits) -> Option<String> {
        let missing = self.needed.iter().filter(|(_, there)| *there == vk::FALSE);
        let mut names: Vec<String> = missing.map(|(name, _)| (*name).into()).collect();
        names.append(&mut too_low(limits));
        (!names.is_empty()).then(|| format!("lacks {}, {NEEDS} is needed", names.join(", ")))
    }
}

fn rank(kind: vk::PhysicalDeviceType) -> (u32, &'static str) {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => (0, "discrete"),
        vk::PhysicalDeviceType::INTEGRATED_GPU => (1, "integrated"),
        vk::PhysicalDeviceType::VIRTUAL_GPU => (2, "virtual"),
        vk::PhysicalDeviceType::CPU => (4, SOFTWARE),
        _ => (3, "other"),
    }
}

fn graphics_family(instance: &Instance, physical: vk::PhysicalDevice, goal: Goal<'_>) -> Option<u32> {
    // SAFETY: `physical` comes from this instance; the call only reads.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    first_family(&families, |family| match goal {
        Goal::Pictures | Goal::Windows => true,
        Goal::Window(surface) => surface.takes_from(physical, family),
    })
}

/// The first with graphics, compute and timestamps that can present.
fn first_family(families: &[vk::QueueFamilyProperties], presents: impl Fn(u32) -> bool) -> Option<u32> {
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let works = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(both) && f.timestamp_valid_bits > 0;
    (0..).zip(families).find(|(index, family)| works(family) && presents(*index)).map(|(index, _)| index)
}

fn filters_floats(instance: &Instance, physical: vk::PhysicalDevice) -> bool {
    let format = vk::Format::R32G32B32A32_SFLOAT;
    // SAFETY: `physical` comes from this instance; the call only reads.
    let there = unsafe { instance.raw.get_physical_device_format_properties(physical, format) };
    there.optimal_tiling_features.contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR)
}

fn has_extension(instance: &Instance, physical: vk::PhysicalDevice, name: &CStr) -> bool {
    // SAFETY: `physical` comes from this instance; the call only reads.
    let all = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    all.iter().any(|e| e.extension_name_as_c_str() == Ok(name))
}

fn device_memory(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    // SAFETY: `physical` comes from this instance; the call only reads.
    let memory = unsafe { instance.raw.get_physical_device_memory_properties(physical) };
    let heaps = memory.memory_heaps_as_slice().iter();
    heaps.filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)).map(|h| h.size).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_family_taken_does_everything_that_is_asked_of_it() {
        use vk::QueueFlags as F;
        let family = |queue_flags, timestamp_valid_bits| vk::QueueFamilyProperties {
            queue_flags,
            timestamp_valid_bits,
            queue_count: 1,
            ..Default::default()
        };
        let both = F::GRAPHICS | F::COMPUTE;
        let families = [family(F::TRANSFER, 64), family(both, 0), family(both, 36), family(both | F::TRANSFER, 64)];
        assert_eq!(first_family(&families, |_| true), Some(2));
        assert_eq!(first_family(&families, |index| index != 2), Some(3));
        assert_eq!(first_family(&families, |index| index < 2), None);
        assert_eq!(first_family(&[], |_| true), None);
    }
}
