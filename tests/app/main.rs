//! The program from the outside: its command line, the files it reads and writes, its window.
// Helpers outside of `#[test]` functions fail a test by panicking, too.
#![allow(clippy::expect_used, clippy::print_stdout, clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
#[cfg(target_os = "linux")]
#[path = "../desktop/mod.rs"]
mod desktop;

mod assets;
mod bake;
mod cache;
mod causes;
mod cli;
mod exporters;
#[cfg(target_os = "linux")]
mod faults;
#[cfg(target_os = "linux")]
mod file_faults;
#[cfg(target_os = "linux")]
mod killed;
#[cfg(target_os = "linux")]
mod killed_window;
mod ladder;
mod loading;
#[cfg(target_os = "linux")]
mod long_runs;
#[cfg(target_os = "linux")]
mod lost_gpu;
mod measure;
mod needs;
#[cfg(target_os = "linux")]
mod panel;
mod sequences;
mod textures;
#[cfg(target_os = "linux")]
mod weak_gpus;
#[cfg(target_os = "linux")]
mod window;
