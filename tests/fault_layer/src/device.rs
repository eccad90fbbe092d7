//! The next layer, by any of its objects: whose functions come after this layer's, and whether the device is lost.

use std::collections::HashMap;
use std::ffi::{CStr, CString, c_char};
use std::mem::transmute;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use ash::vk::{self, Handle};

use super::chain::{Function, function_of_last_instance};
use super::{functions, weak};

const LOST: vk::Result = vk::Result::ERROR_DEVICE_LOST;

/// A device, and the next layer's functions of it.
struct Device {
    handle: vk::Device,
    get: vk::PFN_vkGetDeviceProcAddr,
    is_lost: AtomicBool,
}

/// By [`key`].
static DEVICES: Mutex<Option<HashMap<usize, Arc<Device>>>> = Mutex::new(None);

/// What a device, its queues and command buffers have in common: the loader puts its table of functions first in each object.
///
/// # Safety
/// The handle is of a dispatchable object that is alive.
unsafe fn key(handle: impl Handle) -> usize {
    // SAFETY: such handles are pointers to objects that begin with a pointer.
    unsafe { *(handle.as_raw() as *const usize) }
}

/// # Safety
/// As for [`key`].
unsafe fn device_of(handle: impl Handle) -> Arc<Device> {
    let devices = DEVICES.lock().expect("no thread has panicked");
    // SAFETY: see above.
    let known = devices.as_ref().and_then(|devices| devices.get(&unsafe { key(handle) }).cloned());
    known.expect("a device that was created through this layer")
}

/// What comes after this layer, for one object.
pub enum Next {
    Instance,
    Device(vk::Device, vk::PFN_vkGetDeviceProcAddr, DeviceState),
}

/// Whether a device is lost.
pub struct DeviceState(Arc<Device>);

impl Next {
    /// # Safety
    /// The handle is of a dispatchable object that is alive.
    pub unsafe fn of<T: Handle>(handle: T) -> Self {
        if [vk::ObjectType::INSTANCE, vk::ObjectType::PHYSICAL_DEVICE].contains(&T::TYPE) {
            return Self::Instance;
        }
        // SAFETY: see above.
        let device = unsafe { device_of(handle) };
        Self::Device(device.handle, device.get, DeviceState(device))
    }

    /// The next layer's function of a name.
    pub fn function(&self, name: &str) -> Option<Function> {
        let Self::Device(device, get, _) = self else { return function_of_last_instance(name) };
        let name = CString::new(name).expect("a name without NUL");
        // SAFETY: the device is alive, the name ends in NUL.
        unsafe { get(*device, name.as_ptr()) }
    }

    /// The error of a call for which this one was meant: that it finds the device lost, too, once it is, where it may.
    pub fn fails(&self, meant: Option<vk::Result>, may: &[vk::Result]) -> Option<vk::Result> {
        let Self::Device(.., DeviceState(device)) = self else { return meant };
        if meant == Some(LOST) {
            device.is_lost.store(true, Ordering::Relaxed);
        }
        let is_lost = may.contains(&LOST) && device.is_lost.load(Ordering::Relaxed);
        if is_lost { Some(LOST) } else { meant }
    }
}

/// Notes a new device.
///
/// # Safety
/// The next layer has just created it, and `get` is that layer's.
pub unsafe fn remember(device: vk::Device, get: vk::PFN_vkGetDeviceProcAddr) {
    let known = Device { handle: device, get, is_lost: AtomicBool::new(false) };
    let mut devices = DEVICES.lock().expect("no thread has panicked");
    // SAFETY: the device is alive.
    devices.get_or_insert_default().insert(unsafe { key(device) }, Arc::new(known));
}

pub unsafe extern "system" fn get_device_proc_addr(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: the caller's text ends in NUL.
    let asked = unsafe { CStr::from_ptr(name) };
    let own = match asked.to_bytes() {
        b"vkGetDeviceProcAddr" => Some(get_device_proc_addr as *const _),
        b"vkDestroyDevice" => Some(destroy as *const _),
        _ => weak::own(asked).or_else(|| functions::own(asked)),
    };
    // SAFETY: the caller's arguments.
    let next = unsafe { device_of(device) };
    // SAFETY: as above.
    let there = unsafe { (next.get)(device, name) };
    // What the next layer lacks this one lacks, too.
    // SAFETY: a function of this library with the signature of that name.
    own.and(there).and(own).map(|own| unsafe { transmute::<*const std::ffi::c_void, Function>(own) }).or(there)
}

/// # Safety
/// That of vkDestroyDevice.
pub unsafe extern "system" fn destroy(device: vk::Device, allocator: *const vk::AllocationCallbacks<'_>) {
    if device.is_null() {
        return;
    }
    // SAFETY: the device is alive until the next layer destroys it.
    unsafe {
        let (next, key) = (Next::of(device), key(device));
        DEVICES.lock().expect("no thread has panicked").get_or_insert_default().remove(&key);
        let destroy = next.function("vkDestroyDevice").expect("a function of Vulkan 1.0");
        transmute::<Function, vk::PFN_vkDestroyDevice>(destroy)(device, allocator);
    }
}
