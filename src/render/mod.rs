//! Draws frames of a scene for N eyes: culling, forward pass or the reference's samples, sky, resolve; and the user interface.
//!
//! A new binding is a row in `bindings`, the resource in the set that holds it (for a scene, `bound_scene`), and its
//! declaration in a shader. Data of one frame need no binding: a pass pushes them and declares `FRAME_STORAGE`. A new pass
//! is a file of its own with its shaders, a field of `pipelines::PassPipelines`, and a call in `Renderer::record`.

mod bake_sets;
mod baked_light;
#[cfg(test)]
mod baked_light_gpu_tests;
pub mod bindings;
mod bound_scene;
mod culling;
mod draws;
mod edits;
mod emitters;
mod eye;
mod forward;
mod frame;
mod frame_set;
mod gizmos;
mod hidden_area;
mod importance;
mod kept_pipelines;
mod layouts;
mod light_bake;
mod light_detail;
pub(crate) mod light_plan;
mod lighting;
mod lightmap;
mod lightmap_stages;
mod lightmapped;
mod material_code;
mod mirror_picture;
#[cfg(test)]
mod mirror_picture_gpu_tests;
mod output;
mod pace;
mod picker;
mod pipeline_request;
mod pipelines;
mod probe_maps;
mod probes;
#[cfg(test)]
mod probes_gpu_tests;
mod ray_features;
mod ray_scene;
mod ray_textures;
#[cfg(test)]
mod random_gpu_tests;
mod reference_accumulator;
mod renderer;
mod rest;
#[cfg(test)]
mod scatter_gpu_tests;
mod scene_resources;
#[cfg(test)]
mod seam_gpu_tests;
mod settings;
#[cfg(test)]
mod shadow_gpu_tests;
mod shadow_maps;
mod shadow_plan;
mod shared;
#[cfg(test)]
mod shared_gpu_tests;
mod sun_view;
mod surface_pass;
mod targets;
mod texture_request;
mod ui;
mod visible_sky;

pub use draws::{CullOptions, DrawCounts, Order};
pub use edits::{MaterialFactors, SceneEdits};
pub use eye::{Eye, IPD_METRES, NEAR_METRES};
pub use frame::{FRAME_BYTES, FrameInputs};
pub use gizmos::{ControllerGizmos, GizmoVertex, MAX_GIZMO_VERTICES};
pub use kept_pipelines::KeptPipelines;
pub use light_detail::LightDetail;
pub use lighting::Lighting;
pub use lightmap::sides as lightmap_sides;
pub use lightmapped::{LightmapRequest, Lightmapped, is_lightmapped};
pub use mirror_picture::{MirrorPart, MirrorPicture};
pub use output::Output;
pub use pipeline_request::PipelineRequest;
pub use pipelines::PassPipelines;
pub use probe_maps::ProbeMaps;
pub use reference_accumulator::StandardError;
pub use renderer::Renderer;
pub use scene_resources::{Replaced, SceneTextures, TextureFacts, affordable_bytes};
pub use settings::{Change, LightModel, LightPart, RenderSettings, Shading, TextureSettings};
pub use shared::MAX_EYES;
pub use targets::check_size;
pub use texture_request::TextureRequest;
pub use ui::{MAX_TEXTURE_SIDE, UI_BYTES, UiFrame, UiRenderer, UiTarget};

pub use crate::gpu::FRAMES_IN_FLIGHT;
