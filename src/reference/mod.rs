//! The truth in f64, no Vulkan: BRDF terms, sampling, integrals, colour, picture metrics.
pub mod brdf;
pub mod levels;
