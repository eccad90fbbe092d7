//! Devices, and their functions that may find them lost.

use std::collections::HashMap;
use std::ffi::{CStr, c_char, c_void};
use std::mem::transmute;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use ash::vk::{self, Handle};

use super::faults::fails;

/// A function whose signature is known by its name.
pub type Function = unsafe extern "system" fn();

const LOST: vk::Result = vk::Result::ERROR_DEVICE_LOST;

/// The next layer's functions of one device.
struct Next {
    get: vk::PFN_vkGetDeviceProcAddr,
    destroy: vk::PFN_vkDestroyDevice,
    wait_idle: vk::PFN_vkDeviceWaitIdle,
    submit: vk::PFN_vkQueueSubmit2,
    wait_semaphores: vk::PFN_vkWaitSemaphores,
    queue_idle: vk::PFN_vkQueueWaitIdle,
    /// Only with a swapchain.
    present: Option<vk::PFN_vkQueuePresentKHR>,
    acquire: Option<vk::PFN_vkAcquireNextImageKHR>,
    is_lost: AtomicBool,
}

/// By [`key`].
static DEVICES: Mutex<Option<HashMap<usize, Arc<Next>>>> = Mutex::new(None);

/// What a device and its queues have in common: the loader puts its table of functions first in each object.
///
/// # Safety
/// The handle is of a dispatchable object that is alive.
unsafe fn key(handle: impl Handle) -> usize {
    // SAFETY: such handles are pointers to objects that begin with a pointer.
    unsafe { *(handle.as_raw() as *const usize) }
}

/// # Safety
/// As for [`key`].
unsafe fn next(handle: impl Handle) -> Arc<Next> {
    let devices = DEVICES.lock().expect("no thread has panicked");
    // SAFETY: see above.
    let known = devices.as_ref().and_then(|devices| devices.get(&unsafe { key(handle) }).cloned());
    known.expect("a device that was created through this layer")
}

/// Notes a new device.
///
/// # Safety
/// The next layer has just created it, and `get` is that layer's.
pub unsafe fn remember(device: vk::Device, get: vk::PFN_vkGetDeviceProcAddr) {
    // SAFETY: the next layer's functions have the signatures of their names.
    let next = unsafe {
        let of = |name: &CStr| get(device, name.as_ptr());
        let needed = |name: &CStr| of(name).expect("a function of Vulkan 1.3");
        Next {
            get,
            destroy: transmute::<Function, vk::PFN_vkDestroyDevice>(needed(c"vkDestroyDevice")),
            wait_idle: transmute::<Function, vk::PFN_vkDeviceWaitIdle>(needed(c"vkDeviceWaitIdle")),
            submit: transmute::<Function, vk::PFN_vkQueueSubmit2>(needed(c"vkQueueSubmit2")),
            wait_semaphores: transmute::<Function, vk::PFN_vkWaitSemaphores>(needed(c"vkWaitSemaphores")),
            queue_idle: transmute::<Function, vk::PFN_vkQueueWaitIdle>(needed(c"vkQueueWaitIdle")),
            present: transmute::<vk::PFN_vkVoidFunction, Option<vk::PFN_vkQueuePresentKHR>>(of(c"vkQueuePresentKHR")),
            acquire: transmute::<vk::PFN_vkVoidFunction, Option<vk::PFN_vkAcquireNextImageKHR>>(of(
                c"vkAcquireNextImageKHR",
            )),
            is_lost: AtomicBool::new(false),
        }
    };
    let mut devices = DEVICES.lock().expect("no thread has panicked");
    // SAFETY: the device is alive.
    devices.get_or_insert_default().insert(unsafe { key(device) }, Arc::new(next));
}

