//! `pbr-vr`: physically based materials, lit by panoramas, for the headset and the desktop.
//!
//! The layers, lowest first; each may use those above it in this list and none below (`tests/layers.rs`).

pub mod asset;
pub mod error;
pub mod gpu;
pub mod precompute;
pub mod reference;
pub mod render;
pub mod scene;
pub mod view;

pub use error::{Error, Result};
