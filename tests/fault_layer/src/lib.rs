//! A Vulkan layer that lets a call fail on purpose, when a test says so, with an error that it may return. After
//! `VK_ERROR_DEVICE_LOST`, everything that the device is asked for fails with it, as the specification has it ("Lost Device").
//! Another device is whole again. Where a test asks for it, a GPU reports less than it can; see `weak.rs`.

mod chain;
mod chained;
mod device;
mod faults;
mod formats;
mod functions;
mod limits;
mod memory;
mod weak;

use std::ffi::{CStr, c_char, c_void};
use std::fs;
use std::mem::transmute;
use std::path::Path;

use ash::vk::{self, Result as R};
use serde_json::json;

use chain::{Function, NegotiateInterface, device_link, instance_link, last_instance, set_last_instance};
use faults::fault;

const VALIDATION: &str = "VK_LAYER_KHRONOS_validation";
/// The layer's name, for `VK_INSTANCE_LAYERS`.
pub const LAYER: &str = "VK_LAYER_PBRVR_fault";
/// A meta-layer, for the same: validation, and this layer below it. Loaders differ in how they order the layers of the variable
/// (1.3.239 has this one on top whatever it says), but not in how they order the parts of a meta-layer.
pub const BELOW_VALIDATION: &str = "VK_LAYER_PBRVR_fault_below_validation";
pub use faults::{CALL, FILE, LOG};
pub use memory::BUDGET;
pub use weak::GPU;

/// Writes the layers' manifests into `folder`, for `VK_LAYER_PATH`; `library` is this crate's, as cargo has built it.
///
/// # Errors
/// The file cannot be written.
pub fn install(folder: &Path, library: &Path) -> std::io::Result<()> {
    let manifest = json!({
        "file_format_version": "1.2.0",
        "layer": {
            "name": LAYER,
            "type": "GLOBAL",
            "library_path": library,
            "api_version": "1.3.0",
            "implementation_version": "1",
            "description": "lets a chosen call fail",
        },
    });
    fs::write(folder.join("fault_layer.json"), manifest.to_string())?;
    let manifest = json!({
        "file_format_version": "1.2.0",
        "layer": {
            "name": BELOW_VALIDATION,
            "type": "GLOBAL",
            "api_version": "1.3.0",
            "implementation_version": "1",
            "description": "lets calls fail below the validation layer",
            "component_layers": [VALIDATION, LAYER],
        },
    });
    fs::write(folder.join("fault_layer_below_validation.json"), manifest.to_string())
}

/// The loader's first call: which interface both speak.
///
/// # Safety
/// The pointer is to the loader's structure.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn vkNegotiateLoaderLayerInterfaceVersion(interface: *mut NegotiateInterface) -> R {
    // SAFETY: the loader's structure is good for the call.
    let interface = unsafe { &mut *interface };
    interface.offer(get_instance_proc_addr, device::get_device_proc_addr);
    R::SUCCESS
}

unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: the caller's text ends in NUL.
    let asked = unsafe { CStr::from_ptr(name) };
    let own: Option<*const c_void> = match asked.to_bytes() {
        b"vkGetInstanceProcAddr" => Some(get_instance_proc_addr as *const c_void),
        b"vkCreateInstance" => Some(create_instance as *const c_void),
        b"vkCreateDevice" => Some(create_device as *const c_void),
        b"vkGetDeviceProcAddr" => Some(device::get_device_proc_addr as *const c_void),
        b"vkDestroyDevice" => Some(device::destroy as *const c_void),
        _ => weak::own(asked).or_else(|| functions::own(asked)),
    };
    if let Some(own) = own {
        // SAFETY: a function of this library with the signature of that name.
        return Some(unsafe { transmute::<*const c_void, Function>(own) });
    }
    // SAFETY: the next layer's function, with the caller's arguments.
    last_instance().and_then(|(_, next)| unsafe { next(instance, name) })
}

unsafe extern "system" fn create_instance(
    info: *const vk::InstanceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    instance: *mut vk::Instance,
) -> R {
    // SAFETY: the loader chains its link into every call of a layer.
    let Some(next) = (unsafe { instance_link((*info).p_next) }) else { return R::ERROR_INITIALIZATION_FAILED };
    let errors = [R::ERROR_OUT_OF_HOST_MEMORY, R::ERROR_INITIALIZATION_FAILED, R::ERROR_INCOMPATIBLE_DRIVER];
    if let Some(error) = fault("vkCreateInstance", &errors) {
        return error;
    }
    // SAFETY: before there is an instance, only global functions are asked for.
    let create = unsafe { next(vk::Instance::null(), c"vkCreateInstance".as_ptr()) };
    let Some(create) = create else { return R::ERROR_INITIALIZATION_FAILED };
    // SAFETY: the next layer's function of this name; arguments are the caller's.
    unsafe {
        let create = transmute::<Function, vk::PFN_vkCreateInstance>(create);
        let created = create(info, allocator, instance);
        if created == R::SUCCESS {
            set_last_instance(*instance, next, [functions::NAMES, weak::NAMES].concat().into_iter());
        }
        created
    }
}

unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    device: *mut vk::Device,
) -> R {
    // SAFETY: as for an instance.
    let link = unsafe { device_link((*info).p_next) };
    let Some(((next_instance, next_device), (instance, _))) = link.zip(last_instance()) else {
        return R::ERROR_INITIALIZATION_FAILED;
    };
    let errors = [R::ERROR_OUT_OF_HOST_MEMORY, R::ERROR_OUT_OF_DEVICE_MEMORY, R::ERROR_INITIALIZATION_FAILED];
    let more = [R::ERROR_TOO_MANY_OBJECTS, R::ERROR_DEVICE_LOST];
    if let Some(error) = fault("vkCreateDevice", &[&errors[..], &more].concat()) {
        return error;
    }
    // SAFETY: the caller's arguments.
    if let Some(error) = unsafe { weak::refuses(physical, &*info) } {
        return error;
    }
    // SAFETY: the next layer's function, of the instance that the physical device is of.
    let create = unsafe { next_instance(instance, c"vkCreateDevice".as_ptr()) };
    let Some(create) = create else { return R::ERROR_INITIALIZATION_FAILED };
    // SAFETY: the next layer's function of this name; arguments are the caller's, but for some extensions.
    let created = unsafe {
        let names = weak::passed_on(&*info);
        let mut info = *info;
        (info.enabled_extension_count, info.pp_enabled_extension_names) = (names.len() as u32, names.as_ptr());
        transmute::<Function, vk::PFN_vkCreateDevice>(create)(physical, &info, allocator, device)
    };
    if created == R::SUCCESS {
        // SAFETY: the device was just created by the next layer.
        unsafe { device::remember(*device, next_device) };
    }
    created
}
