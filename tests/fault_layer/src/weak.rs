//! Weak GPUs: a GPU reports no more than a test asks for, and refuses what it has not reported. Validation above this layer
//! holds the program to it.

use std::ffi::{CStr, c_char, c_void};
use std::mem::transmute;
use std::sync::OnceLock;

use ash::vk::{self, Result as R};

use super::chain::Function;
use super::chained::{EnabledFeatures, lower_features, lower_properties};
use super::device::Next;
use super::formats::{lower_features_of_format, lower_image};
use super::memory;

/// The environment variable with the kind of GPU, words between commas:
///
/// - `minimum`: what Vulkan 1.3 requires of every GPU, and nothing else;
/// - `bare`: the same, and what pbr-vr says it needs beyond that;
/// - `memory:N`: heaps of N MiB, which are full when they are;
/// - `sets:N`: so many descriptor sets at most, which may be fewer than Vulkan requires.
pub const GPU: &str = "PBR_VR_FAULT_GPU";

const MEMORY_BUDGET: &CStr = ash::ext::memory_budget::NAME;

/// What a GPU is lowered to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    pub level: Level,
    /// Bytes of each heap, at most.
    pub heap: Option<u64>,
    pub sets: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// All of the driver's limits and features.
    Whole,
    /// The least of Vulkan 1.3.
    Minimum,
    /// That, and what pbr-vr needs.
    Bare,
}

impl Profile {
    fn parse(text: &str) -> Self {
        let mut profile = Self { level: Level::Whole, heap: None, sets: None };
        for word in text.split(',') {
            match word.split_once(':') {
                Some(("memory", mib)) => profile.heap = Some(mib.parse::<u64>().expect("MiB") << 20),
                Some(("sets", count)) => profile.sets = Some(count.parse().expect("a count")),
                None if word == "minimum" => profile.level = Level::Minimum,
                None if word == "bare" => profile.level = Level::Bare,
                _ => panic!("{GPU}={text}: no such GPU"),
            }
        }
        profile
    }

    /// The profile that a test has asked for.
    pub fn chosen() -> Option<Self> {
        static CHOSEN: OnceLock<Option<Profile>> = OnceLock::new();
        *CHOSEN.get_or_init(|| std::env::var(GPU).ok().map(|text| Self::parse(&text)))
    }

    fn now() -> Self {
        Self::chosen().expect("functions of a weak GPU are given out only for one")
    }

    fn has(self, extension: &CStr) -> bool {
        if extension == MEMORY_BUDGET && memory::budget().is_some() {
            return true;
        }
        // What shows pictures in a window is there; everything else is optional.
        self.level == Level::Whole || extension == ash::khr::swapchain::NAME
    }
}

/// The functions of instances that a weak GPU has others of.
pub const NAMES: &[&str] = &[
    "vkGetPhysicalDeviceProperties",
    "vkGetPhysicalDeviceProperties2",
    "vkGetPhysicalDeviceFeatures2",
    "vkGetPhysicalDeviceFormatProperties",
    "vkGetPhysicalDeviceFormatProperties2",
    "vkGetPhysicalDeviceImageFormatProperties2",
    "vkGetPhysicalDeviceMemoryProperties",
    "vkGetPhysicalDeviceMemoryProperties2",
    "vkEnumerateDeviceExtensionProperties",
];

/// Calls the next layer's function that has the name of a pointer type.
macro_rules! next {
    ($kind:ident($first:expr $(, $more:expr)*)) => {{
        let name = &stringify!($kind)["PFN_".len()..];
        let function = Next::of($first).function(name).expect("a function of Vulkan 1.1");
        transmute::<Function, vk::$kind>(function)($first $(, $more)*)
    }};
}

