//! Commands that show, render and compare: requests from the command line, outputs (headset, window, picture file), and
//! camera control.

mod action;
mod app;
mod args;
mod bake;
mod bake_scene;
mod baked_file;
mod compare;
mod control;
pub mod doctor;
mod frame_clock;
#[expect(unsafe_code, reason = "calls OpenVR")]
pub mod headset;
mod interrupt;
mod kept;
mod loader;
mod loading_files;
#[cfg(test)]
mod lost_gpu_tests;
mod measured;
mod memory_watch;
mod needs;
pub(crate) mod panel;
mod playlist;
mod render;
mod request;
mod scene_parts;
mod screenshot;
pub(crate) mod sequence;
mod sequence_files;
mod show;
mod shown_scene;
mod stagings;
mod update;
mod video;
#[expect(unsafe_code, reason = "calls Vulkan and the window system")]
mod window;

pub use args::Choice;
pub use bake::{BAKED, BakeFacts, BakeRequest, bake};
pub use bake_scene::{SceneBakeFacts, bake_scene};
pub use compare::{CompareRequest, compare};
pub use headset::{HiddenAreaV, PROBE_SUBCOMMAND, answer_probe};
pub use loader::{load_scene, load_staged};
pub use measured::MeasuredSettings;
pub use needs::{NeedsRequest, needs};
pub use render::{RenderFacts, RenderRequest, picture_files, render, render_on};
pub use request::{Mirror, On, ViewRequest};
pub use sequence::render_sequence;
pub use show::show;
pub use window::console;
