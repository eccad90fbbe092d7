//! Heaps that are smaller than the driver's.

use std::collections::HashMap;
use std::ffi::c_void;
use std::mem::transmute;
use std::sync::Mutex;

use ash::vk::{self, Result as R};

use super::chain::Function;
use super::device::Next;
use super::functions;
use super::weak::Profile;

/// The environment variable with the path of a file that says how much memory there is for the program at the moment, MiB: a
/// budget, as other programs take memory and give it back.
pub const BUDGET: &str = "PBR_VR_FAULT_BUDGET";

/// Bytes of the budget; `None` if there is none.
pub fn budget() -> Option<u64> {
    let text = std::fs::read_to_string(std::env::var_os(BUDGET)?).expect("a budget");
    Some(text.trim().parse::<u64>().expect("MiB") << 20)
}

/// Bytes of each allocation. All heaps count as one, as lavapipe has one only.
static TAKEN: Mutex<Option<HashMap<vk::DeviceMemory, u64>>> = Mutex::new(None);

fn taken() -> u64 {
    TAKEN.lock().expect("no thread has panicked").get_or_insert_default().values().sum()
}

pub fn lower(out: &mut vk::PhysicalDeviceMemoryProperties, heap: Option<u64>) {
    let count = out.memory_heap_count as usize;
    for there in &mut out.memory_heaps[..count] {
        there.size = there.size.min(heap.unwrap_or(u64::MAX));
    }
}

/// The budget's structure, if the caller asks for it.
///
/// # Safety
/// The chain is that of vkGetPhysicalDeviceMemoryProperties2, which has filled it.
pub unsafe fn lower_budget(mut chain: *mut c_void, heap: Option<u64>) {
    let Some(least) = budget().or(heap) else { return };
    while !chain.is_null() {
        // SAFETY: every structure of a chain begins with its kind and the next one, and is what its kind says.
        unsafe {
            let head = *chain.cast::<vk::BaseOutStructure<'_>>();
            if head.s_type == vk::StructureType::PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT {
                let out = &mut *chain.cast::<vk::PhysicalDeviceMemoryBudgetPropertiesEXT<'_>>();
                out.heap_budget = [0; vk::MAX_MEMORY_HEAPS];
                out.heap_usage = [0; vk::MAX_MEMORY_HEAPS];
                out.heap_budget[0] = least.min(heap.unwrap_or(u64::MAX));
                out.heap_usage[0] = taken();
            }
            chain = head.p_next.cast();
        }
    }
}

/// vkAllocateMemory, which fails if there is no room; it may fail by chance, too.
pub unsafe extern "system" fn allocate(
    device: vk::Device,
    info: *const vk::MemoryAllocateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::DeviceMemory,
) -> R {
    let heap = Profile::chosen().and_then(|profile| profile.heap).unwrap_or(u64::MAX);
    // SAFETY: the caller's arguments.
    unsafe {
        let size = (*info).allocation_size;
        if taken() + size > heap {
            return R::ERROR_OUT_OF_DEVICE_MEMORY;
        }
        let call = functions::own(c"vkAllocateMemory").expect("a function that may fail");
        let answer = transmute::<*const c_void, vk::PFN_vkAllocateMemory>(call)(device, info, allocator, out);
        if answer == R::SUCCESS {
            TAKEN.lock().expect("no thread has panicked").get_or_insert_default().insert(*out, size);
        }
        answer
    }
}

pub unsafe extern "system" fn free(
    device: vk::Device,
    memory: vk::DeviceMemory,
    allocator: *const vk::AllocationCallbacks<'_>,
) {
    TAKEN.lock().expect("no thread has panicked").get_or_insert_default().remove(&memory);
    // SAFETY: the caller's arguments, for the next layer's function of this name.
    unsafe {
        let call = Next::of(device).function("vkFreeMemory").expect("a function of Vulkan 1.0");
        transmute::<Function, vk::PFN_vkFreeMemory>(call)(device, memory, allocator);
    }
}
