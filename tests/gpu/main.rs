//! What the renderer computes on a GPU (lavapipe unless PBR_VR_TEST_GPU is set), called as a library.
// Helpers outside of `#[test]` functions fail a test by panicking, too.
#![allow(clippy::expect_used, clippy::print_stdout, clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;

mod anisotropy;
mod blending;
mod clearcoat;
mod damaged;
mod diffuse_transmission;
mod draws;
mod edits;
mod emission;
mod extension_maps;
mod model_lights;
mod models;
mod reference;
mod refraction;
mod shadows;
mod sheen;
mod hands;
mod light;
mod lightmap;
mod pictures;
mod precompute;
mod probes;
mod sphere_lights;
mod split_sum;
mod stability;
mod stability_jitter;
mod stability_view;
mod stability_walk;
mod steady_state;
mod sun;
mod tangents;
mod texture_settings;
mod transport;
mod windows;
