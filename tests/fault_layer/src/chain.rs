//! The loader's side: structures by which it links layers (vk_layer.h of the Vulkan headers, "LoaderLayerInterface.md" of the
//! loader), which ash does not have.

use std::collections::HashMap;
use std::ffi::{CString, c_void};
use std::sync::Mutex;

use ash::vk;

/// Of the loader's structures: `VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO` and `…_DEVICE_CREATE_INFO`.
const INSTANCE_INFO: i32 = 47;
const DEVICE_INFO: i32 = 48;
/// `VK_LAYER_LINK_INFO`.
const LINK: i32 = 0;
/// The interface that is spoken: one entry for negotiation.
const VERSION: u32 = 2;

/// A function whose signature is known by its name.
pub type Function = unsafe extern "system" fn();
type NextOfInstance = vk::PFN_vkGetInstanceProcAddr;
type NextOfDevice = vk::PFN_vkGetDeviceProcAddr;

/// `VkNegotiateLayerInterface`.
#[repr(C)]
pub struct NegotiateInterface {
    kind: i32,
    next: *mut c_void,
    version: u32,
    of_instance: Option<NextOfInstance>,
    of_device: Option<NextOfDevice>,
    of_physical_device: Option<NextOfInstance>,
}

impl NegotiateInterface {
    pub fn offer(&mut self, of_instance: NextOfInstance, of_device: NextOfDevice) {
        self.version = self.version.min(VERSION);
        (self.of_instance, self.of_device, self.of_physical_device) = (Some(of_instance), Some(of_device), None);
    }
}

/// `VkLayerInstanceLink` and `VkLayerDeviceLink`: the second function is of physical devices for one, of devices for the
/// other.
#[repr(C)]
struct Link {
    next: *mut Link,
    of_instance: Option<NextOfInstance>,
    other: Option<NextOfDevice>,
}

/// `VkLayerInstanceCreateInfo` and `VkLayerDeviceCreateInfo`, as far as they are links.
#[repr(C)]
struct CreateInfo {
    kind: i32,
    next: *mut c_void,
    function: i32,
    link: *mut Link,
}

/// Takes this layer's link out of a chain of structures: the next layer's one comes to its place.
unsafe fn take(mut chain: *const c_void, kind: i32) -> Option<*mut Link> {
    while !chain.is_null() {
        let info = chain.cast_mut().cast::<CreateInfo>();
        // SAFETY: every structure of a chain begins with its kind and the next one; those of this kind and function are links.
        unsafe {
            if (*info).kind == kind && (*info).function == LINK {
                let link = (*info).link;
                (*info).link = (*link).next;
                return Some(link);
            }
            chain = (*info).next;
        }
    }
    None
}

/// The next layer's `vkGetInstanceProcAddr`.
///
/// # Safety
/// The chain is that of a call of vkCreateInstance by the loader.
pub unsafe fn instance_link(chain: *const c_void) -> Option<NextOfInstance> {
    // SAFETY: the link is the loader's, and good for the call.
    unsafe { take(chain, INSTANCE_INFO).and_then(|link| (*link).of_instance) }
}

/// The next layer's `vkGetInstanceProcAddr` and `vkGetDeviceProcAddr`.
///
/// # Safety
/// The chain is that of a call of vkCreateDevice by the loader.
pub unsafe fn device_link(chain: *const c_void) -> Option<(NextOfInstance, NextOfDevice)> {
    // SAFETY: as above.
    unsafe { take(chain, DEVICE_INFO).and_then(|link| (*link).of_instance.zip((*link).other)) }
}

/// The instance that was created last, with the next layer's functions of it: all instances are made by the same next layer.
struct LastInstance {
    handle: vk::Instance,
    next: NextOfInstance,
    functions: HashMap<&'static str, Function>,
}

static LAST: Mutex<Option<LastInstance>> = Mutex::new(None);

/// The instance, and the next layer's `vkGetInstanceProcAddr`.
pub fn last_instance() -> Option<(vk::Instance, NextOfInstance)> {
    LAST.lock().expect("no thread has panicked").as_ref().map(|last| (last.handle, last.next))
}

/// The next layer's function of a name that was given to [`set_last_instance`].
pub fn function_of_last_instance(name: &str) -> Option<Function> {
    LAST.lock().expect("no thread has panicked").as_ref()?.functions.get(name).copied()
}

/// Notes a new instance, and asks for the functions that are wanted: later the loader would answer with those of the topmost
/// layer.
///
/// # Safety
/// The next layer has just created it, and vkCreateInstance has not returned.
pub unsafe fn set_last_instance(
    handle: vk::Instance,
    next: NextOfInstance,
    wanted: impl Iterator<Item = &'static str>,
) {
    let find = |name: &'static str| {
        let text = CString::new(name).expect("a name without NUL");
        // SAFETY: the instance is alive, the name ends in NUL.
        Some((name, unsafe { next(handle, text.as_ptr()) }?))
    };
    let last = LastInstance { handle, next, functions: wanted.filter_map(find).collect() };
    *LAST.lock().expect("no thread has panicked") = Some(last);
}
