//! For tests: a GPU under validation, and one that runs out of memory when a test says so.

use std::cell::Cell;
use std::sync::{Arc, Mutex};

use ash::vk;

use super::{Gpu, GpuOptions};

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

/// Opens a GPU for `work`; any validation message fails, those of closing it too.
pub fn with_gpu<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    run(open(), work)
}

/// The same with a GPU that has no memory for images of threads whose [`NO_IMAGES`] is set.
pub fn with_gpu_of_little_memory<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    let mut gpu = open();
    Arc::get_mut(&mut gpu).unwrap().device.replace(|device| {
        *BIND_IMAGE.lock().unwrap() = Some(device.bind_image_memory);
        device.bind_image_memory = bind_image;
    });
    run(gpu, work)
}

fn open() -> Arc<Gpu> {
    Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap()
}

fn run<R>(gpu: Arc<Gpu>, work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    let messages = gpu.messages();
    let result = work(&gpu);
    assert!(Arc::into_inner(gpu).is_some(), "something keeps the GPU open");
    messages.check().unwrap();
    result
}
