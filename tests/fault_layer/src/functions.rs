//! The functions that may fail, with the errors that Vulkan's specification lists for each ("Return Codes"). Names for
//! debugging are left out, as without them nothing changes, and vkEnumerateDeviceExtensionProperties, whose failure
//! Vulkan's own loader does not survive (1.3.239).
#![allow(non_snake_case)]

use std::ffi::{CStr, c_void};
use std::mem::transmute;

use ash::vk::*;

use super::chain::Function;
use super::device::Next;
use super::faults::fault;

type Memory<'a> = *const AllocationCallbacks<'a>;
type Answer = ash::vk::Result;

const HOST: Answer = Answer::ERROR_OUT_OF_HOST_MEMORY;
const DEVICE: Answer = Answer::ERROR_OUT_OF_DEVICE_MEMORY;
const LOST: Answer = Answer::ERROR_DEVICE_LOST;
const SURFACE: Answer = Answer::ERROR_SURFACE_LOST_KHR;
const START: Answer = Answer::ERROR_INITIALIZATION_FAILED;
const MANY: Answer = Answer::ERROR_TOO_MANY_OBJECTS;

/// Declares a function for each row, which fails when a test says so, and else calls the next layer's; and `own`, which finds
/// them by name. `after` calls the next layer's first, as what was submitted goes on here and must end before anything is
/// destroyed. The block of a row runs before a failure.
macro_rules! functions {
    ($($name:ident($first:ident: $on:ty $(, $more:ident: $of:ty)*) may $errors:expr $(, $when:ident)? $(=> $block:block)?;)*) => {
        $(
            unsafe extern "system" fn $name($first: $on $(, $more: $of)*) -> Answer {
                // A function pointer's type begins with "PFN_".
                let name = &stringify!($name)["PFN_".len()..];
                // SAFETY: the caller's arguments, for the next layer's function of this name.
                unsafe {
                    let next = Next::of($first);
                    let call = || match next.function(name) {
                        Some(call) => transmute::<Function, ash::vk::$name>(call)($first $(, $more)*),
                        None => Answer::ERROR_EXTENSION_NOT_PRESENT,
                    };
                    functions!(@order $($when)?, next, name, $errors, call, { $($block)? })
                }
            }
        )*

        /// Their names.
        pub const NAMES: &[&str] = &[$(stringify!($name).split_at("PFN_".len()).1),*];

        /// This layer's function of a name.
        pub fn own(name: &CStr) -> Option<*const c_void> {
            Some(match name.to_str().ok()? {
                $(name if name == &stringify!($name)["PFN_".len()..] => {
                    let own: ash::vk::$name = $name;
                    own as *const c_void
                })*
                _ => return None,
            })
        }
    };
    (@order after, $next:ident, $name:ident, $errors:expr, $call:ident, $block:block) => {{
        let answer = $call();
        $next.fails(fault($name, &$errors), &$errors).unwrap_or(answer)
    }};
    (@order , $next:ident, $name:ident, $errors:expr, $call:ident, $block:block) => {
        match $next.fails(fault($name, &$errors), &$errors) {
            Some(error) => {
                $block
                error
            }
            None => $call(),
        }
    };
}

