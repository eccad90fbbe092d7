//! For tests: a GPU under validation.

use std::sync::Arc;

use super::{Gpu, GpuOptions};

/// Opens a GPU for `work`; any validation message fails, those of closing it too.
pub fn with_gpu<R>(work: impl FnOnce(&Arc<Gpu>) -> R) -> R {
    let gpu = Gpu::open(GpuOptions { validate: true, ..GpuOptions::default() }).unwrap();
    let messages = gpu.messages();
    let result = work(&gpu);
    assert!(Arc::into_inner(gpu).is_some(), "something keeps the GPU open");
    messages.check().unwrap();
    result
}