/// This layer's function of a name.
pub fn own(name: &CStr) -> Option<*const c_void> {
    Some(match name.to_bytes() {
        b"vkGetDeviceProcAddr" => get_device_proc_addr as *const c_void,
        b"vkDestroyDevice" => destroy as *const c_void,
        b"vkDeviceWaitIdle" => wait_idle as *const c_void,
        b"vkQueueWaitIdle" => queue_idle as *const c_void,
        b"vkQueueSubmit2" => submit as *const c_void,
        b"vkWaitSemaphores" => wait_semaphores as *const c_void,
        b"vkQueuePresentKHR" => present as *const c_void,
        b"vkAcquireNextImageKHR" => acquire as *const c_void,
        _ => return None,
    })
}

pub unsafe extern "system" fn get_device_proc_addr(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: the caller's text ends in NUL.
    if let Some(own) = own(unsafe { CStr::from_ptr(name) }) {
        // SAFETY: a function of this library with the signature of that name.
        return Some(unsafe { transmute::<*const c_void, Function>(own) });
    }
    // SAFETY: the caller's arguments.
    unsafe { (next(device).get)(device, name) }
}

impl Next {
    /// Whether a call fails: the device is lost, or is to be with this call.
    fn loses(&self, function: &'static str) -> bool {
        if fails(function) {
            self.is_lost.store(true, Ordering::Relaxed);
        }
        self.is_lost.load(Ordering::Relaxed)
    }
}

unsafe extern "system" fn destroy(device: vk::Device, allocator: *const vk::AllocationCallbacks<'_>) {
    if device.is_null() {
        return;
    }
    // SAFETY: the device is alive until the next layer destroys it.
    unsafe {
        let (next, key) = (next(device), key(device));
        DEVICES.lock().expect("no thread has panicked").get_or_insert_default().remove(&key);
        (next.destroy)(device, allocator);
    }
}

unsafe extern "system" fn wait_idle(device: vk::Device) -> vk::Result {
    // SAFETY: the caller's arguments. What was submitted before the loss still runs here, unlike on a GPU that is lost, and
    // must end before anything is destroyed.
    unsafe {
        let next = next(device);
        let waited = (next.wait_idle)(device);
        if next.loses("vkDeviceWaitIdle") { LOST } else { waited }
    }
}

unsafe extern "system" fn queue_idle(queue: vk::Queue) -> vk::Result {
    // SAFETY: as above.
    unsafe {
        let next = next(queue);
        let waited = (next.queue_idle)(queue);
        if next.loses("vkQueueWaitIdle") { LOST } else { waited }
    }
}

unsafe extern "system" fn submit(
    queue: vk::Queue,
    count: u32,
    infos: *const vk::SubmitInfo2<'_>,
    fence: vk::Fence,
) -> vk::Result {
    // SAFETY: the caller's arguments.
    unsafe {
        let next = next(queue);
        if next.loses("vkQueueSubmit2") { LOST } else { (next.submit)(queue, count, infos, fence) }
    }
}

unsafe extern "system" fn wait_semaphores(
    device: vk::Device,
    info: *const vk::SemaphoreWaitInfo<'_>,
    timeout: u64,
) -> vk::Result {
    // SAFETY: the caller's arguments.
    unsafe {
        let next = next(device);
        if next.loses("vkWaitSemaphores") { LOST } else { (next.wait_semaphores)(device, info, timeout) }
    }
}

unsafe extern "system" fn present(queue: vk::Queue, info: *const vk::PresentInfoKHR<'_>) -> vk::Result {
    // SAFETY: the caller's arguments.
    unsafe {
        let next = next(queue);
        if next.loses("vkQueuePresentKHR") {
            return LOST;
        }
        next.present.map_or(LOST, |present| present(queue, info))
    }
}

unsafe extern "system" fn acquire(
    device: vk::Device,
    swapchain: vk::SwapchainKHR,
    timeout: u64,
    semaphore: vk::Semaphore,
    fence: vk::Fence,
    index: *mut u32,
) -> vk::Result {
    // SAFETY: the caller's arguments.
    unsafe {
        let next = next(device);
        if next.loses("vkAcquireNextImageKHR") {
            return LOST;
        }
        next.acquire.map_or(LOST, |acquire| acquire(device, swapchain, timeout, semaphore, fence, index))
    }
}