functions! {
    PFN_vkEnumeratePhysicalDevices(on: Instance, count: *mut u32, out: *mut PhysicalDevice) may [HOST, DEVICE, START];
    PFN_vkCreateDebugUtilsMessengerEXT(
        on: Instance, info: *const DebugUtilsMessengerCreateInfoEXT<'_>, memory: Memory<'_>, out: *mut DebugUtilsMessengerEXT
    ) may [HOST];
    PFN_vkCreateXlibSurfaceKHR(
        on: Instance, info: *const XlibSurfaceCreateInfoKHR<'_>, memory: Memory<'_>, out: *mut SurfaceKHR
    ) may [HOST, DEVICE];
    PFN_vkCreateXcbSurfaceKHR(
        on: Instance, info: *const XcbSurfaceCreateInfoKHR<'_>, memory: Memory<'_>, out: *mut SurfaceKHR
    ) may [HOST, DEVICE];
    PFN_vkGetPhysicalDeviceSurfaceSupportKHR(
        on: PhysicalDevice, family: u32, surface: SurfaceKHR, out: *mut Bool32
    ) may [HOST, DEVICE, SURFACE];
    PFN_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(
        on: PhysicalDevice, surface: SurfaceKHR, out: *mut SurfaceCapabilitiesKHR
    ) may [HOST, DEVICE, SURFACE];
    PFN_vkGetPhysicalDeviceSurfaceFormatsKHR(
        on: PhysicalDevice, surface: SurfaceKHR, count: *mut u32, out: *mut SurfaceFormatKHR
    ) may [HOST, DEVICE, SURFACE];
    PFN_vkGetPhysicalDeviceSurfacePresentModesKHR(
        on: PhysicalDevice, surface: SurfaceKHR, count: *mut u32, out: *mut PresentModeKHR
    ) may [HOST, DEVICE, SURFACE];

    PFN_vkAllocateMemory(
        on: Device, info: *const MemoryAllocateInfo<'_>, memory: Memory<'_>, out: *mut DeviceMemory
    ) may [HOST, DEVICE, MANY];
    PFN_vkMapMemory(
        on: Device, memory: DeviceMemory, offset: DeviceSize, size: DeviceSize, flags: MemoryMapFlags, out: *mut *mut c_void
    ) may [HOST, DEVICE, Answer::ERROR_MEMORY_MAP_FAILED];
    PFN_vkBindBufferMemory(on: Device, buffer: Buffer, memory: DeviceMemory, offset: DeviceSize) may [HOST, DEVICE];
    PFN_vkBindImageMemory(on: Device, image: Image, memory: DeviceMemory, offset: DeviceSize) may [HOST, DEVICE];
    PFN_vkCreateBuffer(on: Device, info: *const BufferCreateInfo<'_>, memory: Memory<'_>, out: *mut Buffer) may [HOST, DEVICE];
    PFN_vkCreateImage(on: Device, info: *const ImageCreateInfo<'_>, memory: Memory<'_>, out: *mut Image) may [HOST, DEVICE];
    PFN_vkCreateImageView(
        on: Device, info: *const ImageViewCreateInfo<'_>, memory: Memory<'_>, out: *mut ImageView
    ) may [HOST, DEVICE];
    PFN_vkCreateSampler(
        on: Device, info: *const SamplerCreateInfo<'_>, memory: Memory<'_>, out: *mut Sampler
    ) may [HOST, DEVICE, MANY];
    PFN_vkCreateShaderModule(
        on: Device, info: *const ShaderModuleCreateInfo<'_>, memory: Memory<'_>, out: *mut ShaderModule
    ) may [HOST, DEVICE];
    PFN_vkCreatePipelineLayout(
        on: Device, info: *const PipelineLayoutCreateInfo<'_>, memory: Memory<'_>, out: *mut PipelineLayout
    ) may [HOST, DEVICE];
    PFN_vkCreatePipelineCache(
        on: Device, info: *const PipelineCacheCreateInfo<'_>, memory: Memory<'_>, out: *mut PipelineCache
    ) may [HOST, DEVICE];
    PFN_vkGetPipelineCacheData(
        on: Device, cache: PipelineCache, size: *mut usize, out: *mut c_void
    ) may [HOST, DEVICE];
    PFN_vkMergePipelineCaches(
        on: Device, into: PipelineCache, count: u32, from: *const PipelineCache
    ) may [HOST, DEVICE];
    PFN_vkCreateGraphicsPipelines(
        on: Device, cache: PipelineCache, count: u32, infos: *const GraphicsPipelineCreateInfo<'_>, memory: Memory<'_>,
        out: *mut Pipeline
    ) may [HOST, DEVICE] => { none(out, count) };
    PFN_vkCreateComputePipelines(
        on: Device, cache: PipelineCache, count: u32, infos: *const ComputePipelineCreateInfo<'_>, memory: Memory<'_>,
        out: *mut Pipeline
    ) may [HOST, DEVICE] => { none(out, count) };
    PFN_vkCreateDescriptorSetLayout(
        on: Device, info: *const DescriptorSetLayoutCreateInfo<'_>, memory: Memory<'_>, out: *mut DescriptorSetLayout
    ) may [HOST, DEVICE];
    PFN_vkCreateDescriptorPool(
        on: Device, info: *const DescriptorPoolCreateInfo<'_>, memory: Memory<'_>, out: *mut DescriptorPool
    ) may [HOST, DEVICE, Answer::ERROR_FRAGMENTATION];
    PFN_vkAllocateDescriptorSets(
        on: Device, info: *const DescriptorSetAllocateInfo<'_>, out: *mut DescriptorSet
    ) may [HOST, DEVICE, Answer::ERROR_FRAGMENTED_POOL, Answer::ERROR_OUT_OF_POOL_MEMORY];
    PFN_vkCreateCommandPool(
        on: Device, info: *const CommandPoolCreateInfo<'_>, memory: Memory<'_>, out: *mut CommandPool
    ) may [HOST, DEVICE];
    PFN_vkResetCommandPool(on: Device, pool: CommandPool, flags: CommandPoolResetFlags) may [DEVICE];
    PFN_vkAllocateCommandBuffers(
        on: Device, info: *const CommandBufferAllocateInfo<'_>, out: *mut CommandBuffer
    ) may [HOST, DEVICE];
    PFN_vkBeginCommandBuffer(on: CommandBuffer, info: *const CommandBufferBeginInfo<'_>) may [HOST, DEVICE];
    PFN_vkEndCommandBuffer(on: CommandBuffer) may [HOST, DEVICE];
    PFN_vkCreateQueryPool(
        on: Device, info: *const QueryPoolCreateInfo<'_>, memory: Memory<'_>, out: *mut QueryPool
    ) may [HOST, DEVICE];
    PFN_vkGetQueryPoolResults(
        on: Device, pool: QueryPool, first: u32, count: u32, size: usize, out: *mut c_void, stride: DeviceSize,
        flags: QueryResultFlags
    ) may [HOST, DEVICE, LOST];
    PFN_vkCreateSemaphore(
        on: Device, info: *const SemaphoreCreateInfo<'_>, memory: Memory<'_>, out: *mut Semaphore
    ) may [HOST, DEVICE];
    PFN_vkGetSemaphoreCounterValue(on: Device, semaphore: Semaphore, out: *mut u64) may [HOST, DEVICE, LOST];
    PFN_vkWaitSemaphores(on: Device, info: *const SemaphoreWaitInfo<'_>, timeout: u64) may [HOST, DEVICE, LOST];
    PFN_vkCreateFence(on: Device, info: *const FenceCreateInfo<'_>, memory: Memory<'_>, out: *mut Fence) may [HOST, DEVICE];
    PFN_vkGetFenceStatus(on: Device, fence: Fence) may [HOST, DEVICE, LOST];
    PFN_vkResetFences(on: Device, count: u32, fences: *const Fence) may [DEVICE];
    PFN_vkWaitForFences(
        on: Device, count: u32, fences: *const Fence, all: Bool32, timeout: u64
    ) may [HOST, DEVICE, LOST], after;
    PFN_vkQueueSubmit2(
        on: Queue, count: u32, infos: *const SubmitInfo2<'_>, fence: Fence
    ) may [HOST, DEVICE, LOST];
    PFN_vkQueueWaitIdle(on: Queue) may [HOST, DEVICE, LOST], after;
    PFN_vkDeviceWaitIdle(on: Device) may [HOST, DEVICE, LOST], after;
    PFN_vkCreateSwapchainKHR(
        on: Device, info: *const SwapchainCreateInfoKHR<'_>, memory: Memory<'_>, out: *mut SwapchainKHR
    ) may [HOST, DEVICE, LOST, SURFACE, Answer::ERROR_NATIVE_WINDOW_IN_USE_KHR, START];
    PFN_vkGetSwapchainImagesKHR(
        on: Device, swapchain: SwapchainKHR, count: *mut u32, out: *mut Image
    ) may [HOST, DEVICE];
    PFN_vkAcquireNextImageKHR(
        on: Device, swapchain: SwapchainKHR, timeout: u64, semaphore: Semaphore, fence: Fence, index: *mut u32
    ) may [HOST, DEVICE, LOST, Answer::ERROR_OUT_OF_DATE_KHR, SURFACE];
    PFN_vkQueuePresentKHR(
        on: Queue, info: *const PresentInfoKHR<'_>
    ) may [HOST, DEVICE, LOST, Answer::ERROR_OUT_OF_DATE_KHR, SURFACE];
}

/// No pipelines: what a failure leaves where they would be.
unsafe fn none(out: *mut Pipeline, count: u32) {
    for i in 0..count as usize {
        // SAFETY: the caller has room for as many.
        unsafe { *out.add(i) = Pipeline::null() };
    }
}
