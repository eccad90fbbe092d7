//! The only place that calls Vulkan: device, memory, images, buffers, pipelines, barriers, timers, readback.
