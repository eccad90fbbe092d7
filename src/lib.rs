//! `pbr-vr`: physically based materials, lit by panoramas, for the headset and the desktop.
//!
//! The layers, lowest first; each may use those above it in this list and none below (`layers_tests`).

pub mod error;
pub mod reference;
pub mod asset;
pub mod args;
pub mod scene;
#[expect(unsafe_code, reason = "calls Vulkan")]
pub mod gpu;
pub mod context;
pub mod precompute;
pub mod render;
pub mod view;
pub mod measure;

pub use error::{Error, Result};

#[cfg(test)]
#[path = "../tests/fuzz/mod.rs"]
mod fuzz_tests;
#[cfg(test)]
mod layers_tests;
