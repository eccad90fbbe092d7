//! The program on the OpenVR test runtime (tests/headset_runtime), each run in a process of its own.
// Helpers outside of `#[test]` functions fail a test by panicking, too.
#![allow(clippy::expect_used, clippy::print_stdout, clippy::unwrap_used, unsafe_code)]

#[path = "../common/mod.rs"]
mod common;
#[cfg(target_os = "linux")]
#[path = "../desktop/mod.rs"]
mod desktop;

#[cfg(target_os = "linux")]
mod beside_window;
mod dashboard;
#[cfg(target_os = "linux")]
mod faults;
mod hands;
mod held_panel;
#[cfg(target_os = "linux")]
mod long_run;
mod lost_gpu;
mod openvr_loader;
mod session;
mod start;
mod weak_gpu;