/// The function of a weak GPU in place of the one of a name; `None` if the GPU is not weak, or the function is as ever.
pub fn own(name: &CStr) -> Option<*const c_void> {
    Profile::chosen()?;
    // The names of before Vulkan 1.1.
    let name = name.to_str().ok()?;
    let name = name.strip_suffix("KHR").filter(|short| short.ends_with('2')).unwrap_or(name);
    Some(match name {
        "vkGetPhysicalDeviceProperties" => properties as *const c_void,
        "vkGetPhysicalDeviceProperties2" => properties_2 as *const c_void,
        "vkGetPhysicalDeviceFeatures" => features as *const c_void,
        "vkGetPhysicalDeviceFeatures2" => features_2 as *const c_void,
        "vkGetPhysicalDeviceFormatProperties" => format as *const c_void,
        "vkGetPhysicalDeviceFormatProperties2" => format_2 as *const c_void,
        "vkGetPhysicalDeviceImageFormatProperties" => image as *const c_void,
        "vkGetPhysicalDeviceImageFormatProperties2" => image_2 as *const c_void,
        "vkGetPhysicalDeviceMemoryProperties" => heaps as *const c_void,
        "vkGetPhysicalDeviceMemoryProperties2" => heaps_2 as *const c_void,
        "vkEnumerateDeviceExtensionProperties" => extensions as *const c_void,
        "vkAllocateMemory" => memory::allocate as *const c_void,
        "vkFreeMemory" => memory::free as *const c_void,
        _ => return None,
    })
}

unsafe extern "system" fn properties(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties) {
    // SAFETY: the caller's arguments; the next layer fills the structure.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceProperties(on, out));
        super::limits::lower(&mut (*out).limits, Profile::now());
    }
}

unsafe extern "system" fn properties_2(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties2<'_>) {
    // SAFETY: as above; the chain is the caller's.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceProperties2(on, out));
        super::limits::lower(&mut (*out).properties.limits, Profile::now());
        lower_properties((*out).p_next, Profile::now().level);
    }
}

unsafe extern "system" fn features(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceFeatures) {
    let mut all = vk::PhysicalDeviceFeatures2::default();
    // SAFETY: as above.
    unsafe {
        features_2(on, &mut all);
        *out = all.features;
    }
}

unsafe extern "system" fn features_2(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceFeatures2<'_>) {
    // SAFETY: as above.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceFeatures2(on, out));
        lower_features(&mut *out, Profile::now().level);
    }
}

unsafe extern "system" fn format(on: vk::PhysicalDevice, format: vk::Format, out: *mut vk::FormatProperties) {
    // SAFETY: as above.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceFormatProperties(on, format, out));
        lower_features_of_format(format, &mut *out, Profile::now().level);
    }
}

unsafe extern "system" fn format_2(on: vk::PhysicalDevice, format: vk::Format, out: *mut vk::FormatProperties2<'_>) {
    // SAFETY: as above.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceFormatProperties2(on, format, out));
        lower_features_of_format(format, &mut (*out).format_properties, Profile::now().level);
        super::formats::lower_chain((*out).p_next, (*out).format_properties);
    }
}

unsafe extern "system" fn image(
    on: vk::PhysicalDevice,
    format: vk::Format,
    kind: vk::ImageType,
    tiling: vk::ImageTiling,
    usage: vk::ImageUsageFlags,
    flags: vk::ImageCreateFlags,
    out: *mut vk::ImageFormatProperties,
) -> R {
    let info = vk::PhysicalDeviceImageFormatInfo2::default().format(format).ty(kind).tiling(tiling);
    let mut all = vk::ImageFormatProperties2::default();
    // SAFETY: as above.
    unsafe {
        let answer = image_2(on, &info.usage(usage).flags(flags), &mut all);
        *out = all.image_format_properties;
        answer
    }
}

unsafe extern "system" fn image_2(
    on: vk::PhysicalDevice,
    info: *const vk::PhysicalDeviceImageFormatInfo2<'_>,
    out: *mut vk::ImageFormatProperties2<'_>,
) -> R {
    // SAFETY: as above.
    unsafe {
        let answer = next!(PFN_vkGetPhysicalDeviceImageFormatProperties2(on, info, out));
        let mut there = vk::FormatProperties::default();
        format(on, (*info).format, &mut there);
        let is_there = lower_image(&*info, there, &mut (*out).image_format_properties, Profile::now().level);
        if answer == R::SUCCESS && !is_there {
            (*out).image_format_properties = vk::ImageFormatProperties::default();
            return R::ERROR_FORMAT_NOT_SUPPORTED;
        }
        answer
    }
}

unsafe extern "system" fn heaps(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceMemoryProperties) {
    // SAFETY: as above.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceMemoryProperties(on, out));
        memory::lower(&mut *out, Profile::now().heap);
    }
}

unsafe extern "system" fn heaps_2(on: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceMemoryProperties2<'_>) {
    // SAFETY: as above.
    unsafe {
        next!(PFN_vkGetPhysicalDeviceMemoryProperties2(on, out));
        memory::lower(&mut (*out).memory_properties, Profile::now().heap);
        memory::lower_budget((*out).p_next, Profile::now().heap);
    }
}

