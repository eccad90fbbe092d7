//! A library for `LD_PRELOAD` that lets one call on files of a folder, or one start of a thread, fail on purpose when a test says so,
//! with an error that the call may return. What drivers and other libraries do elsewhere is left alone.
#![cfg(target_os = "linux")]

mod calls;
mod faults;
mod files;
mod names;
