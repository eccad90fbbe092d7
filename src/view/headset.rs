//! The headset: its pure parts; what they are wired to is in the files of its loop.

pub mod actions;
pub mod frame_statistics;
pub mod quality;
pub mod rig;
