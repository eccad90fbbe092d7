//! For tests: a GPU under validation, and one that runs out of memory when a test says so.

use std::cell::Cell;
use std::sync::{Arc, Mutex};

use ash::vk;

use super::{Gpu, GpuOptions};

#[path = "../../tests/common/gpus.rs"]
mod gpus;
use gpus::TestGpu;

thread_local! {
    /// Whether this thread finds no memory for images, on a GPU of [`with_gpu_of_little_memory`].
    pub static NO_IMAGES: Cell<bool> = const { Cell::new(false) };
}

/// The function below this one, which all devices have in common while there are any: with the last one the loader unloads
/// layers and driver, and their next place is another.
static BIND_IMAGE: Mutex<Option<vk::PFN_vkBindImageMemory>> = Mutex::new(None);

unsafe extern "system" fn bind_image(
    device: vk::Device,
    image: vk::Image,
    memory: vk::DeviceMemory,
    offset: vk::DeviceSize,
) -> vk::Result {
    let below = *BIND_IMAGE.lock().unwrap();
    match below {
        // SAFETY: the function of a device that lives, which the caller has, with the caller's arguments.
        Some(bind) if !NO_IMAGES.get() => unsafe { bind(device, image, memory, offset) },
        _ => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
    }
}

/// Takes a GPU for `work`; any validation message fails.
pub fn with_gpu<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    work(&TestGpu::take())
}

/// The same with a new GPU that has no memory for images of threads whose [`NO_IMAGES`] is set.
pub fn with_gpu_of_little_memory<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    let mut gpu = Gpu::open(validated()).unwrap();
    Arc::get_mut(&mut gpu).unwrap().device.replace(|device| {
        *BIND_IMAGE.lock().unwrap() = Some(device.bind_image_memory);
        device.bind_image_memory = bind_image;
    });
    let result = work(&gpu);
    gpus::close(gpu);
    result
}

fn validated() -> GpuOptions<'static> {
    GpuOptions { validate: true, ..GpuOptions::default() }
}