unsafe extern "system" fn extensions(
    on: vk::PhysicalDevice,
    layer: *const c_char,
    count: *mut u32,
    out: *mut vk::ExtensionProperties,
) -> R {
    // SAFETY: as above; the caller has room for `count`.
    unsafe {
        if !layer.is_null() {
            return next!(PFN_vkEnumerateDeviceExtensionProperties(on, layer, count, out));
        }
        let mut there = match all_extensions(on) {
            Ok(there) => there,
            Err(error) => return error,
        };
        let named = |extension: &vk::ExtensionProperties, name| extension.extension_name_as_c_str() == Ok(name);
        if memory::budget().is_some() && !there.iter().any(|extension| named(extension, MEMORY_BUDGET)) {
            let budget = vk::ExtensionProperties::default().extension_name(MEMORY_BUDGET).expect("a short name");
            there.push(budget.spec_version(1));
        }
        there.retain(|extension| extension.extension_name_as_c_str().is_ok_and(|name| Profile::now().has(name)));
        if out.is_null() {
            *count = there.len() as u32;
            return R::SUCCESS;
        }
        let room = (*count as usize).min(there.len());
        std::ptr::copy_nonoverlapping(there.as_ptr(), out, room);
        *count = room as u32;
        if room < there.len() { R::INCOMPLETE } else { R::SUCCESS }
    }
}

unsafe fn all_extensions(on: vk::PhysicalDevice) -> Result<Vec<vk::ExtensionProperties>, R> {
    let mut count = 0;
    let none = std::ptr::null();
    // SAFETY: the first call counts, the second fills as many.
    unsafe {
        next!(PFN_vkEnumerateDeviceExtensionProperties(on, none, &mut count, std::ptr::null_mut())).result()?;
        let mut all = vec![vk::ExtensionProperties::default(); count as usize];
        next!(PFN_vkEnumerateDeviceExtensionProperties(on, none, &mut count, all.as_mut_ptr())).result()?;
        all.truncate(count as usize);
        Ok(all)
    }
}

/// The extensions of a device that the next layer is to know: not the budget that this layer makes.
///
/// # Safety
/// The arguments are those of vkCreateDevice.
pub unsafe fn passed_on(info: &vk::DeviceCreateInfo<'_>) -> Vec<*const c_char> {
    // SAFETY: names are the caller's, and end in NUL.
    unsafe {
        let is_own = |name: &*const c_char| CStr::from_ptr(*name) == MEMORY_BUDGET && memory::budget().is_some();
        names(info).iter().copied().filter(|name| !is_own(name)).collect()
    }
}

unsafe fn names<'a>(info: &'a vk::DeviceCreateInfo<'_>) -> &'a [*const c_char] {
    match info.enabled_extension_count {
        0 => &[],
        // SAFETY: the caller has as many.
        count => unsafe { std::slice::from_raw_parts(info.pp_enabled_extension_names, count as usize) },
    }
}

/// Why a weak GPU does not open: it was asked for what it has not reported.
///
/// # Safety
/// The arguments are those of vkCreateDevice.
pub unsafe fn refuses(on: vk::PhysicalDevice, info: &vk::DeviceCreateInfo<'_>) -> Option<R> {
    let profile = Profile::chosen()?;
    // SAFETY: names are the caller's, and end in NUL; the features are the next layer's, lowered.
    unsafe {
        if names(info).iter().any(|name| !profile.has(CStr::from_ptr(*name))) {
            return Some(R::ERROR_EXTENSION_NOT_PRESENT);
        }
        let asked = EnabledFeatures::of(info);
        let mut there = EnabledFeatures::default();
        there.fill(|all| features_2(on, all));
        (!asked.are_among(&there)).then_some(R::ERROR_FEATURE_NOT_PRESENT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gpu_is_known_by_its_words() {
        assert_eq!(Profile::parse("minimum"), Profile { level: Level::Minimum, heap: None, sets: None });
        let both = Profile { level: Level::Bare, heap: Some(2 << 20), sets: Some(1) };
        assert_eq!(Profile::parse("bare,memory:2,sets:1"), both);
        assert!(Profile::parse("memory:1").has(c"VK_EXT_memory_budget"));
        assert!(!Profile::parse("bare").has(c"VK_EXT_memory_budget"));
    }
}
